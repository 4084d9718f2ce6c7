// The boards: one chip each while all is well, and a table with what they heard on the bus.
import { html, say, sign } from "./dom.js";

export const LINKS = [1, 2, 3, 4, 5, 6, 7, 8].map((board) => `/link/${board}`);
/** Where the boards are; a test holds it against the list of the program. */
const PLACES = ["left yaw", "left horizontal", "left vertical", "right yaw", "right horizontal", "right vertical", "left", "right"];
const FIRST_WHEEL = 7;

/** What is at a board. @param {number} board */
export const place = (board) => PLACES[board - 1];

/** A board as texts of events name it. @param {number} board */
export const called = (board) => `${board < FIRST_WHEEL ? "joint" : "wheel"} ${board}`;

/** The same, and where it is. @param {number} board */
export const named = (board) => `${called(board)} (${place(board)})`;

/** Boards as a person would list them: "joints 1–6, wheel 7 (left)". @param {number[]} boards */
export function listed(boards) {
  const runs = (of) => {
    /** @type {number[][]} */
    const found = [];
    for (const board of of) {
      const last = found[found.length - 1];
      if (last && board === last[1] + 1) last[1] = board;
      else found.push([board, board]);
    }
    return found.map(([a, b]) => (a === b ? `${a}` : `${a}–${b}`)).join(", ");
  };
  const several = (kind, of) => (of.length > 1 ? `${kind} ${runs(of)}` : of.map(named).join());
  const sorted = [...boards].sort((a, b) => a - b);
  return [several("joints", sorted.filter((b) => b < FIRST_WHEEL)), several("wheels", sorted.filter((b) => b >= FIRST_WHEEL))].filter(Boolean).join(", ");
}

/** Boards at the begin of a sentence. @param {number[]} boards */
export function titled(boards) {
  const text = listed(boards);
  return `${text.charAt(0).toUpperCase()}${text.slice(1)}`;
}
/** What makes a frame unsound, each counted by the board. */
const UNSOUND = ["overflow", "truncated", "short", "version", "length", "address"];
// Mode and faults are on the chips and cards.
const HEADS = ["Board", "Sound frames", "CRC errors", "Other errors", "Unsent", "Drift, ppm", "Parameters"];

/** Chips and table. */
export function boardsView() {
  const chips = html("ol", { class: "boards" });
  const rows = PLACES.map((_, i) => {
    const cells = HEADS.slice(1).map(() => html("td", { class: "num" }, "–"));
    return { cells, root: html("tr", {}, html("th", { scope: "row" }, `${i + 1}, ${place(i + 1)}${i + 1 < FIRST_WHEEL ? "" : " wheel"}`), cells) };
  });
  const table = html("table", { class: "boardtable" }, html("thead", {}, html("tr", {}, HEADS.map((head) => html("th", { scope: "col" }, head)))), html("tbody", {}, rows.map((row) => row.root)));
  const more = html("details", {}, html("summary", {}, "Table"), html("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Table of boards" }, table));
  let shown = "";
  return {
    root: html("section", { class: "panel boardlist", "data-live": true, "aria-label": "Boards" }, html("h2", {}, "Boards"), chips, more),
    /** @param {any} state */
    state(state) {
      const key = JSON.stringify(state.boards);
      if (key === shown) return;
      shown = key;
      chips.replaceChildren(
        ...state.boards.map((b) => {
          const bad = !b.present || b.faults.length > 0;
          return html("li", { class: bad ? "bad" : "", title: named(b.address) }, html("b", {}, String(b.address), sign(bad ? "alarm" : "met")), html("span", {}, b.present ? b.mode : "missing"));
        }),
      );
      for (const b of state.boards) rows[b.address - 1].root.classList.toggle("bad", !b.present || b.faults.length > 0);
    },
    /** What a board has heard. @param {string} topic @param {any} v */
    link(topic, v) {
      const row = rows[Number(topic.slice("/link/".length)) - 1];
      if (!row) return;
      const values = [v.frames, v.crc, UNSOUND.reduce((sum, name) => sum + v[name], 0), v.unsent, v.drift_ppm, `0x${Number(v.parameters).toString(16).padStart(8, "0")}`];
      values.forEach((value, i) => say(row.cells[i], String(value).replace("-", "−")));
    },
  };
}
