// The socket to `wheeleg serve`, by its contract (host-sim/console/PROTOCOL.md): handshake, signed
// frames in their order, answers, samples. It knows nothing of the page.

import { hmac } from "./mac.js";

const SUBPROTOCOL = "wheeleg.console.v1";
/** A command is about what its sender saw at most this long before, ms. */
const VALID_MS = 800;
/** After an answer that took longer the next question follows at once, ms. */
const ECHO_SLOW_MS = 100;

const text = new TextEncoder();
const bytes = (hexadecimal) => Uint8Array.from(hexadecimal.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16));
const hexadecimal = (list) => Array.from(list, (byte) => byte.toString(16).padStart(2, "0")).join("");

/** Each part with its length before it. @param {...(string | Uint8Array)} parts */
function prefixed(...parts) {
  const lists = parts.map((part) => (typeof part === "string" ? text.encode(part) : part));
  const all = new Uint8Array(lists.reduce((sum, list) => sum + 4 + list.length, 0));
  const view = new DataView(all.buffer);
  let at = 0;
  for (const list of lists) {
    view.setUint32(at, list.length, true);
    all.set(list, at + 4);
    at += 4 + list.length;
  }
  return all;
}

const READERS = {
  f32: (view, at) => [view.getFloat32(at, true), 4],
  u32: (view, at) => [view.getUint32(at, true), 4],
  i32: (view, at) => [view.getInt32(at, true), 4],
  u64: (view, at) => [Number(view.getBigUint64(at, true)), 8],
  bool: (view, at) => [view.getUint8(at) !== 0, 1],
  text: (view, at) => {
    const length = view.getUint16(at, true);
    return [new TextDecoder().decode(new Uint8Array(view.buffer, view.byteOffset + at + 2, length)), 2 + length];
  },
};

/** @typedef {{status: string, reason?: string, text?: string, holder?: string, age_ms?: number}} Answer */
/** @typedef {{key: string, role: "control" | "view", name: string}} Identity */
/** Why a connection ends, by the code of its close. @type {Object<number, string>} */
const ENDS = { 4003: "The server has closed the connection: a frame was not sound", 4004: "The server has closed the connection: this page or its line is too slow", 4006: "The server has ended" };

/** The server does not let this page in; `wrong`: the key is not one of this role. */
export class Refused extends Error {
  /** @param {string} text @param {boolean} wrong */
  constructor(text, wrong) {
    super(text);
    this.wrong = wrong;
  }
}

/** @typedef {{sample: (topic: string, t_us: number, values: Object<string, any>) => void, state: (state: any) => void,
 *   event: (event: any) => void, asked: (by: string, session: string) => void, offered: (by: string) => void,
 *   revoked: (by: string) => void, closed: (why: string) => void}} Listener */

/** One session. */
export class Link {
  /** @param {Identity} identity @param {Listener} listener */
  constructor(identity, listener) {
    this.identity = identity;
    this.listener = listener;
    this.n = 0;
    /** Newest master time that the page has painted, µs. */
    this.seen_us = 0;
    /** @type {Map<number, (answer: Answer) => void>} */
    this.waiting = new Map();
    /** Who is told that a command was taken, before its end. @type {Map<number, () => void>} */
    this.taken = new Map();
    // What the handshake gives; nothing is sent before it.
    const later = /** @type {any} */ (null);
    /** @type {WebSocket} */
    this.socket = later;
    /** The session's key. @type {Uint8Array} */
    this.key = later;
    /** Nonces of both sides, and all that both MACs are over. @type {Uint8Array} */
    this.server = later;
    /** @type {Uint8Array} */
    this.client = later;
    /** @type {Uint8Array} */
    this.common = later;
    /** @type {{layout: string, commands: string}} */
    this.hashes = later;
    /** @type {Map<number, any>} */
    this.channels = new Map();
    this.session = "";
    /** How long the last answer took, and since when the next one is waited for, ms. */
    this.delay_ms = NaN;
    /** @type {number | null} */
    this.asked_ms = null;
  }

  /** A document of the HTTP API. @param {string} path */
  async ask(path) {
    // Over plain HTTP no key may be sent; what is not secret comes without.
    const headers = isSecureContext ? { Authorization: `Bearer ${this.identity.key}` } : undefined;
    const response = await fetch(`/api/v1/${path}`, { headers });
    const answer = await response.json();
    if (response.status === 401) throw new Error("The key in the address is wrong. Open the address that `wheeleg serve` prints.");
    if (!response.ok) throw new Error(`${answer.detail}: ${answer.remedy}`);
    return answer;
  }

