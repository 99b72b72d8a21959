// Panel for what a hub has besides motors: servos, analog inputs, digital pins and I2C buses. A part is shown only if the hub has
// its devices. The hub ends pulses and releases outputs at STOP, and when the page in control is gone.

import { elementById, h, hexOf, numberIn, part, setText } from "./dom.js";
import { select } from "./list.js";
import { labelled } from "./slider.js";
import { mayOrder, on, state } from "./state.js";
import { number } from "./units.js";

/** Interval between two requests for the state of the devices that the page shows, in milliseconds. */
const LOOK_MS = 1000;
/** Number of servo outputs of a whole hub. */
const SERVOS = 6;
const LEVELS = [["input", "input, pulled up"], ["low", "output, low"], ["high", "output, high"]];
const RELEASED = ["released", "output, released"];

const count = (/** @type {number} */ length) => Array.from({ length }, (_, index) => index);
/** A byte as 61 or 0x3d; not a number for other texts, and above 255. */
const byte = (/** @type {string} */ text) => (/^(0x[0-9a-f]{1,2}|\d{1,3})$/i.test(text) && Number(text) < 256 ? Number(text) : NaN);

/** @param {any} link */
export function devicesPanel(link) {
  const parts = { servos: servos(link), analog: analog(), pins: pins(link), i2c: i2c(link) };
  const has = () => state.has ?? { servos: 0, analog: 0, pins: [], buses: 0 };

  function look() {
    if (!state.open || !state.connected || document.hidden || elementById("panel-devices").hidden) return;
    for (const what of /** @type {const} */ (["servos", "analog", "pins"])) {
      const { element } = parts[what];
      if (element.open && !element.hidden) link.order("look", what);
    }
  }
  function fit() {
    const { servos, analog, pins, buses } = has();
    parts.servos.element.hidden = !servos;
    // A hub that says what it has measures at least the battery.
    parts.analog.element.hidden = !analog;
    parts.pins.element.hidden = !pins.length;
    parts.i2c.element.hidden = !buses;
    parts.i2c.buses(buses);
    elementById("tab-devices").hidden = !servos && !analog && !pins.length && !buses;
    allow();
    look();
  }
  function allow() {
    const may = mayOrder();
    for (const { allow } of Object.values(parts)) allow(may);
  }
  on("line", fit);
  for (const what of ["control", "open"]) on(what, allow);
  for (const what of ["tab", "notice"]) on(what, look);
  for (const { element } of Object.values(parts)) element.addEventListener("toggle", look);
  setInterval(look, LOOK_MS);
  return h("div", { class: "parts" }, ...Object.values(parts).map(({ element }) => element));
}

function servos(/** @type {any} */ link) {
  const period = h("input", { type: "number", id: "servo-period", min: 2, max: 65535, step: 1, value: 20000, onchange: () => {
    for (const one of all) if (one.on) one.send(null);
  } });
  const all = count(SERVOS).map((servo) => {
    const one = { width: 1500, on: false, row: [], send, slider: /** @type {any} */ (null), run: /** @type {any} */ (null) };
    function send(/** @type {boolean|null} */ on) {
      link.order("device", { servo: { servo, period_us: numberIn(period), width_us: one.width, on } });
    }
    one.slider = labelled({ label: `Pulse of servo ${servo}, µs`, min: 500, max: 2500, step: 10, words: (value) => `${number(value)} µs`, send: (value) => {
      one.width = value;
      // A change of the width starts no pulses.
      if (one.on) send(null);
    } });
    one.slider.set(one.width, one.width);
    one.run = h("button", { type: "button", role: "switch", "aria-checked": "false", "aria-label": `Pulses of servo ${servo}`, onclick: () => {
      send(!one.on);
      one.on = !one.on;
      link.order("look", "servos");
    } }, "Off");
    one.row = [h("span", {}, `Servo ${servo}`), h("div", { class: "servo" }, one.slider.element, one.run)];
    return one;
  });
  // A width that was not sent before a stop is forgotten.
  const forget = () => { for (const one of all) one.slider.set(one.width, one.width); };
  for (const what of ["stopped", "line"]) on(what, forget);
  on("servos", ({ servos }) => all.forEach((one, servo) => {
    const is = servos[servo];
    for (const element of one.row) element.hidden = !is;
    if (!is) return;
    one.on = is.enabled;
    if (is.width_us && is.enabled) {
      one.width = is.width_us;
      one.slider.show(is.width_us, is.width_us);
    }
    one.run.setAttribute("aria-checked", String(is.enabled));
    setText(one.run, is.enabled ? "On" : "Off");
  }));
  return {
    element: part("devices", "Servos", true,
      h("div", { class: "pair servos" }, ...all.flatMap(({ row }) => row), h("label", { for: "servo-period" }, "Period, µs"), period),
      h("p", { class: "muted" }, "STOP ends the pulses of all servos. The hub also ends them when this page is gone, and below 7 V.")),
    allow: (/** @type {boolean} */ may) => { for (const element of [period, ...all.flatMap(({ slider, run }) => [slider.input, run])]) element.disabled = !may; },
  };
}

function analog() {
  const rows = h("tbody", {});
  on("analog", ({ channels }) => rows.replaceChildren(...channels.map((/** @type {any} */ of) => h("tr", {},
    h("th", {}, of.name), h("td", {}, of.value === null ? of.why : `${number(of.value, of.unit === "°C" ? 1 : 3)} ${of.unit}`)))));
  return {
    element: part("devices", "Analog inputs", false, h("table", { id: "analog" }, rows), h("p", { class: "muted" }, "An input without a connection reads about 0 V: it is pulled down.")),
    allow: () => {},
  };
}

