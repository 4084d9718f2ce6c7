// The console: the robot as it is now, and what its operator may do.
import { html, svg, set, say, fixed, sign } from "./dom.js";
import { reliefHeights } from "./ground.js";
import { sideView, topView, footView } from "./robot.js";
import { Link, Refused } from "./link.js";
import { HZ, Scope } from "./scope.js";
import { LINKS, boardsView, titled } from "./boards.js";
import { Pauses, faultsToTry, faultsView, latched } from "./faults.js";
import { driver } from "./drive.js";
import { isBlind, isUnread, jointCard } from "./joint.js";
import { eventsView } from "./events.js";
import { parametersView } from "./parameters.js";
import { BROWSER, filled, refusal, spoken } from "./words.js";

/** What is older is not shown as if it were now, ms. */
const STALE_MS = 300;
const BEAT_MS = 50;
/** The page is drawn so often at most, and on a slow computer at least, ms. */
const FRAME_MS = 25;
const LONGEST_APART_MS = 100;
/** Frames are a little early or late, ms. */
const BEFORE_MS = 5;
/** A computer that takes longer to draw is slow, ms: it draws the lesser parts once in so many drawings. */
const SLOW_MS = 45;
const LESSER = 4;
/** Who asked for the control longer ago may not wait for it any more. */
const ASKED_MS = 20000;
/** How often the line is measured. */
const ECHO_MS = 100;
/** Losses of the control are counted within so long, ms. */
const LOSSES_MS = 60000;
/** Ready waits for the air so long, and asks again so often where nobody measures it, ms. */
const AIR_MS = 90000;
const ASK_AIR_MS = 2000;
/** In a list of plain questions and answers: how often it is looked at. */
const LOOK_MS = 100;
const JOINTS = [1, 2, 3, 4, 5, 6].map((board) => titled([board]));
const WHEELS = ["/wheel/7", "/wheel/8"];
const AIR = "/supply";

/** The key from the address, which must not stay there, or of this tab. @returns {import("./link.js").Identity | null} */
function identity() {
  const given = /^#([kv])=([0-9a-f]{64})$/.exec(location.hash.trim());
  if (given) {
    sessionStorage.setItem("key", given[2]);
    // After #k= either key may stand; which of them it is, the server knows.
    sessionStorage.setItem("role", given[1] === "k" ? "control" : "view");
    history.replaceState(null, "", location.pathname);
  }
  const key = sessionStorage.getItem("key");
  const role = sessionStorage.getItem("role") === "control" ? "control" : "view";
  return key ? { key, role, name: BROWSER } : null;
}

/** Newest values by channel, and when the newest sample came.
 * @type {{of: Map<string, any>, t_us: number, heard_ms: number, state: any}} */
const now = { of: new Map(), t_us: 0, heard_ms: -Infinity, state: null };
/** @type {Link | null} */
let link = null;
/** Why the page shows nothing new. */
let lost = "";

const page = /** @type {HTMLElement} */ (document.getElementById("page"));
const cell = (name, minor = false) => {
  const value = html("b", {}, "–");
  return { root: html("div", { class: minor ? "cell minor" : "cell" }, html("small", {}, name), value), value };
};
/** With a hint below its name. */
const button = (name, hint, act) => html("button", { class: "btn", type: "button", onclick: act }, html("span", {}, name), hint && (hint instanceof Node ? hint : html("small", {}, hint)));

