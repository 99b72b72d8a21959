// Values of the last minute for the plots: an array of numbers for each quantity.

/** Number of frames kept: one minute at 50 frames per second. */
export const KEPT = 3000;

/** Time between two frames from which nothing is drawn between them, in seconds. */
export const GAP_S = 0.5;

/** Quantities of a motor. `target` is a speed, `goal` a position. */
export const OF_MOTOR = ["velocity", "target", "position", "goal", "control", "s", "t", "z", "g", "current", "load", "measured"];

/** Values of one quantity, null where unknown; the last KEPT are available. */
class Column {
  constructor() {
    /** @type {(number|null)[]} */
    this.values = [];
  }
  /** @param {number|null} value */
  push(value) {
    this.values.push(value);
    // Old values are dropped in blocks, because dropping them singly would copy the array every time.
    if (this.values.length >= 2 * KEPT) this.values.splice(0, KEPT);
  }
  last() {
    return this.values.slice(-KEPT);
  }
}

export class History {
  constructor() {
    this.clear();
  }

  clear() {
    this.time = new Column();
    this.battery = new Column();
    this.motors = [0, 1, 2, 3].map(() => Object.fromEntries(OF_MOTOR.map((name) => [name, new Column()])));
    this.length = 0;
  }

  /** @param {any} frame */
  push(frame) {
    const before = this.time.values.at(-1) ?? frame.at_s;
    if (frame.at_s - before > GAP_S) this.push({ at_s: before + GAP_S / 2, motors: [] });
    this.length += 1;
    this.time.push(frame.at_s);
    this.battery.push(frame.battery_v ?? null);
    this.motors.forEach((columns, index) => {
      const motor = frame.motors[index] ?? {};
      const [s, t, z, g] = motor.points ?? [];
      const target = motor.setpoint === "velocity" ? motor.target : null;
      const goal = motor.setpoint === "position" || motor.setpoint === "together" ? motor.target : null;
      const row = { velocity: motor.velocity, target, position: motor.position, goal, control: motor.control, s, t, z, g, current: motor.modelled_a, load: motor.load_a, measured: motor.measured_a };
      for (const name of OF_MOTOR) columns[name].push(row[name] ?? null);
    });
  }
}
