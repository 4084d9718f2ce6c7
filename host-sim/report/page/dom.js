// Small helpers to build a page. Texts are set as text, never as HTML.

const SVG = "http://www.w3.org/2000/svg";

/** An HTML element. Attributes that begin with "on" are listeners; null and false are left out, of children too.
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T} tag @param {Object<string, any>} [attributes] @param {...any} children @returns {HTMLElementTagNameMap[T]} */
export function html(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    // As an attribute a style is forbidden to the console's page; as a property it is not.
    else if (name === "style") element.style.cssText = value;
    else if (value === true) element.setAttribute(name, "");
    else if (value != null && value !== false) element.setAttribute(name, String(value));
  }
  for (const child of children.flat()) {
    if (child != null && child !== false) element.append(child instanceof Node ? child : String(child));
  }
  return element;
}

/** An SVG element, added to its parent.
 * @template {keyof SVGElementTagNameMap} T
 * @param {T} tag @param {Object<string, any>} [attributes] @param {Element} [parent] @returns {SVGElementTagNameMap[T]} */
export function svg(tag, attributes = {}, parent) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  if (parent) parent.append(element);
  return element;
}

/** Writes the attributes that changed. @param {Element} element @param {Object<string, any>} attributes */
export function set(element, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    const text = String(value);
    if (element.getAttribute(name) !== text) element.setAttribute(name, text);
  }
}

/** Writes a text if it changed. @param {Node | null} node @param {string} text */
export function say(node, text) {
  if (node && node.textContent !== text) node.textContent = text;
}

/** A number with fixed decimals and a true minus sign; a dash where there is none.
 * @param {number | null | undefined} value */
export function fixed(value, decimals = 1) {
  if (value == null || !Number.isFinite(value)) return "–";
  const digits = Math.abs(value).toFixed(decimals);
  return value < 0 && Number(digits) !== 0 ? `−${digits}` : digits;
}

const SIGNS = {
  alarm: "M8 1 L15 8 L8 15 L1 8Z M7.2 4.2 h1.6 v4.6 h-1.6Z M7.2 10 h1.6 v1.7 h-1.6Z",
  warn: "M8 1.5 L15.3 14.5 H.7Z M7.2 6 h1.6 v4.2 h-1.6Z M7.2 11.2 h1.6 v1.6 h-1.6Z",
  met: "M6.4 12.2 2.6 8.4 3.9 7.1 6.4 9.6 12.1 3.9 13.4 5.2Z",
  play: "M4 2.5v11l9-5.5Z",
  pause: "M4 3h3v10H4Z M9 3h3v10H9Z",
  stale: "M8 1a7 7 0 1 0 0 14 7 7 0 0 0 0-14Z M7.2 3.6h1.6v4.1l2.9 1.7-.8 1.4-3.7-2.2Z",
};

/** A sign: its shape says what its colour says. @param {keyof typeof SIGNS} kind */
export function sign(kind) {
  const picture = svg("svg", { viewBox: "0 0 16 16", class: `sign sign-${kind}`, "aria-hidden": "true" });
  svg("path", { d: SIGNS[kind], "fill-rule": "evenodd" }, picture);
  return picture;
}