// ---- answers ----
/** Code and layer of each command, by its name. @type {Map<string, string>} */
const codes = new Map();
const answer = html("p", { class: "answer", role: "status" }, "No command sent yet.");
/** What the robot is like, for words. */
const around = () => ({ air_bar: air_bar(), full_bar, injected: now.state?.faults ?? [], lost_s: loss?.at_s ?? null });
/** @param {string} what @param {import("./link.js").Answer} given @param {HTMLElement[]} places where it is shown */
function tell(what, given, places = [answer]) {
  const { status, reason, holder } = given;
  const held = holder ? ` (${holder} is in control)` : "";
  // A command that ran for long and was ended was not refused.
  const verdict = reason === "interrupted" ? "ended early" : "refused";
  const words = { done: "done", unknown: "no answer: look at the robot" }[status] ?? `${verdict}: ${refusal(what, given, around())}${held}`;
  const code = codes.get(what);
  for (const place of places) {
    place.replaceChildren(sign(status === "done" ? "met" : "warn"), ` ${spoken(what)}: ${words}`);
    place.title = code ? `${what} ${code}` : "";
    place.classList.toggle("bad", status !== "done");
  }
}
/** How many commands this page has given. */
let commanded = 0;
/** @param {string} name @param {Object<string, any>} [args] @param {() => void} [taken] @param {HTMLElement[]} [beside] shows the answer, too */
async function command(name, args, taken, beside = []) {
  commanded += 1;
  const places = [answer, ...beside];
  const given = await ask(name, args, taken, places);
  if (given) tell(name, given, places);
  return given?.status === "done";
}
/** The same without a word about its end. @param {string} name @param {Object<string, any>} [args] @param {() => void} [taken] @param {HTMLElement[]} [places] */
async function ask(name, args, taken, places = []) {
  if (!link) {
    say(answer, `${spoken(name)}: not sent, there is no connection.`);
    return null;
  }
  for (const place of places) say(place, `${spoken(name)} …`);
  // Who gives the control away does not lose it.
  if (GIVE_AWAY.has(name)) gave = true;
  const given = await link.command(name, args, taken);
  if (GIVE_AWAY.has(name) && given.status !== "done") gave = false;
  return given;
}
/** Arms; where the reservoir is not full it waits for the air, until another command is given. */
async function arm() {
  if (!link) return command("Arm");
  commanded += 1;
  const [turn, end_ms] = [commanded, performance.now() + AIR_MS];
  say(answer, "Arm …");
  for (;;) {
    const given = await ask("Arm");
    if (!given || turn !== commanded) return false;
    if (given.reason !== "no_air" || performance.now() > end_ms) {
      tell("Arm", given);
      return given.status === "done";
    }
    const asked_ms = performance.now();
    answer.classList.remove("bad");
    // A full reservoir whose switch is open has lost its source: that is asked about seldom, too.
    while (performance.now() < asked_ms + LOOK_MS || (performance.now() < asked_ms + ASK_AIR_MS && !(air_bar() >= full_bar))) {
      say(answer, `Ready waits for air${filled(around()) && `: ${filled(around())}`}. Any other button ends the wait.`);
      await new Promise((resolve) => setTimeout(resolve, LOOK_MS));
      if (turn !== commanded || !link) return false;
    }
  }
}
async function getReady() {
  if (!mine() && !(await command("TakeControl"))) return;
  if (await arm()) await command("Stand");
}

// ---- stop ----
/** A stop that is not answered for so long is not confirmed. */
const UNCONFIRMED_MS = 200;
/** How often STOP was pressed. */
let pressed = 0;
const stopButton = html("button", { class: "stop", type: "button", onclick: stop }, html("b", {}, "STOP"), html("kbd", { class: "key" }, "Esc"));
async function stop() {
  byHand.letGo();
  commanded += 1;
  pressed += 1;
  const turn = pressed;
  if (!link) return unconfirmed();
  const timer = setTimeout(unconfirmed, UNCONFIRMED_MS);
  const given = await link.stop();
  clearTimeout(timer);
  if (given.status !== "done") return unconfirmed();
  // It says nothing of one that was pressed after it.
  if (turn !== pressed) return;
  alarm.hidden = true;
  tell("STOP", given);
}
const alarm = html("p", { class: "banner alarm", role: "alert", hidden: true }, sign("alarm"), " STOP NOT CONFIRMED: CUT THE AIR");
function unconfirmed() {
  alarm.hidden = false;
  // No stop of before is taken for this one.
  answer.replaceChildren(sign("warn"), " STOP: not confirmed");
  answer.classList.add("bad");
}

// ---- head ----
const head = { robot: cell("Robot", true), mode: cell("State"), gait: cell("Gait"), link: cell("Link"), time: cell("Time", true), speed: cell("Clock", true), control: cell("Control"), you: cell("You"), air: cell("Air, absolute") };
const banner = html("p", { class: "banner", role: "alert", hidden: true });

