// The page: passes messages of the server to their listeners, and actions of the user to the server.

import { startChain } from "./chain.js";
import { elementById, FieldError, setText } from "./dom.js";
import { startGamepad } from "./gamepad.js";
import { learned } from "./learn.js";
import { Link } from "./link.js";
import { select } from "./list.js";
import { startMotors } from "./motors.js";
import { startPanels } from "./panels.js";
import { columns, drawn, startPlots } from "./plots.js";
import { choose, inControl, store, stored, on, shownHub, state, emit } from "./state.js";
import { admitted } from "./transport.js";
import { number, units } from "./units.js";

const THEMES = ["auto", "light", "dark"];
const NOTICE_MS = 8000;
/** Age of the newest frame from which shown values count as old. */
const STALE_MS = 500;

let noticeUntil = 0;
let heardAt = 0;

/** Another hub begins with an empty history. */
function setHubs(/** @type {any[]} */ hubs) {
  const former = shownHub();
  state.hubs = hubs;
  if (shownHub() !== former) state.history.clear();
}

/** @param {import("./link.js").Message} message */
function onMessage(message) {
  switch (message.kind) {
    case "welcome":
    case "line":
    case "control":
      Object.assign(state, message);
      if (message.connected === false) Object.assign(state, { hubs: [], frame: null });
      break;
    case "settings":
      state.settings[message.motor] = message;
      break;
    case "frame":
      state.frame = message;
      state.history.push(message);
      heardAt = performance.now();
      break;
    case "hubs":
      setHubs(message.hubs);
      break;
    case "world":
      state.world = message;
      break;
    case "notice":
      notice(message.text);
      // The server has disabled all motors, for example after STOP, or shows another hub because this one was lost.
      if (message.motors_disabled) emit("stopped");
      break;
    case "refused":
      notice(`Not done: ${message.why}`);
      break;
  }
  emit(message.kind, message);
}

/** @param {string} text */
function notice(text) {
  elementById("notice").classList.add("news");
  setText(elementById("notice"), `${text[0].toUpperCase()}${text.slice(1)}.`);
  noticeUntil = performance.now() + NOTICE_MS;
}

/** Text while there is no notice. */
function hint() {
  elementById("notice").classList.remove("news");
  setText(elementById("notice"), "Esc stops all motors from anywhere on the page; Space does so outside of input fields. Keys 0 to 3 choose a motor.");
}

function fact(/** @type {any} */ element, /** @type {boolean} */ bad, /** @type {string} */ text) {
  setText(element, text);
  element.classList.toggle("bad", bad);
}

function facts() {
  const stale = performance.now() - heardAt > STALE_MS;
  setText(elementById("place"), state.place || "motor-hub");
  setText(elementById("kind"), state.simulated ? "SIMULATED" : "HARDWARE");
  elementById("kind").classList.toggle("simulated", state.simulated);
  if (state.restarted) fact(elementById("line"), true, "The program was started again: open the URL that it printed");
  else if (!state.open) fact(elementById("line"), true, "No connection to the program, values are old: is it running? Once started again, it prints a new URL to open");
  else if (!state.connected) fact(elementById("line"), true, `Hub not connected: ${state.why}`);
  else if (stale) fact(elementById("line"), true, "No new values from the hub");
  else fact(elementById("line"), false, "Connected");
  const volts = state.frame?.battery_v;
  fact(elementById("battery"), state.connected && volts === null, volts ? `Battery ${number(volts, 1)} V` : "Battery unknown");
  const others = (state.pages ?? 1) - 1;
  const watched = others > 0 ? `, ${others} other page${others > 1 ? "s" : ""}` : "";
  const asked = state.asks === state.you ? ", and is asked to release it" : "";
  const asks = inControl() && state.asks !== null;
  setText(elementById("control"), !state.open ? "" : asks ? "Another page asks for control" : inControl() ? `You are in control${watched}` : state.controller ? `Another page is in control${asked}` : "No page is in control");
  elementById("control").classList.toggle("asks", asks);
  elementById("take").hidden = !state.open || inControl();
  elementById("take").disabled = state.asks === state.you;
  elementById("release").hidden = !inControl() || !others;
  elementById("release").classList.toggle("primary", asks);
  if (noticeUntil && performance.now() > noticeUntil) {
    hint();
    noticeUntil = 0;
  }
}

