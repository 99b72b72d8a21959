// Buttons that drive motors while they are held. When a button is released, its motors are regulated to a stop. When the page is
// hidden or loses the focus, they are switched off; the server does so when the page is gone.

import { h, numberIn, setText } from "./dom.js";
import { select } from "./list.js";
import { limited, scale } from "./motors.js";
import { mayOrder, on, onControl, onLeave, state } from "./state.js";

/** @param {any} link */
export function jogForm(link) {
  const which = select([["one", "The chosen motor"], ["all", "All motors"]], { id: "jog-motors", "aria-label": "Motors to drive" });
  const mode = select([["velocity", "Speed"], ["power", "Power"]], { id: "jog-mode", "aria-label": "What the level is", onchange: () => show() });
  /** The level of each mode in the server's unit. */
  const levels = /** @type {Record<string, number>} */ ({ velocity: 300, power: 0.25 });
  const of = () => scale(mode.value, state.settings[state.chosen]);
  const level = h("input", { type: "number", id: "jog-level", min: 0, step: "any", onchange: () => {
    try {
      levels[mode.value] = Math.abs(of().meant(limited(of(), numberIn(level)).value));
    } finally {
      show();
    }
  } });
  const unit = h("span", { class: "muted" });
  /** @type {number[]} the motors that a held button drives */
  let driven = [];

  function drive(/** @type {number} */ value, enable = false) {
    for (const motor of driven) link.order("drive", { motor, mode: mode.value, value, enable });
  }
  function begin(/** @type {number} */ direction) {
    driven = which.value === "all" ? [0, 1, 2, 3] : [state.chosen];
    drive(direction * levels[mode.value], true);
  }
  function end() {
    drive(0);
    driven = [];
  }
  function leave() {
    for (const motor of driven) link.order("enable", { motor, on: false });
    driven = [];
  }
  const buttons = [["◀ Backward", -1], ["Forward ▶", 1]].map(([words, direction]) => {
    const go = () => begin(Number(direction));
    return h("button", {
      type: "button", class: "jog",
      onpointerdown: (/** @type {PointerEvent} */ event) => { if (event.isPrimary && event.button === 0) go(); },
      onpointerup: end, onpointercancel: end, onpointerleave: end, onblur: end,
      onkeydown: (/** @type {KeyboardEvent} */ event) => { if (event.key === "Enter" && !event.repeat) go(); },
      onkeyup: (/** @type {KeyboardEvent} */ event) => { if (event.key === "Enter") end(); },
      oncontextmenu: (/** @type {Event} */ event) => event.preventDefault(),
    }, words);
  });
  onLeave(leave);
  on("stopped", () => { driven = []; });

  function show() {
    const { digits, shown, unit: words } = of();
    level.value = String(Number(shown(levels[mode.value]).toFixed(digits)));
    level.setAttribute("aria-label", `Level while a button is held, ${words}`);
    setText(unit, words);
  }
  function allow() {
    const may = mayOrder();
    if (!may) driven = [];
    for (const element of [which, mode, level, ...buttons]) element.disabled = !may;
  }
  onControl(allow);
  for (const what of ["unit", "chosen", "settings"]) on(what, show);
  return h("div", { class: "stack" },
    h("div", { class: "row" }, which, mode), h("label", { class: "field" }, "at", level, unit), h("div", { class: "row" }, ...buttons));
}
