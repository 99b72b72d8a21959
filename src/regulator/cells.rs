//! From samples of the encoder to what voltage, drag, friction and load could have made of the mean speed from
//! one stretch of the motion, a cell, to the next.
//!
//! With w the mean speed of a cell, F the running integral of the voltage and P the position, means over the
//! cells obey the motor's own equation exactly, whatever the voltage did meanwhile:
//!
//! ```text
//! w' - w = b (F' - F) - q (P' - P) - c b sign(w) G + load
//! ```

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

    /// Ends the running cell; returns what came of it since the one before, if the motor moved in both, and the
    /// same way.
    pub(super) fn close(&mut self) -> Option<Change> {
        let cell = self.cell;
        let counts = self.last.position.wrapping_sub(cell.start) as f32;
        let rough = counts / cell.seconds;
        // Its speed at the end, if it goes on as it came.
        let ahead = self.before.map_or(0.0, |before| (rough - before.speed) / 2.0);
        let place = self.place(rough + ahead);
        let moved = counts + place - cell.place;
        let whole = Whole { cell, speed: moved / cell.seconds, moved: counts };
        let change = self.before.and_then(|before| change(&before, &whole, self.origin));
        self.before = Some(whole);
        self.cell = Cell::new(self.last.position, place);
        change
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

/// What came of the motion from one cell to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    /// Of the mean speed, counts/s.
    pub(super) speed: f32,
    /// Of the integral of the voltage, V s.
    pub(super) push: f32,
    /// Of the mean position, counts.
    pub(super) way: f32,
    /// The mean position, counts from the first sample.
    pub(super) place: f32,
    /// Seconds from the middle of one to that of the other.
    pub(super) time: f32,
    /// Seconds that the shorter of the two took. Whole counts blur the speed by some 0.7 in this time.
    pub(super) shorter: f32,
    /// 1 forward, -1 backward.
    pub(super) side: f32,
}

fn change(from: &Whole, to: &Whole, origin: i32) -> Option<Change> {
    let enough = |whole: &Whole| whole.moved.abs() > LEAST_COUNTS;
    if !(enough(from) && enough(to) && from.speed * to.speed > 0.0) {
        return None;
    }
    let (a, b) = (&from.cell, &to.cell);
    let [before, after] = [a, b].map(|cell| cell.way_sum / cell.seconds);
    let start = b.start.wrapping_sub(origin) as f32;
    Some(Change {
        speed: to.speed - from.speed,
        push: a.push - a.push_sum / a.seconds + b.push_sum / b.seconds,
        way: from.moved - before + after,
        place: start + f32::midpoint(before - from.moved, after),
        time: f32::midpoint(a.seconds, b.seconds),
        shorter: a.seconds.min(b.seconds),
        side: 1.0f32.copysign(to.speed),
    })
}
