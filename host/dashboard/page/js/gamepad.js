// A gamepad drives the chosen motor while its button A is held: the left stick, forward and back, sets the speed. Released,
// without the gamepad, or in a page that is hidden or without the focus, the motor is off.

import { inControl, on, onLeave, state } from "./state.js";
import { freeSpeed } from "./units.js";

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
  /** STOP was pressed, or the page could not drive: the button must be seen released first. */
  let stopped = true;
  let [sent, speed] = [0, 0];

  function off() {
    if (driven !== null) link.order("enable", { motor: driven, on: false });
    driven = null;
  }

  function leave() {
    stopped = true;
    off();
  }

  function look() {
    requestAnimationFrame(look);
    const pad = navigator.getGamepads?.().find((one) => one?.connected);
    if (!pad?.buttons[BUTTON]?.pressed) {
      stopped = false;
      return off();
    }
    if (stopped || !inControl() || !state.connected || !document.hasFocus()) return leave();
    const begins = driven === null;
    driven ??= state.chosen;
    const stick = -(pad.axes[STICK] ?? 0);
    const wanted = Math.abs(stick) < DEAD ? 0 : Math.round(stick * SHARE * freeSpeed(state.settings[driven]));
    if (!begins && (wanted === speed || performance.now() - sent < EVERY_MS)) return;
    [sent, speed] = [performance.now(), wanted];
    link.order("drive", { motor: driven, mode: "velocity", value: wanted });
    if (begins) link.order("enable", { motor: driven, on: true });
  }
  on("notice", ({ grave }) => {
    if (!grave) return;
    [driven, stopped] = [null, true];
  });
  // A hidden page looks at no gamepad: nothing calls `look`.
  onLeave(leave);
  look();
}
