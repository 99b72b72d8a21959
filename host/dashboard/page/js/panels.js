// Tabs below the plots. All panels are built at the start and only hidden, so that typed values are kept.

import { by, h } from "./dom.js";
import { groupPanel } from "./group.js";
import { learnPanel } from "./learn.js";
import { recordPanel } from "./record.js";
import { setupPanel } from "./setup.js";
import { state, on } from "./state.js";
import { tunePanel } from "./tune.js";
import { worldPanel } from "./world.js";

/** @param {any} link */
export function startPanels(link) {
  const panels = [
    ["tune", "Tune", tunePanel(link)],
    ["learn", "Identify", learnPanel(link)],
    ["setup", "Motor and scheme", setupPanel(link)],
    ["group", "In step", groupPanel(link)],
    ["record", "Record", recordPanel()],
    ["world", "Simulated world", worldPanel(link)],
  ];
  const buttons = panels.map(([name, words, panel]) => {
    const element = h("div", { role: "tabpanel", id: `panel-${name}`, "aria-labelledby": `tab-${name}` }, panel);
    by("panel").append(element);
    return h("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}`, onclick: () => open(name) }, words);
  });
  by("tabs").append(...buttons);
  function open(/** @type {string} */ chosen) {
    panels.forEach(([name], index) => {
      const is = name === chosen;
      buttons[index].setAttribute("aria-selected", String(is));
      buttons[index].tabIndex = is ? 0 : -1;
      by(`panel-${name}`).hidden = !is;
    });
  }
  // Arrow keys choose the next tab, as usual for tab lists.
  by("tabs").addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const seen = buttons.filter((button) => !button.hidden);
    const next = seen[(seen.indexOf(/** @type {any} */ (document.activeElement)) + step + seen.length) % seen.length];
    next.focus();
    next.click();
  });
  open("tune");
  on("welcome", () => {
    by("tab-world").hidden = !state.simulated;
    if (state.simulated) open("world");
  });
}
