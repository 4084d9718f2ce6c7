// A report: its figures drawn from their data, and the robot that plays what the log holds. The
// pictures in the page stay for paper and for readers without scripts.
import { html, svg, say, fixed } from "./dom.js";
import { held, linear } from "./signal.js";
import { Player } from "./player.js";
import { transport } from "./transport.js";
import { Linked, Plot } from "./plot.js";
import { trackHeights } from "./ground.js";
import { footView, sideView, topView } from "./robot.js";
import { showFilm } from "./film.js";

/** @typedef {{geometry: import("./robot.js").Geometry, t: number[], start: number, end: number,
 *   commanded_mm: number[][], sensed_mm: number[][], load_n: number[][], switches: number[][],
 *   travel_mm: number[], pitch_deg: number[], y_mm: number[], z_mm: number[], yaw_deg: number[], supply_bar: number[],
 *   ground?: import("./ground.js").Ground,
 *   blind: {joint: number, from: number, to: number}[],
 *   phases: import("./transport.js").Phase[], marks: import("./transport.js").Mark[]}} Motion */

/** Whether a joint has no reading at a time. @param {Motion} m @param {number} joint @param {number} t s */
const isBlind = (m, joint, t) => m.blind.some((b) => b.joint === joint && t >= b.from && t <= b.to);

/** State of the robot at a time. @param {Motion} m @param {number} t s @returns {import("./robot.js").Pose} */
function pose(m, t) {
  const value = (values) => linear(m.t, values, t) ?? held(m.t, values, t);
  const strokes = (joints, first, read) => /** @type {[number, number, number]} */ ([0, 1, 2].map((i) => read(joints[first + i])));
  const legState = (side) => ({
    commanded_mm: strokes(m.commanded_mm, 3 * side, (v) => held(m.t, v, t)),
    sensed_mm: strokes(m.sensed_mm, 3 * side, value),
    load_n: value(m.load_n[side]),
    switches: held(m.t, m.switches[side], t),
    blind: [0, 1, 2].some((i) => isBlind(m, 3 * side + i, t)),
  });
  const place = { y_mm: value(m.y_mm), z_mm: value(m.z_mm), yaw_deg: value(m.yaw_deg) };
  return { travel_mm: value(m.travel_mm), pitch_deg: value(m.pitch_deg), ...place, legs: [legState(0), legState(1)] };
}

/** The robot with its transport, below which everything follows. @param {HTMLElement} place @param {Motion} motion @param {Player} player */
function showMotion(place, motion, player) {
  const pictures = { side: svg("svg"), top: svg("svg"), left: svg("svg"), right: svg("svg") };
  const side = sideView(pictures.side, motion.geometry, motion.ground && trackHeights(motion.geometry, motion.ground));
  const top = topView(pictures.top, motion.geometry, motion.ground);
  const feet = [footView(pictures.left, "Left"), footView(pictures.right, "Right")];
  const readings = html("dl", { class: "readings" });
  const reading = (name) => {
    const value = html("dd", { class: "num" });
    readings.append(html("div", {}, html("dt", {}, name), value));
    return value;
  };
  const read = {
    phase: reading("Phase"),
    horizontal: reading("Joint 2 (left horizontal)"),
    vertical: reading("Joint 3 (left vertical)"),
    travel: reading("Travelled"),
    air: reading("Air, absolute"),
  };
  place.append(
    html(
      "div",
      { class: "stage" },
      html("div", { class: "view" }, pictures.side, html("p", { class: "keys" }, html("span", { class: "asked-key" }, "asked"), html("span", { class: "sensed-key" }, "sensed"))),
      html("div", { class: "beside" }, html("div", { class: "plan" }, pictures.top), html("div", { class: "feet" }, html("figure", {}, pictures.left, "left foot"), html("figure", {}, pictures.right, "right foot")), readings),
    ),
    transport(player, motion),
  );
  player.on((t) => {
    const now = pose(motion, t);
    side.update(now);
    top.update(now);
    now.legs.forEach((state, i) => feet[i].update(state));
    say(read.phase, motion.phases.find((p) => t >= p.from && t < p.to)?.name ?? "stands");
    const stroke = (joint) => (isBlind(motion, joint, t) ? "no reading" : `${fixed(now.legs[0].sensed_mm[joint])} mm`);
    say(read.horizontal, stroke(1));
    say(read.vertical, stroke(2));
    say(read.travel, `${fixed(now.travel_mm / 1000, 3)} m`);
    say(read.air, `${fixed(linear(motion.t, motion.supply_bar, t) ?? held(motion.t, motion.supply_bar, t))} bar`);
  });
  place.hidden = false;
}

