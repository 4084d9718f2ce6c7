// Plots of curves over time, on a canvas. One cursor is linked over all plots of a page: it is the
// time of the Player. A drag across a plot zooms all of them, a double click shows everything again.
import { html, say, fixed } from "./dom.js";
import { linear } from "./signal.js";
import { stepByKey } from "./transport.js";

/** @typedef {{label: string, colour: string, width: number, x: number[], y: Array<number | null>}} Series */
/** @typedef {{title: string, unit: string, x_label: string, x: [number, number], y: [number, number],
 *   series: Series[], limits: number[], marks: number[], marked: string, height: number}} Panel */

/** The bottom has room for the numbers of the abscissa, and below them its name. */
const PAD = { left: 52, right: 12, top: 8, bottom: 36 };
const ZOOM_PX = 6;

/** A token of the page's style. @param {string} name */
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Colour of the page's scheme for one of `plot/colour.rs`. @param {string} colour */
const shade = (colour) => css(`--c-${colour.slice(1)}`) || colour;

/** Plots that show the same span of time. */
export class Linked {
  /** @param {import("./player.js").Player | null} player */
  constructor(player) {
    this.player = player;
    /** @type {Plot[]} */
    this.plots = [];
    /** @type {[number, number] | null} */
    this.zoom = null;
  }

  /** @param {[number, number] | null} range s; null for everything */
  show(range) {
    this.zoom = range;
    for (const plot of this.plots) plot.draw();
  }

  redraw() {
    for (const plot of this.plots) plot.draw();
  }
}

export class Plot {
  /** @param {Panel} panel @param {Linked} linked plots that share cursor and zoom @param {"h3" | "h4"} heading */
  constructor(panel, linked, heading = "h4") {
    this.panel = panel;
    this.linked = linked;
    this.width = 0;
    this.height = 0;
    /** @type {number | null} */
    this.from = null;
    linked.plots.push(this);
    const player = linked.player;

    this.values = panel.series.map(() => html("b", { class: "num" }, "–"));
    const legend = panel.series.map((s, i) => s.label && html("span", { class: "key" }, html("i", { style: `border-color:var(--c-${s.colour.slice(1)}, ${s.colour});border-top-width:${s.width + 0.5}px` }), s.label, " ", this.values[i]));
    if (panel.limits.length > 0) legend.push(html("span", { class: "key" }, html("i", { class: "limit" }), "limit"));
    if (panel.marks.length > 0) legend.push(html("span", { class: "key" }, html("i", { class: "event" }), panel.marked));

    this.canvas = html("canvas", { "aria-hidden": "true" });
    this.cursor = html("div", { class: "cursor", hidden: true });
    this.span = html("div", { class: "span", hidden: true });
    this.area = html(
      "div",
      { class: "plot-area", style: `height:${Math.max(120, Math.min(260, panel.height)) + PAD.bottom}px`, tabindex: 0, role: "slider", "aria-label": `${panel.title}, ${panel.x_label}`, "aria-valuemin": panel.x[0], "aria-valuemax": panel.x[1], "aria-valuenow": panel.x[0] },
      this.canvas,
      this.span,
      this.cursor,
    );
    this.root = html("section", { class: "plot" }, html("header", {}, html(heading, {}, panel.title, html("span", { class: "unit" }, ` ${panel.unit}`)), html("div", { class: "legend" }, legend)), this.area);

    new ResizeObserver(([entry]) => {
      this.width = entry.contentRect.width;
      this.height = entry.contentRect.height;
      this.draw();
    }).observe(this.area);
    this.listen();
    player?.on((t) => this.at(t));
  }

  /** Time at a place of the screen, s. @param {number} clientX */
  time(clientX) {
    const [a, b] = this.range();
    const px = clientX - this.area.getBoundingClientRect().left - PAD.left;
    return a + (px / this.inner()) * (b - a);
  }

  range() {
    return this.linked.zoom ?? this.panel.x;
  }

  inner() {
    return Math.max(1, this.width - PAD.left - PAD.right);
  }

  listen() {
    const { area, linked } = this;
    const point = (event) => linked.player?.hold(this.time(event.clientX));
    area.addEventListener("pointerdown", (event) => {
      area.setPointerCapture(event.pointerId);
      this.from = event.clientX;
      point(event);
    });
    area.addEventListener("pointermove", (event) => {
      if (event.buttons && this.from != null) this.mark(event.clientX);
      else if (event.pointerType === "mouse" && !linked.player?.playing) point(event);
    });
    area.addEventListener("pointerup", (event) => {
      const from = this.from;
      this.from = null;
      this.span.hidden = true;
      if (from == null || Math.abs(event.clientX - from) < ZOOM_PX) return;
      const [a, b] = [this.time(from), this.time(event.clientX)].sort((x, y) => x - y);
      const [low, high] = this.panel.x;
      const range = [Math.max(low, a), Math.min(high, b)];
      if (range[1] - range[0] > 1e-3) linked.show(/** @type {[number, number]} */ (range));
    });
    area.addEventListener("dblclick", () => linked.show(null));
    area.addEventListener("keydown", (event) => {
      if (event.key === "Escape") linked.show(null);
      else if (linked.player && stepByKey(linked.player, event)) event.preventDefault();
    });
  }

