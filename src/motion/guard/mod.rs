//! Checks the encoder of a regulated motor by drive voltage and counts. With an encoder that is unplugged or reversed,
//! a regulated motor runs away.
//!
//! * **Reversed.** For 150 ms the control value is at the end of its range, and the bridge is in reverse. Still the
//!   motor turns in the wrong direction, or at twice the requested speed, with 160 counts/s or more, and does not slow
//!   down. With a sound encoder this takes a load of more than the stall torque. In Schemes C and D the end of the
//!   range may be less than full reverse. There the bridge gets full reverse after 100 ms, for another 100 ms. Full
//!   reverse slows down a motor with a sound encoder, and drives on a motor with a reversed one.
//! * **Stuck.** The motor does not count though it should, by its drive voltage, its acceleration and the heaviest
//!   friction. Or it turned steadily and falls silent, though it should have kept turning under its load. The encoder
//!   may be unplugged or have a broken wire, or a stop may block the motor. To decide, the motor is released, if there
//!   is time, and *probed*: driven in the other direction once. Counts mean a *stall*, which is no fault. The file
//!   `stuck.rs` has the states.
//!
//! | motor | time to a fault |
//! |---|---|
//! | turned steadily, then silent | 250 ms, at every control period |
//! | other clear cases | 250 ms from full drive voltage on |
//! | has few counts | longer, by the time that counts take |
//! | unknown, last turned in the other direction | 1 s, because a heavy motor may take that long to reverse |
//! | unknown, with fewer than 1000 counts/s at 12 V | some 4 s |
//!
//! Three kinds of motors are not checked: a motor in open loop, which needs no encoder; a motor that holds its
//! position, from which no count is due; and a motor at rest that a low battery may be unable to turn against friction.
//!
//! Constants without a stated source have none on record. `motor-hub soak --sweep` counts false alarms with them (see
//! `docs/concepts/faults.md`), and `tests/guard.rs` checks the times.
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

mod expected;
mod last_motion;
mod runaway;
mod stuck;

use crate::braking::Regime;
use crate::motion::Reading;
use crate::units::{Control, CountsPerSecond, EmfConstant, Period, Voltage};
use runaway::{Runaway, Span};
use stuck::StuckCheck;

/// Least magnitude of a control value at the end of its range: 15/16 of it. The rest is for rounding in the loop.
const FULL_CONTROL: i16 = 30_720;

/// Distance that a motor from rest should cover before missing counts matter, in counts.
const EXPECTED_COUNTS: f32 = 6.0;

/// A fault of an encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncoderFault {
    /// The encoder does not count in either direction of drive.
    Stuck,
    /// The encoder counts against the drive voltage.
    Reversed,
}

/// The command of the bridge at the last tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// Requested speed.
    pub target: CountsPerSecond,
    /// Control value of the command.
    pub control: Control,
    /// Regime of the command.
    pub regime: Regime,
    /// Drive voltage of the command: the mean voltage across the motor, positive clockwise.
    pub push: Voltage,
    /// Estimated speed at the time of the command.
    pub velocity: CountsPerSecond,
}

/// The command of the last tick, and the motion since then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// Command in force until now.
    pub order: Order,
    /// Counts since the command.
    pub moved: i32,
    /// Estimated speed now.
    pub velocity: CountsPerSecond,
    /// Battery voltage, in volts.
    pub battery: f32,
    /// Least acceleration of the motor per volt, in counts/s²; `None` for an unknown motor.
    pub gain: Option<f32>,
    /// Estimated acceleration of the motor per volt, in counts/s².
    pub volt: f32,
    /// Back EMF constant of the motor.
    pub emf: EmfConstant,
    /// True if the end of the control range may be less than full reverse.
    pub gentle: bool,
    /// True if a motor that does not turn may be probed.
    pub probing: bool,
}

impl Evidence {
    /// Counts since the command, positive in the direction of the estimated speed. The estimate may lag behind the
    /// counts.
    fn counts(&self) -> i64 {
        let moved = i64::from(self.moved);
        if self.velocity < CountsPerSecond::ZERO { -moved } else { moved }
    }

    /// True if the motor turns in the wrong direction, or at least twice as fast as requested, against full control in
    /// reverse.
    fn runs_away(&self) -> bool {
        let Order { target, control, regime, .. } = self.order;
        let (velocity, target) = (i64::from(self.velocity.to_bits()), i64::from(target.to_bits()));
        let wrong_speed = if velocity < 0 { 2 * target >= velocity } else { 2 * target <= velocity };
        wrong_speed && regime == Regime::Reverse && control.get().abs() >= FULL_CONTROL
    }
}

/// What the motor has to do at this tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// Follow the loop: no fault is found.
    Sound,
    /// Follow the loop: the motor is stalled, and its encoder is sound.
    Stalled,
    /// Brake, and wait for counts.
    Release,
    /// Apply this control value in open loop instead of the loop's.
    Probe(Control),
    /// Apply full reverse, in every scheme. The control value is the end of the range.
    Insist(Control),
    /// Stop the regulation: the encoder is at fault.
    Fault(EncoderFault),
}

/// The encoder check of one regulated motor.
#[derive(Clone, Copy, Debug)]
pub struct Guard {
    period: Period,
    stuck: StuckCheck,
    runaway: Runaway,
}

impl Guard {
    /// Creates a check that is stepped every `period`.
    pub fn new(period: Period) -> Self {
        Self { period, stuck: StuckCheck::new(period), runaway: Runaway::default() }
    }

    /// Takes a sample of the encoder, at ticks and best every millisecond between them. `load` computes the estimated
    /// disturbance: the acceleration by everything but the bridge, in counts/s².
    pub fn sample(&mut self, reading: &Reading, load: impl FnOnce() -> f32) {
        self.stuck.sample(reading, load);
    }

    /// Takes the evidence of a tick, and decides by this tick and those before.
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
        self.stuck.step(evidence)
    }

    /// Notes a new set-point. A release or a probe ends, so that it does not disturb the new motion. Returns true if
    /// there was one.
    pub fn retarget(&mut self) -> bool {
        let examining = self.stuck.is_examining();
        if examining {
            self.reset();
        }
        examining
    }

    /// Discards all evidence, as when the motor is no longer regulated.
    pub fn reset(&mut self) {
        self.stuck.reset();
        self.runaway = Runaway::default();
    }
}
