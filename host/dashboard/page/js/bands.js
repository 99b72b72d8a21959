// Bands behind the control plot: the regimes of the paper at the present speed. Between S and T the motor is driven against its
// motion, between T and Z it brakes, and between Z and G it is driven with its motion.

import { colour, typeScale } from "./dom.js";

const BANDS = [["s", "t", "reverse"], ["t", "z", "braking"], ["z", "g", "forward"]];
/** Smallest height in pixels of a band with a name. */
const NAMED = 15;

/**
 * Fills the bands behind the lines of a plot.
 * @param {any} u a uPlot
 * @param {Record<string, (number|null)[]>} points
 */
export function drawBands(u, points) {
  const time = u.data[0];
  if (!time.length || !points.s) return;
  const { ctx, bbox } = u;
  const first = Math.max(0, lower(time, u.scales.x.min) - 1);
  const last = Math.min(time.length - 1, lower(time, u.scales.x.max) + 1);
  // One point per pixel is enough.
  const step = Math.max(1, Math.floor((2 * (last - first)) / bbox.width));
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  for (const [low, high, name] of BANDS) {
    ctx.globalAlpha = 0.3;
    ctx.fillStyle = colour(name);
    fill(u, time, points[low], points[high], first, last, step);
    ctx.globalAlpha = 1;
  }
  stroke(u, time, points.t, first, last, step, "reverse-edge", [2, 3]);
  stroke(u, time, points.z, first, last, step, "forward-edge", []);
  ctx.restore();
}

/** Names the bands, over the lines. @param {any} u @param {Record<string, (number|null)[]>} points */
export function nameBands(u, points) {
  const time = u.data[0];
  if (!time.length || !points.s) return;
  const last = Math.min(time.length - 1, lower(time, u.scales.x.max) + 1);
  u.ctx.save();
  for (const [low, high, name] of BANDS) label(u, points[low], points[high], last, name);
  u.ctx.restore();
}

/** The first index whose time is not before `at`. */
function lower(/** @type {number[]} */ time, /** @type {number} */ at) {
  let [low, high] = [0, time.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time[middle] < at) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** @param {any} u @param {any} time @param {any} low @param {any} high @param {number} first @param {number} last @param {number} step */
function fill(u, time, low, high, first, last, step) {
  const { ctx } = u;
  const x = (/** @type {number} */ i) => u.valToPos(time[i], "x", true);
  const y = (/** @type {number} */ value) => u.valToPos(value, "y", true);
  for (let i = first; i <= last; ) {
    // One polygon for each stretch of known points.
    while (i <= last && low[i] === null) i += 1;
    const from = i;
    while (i <= last && low[i] !== null) i += 1;
    const to = i - 1;
    if (to <= from) continue;
    ctx.beginPath();
    for (let k = from; k <= to; k += step) ctx.lineTo(x(k), y(high[k]));
    for (let k = to; k >= from; k -= step) ctx.lineTo(x(k), y(low[k]));
    ctx.fill();
  }
}

/** @param {any} u @param {any} time @param {any} edge @param {number} first @param {number} last @param {number} step @param {string} name @param {number[]} dash */
function stroke(u, time, edge, first, last, step, name, dash) {
  const { ctx } = u;
  ctx.strokeStyle = colour(name);
  ctx.lineWidth = 1.5 * devicePixelRatio;
  ctx.setLineDash(dash.map((length) => length * devicePixelRatio));
  ctx.beginPath();
  let pen = false;
  for (let i = first; i <= last; i += 1) {
    if (edge[i] === null) pen = false;
    if (edge[i] === null || (pen && i % step)) continue;
    const [x, y] = [u.valToPos(time[i], "x", true), u.valToPos(edge[i], "y", true)];
    if (pen) ctx.lineTo(x, y);
    else ctx.moveTo(x, y);
    pen = true;
  }
  ctx.stroke();
}

/** @param {any} u @param {any} low @param {any} high @param {number} last @param {string} name */
function label(u, low, high, last, name) {
  const { ctx, bbox } = u;
  if (low[last] === null) return;
  const inside = (/** @type {number} */ value) => Math.min(bbox.top + bbox.height, Math.max(bbox.top, u.valToPos(value, "y", true)));
  const [top, bottom] = [inside(high[last]), inside(low[last])].sort((a, b) => a - b);
  if (!(bottom - top > NAMED * devicePixelRatio)) return;
  ctx.font = `${12 * typeScale() * devicePixelRatio}px system-ui, sans-serif`;
  ctx.textAlign = "right";
  ctx.textBaseline = "middle";
  const [x, y] = [bbox.left + bbox.width - 8 * devicePixelRatio, (top + bottom) / 2];
  ctx.setLineDash([]);
  ctx.lineWidth = 4 * devicePixelRatio;
  ctx.strokeStyle = colour("card");
  ctx.strokeText(name, x, y);
  ctx.fillStyle = colour("ink");
  ctx.fillText(name, x, y);
}