// ---- views ----
const pictures = { side: svg("svg"), top: svg("svg"), left: svg("svg"), right: svg("svg") };
/** @type {any} */
let views = null;
/** What no board tells is not a number. */
const known = (value, otherwise = 0) => (Number.isFinite(value) ? value : otherwise);
function pose() {
  const joint = (i) => now.of.get(`/joint/${i + 1}`);
  const legs = [0, 1].map((side) => {
    const foot = now.of.get(side === 0 ? "/foot/left" : "/foot/right") ?? {};
    const three = [0, 1, 2].map((i) => joint(3 * side + i));
    return {
      commanded_mm: three.map((s) => known(s?.commanded_mm, 90)),
      sensed_mm: three.map((s) => known(s?.sensed_mm, 90)),
      load_n: foot.normal_force_n || 0,
      switches: foot.switches ?? 0,
      blind: [0, 1, 2].some((i) => isBlind(now.state?.boards[3 * side + i])),
    };
  });
  const body = now.of.get("/body") ?? {};
  /** @type {[number, number]} */
  const wheels_mm = [known(now.of.get(WHEELS[0])?.sensed_mm), known(now.of.get(WHEELS[1])?.sensed_mm)];
  // Of real boards nobody knows where the robot is; on their wheels it has gone so far.
  const place = { y_mm: known(body.y_mm), z_mm: known(body.z_mm, drawing.wheel_radius_mm), yaw_deg: known(body.yaw_deg) };
  return { travel_mm: known(body.x_mm, (wheels_mm[0] + wheels_mm[1]) / 2), wheels_mm, pitch_deg: known(body.pitch_deg), ...place, legs };
}
/** The same in space; real boards stand level where their wheels have brought them. */
function spacePose(robot) {
  const body = now.of.get("/body") ?? {};
  return { ...robot, x_mm: robot.travel_mm, roll_deg: known(body.roll_deg) };
}
/** Pressure in the reservoir, bar; no number of real boards, none of which measures it. */
const air_bar = () => now.of.get(AIR)?.pressure_bar ?? NaN;
/** That at which it is full. */
let full_bar = NaN;
/** Sizes of the robot, and the ground if it is not level; from the server. @type {any} */
let drawing = null;
/** @type {any} */
let relief = null;
/** The view in space, once somebody has asked for it. @type {any} */
let space = null;
const inSpace = html("button", { class: "btn", type: "button", "aria-pressed": "false", "aria-label": "Robot in space, 3D", onclick: toggleSpace }, "3D");
const noSpace = html("p", { class: "no-space", role: "status", hidden: true });
const plan = html("div", { class: "plan" }, pictures.top, noSpace, inSpace);
function showSpace(show) {
  set(inSpace, { "aria-pressed": show });
  plan.classList.toggle("in-space", show);
}
async function toggleSpace() {
  const show = inSpace.getAttribute("aria-pressed") !== "true";
  showSpace(show);
  noSpace.hidden = true;
  if (!show || space) return;
  const failed = (why) => {
    space = null;
    showSpace(false);
    noSpace.hidden = false;
    say(noSpace, `No view in space: ${why}. Press 3D to try again.`);
  };
  const module = await import("./view3d.js").catch(() => failed("the server does not give its parts"));
  if (!module || space) return;
  try {
    space = module.view3d(drawing, relief, failed);
    plan.prepend(space.root);
  } catch (error) {
    failed(error instanceof Error ? error.message : String(error));
  }
}

// ---- joints ----
const joints = JOINTS.map((name, i) => jointCard(name, (stroke) => command("JointReference", { joint: i + 1, stroke })));