  /** Shows what a drag would zoom to. @param {number} clientX */
  mark(clientX) {
    const left = this.area.getBoundingClientRect().left;
    const [a, b] = [/** @type {number} */ (this.from) - left, clientX - left].sort((x, y) => x - y);
    this.span.hidden = b - a < ZOOM_PX;
    this.span.style.left = `${a}px`;
    this.span.style.width = `${b - a}px`;
  }

  /** Moves the cursor. @param {number} t s */
  at(t) {
    const [a, b] = this.range();
    this.cursor.hidden = t < a || t > b || this.width === 0;
    this.cursor.style.transform = `translateX(${(PAD.left + ((t - a) / (b - a)) * this.inner()).toFixed(1)}px)`;
    // Channels begin one after the other: a first sample less than a pixel ahead is under the cursor.
    const pixel = (b - a) / Math.max(1, this.inner());
    const under = (x) => (t < x[0] && x[0] - t < pixel ? x[0] : t);
    this.panel.series.forEach((s, i) => say(this.values[i], fixed(linear(s.x, s.y, under(s.x)), decimals(this.panel.y))));
    this.area.setAttribute("aria-valuenow", t.toFixed(2));
  }

  draw() {
    if (this.width === 0) return;
    const { panel, canvas, width, height } = this;
    const scale = Math.min(2, window.devicePixelRatio || 1);
    canvas.width = width * scale;
    canvas.height = height * scale;
    const g = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    g.setTransform(scale, 0, 0, scale, 0, 0);
    const [x0, x1] = this.range();
    const [y0, y1] = panel.y;
    const inner = { w: this.inner(), h: height - PAD.top - PAD.bottom };
    const X = (t) => PAD.left + ((t - x0) / (x1 - x0)) * inner.w;
    const Y = (v) => PAD.top + (1 - (v - y0) / (y1 - y0)) * inner.h;
    const line = (ax, ay, bx, by) => {
      g.beginPath();
      g.moveTo(ax, ay);
      g.lineTo(bx, by);
      g.stroke();
    };

    g.font = `11px ${css("--font")}`;
    g.textBaseline = "middle";
    g.lineWidth = 1;
    g.strokeStyle = css("--line");
    g.fillStyle = css("--ink-3");
    g.textAlign = "right";
    for (const v of ticks(y0, y1, Math.max(3, inner.h / 45))) {
      line(PAD.left, Math.round(Y(v)) + 0.5, width - PAD.right, Math.round(Y(v)) + 0.5);
      g.fillText(short(v), PAD.left - 6, Y(v));
    }
    g.textAlign = "center";
    for (const t of ticks(x0, x1, Math.max(3, inner.w / 80))) {
      line(Math.round(X(t)) + 0.5, PAD.top + inner.h, Math.round(X(t)) + 0.5, PAD.top + inner.h + 4);
      g.fillText(short(t), Math.min(X(t), width - 16), PAD.top + inner.h + 13);
    }
    g.fillText(panel.x_label, PAD.left + inner.w / 2, PAD.top + inner.h + 28, inner.w + PAD.left);

    g.save();
    g.beginPath();
    g.rect(PAD.left, PAD.top - 2, inner.w, inner.h + 4);
    g.clip();
    g.lineJoin = "round";
    g.strokeStyle = css("--alarm");
    g.setLineDash([2, 3]);
    for (const v of panel.limits) if (v > y0 && v < y1) line(PAD.left, Y(v), PAD.left + inner.w, Y(v));
    g.setLineDash([6, 3]);
    for (const t of panel.marks) line(X(t), PAD.top, X(t), PAD.top + inner.h);
    g.setLineDash([]);
    for (const s of panel.series) {
      g.strokeStyle = shade(s.colour);
      g.lineWidth = s.width + 0.25;
      g.beginPath();
      // A value that does not exist is a gap, never a line across it.
      s.x.forEach((t, i) => {
        const value = s.y[i];
        if (value == null) return;
        if (i === 0 || s.y[i - 1] == null) g.moveTo(X(t), Y(value));
        else g.lineTo(X(t), Y(value));
      });
      g.stroke();
    }
    g.restore();
    if (this.linked.player) this.at(this.linked.player.t);
  }
}

/** Fewer numbers tell too little of an axis. */
const FEWEST_TICKS = 3;

/** Round values between two ends, about `count` of them. */
function ticks(low, high, count) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const steps = [0.5, 1, 2, 5, 10].map((f) => f * power);
  const chosen = Math.max(1, steps.findIndex((step) => step >= rough));
  /** Counted, because of a range without sense no step might lead to its end. @param {number} step */
  const every = (step) => {
    const found = [];
    for (let i = Math.ceil(low / step - 1e-6); i * step <= high + step * 1e-6 && found.length <= 3 * count; i += 1) found.push(i * step);
    return found;
  };
  const values = every(steps[chosen]);
  return values.length >= FEWEST_TICKS ? values : every(steps[chosen - 1]);
}

const short = (v) => {
  const text = String(Number(v.toPrecision(6)));
  return text.startsWith("-") ? `−${text.slice(1)}` : text;
};

/** Decimals that tell a thousandth of an axis apart. */
const decimals = ([low, high]) => Math.max(0, Math.min(3, Math.ceil(2 - Math.log10(Math.abs(high - low) || 1)) + 1));
