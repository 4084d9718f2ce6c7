// Plots as a picture: their curves as they are drawn, with title, unit and legend, which on a page stand beside them.
const HEAD = 26;
const GAP = 10;
const MARGIN = 12;
const LINE = 18;

/** @param {import("./plot.js").Plot[]} plots one below the other @returns {Promise<Blob | null>} none where there is nothing to see */
export function picture(plots) {
  const seen = plots.filter(({ width, height }) => width > 0 && height > 0);
  if (seen.length === 0) return Promise.resolve(null);
  const style = getComputedStyle(document.documentElement);
  const css = (name) => style.getPropertyValue(name).trim();
  const scale = Math.max(...seen.map(({ canvas, width }) => canvas.width / width));
  const width = Math.max(...seen.map((plot) => plot.width)) + 2 * MARGIN;
  const height = seen.reduce((sum, plot) => sum + HEAD + plot.height + GAP, MARGIN);
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [Math.round(width * scale), Math.round(height * scale)];
  const g = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  g.scale(scale, scale);
  g.fillStyle = css("--panel");
  g.fillRect(0, 0, width, height);
  g.textBaseline = "middle";
  let y = MARGIN;
  for (const plot of seen) {
    const { title, unit, series } = plot.panel;
    const middle = y + HEAD / 2;
    g.font = `600 13px ${css("--font")}`;
    g.fillStyle = css("--ink");
    const heading = `${title} [${unit}]`;
    g.fillText(heading, MARGIN, middle);
    let x = MARGIN + g.measureText(heading).width + LINE;
    g.font = `12px ${css("--font")}`;
    for (const { label, colour, width: thick } of series) {
      g.strokeStyle = css(`--c-${colour.slice(1)}`) || colour;
      g.lineWidth = thick + 0.5;
      g.beginPath();
      g.moveTo(x, middle);
      g.lineTo(x + LINE, middle);
      g.stroke();
      g.fillText(label, x + LINE + 4, middle);
      x += LINE + 4 + g.measureText(label).width + LINE;
    }
    g.drawImage(plot.canvas, MARGIN, y + HEAD, plot.width, plot.height);
    y += HEAD + plot.height + GAP;
  }
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}
