// The simulated world: loads, torques, battery and faults to play with, so that it can be seen what the hub does about them.

import { h, say, select } from "./dom.js";
import { inControl, on, state } from "./state.js";
import { number } from "./units.js";

const ENCODERS = [["sound", "sound"], ["unplugged", "unplugged"], ["reversed", "wires changed places"], ["loose", "a loose contact"]];
const WAIT_MS = 50;

/** A slider with its value in words. @param {{label: string, min: number, max: number, step: number, words: (value: number) => string, send: (value: number) => void}} of */
function slider({ label, min, max, step, words, send }) {
  const input = h("input", { type: "range", min, max, step, "aria-label": label });
  const output = h("output", {}, "");
  /** @type {any} */
  let timer;
  input.addEventListener("input", () => {
    say(output, words(Number(input.value)));
    clearTimeout(timer);
    timer = setTimeout(() => send(Number(input.value)), WAIT_MS);
  });
  return { input, element: h("div", { class: "slider" }, input, output), set(/** @type {number} */ value) { input.value = String(value); say(output, words(value)); } };
}

/** @param {any} link */
export function worldPanel(link) {
  const change = (/** @type {string} */ what, /** @type {any} */ fields) => link.order("world", { [what]: fields });
  const motor = () => state.chosen;
  const volts = slider({ label: "Battery without load, V", min: 0, max: 16, step: 0.1, words: (value) => `${number(value, 1)} V`, send: (value) => change("battery", { volts: value }) });
  const torque = slider({ label: "Torque on the output shaft, N m", min: -2, max: 2, step: 0.05, words: (value) => `${number(value, 2)} N m`, send: (value) => change("torque", { motor: motor(), nm: value }) });
  const inertia = slider({ label: "Load on the output shaft, kg m²", min: 0, max: 0.02, step: 0.0005, words: (value) => `${number(1e3 * value, 1)} g m²`, send: (value) => change("inertia", { motor: motor(), kg_m2: value }) });
  const hold = h("button", { type: "button", "aria-pressed": "false", onclick: () => change("hold", { motor: motor(), held: hold.getAttribute("aria-pressed") !== "true" }) }, "Hold the shaft");
  const encoder = select(ENCODERS, { id: "world-encoder", onchange: () => change("encoder", { motor: motor(), is: encoder.value }) });
  const of = h("h3", {}, "");
  const buttons = [
    ["Winch: 0.8 N m pull", () => { link.order("drive", { motor: motor(), mode: "velocity", value: 800 }); link.order("enable", { motor: motor(), on: true }); change("torque", { motor: motor(), nm: 0.8 }); }],
    ["Unplug its encoder", () => change("encoder", { motor: motor(), is: "unplugged" })],
    ["Drop the battery to 7 V", () => change("battery", { volts: 7 })],
    ["All as it was", () => change("reset", null)],
  ].map(([words, act]) => h("button", { type: "button", onclick: act }, words));

  const play = h("button", { type: "button", class: "primary", id: "world-play", hidden: true, onclick: () => link.order("play") }, "Play the scenario");
  on("welcome", () => { play.hidden = !state.playable; });

  function fill() {
    const { world } = state;
    say(of, `Motor ${state.chosen}`);
    if (!world) return;
    const at = world.motors[state.chosen];
    if (document.activeElement !== volts.input) volts.set(world.volts ?? 12.6);
    if (document.activeElement !== torque.input) torque.set(at.nm ?? 0);
    if (document.activeElement !== inertia.input) inertia.set(at.kg_m2 ?? 0);
    if (at.kg_m2 === null) say(/** @type {any} */ (inertia.element.lastChild), "as it is");
    if (at.nm === null) say(/** @type {any} */ (torque.element.lastChild), "as it is");
    if (world.volts === null) say(/** @type {any} */ (volts.element.lastChild), "as it is");
    hold.setAttribute("aria-pressed", String(at.held));
    say(hold, at.held ? "Let the shaft go" : "Hold the shaft");
    encoder.value = at.encoder;
  }
  function allow() {
    for (const element of [volts.input, torque.input, inertia.input, hold, encoder, play, ...buttons]) element.disabled = !inControl();
    fill();
  }
  for (const what of ["world", "chosen"]) on(what, fill);
  for (const what of ["desk", "open"]) on(what, allow);
  return h("div", { class: "columns" },
    h("div", { class: "stack" }, of,
      h("div", { class: "pair" }, h("span", {}, "Torque on its shaft"), torque.element, h("span", {}, "Load on its shaft"), inertia.element, h("label", { for: "world-encoder" }, "Its encoder"), encoder, h("span", {}, "A hand"), hold)),
    h("div", { class: "stack" }, h("h3", {}, "For all"),
      h("div", { class: "pair" }, h("span", {}, "Battery, no load"), volts.element),
      h("div", { class: "row" }, play, ...buttons),
      h("p", { class: "muted" }, "Let a motor hold a speed and pull its shaft along: its control sinks from forward through braking towards reverse, and the bands of the control plot show where it is.")));
}
