// Plots over time: speed, position, control, current or torque, battery. They share a cursor. Dragging zooms in. Pausing freezes
// the plots while the hub continues. Which curves are shown is chosen, and kept for the next visit.

import { drawBands, nameBands } from "./bands.js";
import { colour, elementById, h, LARGE, setText, swatch, typeScale } from "./dom.js";
import { select } from "./list.js";
import { store, stored, motorName, on, state } from "./state.js";
import { fromCps, number, speedUnit, tickText } from "./units.js";

/** @typedef {{name: string, words: string, colour: string, dash?: number[], digits: number, of?: number}} Line `of` is a motor, where it is not the chosen one */
/** @typedef {{title: string, height: number, lines: Line[], range?: (u: any, low: number, high: number) => number[]}} Plot */

/** Colours and dashes of motors that are shown beside the chosen one. */
const MOTORS = [["speed", [2, 3]], ["target", [9, 3, 2, 3]], ["measured", [5, 4]], ["reverse-edge", [1, 3]]];

/** A motor's curve beside the chosen motor's curves. @returns {Line[]} */
const others = (/** @type {string} */ name, /** @type {number} */ digits) => MOTORS.map(([colour, dash], motor) => ({ name, words: `motor ${motor}`, colour: /** @type {string} */ (colour), dash: /** @type {number[]} */ (dash), digits, of: motor }));

/** @type {Record<string, Plot>} */
const PLOTS = {
  speed: { title: "Speed", height: 170, range: (_, low, high) => around(low, high, 50), lines: [
    { name: "velocity", words: "measured", colour: "speed", digits: 0 },
    { name: "target", words: "set-point", colour: "target", dash: [7, 5], digits: 0 }, ...others("velocity", 0)] },
  position: { title: "Position, counts", height: 140, range: (_, low, high) => around(low, high, 10), lines: [
    { name: "position", words: "measured", colour: "speed", digits: 0 },
    { name: "goal", words: "set-point", colour: "target", dash: [7, 5], digits: 0 }, ...others("position", 0)] },
  control: { title: "Control and regimes", height: 190, range: () => [-1.05, 1.05], lines: [
    { name: "control", words: "control", colour: "control", digits: 2 }, ...others("control", 2)] },
  current: { title: "Current, A", height: 140, range: (_, low, high) => around(low, high, 0.1), lines: [
    { name: "current", words: "modelled", colour: "current", digits: 2 },
    { name: "load", words: "load", colour: "load", dash: [7, 5], digits: 2 },
    { name: "measured", words: "measured", colour: "measured", dash: [2, 3], digits: 2 }, ...others("current", 2)] },
  battery: { title: "Battery, V", height: 110, range: (_, low, high) => around(low, high, 0.25), lines: [
    { name: "battery", words: "at the hub", colour: "volts", digits: 2 }] },
};

/** Shortest interval between two drawings, in milliseconds. */
const DRAW_MS = 30;
/** Interval between two texts that describe a plot, in milliseconds. */
const DESCRIBE_MS = 1000;
/** Least height of a plot, in pixels. */
const LEAST_PX = 56;

/** Range of an axis: that of the values and a margin of at least `least`. @returns {number[]} */
function around(/** @type {any} */ low, /** @type {any} */ high, /** @type {number} */ least) {
  if (low === null || high === null) return [-least, least];
  const room = Math.max(least, 0.12 * (high - low));
  return [low - room, high + room];
}

/** @type {Map<string, {plot: any, values: any[], spans: any[], host: any, legend: any}>} */
const charts = new Map();
/** State of the view. While paused or zoomed in, the plots do not follow the hub. */
const view = { window: stored("window", 60), paused: false, /** @type {number[]|null} */ zoom: null, /** @type {any} */ frozen: null, /** @type {number|null} */ cursor: null };
/** The times of a whole recording, while one is shown. */
let whole = /** @type {number[]|null} */ (null);
/** Chosen curves: plots and curves that are hidden, motors that are shown beside the chosen one, and the unit of currents. */
const chosen = { hidden: ["position"], motors: /** @type {number[]} */ ([]), torque: false, ...stored("curves", {}) };
/** Durations of the last drawings in milliseconds, and times between them; for measurements. */
export const drawn = { /** @type {number[]} */ took: [], /** @type {number[]} */ apart: [] };