function theme(/** @type {string} */ chosen) {
  const dark = chosen === "dark" || (chosen === "auto" && matchMedia("(prefers-color-scheme: dark)").matches);
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  setText(elementById("theme"), { auto: "◐ auto", light: "○ light", dark: "● dark" }[chosen] ?? "");
  elementById("theme").title = chosen === "auto" ? "Theme of the system" : `${chosen} theme`;
  elementById("theme").dataset.chosen = chosen;
  store("theme", chosen);
  emit("theme");
}

const link = new Link(onMessage, (open) => {
  state.open = open;
  if (open) state.history.clear();
  else Object.assign(state, { controller: null, asks: null, connected: false, frame: null });
  facts();
  emit("open");
  emit("control");
  if (open) state.restarted = false;
  else admitted().then((is) => { state.restarted = is === false && !state.open; });
});

const stop = () => {
  if (!link.order("stop")) notice("This page has no connection: STOP did not reach the server. The server disables all motors when the page in control is gone");
};

/** Fields in which Space enters a character. */
const typing = (/** @type {any} */ target) => target.matches?.("input:not([type=range]), textarea");

// The listener is on the window and in the capture phase, so that STOP gets a key before any element gets the key.
addEventListener("keydown", (event) => {
  if (event.key === "Escape" || (event.key === " " && !typing(event.target))) {
    event.preventDefault();
    stop();
  } else if (event.key === "Enter" && typing(event.target)) {
    // The field sends its value when it loses the focus, and Space stops again.
    /** @type {HTMLElement} */ (event.target).blur();
  } else if (/^[0-3]$/.test(event.key) && !typing(event.target) && !event.ctrlKey && !event.altKey && !event.metaKey) {
    choose(Number(event.key));
  }
}, true);

// An action throws a `FieldError` before it sends anything.
addEventListener("error", (event) => {
  if (!(event.error instanceof FieldError)) return;
  event.preventDefault();
  notice(`Not done: ${event.error.message}`);
});

// A text that is no number is no change for the browser if the field was empty before.
addEventListener("focusout", ({ target }) => {
  if (/** @type {any} */ (target).validity?.badInput) target?.dispatchEvent(new Event("change"));
});

// By default the mouse wheel changes a number field that has the focus. On this page the wheel always scrolls the page.
addEventListener("wheel", (event) => {
  if (event.ctrlKey || event.target !== document.activeElement || !typing(event.target)) return;
  event.preventDefault();
  scrollBy(event.deltaX, event.deltaY);
}, { passive: false });

elementById("stop").addEventListener("click", stop);
elementById("take").addEventListener("click", () => link.order("take"));
elementById("release").addEventListener("click", () => link.order("release"));
const unit = select([["cps", "counts/s"], ["rpm", "rpm"], ["rad", "rad/s"]], { id: "unit", "aria-label": "Unit of speeds" });
elementById("units").append(unit);
unit.addEventListener("change", () => {
  units.chosen = unit.value;
  store("unit", unit.value);
  emit("unit");
});
units.chosen = unit.value = stored("unit", "cps");
elementById("theme").addEventListener("click", () => theme(THEMES[(THEMES.indexOf(elementById("theme").dataset.chosen) + 1) % THEMES.length]));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => theme(elementById("theme").dataset.chosen));

startChain(link);
startMotors(link);
startPlots();
startPanels(link);
startGamepad(link);
theme(stored("theme", "auto"));
hint();
choose(stored("motor", 0));
for (const what of ["welcome", "line", "control"]) on(what, facts);
setInterval(facts, 250);
// For tests and measurements.
Object.assign(window, { dashboard: { state, drawn, link, columns, learned: () => learned } });