  /** Loads what the robot is, opens the socket, and proves both sides to each other. */
  async open() {
    const [robot, channels, commands, faults] = await Promise.all(["robot", "channels", "commands", "faults"].map((path) => this.ask(path)));
    this.channels = new Map(channels.channels.map((channel) => [channel.id, channel]));
    for (const { topic, fields } of channels.channels) for (const field of fields) field.measured = !robot.unmeasured[topic]?.includes(field.name);
    this.hashes = { layout: channels.layout, commands: commands.hash };
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`, SUBPROTOCOL);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    await new Promise((resolve, reject) => {
      socket.onclose = (close) => reject(new Error(close.reason || "the robot's server does not answer"));
      socket.onmessage = (message) => {
        try {
          if (this.greet(JSON.parse(message.data))) resolve(undefined);
        } catch (error) {
          reject(error);
        }
      };
    });
    socket.onclose = (close) => this.end(ENDS[close.code] ?? "The connection has ended");
    socket.onmessage = (message) => (typeof message.data === "string" ? this.told(JSON.parse(message.data)) : this.samples(message.data));
    return { robot, commands: commands.commands, faults: faults.injectable, holds: faults.holds };
  }

  /** One message of the handshake; true when it is over. */
  greet(message) {
    const key = bytes(this.identity.key);
    const { role, name } = this.identity;
    if (message.op === "hello") {
      if (message.layout !== this.hashes.layout || message.commands !== this.hashes.commands) throw new Error("the program has changed: reload this page");
      this.server = bytes(message.nonce);
      this.client = crypto.getRandomValues(new Uint8Array(32));
      this.common = prefixed(this.server, this.client, role, name, location.host, message.layout, message.commands);
      const proof = hmac(key, Uint8Array.from([...prefixed("c1"), ...this.common]));
      this.socket.send(JSON.stringify({ op: "auth", role, name, nonce: hexadecimal(this.client), ...this.hashes, mac: hexadecimal(proof) }));
      return false;
    }
    if (message.op !== "welcome") throw new Refused(`${message.text ?? "refused"}. ${message.remedy ?? ""}`, ["wrong_key", "look_only", "wait"].includes(message.reason));
    const expected = hmac(key, Uint8Array.from([...prefixed("s1"), ...this.common, ...prefixed(message.session)]));
    if (hexadecimal(expected) !== message.mac) throw new Error("this is not your robot: its server does not have the key");
    this.session = message.session;
    this.key = hmac(key, prefixed("k1", this.server, this.client));
    return true;
  }

  end(why) {
    for (const answer of this.waiting.values()) answer({ status: "unknown", text: why });
    this.waiting.clear();
    this.taken.clear();
    this.listener.closed(why);
  }

  /** Sends a frame, and gives its number. @param {Object<string, any>} frame */
  send(frame) {
    this.n += 1;
    const json = text.encode(JSON.stringify({ n: this.n, ...frame }));
    const signature = hmac(this.key, prefixed("f1", json)).slice(0, 16);
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(Uint8Array.from([...signature, ...json]));
    return this.n;
  }

  /** Sends a frame that is answered. @param {Object<string, any>} frame @returns {Promise<Answer>} */
  answered(frame) {
    return new Promise((resolve) => this.waiting.set(this.send(frame), resolve));
  }

  /** Answered at the command's end; `taken` is called when it begins, if it has an end of its own.
   * @param {string} cmd @param {Object<string, any>} args @param {() => void} [taken] */
  command(cmd, args = {}, taken) {
    return new Promise((resolve) => {
      const n = this.send({ seen_us: this.seen_us, valid_ms: VALID_MS, cmd, args });
      this.waiting.set(n, resolve);
      if (taken) this.taken.set(n, taken);
    });
  }

  stop() {
    return this.answered({ op: "stop" });
  }

  /** Asks for nothing, to see how long the answer takes; one at a time. */
  async echo() {
    if (this.asked_ms !== null) return;
    const asked_ms = performance.now();
    this.asked_ms = asked_ms;
    await this.answered({ op: "unsubscribe", channels: [] });
    this.delay_ms = performance.now() - asked_ms;
    this.asked_ms = null;
    // A line that was slow just now may be quick again; it is not believed to be before it has shown it.
    if (this.delay_ms > ECHO_SLOW_MS && this.socket.readyState === WebSocket.OPEN) this.echo();
  }

  /** How late what comes may be, ms: all that has come until now was sent before the answer that is waited for, and the
   * line is as slow as the last answer has shown. */
  late_ms() {
    const waited = this.asked_ms === null ? 0 : performance.now() - this.asked_ms;
    return Math.max(waited, this.delay_ms || 0);
  }

  beat() {
    this.send({ op: "beat", seen_us: this.seen_us });
  }

  /** @param {string[]} channels @param {number} hz */
  subscribe(channels, hz) {
    return this.answered({ op: "subscribe", channels, hz });
  }

  told(message) {
    if (message.op === "answer") {
      this.taken.get(message.n)?.();
      this.taken.delete(message.n);
      if (message.status === "accepted") return;
      this.waiting.get(message.n)?.(message);
      this.waiting.delete(message.n);
    } else if (message.op === "state") this.listener.state(message);
    else if (message.op === "event") this.listener.event(message);
    else if (message.op === "asked") this.listener.asked(message.by, message.session);
    else if (message.op === "offered") this.listener.offered(message.by);
    else if (message.op === "revoked") this.listener.revoked(message.by);
    else if (message.op === "error") this.refusal = message.text;
  }

  samples(buffer) {
    const view = new DataView(buffer);
    const channel = this.channels.get(view.getUint16(1, true));
    if (view.getUint8(0) !== 1 || !channel) return;
    let at = 7;
    while (at < view.byteLength) {
      const t_us = Number(view.getBigUint64(at, true)) / 1000;
      at += 8;
      const values = {};
      for (const field of channel.fields) {
        const [value, length] = READERS[field.wire](view, at);
        // What no board tells is not 0.
        values[field.name] = field.measured ? value : NaN;
        at += length;
      }
      this.listener.sample(channel.topic, t_us, values);
    }
  }
}
