// The robot in space as solids, from the same dimensions as its flat drawings.
import { BODY, SIDES, WHEEL_WIDTH, leg } from "./shape.js";
import { moved, multiply, reaching, rolled, scaled, tilted, turned } from "./matrix.js";

/** A unit solid (box, cylinder or cone along z, 1 wide and 1 long), how it is placed, its colour.
 * @typedef {{mesh: "box" | "cylinder" | "cone", at: import("./matrix.js").Matrix, colour: string}} Solid */
/** Middle of the axle and attitude; travel of each wheel's rim; strokes and load of each leg. Left comes first.
 * @typedef {{x_mm: number, y_mm: number, z_mm: number, roll_deg: number, pitch_deg: number, yaw_deg: number,
 *   wheels_mm: [number, number], legs: {sensed_mm: import("./shape.js").Strokes, load_n: number}[]}} SpacePose */

const RAD = Math.PI / 180;
/** Length of a force's arrow, mm per newton. */
const ARROW = 2.2;

/** From axes of the chassis, on the ground under the axle, to the world. @param {import("./shape.js").Geometry} g @param {SpacePose} pose */
export function chassis(g, pose) {
  // Nose up turns about −y.
  const attitude = multiply(turned(pose.yaw_deg * RAD), multiply(tilted(-pose.pitch_deg * RAD), rolled(pose.roll_deg * RAD)));
  return multiply(moved([pose.x_mm, pose.y_mm, pose.z_mm]), multiply(attitude, moved([0, 0, -g.wheel_radius_mm])));
}

/** @param {import("./shape.js").Geometry} g @param {SpacePose} pose @returns {Solid[]} */
export function solids(g, pose) {
  /** @type {Solid[]} */
  const list = [];
  const place = chassis(g, pose);
  const add = (mesh, colour, at) => list.push({ mesh, colour, at: multiply(place, at) });
  const box = (colour, [x0, x1], [y0, y1], [z0, z1]) => add("box", colour, multiply(moved([(x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2]), scaled([x1 - x0, y1 - y0, z1 - z0])));
  const rod = (colour, from, to, width, mesh = "cylinder") => add(mesh, colour, reaching(from, to, width));

  const { rear, front, nose, belly, chin, deck, half } = BODY;
  box("body", [rear, nose], [-half, half], [belly, deck]);
  box("body", [nose, front], [-half, half], [chin, deck]);
  box("end", [-70, 230], [-120, 120], [deck, deck + 34]);
  rod("barrel", [-222, -110, deck + 34], [-222, 110, deck + 34], 74);
  SIDES.forEach((side, i) => {
    const [y, r] = [(side.y * g.track_mm) / 2, g.wheel_radius_mm];
    rod("tyre", [0, y - WHEEL_WIDTH / 2, r], [0, y + WHEEL_WIDTH / 2, r], 2 * r);
    // Spokes, so that it can be seen to roll.
    const roll = multiply(moved([0, y, r]), tilted(pose.wheels_mm[i] / r));
    for (let spoke = 0; spoke < 3; spoke += 1) add("box", "rim", multiply(roll, multiply(tilted((spoke * Math.PI) / 3), scaled([18, WHEEL_WIDTH + 4, 1.5 * r]))));
  });
  SIDES.forEach((side, i) => {
    const { sensed_mm, load_n } = pose.legs[i];
    const at = leg(g, side.y, sensed_mm);
    const along = (w) => [at.o4[0] + w * Math.cos(at.phi), at.o4[1] + w * Math.sin(at.phi), 318];
    const span = Math.hypot(at.o3[0] - at.o1[0], at.o3[1] - at.o1[1]);
    const share = (w) => [at.o1[0] + ((at.o3[0] - at.o1[0]) * w) / span, at.o1[1] + ((at.o3[1] - at.o1[1]) * w) / span, side.yaw_z];
    box("end", [at.o4[0] - 17, at.o4[0] + 17], [at.o4[1] - 17, at.o4[1] + 17], [deck, 346]);
    rod("barrel", share(0), share(225), 22);
    rod("rod", share(225), share(span), 8);
    rod("end", [...at.o3, 300], [...at.o4, 300], 26, "box");
    rod("barrel", along(-225), along(-8), 24);
    rod("rod", along(-8), [...at.o6, 318], 8);
    const [x, y] = at.o6;
    box("end", [x - 24, x + 24], [y - 24, y + 24], [276, 338]);
    rod("barrel", [x, y, 200], [x, y, 400], 24);
    rod("rod", [x, y, at.sole + 30], [x, y, 206], 8);
    rod("end", [x, y, at.sole + 14], [x, y, at.sole + 34], 26);
    rod("tyre", [x, y, at.sole], [x, y, at.sole + 14], 2 * g.sole_radius_mm);
    if (load_n > 0.5) {
      const top = at.sole + 30 + Math.min(330, load_n * ARROW);
      const beside = y + side.y * (g.sole_radius_mm + 20);
      rod("force", [x, beside, at.sole], [x, beside, top], 9);
      rod("force", [x, beside, top], [x, beside, top + 28], 26, "cone");
    }
  });
  return list;
}