// ---- faults, boards, events ----
const toTry = faultsToTry((name, args, beside) => command(name, args, undefined, [beside]), () => clear);
const faults = faultsView(toTry.ours, (fault) => command("EndFault", { fault }), () => clear);
const pauses = new Pauses();
/** Why all axes hold where an operator was lost. */
const OPERATOR_LOST = "operator_lost";
/** Since when this page is in control. @type {number | null} */
let took_ms = null;
/** Commands that give the control away, and whether one was given. */
const GIVE_AWAY = new Set(["ReleaseControl", "HandOver"]);
let gave = false;
/** Who has taken it away. */
let revoker = "";
/** How this page has lost its control, until it has it again; and when, of late. @type {import("./faults.js").Loss | null} */
let loss = null;
/** @type {number[]} */
let losses = [];
/** Sees whether this page has still its control. */
function watchControl() {
  const at_ms = performance.now();
  if (mine()) {
    took_ms ??= at_ms;
    // Of a robot that holds for it, it goes on to be told.
    if (now.state?.hold !== OPERATOR_LOST) loss = null;
    revoker = "";
  } else if (took_ms !== null) {
    if (!gave) {
      losses = [...losses.filter((ms) => at_ms - ms < LOSSES_MS), at_ms];
      const why = revoker ? `${revoker}, at the robot's computer, has revoked it.` : pauses.reason();
      loss = { at_s: now.t_us * 1e-6, kept_ms: at_ms - took_ms, times: losses.length, why };
    }
    took_ms = null;
  }
  if (took_ms === null) gave = false;
  // Somebody else drives: there is nothing to take again.
  if (!mine() && now.state?.control && !now.state.control.ended && now.state.hold !== OPERATOR_LOST) loss = null;
}
const boards = boardsView();
/** @type {Scope | null} */
let scope = null;
const events = eventsView(() => link?.session ?? "");
// ---- recording ----
const record = button("Record", "", () => command(recording() ? "RecordStop" : "RecordStart"));
const recorded = html("p", { class: "effect", role: "status" }, "Not recording.");
const recording = () => Boolean(now.state?.recording && !now.state.recording.failure);
let lastRecording = "";
function showRecording(state) {
  const { recording: r } = state;
  record.classList.toggle("on", recording());
  say(record.firstElementChild, recording() ? "Stop recording" : "Record");
  if (r?.failure) say(recorded, `Recording ${r.id} ended early: ${r.failure}. The robot goes on; make room, then record again.`);
  else if (r) {
    lastRecording = r.id;
    say(recorded, `${r.id}, ${fixed((state.master_us - r.since_us) * 1e-6)} s${r.dropped > 0 ? `; ${r.dropped} messages lost: the disk is too slow` : ""}`);
  } else say(recorded, lastRecording ? `Recorded: ${lastRecording}. On the command line, “wheeleg replay runs/live/${lastRecording}” repeats it and “wheeleg view runs/live/${lastRecording}” shows its log, unless the server was given another folder.` : "Not recording.");
  recorded.classList.toggle("bad", Boolean(r?.failure) || (r?.dropped ?? 0) > 0);
}

// ---- forms ----
/** @type {any[]} */
let commands = [];
const form = html("form", { class: "form" });
const fields = html("div", { class: "fields" });
const which = html("select", { "aria-label": "Command", onchange: showFields });
const effect = html("p", { class: "effect" });
form.append(html("div", { class: "row" }, which, html("button", { class: "btn" }, "Send")), effect, fields);
function showFields() {
  const chosen = commands.find((c) => c.name === which.value);
  if (!chosen) return;
  say(effect, chosen.effect);
  fields.replaceChildren(
    ...chosen.arguments.map((a) => {
      const label = a.unit === "1" ? a.name : `${a.name}, ${a.unit}`;
      const range = a.min != null ? `${a.min} to ${a.max}` : "";
      let input;
      if (a.choices) input = html("select", { name: a.name, "data-kind": "text" }, a.choices.map((c) => html("option", { selected: c === a.usual }, c)));
      else if (a.kind === "flag") input = html("select", { name: a.name, "data-kind": "flag" }, html("option", {}, "false"), html("option", {}, "true"));
      else if (a.kind === "text" || a.kind === "parameter") input = html("input", { name: a.name, "data-kind": "text" });
      else input = html("input", { name: a.name, "data-kind": "number", type: "number", step: "any", min: a.min, max: a.max, required: true, value: a.usual ?? (a.min != null && a.min > 0 ? a.min : 0) });
      return html("label", { title: a.description }, html("span", {}, label), input, html("small", {}, range));
    }),
  );
}
form.addEventListener("submit", (submit) => {
  submit.preventDefault();
  const args = {};
  for (const input of fields.querySelectorAll("[name]")) {
    const field = /** @type {HTMLInputElement} */ (input);
    args[field.name] = field.dataset.kind === "number" ? Number(field.value) : field.dataset.kind === "flag" ? field.value === "true" : field.value;
  }
  command(which.value, args);
});

