// A card for each motor: state, reason why it stands, and set-point.

import { by, h, say, select } from "./dom.js";
import { choose, inControl, on, state } from "./state.js";
import { fromCps, number, speed, speedUnit, toCps } from "./units.js";

/** Shortest interval between two set-points of a dragged slider, in milliseconds. */
const DRAG_MS = 50;
/** Highest speed that a hub accepts, in counts/s. */
const MOST_CPS = 32767;

/** @type {{order: (order: string, fields?: any) => boolean}} */
let link;
/** @type {any[]} */
const cards = [];

/** Free speed of a motor at 12 V, in the chosen unit. */
function fastest(/** @type {any} */ settings) {
  const cps = Math.min(MOST_CPS, settings ? 12000 / settings.emf_mv_s_per_count : 3000);
  return fromCps(cps, settings);
}

/** Range, step and unit of the slider of a mode. */
function scale(/** @type {string} */ mode, /** @type {any} */ settings) {
  if (mode === "power") return { most: 100, step: 1, unit: "%" };
  if (mode === "current") return { most: Math.ceil(10 * (12 / (settings?.resistance_ohm || 3))) / 10, step: 0.05, unit: "A" };
  if (mode === "velocity") {
    const most = fastest(settings);
    const step = most > 500 ? 10 : most > 50 ? 1 : 0.1;
    return { most: Math.floor(most / step) * step, step, unit: speedUnit(settings) };
  }
  return { most: Math.round(5 * (settings?.counts_per_turn ?? 1000)), step: 1, unit: "counts" };
}

/** The set-point in the server's unit. */
function value(/** @type {any} */ card) {
  const given = Number(card.number.value) || 0;
  const mode = card.mode.value;
  if (mode === "power") return given / 100;
  return mode === "velocity" ? Math.max(-MOST_CPS, Math.min(MOST_CPS, toCps(given, state.settings[card.motor]))) : given;
}

function drive(/** @type {any} */ card) {
  if (card.mode.value === "current") link.order("current", { motor: card.motor, amperes: value(card) });
  else link.order("drive", { motor: card.motor, mode: card.mode.value, value: value(card) });
}

function fit(/** @type {any} */ card) {
  const { most, step, unit } = scale(card.mode.value, state.settings[card.motor]);
  for (const input of [card.slider, card.number]) Object.assign(input, { min: input === card.number && card.mode.value !== "power" ? "" : -most, max: input === card.number && card.mode.value !== "power" ? "" : most, step: input === card.number && unit === "counts" ? 1 : step });
  card.slider.setAttribute("aria-label", `Set-point of motor ${card.motor}, ${unit}`);
  card.number.setAttribute("aria-label", `Set-point of motor ${card.motor}, ${unit}`);
  say(card.unit, unit);
}

function build(/** @type {number} */ motor) {
  /** @type {any} */
  const card = { motor, sent: 0 };
  card.name = h("small", {});
  card.choose = h("button", { class: "choose", type: "button", "aria-pressed": "false", onclick: () => choose(motor) }, `Motor ${motor} `, card.name);
  card.pill = h("span", { class: "pill" }, "off");
  card.run = h("button", { class: "run", type: "button", role: "switch", "aria-checked": "false", "aria-label": `Enable motor ${motor}`, onclick: () => run(card) }, "Run");
  card.speed = h("b", {}, "–");
  card.speedUnit = h("span", {}, "");
  card.position = h("b", {}, "–");
  card.current = h("b", {}, "–");
  card.mode = select([["power", "Power"], ["current", "Current"], ["velocity", "Velocity"], ["position", "Position"]], { "aria-label": `Mode of motor ${motor}` });
  card.mode.value = "velocity";
  card.slider = h("input", { type: "range", value: 0 });
  card.number = h("input", { type: "number", value: 0 });
  card.unit = h("span", { class: "muted" });
  card.why = h("p", { class: "why", role: "status" });
  card.mode.addEventListener("change", () => {
    card.slider.value = card.number.value = "0";
    if (card.mode.value === "position") card.number.value = String(Math.round(state.frame?.motors[motor]?.position ?? 0));
    fit(card);
    drive(card);
  });
  card.slider.addEventListener("input", () => {
    card.number.value = card.slider.value;
    clearTimeout(card.timer);
    const wait = Math.max(0, card.sent + DRAG_MS - performance.now());
    card.timer = setTimeout(() => { card.sent = performance.now(); drive(card); }, wait);
  });
  card.number.addEventListener("change", () => { card.slider.value = card.number.value; drive(card); });
  card.element = h("article", { class: "card", "aria-label": `Motor ${motor}` },
    h("header", {}, card.choose, card.run),
    h("div", { class: "numbers" }, h("span", { class: "speed" }, card.speed, " ", card.speedUnit), h("span", { class: "grow" }), h("span", {}, card.current, " A"), h("span", {}, card.position, " counts")),
    h("div", { class: "setpoint" }, card.mode, card.slider, card.number),
    h("div", { class: "does" }, card.pill, card.why));
  by("motors").append(card.element);
  cards.push(card);
  fit(card);
}

