// The robot from its side and from above, to scale. A view makes its elements once; `update` then
// writes transforms and the few attributes that changed.
import { svg, set, say } from "./dom.js";
import { oblique, points, tenth } from "./projection.js";
import { BODY, SIDES, WHEEL_WIDTH, leg } from "./shape.js";
import { floorSide, terrainAbove, terrainSide } from "./ground.js";

/** @typedef {import("./shape.js").Geometry} Geometry */
/** @typedef {import("./shape.js").Strokes} Strokes */
/** @typedef {{commanded_mm: Strokes, sensed_mm: Strokes, load_n: number, switches: number, blind?: boolean}} Leg
 * `blind`: a sensor of it gives no reading; it is drawn where its last one was. */
/** Where the middle of the axle is, if it is known, how far the left and the right wheel have turned, at the
 * rim, if that is told apart, and how the legs are.
 * @typedef {{travel_mm: number, wheels_mm?: [number, number], pitch_deg: number, y_mm?: number, z_mm?: number, yaw_deg?: number, legs: [Leg, Leg]}} Pose */

/** Outlines nearer to the measured part than this would only blur it. */
const VISIBLE_MM = 3;
/** The name of a leg stands so high, above the horizontal cylinder of the other one. */
const TAG_MM = 424;

/** @param {Element} line @param {number[]} from @param {number[]} to */
export const put = (line, [x1, y1], [x2, y2]) => set(line, { x1: tenth(x1), y1: tenth(y1), x2: tenth(x2), y2: tenth(y2) });
const bar = (parent, name, width) => svg("line", { class: name, "stroke-width": width }, parent);

/** A wheel seen from its side; returns what turns it. */
function wheelSide(parent, g, y) {
  const r = g.wheel_radius_mm;
  const tyre = svg("line", { class: "r-tyre", "stroke-width": 2 * r, "stroke-linecap": "round" }, parent);
  put(tyre, oblique(0, y + WHEEL_WIDTH / 2, r), oblique(0, y - WHEEL_WIDTH / 2, r));
  const face = svg("g", { transform: `translate(${oblique(0, y - WHEEL_WIDTH / 2, r)}) scale(${r / 150})` }, parent);
  svg("circle", { r: 146, class: "r-tyre-face" }, face);
  svg("circle", { r: 112, class: "r-rim" }, face);
  const spokes = svg("g", {}, face);
  for (let i = 0; i < 5; i += 1) svg("path", { d: "M-9,-26 L-13,-106 A107,107 0 0 1 13,-106 L9,-26Z", class: "r-spoke", transform: `rotate(${i * 72})` }, spokes);
  svg("rect", { x: -4, y: -143, width: 8, height: 24, rx: 3, class: "r-mark" }, spokes);
  svg("circle", { r: 27, class: "r-hub" }, face);
  return (degrees) => set(spokes, { transform: `rotate(${tenth(degrees)})` });
}

/** Vertical cylinder and foot; its origin is where the carriage is. Commanded ones are outlines. */
function verticalCylinder(parent, commanded) {
  const kind = (name) => (commanded ? "r-ask" : name);
  svg("rect", { x: -24, y: -338, width: 48, height: 62, rx: 5, class: kind("r-carriage") }, parent);
  const rod = svg("rect", { x: -4, y: -206, width: 8, height: 10, class: kind("r-rod") }, parent);
  svg("rect", { x: -12, y: -400, width: 24, height: 200, rx: 2, class: kind("r-barrel") }, parent);
  if (!commanded) for (const y of [-404, -212]) svg("rect", { x: -15, y, width: 30, height: 14, rx: 2.5, class: "r-cap" }, parent);
  const foot = svg("g", {}, parent);
  svg("path", { d: "M-8,-34 L8,-34 L17,-13 L-17,-13Z", class: kind("r-ankle") }, foot);
  svg("rect", { x: -30, y: -14, width: 60, height: 14, rx: 5, class: kind("r-sole") }, foot);
  return (sole) => {
    set(rod, { height: tenth(Math.max(2, 176 - sole)) });
    set(foot, { transform: `translate(0,${tenth(-sole)})` });
  };
}

