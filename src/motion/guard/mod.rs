//! Is the encoder telling the truth? A regulated motor whose encoder is unplugged or reversed runs
//! away; this notices, from nothing but effort and counts.
//!
//! * **Reversed:** for 150 ms the control value is at the end of its range and the bridge in reverse, and
//!   still the motor turns the wrong way, or twice as fast as asked, at 160 counts/s or more, and does
//!   not slow down. A load that does this to a well-wired motor overpowers it by more than its stall
//!   torque. In Schemes C and D the end of the range may be less than full reverse, and a load may
//!   overpower that: there, after 100 ms, the bridge is put in full reverse for another 100 ms, which
//!   slows down a well-wired motor, and drives on one whose encoder is reversed.
//! * **Stuck:** the motor does not turn though it should, by what the bridge was told, the motor's acceleration,
//!   and the heaviest friction; or it turned evenly and falls silent, though under the load that it had it would have gone
//!   on: see `held`. An unplugged encoder, one with a broken wire, or a motor held by a stop:
//!   it is released, if there is time for that, and then driven the other way, once, to find out. A motor that is *stalled* is reported,
//!   which is no fault.
//!
//! A motor that turns evenly and whose encoder falls silent is judged within 250 ms, at every control period; so is a clear
//! case of any other, from when it is given all that it has. It takes longer where counts take longer, and of a motor of
//! which nothing is known: 1 s if it was last heard turning the wrong way, for it may be that slow to turn back, and some
//! 4 s if it has fewer than 1000 counts/s at 12 V.
//!
//! Open-loop power needs no encoder and is not watched; neither is a motor that holds its position, from which no count is
//! due, nor one at rest that all of a low battery might not turn against friction.
//!
//! ```
//! use motor_hub::braking::{Regime, Winding};
//! use motor_hub::motion::guard::{EncoderFault, Evidence, Finding, Guard, Order};
//! use motor_hub::motion::Reading;
//! use motor_hub::units::{Control, CountsPerSecond, Micros, Period, Voltage};
//!
//! let mut guard = Guard::new(Period::DEFAULT);
//! let order = Order {
//!     target: CountsPerSecond::new(1_000),
//!     control: Control::MAX,
//!     regime: Regime::Forward,
//!     push: Voltage::from_volts(12.0),
//!     velocity: CountsPerSecond::ZERO,
//! };
//! let no_counts = Evidence {
//!     order,
//!     moved: 0,
//!     velocity: CountsPerSecond::ZERO,
//!     battery: 12.0,
//!     gain: Some(1_500.0),
//!     volt: 1_500.0,
//!     emf: Winding::NEVEREST_60.emf,
//!     gentle: false,
//!     probing: true,
//! };
//! let findings = [40, 90, 140, 190].map(|ms| {
//!     let at = Micros::new(1_000 * ms);
//!     guard.sample(&Reading { position: 0, edge_at: Micros::new(0), at }, || 0.0);
//!     guard.step(&no_counts)
//! });
//! assert_eq!(findings[..2], [Finding::Sound, Finding::Release]);
//! assert!(matches!(findings[2], Finding::Probe(_)));
//! assert_eq!(findings[3], Finding::Fault(EncoderFault::Stuck));
//! ```

mod heard;
mod held;
mod runaway;

use crate::braking::Regime;
use crate::motion::Reading;
use crate::units::{Control, CountsPerSecond, EmfConstant, Period, Voltage};
use held::Held;
use runaway::{Runaway, Span};

/// Effort of a motor that is given all: the end of the control range, but for what the loop's rounding
/// leaves.
const FULL_EFFORT: i16 = 30_720;

/// Way that is due before it is missed, in counts.
const DUE_COUNTS: f32 = 6.0;

/// What is wrong with an encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncoderFault {
    /// No counts under effort, in neither direction.
    Stuck,
    /// Counts against the effort.
    Reversed,
}

/// What the bridge was told at the last tick, and for what speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// Speed that was asked for.
    pub target: CountsPerSecond,
    /// Control value,
    pub control: Control,
    /// its regime,
    pub regime: Regime,
    /// and the voltage across the motor that it meant.
    pub push: Voltage,
    /// Speed at that time.
    pub velocity: CountsPerSecond,
}

/// What was ordered, and what came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// In force until now.
    pub order: Order,
    /// Counts that came meanwhile.
    pub moved: i32,
    /// Speed after them.
    pub velocity: CountsPerSecond,
    /// Of the battery, in volts.
    pub battery: f32,
    /// What a volt accelerates the motor by at least, in counts/s², if that is known.
    pub gain: Option<f32>,
    /// What a volt is thought to accelerate it by, in counts/s².
    pub volt: f32,
    /// Its back EMF.
    pub emf: EmfConstant,
    /// The end of the control range may be less than full reverse.
    pub gentle: bool,
    /// A motor that does not turn may be driven the other way to find out why.
    pub probing: bool,
}

impl Evidence {
    /// Counts the way that it is thought to turn: an estimate may lag behind them.
    fn counts(&self) -> i64 {
        let moved = i64::from(self.moved);
        if self.velocity < CountsPerSecond::ZERO { -moved } else { moved }
    }

    /// The motor turns the wrong way, or at least twice as fast as asked, against all that control can do.
    fn runs_away(&self) -> bool {
        let Order { target, control, regime, .. } = self.order;
        let (velocity, target) = (i64::from(self.velocity.to_bits()), i64::from(target.to_bits()));
        let astray = if velocity < 0 { 2 * target >= velocity } else { 2 * target <= velocity };
        astray && regime == Regime::Reverse && control.get().abs() >= FULL_EFFORT
    }
}

/// What to do about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// Nothing is wrong, or not yet.
    Sound,
    /// Held against a stop; nothing is wrong with the encoder.
    Stalled,
    /// Brake, to see whether anything moves the motor.
    Release,
    /// Use this control value instead of the loop's.
    Probe(Control),
    /// Put the bridge in full reverse, whatever the scheme says to this control value, the end of its range.
    Insist(Control),
    /// Stop using the encoder.
    Fault(EncoderFault),
}

/// Watches one regulated motor.
#[derive(Clone, Copy, Debug)]
pub struct Guard {
    period: Period,
    held: Held,
    runaway: Runaway,
}

impl Guard {
    /// For a motor that is stepped every `period`. Nothing is suspected.
    pub fn new(period: Period) -> Self {
        Self { period, held: Held::new(period), runaway: Runaway::default() }
    }

    /// Takes a sample of the encoder between two ticks and at them, best every millisecond, and what besides the bridge is
    /// thought to accelerate the motor then, in counts/s².
    pub fn sample(&mut self, reading: &Reading, load: impl FnOnce() -> f32) {
        self.held.sample(reading, load);
    }

    /// What a tick says of the encoder, together with those before it.
    pub fn step(&mut self, evidence: &Evidence) -> Finding {
        if evidence.runs_away() {
            let tick = Span { ms: self.period.as_millis().into(), counts: evidence.counts() };
            let finding = self.runaway.step(tick, evidence);
            if finding != Finding::Sound {
                return finding;
            }
        } else if self.runaway.has_begun() {
            self.runaway = Runaway::default();
        }
        self.held.step(evidence)
    }

    /// Another thing is asked of the motor: one that is being examined is not driven on because of that. Returns
    /// whether it was.
    pub fn retarget(&mut self) -> bool {
        let examining = self.held.is_examining();
        if examining {
            self.reset();
        }
        examining
    }

    /// Suspects nothing any more, as when the motor is no longer regulated.
    pub fn reset(&mut self) {
        self.held.reset();
        self.runaway = Runaway::default();
    }
}
