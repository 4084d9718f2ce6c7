// A filmstrip: the robot on its ground in the middle of every swing, side by side.
import { html, svg, fixed } from "./dom.js";
import { trackHeights } from "./ground.js";
import { sideView } from "./robot.js";

/** Frames of a strip, at most: of a longer walk they lie evenly over it. */
const FRAMES = 12;
/** Fewer swings make no strip. */
const FEWEST = 3;
/** A foot with less load is in the air, N. */
const LOADED_N = 1;
/** Shorter times in the air are bounces, s. */
const SWING_S = 0.2;

/** Middle of each time in which a foot is in the air, both feet in one order.
 * @param {number[]} t s @param {number[][]} load_n @returns {number[]} s */
export function swings(t, load_n) {
  const found = [];
  for (const load of load_n) {
    let since = -1;
    for (let k = 0; k < t.length; k += 1) {
      if (load[k] < LOADED_N) {
        if (since < 0) since = k;
      } else {
        if (since > 0 && t[k] - t[since] >= SWING_S) found.push((t[since] + t[k]) / 2);
        since = -1;
      }
    }
  }
  return found.sort((a, b) => a - b);
}

/** Draws the strip; each frame leads the robot of the page to its time.
 * @param {HTMLElement} place @param {{t: number[], load_n: number[][], geometry: import("./robot.js").Geometry, ground?: import("./ground.js").Ground}} motion
 * @param {(t: number) => import("./robot.js").Pose} poseAt @param {(t: number) => void} goTo */
export function showFilm(place, motion, poseAt, goTo) {
  const all = swings(motion.t, motion.load_n);
  if (all.length < FEWEST) return;
  const count = Math.min(FRAMES, all.length);
  const heights = motion.ground && trackHeights(motion.geometry, motion.ground);
  const strip = html("div", { class: "strip", role: "group", "aria-label": "Frames of the walk" });
  for (let i = 0; i < count; i += 1) {
    const t = all[Math.round((i * (all.length - 1)) / Math.max(1, count - 1))];
    const picture = svg("svg");
    const now = poseAt(t);
    sideView(picture, motion.geometry, heights).update(now);
    const label = `${fixed(t, 1)} s, ${fixed(now.travel_mm / 1000, 2)} m`;
    strip.append(html("div", { class: "frame" }, picture, html("button", { type: "button", class: "num", onclick: () => goTo(t) }, label)));
  }
  place.append(html("h2", {}, "Filmstrip"), html("p", {}, `${count} of ${all.length} swings, each in its middle. Click a frame to go to its time.`), strip);
  place.hidden = false;
}
