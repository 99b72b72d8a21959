// Four plots over time: speed, control, current, battery. They share a cursor. Dragging zooms in. Pausing freezes the plots
// while the hub continues.

import { drawBands, nameBands } from "./bands.js";
import { by, h, say } from "./dom.js";
import { select } from "./list.js";
import { on, state } from "./state.js";
import { fromCps, number, speedUnit } from "./units.js";

/** @typedef {{name: string, words: string, colour: string, dash?: number[], digits: number}} Line */
/** @typedef {{title: string, height: number, lines: Line[], range?: (u: any, low: number, high: number) => number[]}} Plot */

const speeds = (/** @type {any} */ _, /** @type {number} */ low, /** @type {number} */ high) => around(low, high, 50);
/** @type {Record<string, Plot>} */
const PLOTS = {
  speed: { title: "Speed", height: 170, range: speeds, lines: [
    { name: "velocity", words: "measured", colour: "speed", digits: 0 },
    { name: "target", words: "set-point", colour: "target", dash: [7, 5], digits: 0 }] },
  control: { title: "Control and regimes", height: 190, range: () => [-1.05, 1.05], lines: [
    { name: "control", words: "control", colour: "control", digits: 2 }] },
  current: { title: "Current, A", height: 140, range: (_, low, high) => around(low, high, 0.2), lines: [
    { name: "current", words: "modelled", colour: "current", digits: 2 },
    { name: "load", words: "load", colour: "load", dash: [7, 5], digits: 2 },
    { name: "measured", words: "measured", colour: "measured", dash: [2, 3], digits: 2 }] },
  battery: { title: "Battery, V", height: 110, range: (_, low, high) => around(low, high, 0.25), lines: [
    { name: "battery", words: "at the hub", colour: "volts", digits: 2 }] },
};

/** Shortest interval between two drawings, in milliseconds. */
const DRAW_MS = 30;

/** Range of an axis: that of the values and a margin of at least `least`. @returns {number[]} */
function around(/** @type {any} */ low, /** @type {any} */ high, /** @type {number} */ least) {
  if (low === null || high === null) return [-least, least];
  const room = Math.max(least, 0.12 * (high - low));
  return [low - room, high + room];
}

/** Text of a tick with as few digits as needed. */
const tickWords = (/** @type {number} */ tick) => number(tick, [0, 1, 2].find((digits) => Math.abs(tick - Number(tick.toFixed(digits))) < 1e-9) ?? 3);

let colours = new Map();
function colour(/** @type {string} */ name) {
  let known = colours.get(name);
  if (!known) colours.set(name, (known = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim()));
  return known;
}

/** @type {Map<string, {plot: any, values: Map<string, Element>, host: any}>} */
const charts = new Map();
/** State of the view. While paused or zoomed in, the plots do not follow the hub. */
const view = { window: 60, paused: false, /** @type {number[]|null} */ zoom: null, /** @type {any} */ frozen: null, /** @type {number|null} */ cursor: null };
/** Durations of the last drawings in milliseconds, and times between them; for measurements. */
export const drawn = { /** @type {number[]} */ took: [], /** @type {number[]} */ apart: [] };

/** Columns of the chosen motor. @returns {Record<string, any>} */
function columns() {
  if (view.frozen) return view.frozen.motors[state.chosen];
  const { history } = state;
  const all = Object.entries(history.motors[state.chosen]).map(([name, column]) => [name, column.last()]);
  return { ...Object.fromEntries(all), battery: history.battery.last(), time: history.time.last() };
}

/** Copies all values, so that new frames do not change the plots. */
function freeze() {
  const chosen = state.chosen;
  const motors = [0, 1, 2, 3].map((motor) => {
    state.chosen = motor;
    return Object.fromEntries(Object.entries(columns()).map(([name, values]) => [name, values.slice()]));
  });
  state.chosen = chosen;
  view.frozen = { motors };
}

/** Converts speeds to the chosen unit. */
function inUnits(/** @type {string} */ name, /** @type {any[]} */ values) {
  const factor = fromCps(1, state.settings[state.chosen]);
  return factor === 1 || (name !== "velocity" && name !== "target") ? values : values.map((value) => (value === null ? null : value * factor));
}

function swatch(/** @type {Line} */ line) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  path.setAttribute("d", "M0 5H26");
  path.setAttribute("stroke", `var(--${line.colour})`);
  path.setAttribute("stroke-width", "2.5");
  if (line.dash) path.setAttribute("stroke-dasharray", line.dash.join(" "));
  svg.setAttribute("aria-hidden", "true");
  svg.append(path);
  return svg;
}

