// Driving by hand: the wheels follow as long as somebody holds on, by button, arrow key or gamepad.
// Who lets go holds the robot. What moves is the command `WheelReference`, in short pieces, each
// with a deadline of its own: nothing that is late moves anything.
import { html, say } from "./dom.js";

/** A piece is given this often, ms. */
const PIECE_MS = 200;
/** Fastest, mm/s at the rim. */
const FASTEST = 150;
/** A stick nearer to its middle than this is in its middle. */
const DEAD_ZONE = 0.12;
/** Buttons of the standard gamepad that must be held: the shoulders. */
const DEAD_MAN = [4, 5];

/** @param {(name: string, args?: Object<string, any>) => Promise<boolean>} command */
export function driver(command) {
  /** Who holds on, and how fast, as a share from −1 to 1. @type {Map<string, number>} */
  const held = new Map();
  let moving = false;
  let busy = false;
  const speed = html("input", { type: "range", min: 10, max: FASTEST, value: 60, step: 10, "aria-label": "Speed of driving, mm/s" });
  const shown = html("output", {}, `${speed.value} mm/s`);
  speed.addEventListener("input", () => say(shown, `${speed.value} mm/s`));
  const pad = html("p", { class: "effect", role: "status" }, "No gamepad. Hold a button, or ↑ and ↓ while one of them has the focus; letting go holds the robot.");

  const hold = (who, share) => held.set(who, share);
  const release = (who) => held.delete(who) && held.size === 0 && stop();
  /** Lets go of everything. */
  function stop() {
    held.clear();
    if (!moving) return;
    moving = false;
    command("Hold");
  }
  const button = (name, key, share) => {
    const one = html("button", { class: "btn", type: "button" }, html("span", {}, name), html("small", {}, `hold, or ${key}`));
    one.addEventListener("pointerdown", (event) => {
      one.setPointerCapture(event.pointerId);
      hold(name, share);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) one.addEventListener(end, () => release(name));
    return one;
  };
  const buttons = [button("Backward", "↓", -1), button("Forward", "↑", 1)];
  const root = html("section", { class: "panel", "aria-label": "Drive by hand" }, html("h2", {}, "Drive by hand"), html("div", { class: "drive" }, buttons, html("label", {}, speed, shown)), pad);
  const KEYS = { ArrowUp: 1, ArrowDown: -1 };
  for (const one of buttons) {
    one.addEventListener("keydown", (event) => {
      const share = KEYS[event.key];
      if (share === undefined) return;
      event.preventDefault();
      hold(event.key, share);
    });
    one.addEventListener("keyup", (event) => release(event.key));
    one.addEventListener("blur", () => Object.keys(KEYS).forEach(release));
  }
  addEventListener("blur", stop);

  /** Reads the first gamepad; its stick moves nothing unless a shoulder is held. */
  function gamepad() {
    const one = [...navigator.getGamepads()].find((found) => found?.connected);
    if (!one) {
      release("gamepad");
      return;
    }
    const holds = DEAD_MAN.some((i) => one.buttons[i]?.pressed);
    say(pad, `${one.id.slice(0, 40)}: hold a shoulder button and push the left stick; letting go holds the robot.`);
    const share = -(one.axes[1] ?? 0);
    if (holds) hold("gamepad", Math.abs(share) < DEAD_ZONE ? 0 : share);
    else release("gamepad");
  }

  setInterval(async () => {
    gamepad();
    if (held.size === 0 || busy) return;
    const share = [...held.values()].reduce((sum, one) => sum + one, 0);
    const travel = Math.max(-1, Math.min(1, share)) * Number(speed.value) * (PIECE_MS / 1000);
    if (travel === 0) return;
    busy = true;
    moving = true;
    const done = await command("WheelReference", { travel: Math.round(travel * 10) / 10 });
    busy = false;
    // Who is refused has let go: the next piece needs a new hold.
    if (!done) {
      held.clear();
      moving = false;
    }
  }, PIECE_MS);
  return { root, stop };
}
