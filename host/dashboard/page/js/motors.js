// A card for each motor: state, reason why it stands, and set-point. The set-point of a running motor is the hub's, so that
// every page shows what runs. A motor that was stopped starts again at zero, or at its present position, unless a value
// was entered since. A value that was entered before *Set zero here*, or for another hub, no longer counts.

import { elementById, h, numberIn, setText } from "./dom.js";
import { select } from "./list.js";
import { slider } from "./slider.js";
import { choose, mayOrder, motorName, on, onControl, state } from "./state.js";
import { freeSpeed, fromCps, number, speed, speedLimit, speedUnit, toCps } from "./units.js";

/** Shortest interval between two set-points of a dragged slider, in milliseconds. */
const DRAG_MS = 50;
/** Time after an order during which reported set-points may be older than the order, in milliseconds. */
const ORDER_MS = 500;
/** Time for which the card shows the message about a limited value, in milliseconds. */
const SAID_MS = 8000;
/** Highest speed of a motor that counts as standing, as in the client. */
const STANDS_CPS = 3;

/** Options of set-points: behaviour at zero, speed limits in counts/s, and the tolerance of positions in counts. */
export const motion = { zero: "brake", speed: /** @type {number|null} */ (1000), tolerance: /** @type {number|null} */ (10), current: /** @type {number|null} */ (null) };

/** @type {{order: (order: string, fields?: any) => boolean}} */
let link;
/** @type {any[]} */
const cards = [];

/**
 * Range, step and unit of a mode. `shown` converts from the server's unit, `meant` converts to it. `limit` names what limits
 * entered values; without it only the slider has limits.
 * @returns {{most: number, step: number, digits: number, unit: string, limit?: string, shown: (value: number) => number, meant: (value: number) => number}}
 */
export function scale(/** @type {string} */ mode, /** @type {any} */ settings) {
  const same = (/** @type {number} */ value) => value;
  if (mode === "power") return { most: 100, step: 1, digits: 1, unit: "%", limit: "full power", shown: (value) => 100 * value, meant: (value) => value / 100 };
  if (mode === "current") {
    const most = Math.ceil(10 * (12 / (settings?.resistance_ohm || 3))) / 10;
    return { most, step: 0.05, digits: 2, unit: "A", limit: "the stall current at 12 V", shown: same, meant: same };
  }
  if (mode === "velocity") {
    const free = fromCps(freeSpeed(settings), settings);
    const step = free > 500 ? 10 : free > 50 ? 1 : 0.1;
    return { most: Math.floor(free / step) * step, step, digits: speedUnit(settings) === "counts/s" ? 0 : 1, unit: speedUnit(settings), limit: speedLimit(settings), shown: (value) => fromCps(value, settings), meant: (value) => toCps(value, settings) };
  }
  return { most: Math.round(5 * (settings?.counts_per_turn ?? 1000)), step: 1, digits: 0, unit: "counts", shown: same, meant: same };
}

/** An entered value within the range of a mode, and words where it was limited. @returns {{value: number, words: string|null}} */
export function limited(/** @type {ReturnType<typeof scale>} */ { most, digits, unit, limit }, /** @type {number} */ given) {
  const value = limit ? Math.max(-most, Math.min(most, given)) : given;
  return { value, words: value === given ? null : `Limited to ${number(value, digits)} ${unit}, ${limit}: ${given} was entered.` };
}

const of = (/** @type {any} */ card) => scale(card.mode.value, state.settings[card.motor]);

/** Sends the set-point. With `enable` the server enables the motor once the hub has accepted the set-point. */
function drive(/** @type {any} */ card, enable = false) {
  card.orderedAt = performance.now();
  if (card.mode.value === "current") link.order("current", { motor: card.motor, amperes: card.target, speed: motion.current, enable });
  else link.order("drive", { motor: card.motor, mode: card.mode.value, value: card.target, zero: motion.zero, speed: motion.speed, tolerance: motion.tolerance, enable });
}

/** Takes a value in the unit of the card, limits it to what the motor can, and sends it. */
function enter(/** @type {any} */ card, /** @type {number} */ given) {
  const { value, words } = limited(of(card), given);
  card.entered = true;
  card.target = of(card).meant(value);
  card.limited = words && { words, until: performance.now() + SAID_MS };
  clearTimeout(card.timer);
  drive(card);
}

/** Puts the set-point of a motor that is not driven in the place of an entered one. */
function rest(/** @type {any} */ card) {
  card.entered = false;
  card.target = card.mode.value === "position" ? state.frame?.motors[card.motor]?.position ?? 0 : 0;
  clearTimeout(card.timer);
}