// ---- what the operator does ----
const take = button("Take control", "", () => command(mine() ? "ReleaseControl" : "TakeControl"));
const ready = button("Ready", "take, arm, stand", getReady);
const walk = button("Walk", "straight", () => {
  if (!stepping()) return byHand.walk();
  byHand.letGo();
  command("StopGait");
});
const hold = button("Hold", html("small", { class: "key" }, "Space"), () => command("Hold"));
const disarm = button("Disarm", "", () => command("Disarm"));
const clear = button("Clear fault", "", () => command("ClearFault"));
/** Commands that a button gives: whoever points at it sees their codes. @type {[HTMLElement, string[]][]} */
const gives = [
  [take, ["TakeControl", "ReleaseControl"]],
  [ready, ["TakeControl", "Arm", "Stand"]],
  [walk, ["Walk", "StopGait"]],
  [hold, ["Hold"]],
  [disarm, ["Disarm"]],
  [clear, ["ClearFault"]],
  [record, ["RecordStart", "RecordStop"]],
];
const byHand = driver(command);
const parameters = parametersView(command, () => (link ? link.ask("parameters") : Promise.reject(new Error(lost))));
/** Who asked for the control last, and how long that is offered here. @type {{session: string, until_ms: number} | null} */
let heir = null;
/** What is said of that. */
let asking = "";
const handOver = html("div", { class: "row", hidden: true }, html("button", { class: "btn", type: "button", onclick: () => heir && command("HandOver", { to: heir.session }) }));
const mine = () => Boolean(link && now.state?.control?.session === link.session && !now.state.control.ended);
const stepping = () => Boolean(now.state?.stepping);

/** Where a space is typed, or opens a list. A slider is no such field. @param {KeyboardEvent} key */
const inField = ({ target }) => target instanceof Element && target.matches("input:not([type=range]), select, textarea");
/** Whether it holds. A space on STOP stops, which is more. @param {KeyboardEvent} key */
const holds = (key) => key.key === " " && !inField(key) && !(key.target instanceof Node && stopButton.contains(key.target));
addEventListener(
  "keydown",
  (key) => {
    if (key.key === "Escape") {
      key.preventDefault();
      stop();
    } else if (holds(key)) {
      key.preventDefault();
      if (key.repeat) return;
      byHand.letGo();
      command("Hold");
    } else if (key.key === "?" && !inField(key)) {
      keys.open = !keys.open;
      if (keys.open) keys.scrollIntoView({ block: "center" });
    }
  },
  true,
);
// Some browsers press the button that has the focus when the key comes up.
addEventListener("keyup", (key) => holds(key) && key.preventDefault(), true);
const keys = html("details", { class: "keyhelp" }, html("summary", {}, "Keys"), html("dl", {}, [["Esc", "STOP, from anywhere"], ["Space", "Hold, except in text and number fields and in lists; on STOP it stops"], ["↑ ↓ ← →", "drive by hand, on its buttons"], ["← →", "on a plot: its cursor, by 20 ms; with Shift by 200 ms"], ["↑ ↓ ← → + −", "on the view in space: turn it, and come nearer or go away"], ["?", "this list"]].flatMap(([key, what]) => [html("dt", {}, html("kbd", {}, key)), html("dd", {}, what)])));
const controls = html("section", { class: "panel control", "data-live": true, "aria-label": "Control" }, html("div", { class: "buttons" }, take, ready, walk, hold, clear, disarm), handOver, answer);
const recorder = html("section", { class: "panel", "aria-label": "Recording" }, html("h2", {}, "Recording"), html("div", { class: "buttons one" }, record), recorded);
/** Who does not look does not drive. */
const leaves = () => {
  byHand.stop();
  if (mine()) command("Hold");
};
document.addEventListener("visibilitychange", () => document.hidden && leaves());
addEventListener("pagehide", leaves);
// Whoever reloads or closes the page in mid-walk loses the robot, which holds: the browser asks before.
addEventListener("beforeunload", (event) => mine() && stepping() && event.preventDefault());

