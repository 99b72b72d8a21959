// The tabs and their panels. All panels are built at the start and only hidden, so that typed values are kept.

import { elementById, h } from "./dom.js";
import { devicesPanel } from "./devices.js";
import { groupPanel } from "./group.js";
import { hubPanel } from "./hub.js";
import { learnPanel } from "./learn.js";
import { recordPanel } from "./record.js";
import { regimesPanel } from "./regimes.js";
import { setupPanel } from "./setup.js";
import { store, stored, on, state, emit } from "./state.js";
import { tunePanel } from "./tune.js";
import { worldPanel } from "./world.js";

/** @param {any} link */
export function startPanels(link) {
  const panels = [
    ["tune", "Tune", tunePanel(link)],
    ["learn", "Identify", learnPanel(link)],
    ["setup", "Set up", setupPanel(link)],
    ["group", "Move", groupPanel(link)],
    ["record", "Record", recordPanel()],
    ["regimes", "S T Z G", regimesPanel(link)],
    ["devices", "Devices", devicesPanel(link)],
    ["hub", "Hub", hubPanel(link)],
    ["world", "Simulate", worldPanel(link)],
  ];
  const buttons = panels.map(([name, words, panel]) => {
    const element = h("div", { role: "tabpanel", id: `panel-${name}`, "aria-labelledby": `tab-${name}` }, panel);
    elementById("panel").append(element);
    return h("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}`, onclick: () => { open(name); store("tab", name); } }, words);
  });
  elementById("tabs").append(...buttons);
  function open(/** @type {string} */ chosen) {
    panels.forEach(([name], index) => {
      const is = name === chosen;
      buttons[index].setAttribute("aria-selected", String(is));
      buttons[index].tabIndex = is ? 0 : -1;
      elementById(`panel-${name}`).hidden = !is;
    });
    emit("tab");
  }
  // Arrow keys choose the next tab, as usual for tab lists.
  elementById("tabs").addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const seen = buttons.filter((button) => !button.hidden);
    const next = seen[(seen.indexOf(/** @type {any} */ (document.activeElement)) + step + seen.length) % seen.length];
    next.focus();
    next.click();
  });
  open("tune");
  /** Leaves a panel whose tab is hidden. */
  function leave(/** @type {string} */ name) {
    if (elementById(`tab-${name}`).hidden && !elementById(`panel-${name}`).hidden) open("tune");
  }
  // Only motors and battery of the first hub are simulated by orders of a page.
  on("hubs", ({ hubs }) => {
    elementById("tab-world").hidden = !(state.simulated && hubs[0].shown);
    leave("world");
  });
  // A hub without devices may take the place of one that has some.
  on("line", () => { if (state.connected) leave("devices"); });
  let first = true;
  on("welcome", () => {
    elementById("tab-world").hidden = !state.simulated;
    // A socket that connects again leaves the tab as it is.
    if (!first) return;
    first = false;
    const usual = state.simulated ? "world" : "tune";
    const last = stored("tab", usual);
    open(panels.some(([name]) => name === last) && !elementById(`tab-${last}`).hidden ? last : usual);
  });
}
