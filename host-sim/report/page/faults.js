// Faults on the console's page: what is wrong with the robot, and what to do about it; and faults that
// somebody tries on a simulated one.
import { html, say, sign, fixed } from "./dom.js";

/** Boards by their address from 1 on, as the target of a fault names them. */
const BOARDS = ["joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "wheel7", "wheel8"];
/** Why all axes hold although no board has a fault, and what to do. @type {Object<string, [string, string]>} */
const HOLDS = {
  operator_lost: ["Operator lost: the robot holds.", "Press Take control, Clear fault and Ready."],
};
const LOST = "The operator saw nothing new for 0.4 s. Keep the page in front, and check the connection.";
/** The boards' fault EmergencyStop, and how it is ended on this page. */
const E_STOP = 39;
const AFTER_STOP = "Remove the cause, then press Clear fault, and Ready once the reservoir is full.";
/** A pause of the page, or of the line, that is shorter does not lose an operator, ms. */
const PAUSE_MS = 250;
/** What was longer ago is not why an operator is lost now, ms. */
const RECENT_MS = 5000;

/** What may have kept this page from being seen. */
export class Pauses {
  constructor() {
    this.ran_ms = performance.now();
    /** The longest of late, and when it ended. @type {Object<"page" | "line", {ms: number, at_ms: number}>} */
    this.longest = { page: { ms: 0, at_ms: -Infinity }, line: { ms: 0, at_ms: -Infinity } };
  }

  /** The page runs. @param {number} late_ms how late the line is */
  run(late_ms) {
    const now = performance.now();
    this.note("page", now - this.ran_ms, now);
    this.note("line", late_ms, now);
    this.ran_ms = now;
  }

  /** @param {"page" | "line"} side @param {number} ms @param {number} now */
  note(side, ms, now) {
    const { longest } = this;
    if (ms > PAUSE_MS && (ms >= longest[side].ms || now - longest[side].at_ms > RECENT_MS)) longest[side] = { ms, at_ms: now };
  }

  /** Why the operator on this page was not seen. A page that did not run heard nothing either. */
  reason() {
    const now = performance.now();
    const recent = ({ ms, at_ms }) => (now - at_ms <= RECENT_MS ? ms : 0);
    const [page, line] = [recent(this.longest.page), recent(this.longest.line)];
    if (page > 0) return `For ${fixed(page / 1000, 2)} s this page did not run; the computer may be busy.`;
    return line > 0 ? `An answer took ${fixed(line / 1000, 2)} s: the line or the robot's computer is slow.` : LOST;
  }
}

/** Injected faults that act on one of these boards, or on no board of its own. @param {string[]} faults @param {number[]} boards */
const acting = (faults, boards) =>
  faults.filter((fault) => {
    const board = BOARDS.indexOf(/:(\w+)/.exec(fault)?.[1] ?? "") + 1;
    return board === 0 || boards.includes(board);
  });

/** Why the operator was lost, as the event of it tells; nothing where it does not.
 * @param {import("./events.js").RobotEvent} event */
function told({ holder, revoked_by, gone }) {
  if (revoked_by) return `${revoked_by}, at the robot's computer, has revoked the control of ${holder}.`;
  return gone ? `The connection of ${holder} has ended: its page was closed or reloaded, or its program has ended.` : "";
}

/** What is wrong. @param {(fault: string) => boolean} ours whether this page has injected a fault
 * @param {() => boolean} looks whether who sees it may only look */
export function faultsView(ours, looks) {
  const list = html("ul", { class: "faults" });
  /** Why the operator was lost, as found when that was seen. */
  let why = "";
  /** The newest loss of an operator. @type {import("./events.js").RobotEvent | null} */
  let loss = null;
  let shown = "";
  const inTheWay = (faults) => faults.map((fault) => html("p", {}, `Injected${ours(fault) ? " by you" : ""}: `, html("code", {}, fault), ". Press End under Faults to try, then Clear fault."));
  const card = (title, remedy, injected, number) => html("li", { class: "fault" }, html("b", {}, sign("alarm"), ` ${title}`), html("p", {}, remedy), inTheWay(injected), number && html("small", {}, number));
  return {
    root: html("section", { class: "panel faultlist", "data-live": true }, html("h2", {}, "Faults"), list),
    /** @param {import("./events.js").RobotEvent} event */
    event(event) {
      if (event.code !== "hold" || event.detail !== "operator_lost" || event.number <= (loss?.number ?? 0)) return;
      loss = event;
      why = told(event);
      shown = "";
    },
    /** One line for what many boards have. @param {any} state @param {boolean} drove whether this page was in control @param {Pauses} pauses */
    state(state, drove, pauses) {
      const key = JSON.stringify([state.hold, state.faults, state.boards.map((b) => b.faults)]);
      if (key === shown) return;
      shown = key;
      if (state.hold !== "operator_lost") why = "";
      // The event of it may come a moment later, and then counts.
      else if (why === "") why = (loss && told(loss)) || (drove ? pauses.reason() : LOST);
      const rows = new Map();
      for (const b of state.boards) for (const f of b.faults) rows.set(f.number, { fault: f, boards: [...(rows.get(f.number)?.boards ?? []), b.address] });
      const [cause, remedy] = HOLDS[state.hold] ?? [`All axes hold: ${state.hold?.replaceAll("_", " ")}.`, "Fix what the boards and events report, then clear the fault and press Ready."];
      // A stop is told by the boards.
      const held = state.hold && state.hold !== "emergency_stop" && state.hold !== "board_fault";
      const cards = [...rows.values()].map(({ fault: f, boards: of }) => card(`${of.length > 1 ? "Boards" : "Board"} ${of.join(", ")}: ${f.cause}`, f.number === E_STOP && !looks() ? AFTER_STOP : f.remedy, acting(state.faults, of), `${f.name}, number ${f.number}`));
      // Who holds on to a fault of their own is told once.
      if (held) cards.unshift(card(cause, `${why} ${looks() ? "" : remedy}`.trim(), cards.length > 0 || state.hold === "operator_lost" ? [] : state.faults, ""));
      list.replaceChildren(...(cards.length > 0 ? cards : [html("li", { class: "none" }, sign("met"), " No board has a fault.")]));
    },
  };
}

/** Faults to try. `command` gives one to the robot and shows its answer here, too.
 * @param {(name: string, args: Object<string, any>, beside: HTMLElement) => Promise<boolean>} command */
export function faultsToTry(command) {
  /** Those that this page has injected. @type {Set<string>} */
  const ours = new Set();
  /** @type {any[]} */
  let known = [];
  const which = html("select", { "aria-label": "Fault", onchange: () => choose() });
  const target = html("select", { "aria-label": "Target" });
  const value = html("input", { "aria-label": "Value", size: 8, spellcheck: "false", inputmode: "decimal" });
  const inject = html("button", { class: "btn", type: "button", onclick: () => begin() }, "Inject");
  const effect = html("p", { class: "effect" });
  const answer = html("p", { class: "answer", role: "status" });
  const active = html("ul", { class: "injected" });
  const chosen = () => known.find((f) => f.fault === which.value);
  function choose() {
    const { places, value: number, effect: what } = chosen();
    const before = target.value;
    target.replaceChildren(...places.map((place) => html("option", { selected: place === before }, place)));
    target.hidden = places.length === 0;
    value.hidden = !number;
    value.value = "";
    value.placeholder = number ? `${number.default} ${number.unit === "1" ? "" : number.unit}`.trim() : "";
    value.title = number ? `${number.description}, ${number.min} to ${number.max} ${number.unit === "1" ? "" : number.unit}`.trim() : "";
    say(effect, number ? `${what} Value: ${value.title}.` : what);
  }
  async function begin() {
    const number = value.hidden ? "" : value.value.trim();
    const fault = `${which.value}${target.hidden ? "" : `:${target.value}`}${number && `=${number}`}`;
    // The state that tells of it may come before the answer.
    ours.add(fault.split("=")[0]);
    await command("Inject", { fault }, answer);
  }
  return {
    root: html("section", { class: "panel try", "aria-label": "Faults to try" }, html("h2", {}, "Faults to try"), html("div", { class: "row" }, which, target, value, inject), effect, answer, active),
    /** @param {any[]} list */
    offer(list) {
      known = list;
      which.replaceChildren(...list.map((f) => html("option", { value: f.fault, title: f.effect }, f.fault)));
      choose();
    },
    /** Whether this page has injected it. @param {string} fault */
    ours: (fault) => ours.has(fault.split("=")[0]),
    /** @param {string[]} faults those under way */
    state(faults) {
      if (active.dataset.active === faults.join()) return;
      active.dataset.active = faults.join();
      active.replaceChildren(...faults.map((fault) => html("li", {}, fault, html("button", { class: "btn", type: "button", onclick: () => command("EndFault", { fault }, answer) }, "End"))));
    },
  };
}
