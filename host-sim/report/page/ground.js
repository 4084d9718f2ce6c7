// The terrain below the robot, from its side and from above (mm; world axes as those of robot.js at
// the start). It is drawn once and moved.
import { svg, set, say } from "./dom.js";
import { oblique, points, tenth } from "./projection.js";

/** Heights along both wheels' tracks; middle, half axes and heading of each rock; corners of blocks.
 * @typedef {{from_mm: number, step_mm: number, left_mm: number[], right_mm: number[],
 *   rocks: [number, number, number, number, number][], blocks: [number, number][][]}} Ground */

/** How far below the ground it is drawn. */
const DEEP_MM = 900;

/** A strip of ground between the tracks of both wheels, cut off at the near one.
 * @param {SVGElement} picture @param {{track_mm: number}} g @param {Ground} ground */
export function terrainSide(picture, g, ground) {
  const all = svg("g", {}, picture);
  const x = (k) => ground.from_mm + k * ground.step_mm;
  const half = g.track_mm / 2;
  const line = (heights, y) => heights.map((z, k) => oblique(x(k), y, z));
  const [far, near] = [line(ground.left_mm, half), line(ground.right_mm, -half)];
  const last = near.length - 1;
  const lowest = Math.min(...ground.right_mm) - DEEP_MM;
  const below = [oblique(x(last), -half, lowest), oblique(x(0), -half, lowest)];
  // Each bit of the strip shades what is behind it.
  svg("polygon", { class: "r-ground", points: points([...far, ...[...near].reverse()]) }, all);
  svg("polygon", { class: "r-soil", points: points([...near, ...below]) }, all);
  svg("polyline", { class: "r-edge r-far-edge", points: points(far) }, all);
  svg("polyline", { class: "r-edge", points: points(near) }, all);
  for (let at = Math.ceil(x(0) / 500) * 500; at <= x(last); at += 500) {
    const height = ground.right_mm[Math.min(last, Math.max(0, Math.round((at - ground.from_mm) / ground.step_mm)))];
    const [tx, ty] = oblique(at, -half, height);
    svg("line", { class: "r-tick r-tick5", x1: tx, x2: tx, y1: ty, y2: ty + 14 }, all);
    say(svg("text", { x: tx + 6, y: ty + 26 }, all), `${(at / 1000).toFixed(1)} m`);
  }
  return { ticks: all, shadows: [] };
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
