// Panel for tuning: coefficients, regulator, and a step response, plotted over the step before.

import { h, numberIn, numberOrNull, setText } from "./dom.js";
import { limited, scale } from "./motors.js";
import { SmallPlot } from "./small.js";
import { inControl, mayOrder, on, onControl, state } from "./state.js";
import { fromCps, number, speed, speedUnit } from "./units.js";

/** Time for which a step is recorded, in seconds. */
const WATCHED_S = 2;
/** Longest wait for the speed from which a step begins, in seconds. */
const REACHED_S = 6;
/** Time for which the motor must have the first speed before the step begins, in seconds. */
const HELD_S = 0.2;
/** Largest error of the first speed: in counts/s, and as a share of the first speed. */
const [NEAR_CPS, NEAR] = [10, 0.05];
/** Largest error of a settled motor, as a share of the step. */
const SETTLED = 0.05;

/** Characteristics of a step response: `times` in seconds since the step, `speeds` in counts/s. */
function judge(/** @type {number[]} */ times, /** @type {number[]} */ speeds, /** @type {number} */ from, /** @type {number} */ to) {
  const size = to - from;
  const share = speeds.map((speed) => (speed - from) / size);
  const reached = times[share.findIndex((part) => part >= 0.9)];
  const overshoot = Math.max(0, ...share) - 1;
  let settled = NaN;
  for (let i = share.length - 1; i >= 0 && Math.abs(share[i] - 1) <= SETTLED; i -= 1) settled = times[i];
  const end = share.slice(-25);
  const error = (end.reduce((sum, part) => sum + part, 0) / Math.max(1, end.length) - 1) * size;
  return { reached, settled, overshoot: Math.max(0, overshoot), error };
}

