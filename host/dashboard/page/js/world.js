// Panel for a simulated hub: loads, torques, battery and faults, to see how the hub reacts.

import { h, setText } from "./dom.js";
import { select } from "./list.js";
import { labelled } from "./slider.js";
import { inControl, on, state } from "./state.js";
import { number } from "./units.js";

const ENCODERS = [["sound", "sound"], ["unplugged", "unplugged"], ["reversed", "wires swapped"], ["loose", "loose contact"]];
/** @param {any} link */
export function worldPanel(link) {
  const change = (/** @type {string} */ what, /** @type {any} */ fields) => link.order("world", { [what]: fields });
  const motor = () => state.chosen;
  const volts = labelled({ label: "Battery without load, V", min: 0, max: 16, step: 0.1, words: (value) => `${number(value, 1)} V`, send: (value) => change("battery", { volts: value }) });
  const torque = labelled({ label: "Torque on the output shaft, N m", min: -2, max: 2, step: 0.05, words: (value) => `${number(value, 2)} N m`, send: (value) => change("torque", { motor: motor(), nm: value }) });
  const inertia = labelled({ label: "Inertia on the output shaft, kg m²", min: 0, max: 0.02, step: 0.0005, words: (value) => `${number(1e3 * value, 1)} g m²`, send: (value) => change("inertia", { motor: motor(), kg_m2: value }) });
  const hold = h("button", { type: "button", "aria-pressed": "false", onclick: () => change("hold", { motor: motor(), held: hold.getAttribute("aria-pressed") !== "true" }) }, "Hold the shaft");
  const encoder = select(ENCODERS, { id: "world-encoder", onchange: () => change("encoder", { motor: motor(), is: encoder.value }) });
  const of = h("h3", {}, "");
  const buttons = [
    ["Winch of 0.8 N m", () => { link.order("drive", { motor: motor(), mode: "velocity", value: 800, enable: true }); change("torque", { motor: motor(), nm: 0.8 }); }],
    ["Unplug the encoder", () => change("encoder", { motor: motor(), is: "unplugged" })],
    ["Battery to 7 V", () => change("battery", { volts: 7 })],
    ["Reset simulation", () => change("reset", null)],
  ].map(([words, act]) => h("button", { type: "button", onclick: act }, words));

  const play = h("button", { type: "button", class: "primary", id: "world-play", hidden: true, onclick: () => link.order("play") }, "Play the scenario");
  on("welcome", () => { play.hidden = !state.playable; });

  /** The motor whose values are shown. */
  let filled = -1;
  function fill() {
    const { world } = state;
    setText(of, `Motor ${state.chosen}`);
    if (!world) return;
    const at = world.motors[state.chosen];
    volts.show(world.volts, 12.6);
    // A slider in use does not keep the value of the motor that was chosen before.
    const put = filled === state.chosen ? "show" : "set";
    filled = state.chosen;
    torque[put](at.nm, 0);
    inertia[put](at.kg_m2, 0);
    hold.setAttribute("aria-pressed", String(at.held));
    setText(hold, at.held ? "Release the shaft" : "Hold the shaft");
    encoder.value = at.encoder;
  }
  function allow() {
    for (const element of [volts.input, torque.input, inertia.input, hold, encoder, play, ...buttons]) element.disabled = !inControl();
    fill();
  }
  for (const what of ["world", "chosen"]) on(what, fill);
  for (const what of ["control", "open"]) on(what, allow);
  return h("div", { class: "columns" },
    h("div", { class: "stack" }, of,
      h("div", { class: "pair" }, h("span", {}, "Torque on the shaft"), torque.element, h("span", {}, "Inertia on the shaft"), inertia.element, h("label", { for: "world-encoder" }, "Encoder"), encoder, h("span", {}, "Shaft"), hold)),
    h("div", { class: "stack" }, h("h3", {}, "All motors"),
      h("div", { class: "pair" }, h("span", {}, "Battery, no load"), volts.element),
      h("div", { class: "row" }, play, ...buttons),
      h("p", { class: "muted" }, "Run a motor at a speed, and apply a torque in the direction of motion. Its control falls from forward through braking towards reverse; the bands of the control plot show the regime.")));
}
