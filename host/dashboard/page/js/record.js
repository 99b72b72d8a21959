// Panel for recordings: saves values as CSV or MCAP, and shows saved CSV files whole, with their events.

import { chooser, download, elementById, h, setText } from "./dom.js";
import { GAP_S, OF_MOTOR } from "./history.js";
import { mcap } from "./mcap.js";
import { show } from "./plots.js";
import { on, shownHub } from "./state.js";

/** Rows that are kept as text; older rows go to a blob, which the browser may keep on disk. */
const ROWS = 4096;
const FRAMES_PER_S = 50;
/** Columns that are words: the kind of the set-point, the bridge's mode, the regime. */
const WORDS = ["setpoint", "mode", "regime"];
/** Columns that older recordings do not have. */
const LATER = ["goal", "enabled", "setpoint", "power", "current_setpoint", "mode", "duty", "regime", "fault"];
const HEADINGS = ["time_s", "motor", "battery_v", ...OF_MOTOR, ...LATER.slice(1)];
/** Columns of a recording, and the fields of a motor in a frame. */
const FIELDS = { velocity: "velocity", position: "position", control: "control", current: "modelled_a", load: "load_a", measured: "measured_a", setpoint: "setpoint", mode: "mode", duty: "duty", regime: "regime" };
/** Columns of set-points, and the kinds of set-points that they hold. */
const SETPOINTS = { target: ["velocity"], goal: ["position", "together"], power: ["power"], current_setpoint: ["current"] };

/** CSV rows of a frame. */
function rows(/** @type {any} */ frame) {
  return frame.motors.map((/** @type {any} */ motor, /** @type {number} */ index) => {
    const [s, t, z, g] = motor.points ?? [];
    const of = {
      ...Object.fromEntries(Object.entries(FIELDS).map(([name, key]) => [name, motor[key]])),
      ...Object.fromEntries(Object.entries(SETPOINTS).map(([name, kinds]) => [name, kinds.includes(motor.setpoint) ? motor.target : null])),
      s, t, z, g, enabled: Number(motor.enabled), fault: Number(Boolean(motor.fault || motor.stalled)),
    };
    return [frame.at_s.toFixed(4), index, frame.battery_v ?? "", ...HEADINGS.slice(3).map((name) => of[name] ?? "")].join(",");
  }).join("\n");
}

/** Rows of a CSV file: numbers, words, or null. Throws an error that says what is wrong. */
function read(/** @type {string} */ text) {
  const [head, ...lines] = text.trim().split(/\r?\n/);
  const names = head.split(",");
  const missing = HEADINGS.filter((name) => !names.includes(name) && !LATER.includes(name));
  if (missing.length) throw new Error(`not a recording of this page: the file has no column ${missing.join(", ")}`);
  return lines.map((line, index) => {
    const cells = line.split(",");
    const row = Object.fromEntries(names.map((name, at) => [name, cells[at] === "" ? null : WORDS.includes(name) ? cells[at] : Number(cells[at])]));
    if (cells.length !== names.length || !(Number(row.motor) in [0, 1, 2, 3]) || Object.values(row).some(Number.isNaN)) throw new Error(`line ${index + 2} is not a row of a recording`);
    return row;
  });
}

/** What has happened between two rows of a motor, in words; null if nothing has. */
function event(/** @type {any} */ before, /** @type {any} */ row) {
  if (!before) return null;
  if (row.fault && !before.fault) return "fault";
  if (before.enabled && row.enabled === 0) return "off";
  const changed = ["setpoint", ...Object.keys(SETPOINTS)].some((name) => row[name] !== before[name]);
  return changed && row.enabled !== 0 ? "set-point" : null;
}

/** Columns by motor, with the events as marks. */
export function parse(/** @type {string} */ text) {
  const motors = [0, 1, 2, 3].map(() => ({ ...Object.fromEntries([...OF_MOTOR, "time", "battery"].map((name) => [name, /** @type {any[]} */ ([])])), marks: /** @type {any[]} */ ([]) }));
  /** @type {any[]} */
  const before = [];
  for (const row of read(text)) {
    const motor = Number(row.motor);
    const of = /** @type {any} */ (motors[motor]);
    const words = event(before[motor], row);
    if (words) of.marks.push({ at: row.time_s, words });
    const push = (/** @type {any} */ values) => {
      of.time.push(values.time_s);
      of.battery.push(values.battery_v ?? null);
      for (const name of OF_MOTOR) of[name].push(values[name] ?? null);
    };
    const last = before[motor]?.time_s ?? row.time_s;
    if (row.time_s - last > GAP_S) push({ time_s: last + GAP_S / 2 });
    push(row);
    before[motor] = row;
  }
  if (!before.length) throw new Error("the recording has no rows");
  return motors;
}

