// Panel for motors that move in step.

import { h } from "./dom.js";
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
  function allow() {
    for (const element of [...places, speed, acceleration, go]) element.disabled = !(inControl() && state.connected && state.reports);
  }
  for (const what of ["control", "open", "line"]) on(what, allow);
  return h("div", { class: "columns" },
    h("div", { class: "stack" },
      h("div", { class: "grid4" }, h("span", {}), ...[0, 1, 2, 3].map((motor) => h("span", { class: "head" }, `motor ${motor}`)), h("span", {}, "Move by, counts"), ...places),
      h("div", { class: "pair" }, h("label", { for: "group-speed" }, "Speed, counts/s"), speed, h("label", { for: "group-acceleration" }, "Acceleration, counts/s²"), acceleration),
      h("div", { class: "row" }, go)),
    h("p", { class: "muted" }, "All motors travel in proportion and arrive at the same time. If a motor lags, the others wait for it. Choose a motor above to see its motion in the plots."));
}