/** Columns of a motor. @returns {Record<string, any>} */
export function columns(motor = state.chosen) {
  if (view.frozen) return view.frozen.motors[motor];
  const { history } = state;
  const all = Object.entries(history.motors[motor]).map(([name, column]) => [name, column.last()]);
  return { ...Object.fromEntries(all), battery: history.battery.last(), time: history.time.last() };
}

/** Copies all values, so that new frames do not change the plots. */
function freeze() {
  const motors = [0, 1, 2, 3].map((motor) => Object.fromEntries(Object.entries(columns(motor)).map(([name, values]) => [name, values.slice()])));
  view.frozen = { motors };
}

/** Torque of the output shaft per ampere, in N m/A, by the back EMF; null for a motor whose counts per turn are unknown. */
function torquePerAmpere(motor = state.chosen) {
  const settings = state.settings[motor];
  return settings?.counts_per_turn ? (settings.emf_mv_s_per_count / 1000) * (settings.counts_per_turn / (2 * Math.PI)) : null;
}

/** Factor from a frame's unit to the shown unit. */
function factor(/** @type {Line} */ { name, of }) {
  const motor = of ?? state.chosen;
  if (name === "velocity" || name === "target") return fromCps(1, state.settings[motor]);
  if (chosen.torque && ["current", "load", "measured"].includes(name)) return torquePerAmpere(motor) ?? 1;
  return 1;
}

/** Values of a curve in the shown unit. */
function valuesOf(/** @type {Line} */ line, /** @type {Record<string, any>} */ of) {
  const values = line.of === undefined ? of[line.name] : columns(line.of)[line.name];
  const times = factor(line);
  return times === 1 ? values : values.map((/** @type {number|null} */ value) => (value === null ? null : value * times));
}

const plotShown = (/** @type {string} */ name) => !chosen.hidden.includes(name);
const lineShown = (/** @type {string} */ name, /** @type {Line} */ line) => (line.of === undefined ? !chosen.hidden.includes(`${name}.${line.name}`) : chosen.motors.includes(line.of) && line.of !== state.chosen);
/** The lowest visible plot, which shows the time axis. */
const lowest = () => Object.keys(PLOTS).filter(plotShown).at(-1);

