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
  const again = h("button", { type: "button", onclick: () => discard() }, "Discard changes");
  /** The motor whose settings the fields show. */
  let motor = state.chosen;
  /** @type {{input: any, of: any}[]} */
  let inputs = [];
  /** By motor the fields with an entry that is not in force. @type {{input: any, of: any}[][]} */
  let typed = [];

  /** Shows the settings in force. An entry stays until its setting changes. */
  function fill() {
    typed[motor] = inputs.filter(({ input, of }) => input.validity?.badInput || input.value !== shown(of.value));
    motor = state.chosen;
    const fields = state.settings[motor]?.fields ?? [];
    inputs = fields.map((/** @type {any} */ of) => {
      const kept = typed[motor]?.find((before) => before.of.name === of.name && before.of.value === of.value);
      if (kept) return { input: kept.input, of };
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
  function discard() {
    [inputs, typed[motor]] = [[], []];
    fill();
  }
  function allow() {
    for (const element of [apply, again, ...inputs.map(({ input }) => input)]) element.disabled = !mayOrder();
  }
  on("settings", ({ motor }) => { if (motor === state.chosen) fill(); });
  on("chosen", fill);
  // The server sends this message before the settings of another hub.
  on("line", () => { [inputs, typed] = [[], []]; });
  onControl(allow);
  return h("details", { id: "all-settings" }, h("summary", {}, "All settings of the motor"),
    h("div", { class: "stack" },
      h("p", { class: "muted" }, "The names are those of a settings file; each ends with its unit. An empty field is not configured."),
      rows, h("div", { class: "row" }, apply, again)));
}
