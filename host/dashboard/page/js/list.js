// A list to choose from. A browser's own list takes every key while it is open, also Escape, so that a motor could not be
// stopped. This list leaves Escape to the page, and arrow keys change nothing while it is closed.

import { h, setText } from "./dom.js";

let count = 0;

/**
 * A button with `value` and `options`, which sends `change` like a select element.
 * @param {string[][]} options pairs of value and label
 * @param {Record<string, any>} attributes
 */
export function select(options, attributes = {}) {
  const name = `list-${(count += 1)}`;
  const words = h("span", {});
  const element = h("button", { type: "button", role: "combobox", class: "select", "aria-haspopup": "listbox", "aria-expanded": "false", ...attributes }, words);
  /** @type {any} the list while it is open */
  let open = null;
  /** Where the button was when the list opened. */
  let top = 0;
  let [pairs, value, active] = [options, options[0]?.[0] ?? "", 0];

  const labels = () => setText(words, pairs.find(([key]) => key === value)?.[1] ?? "–");
  function close() {
    open?.remove();
    open = null;
    element.setAttribute("aria-expanded", "false");
    element.removeAttribute("aria-activedescendant");
    element.removeAttribute("aria-controls");
  }
  function mark(/** @type {number} */ index) {
    active = (index + pairs.length) % pairs.length;
    [...open.children].forEach((option, at) => option.classList.toggle("active", at === active));
    open.children[active]?.scrollIntoView({ block: "nearest" });
    element.setAttribute("aria-activedescendant", `${name}-${active}`);
  }
  function pick(/** @type {number} */ index) {
    const before = value;
    close();
    element.value = pairs[index][0];
    if (value !== before) element.dispatchEvent(new Event("change", { bubbles: true }));
  }
  function show() {
    open = h("div", { role: "listbox", id: name, class: "options", "aria-label": element.getAttribute("aria-label") ?? "Options" }, ...pairs.map(([key, label], index) => h("div", { role: "option", id: `${name}-${index}`, "aria-selected": String(key === value), onpointerdown: (/** @type {Event} */ event) => event.preventDefault(), onclick: () => pick(index) }, label)));
    (document.querySelector("main") ?? document.body).append(open);
    const [box, size] = [element.getBoundingClientRect(), open.getBoundingClientRect()];
    const below = box.bottom + size.height <= innerHeight || box.top < size.height;
    Object.assign(open.style, { minWidth: `${box.width}px`, left: `${Math.max(4, Math.min(box.left, innerWidth - size.width - 4))}px`, top: `${below ? Math.max(4, Math.min(box.bottom, innerHeight - size.height - 4)) : box.top - size.height}px` });
    top = box.top;
    element.setAttribute("aria-expanded", "true");
    element.setAttribute("aria-controls", name);
    mark(Math.max(0, pairs.findIndex(([key]) => key === value)));
  }
  element.addEventListener("click", () => (open ? close() : show()));
  element.addEventListener("blur", close);
  element.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (event.key === "Escape") close();
    else if (step) {
      event.preventDefault();
      if (open) mark(active + step);
      else show();
    } else if (event.key === "Enter" && open) {
      event.preventDefault();
      pick(active);
    }
  });
  Object.defineProperties(element, {
    value: { get: () => value, set: (next) => { value = String(next ?? ""); labels(); } },
    options: { get: () => pairs, set: (next) => { pairs = next; close(); labels(); } },
  });
  // An event of scrolling that was over before the list opened may arrive late.
  addEventListener("scroll", () => open && element.getBoundingClientRect().top !== top && close(), { passive: true });
  labels();
  return element;
}
