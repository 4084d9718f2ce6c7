// Why a command was refused, in the words of the console's buttons. What is not here is told as the server tells it.

/** @typedef {{air_bar: number, injected: string[]}} Around what the robot is like just now */

/** By the reason of the answer. @type {Object<string, (around: Around) => string>} */
const WORDS = {
  not_in_control: () => "press Take control first",
  not_armed: () => "the robot is not armed: press Ready; after a stop or a hold press Clear fault before",
  not_disarmed: () => "the robot is armed: press Disarm first",
  moving: () => "the robot is moving: wait for the end of the motion, or press Hold, or in a walk Stop walking",
  not_moving: () => "the robot does not walk; Hold ends any other motion",
  latched: () => "a stop or a hold is latched: press Clear fault, and Ready once the reservoir is full",
  no_air: ({ air_bar }) => `the reservoir is not full yet${Number.isFinite(air_bar) ? `, at ${air_bar.toFixed(1)} bar` : ""}: wait, then press Ready again; if it stays so, check compressor, hose and regulator`,
  interrupted: () => "a stop, a hold or another command came between: Faults and Events tell which",
};

/** @param {string} command @param {import("./link.js").Answer} answer @param {Around} around */
export function refusal(command, { reason, text }, around) {
  const own = reason && Object.hasOwn(WORDS, reason) ? WORDS[reason](around) : text || reason || "";
  // A board keeps a fault whose cause is there.
  const kept = command === "ClearFault" && reason?.startsWith("board_") && around.injected.length > 0;
  return kept ? `${own} Injected: ${around.injected.join(", ")}. Press End under Faults to try, then Clear fault.` : own;
}
