// Panel for the points S, T, Z and G: where they lie at a speed and a battery voltage, by the paper's formulas and in the firmware.

import { h, setText } from "./dom.js";
import { select } from "./list.js";
import { labelled } from "./slider.js";
import { on, state } from "./state.js";
import { number, speed, speedUnit } from "./units.js";

const NAMES = ["S", "T", "Z", "G"];
const MEANINGS = ["full reverse", "full braking", "no current", "full forward"];
/** Control values of S, T, Z and G by the paper. V is the battery voltage, e the back EMF. */
const FORMULAS = {
  A: ["−1", "0", "e / V", "1"],
  B: ["−1", "−e / (V + e)", "0", "1"],
  C: ["−(V + e) / (V − e)", "−e / (V − e)", "0", "1"],
  D: ["−k", "−k e / (V + e)", "0", "1"],
};
const NOTES = {
  A: "Scheme A: a control value is a voltage. Z moves with the speed.",
  B: "Scheme B: a control value is a current. T moves with the speed.",
  C: "Scheme C: braking is as steep as driving. Near e = V the firmware keeps T within the control range.",
  D: "Scheme D: k = 1 + 2 b e / (V − e), with the largest blend b, at most (1 − u) / (2 u²), u = e / V, that keeps T in the control range.",
};
const BANDS = ["reverse", "braking", "forward"];
/** Size of the drawing, and the control value at its edge. */
const [WIDTH, HEIGHT, EDGE] = [400, 150, 1.25];
const USUAL_VOLTS = 12;
/** Highest speed, in counts/s, for which the server computes points. */
const MOST_CPS = 1_000_000;

const svg = (/** @type {string} */ tag, /** @type {Record<string, any>} */ attributes, text = "") => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  element.textContent = text;
  return element;
};

/** @param {any} link */
export function regimesPanel(link) {
  /** Chosen speed and battery voltage; until one is chosen, half of the free speed at the usual voltage. */
  const chosen = { cps: /** @type {number|null} */ (null), volts: USUAL_VOLTS };
  const settings = () => state.settings[state.chosen];
  const free = () => (settings() ? (1000 * chosen.volts) / settings().emf_mv_s_per_count : 3000);
  const cps = () => Math.min(MOST_CPS, chosen.cps ?? Math.round(free() / 2));
  const turns = labelled({ label: "Speed for the points", min: 0, max: 4000, step: 10, words: (value) => speed(value, settings()), send: (value) => { chosen.cps = value; ask(); } });
  const volts = labelled({ label: "Battery for the points, V", min: 6, max: 16, step: 0.1, words: (value) => `${number(value, 1)} V`, send: (value) => { chosen.volts = value; ask(); } });
  const scheme = select(Object.keys(FORMULAS).map((name) => [name, `Scheme ${name}`]), { id: "regimes-scheme", "aria-label": "Scheme for the points", onchange: () => ask() });
  const drawing = svg("svg", { class: "points", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img" });
  const rows = h("tbody", {});
  const note = h("p", { class: "muted" });
  const unit = h("span", {}, "Speed");

  function ask() {
    if (!state.open || !state.connected || !settings()) return;
    turns.input.max = String(Math.min(MOST_CPS, Math.round(1.2 * free())));
    turns.show(cps(), 0);
    volts.show(chosen.volts, USUAL_VOLTS);
    setText(unit, `Speed, ${speedUnit(settings())}`);
    link.order("points", { motor: state.chosen, scheme: scheme.value, cps: cps(), volts: chosen.volts });
  }

  function show(/** @type {any} */ { emf_v, firmware, paper, values }) {
    const name = /** @type {keyof typeof FORMULAS} */ (scheme.value);
    const of = name === "A" ? "V" : "A";
    rows.replaceChildren(...NAMES.map((point, index) => h("tr", {}, h("th", {}, h("b", {}, point), ` ${MEANINGS[index]}`), h("td", {}, FORMULAS[name][index]), h("td", { class: "n" }, number(paper[index], 3)), h("td", { class: "n" }, number(firmware[index], 3)), h("td", { class: "n" }, `${number(values[index], 2)} ${of}`))));
    setText(note, `${NOTES[name]} Here e = ${number(emf_v, 2)} V and e / V = ${number(emf_v / chosen.volts, 2)}.`);
    draw(firmware, values);
  }

  function draw(/** @type {number[]} */ points, /** @type {number[]} */ values) {
    const x = (/** @type {number} */ control) => (WIDTH / 2) * (1 + Math.max(-EDGE, Math.min(EDGE, control)) / EDGE);
    const most = Math.max(...values.map(Math.abs));
    const y = (/** @type {number} */ value) => HEIGHT / 2 - (value / most) * (HEIGHT / 2 - 24);
    const bands = BANDS.map((band, index) => svg("rect", { x: x(points[index]), y: 0, width: Math.max(0, x(points[index + 1]) - x(points[index])), height: HEIGHT, fill: `var(--${band})`, opacity: 0.3 }));
    const edges = [-1, 1].map((end) => svg("line", { x1: x(end), x2: x(end), y1: 0, y2: HEIGHT, stroke: "var(--muted)", "stroke-dasharray": "2 4" }));
    const line = svg("polyline", { points: points.map((point, index) => `${x(point)},${y(values[index])}`).join(" "), fill: "none", stroke: "var(--control)", "stroke-width": 2 });
    const marks = points.flatMap((point, index) => [svg("circle", { cx: x(point), cy: y(values[index]), r: 4, fill: "var(--control)" }), svg("text", { x: x(point) + (index < 2 ? 6 : -6), y: y(values[index]) + (index < 2 ? 16 : -8), "text-anchor": index < 2 ? "start" : "end" }, NAMES[index])]);
    drawing.replaceChildren(...bands, svg("line", { x1: 0, x2: WIDTH, y1: HEIGHT / 2, y2: HEIGHT / 2, stroke: "var(--line)" }), ...edges, line, ...marks);
    drawing.setAttribute("aria-label", `Points over the control value from −1 to 1: ${NAMES.map((name, index) => `${name} at ${number(points[index], 2)}`).join(", ")}`);
  }

  on("points", show);
  on("chosen", () => { chosen.cps = null; ask(); });
  for (const what of ["settings", "line", "unit"]) on(what, ask);
  return h("div", { class: "columns" },
    h("div", { class: "stack" },
      h("div", { class: "pair" }, h("label", { for: "regimes-scheme" }, "Scheme"), scheme, unit, turns.element, h("span", {}, "Battery"), volts.element),
      drawing, note),
    h("table", {}, h("thead", {}, h("tr", {}, ...["point", "formula", "paper", "firmware", "value"].map((words) => h("th", {}, words)))), rows));
}