/** Shows the set-point in slider and field. A field into which somebody types stays as it is, unless `typed` is true. */
function showTarget(/** @type {any} */ card, typed = false) {
  const { digits, limit, most, shown } = of(card);
  const value = Number(shown(card.target).toFixed(digits));
  // A position beyond the slider's range becomes the middle of the range, so that a drag begins at the position.
  if (!limit && Math.abs(value - card.middle) > most) {
    card.middle = value;
    Object.assign(card.slider.input, { min: value - most, max: value + most });
  }
  card.slider.set(value);
  if (typed || document.activeElement !== card.number) card.number.value = String(value);
}

/** Adapts slider and field to mode, motor and unit. */
function fit(/** @type {any} */ card) {
  const { most, step, unit } = of(card);
  card.middle = 0;
  Object.assign(card.slider.input, { min: -most, max: most, step });
  card.number.step = step;
  card.slider.input.setAttribute("aria-label", `Slider for the set-point of motor ${card.motor}, ${unit}`);
  card.number.setAttribute("aria-label", `Set-point of motor ${card.motor}, ${unit}`);
  setText(card.unit, unit);
  showTarget(card);
}

function build(/** @type {number} */ motor) {
  /** @type {any} */
  const card = { motor, target: 0, middle: 0, entered: false, sent: 0, orderedAt: -Infinity };
  card.name = h("small", {});
  card.title = h("span", {}, `Motor ${motor}`);
  card.choose = h("button", { class: "choose", type: "button", "aria-pressed": "false", onclick: () => choose(motor) }, card.title, card.name);
  card.pill = h("span", { class: "pill" }, "Off (coasting)");
  card.run = h("button", { class: "run", type: "button", role: "switch", "aria-checked": "false", "aria-label": `Enable motor ${motor}`, onclick: () => run(card) }, "Run");
  card.speed = h("b", {}, "–");
  card.speedUnit = h("span", {}, "");
  card.position = h("b", {}, "–");
  card.current = h("b", {}, "–");
  card.mode = select([["power", "Power"], ["current", "Current"], ["velocity", "Velocity"], ["position", "Position"]], { "aria-label": `Mode of motor ${motor}` });
  card.mode.value = "velocity";
  card.slider = slider({ value: 0 }, (value) => {
    card.entered = true;
    card.target = of(card).meant(value);
    card.number.value = String(value);
    clearTimeout(card.timer);
    const wait = Math.max(0, card.sent + DRAG_MS - performance.now());
    card.timer = setTimeout(() => { card.sent = performance.now(); drive(card); }, wait);
  });
  card.number = h("input", { type: "number", value: 0 });
  card.unit = h("span", { class: "unit muted" });
  card.why = h("p", { class: "why", role: "status" });
  card.mode.addEventListener("change", () => {
    rest(card);
    fit(card);
    drive(card);
  });
  card.number.addEventListener("change", () => {
    try {
      enter(card, numberIn(card.number));
    } finally {
      showTarget(card, true);
    }
  });
  card.element = h("article", { class: "card", "aria-label": `Motor ${motor}` },
    h("header", {}, card.choose, h("span", { class: "speed" }, card.speed, " ", card.speedUnit), card.run),
    h("div", { class: "setpoint" }, card.mode, card.slider.element, card.number),
    h("div", { class: "numbers" }, card.pill, h("span", {}, card.current, " A"), h("span", {}, card.position, " counts")),
    card.why);
  elementById("motors").append(card.element);
  cards.push(card);
  fit(card);
}

function run(/** @type {any} */ card) {
  if (state.frame?.motors[card.motor]?.enabled) link.order("enable", { motor: card.motor, on: false });
  else drive(card, true);
}

/** Follows the hub's set-point. */
function follow(/** @type {any} */ card, /** @type {any} */ motor) {
  const stopped = card.enabled && !motor.enabled;
  card.enabled = motor.enabled;
  if (stopped || (!motor.enabled && !card.entered && !card.slider.held())) {
    rest(card);
    return showTarget(card, stopped);
  }
  const mine = card.slider.held() || performance.now() - card.orderedAt < ORDER_MS;
  if (!motor.enabled || mine || motor.target === null || !card.mode.options.some(([mode]) => mode === motor.setpoint)) return;
  if (card.mode.value === motor.setpoint && card.target === motor.target) return;
  // At power 0 a motor brakes, as before an identification. The card keeps its mode, in which the next value is meant.
  if (motor.setpoint === "power" && motor.target === 0) {
    rest(card);
    return showTarget(card);
  }
  card.mode.value = motor.setpoint;
  card.target = motor.target;
  fit(card);
}

