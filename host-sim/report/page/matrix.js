// Matrices of 4 × 4 as WebGL wants them: 16 numbers, column after column.

/** @typedef {number[]} Matrix */
/** @typedef {[number, number, number]} Point */

/** First `b`, then `a`. @param {Matrix} a @param {Matrix} b @returns {Matrix} */
export function multiply(a, b) {
  const out = new Array(16).fill(0);
  for (let column = 0; column < 4; column += 1) {
    for (let row = 0; row < 4; row += 1) {
      for (let k = 0; k < 4; k += 1) out[4 * column + row] += a[4 * k + row] * b[4 * column + k];
    }
  }
  return out;
}

/** @param {Point} by @returns {Matrix} */
export const moved = ([x, y, z]) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1];
/** @param {Point} by @returns {Matrix} */
export const scaled = ([x, y, z]) => [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1];
/** About x. @param {number} angle rad @returns {Matrix} */
export const rolled = (angle) => [1, 0, 0, 0, 0, Math.cos(angle), Math.sin(angle), 0, 0, -Math.sin(angle), Math.cos(angle), 0, 0, 0, 0, 1];
/** About y. @param {number} angle rad @returns {Matrix} */
export const tilted = (angle) => [Math.cos(angle), 0, -Math.sin(angle), 0, 0, 1, 0, 0, Math.sin(angle), 0, Math.cos(angle), 0, 0, 0, 0, 1];
/** About z. @param {number} angle rad @returns {Matrix} */
export const turned = (angle) => [Math.cos(angle), Math.sin(angle), 0, 0, -Math.sin(angle), Math.cos(angle), 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** @param {Point} a @param {Point} b @returns {Point} */
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
/** @param {Point} a @param {Point} b @returns {Point} */
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** @param {Point} a @returns {Point} */
const unit = (a) => {
  const length = Math.hypot(...a) || 1;
  return [a[0] / length, a[1] / length, a[2] / length];
};

/** A unit solid along z, so that it reaches from one point to another. @param {Point} from @param {Point} to @param {number} width @returns {Matrix} */
export function reaching(from, to, width) {
  const way = minus(to, from);
  const z = unit(way);
  const x = unit(cross(Math.abs(z[2]) > 0.9 ? [1, 0, 0] : [0, 0, 1], z));
  const y = cross(z, x);
  const middle = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2, (from[2] + to[2]) / 2];
  const length = Math.hypot(...way);
  return [...x.map((v) => v * width), 0, ...y.map((v) => v * width), 0, ...z.map((v) => v * length), 0, ...middle, 1];
}

/** What an eye sees that looks at a point, z up. @param {Point} eye @param {Point} at @returns {Matrix} */
export function looking(eye, at) {
  const z = unit(minus(eye, at));
  const x = unit(cross([0, 0, 1], z));
  const y = cross(z, x);
  return [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1];
}

/** @param {number} angle of the whole height, rad @param {number} aspect width over height @returns {Matrix} */
export function perspective(angle, aspect, near, far) {
  const f = 1 / Math.tan(angle / 2);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
}