function chassisSide(root) {
  const { rear, front, nose, belly, chin, deck, half } = BODY;
  const face = (name, ...corners) => svg("polygon", { class: name, points: points(corners.map((c) => oblique(...c))) }, root);
  face("r-body-end", [front, -half, chin], [front, half, chin], [front, half, deck], [front, -half, deck]);
  face("r-body-end", [nose, -half, belly], [nose, half, belly], [front, half, chin], [front, -half, chin]);
  face("r-body-top", [rear, -half, deck], [front, -half, deck], [front, half, deck], [rear, half, deck]);
  // Electronics on the deck.
  face("r-body-end", [230, -120, 262], [230, 120, 262], [230, 120, 296], [230, -120, 296]);
  face("r-body-top", [-70, -120, 296], [230, -120, 296], [230, 120, 296], [-70, 120, 296]);
  face("r-body", [-70, -120, 262], [230, -120, 262], [230, -120, 296], [-70, -120, 296]);
  const tank = svg("line", { class: "r-tank", "stroke-width": 74, "stroke-linecap": "round" }, root);
  put(tank, oblique(-222, -110, 296), oblique(-222, 110, 296));
  face("r-body", [rear, -half, 168], [rear + 46, -half, belly], [nose, -half, belly], [front, -half, chin], [front, -half, deck], [rear, -half, deck]);
}

/** The robot from its right side, on a level floor or on a terrain. @param {SVGElement} picture @param {Geometry} g
 * @param {import("./ground.js").Heights} [heights] */
