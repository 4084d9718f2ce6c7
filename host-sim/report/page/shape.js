// Where the parts of the robot are, from the dimensions of the robot file (mm; x forward, y left, z
// up; the origin is on the ground under the axle). Wheels, cranks, cylinders and feet are the
// file's; the shape of the chassis is ours.

/** @typedef {{crank_mm: number, p4_mm: [number, number], o4_mm: [number, number, number], stroke_zero_mm: [number, number, number],
 *   foot_pad_mm: number, sole_radius_mm: number, wheel_radius_mm: number, track_mm: number}} Geometry */
/** Strokes of yaw, horizontal and vertical cylinder.
 * @typedef {[number, number, number]} Strokes */

export const SIDES = [
  { name: "left", class: "leg-L", y: 1, yaw_z: 288 },
  { name: "right", class: "leg-R", y: -1, yaw_z: 312 },
];
export const BODY = { rear: -290, front: 560, nose: 430, belly: 120, chin: 196, deck: 262, half: 190 };
export const WHEEL_WIDTH = 50;

/** Points of a leg in axes of the chassis. @param {Geometry} g @param {number} side 1 left, −1 right @param {Strokes} strokes */
export function leg(g, side, [yaw, horizontal, vertical]) {
  const [px, py] = g.p4_mm;
  const [ox, oy] = g.o4_mm;
  const reach = Math.hypot(px, py);
  const b2 = g.stroke_zero_mm[0] + yaw;
  const b5 = g.stroke_zero_mm[1] + horizontal;
  const b6 = g.stroke_zero_mm[2] + vertical;
  // Law of cosines in the triangle of crank, yaw cylinder and chassis.
  const phi = Math.atan2(py, px) - Math.acos((reach * reach + g.crank_mm * g.crank_mm - b2 * b2) / (2 * g.crank_mm * reach));
  const [c, s] = [Math.cos(phi), Math.sin(phi)];
  return {
    phi: side * phi,
    o1: [ox - px, side * (oy - py)],
    o3: [ox - g.crank_mm * c, side * (oy - g.crank_mm * s)],
    o4: [ox, side * oy],
    o6: [ox + b5 * c, side * (oy + b5 * s)],
    // O4 stands above the axle, the axle a wheel's radius above the ground.
    sole: g.wheel_radius_mm + g.o4_mm[2] - b6 - g.foot_pad_mm,
  };
}