function build(/** @type {string} */ name, /** @type {Plot} */ { title, height, lines, range }) {
  const values = new Map();
  const legend = h("div", { class: "legend" }, h("h3", {}, title));
  for (const line of lines) {
    const value = h("b", {}, "–");
    values.set(line.name, value);
    legend.append(h("span", {}, swatch(line), `${line.words} `, value));
  }
  if (name === "battery") legend.append(h("span", { id: "bus" }));
  const host = h("div", { class: "chart", role: "img", "aria-label": `${title} over time` });
  by("charts").append(legend, host);
  const axis = { stroke: () => colour("muted"), grid: { stroke: () => colour("grid"), width: 1 }, ticks: { show: false }, font: "12px system-ui, sans-serif" };
  const plot = new uPlot({
    width: Math.max(200, host.clientWidth), height, legend: { show: false }, padding: [6, 8, 0, 0],
    cursor: { sync: { key: "time" }, drag: { x: true, y: false, setScale: false }, points: { size: 7 } },
    scales: { x: { time: false, range: (/** @type {any} */ u, /** @type {number} */ low, /** @type {number} */ high) => view.zoom ?? [Math.max(low, high - view.window), Math.max(high, low + 1)] }, y: { range } },
    axes: [{ ...axis, incrs: [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60], space: 60, size: name === "battery" ? 40 : 18, values: name === "battery" ? (/** @type {any} */ _, /** @type {number[]} */ ticks) => ticks.map((tick) => `${number(tick, Number.isInteger(tick) ? 0 : 1)} s`) : () => [] }, { ...axis, size: 62, values: (/** @type {any} */ _, /** @type {number[]} */ ticks) => ticks.map(tickWords) }],
    series: [{}, ...lines.map((line) => ({ stroke: () => colour(line.colour), width: 2, dash: line.dash, points: { show: false }, spanGaps: false }))],
    hooks: {
      drawAxes: name === "control" ? [(/** @type {any} */ u) => drawBands(u, columns(), colour)] : [],
      draw: name === "control" ? [(/** @type {any} */ u) => nameBands(u, columns(), colour)] : [],
      setSelect: [(/** @type {any} */ u) => zoom(u)],
      setCursor: [(/** @type {any} */ u) => { if (view.cursor !== u.cursor.idx) { view.cursor = u.cursor.idx; legends(); } }],
    },
  }, [[], ...lines.map(() => [])], host);
  charts.set(name, { plot, values, host });
}

function zoom(/** @type {any} */ u) {
  const { left, width } = u.select;
  if (width < 4) return;
  if (!view.frozen) freeze();
  view.zoom = [u.posToVal(left, "x"), u.posToVal(left + width, "x")];
  u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
  by("unzoom").disabled = false;
  draw();
}

/** Shows the values of all lines, at the cursor or at the end. */
function legends() {
  const of = columns();
  const at = view.cursor ?? of.time.length - 1;
  for (const [name, { lines }] of Object.entries(PLOTS)) {
    const { values } = /** @type {any} */ (charts.get(name));
    for (const line of lines) {
      const value = of[line.name]?.[at];
      const isSpeed = line.name === "velocity" || line.name === "target";
      const shown = isSpeed && value !== null ? fromCps(value, state.settings[state.chosen]) : value;
      say(values.get(line.name), number(shown, line.digits || (speedUnit(state.settings[state.chosen]) === "counts/s" ? 0 : 1)));
    }
  }
  const ago = of.time[of.time.length - 1] - of.time[at];
  say(by("cursor"), view.cursor === null ? "drag in a plot to zoom in" : `${number(of.time[at], 2)} s, ${number(ago, 2)} s ago`);
}

let last = 0;
/** Draws all plots. */
export function draw() {
  const begun = performance.now();
  const of = columns();
  for (const [name, { lines }] of Object.entries(PLOTS)) {
    const { plot } = /** @type {any} */ (charts.get(name));
    plot.batch(() => plot.setData([of.time, ...lines.map((line) => inUnits(line.name, of[line.name]))]));
  }
  legends();
  drawn.took.push(performance.now() - begun);
  drawn.apart.push(begun - last);
  if (drawn.took.length > 500) [drawn.took, drawn.apart] = [drawn.took.slice(-250), drawn.apart.slice(-250)];
  last = begun;
}

function title() {
  const settings = state.settings[state.chosen];
  say(by("plots-of"), `Motor ${state.chosen}${settings?.name ? `, ${settings.name}` : ""}`);
  const heading = by("charts").querySelector("h3");
  if (heading) say(heading, `Speed, ${speedUnit(settings)}`);
}

/** Shows a recording instead of the hub. */
export function show(/** @type {any[]} */ motors) {
  view.frozen = { motors };
  pause(true);
}

function pause(/** @type {boolean} */ paused) {
  view.paused = paused;
  if (paused && !view.frozen) freeze();
  if (!paused) [view.frozen, view.zoom] = [null, null];
  by("pause").setAttribute("aria-pressed", String(paused));
  say(by("pause"), paused ? "Resume" : "Pause");
  by("unzoom").disabled = view.zoom === null;
  draw();
}

export function startPlots() {
  for (const [name, plot] of Object.entries(PLOTS)) build(name, plot);
  title();
  by("pause").addEventListener("click", () => pause(!view.paused));
  by("unzoom").addEventListener("click", () => {
    view.zoom = null;
    pause(view.paused);
  });
  const window = select([["10", "10 s"], ["30", "30 s"], ["60", "60 s"]], { id: "window", "aria-label": "Time shown in the plots" });
  window.value = "60";
  by("windows").append(window);
  window.addEventListener("change", () => {
    view.window = Number(window.value);
    draw();
  });
  new ResizeObserver(() => {
    for (const [name, { plot, host }] of charts) plot.setSize({ width: Math.max(200, host.clientWidth), height: PLOTS[name].height });
  }).observe(by("charts"));
  for (const what of ["chosen", "settings", "unit"]) on(what, () => { title(); draw(); });
  on("theme", () => { colours = new Map(); draw(); });
  on("line", () => { by("untold").hidden = state.reports; });
  on("frame", (frame) => say(by("bus"), frame.bus ? `bus ${frame.bus}${frame.burning ? `, dissipates ${number(100 * frame.burning)} %` : ""}` : ""));
  const loop = (/** @type {number} */ now) => {
    if (!view.paused && !view.zoom && now - last >= DRAW_MS && state.history.length) draw();
    requestAnimationFrame(loop);
  };
  requestAnimationFrame(loop);
}
