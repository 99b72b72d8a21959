// A slider that only a drag of its thumb, or an arrow key, moves. A tap on its track, and a swipe that scrolls the page, change
// nothing: they would set a motor's speed by accident.

import { h, setText } from "./dom.js";

/** Shortest interval between two values that a labelled slider sends, in milliseconds. */
const WAIT_MS = 50;
/** Distance from the thumb's middle at which a finger still takes the thumb. */
const REACH_PX = 22;
/** Distance from which a pressed pointer counts as a drag. */
const SLOP_PX = 6;
/** Width of the thumb, as in the style sheet. */
const THUMB_PX = 20;

/** @param {Record<string, any>} attributes of the input element @param {(value: number) => void} moved called with each new value */
export function slider(attributes, moved) {
  const input = h("input", { type: "range", ...attributes });
  const element = h("div", { class: "drag" }, input);
  /** @type {{pointer: number, x: number, y: number, from: string, moves: boolean}|null} */
  let drag = null;

  const room = () => Math.max(1, input.clientWidth - THUMB_PX);
  const range = () => Number(input.max) - Number(input.min);
  const thumb = () => input.getBoundingClientRect().left + THUMB_PX / 2 + ((Number(input.value) - Number(input.min)) / range()) * room();
  function move(/** @type {string|number} */ value) {
    const before = input.value;
    input.value = String(value);
    if (input.value !== before) moved(Number(input.value));
  }
  function cancel() {
    const was = drag;
    drag = null;
    if (was?.moves) move(was.from);
  }

  element.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
    if (input.disabled || !event.isPrimary || event.button !== 0 || Math.abs(event.clientX - thumb()) > REACH_PX) return;
    drag = { pointer: event.pointerId, x: event.clientX, y: event.clientY, from: input.value, moves: false };
    element.setPointerCapture(event.pointerId);
  });
  element.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => {
    if (drag?.pointer !== event.pointerId || input.disabled) return;
    const by = event.clientX - drag.x;
    if (!drag.moves) {
      if (Math.abs(by) < SLOP_PX || Math.abs(by) < Math.abs(event.clientY - drag.y)) return;
      // The drag begins here, so that the value does not jump.
      Object.assign(drag, { x: event.clientX, moves: true });
      return;
    }
    move(Number(drag.from) + (by / room()) * range());
  });
  element.addEventListener("pointerup", () => { drag = null; });
  // The browser has taken over the touch, to scroll the page or for a gesture at the edge of the screen. `cancel`
  // restores the value from before the drag.
  element.addEventListener("pointercancel", cancel);
  element.addEventListener("lostpointercapture", cancel);
  // Arrow keys. The pointer does not reach the input element.
  input.addEventListener("input", () => moved(Number(input.value)));

  return {
    input,
    element,
    /** True while the thumb is held. */
    held: () => drag !== null,
    /** Shows a value; a drag ends without a new value. */
    set(/** @type {number} */ value) {
      drag = null;
      input.value = String(value);
    },
  };
}

/** A slider with its value as text. @param {{label: string, min: number, max: number, step: number, words: (value: number) => string, send: (value: number) => void}} of */
export function labelled({ label, min, max, step, words, send }) {
  const output = h("output", {}, "");
  /** @type {any} */
  let timer;
  const { input, element, held, set } = slider({ min, max, step, "aria-label": label }, (value) => {
    setText(output, words(value));
    clearTimeout(timer);
    timer = setTimeout(() => send(value), WAIT_MS);
  });
  function put(/** @type {number|null} */ value, /** @type {number} */ otherwise) {
    set(value ?? otherwise);
    setText(output, value === null ? "scenario" : words(value));
  }
  return {
    input,
    element: h("div", { class: "slider" }, element, output),
    /** Shows the value in force, unless somebody uses the slider; without a value the scenario's value is in force. */
    show(/** @type {number|null} */ value, /** @type {number} */ otherwise) {
      if (!held() && document.activeElement !== input) put(value, otherwise);
    },
    /** Shows the value in force, and forgets a value that was not sent yet. */
    set(/** @type {number|null} */ value, /** @type {number} */ otherwise) {
      clearTimeout(timer);
      put(value, otherwise);
    },
  };
}
