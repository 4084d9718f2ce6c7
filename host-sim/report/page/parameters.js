// Parameters of the boards: a table of one board. A value is written, read back, and then shown; to save is apart.
import { html, say } from "./dom.js";
import { titled } from "./boards.js";

/** @typedef {(name: string, args: Object<string, any>) => Promise<boolean>} Command */

const HEADS = ["Parameter", "Value", "", "Unit", "Allowed", "Told by", "Kept"];
const number = (value) => String(value).replace("-", "−");

/** @param {Command} command gives a command, and says whether it was done
 *  @param {() => Promise<any>} look what the server knows of the parameters */
export function parametersView(command, look) {
  const which = html("select", { "aria-label": "Board", onchange: build }, [1, 2, 3, 4, 5, 6, 7, 8].map((n) => html("option", { value: n }, titled([n]))));
  const sieve = html("input", { type: "search", "aria-label": "Parameters whose name has", placeholder: "name", size: 8, oninput: filter });
  const read = html("button", { class: "btn", type: "button", onclick: readShown }, "Read");
  const save = html("button", { class: "btn", type: "button", onclick: () => command("SaveParameters", { board: board() }) }, "Save on the board");
  const body = html("tbody");
  const table = html("table", { class: "boardtable parametertable" }, html("thead", {}, html("tr", {}, HEADS.map((head) => html("th", { scope: "col" }, head || html("span", { class: "unseen" }, "Write"))))), body);
  const board = () => Number(which.value);
  /** @type {any[]} */
  let rows = [];
  let mayWrite = false;

  function row(info) {
    const input = html("input", { type: "number", step: info.whole ? 1 : "any", min: info.min, max: info.max, "aria-label": `${info.name}, value` });
    const write = html("button", { class: "btn", type: "button", "aria-label": `Write ${info.name}`, onclick: () => writes(info, input) }, "Write");
    // Who has begun to type goes on.
    input.addEventListener("input", () => input.classList.add("typed"));
    const told = html("td");
    const root = html("tr", { title: info.description }, html("th", { scope: "row" }, info.name), html("td", {}, input), html("td", {}, write), html("td", {}, info.unit === "1" ? "" : info.unit), html("td", {}, `${number(info.min)} to ${number(info.max)}`), told, html("td", {}, info.saved ? "by saving" : "no"));
    return { info, input, write, told, root };
  }

  async function build() {
    const all = await look();
    const of = all.boards[board() - 1];
    rows = all[of.kind].map(row);
    body.replaceChildren(...rows.map((r) => r.root));
    show(of);
    filter();
  }

  function show(of) {
    rows.forEach((r, i) => {
      const { value, told } = of.values[i];
      if (!r.input.classList.contains("typed")) r.input.value = String(value);
      say(r.told, told ? "board" : "file");
      r.write.toggleAttribute("disabled", !mayWrite);
    });
  }

  function filter() {
    for (const r of rows) r.root.hidden = !r.info.name.includes(sieve.value.trim());
  }

  async function refresh() {
    show((await look()).boards[board() - 1]);
  }

  async function writes(info, input) {
    const parameter = info.name;
    if (input.value === "" || !(await command("WriteParameter", { board: board(), parameter, value: Number(input.value) }))) return;
    input.classList.remove("typed");
    await command("ReadParameter", { board: board(), parameter });
    await refresh();
  }

  /** Asks the board for what is shown, one after the other; ends at the first refusal. */
  async function readShown() {
    for (const r of rows.filter((r) => !r.root.hidden)) {
      r.input.classList.remove("typed");
      if (!(await command("ReadParameter", { board: board(), parameter: r.info.name }))) break;
    }
    await refresh();
  }

  const panel = html("details", { ontoggle: () => panel.open && rows.length === 0 && build() }, html("summary", {}, "Table"), html("div", { class: "row parameterrow" }, which, sieve, read, save), html("div", { class: "scroll tall", tabindex: 0, role: "region", "aria-label": "Table of parameters" }, table));
  return {
    root: html("section", { class: "panel", "aria-label": "Parameters" }, html("h2", {}, "Parameters"), panel),
    /** Whether who looks may write. @param {boolean} may */
    allow(may) {
      if (may === mayWrite) return;
      mayWrite = may;
      for (const b of [read, save, ...rows.map((r) => r.write)]) b.toggleAttribute("disabled", !may);
    },
  };
}
