//! What a voltage does to a motor of which only the back EMF is known, learned while it works.
//!
//! Over the [cells](super::cells) of the motion the voltage that is left beside the back EMF accelerates the
//! motor, and so does its load:
//!
//! ```text
//! change of speed = b (integral of u - kappa w) + load time
//! ```
//!
//! A filter of two states, b and what the load accelerates the motor by, takes each cell for what it is worth: whole
//! counts blur the change of a speed, the load may have changed since the last cell, and friction has when the motion
//! turned. (It is the speed that is blurred, so it stands by itself on one side: an equation solved for the voltage
//! would make every heavy motor a light one.) It begins with a light motor, which makes a heavy one answer slowly
//! until it is known; the other way round it would swing.

use super::cells::{Cells, Change};
use super::loops::GUESSED_TIME_CONSTANT;
use crate::motion::Reading;
use crate::units::single::{at_least, at_most};
use crate::units::{Micros, Period};
use libm::sqrtf;

/// Mechanical time constant of any motor, in seconds.
const PLAUSIBLE: (f32, f32) = (0.01, 30.0);
/// A motor of a time constant that is longer than the guess by this is a heavy one.
const HEAVY: f32 = 1.25;
/// The shortest cell, in milliseconds.
const CELL_MS: u32 = 40;
/// From one sample of a cell to the next, at least, in microseconds.
const SAMPLE_MICROS: u64 = 9_500;
/// A cell with fewer counts than this is made longer,
const CELL_COUNTS: u32 = 8;
/// up to this, in seconds.
const LONGEST_CELL: f32 = 0.25;
/// What whole counts and edges blur a cell's way by, in counts.
const COUNTING_NOISE: f32 = 0.7;
/// Standard deviation of b, as a share, of what is no guess.
const SURE: f32 = 0.5;
/// Standard deviations, in volts: of what a bridge makes,
const OF_VOLTAGE: f32 = 0.15;
/// of the load, at first,
const OF_LOAD: f32 = 4.0;
/// of what it changes by from one cell to the next,
const LOAD_DRIFT: f32 = 0.1;
/// or over a time that says nothing. A heavier one is none.
const LOAD_CHANGE: f32 = 0.5;
const HEAVIEST_LOAD: f32 = 8.0;
/// What surprises by more than so many standard deviations comes of another load,
const SURPRISE: f32 = 2.0;
/// or is not the motor's own.
const OUTLIER: f32 = 5.0;
/// By what b may change from one cell to the next, as a share.
const DRIFT: f32 = 0.01;

/// Learns of one motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Learner {
    /// Back EMF, volts per count/s.
    kappa: f32,
    /// Shortest cell.
    shortest_micros: u64,
    /// While the motor is driven.
    cells: Option<Cells>,
    /// When the next sample is taken, and when the running cell may end.
    due: Micros,
    ends: Micros,
    /// Across the motor, since then, and the integral from the last sample of a cell until then, V s.
    voltage: f32,
    since: Micros,
    push: f32,
    /// What is known of b.
    gain: f32,
    /// What a volt accelerates the motor by, counts/s²,
    b: f32,
    /// and the load, counts/s².
    load: f32,
    variance: Variance,
}

/// Of b, of the load, and of both.
#[derive(Clone, Copy, Debug)]
struct Variance {
    b: f32,
    load: f32,
    both: f32,
}

impl Learner {
    pub(super) fn new(kappa: f32, period: Period) -> Self {
        let period = period.as_millis();
        let cell_ms = (CELL_MS / period * period).max(period);
        let b = guess(kappa);
        Self {
            kappa,
            // Half a millisecond less, for rounding.
            shortest_micros: u64::from(cell_ms) * 1_000 - 500,
            cells: None,
            due: Micros::new(0),
            ends: Micros::new(0),
            voltage: 0.0,
            since: Micros::new(0),
            push: 0.0,
            gain: b,
            b,
            load: 0.0,
            variance: Variance { b: b * b, load: square(OF_LOAD * b), both: 0.0 },
        }
    }

