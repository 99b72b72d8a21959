// Conversion of speeds from counts/s to the chosen unit.

const PER_TURN = { cps: null, rpm: 60, rad: 2 * Math.PI };
const NAMES = { cps: "counts/s", rpm: "rpm", rad: "rad/s" };

/** The chosen unit. Motors whose counts per turn are unknown keep counts/s. */
export const units = { /** @type {"cps"|"rpm"|"rad"} */ chosen: "cps" };

/** @param {{counts_per_turn?: number|null}|undefined} settings */
function factor(settings) {
  const per = PER_TURN[units.chosen];
  return per && settings?.counts_per_turn ? per / settings.counts_per_turn : null;
}

/** @param {any} settings */
export const speedUnit = (settings) => (factor(settings) ? NAMES[units.chosen] : NAMES.cps);
/** @param {number} cps @param {any} settings */
export const fromCps = (cps, settings) => cps * (factor(settings) ?? 1);
/** @param {number} value @param {any} settings */
export const toCps = (value, settings) => value / (factor(settings) ?? 1);

/** Highest speed that a hub accepts, in counts/s. */
const MOST_CPS = 32767;
/** Free speed of a motor at 12 V, in counts/s, as far as a hub accepts it. @param {any} settings */
export const freeSpeed = (settings) => Math.min(MOST_CPS, settings ? 12000 / settings.emf_mv_s_per_count : 3000);
/** What limits the speed of a motor. @param {any} settings */
export const speedLimit = (settings) => (freeSpeed(settings) < MOST_CPS ? "the free speed at 12 V" : "the highest speed that a hub accepts");

/** Text of a number, with a space between thousands from 10 000 on; "–" if unknown. @param {number|null|undefined} value @param {number} [digits] */
export function number(value, digits = 0) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  return value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1").replace("-", "−").replace(/\B(?=(\d{3})+(?!\d|.*\.\d))/g, value >= 1e4 || value <= -1e4 ? " " : "");
}

/** Text of a tick of an axis, with as few digits as needed. @param {number} tick */
export const tickText = (tick) => number(tick, [0, 1, 2].find((digits) => Math.abs(tick - Number(tick.toFixed(digits))) < 1e-9) ?? 3);

/** @param {number} cps @param {any} settings */
export const speed = (cps, settings) => number(fromCps(cps, settings), speedUnit(settings) === "counts/s" ? 0 : 1);