/** Name of a recording's file. */
const nameOf = (/** @type {number} */ begun, /** @type {string} */ ending) => `motor-hub-${new Date(begun).toISOString().slice(0, 19).replaceAll(":", "")}.${ending}`;

export function recordPanel() {
  /** @type {Blob[]} */
  let blobs = [];
  /** @type {string[]} */
  let recent = [];
  let [recording, frames, begun] = [false, 0, 0];
  /** Address of the hub that is recorded; `undefined` for a hub without a chain. @type {number|undefined} */
  let hub;
  /** The rows as objects, a blob at a time. */
  async function* pieces() {
    for (const blob of [...blobs, new Blob(recent.map((row) => `${row}\n`))]) {
      yield read(`${HEADINGS.join(",")}\n${await blob.text()}`).map(({ motor, time_s, ...values }) => ({ motor: Number(motor), at_s: Number(time_s), values }));
    }
  }
  const whole = () => new Blob([`${HEADINGS.join(",")}\n`, ...blobs, ...recent.map((row) => `${row}\n`)], { type: "text/csv" });
  const says = h("p", { role: "status" }, "No recording yet.");
  const toggle = h("button", { type: "button", class: "primary", "aria-pressed": "false", onclick: () => switchTo(!recording) }, "Record");
  function switchTo(/** @type {boolean} */ is) {
    recording = is;
    if (recording) [blobs, recent, frames, begun] = [[], [], 0, Date.now()];
    toggle.setAttribute("aria-pressed", String(recording));
    setText(toggle, recording ? "Stop recording" : "Record");
    emit();
    setText(says, recording ? "Recording." : frames ? `${seconds()} s of all motors are recorded.` : "No recording yet.");
  }
  const save = h("button", { type: "button", disabled: true, onclick: () => download(whole(), nameOf(begun, "csv")) }, "Save as CSV");
  const pack = h("button", { type: "button", disabled: true, onclick: async () => download(await mcap(pieces(), begun), nameOf(begun, "mcap")) }, "Save as MCAP");
  const [load, file] = chooser("Show a recording", "record-file", async (chosen) => {
    try {
      show(parse(await chosen.text()));
      setText(says, `${chosen.name} is shown in the plots; Resume live shows the hub again.`);
    } catch (error) {
      setText(says, `${chosen.name}: ${/** @type {Error} */ (error).message}`);
    }
  }, ".csv,text/csv");
  const seconds = () => (frames / FRAMES_PER_S).toFixed(0);
  function emit() {
    save.disabled = pack.disabled = !frames;
    elementById("recording").hidden = !recording;
    setText(elementById("recording"), `● Recording, ${seconds()} s`);
  }
  on("frame", (frame) => {
    if (!recording) return;
    if (!frames) hub = shownHub();
    if (shownHub() !== hub) {
      switchTo(false);
      setText(says, `Another hub is shown: the recording of the former hub has ended after ${seconds()} s.`);
      return;
    }
    frames += 1;
    recent.push(rows(frame));
    if (recent.length >= ROWS) {
      blobs.push(new Blob(recent.map((row) => `${row}\n`)));
      recent = [];
    }
    if (frames % FRAMES_PER_S === 1) emit();
  });
  return h("div", { class: "stack" }, h("div", { class: "row" }, toggle, save, pack, load, file), says, h("p", { class: "muted" }, "A recording has a row for each motor and frame, 50 frames per second: time in s, battery in V, speeds in counts/s, positions (goal: set-point) in counts, control, power and points S, T, Z, G from -1 to 1, currents in A, the kind of set-point, and what the bridge does. MCAP opens in Foxglove and PlotJuggler. A shown recording has marks where a set-point changed, a motor was switched off, or a fault came."));
}
