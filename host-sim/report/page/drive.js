// Driving by hand: the robot moves as long as somebody holds on, by button, arrow key or gamepad.
//
// "Wheels and legs" gives the command `Walk`, anew where speed or turn has changed; who lets go stops
// the walk, both feet down. "Wheels alone" gives `WheelReference` in short pieces; who lets go holds
// the robot. Each command has a deadline of its own: nothing that is late moves anything.
import { html, say } from "./dom.js";

/** A command is given this often at most, ms. */
const PIECE_MS = 200;
/** Fastest, mm/s at the rim and for the robot. */
const FASTEST = 150;
/** Tightest turn, degrees a second. */
const TIGHTEST = 10;
const RADIANS = Math.PI / 180;
/** A stick nearer to its middle than this is in its middle. */
const DEAD_ZONE = 0.12;
/** Buttons of the standard gamepad that must be held: the shoulders. */
const DEAD_MAN = [4, 5];
/** Key, direction ahead and turn to the left. */
const DIRECTIONS = [
  ["Turn left", "←", "ArrowLeft", 0, 1],
  ["Forward", "↑", "ArrowUp", 1, 0],
  ["Backward", "↓", "ArrowDown", -1, 0],
  ["Turn right", "→", "ArrowRight", 0, -1],
];
const HELP = "No gamepad. Hold a button, or an arrow key while one of them has the focus; letting go stops.";

