// A small plot: lines over a fixed time.

import { colour, h, LARGE, swatch, typeScale } from "./dom.js";
import { on } from "./state.js";
import { number, tickText } from "./units.js";

/** @typedef {{words: string, colour: string, dash?: number[]}} Line */

export class SmallPlot {
  /** @param {string} label @param {Line[]} lines @param {number} height in pixels */
  constructor(label, lines, height = 200) {
    this.lines = lines;
    this.label = label;
    this.height = height;
    this.host = h("div", { class: "chart", role: "img", "aria-label": label });
    const names = lines.map((line) => h("span", {}, swatch(line), line.words));
    this.element = h("div", {}, h("div", { class: "legend" }, h("h3", {}, label), ...names), this.host);
    this.data = [[0, 1], ...lines.map(() => [null, null])];
    new ResizeObserver(() => this.draw()).observe(this.host);
    const again = () => { this.plot?.destroy(); this.plot = null; this.draw(); };
    on("theme", again);
    LARGE.addEventListener("change", again);
  }

  /** @param {any[]} data times in seconds, then the values of each line */
  show(data) {
    this.data = data;
    // A text for users who do not see the plot.
    const words = this.lines.map(({ words }, index) => {
      const known = data[index + 1].filter((/** @type {number|null} */ value) => value !== null);
      return known.length ? `${words} from ${number(Math.min(...known))} to ${number(Math.max(...known))}, at the end ${number(known.at(-1))}` : `${words} empty`;
    });
    this.host.setAttribute("aria-label", `${this.label}: ${words.join("; ")}`);
    this.draw();
  }

  draw() {
    const width = this.host.clientWidth;
    if (width < 50) return;
    const axis = { stroke: colour("muted"), grid: { stroke: colour("grid"), width: 1 }, ticks: { show: false }, font: `${12 * typeScale()}px system-ui, sans-serif` };
    this.plot ??= new uPlot({
      width, height: this.height, legend: { show: false }, cursor: { drag: { x: false, y: false } }, padding: [8, 8, 0, 0],
      scales: { x: { time: false }, y: { range: (/** @type {any} */ _, /** @type {any} */ low, /** @type {any} */ high) => (low === null ? [0, 1000] : uPlot.rangeNum(low, high, 0.1, true)) } },
      axes: [{ ...axis, size: 28 * typeScale(), values: (/** @type {any} */ _, /** @type {number[]} */ ticks) => ticks.map((tick) => `${tickText(tick)} s`) }, { ...axis, size: 62 * typeScale(), values: (/** @type {any} */ _, /** @type {number[]} */ ticks) => ticks.map(tickText) }],
      series: [{}, ...this.lines.map(({ colour: name, dash }) => ({ stroke: colour(name), width: 2, dash, points: { show: false } }))],
    }, this.data, this.host);
    if (this.plot.width !== width) this.plot.setSize({ width, height: this.height });
    this.plot.setData(this.data);
  }
}