// ---- the page ----
function build({ robot, commands: list, faults: injectable, holds }) {
  ({ drawing, relief } = robot);
  full_bar = robot.full_bar ?? NaN;
  views = { side: sideView(pictures.side, robot.drawing, relief ? reliefHeights(relief) : undefined), top: topView(pictures.top, robot.drawing), feet: [footView(pictures.left, "Left"), footView(pictures.right, "Right")] };
  say(head.robot.value, robot.name);
  commands = list;
  for (const { name, code, layer } of list) codes.set(name, `0x${code.toString(16).padStart(4, "0")}, layer ${layer}`);
  for (const [pressed, names] of gives) pressed.title = names.map((name) => `${name} ${codes.get(name)}`).join("; ");
  which.replaceChildren(...[0, 1, 2].map((layer) => html("optgroup", { label: ["Layer 0: joints, wheels, boards", "Layer 1: gait", "Simulation, and who is in control"][layer] }, list.filter((c) => c.layer === layer).map((c) => html("option", { value: c.name }, `${c.name} 0x${c.code.toString(16).padStart(4, "0")}`)))));
  if (link?.identity.role === "view") say(answer, "You have the view key: you may watch, and press STOP. Driving needs the control key.");
  say(head.you.value, "watching only");
  which.value = "JointReference";
  showFields();
  toTry.offer(injectable);
  faults.know(holds);
  byHand.begin(list.find((c) => c.name === "Walk")?.arguments ?? []);
  const top = html(
    "header",
    { class: "top" },
    html(
      "div",
      { class: "bar" },
      html("h1", {}, "Wheeleg ", html("small", {}, robot.simulated ? "simulated" : "boards at a serial port")),
      html("div", { class: "cells", "data-live": true }, head.mode.root, head.gait.root, head.control.root, link?.identity.role === "view" && head.you.root, head.air.root, head.link.root, head.time.root, head.speed.root, head.robot.root),
      html("div", { class: "stopbox" }, stopButton),
    ),
    alarm,
    banner,
  );
  // What stays in sight below it goes down where a banner comes.
  new ResizeObserver(() => document.documentElement.style.setProperty("--top", `${top.offsetHeight}px`)).observe(top);
  page.replaceChildren(
    top,
    ...(isSecureContext ? [] : [html("p", { class: "banner", role: "note" }, sign("warn"), " Not protected: anyone on the network can read and alter what is shown. From here the robot can be looked at and stopped, not driven.")]),
    html(
      "main",
      {},
      // After STOP the keyboard comes to what is done, and only then to what is seen.
      html(
        "div",
        { class: "col does" },
        controls,
        faults.root,
        boards.root,
        byHand.root,
        recorder,
        html("section", { class: "panel" }, html("h2", {}, "Any command"), form),
        robot.simulated && toTry.root,
        keys,
      ),
      html(
        "div",
        { class: "col sees" },
        html("section", { class: "panel views", "data-live": true, "aria-label": "Robot" }, html("div", { class: "side" }, pictures.side, html("p", { class: "keys" }, html("span", { class: "asked-key" }, "asked"), html("span", { class: "sensed-key" }, "sensed"), !robot.simulated && html("span", {}, "attitude and forces: not measured"))), plan, html("div", { class: "feet" }, html("figure", {}, pictures.left, html("figcaption", {}, "left foot")), html("figure", {}, pictures.right, html("figcaption", {}, "right foot")))),
        html("section", { class: "joints", "aria-label": "Joints" }, joints.map((j) => j.root)),
        scope?.root,
        events.root,
        parameters.root,
      ),
    ),
  );
}

/** Who is in control, or for whom control is reserved. */
function whose({ control, reserved_for: reserved }) {
  if (mine()) return "you";
  if (control) return control.ended ? `${control.holder}, ${control.ended}` : control.holder;
  if (reserved) return `reserved for ${reserved.session === link?.session ? "you" : reserved.name}`;
  return "free";
}

