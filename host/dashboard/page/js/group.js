// Panel for motors that are driven by a held button, or that move in step: to positions, or at speeds.

import { h } from "./dom.js";
import { jogForm } from "./jog.js";
import { inControl, on, state } from "./state.js";

/** @param {any} link */
export function groupPanel(link) {
  const places = [0, 1, 2, 3].map((motor) => h("input", { type: "number", step: 1, placeholder: "stays", "aria-label": `Move motor ${motor} by, counts` }));
  const speed = h("input", { type: "number", min: 1, value: 1000, step: 1, id: "group-speed" });
  const acceleration = h("input", { type: "number", min: 1, value: 2000, step: 1, id: "group-acceleration" });
  const go = h("button", { type: "button", class: "primary", onclick: () => {
    const to = places.map((field, motor) => (field.value === "" ? null : Math.round(Number(field.value) + (state.frame?.motors[motor]?.position ?? 0))));
    link.order("together", { to, speed: Math.round(Number(speed.value)), acceleration: Math.round(Number(acceleration.value)) });
  } }, "Move together");
  const speeds = [0, 1, 2, 3].map((motor) => h("input", { type: "number", step: 1, placeholder: "stays", "aria-label": `Turn motor ${motor} at, counts/s` }));
  const turn = h("button", { type: "button", class: "primary", onclick: () => {
    const at = speeds.map((field) => (field.value === "" ? null : Math.round(Number(field.value))));
    link.order("turn", { at, acceleration: Math.round(Number(acceleration.value)) });
  } }, "Turn together");
  function allow() {
    for (const element of [...places, ...speeds, turn, speed, acceleration, go]) element.disabled = !(inControl() && state.connected && state.reports);
  }
  for (const what of ["control", "open", "line"]) on(what, allow);
  return h("div", { class: "columns" },
    jogForm(link),
    h("div", { class: "stack" }, h("h3", {}, "Several motors in step"),
      h("div", { class: "grid4" }, h("span", {}), ...[0, 1, 2, 3].map((motor) => h("span", { class: "head" }, `motor ${motor}`)), h("span", {}, "Move by, counts"), ...places, h("span", {}, "Turn at, counts/s"), ...speeds),
      h("div", { class: "pair" }, h("label", { for: "group-speed" }, "Speed, counts/s"), speed, h("label", { for: "group-acceleration" }, "Acceleration, counts/s²"), acceleration),
      h("div", { class: "row" }, go, turn)),
    h("p", { class: "muted" }, "All motors travel in proportion and arrive at the same time. If a motor lags, the others wait for it. Motors that turn together keep their speeds in proportion until the next request. The speed applies to moves, the acceleration to both. Choose a motor above to see its motion in the plots."));
}
