// The robot in space on the console's page. A worker draws it (`space.js`); here are the canvas, what
// turns it, and its colours, which are the page's. The worker has one pose at a time: the next goes to it
// when it has drawn that. A picture that is late says so.
import { html, say, fixed, sign } from "./dom.js";

/** Names of colours in a drawing, and the page's tokens. */
const COLOURS = { sky: "--panel", ground: "--r-ground", line: "--r-far", edge: "--ink-3", body: "--s-body", end: "--s-end", barrel: "--s-barrel", rod: "--r-rod", tyre: "--r-tyre", rim: "--s-rim", force: "--asked" };
const LOW = 0.05;
const HIGH = 1.5;
/** A pose that is not drawn for so long is told, ms: as on the whole page. */
const LATE_MS = 300;

/** Red, green and blue from 0 to 1, of a colour as `#rrggbb`. @param {string} text */
const rgb = (text) => [1, 3, 5].map((at) => parseInt(text.trim().slice(at, at + 2), 16) / 255);

/** @param {import("./shape.js").Geometry} geometry @param {import("./space.js").Relief | null} relief
 * @param {(why: string) => void} failed there is no picture any more
 * @throws {Error} if this browser cannot draw it */
export function view3d(geometry, relief, failed) {
  // It is moved by keys, and has no text: for who cannot see it the flat views' titles are there.
  const canvas = html("canvas", { class: "space", tabindex: 0, role: "application", "aria-roledescription": "view", "aria-label": "Robot in space: arrow keys turn it, plus and minus zoom" });
  const age = html("span");
  const late = html("p", { class: "late", hidden: true }, sign("stale"), age);
  const root = html("div", { class: "space-box" }, canvas, late);
  if (!canvas.transferControlToOffscreen) throw new Error("this browser cannot draw in a worker");
  const worker = new Worker(new URL("space.js", import.meta.url), { type: "module" });
  const scheme = matchMedia("(prefers-color-scheme: dark)");
  /** Number of the newest pose that was sent, and when; no time: it is drawn. */
  let number = 0;
  /** @type {number | null} */
  let sent_ms = null;
  /** The newest pose, if it waits for the one before. @type {import("./solids.js").SpacePose | null} */
  let next = null;
  const send = (pose) => {
    number += 1;
    sent_ms = performance.now();
    next = null;
    worker.postMessage({ pose, number });
  };
  const fail = (why) => {
    worker.terminate();
    scheme.removeEventListener("change", colour);
    root.remove();
    failed(why);
  };
  worker.onmessage = ({ data }) => {
    if (data.failed) fail(data.failed);
    if (data.drawn !== number) return;
    sent_ms = null;
    if (next) send(next);
  };
  worker.onerror = () => fail("its worker did not start");
  const offscreen = canvas.transferControlToOffscreen();
  worker.postMessage({ canvas: offscreen, geometry, relief }, [offscreen]);

  function colour() {
    const style = getComputedStyle(document.documentElement);
    worker.postMessage({ colours: Object.fromEntries(Object.entries(COLOURS).map(([name, token]) => [name, rgb(style.getPropertyValue(token))])) });
  }
  colour();
  scheme.addEventListener("change", colour);
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
    /** Called as often as the page draws. @param {import("./solids.js").SpacePose} pose */
    update(pose) {
      if (sent_ms === null) send(pose);
      else next = pose;
      const waits_ms = performance.now() - (sent_ms ?? Infinity);
      late.hidden = waits_ms <= LATE_MS;
      root.classList.toggle("is-late", !late.hidden);
      if (!late.hidden) say(age, ` This picture is ${fixed(waits_ms / 1000)} s old.`);
    },
  };
}
