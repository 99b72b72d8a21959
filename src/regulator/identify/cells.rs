//! From samples of the encoder to rows of the fit: what voltage, drag, friction and load would have made of
//! the mean speed from one stretch of the motion, a cell, to the next.
//!
//! With w the mean speed of a cell, F the running integral of the voltage and P the position, means over the
//! cells obey the motor's own equation exactly, whatever the voltage did meanwhile:
//!
//! ```text
//! w' - w = b (F' - F) - q (P' - P) - c b sign(w) G + load
//! ```

use super::fit::Row;
use crate::motion::Reading;
use crate::units::Micros;

/// Cells in which the motor moved less than this are left out.
const LEAST_COUNTS: f32 = 2.0;
/// Seconds between two samples.
const SAMPLE: f32 = 1e-3;

/// Where the running cell began, and what has been summed in it.
#[derive(Clone, Copy, Debug)]
struct Cell {
    start: i32,
    /// Of the position at its start, within the count.
    place: f32,
    seconds: f32,
    /// Of the voltage since the cell began, V s, and the integral of that.
    push: f32,
    push_sum: f32,
    /// Integral of the counts since the cell began.
    way_sum: f32,
}

impl Cell {
    const fn new(start: i32, place: f32) -> Self {
        Self { start, place, seconds: 0.0, push: 0.0, push_sum: 0.0, way_sum: 0.0 }
    }
}

/// A cell that is over.
#[derive(Clone, Copy, Debug)]
struct Whole {
    cell: Cell,
    speed: f32,
    /// Counts.
    moved: f32,
}

/// The samples of a motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    origin: i32,
    began: Micros,
    last: Reading,
    /// The direction of the last count.
    direction: f32,
    voltage: f32,
    cell: Cell,
    before: Option<Whole>,
}

impl Cells {
    pub(super) const fn new(reading: Reading) -> Self {
        Self {
            origin: reading.position,
            began: reading.at,
            last: reading,
            direction: 0.0,
            voltage: 0.0,
            cell: Cell::new(reading.position, 0.5),
            before: None,
        }
    }

    /// From now on the bridge makes this voltage of the motor.
    pub(super) const fn drive(&mut self, voltage: f32) {
        self.voltage = voltage;
    }

    /// Counts since the first sample.
    pub(super) const fn moved(&self) -> i32 {
        self.last.position.wrapping_sub(self.origin)
    }

    /// The time of the last sample.
    pub(super) const fn now(&self) -> Micros {
        self.last.at
    }

    /// Of the running cell: seconds and counts.
    pub(super) const fn running(&self) -> (f32, i32) {
        (self.cell.seconds, self.last.position.wrapping_sub(self.cell.start))
    }

    /// Since the last count, or the first sample.
    pub(super) fn still_ms(&self) -> f32 {
        let since = if self.direction == 0.0 { self.began } else { self.last.edge_at };
        self.last.at.since(since) as f32 / 1000.0
    }

    /// One more sample.
    pub(super) fn sample(&mut self, reading: Reading) {
        let seconds = reading.at.since(self.last.at) as f32 * 1e-6;
        let Cell { start, .. } = self.cell;
        let [from, to] = [self.last, reading].map(|reading| reading.position.wrapping_sub(start) as f32);
        self.cell.way_sum += (from + to) / 2.0 * seconds;
        self.cell.push_sum += (self.cell.push + self.voltage * seconds / 2.0) * seconds;
        self.cell.push += self.voltage * seconds;
        self.cell.seconds += seconds;
        if from != to {
            self.direction = 1.0f32.copysign(to - from);
        }
        self.last = reading;
    }

    /// Ends the running cell; returns a row if it and the one before it make one, and
    /// the length of the shorter of the two. `emf` is the
    /// back EMF in volts per count/s; `span` the counts that the motion may take.
    pub(super) fn close(&mut self, emf: f32, span: f32) -> Option<(Row, f32)> {
        let cell = self.cell;
        let counts = self.last.position.wrapping_sub(cell.start) as f32;
        let rough = counts / cell.seconds;
        // Its speed at the end, if it goes on as it came.
        let ahead = self.before.map_or(0.0, |before| (rough - before.speed) / 2.0);
        let place = self.place(rough + ahead);
        let moved = counts + place - cell.place;
        let whole = Whole { cell, speed: moved / cell.seconds, moved: counts };
        let row = self.before.and_then(|before| row(&before, &whole, emf, span, self.origin));
        self.before = Some(whole);
        self.cell = Cell::new(self.last.position, place);
        row
    }

    /// Where within its count the shaft is, by the time since it came.
    fn place(&self, speed: f32) -> f32 {
        let since = self.last.at.since(self.last.edge_at) as f32 * 1e-6;
        let speed = speed.abs();
        let passed = (speed * since + (speed * SAMPLE).min(1.0) / 2.0).min(1.0);
        if self.direction > 0.0 {
            passed
        } else if self.direction < 0.0 {
            1.0 - passed
        } else {
            0.5
        }
    }
}

/// What the way from one cell to the next says, in counts of the shorter of the two, whose noise is then
/// the same for all; each unknown is an acceleration per volt.
fn row(from: &Whole, to: &Whole, emf: f32, span: f32, origin: i32) -> Option<(Row, f32)> {
    let enough = |whole: &Whole| whole.moved.abs() > LEAST_COUNTS;
    if !(enough(from) && enough(to) && from.speed * to.speed > 0.0) {
        return None;
    }
    let (a, b) = (&from.cell, &to.cell);
    let [way_before, way_after] = [a, b].map(|cell| cell.way_sum / cell.seconds);
    let push = a.push - a.push_sum / a.seconds + b.push_sum / b.seconds;
    let way = from.moved - way_before + way_after;
    let time = f32::midpoint(a.seconds, b.seconds);
    let start = b.start.wrapping_sub(origin) as f32;
    let place = start + f32::midpoint(way_before - from.moved, way_after);
    let side = 1.0f32.copysign(to.speed);
    let row = [push, -emf * way, -side * time, time, -place / span * time, to.speed - from.speed];
    let shorter = a.seconds.min(b.seconds);
    Some((row.map(|value| value * shorter), shorter))
}
