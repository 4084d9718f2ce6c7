// Plots of a live robot: any signals, over the last seconds. A cursor is linked over all of them; a
// drag zooms, a double click shows everything again; frozen, they stay as they are while the robot
// goes on. A signal is kept from the instant at which its plot was added.
import { titled } from "./boards.js";
import { html, say } from "./dom.js";
import { Player } from "./player.js";
import { picture } from "./picture.js";
import { Linked, Plot } from "./plot.js";
import { save } from "./save.js";

/** Samples per second of a channel. */
export const HZ = 30;
const SPANS_S = [10, 20, 60, 120];
/** Samples of a ring: the longest span, and some more. */
const KEPT = (SPANS_S[SPANS_S.length - 1] + 5) * HZ;
const MOST_PLOTS = 8;
/** At most so many drawings a second, ms. */
const DRAW_MS = 66;
const COLOURS = ["#161B20", "#128A6B", "#9A5C86", "#8A4FBE"];
const ASKED = "#0072B2";

/** @typedef {{name: string, unit: string, wire: string, description: string, measured: boolean}} Field */
/** @typedef {{topic: string, fields: Field[], description: string}} Channel */
/** @typedef {{topic: string, field: string, label: string, colour: string}} Trace */
/** @typedef {{name: string, unit: string, least: [number, number], traces: Trace[]}} Choice */

const JOINTS = [1, 2, 3, 4, 5, 6].map((board) => titled([board]));

/** What is usually looked at. @returns {Choice[]} */
function usual() {
  const trace = (topic, field, label, colour) => ({ topic, field, label, colour });
  /** @type {Choice[]} */
  const choices = [];
  JOINTS.forEach((name, i) => {
    const topic = `/joint/${i + 1}`;
    choices.push({ name: `${name}, stroke`, unit: "mm", least: [0, 180], traces: [trace(topic, "commanded_mm", "asked", ASKED), trace(topic, "sensed_mm", "sensed", COLOURS[0])] });
    choices.push({ name: `${name}, pressures`, unit: "bar, simulated", least: [1, 7], traces: [trace(topic, "pressure_a_bar", "A", COLOURS[0]), trace(topic, "pressure_b_bar", "B", COLOURS[1])] });
  });
  choices.push({ name: "Feet, load", unit: "N, simulated", least: [0, 50], traces: [trace("/foot/left", "normal_force_n", "left", COLOURS[0]), trace("/foot/right", "normal_force_n", "right", COLOURS[1])] });
  choices.push({ name: "Wheels, speed", unit: "mm/s, simulated", least: [-10, 10], traces: [trace("/wheel/7", "velocity_mm_s", "left", COLOURS[0]), trace("/wheel/8", "velocity_mm_s", "right", COLOURS[1])] });
  choices.push({ name: "Air in the supply", unit: "bar, simulated", least: [1, 7], traces: [trace("/supply", "pressure_bar", "", COLOURS[0])] });
  return choices;
}

/** The newest samples of one signal. */
class Ring {
  constructor() {
    this.t = new Float64Array(KEPT);
    this.v = new Float32Array(KEPT);
    this.next = 0;
    this.count = 0;
  }

  /** @param {number} t s @param {number} value */
  push(t, value) {
    this.t[this.next] = t;
    this.v[this.next] = value;
    this.next = (this.next + 1) % KEPT;
    this.count = Math.min(this.count + 1, KEPT);
  }

  /** Time of the newest sample, s; none if there is none. */
  last() {
    return this.count > 0 ? this.t[(this.next - 1 + KEPT) % KEPT] : undefined;
  }

  /** Times and values from `from` on, in order. @param {number} from s */
  since(from) {
    /** @type {number[]} */
    const x = [];
    /** @type {(number | null)[]} */
    const y = [];
    for (let i = 0; i < this.count; i += 1) {
      const at = (this.next - this.count + i + KEPT) % KEPT;
      if (this.t[at] < from) continue;
      x.push(this.t[at]);
      // What is not a number was not measured: a gap.
      y.push(Number.isNaN(this.v[at]) ? null : this.v[at]);
    }
    return { x, y };
  }
}

