// The hubs of a chain: one is shown in full, and the others with what their motors do. STOP stops the motors of all.

import { elementById, h } from "./dom.js";
import { inControl, on, onControl, state, emit } from "./state.js";

/** What a hub does, in words. */
function does(/** @type {any} */ { lost, running, fault }) {
  if (lost) return "does not answer";
  if (!running.length) return "no motor runs";
  const motors = `${running.length > 1 ? "motors" : "motor"} ${running.join(", ")}`;
  return fault ? `${motors}: fault` : `${motors} run${running.length > 1 ? "" : "s"}`;
}

/** @param {any} link */
export function startChain(link) {
  const bar = elementById("hubs");
  function show() {
    bar.hidden = state.hubs.length < 2;
    bar.replaceChildren(...state.hubs.map((hub, index) => h("button", {
      type: "button", "aria-pressed": String(hub.shown), disabled: !inControl(), class: hub.lost || hub.fault ? "fault" : false,
      onclick: () => {
        emit("leave");
        link.order("hub", { address: hub.address });
      },
    }, `Hub ${hub.address}${index ? "" : ", parent"}`, h("small", {}, does(hub)))));
  }
  on("hubs", show);
  onControl(show);
}
