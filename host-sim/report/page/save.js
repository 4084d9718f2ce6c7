// Files that a page gives to who looks at it.
import { html } from "./dom.js";

/** Time that a browser has to take a file, ms. */
const TAKEN_MS = 1000;

/** @param {string} name @param {string} type @param {string | Blob} content */
export function save(name, type, content) {
  const address = URL.createObjectURL(new Blob([content], { type }));
  html("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), TAKEN_MS);
}
