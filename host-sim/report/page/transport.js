// Play, pause, speed and a scrubber for a Player.
import { html, say, sign, fixed } from "./dom.js";

const SPEEDS = [1, 0.25, 2];
const STEP_S = 0.02;
/** Width of a letter in a phase, at most on average, and of what is around its name. */
const LETTER_PX = 6.5;
const AROUND_PX = 8;

/** @typedef {{from: number, to: number, name: string, air: boolean}} Phase */
/** @typedef {{t: number, text: string}} Mark */

/** @param {import("./player.js").Player} player
 * @param {{phases: Phase[], marks: Mark[]}} content phases of the gait and what went wrong, with their times in s */
export function transport(player, { phases, marks }) {
  const length = player.end - player.start;
  const place = (t) => `${(((t - player.start) / length) * 100).toFixed(3)}%`;
  const head = html("div", { class: "head" });
  const clock = html("output");
  const segments = phases.map((p) => html("div", { class: p.air ? "seg air" : "seg", title: p.name, style: `left:${place(p.from)};width:calc(${place(player.start + p.to - p.from)} - 1px)` }, p.name));
  const track = html(
    "div",
    { class: "scrub", role: "slider", tabindex: 0, "aria-label": "Time", "aria-valuemin": player.start, "aria-valuemax": player.end },
    segments,
    marks.map((m) => html("span", { class: "tick", style: `left:${place(m.t)}`, title: m.text }, sign("alarm"))),
    seconds(player).map((t) => html("small", { style: `left:${place(t)}` }, `${t}`)),
    head,
  );
  let width = 0;
  const draw = (t) => {
    head.style.transform = `translateX(${(((t - player.start) / length) * width - 1).toFixed(1)}px)`;
    say(clock, `${fixed(t, 2)} s`);
    track.setAttribute("aria-valuenow", t.toFixed(2));
    track.setAttribute("aria-valuetext", `${fixed(t, 2)} seconds`);
  };
  new ResizeObserver(([entry]) => {
    width = entry.contentRect.width;
    // A word that is cut is none: the whole name, its begin, or nothing.
    phases.forEach((p, i) => {
      const room = ((p.to - p.from) / length) * width - AROUND_PX;
      say(segments[i], [p.name, p.name.split(",")[0]].find((text) => text.length * LETTER_PX <= room) ?? "");
    });
    draw(player.t);
  }).observe(track);

  const drag = (event) => {
    const box = track.getBoundingClientRect();
    player.hold(player.start + ((event.clientX - box.left) / box.width) * length);
  };
  track.addEventListener("pointerdown", (event) => {
    track.setPointerCapture(event.pointerId);
    drag(event);
  });
  track.addEventListener("pointermove", (event) => event.buttons && drag(event));
  track.addEventListener("keydown", (event) => {
    if (stepByKey(player, event)) event.preventDefault();
  });

  const icon = html("span");
  const label = html("span");
  const play = html("button", { class: "btn", type: "button", onclick: () => (player.playing ? player.pause() : player.play()) }, icon, label);
  const speed = html("button", { class: "btn", type: "button", title: "Speed" }, "× 1");
  speed.addEventListener("click", () => {
    player.speed = SPEEDS[(SPEEDS.indexOf(player.speed) + 1) % SPEEDS.length];
    say(speed, `× ${player.speed}`);
  });
  /** @type {boolean | null} */
  let shown = null;
  player.on((t) => {
    draw(t);
    if (shown === player.playing) return;
    shown = player.playing;
    icon.replaceChildren(sign(shown ? "pause" : "play"));
    say(label, shown ? "Pause" : "Play");
  });
  return html("div", { class: "transport" }, play, speed, track, clock);
}

/** Arrow keys move by 20 ms, with Shift by ten times as much. @param {import("./player.js").Player} player @param {KeyboardEvent} event */
export function stepByKey(player, event) {
  const step = { ArrowLeft: -STEP_S, ArrowRight: STEP_S, Home: -Infinity, End: Infinity }[event.key];
  if (step === undefined) return false;
  player.hold(player.t + step * (event.shiftKey ? 10 : 1));
  return true;
}

/** Whole seconds to label, about ten of them. */
function seconds(player) {
  const length = player.end - player.start;
  // The times of a log may be anything.
  const step = [1, 2, 5, 10, 30, 60, 300, 600].find((s) => length / s <= 11) ?? 10 ** Math.ceil(Math.log10(length / 11));
  const labels = [];
  for (let t = Math.ceil(player.start / step) * step; t <= player.end; t += step) labels.push(t);
  return labels;
}
