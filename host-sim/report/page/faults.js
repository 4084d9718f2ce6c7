// Faults on the console's page: what is wrong with the robot, and what to do about it; and faults that
// somebody tries on a simulated one.
import { html, say, sign, fixed } from "./dom.js";
import { place, titled } from "./boards.js";
import { BROWSER, E_STOP, filled, stopper } from "./words.js";

/** Boards by their address from 1 on, as the target of a fault names them. */
const BOARDS = ["joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "wheel7", "wheel8"];
/** Who has seen nothing new for so long loses control, s. */
const LEASE_S = 0.4;
/** What the page needs beside a pause, at most: until it is drawn, and the next beat, s. */
const BESIDE_S = 0.15;
const LOST = `You saw nothing new for ${LEASE_S} s. Keep the page in front, and check the connection.`;
/** Who loses control again so soon has a computer that is too slow for it. */
const TOO_SLOW = "Close other programs, or drive from another computer.";
const WATCHING = "With the view key you can only watch and stop.";
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
    // What is shorter than the lease is no cause by itself.
    const lease = (ms) => `${ms < LEASE_S * 1000 ? `, to which up to ${BESIDE_S} s come for drawing and answering` : ""}; control ends after ${LEASE_S} s`;
    if (page > 0) return `For ${fixed(page / 1000, 2)} s this page did not run${lease(page)}. The computer may be busy.`;
    return line > 0 ? `An answer took ${fixed(line / 1000, 2)} s${lease(line)}. The line or the robot's computer is slow.` : LOST;
  }
}