/** @param {(name: string, args?: Object<string, any>, taken?: () => void) => Promise<boolean>} command */
export function driver(command) {
  /** Who holds on, and how far: ahead and to the left, each from −1 to 1. @type {Map<string, number[]>} */
  const held = new Map();
  /** What the robot does by our command. @type {null | "walk" | "wheels"} */
  let moving = null;
  let given = "";
  let busy = false;
  /** The walk has begun: a change of it that is refused leaves it under way. */
  let walks = false;
  /** The robot walks straight ahead, and nobody needs to hold on. */
  let straight = false;
  /** The gamepad's shoulders were seen open since somebody had to let go. */
  let padOpen = false;

  const slider = (name, unit, min, max, value, step) => {
    const input = html("input", { type: "range", min, max, value, step, "aria-label": `${name}, ${unit}` });
    const shown = html("output", {}, `${value} ${unit}`);
    input.addEventListener("input", () => say(shown, `${input.value} ${unit}`));
    const begin = (number) => {
      input.value = String(number);
      say(shown, `${input.value} ${unit}`);
    };
    return { input, begin, row: html("label", {}, html("span", {}, name), input, shown) };
  };
  const choice = (name, options) => html("select", { "aria-label": name }, options.map(([value, text]) => html("option", { value }, text)));
  const means = choice("What moves", [["walk", "Wheels and legs"], ["wheels", "Wheels alone"]]);
  const speed = slider("Speed", "mm/s", 10, FASTEST, 100, 10);
  const turn = slider("Turn left, right", "°/s", 1, TIGHTEST, 4, 1);
  const lift = slider("Lift", "mm", 20, 170, 60, 10);
  const nose = slider("Nose", "mm", -120, 0, -20, 10);
  const pattern = choice("Pattern", [["alternate", "legs alternate"], ["tandem", "legs in tandem"]]);
  const gait = html("details", {}, html("summary", {}, "Steps"), html("div", { class: "drive" }, html("label", {}, html("span", {}, "Pattern"), pattern), lift.row, nose.row));
  const pad = html("p", { class: "effect", role: "status" }, HELP);

  /** A `Walk` with shares of the speed and turn that are set. */
  function order(ahead, left) {
    return {
      speed: Math.round(ahead * Number(speed.input.value)),
      turn: Math.round(left * Number(turn.input.value) * RADIANS * 1e3) / 1e3,
      pattern: pattern.value,
      lift: Number(lift.input.value),
      nose: Number(nose.input.value),
    };
  }
  const hold = (who, ahead, left) => held.set(who, [ahead, left]);
  const release = (who) => held.delete(who) && held.size === 0 && stop();
  /** Walks straight ahead until somebody stops it. */
  async function walkOn() {
    straight = true;
    await command("Walk", order(1, 0));
    straight = false;
  }
  // What is set meanwhile counts at once.
  for (const field of [speed.input, lift.input, nose.input, pattern]) field.addEventListener("change", () => straight && held.size === 0 && command("Walk", order(1, 0)));
  /** Lets go of everything, and gives no command: another one stops the robot. */
  function letGo() {
    straight = false;
    drop();
  }
  /** Nobody holds on any more. */
  function drop() {
    held.clear();
    moving = null;
    given = "";
    walks = false;
    padOpen = false;
  }
  /** Lets go, and stops what moves. */
  async function stop() {
    const was = moving;
    drop();
    if (was === "walk" && !(await command("StopGait"))) command("Hold");
    if (was === "wheels") command("Hold");
  }
  means.addEventListener("change", () => {
    stop();
    gait.hidden = means.value === "wheels";
  });

  const buttons = DIRECTIONS.map(([name, sign, key, ahead, left]) => {
    const one = html("button", { class: "btn", type: "button" }, html("span", {}, name), html("small", {}, `hold, or ${sign}`));
    one.addEventListener("contextmenu", (event) => event.preventDefault());
    one.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || !event.isPrimary) return;
      one.setPointerCapture(event.pointerId);
      hold(name, ahead, left);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) one.addEventListener(end, () => release(name));
    one.addEventListener("keydown", (event) => {
      const direction = DIRECTIONS.find((d) => d[2] === event.key);
      if (!direction) return;
      event.preventDefault();
      event.stopPropagation();
      // Who had to let go while the key was down has to press it anew.
      if (!event.repeat) hold(event.key, direction[3], direction[4]);
    });
    one.addEventListener("keyup", (event) => release(event.key));
    one.addEventListener("blur", () => DIRECTIONS.forEach((d) => release(d[2])));
    return one;
  });
  const root = html("section", { class: "panel byhand", "data-live": true, "aria-label": "Drive by hand" }, html("h2", {}, "Drive by hand"), html("div", { class: "drive" }, html("label", {}, html("span", {}, "Moves"), means), buttons, speed.row, turn.row), gait, pad);
  addEventListener("blur", stop);

  /** Reads the first gamepad; its stick moves nothing unless a shoulder is held. */
  function gamepad() {
    const one = [...navigator.getGamepads()].find((found) => found?.connected);
    if (!one) {
      say(pad, HELP);
      release("gamepad");
      return;
    }
    const holds = DEAD_MAN.some((i) => one.buttons[i]?.pressed);
    say(pad, `${one.id.slice(0, 40)}: hold a shoulder button and push the left stick; letting go stops.`);
    const [left, ahead] = [0, 1].map((axis) => {
      const share = -(one.axes[axis] ?? 0);
      return Math.abs(share) < DEAD_ZONE ? 0 : share;
    });
    padOpen ||= !holds;
    if (holds && padOpen) hold("gamepad", ahead, left);
    else release("gamepad");
  }

  setInterval(async () => {
    gamepad();
    if (held.size === 0 || busy) return;
    const [ahead, left] = [0, 1].map((axis) => Math.max(-1, Math.min(1, [...held.values()].reduce((sum, one) => sum + one[axis], 0))));
    const way = /** @type {"walk" | "wheels"} */ (means.value);
    const walk = order(ahead, left);
    // A walk goes on until it is changed or stopped; a piece of way ends by itself.
    const wanted = JSON.stringify(walk);
    const travel = Math.round(ahead * Number(speed.input.value) * PIECE_MS * 1e-2) / 10;
    if (way === "walk" ? wanted === given || (moving === null && walk.speed === 0 && walk.turn === 0) : travel === 0) return;
    busy = true;
    moving = way;
    given = wanted;
    if (way === "walk") {
      // A walk ends when it is stopped: what counts is that it was taken.
      const ended = command("Walk", walk, () => {
        busy = false;
        walks = moving === "walk";
      });
      ended.then((done) => {
        busy = false;
        if (!done) refused(way);
      });
    } else {
      if (!(await command("WheelReference", { travel }))) refused(way);
      busy = false;
    }
  }, PIECE_MS);
  /** Who is refused has let go: the next command needs a new hold. A walk that goes on is stopped. */
  function refused(way) {
    if (moving !== way) return;
    if (walks) stop();
    else drop();
  }
  /** Begins with the usual walk, of which the turn is none. @param {{name: string, usual?: any}[]} walk its arguments */
  function begin(walk) {
    const usual = (name) => walk.find((argument) => argument.name === name)?.usual;
    for (const [one, name] of /** @type {[typeof speed, string][]} */ ([[speed, "speed"], [lift, "lift"], [nose, "nose"]])) if (usual(name) !== undefined) one.begin(usual(name));
    pattern.value = usual("pattern") ?? pattern.value;
  }
  return { root, stop, letGo, begin, walk: walkOn, /** What a walk will be. */ about: () => `straight, ${speed.input.value} mm/s` };
}