export function sideView(picture, g, heights) {
  // On a slope the raised legs are higher in the picture.
  const [top, bottom] = heights ? [-590, 124] : [-492, 114];
  set(picture, { viewBox: `-392 ${top} 1310 ${bottom - top}`, role: "img", preserveAspectRatio: "xMidYMax meet" });
  picture.classList.add("robot");
  // Letters keep their size whatever the scale of the drawing.
  new ResizeObserver(([{ contentRect: { width, height } }]) => {
    const scale = Math.min(width / 1310, height / (bottom - top));
    if (scale > 0) picture.style.setProperty("--u", (1 / scale).toFixed(2));
  }).observe(picture);
  const title = svg("title", {}, picture);
  const moveGround = heights ? terrainSide(picture, g, heights) : floorSide(picture);
  // The axle stays where it is in the picture; what is on it pitches about its middle.
  const farWheel = wheelSide(picture, g, g.track_mm / 2);
  const root = svg("g", {}, picture);
  chassisSide(root);
  const yaws = SIDES.map(() => ({ barrel: bar(root, "r-barrel-l", 22), rod: bar(root, "r-rod-l", 8) }));
  const legs = SIDES.map((side) => {
    const group = svg("g", { class: `leg ${side.class}` }, root);
    const [x, y] = oblique(g.o4_mm[0], side.y * g.o4_mm[1], 0);
    svg("rect", { x: x - 17, y: y - 346, width: 34, height: 66, rx: 4, class: "r-post" }, group);
    const crank = bar(group, "r-crank", 15);
    const barrel = bar(group, "r-barrel-l", 24);
    const rod = bar(group, "r-rod-l", 8);
    const commanded = svg("g", { class: "asked" }, group);
    const setCommanded = verticalCylinder(commanded, true);
    const sensed = svg("g", {}, group);
    const setSensed = verticalCylinder(sensed, false);
    const load = svg("path", { class: "r-force" }, group);
    const tag = svg("text", { class: "r-tag" }, group);
    return { group, crank, barrel, rod, commanded, setCommanded, sensed, setSensed, load, tag };
  });
  const nearWheel = wheelSide(picture, g, -g.track_mm / 2);

  return {
    /** @param {Pose} pose */
    update(pose) {
      const pitch = (pose.pitch_deg * Math.PI) / 180;
      /** @type {import("./ground.js").FootPlace[]} */
      const feet = SIDES.map((side, i) => {
        const { o6, sole } = leg(g, side.y, pose.legs[i].sensed_mm);
        const [x, z] = [o6[0], sole - g.wheel_radius_mm];
        return [x * Math.cos(pitch) - z * Math.sin(pitch), o6[1], g.wheel_radius_mm + x * Math.sin(pitch) + z * Math.cos(pitch)];
      });
      moveGround(pose, feet);
      const [left, right] = (pose.wheels_mm ?? [pose.travel_mm, pose.travel_mm]).map((mm) => (mm / g.wheel_radius_mm) * (180 / Math.PI));
      farWheel(left);
      nearWheel(right);
      set(root, { transform: `rotate(${(-pose.pitch_deg).toFixed(2)} 0 ${-g.wheel_radius_mm})` });
      const places = SIDES.map((side, i) => leg(g, side.y, pose.legs[i].sensed_mm));
      const [leftX, rightX] = places.map(({ o6 }) => oblique(...o6, 0)[0]);
      SIDES.forEach((side, i) => {
        const [state, part, yaw] = [pose.legs[i], legs[i], yaws[i]];
        const at = places[i];
        const towards = (w) => {
          const length = Math.hypot(at.o3[0] - at.o1[0], at.o3[1] - at.o1[1]);
          return [at.o1[0] + ((at.o3[0] - at.o1[0]) * w) / length, at.o1[1] + ((at.o3[1] - at.o1[1]) * w) / length];
        };
        const along = (w) => [at.o4[0] + w * Math.cos(at.phi), at.o4[1] + w * Math.sin(at.phi)];
        put(yaw.barrel, oblique(...towards(0), side.yaw_z), oblique(...towards(225), side.yaw_z));
        put(yaw.rod, oblique(...towards(225), side.yaw_z), oblique(...at.o3, side.yaw_z));
        put(part.crank, oblique(...at.o3, 300), oblique(...at.o4, 300));
        put(part.barrel, oblique(...along(-225), 318), oblique(...along(-8), 318));
        put(part.rod, oblique(...along(-8), 318), oblique(...at.o6, 318));
        const [x, y] = oblique(...at.o6, 0);
        set(part.sensed, { transform: `translate(${x},${y})` });
        part.setSensed(at.sole);
        part.group.classList.toggle("blind", state.blind ?? false);
        say(part.tag, state.blind ? `${side.name}: no reading` : side.name);
        const differs = state.commanded_mm.some((c, j) => Math.abs(c - state.sensed_mm[j]) > VISIBLE_MM);
        part.commanded.style.display = differs ? "" : "none";
        if (differs) {
          const asked = leg(g, side.y, state.commanded_mm);
          set(part.commanded, { transform: `translate(${oblique(...asked.o6, 0)})` });
          part.setCommanded(asked.sole);
        }
        // From the sole: a foot may press against a wall, above the ground.
        const from = oblique(...at.o6, at.sole)[1];
        const length = state.load_n > 0.5 ? 18 + Math.min(150, state.load_n * 2.2) : 0;
        set(part.load, { d: length > 0 ? `M${x - 52},${from} v${tenth(-length)} m-9,12 l9,-14 l9,14` : "" });
        // On the side where the other leg is not; what is long has its room behind.
        const ahead = (i === 0 ? leftX >= rightX : rightX > leftX) && !state.blind;
        set(part.tag, { x: tenth(ahead ? x + 24 : x - 24), y: tenth(y - TAG_MM), "text-anchor": ahead ? "start" : "end" });
      });
      say(title, `Robot from its right side, ${Math.round(pose.travel_mm)} mm travelled`);
    },
  };
}

/** The robot from above: forward is right, left is up. @param {SVGElement} picture @param {Geometry} g
 * @param {import("./ground.js").Ground} [terrain] */
