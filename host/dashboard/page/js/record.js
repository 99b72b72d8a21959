// Panel for recordings: saves values as CSV, and shows saved CSV files.

import { h, say } from "./dom.js";
import { OF_MOTOR } from "./history.js";
import { show } from "./plots.js";
import { on } from "./state.js";

/** The longest recording, in frames: half an hour. */
const MOST = 90000;
const HEADINGS = ["time_s", "motor", "battery_v", ...OF_MOTOR];
/** Columns that older recordings do not have. */
const LATER = ["goal"];
/** Columns of a recording, and the fields of a motor in a frame. */
const VALUES = { velocity: "velocity", target: "target", position: "position", control: "control", current: "current_a", load: "load_a", measured: "measured_a" };

/** CSV rows of a frame. */
function rows(/** @type {any} */ frame) {
  return frame.motors.map((/** @type {any} */ motor, /** @type {number} */ index) => {
    const [s, t, z, g] = motor.points ?? [];
    const of = { ...Object.fromEntries(Object.entries(VALUES).map(([name, key]) => [name, motor[key]])), s, t, z, g, target: motor.told === "velocity" ? motor.target : null, goal: motor.told === "position" || motor.told === "together" ? motor.target : null };
    return [frame.at_s.toFixed(4), index, frame.battery_v ?? "", ...OF_MOTOR.map((name) => of[name] ?? "")].join(",");
  }).join("\n");
}

/** Columns of a CSV file by motor; throws an error that says what is wrong. */
export function parse(/** @type {string} */ text) {
  const [head, ...lines] = text.trim().split(/\r?\n/);
  const names = head.split(",");
  const missing = HEADINGS.filter((name) => !names.includes(name) && !LATER.includes(name));
  if (missing.length) throw new Error(`not a recording of this page: the file has no column ${missing.join(", ")}`);
  const motors = [0, 1, 2, 3].map(() => Object.fromEntries([...OF_MOTOR, "time", "battery"].map((name) => [name, /** @type {(number|null)[]} */ ([])])));
  lines.forEach((line, index) => {
    const cells = line.split(",");
    const value = (/** @type {string} */ name) => (!names.includes(name) || cells[names.indexOf(name)] === "" ? null : Number(cells[names.indexOf(name)]));
    const of = motors[value("motor") ?? -1];
    if (!of || cells.length !== names.length || [...cells.keys()].some((i) => Number.isNaN(Number(cells[i])))) throw new Error(`line ${index + 2} is not a row of a recording`);
    of.time.push(value("time_s") ?? 0);
    of.battery.push(value("battery_v"));
    for (const name of OF_MOTOR) of[name].push(value(name));
  });
  return motors;
}

export function recordPanel() {
  /** @type {string[]} */
  let recorded = [];
  let recording = false;
  const says = h("p", { role: "status" }, "No recording yet.");
  const toggle = h("button", { type: "button", class: "primary", "aria-pressed": "false", onclick: () => {
    recording = !recording;
    if (recording) recorded = [];
    toggle.setAttribute("aria-pressed", String(recording));
    say(toggle, recording ? "Stop recording" : "Record");
    tell();
  } }, "Record");
  const save = h("button", { type: "button", disabled: true, onclick: () => {
    const url = URL.createObjectURL(new Blob([[HEADINGS.join(","), ...recorded].join("\n") + "\n"], { type: "text/csv" }));
    h("a", { href: url, download: `motor-hub-${new Date().toISOString().slice(0, 19).replaceAll(":", "")}.csv` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  } }, "Save as CSV");
  const file = h("input", { type: "file", accept: ".csv,text/csv", id: "record-file", hidden: true, onchange: async () => {
    const [chosen] = file.files;
    file.value = "";
    if (!chosen) return;
    try {
      show(parse(await chosen.text()));
      say(says, `${chosen.name} is shown in the plots; Resume live shows the hub again.`);
    } catch (error) {
      say(says, `${chosen.name}: ${/** @type {Error} */ (error).message}`);
    }
  } });
  const load = h("button", { type: "button", onclick: () => file.click() }, "Show a recording");
  function tell() {
    save.disabled = !recorded.length;
    say(says, recording ? `Recording: ${(recorded.length / 50).toFixed(0)} s` : recorded.length ? `${(recorded.length / 50).toFixed(0)} s of all motors are recorded.` : "No recording yet.");
  }
  on("frame", (frame) => {
    if (!recording) return;
    recorded.push(rows(frame));
    if (recorded.length % 50 === 0) tell();
    if (recorded.length >= MOST) toggle.click();
  });
  return h("div", { class: "stack" }, h("div", { class: "row" }, toggle, save, load, file), says, h("p", { class: "muted" }, "A recording has a row for each motor and frame, 50 frames per second: time in s, battery in V, speeds in counts/s, positions (goal: set-point) in counts, control and points S, T, Z, G from -1 to 1, currents in A. It lasts half an hour at most."));
}
