// The events of the robot, the newest on top: sieved by kind, board and text, and saved as they were
// recorded. What several boards tell of one cause is one line, as on a terminal.
import { html, say, fixed } from "./dom.js";
import { called, listed, named } from "./boards.js";
import { save } from "./save.js";
import { E_STOP, stopper } from "./words.js";

/** Lines that are kept; with them the events that they are of. */
const KEPT = 500;
/** What several boards tell alike within this time is one line, ns. */
const ALIKE_NS = 50e6;
/** Lines among which such a one is looked for. */
const RECENT = 32;
/** Minor events, which are many, are left out at first. */
const BUT_DETAILS = "but details";
/** What is said behind the name of one board, and behind those of several, by code. @type {Object<string, [string, string]>} */
const SEVERAL = { board_back: [" answers", " answer"], board_lost: [" is lost", " are lost"], diagnosis: [" says why", " say why"], log: [" logs", " log"], link: [" has heard", " have heard"] };
/** A board's own account of a stop tells no more than the stop itself. */
const DIAGNOSIS = "diagnosis";
const BOARDS = [1, 2, 3, 4, 5, 6, 7, 8];
const COLUMNS = ["t_ns", "kind", "code", "detail", "board", "fault", "command", "holder", "revoked_by", "stopped_by", "text"];

/** A field of a table, in quotes where it needs them. @param {any} value */
function cell(value) {
  const text = value == null ? "" : String(value);
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** @typedef {{number: number, t_ns: number, kind: string, code: string, detail: string, board: number, fault: number, command: number, minor: boolean, text: string, holder?: string, revoked_by?: string, gone?: boolean, stopped?: import("./words.js").Stopped | null}} RobotEvent */
/** @typedef {{events: RobotEvent[], boards: number[], before: string, after: string, root: HTMLElement, what: HTMLElement}} Line */

/** List, sieve and table. @param {() => string} [own] session of this page */
export function eventsView(own = () => "") {
  /** The newest first. @type {Line[]} */
  let lines = [];
  /** Events that have come over the line, until those of before are there. @type {RobotEvent[] | null} */
  let first = [];
  /** Number of the newest event. */
  let newest = 0;
  const missing = html("p", { class: "effect bad", role: "status", hidden: true });
  const list = html("ol", { class: "events", tabindex: 0, "aria-label": "Events" });
  const kinds = html("select", { "aria-label": "Kind of events", onchange: sieve }, html("option", { value: BUT_DETAILS }, "all but details"), html("option", { value: "" }, "every kind"));
  const board = html("select", { "aria-label": "Board of events", onchange: sieve }, html("option", { value: "" }, "every board"), html("option", { value: 0 }, "no board"), BOARDS.map((b) => html("option", { value: b }, named(b))));
  const words = html("input", { type: "search", "aria-label": "Events whose text has", placeholder: "text", size: 8, oninput: sieve });
  const count = html("span", { class: "effect", role: "status" });
  const table = html("button", { class: "btn", type: "button", onclick: () => save("wheeleg-events.csv", "text/csv", csv()) }, "Save events as CSV");

  /** @param {Line} line */
  function shown({ before, after, boards, events: [first] }) {
    const [one, several] = SEVERAL[first.code] ?? ["", ""];
    const verb = boards.length > 1 && one && after.startsWith(one) ? several + after.slice(one.length) : after;
    return `${before}${listed(boards)}${verb}`;
  }
  function fits(line) {
    const { kind, minor } = line.events[0];
    const wanted = words.value.trim().toLowerCase();
    const of = board.value === "" || (board.value === "0" ? line.events[0].board === 0 : line.events.some((event) => event.board === Number(board.value)));
    const asked = kinds.value === "" || (kinds.value === BUT_DETAILS ? !minor : kind === kinds.value);
    return of && asked && line.what.textContent.toLowerCase().includes(wanted);
  }
  function sieve() {
    for (const line of lines) line.root.hidden = !fits(line);
    tell();
  }
  function tell() {
    const left = lines.filter((line) => !line.root.hidden).length;
    say(count, left === lines.length ? "" : `${left} of ${lines.length} lines`);
  }
  /** Every event whose line is shown, each as it was recorded, the oldest first. */
  function csv() {
    const events = lines.filter((line) => !line.root.hidden).flatMap((line) => line.events).sort((a, b) => a.t_ns - b.t_ns);
    return `${[COLUMNS, ...events.map((event) => COLUMNS.map((column) => (column === "stopped_by" ? event.stopped && stopper(event.stopped, own()) : event[column])))].map((row) => row.map(cell).join(",")).join("\n")}\n`;
  }
  /** @param {RobotEvent} event */
  function add(event) {
    // What the server has kept may have overtaken the same over the line.
    if (event.number <= newest) return;
    newest = event.number;
    if (![...kinds.options].some(({ value }) => value === event.kind)) kinds.append(html("option", { value: event.kind }, event.kind));
    // Where its text names the board, the same of another board differs in the name alone.
    const at = event.board > 0 ? event.text.indexOf(called(event.board)) : -1;
    const before = at < 0 ? event.text : event.text.slice(0, at);
    const after = at < 0 ? "" : event.text.slice(at + called(event.board).length);
    /** @param {Line} line */
    const alike = (line) => {
      const [other] = line.events;
      const same = line.after === after || (event.code === DIAGNOSIS && event.fault === E_STOP);
      return line.before === before && same && line.boards.length > 0 && !line.boards.includes(event.board) && ["kind", "code", "detail", "fault"].every((name) => other[name] === event[name]);
    };
    const known = at < 0 ? undefined : lines.find((line, i) => i < RECENT && Math.abs(event.t_ns - line.events[0].t_ns) <= ALIKE_NS && alike(line));
    if (known) {
      known.events.push(event);
      known.boards.push(event.board);
      say(known.what, shown(known));
      known.root.hidden = !fits(known);
      return tell();
    }
    const who = [event.holder, event.revoked_by && `revoked by ${event.revoked_by}`, event.stopped && `by ${stopper(event.stopped, own())}`].filter(Boolean).join(", ");
    const line = { events: [event], boards: at < 0 ? [] : [event.board], before, after: who ? `${after} (${who})` : after, what: html("span"), root: html("li", { class: event.kind === "fault" && event.code !== "faults_cleared" ? "bad" : "" }) };
    say(line.what, shown(line));
    line.root.append(html("time", {}, fixed(event.t_ns * 1e-9, 2)), line.what);
    line.root.hidden = !fits(line);
    lines.unshift(line);
    list.prepend(line.root);
    for (const old of lines.splice(KEPT)) old.root.remove();
    tell();
  }
  return {
    root: html("section", { class: "panel eventlist", "aria-label": "Events of the robot" }, html("h2", {}, "Events"), html("div", { class: "row sieve" }, kinds, board, words), html("div", { class: "row" }, table, count), missing, list),
    /** @param {RobotEvent} event */
    add(event) {
      first?.push(event);
      add(event);
    },
    /** What the server has kept, the oldest first; its end may have come over the line, too. @param {RobotEvent[]} kept */
    past(kept) {
      const all = new Map([...kept, ...(first ?? [])].map((event) => [event.number, event]));
      first = null;
      lines = [];
      newest = 0;
      list.replaceChildren();
      for (const event of [...all.values()].sort((a, b) => a.number - b.number)) add(event);
    },
    /** What the server has kept did not come. @param {string} why */
    noPast(why) {
      first = null;
      missing.hidden = false;
      say(missing, `Earlier events are missing: ${why}. Reload the page to ask for them again.`);
    },
  };
}