const ROLE = { armed: "ARMED", disarmed: "disarmed" };
function showState(state) {
  const stopped = latched(state);
  say(head.mode.value, !state.alive ? "master is dead" : stopped ?? (state.armed ? ROLE.armed : ROLE.disarmed));
  head.mode.root.classList.toggle("alarm", Boolean(stopped) || !state.alive);
  say(head.gait.value, state.step > 0 && state.stepping ? `${state.phase}, step ${state.step}` : state.phase);
  say(head.control.value, whose(state));
  const speed = state.pace.paused ? "paused" : `× ${fixed(state.pace.factor)}`;
  say(head.speed.value, speed);
  say(head.air.value, `${fixed(air_bar())} bar`);
  say(take.firstElementChild, mine() ? "Release control" : "Take control");
  say(walk.firstElementChild, state.stepping ? "Stop walking" : "Walk");
  say(walk.lastElementChild, state.stepping ? "feet down" : byHand.about());
  boards.state(state);
  showRecording(state);
  watchControl();
  const late = !mine() || !heir || performance.now() > heir.until_ms;
  if (late && !handOver.hidden && answer.textContent === asking) say(answer, "");
  handOver.hidden ||= late;
  faults.state(state, { session: link?.session ?? "", looks: link?.identity.role === "view", mine: mine(), air_bar: air_bar(), full_bar, lost: loss });
  toTry.state(state.faults);
}

/** Who may only look, and who has no connection, presses nothing but STOP. */
function permit() {
  const drives = link?.identity.role === "control";
  for (const part of [controls, byHand.root, toTry.root, recorder, form]) {
    for (const one of part.querySelectorAll("button, input, select")) one.toggleAttribute("disabled", !drives);
  }
  parameters.allow(drives);
  for (const joint of joints) joint.allow(drives);
}

/** When the page was drawn last; the longest wait for the browser since, which is how long it takes to draw; when it was free last; how
 * often the lesser parts were left out. Times in ms. */
const drawing_ms = { at: -Infinity, took: 0, free: performance.now() };
let leftOut = 0;
/** Draws the newest state, and only then counts it as seen. What a computer takes long to draw is drawn less often, so that there is time
 * for beats and stops; the head and the robot come first, so that the operator is not lost over the rest. @param {number} at_ms */
function paint(at_ms) {
  requestAnimationFrame(paint);
  pauses.run(link?.late_ms() ?? 0);
  drawing_ms.took = Math.max(drawing_ms.took, at_ms - drawing_ms.free);
  drawing_ms.free = at_ms;
  // At 60 frames a second: every other one.
  const least_ms = Math.min(LONGEST_APART_MS, Math.max(FRAME_MS, 2 * drawing_ms.took - BEFORE_MS));
  if (!views || at_ms - drawing_ms.at < least_ms) return;
  const slow = drawing_ms.took > SLOW_MS;
  drawing_ms.at = at_ms;
  drawing_ms.took = 0;
  const silent = performance.now() - now.heard_ms;
  const age = Math.max(silent, link?.late_ms() ?? 0);
  const stale = lost !== "" || age > STALE_MS;
  document.body.dataset.state = stale ? "stale" : "live";
  banner.hidden = !stale;
  if (stale) {
    say(banner, lost || `Nothing new for ${fixed(age / 1000)} s: what is shown is old.`);
    say(head.link.value, `${fixed(age / 1000)} s old`);
    // What is old and still comes is drawn, and says that it is old.
    if (lost !== "" || silent > STALE_MS) return;
  }
  const robot = pose();
  views.side.update(robot);
  leftOut += 1;
  if (!slow || leftOut >= LESSER) {
    leftOut = 0;
    paintLesser(robot);
  }
  if (now.state) showState(now.state);
  if (!stale) say(head.link.value, link ? `${fixed(link.delay_ms, 0)} ms` : "–");
  say(head.time.value, `${fixed(now.t_us * 1e-6, 2)} s`);
  if (link) link.seen_us = Math.floor(now.t_us);
}

/** @param {ReturnType<typeof pose>} robot */
function paintLesser(robot) {
  if (space && plan.classList.contains("in-space")) space.update(spacePose(robot));
  else views.top.update(robot);
  robot.legs.forEach((state, i) => views.feet[i].update(state));
  joints.forEach((joint, i) => joint.update(now.of.get(`/joint/${i + 1}`), now.state?.boards[i]));
  scope?.paint(now.t_us * 1e-6);
}

