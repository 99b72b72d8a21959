// A form of all settings of the chosen motor, under their names in a settings file.

import { h, numberOrNull } from "./dom.js";
import { select } from "./list.js";
import { mayOrder, on, onControl, state } from "./state.js";

/** Text of a setting's value; empty if the setting is not configured. */
const shown = (/** @type {any} */ value) => (value === null ? "" : typeof value === "number" ? String(Number(value.toPrecision(7))) : value);

/** @param {any} link */
export function settingsForm(link) {
  const rows = h("div", { class: "pair" });
  const apply = h("button", { type: "button", class: "primary", onclick: () => {
    const given = inputs.map(({ input, of }) => ({ of, text: input.value, value: of.words.length ? input.value : numberOrNull(input) }));
    const changed = given.filter(({ of, text }) => text !== shown(of.value));
    const values = Object.fromEntries(changed.map(({ of, value }) => [of.name, value]));
    link.order("configure", { motor: state.chosen, values });
  } }, "Apply changes");
  const again = h("button", { type: "button", onclick: () => fill() }, "Discard changes");
  /** @type {{input: any, of: any}[]} */
  let inputs = [];

  function fill() {
    const fields = state.settings[state.chosen]?.fields ?? [];
    inputs = fields.map((/** @type {any} */ of) => {
      const [least, most] = of.range;
      const attributes = { id: `field-${of.name}`, "aria-label": of.name };
      const input = of.words.length
        ? select(of.words.map((/** @type {string} */ word) => [word, word]), attributes)
        : h("input", { type: "number", step: "any", min: least, max: most, title: `${shown(least)} to ${shown(most)}`, placeholder: of.optional ? "not configured" : "", ...attributes });
      input.value = shown(of.value);
      return { input, of };
    });
    rows.replaceChildren(...inputs.flatMap(({ input, of }) => [h("label", { for: input.id }, of.name), input]));
    allow();
  }
  function allow() {
    for (const element of [apply, again, ...inputs.map(({ input }) => input)]) element.disabled = !mayOrder();
  }
  on("settings", ({ motor }) => { if (motor === state.chosen) fill(); });
  on("chosen", fill);
  onControl(allow);
  return h("details", { id: "all-settings" }, h("summary", {}, "All settings of the motor"),
    h("div", { class: "stack" },
      h("p", { class: "muted" }, "The names are those of a settings file; each ends with its unit. An empty field is not configured."),
      rows, h("div", { class: "row" }, apply, again)));
}