function build(/** @type {string} */ name, /** @type {Plot} */ { title, height, lines, range }) {
  const values = lines.map(() => h("b", {}, "–"));
  const spans = lines.map((line, index) => h("span", {}, swatch(line), `${line.words} `, values[index]));
  const legend = h("div", { class: "legend" }, h("h3", {}, title), ...spans);
  if (name === "battery") legend.append(h("span", { id: "bus" }));
  const host = h("div", { class: "chart", role: "img", "aria-label": `${title} over time` });
  host.style.setProperty("--height", String(height));
  elementById("charts").append(legend, host);
  const scale = typeScale();
  const axis = { stroke: () => colour("muted"), grid: { stroke: () => colour("grid"), width: 1 }, ticks: { show: false }, font: `${12 * scale}px system-ui, sans-serif` };
  const plot = new uPlot({
    width: Math.max(200, host.clientWidth), height, legend: { show: false }, padding: [6, 8, 0, 0],
    cursor: { sync: { key: "time" }, drag: { x: true, y: false, setScale: false }, points: { size: 7 } },
    scales: { x: { time: false, range: (/** @type {any} */ u, /** @type {number} */ low, /** @type {number} */ high) => view.zoom ?? [Math.max(low, high - view.window), Math.max(high, low + 1)] }, y: { range } },
    axes: [{ ...axis, incrs: [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60, 120, 300, 600], space: 60 * scale, size: () => (name === lowest() ? 34 * scale : 12), values: (/** @type {any} */ _, /** @type {number[]} */ ticks) => (name === lowest() ? ticks.map((tick) => `${number(tick, Number.isInteger(tick) ? 0 : 1)} s`) : []) }, { ...axis, size: 62 * scale, space: 26 * scale, values: (/** @type {any} */ _, /** @type {number[]} */ ticks) => ticks.map(tickText) }],
    series: [{}, ...lines.map((line) => ({ stroke: () => colour(line.colour), width: 2, dash: line.dash, points: { show: false }, spanGaps: false, show: lineShown(name, line) }))],
    hooks: {
      drawAxes: name === "control" ? [(/** @type {any} */ u) => drawBands(u, columns())] : [],
      draw: [(/** @type {any} */ u) => {
        if (name === "control") nameBands(u, columns());
        if (whole) drawMarks(u, columns().marks ?? []);
      }],
      setSelect: [(/** @type {any} */ u) => zoom(u)],
      setCursor: [(/** @type {any} */ u) => { if (view.cursor !== u.cursor.idx) { view.cursor = u.cursor.idx; legends(columns()); } }],
    },
  }, [[], ...lines.map(() => [])], host);
  charts.set(name, { plot, values, spans, host, legend });
}

function zoom(/** @type {any} */ u) {
  const { left, width } = u.select;
  if (width < 4) return;
  if (!view.frozen) freeze();
  view.zoom = [u.posToVal(left, "x"), u.posToVal(left + width, "x")];
  u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
  showState();
  draw();
}

const digitsOf = (/** @type {Line} */ line) => (["velocity", "target"].includes(line.name) && speedUnit(state.settings[line.of ?? state.chosen]) !== "counts/s" ? 1 : line.digits);

/** Shows the values of all curves, at the cursor or at the end. */
function legends(/** @type {Record<string, any>} */ of) {
  const at = view.cursor ?? of.time.length - 1;
  for (const [name, { lines }] of Object.entries(PLOTS)) {
    if (!plotShown(name)) continue;
    const { values } = /** @type {any} */ (charts.get(name));
    lines.forEach((line, index) => {
      if (!lineShown(name, line)) return;
      const value = (line.of === undefined ? of : columns(line.of))[line.name]?.[at] ?? null;
      setText(values[index], number(value === null ? null : value * factor(line), digitsOf(line)));
    });
  }
  const ago = of.time[of.time.length - 1] - of.time[at];
  setText(elementById("cursor"), view.cursor === null ? "drag in a plot to zoom in" : `${number(of.time[at], 2)} s, ${number(ago, 2)} s ago`);
}

/** Describes the plots in words, for users who do not see them. */
function describe() {
  const of = columns();
  const first = whole ? 0 : of.time.findIndex((/** @type {number} */ time) => time >= of.time[of.time.length - 1] - view.window);
  for (const [name, { title, lines }] of Object.entries(PLOTS)) {
    const { host, legend } = /** @type {any} */ (charts.get(name));
    const curves = lines.filter((line) => lineShown(name, line)).map((line) => {
      const known = valuesOf(line, of).slice(Math.max(0, first)).filter((/** @type {number|null} */ value) => value !== null);
      const words = (/** @type {number} */ value) => number(value, digitsOf(line));
      return known.length ? `${line.words} ${words(known.at(-1))}, from ${words(Math.min(...known))} to ${words(Math.max(...known))}` : `${line.words} unknown`;
    });
    host.setAttribute("aria-label", `${legend.querySelector("h3").textContent || title}, ${whole ? `recording of ${number(whole[1] - whole[0])} s` : `last ${view.window} s`}: ${curves.join("; ")}`);
  }
}

