// The ground below the robot, from its side and from above (mm).
import { svg, set, say, fixed } from "./dom.js";
import { oblique, points, tenth } from "./projection.js";
import { SIDES } from "./shape.js";

/** Heights along both wheels' tracks; middle, half axes and heading of each rock; corners of blocks.
 * World axes as those of robot.js at the start.
 * @typedef {{from_mm: number, step_mm: number, left_mm: number[], right_mm: number[],
 *   rocks: [number, number, number, number, number][], blocks: [number, number][][]}} Ground */
/** Height of the ground, so far ahead of the middle of the axle and to its left; not a number where nobody knows it.
 * @typedef {(pose: import("./robot.js").Pose, ahead: number, left: number) => number} Heights */
/** Where a foot is: ahead, left, and above the ground under the axle.
 * @typedef {[number, number, number]} FootPlace */

/** How far below the ground it is drawn. */
const DEEP_MM = 900;
/** What is drawn behind and ahead of the axle, more than any picture shows. */
const DRAWN_MM = [-1000, 1600];
const DRAWN_STEP_MM = 10;
/** Between two marks of the distance. */
const MARK_MM = 500;
/** Begin of the picture, and where a label begins at the latest: none is cut off at the edge. */
const LABELS_MM = [-392, 730];
/** Nor below. */
const LOWEST_LABEL_MM = 116;
/** A foot that is higher above the ground has no shadow. */
const SHADOW_MM = 120;

/** Between neighbours in a row. @param {ArrayLike<number | null>} row @param {number} at */
function between(row, at) {
  const k = Math.max(0, Math.min(row.length - 2, Math.floor(at)));
  const [a, b] = [row[k] ?? NaN, row[k + 1] ?? NaN];
  return at < 0 || at > row.length - 1 ? NaN : a + (b - a) * (at - k);
}

/** Those of tracks: on a straight way. @param {{track_mm: number}} g @param {Ground} ground @returns {Heights} */
export function trackHeights(g, ground) {
  return (pose, ahead, left) => {
    const at = (pose.travel_mm + ahead - ground.from_mm) / ground.step_mm;
    const share = Math.max(0, Math.min(1, 0.5 + left / g.track_mm));
    return (1 - share) * between(ground.right_mm, at) + share * between(ground.left_mm, at);
  };
}

/** Those of a grid: wherever the robot heads. @param {import("./space.js").Relief} grid @returns {Heights} */
export function reliefHeights(grid) {
  const { from_mm: from, step_mm: step, columns, heights_mm: heights } = grid;
  const rows = [];
  for (let first = 0; first < heights.length; first += columns) rows.push(heights.slice(first, first + columns));
  return (pose, ahead, left) => {
    const yaw = ((pose.yaw_deg ?? 0) * Math.PI) / 180;
    const x = (pose.travel_mm + ahead * Math.cos(yaw) - left * Math.sin(yaw) - from[0]) / step;
    const y = ((pose.y_mm ?? 0) + ahead * Math.sin(yaw) + left * Math.cos(yaw) - from[1]) / step;
    const row = Math.max(0, Math.min(rows.length - 2, Math.floor(y)));
    return between([between(rows[row], x), between(rows[row + 1], x)], y - row);
  };
}

const shadowOf = (parent) => svg("ellipse", { rx: 34, ry: 8, class: "r-shadow" }, parent);
/** @param {Element} shadow @param {FootPlace} foot @param {number} ground height of the ground below it, above that under the axle */
function castShadow(shadow, [ahead, left, height], ground) {
  const [cx, cy] = oblique(ahead, left, ground);
  set(shadow, Number.isFinite(ground) ? { cx, cy, opacity: tenth(Math.max(0.2, 1 - (height - ground) / SHADOW_MM)) } : { opacity: 0 });
}
const metres = (mm) => `${fixed(mm / 1000)} m`;
const fits = (x) => (x >= LABELS_MM[0] && x <= LABELS_MM[1] ? "visible" : "hidden");

/** A level floor, drawn once and moved. @param {SVGElement} picture */
export function floorSide(picture) {
  const far = 520;
  const all = svg("g", {}, picture);
  svg("polygon", { class: "r-ground", points: points([oblique(-1500, far, 0), oblique(2500, far, 0), oblique(2500, -far, 0), oblique(-1500, -far, 0)]) }, all);
  const ticks = svg("g", {}, all);
  // They go along with the robot in whole marks: there is no end of the ground.
  const near = svg("g", {}, ticks);
  /** @type {{x: number, text: Element}[]} */
  const labels = [];
  for (let x = -3 * MARK_MM; x <= 5 * MARK_MM; x += 100) {
    const [[x1, y1], [x2, y2]] = [oblique(x, far, 0), oblique(x, -far, 0)];
    svg("line", { class: x % MARK_MM === 0 ? "r-tick r-tick5" : "r-tick", x1, y1, x2, y2 }, near);
    if (x % MARK_MM !== 0) continue;
    labels.push({ x, text: svg("text", { x: x2 + 8, y: y2 - 8 }, near) });
  }
  const shadows = SIDES.map(() => shadowOf(all));
  /** @param {import("./robot.js").Pose} pose @param {FootPlace[]} feet */
  return (pose, feet) => {
    const first = Math.floor(pose.travel_mm / MARK_MM) * MARK_MM;
    set(ticks, { transform: `translate(${tenth(-pose.travel_mm)},0)` });
    set(near, { transform: `translate(${first},0)` });
    for (const { x, text } of labels) {
      set(text, { visibility: fits(Number(text.getAttribute("x")) + first - pose.travel_mm) });
      say(text, metres(first + x));
    }
    feet.forEach((foot, i) => castShadow(shadows[i], foot, 0));
  };
}

