// Panel for tuning: coefficients, regulator, and a step response, plotted over the step before.

import { h, say } from "./dom.js";
import { SmallPlot } from "./small.js";
import { inControl, on, state } from "./state.js";
import { number, speedUnit, toCps, fromCps } from "./units.js";

/** Time for which a step is recorded, in seconds. */
const WATCHED_S = 2;
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
  const setLimit = h("button", { type: "button", onclick: () => order("acceleration", { limit: limit.value ? Number(limit.value) : null }) }, "Set");
  const apply = ["velocity", "position"].map((of) => h("button", { type: "button", "aria-label": `Set the ${of} loop`, onclick: () => order("coefficients", { of, pidf: fields[of].map((/** @type {any} */ field) => Number(field.value) || 0) }) }, "Set"));
  const rows = ["velocity", "position"].flatMap((of, index) => [h("span", {}, of), ...fields[of], apply[index]]);

  const from = h("input", { type: "number", value: 0, "aria-label": "Step from" });
  const to = h("input", { type: "number", value: 800, "aria-label": "Step to" });
  const unit = h("span", { class: "muted" }, "counts/s");
  const begin = h("button", { type: "button", class: "primary", onclick: () => step() }, "Run step");
  const says = h("p", { class: "muted", role: "status" });
  const plot = new SmallPlot("Step", [
    { words: "set-point", colour: "target", dash: [7, 5] },
    { words: "before", colour: "muted", dash: [2, 3] },
    { words: "now", colour: "speed" }], 130);
  const results = h("tbody", {});
  /** @type {any} */
  let running = null;
  /** @type {any[]} */
  let runs = [];

  function step() {
    const settings = state.settings[state.chosen];
    const [low, high] = [from, to].map((field) => toCps(Number(field.value) || 0, settings));
    if (low === high) return say(says, "Enter two different speeds for a step.");
    running = { motor: state.chosen, low, high, phase: "rest", until: state.frame.at_s + 1.2, times: [], speeds: [] };
    order("drive", { mode: "velocity", value: low });
    order("enable", { on: true });
    say(says, "Reaching the first speed …");
  }

  function finish() {
    order("enable", { motor: running.motor, on: false });
    runs = [...runs, { ...running, ...judge(running.times, running.speeds, running.low, running.high) }].slice(-2);
    running = null;
    say(says, "Done.");
    lay();
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
    results.replaceChildren(...[["before", before], ["now", now]].filter(([, run]) => run).map(([name, run]) => h("tr", {}, h("th", {}, name), h("td", { class: "n" }, `${number(run.reached, 2)} s`), h("td", { class: "n" }, `${number(100 * run.overshoot, 1)} %`), h("td", { class: "n" }, `${number(run.settled, 2)} s`), h("td", { class: "n" }, number(run.error, 1)))));
  }

  // An answer does not name its order. While a step runs, a refusal is taken for one of the step.
  on("refused", ({ why }) => {
    if (!running) return;
    order("enable", { motor: running.motor, on: false });
    running = null;
    say(says, `Refused: ${why}.`);
  });

  on("frame", (frame) => {
    const motor = frame.motors[state.chosen];
    if (motor) say(regulator, motor.regulator === "model" ? "the motor model" : motor.regulator === "pid" ? "PID" : "not reported");
    if (!running) return;
    if (!frame.motors[running.motor]?.enabled && frame.at_s > running.until - 0.9) {
      running = null;
      return say(says, "The motor was disabled; this step is discarded.");
    }
    if (running.phase === "rest" && frame.at_s > running.until) {
      running.phase = "step";
      running.start = frame.at_s;
      link.order("drive", { motor: running.motor, mode: "velocity", value: running.high });
      say(says, "Recording the step …");
    } else if (running.phase === "step") {
      running.times.push(frame.at_s - running.start);
      running.speeds.push(frame.motors[running.motor].velocity);
      if (frame.at_s - running.start > WATCHED_S) finish();
    }
  });

  function fill() {
    const settings = state.settings[state.chosen];
    undo.disabled = !inControl() || !settings?.undoable;
    say(undo, settings?.undoable ? `Undo (${settings.undoable})` : "Undo");
    for (const of of ["velocity", "position"]) fields[of].forEach((/** @type {any} */ field, /** @type {number} */ i) => { if (document.activeElement !== field && settings) field.value = String(+settings[of][i].toFixed(4)); });
    limit.value = settings?.acceleration ?? "";
    say(unit, speedUnit(settings));
    const known = settings?.dynamics;
    say(model, known ? `Dynamics: ${number(known.gain)} counts/s² per volt, decay ${number(known.decay, 2)} /s, friction ${number(known.friction_v, 2)} V` : "Dynamics are not configured: the motor model learns the acceleration per volt. Identify measures all three.");
  }
  function allow() {
    const may = inControl() && state.connected;
    for (const element of [byModel, byPid, setLimit, begin, limit, ...apply]) element.disabled = !may;
    fill();
  }
  for (const what of ["settings", "chosen", "unit"]) on(what, fill);
  on("chosen", () => { runs = []; results.replaceChildren(); plot.show([[0, WATCHED_S], [null, null], [null, null], [null, null]]); });
  for (const what of ["control", "open", "line"]) on(what, allow);

  return h("div", { class: "columns" },
    h("div", { class: "stack" },
      h("p", {}, "Regulated by ", regulator, ". ", model),
      h("div", { class: "row" }, byModel, byPid, undo),
      h("div", { class: "loops" }, h("span", {}), ...["P", "I", "D", "F"].map((letter) => h("span", { class: "head" }, letter)), h("span", {}), ...rows),
      h("div", { class: "pair" }, h("span", {}, "Largest acceleration, counts/s²"), h("div", { class: "slider" }, limit, setLimit))),
    h("div", { class: "stack" },
      h("div", { class: "row step" }, h("label", { class: "field" }, "From", from), h("label", { class: "field" }, "to", to), unit, begin),
      says, plot.element,
      h("table", {}, h("thead", {}, h("tr", {}, h("td", {}), ...["Rise time (90 %)", "Overshoot", "Settled", "End error, counts/s"].map((words) => h("th", { class: "n" }, words)))), results)));
}