let last = 0;
/** Draws all plots. */
export function draw() {
  const begun = performance.now();
  const of = columns();
  const nothing = new Array(of.time.length).fill(null);
  for (const [name, { lines }] of Object.entries(PLOTS)) {
    if (!plotShown(name)) continue;
    const { plot } = /** @type {any} */ (charts.get(name));
    plot.batch(() => plot.setData([of.time, ...lines.map((line) => (lineShown(name, line) ? valuesOf(line, of) : nothing))]));
  }
  legends(of);
  drawn.took.push(performance.now() - begun);
  drawn.apart.push(begun - last);
  if (drawn.took.length > 500) [drawn.took, drawn.apart] = [drawn.took.slice(-250), drawn.apart.slice(-250)];
  last = begun;
}

function titles() {
  const settings = state.settings[state.chosen];
  setText(elementById("plots-of"), `${motorName(state.chosen)}${settings?.name ? `, ${settings.name}` : ""}`);
  const title = (/** @type {string} */ name, /** @type {string} */ words) => setText(charts.get(name)?.legend.querySelector("h3"), words);
  title("speed", `Speed, ${speedUnit(settings)}`);
  title("current", chosen.torque && torquePerAmpere() !== null ? "Torque of the shaft, N m" : "Current, A");
}

/** Shows and hides plots and curves as chosen. */
function arrange() {
  for (const [name, { lines }] of Object.entries(PLOTS)) {
    const { plot, spans, host, legend } = /** @type {any} */ (charts.get(name));
    host.hidden = legend.hidden = !plotShown(name);
    plot.batch(() => lines.forEach((line, index) => {
      const is = lineShown(name, line);
      spans[index].hidden = !is;
      if (plot.series[index + 1].show !== is) plot.setSeries(index + 1, { show: is });
    }));
  }
  titles();
  fit();
  draw();
}

/** Fits the plots into their boxes. */
function fit() {
  for (const { plot, host } of charts.values()) {
    const [width, height] = [Math.max(200, host.clientWidth), Math.max(LEAST_PX, host.clientHeight)];
    if (!host.hidden && (plot.width !== width || plot.height !== height)) plot.setSize({ width, height });
  }
}

/** Buttons that choose the curves. */
function startCurves() {
  /** @type {[any, () => boolean][]} */
  const toggles = [];
  const toggle = (/** @type {string} */ label, /** @type {() => boolean} */ is, /** @type {() => void} */ change) => {
    const button = h("button", { type: "button", onclick: () => { change(); store("curves", chosen); paint(); arrange(); } }, label);
    toggles.push([button, is]);
    return button;
  };
  const flip = (/** @type {any[]} */ list, /** @type {any} */ item) => (list.includes(item) ? list.filter((other) => other !== item) : [...list, item]);
  const paint = () => toggles.forEach(([button, is]) => button.setAttribute("aria-pressed", String(is())));
  const hide = (/** @type {string} */ name) => () => { chosen.hidden = flip(chosen.hidden, name); };
  const row = (/** @type {string} */ label, /** @type {any[]} */ buttons) => h("div", { class: "row", role: "group", "aria-label": label }, h("span", { class: "muted" }, label), ...buttons);
  elementById("curves").append(
    row("Plots", Object.entries(PLOTS).map(([name, { title }]) => toggle(title.split(",")[0], () => plotShown(name), hide(name)))),
    row("Speed, position", [["speed", 1], ["position", 1]].map(([name, index]) => toggle(`Set-point of ${name}`, () => lineShown(String(name), PLOTS[name].lines[Number(index)]), hide(`${name}.${PLOTS[name].lines[Number(index)].name}`)))),
    row("Current", [...PLOTS.current.lines.filter((line) => line.of === undefined).map((line) => toggle(line.words[0].toUpperCase() + line.words.slice(1), () => lineShown("current", line), hide(`current.${line.name}`))), toggle("As torque, N m", () => chosen.torque, () => { chosen.torque = !chosen.torque; })]),
    row("Also show", [0, 1, 2, 3].map((motor) => toggle(`Motor ${motor}`, () => chosen.motors.includes(motor), () => { chosen.motors = flip(chosen.motors, motor); }))));
  elementById("curves-button").addEventListener("click", () => {
    elementById("curves").hidden = !elementById("curves").hidden;
    elementById("curves-button").setAttribute("aria-expanded", String(!elementById("curves").hidden));
  });
  paint();
}

