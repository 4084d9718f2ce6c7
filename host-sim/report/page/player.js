// One clock of a page. Whatever moves listens here; nothing else asks for animation frames.

/** At most 30 drawings a second. */
const FRAME_MS = 32;
/** A tab that slept goes on from where it was. */
const LONGEST_FRAME_S = 0.1;

export class Player {
  /** @param {number} start s @param {number} end s */
  constructor(start, end) {
    this.start = start;
    this.end = end;
    this.t = start;
    this.speed = 1;
    this.playing = false;
    /** @type {Array<(t: number) => void>} */
    this.listeners = [];
    this.drawn = 0;
  }

  /** Calls `listener` now and whenever time or state changes. @param {(t: number) => void} listener */
  on(listener) {
    this.listeners.push(listener);
    listener(this.t);
  }

  tell() {
    for (const listener of this.listeners) listener(this.t);
  }

  /** @param {number} t s */
  seek(t) {
    this.t = Math.min(this.end, Math.max(this.start, t));
    this.tell();
  }

  play() {
    if (this.playing) return;
    if (this.t >= this.end) this.t = this.start;
    this.playing = true;
    this.drawn = performance.now();
    this.tell();
    requestAnimationFrame((now) => this.frame(now));
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this.tell();
  }

  /** Shows one instant and stays there. @param {number} t s */
  hold(t) {
    this.playing = false;
    this.seek(t);
  }

  /** @param {number} now ms */
  frame(now) {
    if (!this.playing) return;
    if (now - this.drawn >= FRAME_MS) {
      const passed = Math.min(LONGEST_FRAME_S, (now - this.drawn) / 1000);
      this.drawn = now;
      this.t = Math.min(this.end, this.t + passed * this.speed);
      if (this.t >= this.end) this.playing = false;
      this.tell();
    }
    requestAnimationFrame((next) => this.frame(next));
  }
}
