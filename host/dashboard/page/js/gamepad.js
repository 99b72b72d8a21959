// A gamepad drives the chosen motor while its button A is held: the left stick, forward and back, sets the speed. The
// motor is disabled when the button is released, when the gamepad disconnects, and when the page is hidden or loses the
// focus.

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
  /** True after STOP, and while the page may not drive. The gamepad drives again only after its button was released. */
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
    link.order("drive", { motor: driven, mode: "velocity", value: wanted, enable: begins });
  }
  on("stopped", () => { [driven, stopped] = [null, true]; });
  // The browser does not call `look` in a hidden page, so a hidden page must disable the motor by this listener.
  onLeave(leave);
  look();
}
