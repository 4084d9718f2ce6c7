// The boards: one chip each while all is well, and a table with what they heard on the bus.
import { html, say, sign } from "./dom.js";

export const LINKS = [1, 2, 3, 4, 5, 6, 7, 8].map((board) => `/link/${board}`);
const NAMES = ["left yaw", "left horizontal", "left vertical", "right yaw", "right horizontal", "right vertical", "left wheel", "right wheel"];

/** What is at a board. @param {number} board */
export const named = (board) => NAMES[board - 1];

/** Boards at the begin of a sentence: one by its name, more by their numbers. @param {number[]} boards */
export function titled(boards) {
  if (boards.length > 1) return `Boards ${boards.join(", ")}`;
  const name = named(boards[0]);
  return `${name[0].toUpperCase()}${name.slice(1)} (board ${boards[0]})`;
}
/** What makes a frame unsound, each counted by the board. */
const UNSOUND = ["overflow", "truncated", "short", "version", "length", "address"];
const HEADS = ["Board", "Mode", "Faults", "Sound frames", "CRC errors", "Other errors", "Unsent", "Drift, ppm", "Parameters"];

/** Chips and table. */
export function boardsView() {
  const chips = html("ol", { class: "boards" });
  const rows = NAMES.map((name, i) => {
    const cells = HEADS.slice(1).map(() => html("td", { class: "num" }, "–"));
    return { cells, root: html("tr", {}, html("th", { scope: "row" }, `${i + 1} ${name}`), cells) };
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
          return html("li", { class: bad ? "bad" : "", title: NAMES[b.address - 1] }, html("b", {}, String(b.address), sign(bad ? "alarm" : "met")), html("span", {}, b.present ? b.mode : "missing"));
        }),
      );
      for (const b of state.boards) {
        const row = rows[b.address - 1];
        say(row.cells[0], b.present ? b.mode : "missing");
        say(row.cells[1], b.faults.map((f) => f.name).join(", ") || "none");
        row.root.classList.toggle("bad", !b.present || b.faults.length > 0);
      }
    },
    /** What a board has heard. @param {string} topic @param {any} v */
    link(topic, v) {
      const row = rows[Number(topic.slice("/link/".length)) - 1];
      if (!row) return;
      const values = [v.frames, v.crc, UNSOUND.reduce((sum, name) => sum + v[name], 0), v.unsent, v.drift_ppm, `0x${Number(v.parameters).toString(16).padStart(8, "0")}`];
      values.forEach((value, i) => say(row.cells[i + 2], String(value).replace("-", "−")));
    },
  };
}