function pins(/** @type {any} */ link) {
  const rows = h("div", { class: "pair servos" });
  /** @type {Map<number, {level: any, reads: Element}>} */
  const all = new Map();
  let may = false;
  on("pins", ({ pins }) => {
    if (pins.some((/** @type {any} */ { pin }) => !all.has(pin)) || pins.length !== all.size) {
      all.clear();
      for (const { pin } of pins) {
        const level = select(LEVELS, { id: `pin-${pin}`, "aria-label": `Digital pin ${pin}`, onchange: () => {
          link.order("device", { pin: { pin, level: level.value === "input" ? null : level.value === "high" } });
          link.order("look", "pins");
        } });
        level.disabled = !may;
        all.set(pin, { level, reads: h("output", {}) });
      }
      rows.replaceChildren(...[...all].flatMap(([pin, { level, reads }]) => [h("span", {}, `Pin ${pin}`), h("div", { class: "slider pin" }, level, reads)]));
    }
    for (const { pin, output, high } of pins) {
      const { level, reads } = /** @type {any} */ (all.get(pin));
      const word = high === null ? "released" : high ? "high" : "low";
      setText(reads, output ? "" : `reads ${word}`);
      // A list that is open stays as it is.
      const value = output ? word : "input";
      if (level.getAttribute("aria-expanded") === "true" || level.value === value) continue;
      level.options = value === "released" ? [...LEVELS, RELEASED] : LEVELS;
      level.value = value;
    }
  });
  return {
    element: part("devices", "Digital pins", false, rows, h("p", { class: "muted" }, "STOP releases all outputs: they read high by their pull-ups until a level is chosen again.")),
    allow: (/** @type {boolean} */ is) => {
      may = is;
      for (const { level } of all.values()) level.disabled = !is;
    },
  };
}

function i2c(/** @type {any} */ link) {
  const bus = select([["0", "0"]], { id: "i2c-bus" });
  const field = (/** @type {string} */ id, /** @type {string} */ value, /** @type {string} */ empty) => h("input", { type: "text", id, value, placeholder: empty, autocomplete: "off", spellcheck: "false" });
  const [address, register, bytes] = [field("i2c-address", "0x28", "0x08 to 0x77"), field("i2c-register", "0", "none"), field("i2c-bytes", "", "such as 0x3d 12")];
  const length = h("input", { type: "number", id: "i2c-count", min: 1, max: 100, step: 1, value: 1 });
  const fast = select([["", "100 kbit/s"], ["fast", "400 kbit/s"]], { id: "i2c-speed" });
  const result = h("p", { role: "status", id: "i2c-result", class: "bytes" });

  function run(/** @type {string} */ what, /** @type {Record<string, any>} */ fields) {
    const wrong = Object.entries(fields).find(([, value]) => [value].flat().some(Number.isNaN));
    if (wrong) return setText(result, `${wrong[0]}: enter a number such as 61 or 0x3d.`);
    setText(result, `Bus ${bus.value}: ${what} …`);
    link.order("device", { [what]: { bus: Number(bus.value), ...fields } });
  }
  const target = () => ({ address: byte(address.value.trim()), fast: fast.value === "fast" });
  const button = (/** @type {string} */ words, /** @type {() => void} */ act) => h("button", { type: "button", onclick: act }, words);
  const buttons = [
    button("Scan", () => run("scan", {})),
    button("Read", () => run("read", { ...target(), register: register.value.trim() === "" ? null : byte(register.value.trim()), count: Math.round(numberIn(length)) })),
    button("Write", () => run("write", { ...target(), bytes: bytes.value.split(/[\s,]+/).filter(Boolean).map(byte) })),
  ];
  on("transfer", (of) => {
    const shown = hexOf(of.bytes, " ");
    const words = of.what === "scan" ? (shown ? `devices at 0x${hexOf(of.bytes, " 0x")}` : "no device answers") : of.what === "read" ? `read ${shown}` : `wrote ${shown}`;
    setText(result, `Bus ${of.bus}: ${of.why ?? words}.`);
  });
  const fail = (/** @type {string} */ why) => { if (result.textContent?.endsWith("…")) setText(result, `Not done: ${why}.`); };
  on("refused", ({ why }) => fail(why));
  for (const what of ["line", "open"]) on(what, () => fail("the connection was lost, or another hub is shown"));
  return {
    element: part("devices", "I2C buses", false,
      h("div", { class: "pair" }, h("label", { for: "i2c-bus" }, "Bus"), bus, h("label", { for: "i2c-address" }, "Address"), address, h("label", { for: "i2c-register" }, "Register to read"), register, h("label", { for: "i2c-count" }, "Bytes to read"), length, h("label", { for: "i2c-bytes" }, "Bytes to write"), bytes, h("label", { for: "i2c-speed" }, "Speed"), fast),
      h("div", { class: "row" }, ...buttons), result,
      h("p", { class: "muted" }, "A scan reads one byte from each address. Some devices take such a read for a command.")),
    allow: (/** @type {boolean} */ may) => { for (const element of [bus, address, register, length, bytes, fast, ...buttons]) element.disabled = !may; },
    buses: (/** @type {number} */ buses) => { if (buses && bus.options.length !== buses) bus.options = count(buses).map((index) => [String(index), String(index)]); },
  };
}