    /// Counts/s² per volt: of what is in doubt the lighter end, but for a guess no doubt is cast.
    pub(super) const fn gain(&self) -> f32 {
        self.gain
    }

    /// It is no guess any more.
    pub(super) fn is_sure(&self) -> bool {
        self.variance.b < square(SURE * self.b)
    }

    /// It has surely turned out to be heavier than a bare gear motor.
    pub(super) fn is_heavy(&self) -> bool {
        self.is_sure() && HEAVY * self.gain * GUESSED_TIME_CONSTANT * self.kappa < 1.0
    }

    /// Takes a sample of the encoder; some are enough.
    pub(super) fn sample(&mut self, reading: &Reading) {
        if reading.at >= self.due {
            self.take(*reading);
        }
    }

    /// The same for a cell.
    fn take(&mut self, reading: Reading) {
        self.due = later(reading.at, SAMPLE_MICROS);
        self.go_on(reading.at);
        let Some(cells) = &mut self.cells else { return };
        let passed = seconds(cells.now(), reading.at);
        if passed > 0.0 {
            cells.drive(self.push / passed);
            cells.sample(reading);
        }
        self.push = 0.0;
    }

    /// Under the same voltage.
    fn go_on(&mut self, until: Micros) {
        self.push += self.voltage * seconds(self.since, until);
        self.since = until;
    }

    /// From now on, the last sample being this one, the bridge makes this voltage of the motor; `None` if it is
    /// open.
    pub(super) fn drive(&mut self, voltage: Option<f32>, last: Option<Reading>) {
        let (Some(voltage), Some(last)) = (voltage, last) else {
            self.cells = None;
            return;
        };
        if self.cells.is_some() {
            self.go_on(last.at);
        } else {
            self.cells = Some(Cells::new(last));
            (self.push, self.since) = (0.0, last.at);
            self.ends = later(last.at, self.shortest_micros);
        }
        self.voltage = voltage;
    }

    /// One tick, this being the newest sample; returns whether something was learned.
    pub(super) fn step(&mut self, newest: Reading) -> bool {
        if self.cells.is_none() || newest.at < self.ends {
            return false;
        }
        self.take(newest);
        let Some(cells) = &mut self.cells else { return false };
        let (seconds, counts) = cells.running();
        if (1..CELL_COUNTS).contains(&counts.unsigned_abs()) && seconds < LONGEST_CELL {
            return false;
        }
        self.ends = later(newest.at, self.shortest_micros);
        match cells.close() {
            Some(change) => self.learn(&change),
            None => self.doubt_load(LOAD_CHANGE),
        }
        self.gain =
            at_most(self.b + sqrtf(at_least(self.variance.b, 0.0)), at_least(self.b, guess(self.kappa)));
        true
    }

    /// The load may have changed by so many volts.
    fn doubt_load(&mut self, volts: f32) {
        let most = square(OF_LOAD * at_least(self.b, guess(self.kappa)));
        self.variance.load = at_most(self.variance.load + square(volts * self.b), most);
    }

    /// Variance of a change of speed, as far as it comes of either unknown.
    fn expected(&self, left: f32, time: f32) -> f32 {
        let Variance { b, load, both } = self.variance;
        b * left * left + 2.0 * both * left * time + load * time * time
    }

    fn learn(&mut self, change: &Change) {
        let Change { speed, push, way, time, shorter, .. } = *change;
        let left = push - self.kappa * way;
        self.variance.b += square(DRIFT * self.b);
        self.doubt_load(LOAD_DRIFT);
        let surprise = speed - self.b * left - self.load * time;
        let blur = square(COUNTING_NOISE / shorter) + square(OF_VOLTAGE * self.b * time);
        let mut expected = self.expected(left, time) + blur;
        if square(surprise) > square(SURPRISE) * expected {
            // The load is another sooner than the motor.
            self.doubt_load(OF_LOAD);
            expected = self.expected(left, time) + blur;
        }
        let Variance { b, load, both } = self.variance;
        let of_b = b * left + both * time;
        let of_load = both * left + load * time;

        let (least, most) = PLAUSIBLE;
        let better = self.b + of_b / expected * surprise;
        let carried = self.load + of_load / expected * surprise;
        let tau = 1.0 / (better * self.kappa);
        let plausible = (least..most).contains(&tau) && carried.abs() < HEAVIEST_LOAD * better;
        if !plausible || square(surprise) > square(OUTLIER) * expected {
            // A stop, another load, or an encoder at fault.
            self.doubt_load(OF_LOAD);
            return;
        }
        self.b = better;
        self.load = carried;
        self.variance = Variance {
            b: b - of_b * of_b / expected,
            load: load - of_load * of_load / expected,
            both: both - of_b * of_load / expected,
        };
    }
}

