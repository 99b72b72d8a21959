// The newest messages of the server, and the listeners to them.

import { History } from "./history.js";

/** @type {any} */
export const state = {
  /** This page's number. */ you: 0,
  /** The page in control. */ controller: null,
  /** The page that asks for control. */ asks: null,
  open: false,
  /** The program was started again, with another token. */ restarted: false,
  connected: false,
  reports: true,
  /** The hub can store its settings. */ stores: false,
  /** What the hub has besides motors; null if it does not report it. @type {any} */ has: null,
  /** The hubs of a chain, the parent first; empty for one hub. @type {any[]} */ hubs: [],
  why: "",
  place: "",
  simulated: false,
  /** The scenario can be played. */ playable: false,
  /** @type {any[]} */ catalogue: [],
  /** @type {any[]} by motor */ settings: [],
  /** The newest frame; null without a connection to the hub. */ frame: null,
  /** The motor shown in plots and panels. */ chosen: 0,
  world: null,
  history: new History(),
};

/** @type {Map<string, ((message: any) => void)[]>} */
const listeners = new Map();

/** @param {string} what @param {(message: any) => void} listener */
export function on(what, listener) {
  listeners.set(what, [...(listeners.get(what) ?? []), listener]);
}

/** @param {string} what @param {any} [message] */
export function emit(what, message) {
  for (const listener of listeners.get(what) ?? []) listener(message);
}

/** Address of the hub of a chain that is shown; `undefined` for a hub without a chain. @returns {number|undefined} */
export const shownHub = () => state.hubs.find(({ shown }) => shown)?.address;

/** A motor's name: in a chain, with the address of its hub. @param {number} motor */
export const motorName = (motor) => `Motor ${[shownHub(), motor].filter((part) => part !== undefined).join(":")}`;

/** Calls `leave` when somebody can no longer see or use this page, or chooses another hub. @param {() => void} leave */
export function onLeave(leave) {
  on("leave", leave);
  addEventListener("blur", leave);
  document.addEventListener("visibilitychange", leave);
}

export const inControl = () => state.open && state.controller === state.you;

/** True if this page may give orders to the hub. */
export const mayOrder = () => inControl() && state.connected;

/** Calls `allow` when {@link mayOrder} may have changed. @param {() => void} allow */
export function onControl(allow) {
  for (const what of ["control", "open", "line"]) on(what, allow);
}

/** @param {number} motor */
export function choose(motor) {
  state.chosen = motor;
  store("motor", motor);
  emit("chosen");
}

/** What this browser keeps for a reload of the page: a choice by its name. @param {string} name @param {any} fallback */
export function stored(name, fallback) {
  try {
    return JSON.parse(localStorage.getItem(name) ?? "") ?? fallback;
  } catch {
    return fallback;
  }
}

/** @param {string} name @param {any} value */
export function store(name, value) {
  try {
    localStorage.setItem(name, JSON.stringify(value));
  } catch {
    // A browser that stores nothing for this page loses the choice at a reload.
  }
}