/** Plots with their controls. */
export class Scope {
  /** @param {Channel[]} channels @param {(topic: string) => void} subscribe */
  constructor(channels, subscribe) {
    this.subscribe = subscribe;
    /** @type {Map<string, Map<string, Ring>>} */
    this.rings = new Map();
    /** @type {{choice: Choice, plot: Plot, root: HTMLElement}[]} */
    this.shown = [];
    this.player = new Player(0, 1);
    this.linked = new Linked(this.player);
    this.span = 20;
    this.frozen = false;
    this.hovered = false;
    this.drawn_ms = 0;
    this.now = 0;

    const measured = new Set(channels.flatMap(({ topic, fields }) => fields.filter((field) => field.measured).map((field) => `${topic} ${field.name}`)));
    const known = usual().filter(({ traces }) => traces.every(({ topic, field }) => measured.has(`${topic} ${field}`)));
    const others = channels.flatMap((channel) =>
      channel.fields
        .filter((field) => field.wire !== "text" && field.measured)
        .map((field) => ({ name: `${channel.topic} ${field.name}`, unit: field.unit, least: /** @type {[number, number]} */ ([0, 0]), traces: [{ topic: channel.topic, field: field.name, label: "", colour: COLOURS[0] }] })),
    );
    this.choices = [...known, ...others];
    const option = (choice) => html("option", { value: this.choices.indexOf(choice) }, choice.name);
    const add = html("select", { "aria-label": "Add a plot", onchange: (event) => this.chosen(event.target) }, html("option", { value: "" }, "Add a plot…"), html("optgroup", { label: "Usual" }, known.map(option)), html("optgroup", { label: "Every signal" }, others.map(option)));
    const span = html("select", { "aria-label": "Span of the plots", onchange: (event) => this.lasting(Number(event.target.value)) }, SPANS_S.map((s) => html("option", { value: s, selected: s === this.span }, `last ${s} s`)));
    this.freeze = html("button", { class: "btn", type: "button", "aria-pressed": "false", onclick: () => this.toggle() }, "Freeze");
    const table = html("button", { class: "btn", type: "button", onclick: () => save("wheeleg-plots.csv", "text/csv", this.table()) }, "Save as CSV");
    const drawn = html("button", { class: "btn", type: "button", onclick: () => this.savePicture() }, "Save as PNG");
    this.note = html("span", { class: "note-live", role: "status" });
    this.list = html("div", { class: "scope-plots" });
    this.list.addEventListener("pointerenter", () => (this.hovered = true));
    this.list.addEventListener("pointerleave", () => (this.hovered = false));
    this.root = html("section", { class: "panel scope", "data-live": true, "aria-label": "Plots" }, html("header", {}, html("h2", {}, "Plots"), add, span, this.freeze, table, drawn, this.note), this.list);
    this.add(known.find(({ name }) => name === `${JOINTS[2]}, stroke`) ?? known[0]);
  }

  chosen(select) {
    const choice = this.choices[Number(select.value)];
    if (select.value !== "" && choice) this.add(choice);
    select.value = "";
  }

  lasting(span) {
    this.span = span;
    this.linked.show(null);
    this.draw();
  }

  toggle() {
    this.frozen = !this.frozen;
    say(this.freeze, this.frozen ? "Go on" : "Freeze");
    this.freeze.setAttribute("aria-pressed", String(this.frozen));
    if (!this.frozen) this.linked.show(null);
    this.draw();
  }