export function topView(picture, g, terrain) {
  set(picture, { viewBox: "-330 -330 1190 660", role: "img", preserveAspectRatio: "xMidYMid meet" });
  picture.classList.add("robot");
  say(svg("title", {}, picture), "Robot from above");
  const place = terrain ? terrainAbove(picture, terrain) : undefined;
  const { rear, front, half } = BODY;
  svg("line", { x1: 0, x2: 0, y1: -g.track_mm / 2, y2: g.track_mm / 2, class: "r-axle", "stroke-width": 22 }, picture);
  for (const y of [-g.track_mm / 2, g.track_mm / 2]) svg("rect", { x: -g.wheel_radius_mm, y: y - WHEEL_WIDTH / 2, width: 2 * g.wheel_radius_mm, height: WHEEL_WIDTH, rx: 12, class: "r-tyre-face" }, picture);
  svg("path", { class: "r-body", d: `M${rear},${-half} H330 L470,-150 H${front} V150 H470 L330,${half} H${rear}Z` }, picture);
  svg("rect", { x: -262, y: -148, width: 80, height: 296, rx: 38, class: "r-tank-t" }, picture);
  const legs = SIDES.map((side) => {
    const group = svg("g", { class: `leg ${side.class}` }, picture);
    const part = {
      yaw: bar(group, "r-barrel-l", 22),
      yawRod: bar(group, "r-rod-l", 9),
      crank: bar(group, "r-crank", 26),
      barrel: bar(group, "r-barrel-l", 24),
      rod: bar(group, "r-rod-l", 9),
      commanded: svg("circle", { r: g.sole_radius_mm + 4, class: "r-ask" }, group),
      foot: svg("g", {}, group),
    };
    svg("circle", { r: g.sole_radius_mm, class: "r-sole-t" }, part.foot);
    svg("rect", { x: -24, y: -24, width: 48, height: 48, rx: 6, class: "r-carriage" }, part.foot);
    svg("circle", { cx: g.o4_mm[0], cy: -side.y * g.o4_mm[1], r: 22, class: "r-post" }, group);
    return part;
  });
  /** @param {number[]} point */
  const flat = ([x, y]) => [tenth(x), tenth(-y)];
  return {
    /** @param {Pose} pose */
    update(pose) {
      place?.(pose);
      SIDES.forEach((side, i) => {
        const [state, part] = [pose.legs[i], legs[i]];
        const at = leg(g, side.y, state.sensed_mm);
        const middle = [(at.o1[0] + at.o3[0]) / 2, (at.o1[1] + at.o3[1]) / 2];
        const along = (w) => [at.o4[0] + w * Math.cos(at.phi), at.o4[1] + w * Math.sin(at.phi)];
        put(part.yaw, flat(at.o1), flat(middle));
        put(part.yawRod, flat(middle), flat(at.o3));
        put(part.crank, flat(at.o3), flat(at.o4));
        put(part.barrel, flat(along(-225)), flat(along(-8)));
        put(part.rod, flat(along(-8)), flat(at.o6));
        set(part.foot, { transform: `translate(${flat(at.o6)})` });
        const asked = leg(g, side.y, state.commanded_mm).o6;
        part.commanded.style.display = Math.hypot(asked[0] - at.o6[0], asked[1] - at.o6[1]) > VISIBLE_MM ? "" : "none";
        set(part.commanded, { cx: tenth(asked[0]), cy: tenth(-asked[1]) });
      });
    },
  };
}

const SWITCHES = ["front", "back", "left", "right"];
const DIRECTIONS = [[1, 0], [-1, 0], [0, -1], [0, 1]];

/** A sole from above with its four switches (closed is filled) and its load.
 * @param {SVGElement} picture @param {string} name */
export function footView(picture, name) {
  set(picture, { viewBox: "-62 -62 124 124", role: "img" });
  picture.classList.add("robot", "footview");
  const title = svg("title", {}, picture);
  svg("circle", { r: 34, class: "r-sole-o" }, picture);
  const arcs = DIRECTIONS.map(([dx, dy]) => {
    const middle = Math.atan2(dy, dx);
    const corner = (r, a) => `${tenth(r * Math.cos(a))},${tenth(r * Math.sin(a))}`;
    const [a, b] = [middle - 0.66, middle + 0.66];
    return svg("path", { d: `M${corner(42, a)} A42,42 0 0 1 ${corner(42, b)} L${corner(56, b)} A56,56 0 0 0 ${corner(56, a)}Z`, class: "sw" }, picture);
  });
  const load = svg("text", { class: "foot-n", "text-anchor": "middle", y: 5 }, picture);
  say(svg("text", { class: "foot-u", "text-anchor": "middle", y: 23 }, picture), "N");
  return {
    /** @param {Leg} state */
    update(state) {
      const closed = SWITCHES.filter((_, i) => (state.switches >> i) & 1);
      arcs.forEach((arc, i) => set(arc, { class: (state.switches >> i) & 1 ? "sw on" : "sw" }));
      say(load, state.load_n > 0.5 ? state.load_n.toFixed(0) : "–");
      say(title, `${name} foot: ${closed.length === 4 ? "flat on the ground" : closed.join(", ") || "in the air"}`);
    },
  };
}
