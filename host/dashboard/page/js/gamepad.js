// A gamepad drives the chosen motor while its button A is held: the left stick, forward and back, sets the speed. Released, or
// without the gamepad, the motor is off.

import { inControl, on, state } from "./state.js";

const BUTTON = 0;
const STICK = 1;
/** Deflection of the stick that counts as none. */
const DEAD = 0.1;
/** Largest speed, as a share of the free speed at 12 V. */
const SHARE = 0.5;
/** Shortest interval between two set-points, in milliseconds. */
const EVERY_MS = 50;

/** @param {any} link */
export function startGamepad(link) {
  /** @type {number|null} the motor that is driven */
  let driven = null;
  /** STOP was pressed: the button must be released first. */
  let stopped = false;
  let [sent, speed] = [0, 0];

  function off() {
    if (driven !== null) link.order("enable", { motor: driven, on: false });
    driven = null;
  }

  function look() {
    requestAnimationFrame(look);
    const pad = navigator.getGamepads?.().find((one) => one?.connected);
    const held = pad?.buttons[BUTTON]?.pressed && inControl() && state.connected && document.hasFocus();
    if (!held) stopped = false;
    if (!held || stopped) return off();
    const begins = driven === null;
    driven ??= state.chosen;
    const stick = -(pad?.axes[STICK] ?? 0);
    const free = 12000 / (state.settings[driven]?.emf_mv_s_per_count ?? 4);
    const wanted = Math.abs(stick) < DEAD ? 0 : Math.round(stick * SHARE * free);
    if (!begins && (wanted === speed || performance.now() - sent < EVERY_MS)) return;
    [sent, speed] = [performance.now(), wanted];
    link.order("drive", { motor: driven, mode: "velocity", value: wanted });
    if (begins) link.order("enable", { motor: driven, on: true });
  }
  on("notice", ({ grave }) => {
    if (!grave) return;
    [driven, stopped] = [null, true];
  });
  look();
}