  /** @param {Choice} choice */
  add(choice) {
    if (this.shown.some((one) => one.choice === choice)) return;
    if (this.shown.length >= MOST_PLOTS) {
      say(this.note, `At most ${MOST_PLOTS} plots: close one first.`);
      return;
    }
    say(this.note, "");
    for (const { topic, field } of choice.traces) {
      const fields = this.rings.get(topic) ?? new Map();
      if (!fields.has(field)) fields.set(field, new Ring());
      if (!this.rings.has(topic)) this.rings.set(topic, fields);
      this.subscribe(topic);
    }
    const series = choice.traces.map((trace) => ({ label: trace.label || "value", colour: trace.colour, width: 1, x: [], y: [] }));
    const panel = { title: choice.name, unit: choice.unit, x_label: "time [s]", x: /** @type {[number, number]} */ ([this.now - this.span, this.now]), y: /** @type {[number, number]} */ ([...choice.least]), series, limits: [], marks: [], marked: "", height: 120 };
    const plot = new Plot(panel, this.linked, "h3");
    const close = html("button", { class: "btn close", type: "button", "aria-label": `Close the plot ${choice.name}` }, "×");
    const root = html("div", { class: "scope-plot" }, plot.root, close);
    close.addEventListener("click", () => this.remove(choice));
    this.shown.push({ choice, plot, root });
    this.list.append(root);
  }

  remove(choice) {
    const one = this.shown.find((shown) => shown.choice === choice);
    if (!one) return;
    one.root.remove();
    this.shown = this.shown.filter((shown) => shown !== one);
    this.linked.plots = this.linked.plots.filter((plot) => plot !== one.plot);
    this.player.listeners = [];
    for (const { plot } of this.shown) this.player.on((t) => plot.at(t));
  }

  /** A sample has come. @param {string} topic @param {number} t s @param {Object<string, any>} values */
  sample(topic, t, values) {
    const fields = this.rings.get(topic);
    if (!fields) return;
    for (const [field, ring] of fields) ring.push(t, Number(values[field]));
  }

  /** Draws what is new. @param {number} t newest time, s */
  paint(t) {
    this.now = t;
    const now = performance.now();
    if (this.frozen || now - this.drawn_ms < DRAW_MS) return;
    this.drawn_ms = now;
    this.draw();
  }

  draw() {
    const from = this.frozen ? this.player.start : this.now - this.span;
    const to = this.frozen ? this.player.end : this.now;
    this.player.start = from;
    this.player.end = to;
    for (const { choice, plot } of this.shown) {
      const { panel } = plot;
      panel.x = [from, to];
      choice.traces.forEach((trace, i) => {
        const points = this.rings.get(trace.topic)?.get(trace.field)?.since(from);
        if (points && !this.frozen) Object.assign(panel.series[i], points);
      });
      panel.y = range(panel.series, choice.least);
      plot.draw();
    }
    if (!this.hovered && !this.frozen && !this.linked.zoom) this.player.seek(this.newest());
  }

  /** The newest time that all plots have, s. */
  newest() {
    let newest = this.now;
    for (const { choice } of this.shown) {
      for (const { topic, field } of choice.traces) {
        const last = this.rings.get(topic)?.get(field)?.last();
        if (last !== undefined) newest = Math.min(newest, last);
      }
    }
    return newest;
  }

  /** What the plots show, as a table for other programs. */
  table() {
    const columns = this.shown.flatMap(({ choice }) => choice.traces);
    const rows = ["t_s,signal,value"];
    for (const { topic, field } of columns) {
      const points = this.rings.get(topic)?.get(field)?.since(this.player.start);
      points?.x.forEach((t, i) => t <= this.player.end && rows.push(`${t.toFixed(4)},${topic}.${field},${points.y[i] ?? ""}`));
    }
    return `${rows.join("\n")}\n`;
  }

  /** The plots as they are now, one below the other. */
  async savePicture() {
    const file = await picture(this.shown.map(({ plot }) => plot));
    if (file) save("wheeleg-plots.png", "image/png", file);
    else say(this.note, "There is no plot to save.");
  }
}

/** An axis around all values. @param {{y: Array<number | null>}[]} series @param {[number, number]} least @returns {[number, number]} */
function range(series, least) {
  let [low, high] = least;
  if (low === high) [low, high] = [Infinity, -Infinity];
  for (const { y } of series) {
    for (const value of y) {
      if (value == null || !Number.isFinite(value)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (!Number.isFinite(low)) return [0, 1];
  const margin = Math.max((high - low) * 0.05, Math.abs(high) * 1e-3, 1e-6);
  return [low - margin, high + margin];
}