/** Shows a recording instead of the hub. */
export function show(/** @type {any[]} */ motors) {
  const times = motors.find(({ time }) => time.length)?.time ?? [0, 1];
  whole = [times[0], times[times.length - 1]];
  Object.assign(view, { frozen: { motors }, zoom: whole });
  pause(true);
}

/** Marks the events of a recording. @param {any} u a uPlot @param {{at: number, words: string}[]} marks */
function drawMarks(u, marks) {
  const { ctx, bbox } = u;
  let free = bbox.left;
  ctx.save();
  ctx.lineWidth = devicePixelRatio;
  ctx.setLineDash([4 * devicePixelRatio, 4 * devicePixelRatio]);
  ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
  ctx.textBaseline = "top";
  ctx.textAlign = "left";
  for (const { at, words } of marks) {
    const x = Math.round(u.valToPos(at, "x", true));
    if (x < bbox.left || x > bbox.left + bbox.width) continue;
    ctx.strokeStyle = ctx.fillStyle = colour(words === "fault" ? "stop" : "muted");
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    // A name that would lie over the one before is left out.
    if (x < free) continue;
    ctx.fillText(words, x + 3 * devicePixelRatio, bbox.top + 2);
    free = x + ctx.measureText(words).width + 8 * devicePixelRatio;
  }
  ctx.restore();
}

function pause(/** @type {boolean} */ paused) {
  view.paused = paused;
  if (paused && !view.frozen) freeze();
  if (!paused) [view.frozen, view.zoom, whole] = [null, null, null];
  showState();
  draw();
}

/** Shows in the buttons whether the plots are frozen and zoomed in. */
function showState() {
  elementById("pause").setAttribute("aria-pressed", String(view.frozen !== null));
  setText(elementById("pause"), view.frozen ? "Resume live" : "Pause");
  elementById("unzoom").disabled = view.zoom === whole;
}

export function startPlots() {
  const window = select([["10", "10 s"], ["30", "30 s"], ["60", "60 s"]], { id: "window", "aria-label": "Time shown in the plots" });
  window.value = String(view.window);
  elementById("windows").append(window);
  window.addEventListener("change", () => {
    view.window = Number(window.value);
    store("window", view.window);
    draw();
  });
  const boxes = new ResizeObserver(fit);
  const buildAll = () => {
    for (const { plot } of charts.values()) plot.destroy();
    elementById("charts").replaceChildren();
    boxes.disconnect();
    for (const [name, plot] of Object.entries(PLOTS)) build(name, plot);
    for (const { host } of charts.values()) boxes.observe(host);
    arrange();
  };
  startCurves();
  buildAll();
  LARGE.addEventListener("change", buildAll);
  elementById("pause").addEventListener("click", () => pause(!view.frozen));
  elementById("unzoom").addEventListener("click", () => {
    view.zoom = whole;
    pause(view.paused);
  });
  for (const what of ["chosen", "settings", "unit"]) on(what, arrange);
  on("hubs", titles);
  on("theme", draw);
  on("line", () => { elementById("unreported").hidden = state.reports; });
  on("frame", (frame) => setText(elementById("bus"), frame.bus ? `Supply: ${frame.bus}${frame.dissipated_share ? `, ${number(100 * frame.dissipated_share)} %` : ""}` : ""));
  setInterval(describe, DESCRIBE_MS);
  const loop = (/** @type {number} */ now) => {
    if (!view.paused && !view.zoom && now - last >= DRAW_MS && state.history.length) draw();
    requestAnimationFrame(loop);
  };
  requestAnimationFrame(loop);
}
