// One joint on the console's page: where its piston is and is asked to be, its air, its valves, and a
// slider that asks for another stroke.
import { html, svg, set, say, fixed } from "./dom.js";

const VALVES = ["fill A", "vent A", "fill B", "vent B"];
const STROKE_MM = 180;
/** Faults that say of a reading that it is none: SensorRange, SensorRate. */
const NO_READING = new Set([32, 33]);

/** The same in a sample; a test holds them against the protocol. */
const NO_READING_BITS = (1 << 4) | (1 << 5);

/** Whether a sample of a joint has no reading. @param {any} values */
export const isUnread = (values) => (values.faults & NO_READING_BITS) !== 0;

/** Whether a board says that its sensor gives no reading. @param {any} about of the state */
export const isBlind = (about) => (about?.faults ?? []).some((f) => NO_READING.has(f.number));

/** @param {string} name @param {(stroke_mm: number) => void} ask gives the command */
export function jointCard(name, ask) {
  const picture = svg("svg", { viewBox: "0 0 260 48", class: "cyl", role: "img" });
  const title = svg("title", {}, picture);
  svg("rect", { x: 14, y: 9, width: 200, height: 22, class: "bed" }, picture);
  const chamber = { a: svg("rect", { x: 14, y: 9, height: 22, class: "air" }, picture), b: svg("rect", { y: 9, height: 22, class: "air" }, picture) };
  svg("rect", { x: 14, y: 9, width: 200, height: 22, class: "wall" }, picture);
  const rod = svg("rect", { y: 18, height: 4, class: "rod" }, picture);
  const piston = svg("rect", { y: 9, width: 7, height: 22, class: "piston" }, picture);
  const asked = svg("rect", { y: 5, width: 7, height: 30, class: "want" }, picture);
  const valves = VALVES.map((_, k) => svg("path", { d: k % 2 === 0 ? "M-5,4 L5,4 L0,-4Z" : "M-5,-4 L5,-4 L0,4Z", transform: `translate(${[24, 40, 204, 188][k]},42)`, class: "v" }, picture));
  const value = html("b", { class: "val" }, "–");
  const side = html("span", { class: "ask" });
  const slider = html("input", { type: "range", min: 0, max: STROKE_MM, step: 1, value: STROKE_MM / 2, "aria-label": `${name}, stroke to ask for, mm` });
  const wanted = html("output", {}, `${slider.value} mm`);
  const send = html("button", { class: "btn", type: "button", title: "JointReference 0x0101, layer 0", "aria-label": `Send the stroke to ${name}`, onclick: () => give() }, "Send");
  /** Somebody has moved it, and not sent it; else it stands where the joint is asked to be. */
  let touched = false;
  function give() {
    touched = false;
    ask(Number(slider.value));
  }
  slider.addEventListener("input", () => {
    touched = true;
    say(wanted, `${slider.value} mm`);
  });
  const root = html("article", { class: "panel joint", "data-live": true }, html("h2", {}, name), html("p", {}, value, side), picture, html("div", { class: "ask-for" }, slider, wanted, send));
  return {
    root,
    /** Whether who looks may drive. @param {boolean} drives */
    allow(drives) {
      for (const one of [slider, send]) one.toggleAttribute("disabled", !drives);
    },
    /** @param {any} s newest sample @param {any} about its board, of the state */
    update(s, about) {
      const found = about?.faults ?? [];
      const blind = isBlind(about);
      root.classList.toggle("bad", found.length > 0);
      root.classList.toggle("blind", blind);
      if (!s) return;
      if (!touched && Number.isFinite(s.commanded_mm)) {
        slider.value = String(Math.round(s.commanded_mm));
        say(wanted, `${slider.value} mm`);
      }
      const x = (mm) => 14 + (Math.min(Math.max(mm, 0), STROKE_MM) / STROKE_MM) * 193;
      const at = x(s.sensed_mm);
      set(piston, { x: at });
      set(rod, { x: at + 7, width: Math.max(0, 250 - at - 7) });
      set(asked, { x: x(s.commanded_mm) });
      const shade = (bar) => (Number.isNaN(bar) ? 0 : Math.min(1, Math.max(0, (bar - 1) / 6)).toFixed(2));
      // Of real boards neither pressures nor valves are known, but what their law asks for.
      const simulated = !Number.isNaN(s.pressure_a_bar);
      const air = simulated ? `A ${fixed(s.pressure_a_bar)}, B ${fixed(s.pressure_b_bar)} bar absolute (simulated)` : `drive ${fixed(100 * s.drive, 0)} %`;
      set(chamber.a, { width: at - 14, "fill-opacity": shade(s.pressure_a_bar) });
      set(chamber.b, { x: at + 7, width: 214 - at - 7, "fill-opacity": shade(s.pressure_b_bar) });
      for (const v of valves) v.toggleAttribute("hidden", !simulated);
      valves.forEach((v, k) => set(v, { class: (s.valves_open >> k) & 1 ? "v on" : "v" }));
      say(value, blind ? "No reading" : `${fixed(s.sensed_mm)} mm`);
      say(side, ` asked ${fixed(s.commanded_mm)}${blind ? "" : `, error ${fixed(s.commanded_mm - s.sensed_mm)}`} mm; ${air}`);
      say(title, `${name}: ${fixed(s.sensed_mm)} mm of ${STROKE_MM} mm${simulated ? `, open: ${VALVES.filter((_, k) => (s.valves_open >> k) & 1).join(", ") || "no valve"}` : ""}`);
    },
  };
}
