// Panel for the hub: what it is, its settings, its firmware, its faults and what they mean, and the keys of this page.

import { chooser, download, elementById, h, hexOf, numberIn, part, setText } from "./dom.js";
import { firmwareForm } from "./firmware.js";
import { mayOrder, on, onControl, state } from "./state.js";
import { number } from "./units.js";

const KEYS = [
  ["Esc", "stops all motors, everywhere on the page"],
  ["Space", "stops all motors, outside of input fields"],
  ["0 to 3", "choose a motor"],
  ["Enter", "in a field: sends its value"],
  ["Enter", "held on Backward or Forward: drives"],
  ["← →", "on a slider: change the set-point; on the tabs: the next panel"],
  ["Gamepad", "while A is held, the left stick drives the chosen motor"],
];

/** @param {any} link */
export function hubPanel(link) {
  const faults = h("div", { class: "stack", role: "status", id: "hub-faults" });
  const look = h("button", { type: "button", onclick: () => link.order("faults") }, "Show faults");
  const save = h("button", { type: "button", id: "hub-save", onclick: () => link.order("save") }, "Save settings");
  const clear = h("button", { type: "button", onclick: () => { link.order("clear-faults"); link.order("faults"); } }, "Clear");
  const about = h("tbody", {});
  const address = h("input", { type: "number", id: "hub-address", min: 1, max: 254, step: 1 });
  const setAddress = h("button", { type: "button", onclick: () => link.order("address", { new: Math.round(numberIn(address)) }) }, "Set");
  const lamp = h("input", { type: "color", id: "hub-lamp", onchange: () => link.order("led", { colour: [1, 3, 5].map((at) => parseInt(lamp.value.slice(at, at + 2), 16)) }) });
  const fetchStored = h("button", { type: "button", id: "hub-load", onclick: () => link.order("load") }, "Load saved");
  const reset = h("button", { type: "button", id: "hub-reset", onclick: () => link.order("reset") }, "Reset to defaults");
  const take = h("button", { type: "button", onclick: () => link.order("export") }, "Export to a file");
  const [give, file] = chooser("Import a file", "settings-file", async (chosen) => link.order("import", { text: await chosen.text() }), ".toml,text/plain");

  const ask = () => { if (state.open && state.connected && !elementById("panel-hub").hidden) link.order("status"); };
  on("status", ({ address: hub, version, led, stored, differs }) => {
    const rows = [["version", version], ["address", String(hub)], ["saved settings", stored === null ? "this hub saves none" : `${stored}${differs ? "; they differ from the settings in force" : ""}`]];
    about.replaceChildren(...rows.map(([name, value]) => h("tr", {}, h("th", {}, name), h("td", {}, value))));
    if (document.activeElement !== address) address.value = String(hub);
    if (document.activeElement !== lamp) lamp.value = `#${hexOf(led)}`;
  });
  for (const what of ["tab", "line", "settings", "notice"]) on(what, ask);

  on("faults", ({ entries }) => {
    faults.replaceChildren(...entries.map((/** @type {any} */ of) => h("details", {},
      h("summary", {}, h("b", {}, `${of.fault} ${of.name}`), `${of.motor === null ? "" : `, motor ${of.motor}`}, ${number(of.after_s, 1)} s after the start of run ${of.run}${of.times > 1 ? `, ${of.times} times` : ""}`),
      ...of.explanation.map((/** @type {string} */ words) => h("p", {}, words)))));
    if (!entries.length) setText(faults, "No faults or resets are recorded.");
  });
  on("file", ({ name, text }) => download(new Blob([text], { type: "text/plain" }), name));
  function allow() {
    for (const button of [look, take]) button.disabled = !(state.open && state.connected && state.reports);
    give.disabled = !(mayOrder() && state.reports);
    for (const element of [lamp, address, setAddress]) element.disabled = !mayOrder();
    clear.disabled = give.disabled;
    for (const button of [save, fetchStored, reset]) button.disabled = give.disabled || !state.stores;
  }
  onControl(allow);
  return h("div", { class: "parts" },
    part("hub", "This hub", true,
      h("table", {}, about),
      h("div", { class: "pair" }, h("label", { for: "hub-lamp" }, "Colour of the lamp"), lamp, h("label", { for: "hub-address" }, "Address, 1 to 254"), h("div", { class: "slider" }, address, setAddress)),
      h("p", { class: "muted" }, "A notice says how long the hub keeps a new address.")),
    part("hub", "Settings of all motors", false,
      h("div", { class: "row" }, take, give, file), h("div", { class: "row" }, save, fetchStored, reset),
      h("p", { class: "muted" }, "A file is put in force as a whole, or not at all. Undo in Set up takes it back, motor by motor.")),
    part("hub", "New firmware", false, firmwareForm(link)),
    part("hub", "Faults and resets", false, h("div", { class: "row" }, look, clear), faults),
    part("hub", "Keys", false, h("table", {}, h("tbody", {}, ...KEYS.map(([key, does]) => h("tr", {}, h("th", {}, key), h("td", {}, does)))))));
}
