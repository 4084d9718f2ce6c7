// The robot in space on the console's page. A worker draws it (`space.js`); here are the canvas, what
// turns it, and its colours, which are the page's.
import { html, say } from "./dom.js";

/** Names of colours in a drawing, and the page's tokens. */
const COLOURS = { sky: "--panel", ground: "--r-ground", line: "--r-edge", body: "--r-body", end: "--r-body-end", barrel: "--r-barrel", rod: "--r-rod", tyre: "--r-tyre", rim: "--r-rim", force: "--asked" };
const LOW = 0.05;
const HIGH = 1.5;

/** Red, green and blue from 0 to 1, of a colour as `#rrggbb`. @param {string} text */
const rgb = (text) => [1, 3, 5].map((at) => parseInt(text.trim().slice(at, at + 2), 16) / 255);

/** @param {import("./shape.js").Geometry} geometry @param {import("./space.js").Relief | null} relief */
export function view3d(geometry, relief) {
  const canvas = html("canvas", { class: "space", tabindex: 0, role: "img", "aria-label": "Robot in space; drag or arrow keys turn it, plus and minus zoom" });
  const note = html("p", { class: "effect bad", role: "status", hidden: true });
  const root = html("div", { class: "space-box" }, canvas, note);
  const fail = (why) => {
    canvas.hidden = true;
    note.hidden = false;
    say(note, `No view in space: ${why}.`);
  };
  if (!canvas.transferControlToOffscreen) {
    fail("this browser cannot draw in a worker");
    return { root, update() {} };
  }
  const worker = new Worker(new URL("space.js", import.meta.url), { type: "module" });
  worker.onmessage = ({ data }) => fail(data.failed);
  worker.onerror = () => fail("its worker did not start");
  const offscreen = canvas.transferControlToOffscreen();
  worker.postMessage({ canvas: offscreen, geometry, relief }, [offscreen]);

  const colour = () => {
    const style = getComputedStyle(document.documentElement);
    worker.postMessage({ colours: Object.fromEntries(Object.entries(COLOURS).map(([name, token]) => [name, rgb(style.getPropertyValue(token))])) });
  };
  colour();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", colour);
  new ResizeObserver(([entry]) => {
    const { width, height } = entry.contentRect;
    worker.postMessage({ size: [width, height].map((v) => Math.max(1, Math.round(v * devicePixelRatio))) });
  }).observe(canvas);

  const camera = { turn: -0.9, height: 0.35, distance: 2300 };
  const look = (turn, height, zoom) => {
    camera.turn += turn;
    camera.height = Math.min(HIGH, Math.max(LOW, camera.height + height));
    camera.distance = Math.min(9000, Math.max(700, camera.distance * zoom));
    worker.postMessage({ camera });
  };
  look(0, 0, 1);
  canvas.addEventListener("pointerdown", (down) => canvas.setPointerCapture(down.pointerId));
  canvas.addEventListener("pointermove", (move) => {
    if (move.buttons & 1) look(-0.008 * move.movementX, 0.006 * move.movementY, 1);
  });
  canvas.addEventListener("wheel", (wheel) => {
    if (wheel.ctrlKey) return;
    wheel.preventDefault();
    look(0, 0, Math.exp(0.001 * wheel.deltaY));
  }, { passive: false });
  const keys = { ArrowLeft: [0.1, 0, 1], ArrowRight: [-0.1, 0, 1], ArrowUp: [0, 0.08, 1], ArrowDown: [0, -0.08, 1], "+": [0, 0, 0.85], "-": [0, 0, 1.18] };
  canvas.addEventListener("keydown", (key) => {
    const step = keys[key.key];
    // The browser's own zoom and history stay the browser's.
    if (!step || key.ctrlKey || key.altKey || key.metaKey) return;
    key.preventDefault();
    look(step[0], step[1], step[2]);
  });
  return {
    root,
    /** @param {import("./solids.js").SpacePose} pose */
    update(pose) {
      worker.postMessage({ pose });
    },
  };
}