/** Words for the regimes, and what the bridge does in them. */
const REGIMES = {
  forward: ["Driving", "the bridge drives the motor for this share of the time, and shorts it for the rest"],
  braking: ["Braking", "the bridge shorts the winding for this share of the time, and opens it for the rest: the motor brakes, and returns energy to the supply"],
  reverse: ["Reversing", "the bridge drives the motor against its motion for this share of the time, and shorts it for the rest"],
};

/** State of the bridge in a few words, and what it means. */
function bridge(/** @type {any} */ motor) {
  if (!motor.enabled) return ["Off (coasting)", "The bridge is open: the motor turns freely."];
  const regime = REGIMES[/** @type {keyof typeof REGIMES} */ (motor.regime)];
  if (regime) return [`${regime[0]}, ${number(100 * motor.duty)} % duty`, `Mode ${motor.mode}: ${regime[1]}.`];
  return motor.regime === undefined ? [motor.setpoint, ""] : ["Coasting", "The bridge is open: the motor turns freely."];
}

/** What a motor does, or why it does nothing. */
function words(/** @type {any} */ motor) {
  const troubled = motor.fault || motor.stalled;
  if (motor.enabled && motor.setpoint === "velocity" && motor.target === 0 && motor.regulator && !troubled && Math.abs(motor.velocity) <= STANDS_CPS) return "Holding at zero speed.";
  if (motor.why) return motor.why[0].toUpperCase() + motor.why.slice(1) + ".";
  if (!motor.enabled) return "Disabled, still turning.";
  if (motor.setpoint === "power") return "Constant power.";
  if (motor.setpoint === "current") return `Constant current${motor.current_limited ? ", held by the current limit" : ""}.`;
  if (motor.setpoint === "identify") return "Identification runs.";
  if (!motor.regulator) return "";
  const regulator = motor.regulator === "model" ? "by the motor model" : "by PID";
  const limits = `${motor.derated ? "; derated: the winding is hot, and the current is limited" : ""}${motor.current_limited ? "; held by its current limit" : ""}`;
  return `Regulated ${regulator}${limits}${motor.settled ? "; settled" : ""}.`;
}

function show(/** @type {any} */ card, /** @type {any} */ motor) {
  const settings = state.settings[card.motor];
  follow(card, motor);
  setText(card.speed, speed(motor.velocity, settings));
  setText(card.speedUnit, speedUnit(settings));
  setText(card.position, number(motor.position));
  setText(card.current, motor.current_a === undefined ? "–" : number(motor.current_a, 2));
  card.run.setAttribute("aria-checked", String(motor.enabled));
  setText(card.run, motor.enabled ? "Running" : "Run");
  const regime = motor.enabled ? motor.regime : null;
  card.pill.className = `pill ${regime ?? ""}`;
  const [does, meaning] = bridge(motor);
  setText(card.pill, does);
  if (card.pill.title !== meaning) card.pill.title = meaning;
  const limited = card.limited && performance.now() < card.limited.until && !motor.fault && !motor.stalled;
  setText(card.why, limited ? card.limited.words : words(motor));
  card.why.classList.toggle("fault", Boolean(motor.fault || motor.stalled));
}

/** Shows that nothing is known of a motor, because its hub is not connected. */
function showUnknown(/** @type {any} */ card) {
  for (const value of [card.speed, card.position, card.current]) setText(value, "–");
  card.enabled = false;
  card.run.setAttribute("aria-checked", "false");
  setText(card.run, "Run");
  card.pill.className = "pill";
  card.pill.title = "";
  setText(card.pill, "Unknown");
  card.why.classList.remove("fault");
  setText(card.why, "Unknown: the hub is not connected.");
}

function allow() {
  const may = mayOrder();
  if (!may) cards.forEach(rest);
  for (const card of cards) for (const element of [card.run, card.mode, card.slider.input, card.number]) element.disabled = !may;
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
    setText(cards[motor].name, state.settings[motor]?.name ?? "");
    fit(cards[motor]);
  });
  on("unit", () => cards.forEach(fit));
  on("zeroed", (motor) => rest(cards[motor]));
  // After a STOP no value counts that was entered before.
  on("stopped", () => cards.forEach((card) => {
    rest(card);
    showTarget(card, true);
  }));
  // The server sends this message also when it shows another hub.
  on("line", () => cards.forEach(rest));
  for (const what of ["hubs", "line"]) on(what, () => cards.forEach((card) => setText(card.title, motorName(card.motor))));
  on("chosen", () => cards.forEach((card) => {
    card.element.classList.toggle("chosen", card.motor === state.chosen);
    card.choose.setAttribute("aria-pressed", String(card.motor === state.chosen));
  }));
  onControl(() => {
    if (!state.connected) cards.forEach(showUnknown);
    allow();
  });
  allow();
}