/** Draws every panel that has its data; its picture stays for print. @param {Player | null} clock */
function showFigures(clock) {
  const shared = clock && new Linked(clock);
  for (const figure of document.querySelectorAll("figure")) {
    /** Plots over the same abscissa that is not the clock. @type {Map<string, Linked>} */
    const own = new Map();
    for (const data of figure.querySelectorAll('script[type="application/json"]')) {
      const panel = JSON.parse(data.textContent ?? "");
      let linked = panel.on_clock ? shared : null;
      if (!linked) {
        linked = own.get(panel.x_label) ?? null;
      }
      if (!linked) {
        // In the middle most curves have a value, at an end few.
        const player = new Player(panel.x[0], panel.x[1]);
        player.seek((panel.x[0] + panel.x[1]) / 2);
        linked = new Linked(player);
        own.set(panel.x_label, linked);
      }
      const plot = new Plot(panel, linked);
      const frame = /** @type {HTMLElement} */ (data.parentElement);
      frame.append(plot.root);
      frame.classList.add("drawn");
      groups.add(linked);
    }
  }
}

/** @type {Set<Linked>} */
const groups = new Set();
const place = document.getElementById("motion-view");
const source = document.getElementById("motion-data");
/** @type {Player | null} */
let clock = null;
if (place && source) {
  /** @type {Motion} */
  const motion = JSON.parse(source.textContent ?? "");
  clock = new Player(motion.start, motion.end);
  showMotion(place, motion, clock);
  // The first instant at which there are samples.
  clock.seek(motion.t[0]);
  const film = document.getElementById("film");
  const player = clock;
  const goTo = (t) => {
    player.hold(t);
    place.scrollIntoView({ block: "center" });
  };
  if (film) showFilm(film, motion, (t) => pose(motion, t), goTo);
}
showFigures(clock);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => groups.forEach((g) => g.redraw()));
for (const button of document.querySelectorAll("[data-seek]")) {
  const target = /** @type {HTMLElement} */ (button);
  target.hidden = clock === null;
  target.addEventListener("click", () => {
    clock?.hold(Number(target.dataset.seek));
    place?.scrollIntoView({ block: "center" });
  });
}
// A filter over the bodies of a table.
for (const input of document.querySelectorAll("input[data-filter]")) {
  const field = /** @type {HTMLInputElement} */ (input);
  const table = /** @type {HTMLTableElement} */ (document.getElementById(field.dataset.filter ?? ""));
  /** @type {HTMLElement} */ (field.closest(".filter")).hidden = false;
  field.addEventListener("input", () => {
    const wanted = field.value.toLowerCase();
    for (const body of table.tBodies) body.hidden = !(body.textContent ?? "").toLowerCase().includes(wanted);
  });
}
// A link into a folded table opens it.
for (const link of document.querySelectorAll('a[href^="#"]')) {
  link.addEventListener("click", () => {
    const target = document.getElementById((link.getAttribute("href") ?? "#").slice(1));
    const folded = target?.matches("details") ? target : target?.closest("details");
    if (folded instanceof HTMLDetailsElement) folded.open = true;
  });
}
// What is folded is not lost on paper.
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => (d.open = true)));
