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

/** Matches windows with larger type, as in the style sheet. */
export const LARGE = matchMedia("(min-width: 2600px)");
/** Factor of the type in drawings. */
export const typeScale = () => (LARGE.matches ? 1.6 : 1);

/** Sets a text only if it has changed, so that screen readers do not read it again. */
export function setText(/** @type {Element} */ element, /** @type {string} */ text) {
  if (element.textContent !== text) element.textContent = text;
}