const listener = {
  sample(topic, t_us, values) {
    now.of.set(topic, values);
    now.heard_ms = performance.now();
    now.t_us = Math.max(now.t_us, t_us);
    // A reading that is none has no value, as in a report.
    scope?.sample(topic, t_us * 1e-6, topic.startsWith("/joint/") && isUnread(values) ? { ...values, sensed_mm: NaN } : values);
    if (topic.startsWith("/link/")) boards.link(topic, values);
  },
  state(state) {
    now.state = state;
    now.heard_ms = performance.now();
    now.t_us = Math.max(now.t_us, state.master_us);
    permit();
  },
  event(event) {
    events.add(event);
    faults.event(event);
  },
  asked(by, session) {
    asking = `${by} asks for the control.`;
    say(answer, asking);
    heir = { session, until_ms: performance.now() + ASKED_MS };
    say(handOver.firstElementChild, `Hand the control over to ${by}`);
    handOver.hidden = false;
  },
  offered(by) {
    say(answer, `${by} hands the control over to you: press Take control within 2 s. Then it is free for everybody.`);
  },
  revoked(by) {
    revoker = by;
    say(answer, `${by}, at the robot's computer, has revoked your control. Check the robot, then take control again.`);
  },
  closed(why) {
    lost = `${why}. What is shown is old, and nothing is sent any more; reload the page to look again.`;
    link = null;
    permit();
    faults.end();
  },
};

/** Connects; the key after #k= may be the one that only looks and stops.
 * @param {import("./link.js").Identity} who */
async function connect(who) {
  const first = new Link(who, listener);
  try {
    return { opened: first, about: await first.open() };
  } catch (refused) {
    if (!(refused instanceof Refused && refused.wrong && who.role === "control")) throw refused;
    const looking = new Link({ ...who, role: "view" }, listener);
    const about = await looking.open().catch(() => {
      throw refused;
    });
    sessionStorage.setItem("role", "view");
    return { opened: looking, about };
  }
}

async function begin() {
  const who = identity();
  if (!who && /^#[kv]=/.test(location.hash)) {
    page.replaceChildren(html("p", { class: "alone", role: "alert" }, "What stands in the address after #k= or #v= is no key: a key has 64 digits, 0 to 9 and a to f. Open the address that `wheeleg serve` prints."));
    return;
  }
  if (!who) {
    page.replaceChildren(html("p", { class: "alone" }, isSecureContext ? "This page needs a key. Open an address that `wheeleg serve` prints on its terminal. Without a terminal, add #k= and the digits of a key file to this address: control.key to drive, view.key to watch and stop. `wheeleg serve` prints the paths of both." : "This page needs a key. Add #k= and the digits of the file view.key to this address; `wheeleg serve` prints its path."));
    return;
  }
  /** @type {Link} */
  let opened;
  const drawn = new Set([...JOINTS.map((_, i) => `/joint/${i + 1}`), "/foot/left", "/foot/right", "/body", AIR, ...WHEELS, ...LINKS]);
  const said = (error) => (error instanceof Error ? error.message : String(error));
  try {
    const connected = await connect(who);
    const { about } = connected;
    opened = connected.opened;
    link = opened;
    scope = new Scope([...opened.channels.values()], (topic) => {
      if (drawn.has(topic)) return;
      drawn.add(topic);
      link?.subscribe([topic], HZ);
    });
    build(about);
  } catch (error) {
    page.replaceChildren(html("p", { class: "alone", role: "alert" }, said(error)));
    return;
  }
  // From here on there is a robot that can be stopped: whatever fails, its page stays.
  setInterval(() => {
    pauses.run(link?.late_ms() ?? 0);
    if (mine()) link?.beat();
  }, BEAT_MS);
  setInterval(() => link?.echo(), ECHO_MS);
  await opened.subscribe([...drawn], HZ);
  if (!isSecureContext) return events.noPast("the server gives them over HTTPS only");
  try {
    const kept = (await opened.ask("events")).events;
    events.past(kept);
    kept.forEach(faults.event);
  } catch (error) {
    events.noPast(said(error));
  }
}
begin();
requestAnimationFrame(paint);
