// Panel for the set-up: the connected motor, the scheme, and the duty rule.

import { h, setText } from "./dom.js";
import { settingsForm } from "./fields.js";
import { select } from "./list.js";
import { emit, inControl, mayOrder, on, onControl, state } from "./state.js";
import { number } from "./units.js";

const SCHEMES = [["A", "A: control is an equivalent voltage"], ["B", "B: control is a current"], ["C", "C: as B, with braking as steep as driving"], ["D", "D: between B and C"], ["none", "No braking regime"]];
const DUTIES = [["linear-current", "Linear current"], ["linear-duty", "Linear duty, as in the paper"]];

const UNCHANGED = [["", "unchanged"]];

/** @param {any} link */
export function setupPanel(link) {
  const name = select(UNCHANGED, { id: "setup-name" });
  const scheme = select(SCHEMES, { id: "setup-scheme" });
  const duty = select(DUTIES, { id: "setup-duty" });
  const facts = h("p", { class: "muted" });
  const apply = h("button", { type: "button", class: "primary", onclick: () => link.order("set-up", { motor: state.chosen, name: name.value === state.settings[state.chosen]?.name ? null : name.value || null, scheme: scheme.value, duty: duty.value }) }, "Apply");
  const undo = h("button", { type: "button", onclick: () => link.order("undo", { motor: state.chosen }) }, "Undo");
  const save = h("button", { type: "button", id: "save", onclick: () => link.order("save") }, "Save settings");
  const saving = h("p", { class: "muted" });
  const zero = h("button", { type: "button", title: "The present position becomes 0. A motor that holds a position would travel: switch it off first", onclick: () => {
    link.order("reset-encoder", { motor: state.chosen });
    emit("zeroed", state.chosen);
  } }, "Set zero here");

  function fill() {
    const settings = state.settings[state.chosen];
    allow();
    if (!settings) return;
    name.value = settings.name ?? "";
    scheme.value = settings.scheme.scheme;
    duty.value = settings.duty;
    setText(facts, `Back EMF ${number(settings.emf_mv_s_per_count, 3)} mV s/count, winding ${number(settings.resistance_ohm, 2)} Ω${settings.counts_per_turn ? `, ${number(settings.counts_per_turn)} counts per turn` : ""}.`);
  }
  function allow() {
    const may = mayOrder();
    for (const element of [name, scheme, duty, apply, zero]) element.disabled = !may;
    undo.disabled = !inControl() || !state.settings[state.chosen]?.undoable;
    save.disabled = !may || !state.stores;
    setText(saving, state.stores || !state.connected ? "Settings of all motors last until the hub restarts, unless they are saved." : "This hub cannot store settings: they last until it restarts.");
  }
  on("welcome", () => { name.options = [...UNCHANGED, ...state.catalogue.map((/** @type {any} */ motor) => [motor.name, motor.name])]; });
  on("settings", ({ motor }) => { if (motor === state.chosen) fill(); });
  on("chosen", fill);
  onControl(allow);
  return h("div", { class: "columns" },
    h("div", { class: "stack" },
      h("div", { class: "pair" }, h("label", { for: "setup-name" }, "Motor"), name, h("label", { for: "setup-scheme" }, "Scheme"), scheme, h("label", { for: "setup-duty" }, "Duty"), duty),
      h("div", { class: "row" }, apply, undo, zero, save)),
    settingsForm(link),
    h("div", { class: "stack" }, facts, saving, h("p", { class: "muted" }, "Another motor starts with default coefficients for its constants; its dynamics are reset. The scheme determines the points S, T, Z and G: watch the bands of the control plot while you change it.")));
}
