// Who did what, and why a command was refused, in the words of the console's buttons. What is not here is told as the server tells it.
import { fixed } from "./dom.js";

/** Absolute pressure in the reservoir, and where it is full, bar; no numbers of real boards. When this page lost its control, if it did, by
 * the robot's clock, s.
 * @typedef {{air_bar: number, full_bar: number, injected: string[], lost_s: number | null}} Around what the robot is like just now */
/** Who has asked for the stop that is latched. @typedef {{via: string, name?: string | null, session?: string, role?: string, at_us: number}} Stopped */

/** Commands whose buttons say something else than their names. @type {Object<string, string>} */
const BUTTONS = { StopGait: "Stop walking", RecordStart: "Record", RecordStop: "Stop recording", EndFault: "End" };
/** A command as its button says it: "Take control". @param {string} name */
export const spoken = (name) => BUTTONS[name] ?? (name === name.toUpperCase() ? name : name.replace(/(?<=.)[A-Z]/g, (letter) => ` ${letter.toLowerCase()}`));

/** The boards' fault EmergencyStop. */
export const E_STOP = 39;
/** As every page calls itself. */
export const BROWSER = "browser";

/** Who has stopped the robot, for the page of this session. @param {Stopped} stopped @param {string} own */
export function stopper({ via, name, session, role }, own) {
  if (via === "api") return `${name ? `“${name}”` : "a program"}, over the HTTP API`;
  if (via === "foxglove") return "a Foxglove viewer";
  if (session === own) return "you";
  const who = name === BROWSER ? "another browser" : `“${name}”`;
  return role === "view" ? `${who}, with the view key` : who;
}

/** How full the reservoir is, as far as that is known. @param {{air_bar: number, full_bar: number}} around */
export const filled = ({ air_bar, full_bar }) => (Number.isFinite(air_bar) && Number.isFinite(full_bar) ? `${fixed(air_bar)} of ${fixed(full_bar)} bar absolute` : "");

/** By the reason of the answer. @type {Object<string, (around: Around) => string>} */
const WORDS = {
  not_in_control: ({ lost_s }) => (lost_s === null ? "press Take control first" : `you lost control at ${fixed(lost_s)} s of the robot's clock: press Take control again`),
  not_armed: () => "the robot is not armed: press Ready; after a stop or a hold press Clear fault before",
  not_disarmed: () => "the robot is armed: press Disarm first",
  moving: () => "the robot is moving: wait for the end of the motion, or press Hold, or in a walk Stop walking",
  not_moving: () => "the robot does not walk; Hold ends any other motion",
  latched: () => "a stop or a hold is latched: press Clear fault, and Ready once the reservoir is full",
  no_air: (around) => `the reservoir is not full${filled(around) && `: ${filled(around)}`}. Press Ready, which waits for it; if it stays so, check compressor, hose and regulator`,
  interrupted: () => "a stop, a hold or another command came between: Faults and Events tell which",
};

/** With a full stop. @param {string} sentence */
const ended = (sentence) => (/[.!?]$/.test(sentence) ? sentence : `${sentence}.`);

/** @param {string} command @param {import("./link.js").Answer} answer @param {Around} around */
export function refusal(command, { reason, text }, around) {
  const own = reason && Object.hasOwn(WORDS, reason) ? WORDS[reason](around) : text || reason || "";
  if (command !== "ClearFault" || around.injected.length === 0) return own;
  return `${ended(own)} Injected: ${around.injected.join(", ")}. Press End, then Clear fault.`;
}