/** A target, and where it is. @param {string} target */
function placed(target) {
  const board = BOARDS.indexOf(target) + 1;
  return board === 0 ? target : `${target}: ${place(board)}`;
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

/** How this page has lost its control: when, by the robot's clock, how long it had had it, and how often within a minute.
 * @typedef {{at_s: number, kept_ms: number, times: number, why: string}} Loss */
/** `mine`: this page is in control. @typedef {{session: string, looks: boolean, mine: boolean, air_bar: number, full_bar: number, lost: Loss | null}} Here of this page, and what it knows of the air */

/** Why all axes may hold, in the words of the server. @typedef {{hold: string, cause: string, consequence: string | null, remedy: string | null}} Hold */

/** Faults of a board that stay when it is armed no more, but for a stop. @param {any} board of the state */
const own = (board) => board.faults.filter((f) => f.number !== E_STOP);

/** What is latched, in a word or two each; the strongest first. @param {any} state */
export function latched(state) {
  const hold = state.emergency_stop ? "STOPPED" : state.hold && `HOLD: ${state.hold.replaceAll("_", " ")}`;
  const more = state.hold !== "board_fault" || state.emergency_stop ? state.boards.some((b) => own(b).length > 0) : false;
  return hold && `${hold}${more ? ", board fault" : ""}`;
}

/** What is wrong. @param {(fault: string) => boolean} ours whether this page has injected a fault @param {(fault: string) => void} end ends one @param {() => HTMLElement} next what is pressed after the last one has ended */
export function faultsView(ours, end, next) {
  /** @type {Map<string, Hold>} */
  let holds = new Map();
  /** The newest event of a hold, with the board that it is about, if it is about one. */
  let newest = { number: 0, detail: "", board: 0 };
  const list = html("ul", { class: "faults" });
  /** The newest loss of an operator. @type {import("./events.js").RobotEvent | null} */
  let loss = null;
  let shown = "";
  /** @param {string} title @param {string} [remedy] @param {string} [number] */
  const card = (title, remedy, number) => html("li", { class: "fault" }, html("b", {}, sign("alarm"), ` ${title}`), remedy && html("p", {}, remedy), number && html("small", {}, ` ${number}`));
  /** The one way on from all that is told, in its order. @param {any} state @param {Here} here @param {string[]} injected in the way @param {boolean} cause a cause that is not injected has to be removed */
  function wayOn(state, here, injected, cause) {
    if (here.looks) return html("li", { class: "way" }, html("p", {}, `Whoever has the control key must go on. ${WATCHING}`));
    const { control } = state;
    if (!here.mine && control && !control.ended) return html("li", { class: "way" }, html("p", {}, `${called(control.holder)} is in control, and can go on.`));
    const step = (...parts) => html("li", {}, ...parts);
    return html(
      "li",
      { class: "way" },
      html("p", {}, "To go on:"),
      html(
        "ol",
        {},
        !here.mine && step("Press Take control."),
        cause && step("Remove the cause, as described above."),
        injected.map((fault) => step(`${ours(fault) ? "You have injected" : "Injected is"} `, html("code", {}, fault), ". ", html("button", { class: "btn", type: "button", onclick: () => end(fault) }, `End ${fault}`))),
        step("Press Clear fault."),
        step("Press Ready, which waits for the air."),
      ),
    );
  }
  const called = (name) => (name === BROWSER ? "Another browser" : `“${name}”`);
  const again = ({ times, kept_ms }) => (times > 1 ? ` That was ${fixed(kept_ms / 1000)} s after you had taken it, and ${times} times within a minute. ${TOO_SLOW}` : "");
  /** Why nobody drives any more. @param {Here} here */
  function whyLost({ lost }) {
    if (lost) return `${(loss && told(loss)) || lost.why}${again(lost)}`;
    if (loss && told(loss)) return told(loss);
    return `${loss?.holder ? `${called(loss.holder)}, in control until then,` : "Whoever was in control"} saw nothing new for ${LEASE_S} s.`;
  }
  /** A robot that holds, and no board says why. @param {any} state @param {Here} here */
  function held(state, here) {
    const { cause, consequence, remedy } = holds.get(state.hold) ?? { cause: `All axes hold: ${state.hold.replaceAll("_", " ")}`, consequence: null, remedy: null };
    const lost = state.hold === "operator_lost";
    const missing = state.hold === "board_lost" ? state.boards.filter((b) => !b.present).map((b) => b.address) : [];
    const of = missing.length > 0 || newest.board === 0 || newest.detail !== state.hold ? missing : [newest.board];
    const more = consequence ?? (state.hold === "supply_lost" ? filled(here) : "");
    const title = `${of.length > 0 ? `${titled(of)}: ` : ""}${cause}${more && `: ${more}`}. The robot holds.`;
    return card(title, lost ? whyLost(here) : (remedy ?? ""));
  }
  /** A stop that somebody pressed. @param {any} state @param {Here} here @param {number[]} boards */
  function stopCard(state, here, boards) {
    const { stopped } = state;
    const by = stopped && stopper(stopped, here.session);
    const title = stopped ? `Stopped by ${by}, at ${fixed(stopped.at_us * 1e-6)} s.` : "Stopped.";
    const next = !here.looks && by && by !== "you" ? "Make sure that nobody needs the robot to stay stopped." : "";
    return card(title, next, `${boards.length > 0 ? `${titled(boards)}: ` : ""}EmergencyStop, number ${E_STOP}`);
  }
  return {
    root: html("section", { class: "panel faultlist", "data-live": true }, html("h2", {}, "Faults"), list),
    /** @param {Hold[]} all */
    know(all) {
      holds = new Map(all.map((one) => [one.hold, one]));
      shown = "";
    },
    /** Nothing can be pressed any more. */
    end() {
      for (const remedy of list.querySelectorAll("p, ol")) /** @type {HTMLElement} */ (remedy).hidden = true;
    },
    /** @param {import("./events.js").RobotEvent} event */
    event(event) {
      if (event.code === "hold" && event.number > newest.number) {
        newest = { number: event.number, detail: event.detail, board: event.board };
        shown = "";
      }
      if (event.code !== "hold" || event.detail !== "operator_lost" || event.number <= (loss?.number ?? 0)) return;
      loss = event;
      shown = "";
    },
    /** One line for what many boards have. @param {any} state @param {Here} here */
    state(state, here) {
      const air = state.hold === "supply_lost" ? filled(here) : "";
      const key = JSON.stringify([state.hold, state.emergency_stop, state.stopped, state.faults, state.boards.map((b) => [b.present, b.faults]), here.lost, here.mine, state.control?.holder, state.control?.ended, air]);
      if (key === shown) return;
      shown = key;
      const rows = new Map();
      for (const b of state.boards) for (const f of b.faults) rows.set(f.number, { fault: f, boards: [...(rows.get(f.number)?.boards ?? []), b.address] });
      const stop = rows.get(E_STOP);
      rows.delete(E_STOP);
      const cards = [...rows.values()].map(({ fault: f, boards: of }) => card(`${titled(of)}: ${f.cause}`, f.remedy, `${f.name}, number ${f.number}`));
      const found = [...rows.values()].flatMap(({ boards: of }) => of);
      // A stop and a board's fault are told by the boards.
      if (state.hold && state.hold !== "emergency_stop" && state.hold !== "board_fault") cards.unshift(held(state, here));
      const free = !here.mine && !(state.control && !state.control.ended);
      if (here.lost && free && state.hold !== "operator_lost") cards.unshift(card(`You lost control${here.lost.times > 1 ? " again" : ""}.`, `${here.lost.why}${again(here.lost)}`));
      if (stop || state.emergency_stop) cards.unshift(stopCard(state, here, stop?.boards ?? []));
      const stays = state.emergency_stop || stop || state.hold || found.length > 0;
      // No board need tell of what was injected where the robot holds for another reason than its operator.
      const unexplained = found.length === 0 && !state.emergency_stop && state.hold && state.hold !== "operator_lost";
      const injected = found.length > 0 ? acting(state.faults, found) : unexplained ? state.faults : [];
      const cause = found.length > 0 || Boolean(unexplained && holds.get(state.hold)?.remedy);
      if (stays) cards.push(wayOn(state, here, injected, cause && injected.length === 0));
      else if (cards.length > 0 && !here.looks) cards[0].append(html("p", {}, "Press Take control."));
      const focused = list.contains(document.activeElement);
      list.replaceChildren(...(cards.length > 0 ? cards : [html("li", { class: "none" }, sign("met"), " No board has a fault.")]));
      // Whoever pressed End with the keyboard goes on from here.
      if (focused) (list.querySelector("button") ?? next()).focus();
    },
  };
}

/** Faults to try. `command` gives one to the robot and shows its answer here, too; `next` is what is pressed after the last one has ended.
 * @param {(name: string, args: Object<string, any>, beside: HTMLElement) => Promise<boolean>} command @param {() => HTMLElement} next */
export function faultsToTry(command, next) {
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
    target.replaceChildren(...places.map((one) => html("option", { value: one, selected: one === before }, placed(one))));
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
      const focused = active.contains(document.activeElement);
      active.replaceChildren(...faults.map((fault) => html("li", {}, fault, html("button", { class: "btn", type: "button", onclick: () => command("EndFault", { fault }, answer) }, "End"))));
      // Whoever pressed one with the keyboard goes on from here, not from the page's begin.
      if (focused) (active.querySelector("button") ?? next()).focus();
    },
  };
}
