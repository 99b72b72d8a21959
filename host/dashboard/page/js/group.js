// Panel for motors that are driven by a held button, or that move in step to positions or at speeds. The panel also
// sets the speed limits, the tolerance and the behaviour at zero for the set-points of the cards.

import { h, numberIn, numberOrNull, part } from "./dom.js";
import { jogForm } from "./jog.js";
import { select } from "./list.js";
import { motion } from "./motors.js";
import { mayOrder, onControl, state } from "./state.js";

/** @param {any} link */
export function groupPanel(link) {
  const places = [0, 1, 2, 3].map((motor) => h("input", { type: "number", step: 1, placeholder: "stays", "aria-label": `Move motor ${motor} by, counts` }));
  const speed = h("input", { type: "number", min: 1, value: 1000, step: 1, id: "group-speed" });
  const acceleration = h("input", { type: "number", min: 1, value: 2000, step: 1, id: "group-acceleration" });
  const go = h("button", { type: "button", class: "primary", onclick: () => {
    link.order("together", { by: places.map(numberOrNull), speed: numberIn(speed), acceleration: numberIn(acceleration) });
  } }, "Move together");
  const speeds = [0, 1, 2, 3].map((motor) => h("input", { type: "number", step: 1, placeholder: "stays", "aria-label": `Turn motor ${motor} at, counts/s` }));
  const turn = h("button", { type: "button", class: "primary", onclick: () => {
    link.order("turn", { at: speeds.map(numberOrNull), acceleration: numberIn(acceleration) });
  } }, "Turn together");
  function allow() {
    for (const element of [...places, ...speeds, turn, speed, acceleration, go]) element.disabled = !(mayOrder() && state.reports);
  }
  onControl(allow);
  return h("div", { class: "parts" },
    part("move", "Drive while a button is held", true, jogForm(link)),
    part("move", "Several motors in step", false,
      h("div", { class: "grid4" }, h("span", {}), ...[0, 1, 2, 3].map((motor) => h("span", { class: "head" }, `motor ${motor}`)), h("span", {}, "Move by, counts"), ...places, h("span", {}, "Turn at, counts/s"), ...speeds),
      h("div", { class: "pair" }, h("label", { for: "group-speed" }, "Speed, counts/s"), speed, h("label", { for: "group-acceleration" }, "Acceleration, counts/s²"), acceleration),
      h("div", { class: "row" }, go, turn),
      h("p", { class: "muted" }, "The motors travel in proportion and arrive at the same time; if one lags, the others wait. The speed is for moves, the acceleration for both.")),
    part("move", "Limits of set-points", false, ...limits()));
}

/** Fields for speed limits, tolerance and behaviour at zero of the set-points. An entered number is kept within its range. */
function limits() {
  const zero = select([["brake", "brakes"], ["float", "coasts"]], { id: "motion-zero", onchange: () => { motion.zero = zero.value; } });
  const field = (/** @type {"speed"|"tolerance"|"current"} */ name, /** @type {string} */ words, /** @type {number} */ most, /** @type {string} */ empty) => {
    const input = h("input", { type: "number", id: `motion-${name}`, min: 1, max: most, step: 1, placeholder: empty, value: motion[name], onchange: () => {
      try {
        const given = numberOrNull(input);
        motion[name] = given === null ? null : Math.max(1, Math.min(most, Math.round(given)));
      } finally {
        input.value = motion[name] ?? "";
      }
    } });
    return [h("label", { for: input.id }, words), input];
  };
  return [
    h("div", { class: "pair" }, h("label", { for: "motion-zero" }, "At power or speed 0 a motor"), zero,
      ...field("speed", "Speed to a position, counts/s", 32767, "1000"), ...field("tolerance", "Tolerance of a position, counts", 65535, "10"), ...field("current", "Speed limit of a constant current, counts/s", 32767, "no limit")),
    h("p", { class: "muted" }, "These values apply to all motors, from the next set-point on."),
  ];
}