/// From one time to another, less than an hour later.
fn seconds(from: Micros, to: Micros) -> f32 {
    to.since(from) as u32 as f32 * 1e-6
}

fn later(from: Micros, micros: u64) -> Micros {
    Micros::new(from.get().saturating_add(micros))
}

/// b of a bare gear motor.
fn guess(kappa: f32) -> f32 {
    1.0 / (GUESSED_TIME_CONSTANT * kappa)
}

const fn square(value: f32) -> f32 {
    value * value
}

#[cfg(test)]
mod tests {
    use super::*;

    const VOLTS_PER_SPEED: f32 = 0.004;
    const START: Reading = Reading { position: 0, edge_at: Micros::new(0), at: Micros::new(0) };

    fn learner(period: u32) -> Learner {
        Learner::new(VOLTS_PER_SPEED, Period::from_millis(period).unwrap_or_default())
    }

    /// What is learned of a motor of this time constant and load under voltages that change every half second.
    fn learned(period: u32, tau: f32, load: f32, volts: &[f32]) -> Learner {
        let mut learner = learner(period);
        let b = 1.0 / (tau * VOLTS_PER_SPEED);
        let (mut x, mut w) = (0.5f64, 0.0f32);
        let mut reading = START;
        learner.drive(Some(0.0), Some(reading));
        for ms in 1..=500 * volts.len() as u32 {
            let u = volts.get((ms as usize - 1) / 500).copied().unwrap_or(0.0);
            if (ms - 1) % period == 0 {
                learner.drive(Some(u), Some(reading));
            }
            for _ in 0..10 {
                w += b * (u - VOLTS_PER_SPEED * w - load) * 1e-4;
                x += f64::from(w) * 1e-4;
            }
            let at = Micros::new(u64::from(ms) * 1000);
            let position = x.floor() as i32;
            let edge_at = if position == reading.position { reading.edge_at } else { at };
            reading = Reading { position, edge_at, at };
            learner.sample(&reading);
            if ms % period == 0 {
                learner.step(reading);
            }
        }
        learner
    }

    #[test]
    fn light_and_heavy_motors_are_known_after_two_steps_of_voltage_at_every_period_and_never_for_heavier() {
        for tau in [0.05, 0.2, 1.0, 3.0] {
            for period in [1, 5, 20, 50, 100] {
                let found = 1.0 / (learned(period, tau, 0.0, &[9.0, -6.0]).gain() * VOLTS_PER_SPEED);
                assert!((0.6 * tau..1.15 * tau).contains(&found), "{found}, not {tau} s at {period} ms");
            }
        }
    }

    #[test]
    fn a_load_is_not_taken_for_inertia() {
        for load in [-2.0, 2.0] {
            let found = learned(20, 0.4, load, &[9.0, 3.0, 9.0]).gain() * VOLTS_PER_SPEED;
            assert!((found * 0.4 - 1.0).abs() < 0.25, "{found} with {load} V");
        }
    }

    #[test]
    fn a_motor_that_is_held_teaches_nothing() {
        let mut held = learner(10);
        let guess = held.gain();
        held.drive(Some(12.0), Some(START));
        for ms in 1..2_000 {
            let at = Micros::new(ms * 1000);
            let reading = Reading { at, ..START };
            held.sample(&reading);
            held.step(reading);
        }
        assert_eq!(held.gain().to_bits(), guess.to_bits());
    }
}
