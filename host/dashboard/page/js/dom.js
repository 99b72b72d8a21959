// Short functions that create and change elements.

/**
 * @param {string} tag
 * @param {Record<string, any>} [attributes] names with `on…` are listeners, all others attributes; a value of false leaves the attribute out
 * @param {...(Node|string)} children
 * @returns {any} an element
 */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (value === true) element.setAttribute(key, "");
    else if (value !== false && value !== undefined && value !== null) element.setAttribute(key, String(value));
  }
  element.append(...children);
  return element;
}

/** @param {string} id @returns {any} */
export const elementById = (id) => document.getElementById(id);

/** A field does not have the number that an action needs. The message names the field. */
export class FieldError extends Error {}

const enterNumber = (/** @type {any} */ field) => new FieldError(`${field.getAttribute("aria-label") ?? field.labels[0].textContent}: enter a number`);

/** The number in a field, or null if the field is empty. Throws a {@link FieldError} if the text is no number. */
export function numberOrNull(/** @type {any} */ field) {
  // The browser reports such a text as an empty value.
  if (field.validity.badInput) throw enterNumber(field);
  return field.value === "" ? null : Number(field.value);
}

/** The number in a field. Throws a {@link FieldError} if the field is empty, or if the text is no number. */
export function numberIn(/** @type {any} */ field) {
  const number = numberOrNull(field);
  if (number === null) throw enterNumber(field);
  return number;
}

/**
 * A part of a panel that can be closed. Of parts with the same name one is open at a time, so that the panel fits beside the plots.
 * @param {string} name @param {string} words @param {boolean} open @param {...(Node|string)} children @returns {any} an element
 */
export const part = (name, words, open, ...children) => h("details", { name, open }, h("summary", {}, words), h("div", { class: "stack" }, ...children));

/** A button that asks for a file and passes the file to `take`, and the hidden field of the file. */
export function chooser(/** @type {string} */ words, /** @type {string} */ id, /** @type {(file: File) => void} */ take, accept = "") {
  const field = h("input", { type: "file", id, accept, hidden: true, onchange: () => {
    const [chosen] = field.files;
    field.value = "";
    if (chosen) take(chosen);
  } });
  return [h("button", { type: "button", id: `${id}-choose`, onclick: () => field.click() }, words), field];
}

/** Lets the browser save a file. */
export function download(/** @type {Blob} */ blob, /** @type {string} */ name) {
  const url = URL.createObjectURL(blob);
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

/** Bytes as hexadecimal digits. */
export const hexOf = (/** @type {Iterable<number>} */ bytes, between = "") => [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join(between);

/** @type {Map<string, string>} */
const colours = new Map();
/** The colour of this name in the style sheet, in the present theme. */
export function colour(/** @type {string} */ name) {
  const root = document.documentElement;
  const key = `${root.dataset.theme} ${name}`;
  const known = colours.get(key) ?? getComputedStyle(root).getPropertyValue(`--${name}`).trim();
  colours.set(key, known);
  return known;
}

/** A sample of a line in a legend. */
export function swatch(/** @type {{colour: string, dash?: number[]}} */ { colour: name, dash }) {
  const span = h("span", {});
  span.innerHTML = `<svg aria-hidden="true"><path d="M0 5H26" stroke="var(--${name})" stroke-width="2.5"${dash ? ` stroke-dasharray="${dash.join(" ")}"` : ""}/></svg>`;
  return span.firstChild;
}

/** Matches windows with larger type, as in the style sheet. */
export const LARGE = matchMedia("(min-width: 2600px)");
/** Factor of the type in drawings. */
export const typeScale = () => (LARGE.matches ? 1.6 : 1);

/** Sets a text only if it has changed, so that screen readers do not read it again. */
export function setText(/** @type {Element} */ element, /** @type {string} */ text) {
  if (element.textContent !== text) element.textContent = text;
}