/** A strip of ground between the tracks of both wheels, cut off at the near one.
 * @param {SVGElement} picture @param {{track_mm: number, wheel_radius_mm: number}} g @param {Heights} heights */
export function terrainSide(picture, g, heights) {
  const all = svg("g", {}, picture);
  // Each bit of the strip shades what is behind it.
  const strip = svg("polygon", { class: "r-ground" }, all);
  const soil = svg("polygon", { class: "r-soil" }, all);
  const [farEdge, nearEdge] = ["r-edge r-far-edge", "r-edge r-near-edge"].map((name) => svg("polyline", { class: name }, all));
  const marks = [];
  for (let at = DRAWN_MM[0]; at < DRAWN_MM[1]; at += MARK_MM) marks.push({ line: svg("line", { class: "r-tick r-tick5" }, all), text: svg("text", {}, all) });
  const unknown = svg("text", { x: -330, y: 60 }, all);
  say(unknown, "The ground here is not known to this page.");
  const shadows = SIDES.map(() => shadowOf(all));
  const half = g.track_mm / 2;
  /** @param {import("./robot.js").Pose} pose @param {FootPlace[]} feet */
  return (pose, feet) => {
    // The axle stays where it is in the picture; the ground goes up and down below it.
    const level = (pose.z_mm ?? g.wheel_radius_mm) - g.wheel_radius_mm;
    const height = (ahead, left) => heights(pose, ahead, left) - level;
    // The same places of the ground in every picture: its corners stand still.
    const first = Math.ceil((pose.travel_mm + DRAWN_MM[0]) / DRAWN_STEP_MM) * DRAWN_STEP_MM - pose.travel_mm;
    const edge = (left) => {
      const line = [];
      for (let ahead = first; ahead < DRAWN_MM[1]; ahead += DRAWN_STEP_MM) {
        const z = height(ahead, left);
        if (Number.isFinite(z)) line.push(oblique(ahead, left, z));
      }
      return line;
    };
    const [far, near] = [edge(half), edge(-half)];
    const known = far.length > 1 && near.length > 1;
    set(unknown, { visibility: known ? "hidden" : "visible" });
    const below = known ? [near[near.length - 1], near[0]].map(([x]) => [x, Math.max(...near.map(([, y]) => y)) + DEEP_MM]) : [];
    set(strip, { points: known ? points([...far, ...[...near].reverse()]) : "" });
    set(soil, { points: known ? points([...near, ...below]) : "" });
    set(farEdge, { points: points(far) });
    set(nearEdge, { points: points(near) });
    const from = Math.ceil((pose.travel_mm + DRAWN_MM[0]) / MARK_MM) * MARK_MM;
    marks.forEach(({ line, text }, i) => {
      const at = from + i * MARK_MM;
      const z = height(at - pose.travel_mm, -half);
      const [x, y] = Number.isFinite(z) ? oblique(at - pose.travel_mm, -half, z) : [LABELS_MM[1] + 1, 0];
      set(line, { x1: x, x2: x, y1: y, y2: y + 14, visibility: Number.isFinite(z) ? "visible" : "hidden" });
      set(text, { x: x + 6, y: y + 26, visibility: y + 26 < LOWEST_LABEL_MM ? fits(x) : "hidden" });
      say(text, metres(at));
    });
    feet.forEach((foot, i) => castShadow(shadows[i], foot, height(foot[0], foot[1])));
  };
}

/** Rocks and blocks from above; returns what moves them.
 * @param {SVGElement} picture @param {Ground} ground */
export function terrainAbove(picture, ground) {
  const all = svg("g", {}, picture);
  for (const block of ground.blocks) svg("polygon", { class: "r-block", points: points(block.map(([x, y]) => [tenth(x), tenth(-y)])) }, all);
  for (const [x, y, a, b, heading] of ground.rocks) {
    svg("ellipse", { class: "r-rock", rx: a, ry: b, transform: `translate(${x},${tenth(-y)}) rotate(${-heading})` }, all);
  }
  /** @param {import("./robot.js").Pose} pose */
  return (pose) => {
    const yaw = pose.yaw_deg ?? 0;
    set(all, { transform: `rotate(${yaw.toFixed(2)}) translate(${tenth(-pose.travel_mm)},${tenth(pose.y_mm ?? 0)})` });
  };
}
