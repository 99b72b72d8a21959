// Panel for identification: the hub moves the motor for some seconds and measures how it responds to a voltage. The speed
// predicted by the result is plotted over the measured speed.

import { h, numberOrNull, setText } from "./dom.js";
import { SmallPlot } from "./small.js";
import { inControl, mayOrder, on, onControl, state } from "./state.js";
import { number } from "./units.js";

/**
 * Speeds in counts/s that the identified dynamics predict for the applied voltages.
 * @param {{at: number, cps: number, volts: number}[]} seen @param {{gain: number, decay: number, friction_v: number}} found
 */
export function predict(seen, found) {
  let cps = seen[0]?.cps ?? 0;
  return seen.map((now, i) => {
    if (i > 0) {
      const before = seen[i - 1];
      const steps = 10;
      const dt = (now.at - before.at) / steps;
      for (let k = 0; k < steps; k += 1) {
        const drive = found.gain * before.volts;
        const friction = found.gain * found.friction_v;
        // At rest friction cancels a smaller drive.
        const acceleration = Math.abs(cps) < 1 && Math.abs(drive) < friction ? -cps / dt : drive - found.decay * cps - Math.sign(cps || drive) * friction;
        cps += dt * acceleration;
      }
    }
    return cps;
  });
}

/** RMS error of the predicted speeds, as a share of the measured speeds; for tests. */
export const learned = { misfit: NaN };

/** @param {number[]} measured @param {number[]} predicted */
function misfit(measured, predicted) {
  const sum = (/** @type {(i: number) => number} */ of) => measured.reduce((all, _, i) => all + of(i) ** 2, 0);
  return Math.sqrt(sum((i) => predicted[i] - measured[i]) / sum((i) => measured[i]));
}

/** @param {any} link */
export function learnPanel(link) {
  const travel = h("input", { type: "number", min: 1, step: 1, placeholder: "no limit", "aria-label": "Longest travel either way, counts" });
  const begin = h("button", { type: "button", class: "primary", onclick: () => start() }, "Identify");
  const apply = h("button", { type: "button", onclick: () => link.order("apply", { motor: state.chosen }) }, "Use these values");
  const progress = h("progress", { max: 100, value: 0, "aria-label": "Progress of the identification" });
  const says = h("p", { role: "status" }, "The motor turns both ways for some 3 s. It must stand before, and be free to turn.");
  const found = h("tbody", {});
  const about = h("p", { class: "muted", id: "learn-about" });
  const plot = new SmallPlot("Measured and predicted, counts/s", [{ words: "measured", colour: "speed" }, { words: "predicted by the result", colour: "target", dash: [7, 5] }], 140);
  /** @type {{at: number, cps: number, volts: number}[]} */
  let seen = [];
  let motor = -1;
  let [tick, volts] = [-1, 0];
  /** @type {any[]} by motor */
  const last = [];

  function start() {
    const most = numberOrNull(travel);
    [motor, seen] = [state.chosen, []];
    last[motor] = null;
    link.order("identify", { motor, travel: most });
    progress.value = 0;
    setText(says, "Waiting until the motor stands …");
    show();
  }

  on("frame", (frame) => {
    const of = frame.motors[motor];
    const settings = state.settings[motor];
    if (!of || of.setpoint !== "identify" || !settings || of.modelled_a === undefined) return;
    // Motor voltage by the hub's configured constants and the current; the drop across the bridge is small and left out. The
    // voltage is constant between control ticks.
    if (frame.tick_ms !== tick) volts = (settings.emf_mv_s_per_count * of.velocity) / 1000 + (settings.resistance_ohm ?? 0) * of.modelled_a;
    tick = frame.tick_ms;
    seen.push({ at: frame.at_s, cps: of.velocity, volts });
  });

  on("identification", (message) => {
    if (message.state === "running") {
      progress.value = message.percent;
      if (message.motor === motor) setText(says, `Moving: ${message.percent} %`);
      return;
    }
    progress.value = message.state === "found" ? 100 : 0;
    last[message.motor] = { ...message, seen: message.motor === motor ? seen : [] };
    motor = -1;
    show();
  });
  /** The identification of this page has ended without a result. */
  function stopped(/** @type {string} */ words) {
    if (motor < 0) return;
    motor = -1;
    progress.value = 0;
    setText(says, words);
  }
  on("stopped", () => stopped("The identification was stopped."));
  // The server sends a message about the line only when the hub is lost, is found again, or is another one.
  for (const what of ["line", "open"]) on(what, () => stopped("The connection was lost: the identification was stopped."));

  function show() {
    const of = last[state.chosen];
    const is = of?.found;
    apply.disabled = !inControl() || !is;
    found.replaceChildren();
    setText(about, "");
    if (of) setText(says, is ? `Motor ${of.motor} is identified.` : `Motor ${of.motor} is not identified: ${of.why}.`);
    if (!is) return plot.show([[0, 3], [null, null], [null, null]]);
    const bare = is.catalogue;
    const rows = [
      ["", "found", "error", bare?.name ?? ""],
      ["counts/s² per V", number(is.gain), `± ${number(100 * is.gain_error, 1)} %`, bare ? number(bare.gain) : ""],
      ["decay, 1/s", number(is.decay, 2), `± ${number(100 * is.decay_error, 1)} %`, bare ? number(bare.decay, 2) : ""],
      ["EMF, mV s/count", number(is.emf_mv_s_per_count, 3), "", bare ? number((1000 * bare.decay) / bare.gain, 3) : ""],
      ["friction, V", number(is.friction_v, 2), "", bare ? number(bare.friction_v, 2) : ""],
    ];
    found.append(...rows.map(([name, ...cells]) => h("tr", {}, h("th", {}, name), ...cells.map((cell) => h("td", { class: "n" }, cell)))));
    const limit = is.acceleration.map((/** @type {number|null} */ cps2) => (cps2 === null ? "none" : `${number(cps2)} counts/s²`));
    setText(about, `${bare ? `With its load the motor has ${number(bare.inertia_ratio, 2)} times the inertia of a bare ${bare.name}` : "The catalogue has no motor with the configured constants"}. ${number(100 * is.residual, 1)} % of the changes of speed are not explained. Use these values also limits the acceleration: now ${limit[0]}, proposed ${limit[1]}.`);
    const start = of.seen[0]?.at ?? 0;
    const measured = of.seen.map((/** @type {any} */ one) => one.cps);
    const predicted = predict(of.seen, is);
    learned.misfit = misfit(measured, predicted);
    plot.show([of.seen.map((/** @type {any} */ one) => one.at - start), measured, predicted]);
  }

  function allow() {
    begin.disabled = travel.disabled = !(mayOrder() && state.reports);
    show();
  }
  onControl(allow);
  on("chosen", show);
  return h("div", { class: "columns" },
    h("div", { class: "stack" }, says, h("div", { class: "pair" }, h("span", {}, "Longest travel, counts"), travel), h("div", { class: "row" }, begin, apply), progress, h("table", {}, found), about),
    plot.element);
}