/** @param {any} link */
export function tunePanel(link) {
  const order = (/** @type {string} */ name, /** @type {any} */ fields = {}) => link.order(name, { motor: state.chosen, ...fields });
  const fields = Object.fromEntries(["velocity", "position"].map((of) => [of, ["P", "I", "D", "F"].map((letter) => h("input", { type: "number", step: "any", "aria-label": `${letter} of the ${of} loop` }))]));
  const regulator = h("b", {}, "–");
  const model = h("span", { class: "muted" });
  const undo = h("button", { type: "button", onclick: () => order("undo") }, "Undo");
  const byModel = h("button", { type: "button", onclick: () => order("regulator", { kind: "model" }) }, "By the model");
  const byPid = h("button", { type: "button", onclick: () => order("regulator", { kind: "pid" }) }, "By PID");
  const limit = h("input", { type: "number", min: 1, step: 1, placeholder: "none", "aria-label": "Largest acceleration, counts/s²" });
  const setLimit = h("button", { type: "button", onclick: () => order("acceleration", { limit: numberOrNull(limit) }) }, "Set");
  const apply = ["velocity", "position"].map((of) => h("button", { type: "button", "aria-label": `Set the ${of} loop`, onclick: () => order("coefficients", { of, pidf: fields[of].map(numberIn) }) }, "Set"));
  const rows = ["velocity", "position"].flatMap((of, index) => [h("span", {}, of), ...fields[of], apply[index]]);

  /** Speeds of the step in counts/s, and their fields. */
  const ends = [0, 800];
  const endFields = ["Step from", "Step to"].map((label, index) => h("input", { type: "number", "aria-label": label, onchange: () => {
    try {
      const of = scale("velocity", state.settings[state.chosen]);
      const { value, words } = limited(of, numberIn(endFields[index]));
      ends[index] = of.meant(value);
      setText(says, words ?? "");
    } finally {
      showEnds();
    }
  } }));
  const [from, to] = endFields;
  const unit = h("span", { class: "muted" }, "counts/s");
  const begin = h("button", { type: "button", class: "primary", onclick: () => step() }, "Run step");
  const says = h("p", { class: "muted", role: "status" });
  const plot = new SmallPlot("Step", [
    { words: "set-point", colour: "target", dash: [7, 5] },
    { words: "before", colour: "muted", dash: [2, 3] },
    { words: "now", colour: "speed" }], 130);
  const results = h("tbody", {});
  const errorUnit = h("span", {}, "End error");
  /** @type {any} */
  let running = null;
  /** @type {any[]} */
  let runs = [];

  function step() {
    const [low, high] = ends;
    if (low === high) return setText(says, "Enter two different speeds for a step.");
    const now = state.frame?.at_s ?? 0;
    running = { motor: state.chosen, low, high, phase: "rest", begun: now, enabled: false, near: null };
    order("drive", { mode: "velocity", value: low, enable: true });
    setText(says, "Reaching the first speed …");
  }

  /** Ends a step, with its motor disabled. */
  function end(/** @type {string} */ words) {
    order("enable", { motor: running.motor, on: false });
    running = null;
    setText(says, words);
  }

  function finish() {
    runs = [...runs, { ...running, ...judge(running.times, running.speeds, running.low, running.high) }].slice(-2);
    end("Done.");
    lay();
  }

  /** Waits until the motor has the speed from which the step begins. */
  function reach(/** @type {number} */ now, /** @type {number} */ velocity) {
    const { motor, low, high } = running;
    const settings = state.settings[motor];
    if (!running.enabled || Math.abs(velocity - low) > Math.max(NEAR_CPS, NEAR * Math.abs(low))) running.near = null;
    else running.near ??= now;
    if (running.near !== null && now - running.near >= HELD_S) {
      Object.assign(running, { phase: "step", start: now, times: [0], speeds: [velocity] });
      link.order("drive", { motor, mode: "velocity", value: high });
      setText(says, "Recording the step …");
    } else if (now - running.begun > REACHED_S) {
      end(`The motor did not reach ${speed(low, settings)} ${speedUnit(settings)} within ${REACHED_S} s: its speed is ${speed(velocity, settings)} ${speedUnit(settings)}.`);
    }
  }

  /** Shows the last two runs, one over the other. */
  function lay() {
    const settings = state.settings[state.chosen];
    const now = runs.at(-1);
    if (!now) return;
    const before = runs.length > 1 ? runs[0] : null;
    const other = before ? now.times.map((/** @type {number} */ time) => {
      const at = before.times.findIndex((/** @type {number} */ then) => then >= time);
      return at < 0 ? null : fromCps(before.speeds[at], settings);
    }) : now.times.map(() => null);
    plot.show([now.times, now.times.map(() => fromCps(now.high, settings)), other, now.speeds.map((/** @type {number} */ speed) => fromCps(speed, settings))]);
    results.replaceChildren(...[["before", before], ["now", now]].filter(([, run]) => run).map(([name, run]) => h("tr", {}, h("th", {}, name), h("td", { class: "n" }, `${number(run.reached, 2)} s`), h("td", { class: "n" }, `${number(100 * run.overshoot, 1)} %`), h("td", { class: "n" }, `${number(run.settled, 2)} s`), h("td", { class: "n" }, number(fromCps(run.error, settings), 1)))));
  }

  // Another hub is chosen: the motor of the step is switched off before that hub is shown.
  on("leave", () => { if (running) end("Another hub was chosen: the motor is off, and this step is discarded."); });
  // The server sends a message about the line only when the hub is lost, is found again, or is another one.
  on("line", () => {
    if (!running) return;
    running = null;
    setText(says, "The hub was lost, or another one is shown: this step is discarded.");
  });
  // An answer does not name its order. While a step runs, a refusal is taken for one of the step.
  on("refused", ({ why }) => {
    if (!running) return;
    end(`Refused: ${why}.`);
  });

  on("frame", (frame) => {
    const motor = frame.motors[state.chosen];
    if (motor) setText(regulator, motor.regulator === "model" ? "the motor model" : motor.regulator === "PID" ? "PID" : "not reported");
    if (!running) return;
    const { enabled, velocity } = frame.motors[running.motor];
    // The first frames may be older than the order that enables the motor.
    if (running.enabled && !enabled) {
      running = null;
      return setText(says, "The motor was disabled; this step is discarded.");
    }
    running.enabled = enabled;
    if (running.phase === "rest") {
      reach(frame.at_s, velocity);
    } else {
      running.times.push(frame.at_s - running.start);
      running.speeds.push(velocity);
      if (frame.at_s - running.start > WATCHED_S) finish();
    }
  });

  function showEnds() {
    const of = scale("velocity", state.settings[state.chosen]);
    endFields.forEach((field, index) => { field.value = String(Number(of.shown(ends[index]).toFixed(of.digits))); });
    setText(unit, of.unit);
    setText(errorUnit, `End error, ${of.unit}`);
  }

  function fill() {
    const settings = state.settings[state.chosen];
    allow();
    setText(undo, settings?.undoable ? `Undo (${settings.undoable})` : "Undo");
    for (const of of ["velocity", "position"]) fields[of].forEach((/** @type {any} */ field, /** @type {number} */ i) => { if (document.activeElement !== field && settings) field.value = String(+settings[of][i].toFixed(4)); });
    limit.value = settings?.acceleration ?? "";
    const known = settings?.dynamics;
    setText(model, known ? `Dynamics: ${number(known.gain)} counts/s² per volt, decay ${number(known.decay, 2)} /s, friction ${number(known.friction_v, 2)} V` : "Dynamics are not configured: the motor model learns the acceleration per volt. Identify measures all three.");
  }
  function allow() {
    const may = mayOrder();
    for (const element of [byModel, byPid, setLimit, begin, limit, ...apply, ...fields.velocity, ...fields.position, ...endFields]) element.disabled = !may;
    undo.disabled = !inControl() || !state.settings[state.chosen]?.undoable;
  }
  on("settings", ({ motor }) => { if (motor === state.chosen) fill(); });
  on("chosen", fill);
  for (const what of ["settings", "chosen"]) on(what, () => {
    const of = scale("velocity", state.settings[state.chosen]);
    ends.forEach((cps, index) => { ends[index] = of.meant(limited(of, of.shown(cps)).value); });
    showEnds();
  });
  on("unit", () => { showEnds(); lay(); });
  on("chosen", () => { runs = []; results.replaceChildren(); plot.show([[0, WATCHED_S], [null, null], [null, null], [null, null]]); });
  onControl(allow);

  return h("div", { class: "columns" },
    h("div", { class: "stack" },
      h("p", {}, "Regulated by ", regulator, ". ", model),
      h("div", { class: "row" }, byModel, byPid, undo),
      h("div", { class: "loops" }, h("span", {}), ...["P", "I", "D", "F"].map((letter) => h("span", { class: "head" }, letter)), h("span", {}), ...rows),
      h("div", { class: "pair" }, h("span", {}, "Largest acceleration, counts/s²"), h("div", { class: "slider" }, limit, setLimit))),
    h("div", { class: "stack" },
      h("div", { class: "row step" }, h("label", { class: "field" }, "From", from), h("label", { class: "field" }, "to", to), unit, begin),
      says, plot.element,
      h("table", {}, h("thead", {}, h("tr", {}, h("td", {}), ...["Rise time (90 %)", "Overshoot", "Settled", errorUnit].map((words) => h("th", { class: "n" }, words)))), results)));
}