function run(/** @type {any} */ card) {
  const running = state.frame?.motors[card.motor]?.enabled;
  if (!running) drive(card);
  link.order("enable", { motor: card.motor, on: !running });
  // A hub takes a constant current for enabled motors only.
  if (!running && card.mode.value === "current") drive(card);
}

function show(/** @type {any} */ card, /** @type {any} */ motor) {
  const settings = state.settings[card.motor];
  say(card.speed, speed(motor.velocity, settings));
  say(card.speedUnit, speedUnit(settings));
  say(card.position, number(motor.position));
  say(card.current, motor.best_current_a === undefined ? "–" : number(motor.best_current_a, 2));
  card.run.setAttribute("aria-checked", String(motor.enabled));
  say(card.run, motor.enabled ? "Running" : "Run");
  const regime = motor.enabled ? motor.regime : null;
  card.pill.className = `pill ${regime ?? ""}`;
  say(card.pill, regime ? `${regime} ${motor.mode}, ${number(100 * motor.duty)} %` : motor.enabled && motor.regime !== undefined ? "bridge open" : motor.enabled ? motor.told : "off");
  const words = motor.why ? motor.why[0].toUpperCase() + motor.why.slice(1) + "." : motor.told === "identify" ? "Identification runs." : !motor.enabled ? "Disabled, still turning." : motor.regulator ? `Regulated ${motor.regulator === "model" ? "by the motor model" : "by PID"}${motor.derated ? "; derated: the winding is hot, and the current is limited" : ""}${motor.current_limited ? "; held by its current limit" : ""}${motor.settled ? "; settled at its target" : ""}.` : "";
  const constant = motor.told === "power" ? "Constant power." : motor.told === "current" ? `Constant current${motor.current_limited ? ", held by the current limit" : ""}.` : null;
  say(card.why, constant && !motor.why ? constant : words);
  card.why.classList.toggle("fault", Boolean(motor.fault || motor.stalled));
}

function allow() {
  const may = inControl() && state.connected;
  for (const card of cards) for (const element of [card.run, card.mode, card.slider, card.number]) element.disabled = !may;
}

export function startMotors(/** @type {any} */ to) {
  link = to;
  [0, 1, 2, 3].forEach(build);
  on("frame", (frame) => {
    for (const card of cards) {
      card.element.hidden = card.motor >= frame.motors.length;
      if (frame.motors[card.motor]) show(card, frame.motors[card.motor]);
    }
  });
  on("settings", ({ motor }) => {
    say(cards[motor].name, state.settings[motor]?.name ?? "");
    fit(cards[motor]);
  });
  on("unit", () => cards.forEach((card) => {
    if (card.mode.value === "velocity") card.slider.value = card.number.value = "0";
    fit(card);
  }));
  on("chosen", () => cards.forEach((card) => {
    card.element.classList.toggle("chosen", card.motor === state.chosen);
    card.choose.setAttribute("aria-pressed", String(card.motor === state.chosen));
  }));
  for (const what of ["desk", "open", "line"]) on(what, allow);
  allow();
}
