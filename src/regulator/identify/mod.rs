//! Identifies a motor with its load by a short motion at three constant voltages, and by a least-squares fit of the
//! motor's equation.
//!
//! ```text
//! rest 0.2 s | +65 % of the battery voltage 1.1 s | -65 % 1.1 s | +29 % 0.6 s | the bridge is open
//! ```
//!
//! A client shows the largest travel of the motion in either direction, in counts, before the motion (see [`travel`]).
//! The largest travel follows from the configured back EMF. A smaller travel limit shortens the motion in proportion.
//! If the motor has hardly moved by the end of the first phase, all phases become longer, up to eight times; the
//! largest travel stays. Another set-point ends the motion.
//!
//! The fit finds acceleration per volt, decay and friction. The fit also finds a constant load and a spring; both are
//! reasons to [refuse](Refusal) a result. Other reasons are an encoder that sends no counts or counts in the wrong
//! direction, a stop, and a motion that does not fit the equation. A result does not change the settings of the motor.
//! A host may configure the result.
//!
//! The fit is in single precision, a row at a time and by rotations, so a chip's FPU can compute it while the motor
//! turns.
//!
//! The gain of a configured motor is not estimated while the motor runs. Such an estimate has an error of some 10 %,
//! which is worse than exact constants. With the estimate 1.7 % of random responses never settled, with exact constants
//! 0.3 %. For an unknown motor the estimate is better than the initial guess.
//!
//! ```
//! use motor_hub::braking::Winding;
//! use motor_hub::regulator::identify::travel;
//! use motor_hub::units::Millivolts;
//!
//! // A NeveRest 60 on 12 V: less than one and a half turns of its output shaft.
//! let counts = travel(Winding::NEVEREST_60.emf, Millivolts::new(12_000), u32::MAX);
//! assert_eq!(counts, 2_474);
//! ```

mod fit;
mod outcome;
mod segments;
mod verdict;

pub use outcome::{Identification, Identified, Refusal};

use crate::motion::Reading;
use crate::units::{EmfConstant, Micros, Millivolts, Period, Voltage};
use segments::Segments;
use verdict::Regression;

/// A phase of the motion, with a constant voltage.
struct Phase {
    /// Voltage as a share of the battery voltage.
    share: f32,
    /// Planned duration, in ms.
    ms: f32,
}

/// Phases of the motion: up to speed, reversed, and slower in the first direction.
const PHASES: [Phase; 3] = [
    Phase { share: 0.65, ms: 1_100.0 },
    Phase { share: -0.65, ms: 1_100.0 },
    Phase { share: 0.29, ms: 600.0 },
];
/// Duration of all phases, in ms.
const MOTION_MS: f32 = 2_800.0;
/// Largest travel of a motor in these phases, divided by the speed at which the back EMF equals the battery voltage, in
/// s. The motor turns at 65 % of this speed for at most 1.1 s. The factor 1.15 allows for a configured back EMF that is
/// too large.
const TRAVEL_S: f32 = 1.15 * 0.65 * 1.1;
/// Time in ms before the motion, with the bridge open, in which the motor must not turn.
const REST_MS: u32 = 200;
/// Shortest duration of a segment, in ms.
const SEGMENT_MS: u32 = 40;
/// Counts below which a segment is made longer, up to [`LONGEST_SEGMENT_S`].
const SEGMENT_COUNTS: u32 = 5;
/// Longest duration of a segment, in s.
const LONGEST_SEGMENT_S: f32 = 0.5;
/// Least number of segments in the planned motion. A travel limit that leaves fewer segments is refused.
const LEAST_SEGMENTS: f32 = 16.0;
/// Counts from which on the first phase ends as planned; with fewer counts the phase is made longer. A quarter of the
/// announced travel is enough too.
const FIRST_PHASE_COUNTS: f32 = 100.0;
/// Longest duration of the first phase, in ms.
const LONGEST_FIRST_PHASE_MS: f32 = 8_800.0;
/// Least battery voltage, in V.
const LEAST_VOLTS: f32 = 6.0;
/// Largest sag of the battery voltage under the motor's current, as a share of the battery voltage before the motion.
const LARGEST_SAG: f32 = 0.3;
/// Time in ms without a count after which the identification of a fast motor is refused.
const STALLED_MS: f32 = 300.0;
/// Speed in counts/s above which a motor is fast; slower motors are slow.
const FAST_CPS: f32 = 50.0;
/// Time in ms without a count after which the identification of a slow motor is refused, for phases of planned
/// duration. With shorter or longer phases the time is shorter or longer in proportion, but at least [`STALLED_MS`].
/// During this time the hub does not notice the travel of a motor whose encoder is broken.
const SLOW_STALLED_MS: f32 = 1_000.0;
/// Counts by which the shaft may vibrate beyond the announced travel, or turn backwards at the beginning.
const VIBRATION_COUNTS: i32 = 3;

/// Largest travel of a motor in either direction while the motor is identified, in counts: the smaller one of `limit`
/// and the travel that a battery voltage makes possible.
pub fn travel(emf: EmfConstant, battery: Millivolts, limit: u32) -> u32 {
    (full_travel(emf.to_volts(), battery.to_volts()) as u32).min(limit)
}

/// Least travel limit that is not refused, in counts. A hub that estimates another back EMF or measures another battery
/// voltage may need a little more.
pub fn least_travel(emf: EmfConstant, battery: Millivolts, period: Period) -> u32 {
    let share = LEAST_SEGMENTS * shortest_segment_ms(period) / MOTION_MS;
    (share * full_travel(emf.to_volts(), battery.to_volts())) as u32 + 1
}

/// Shortest duration of a segment: whole control periods, in ms.
fn shortest_segment_ms(period: Period) -> f32 {
    let period = period.as_millis();
    (SEGMENT_MS / period * period).max(period) as f32
}

/// Largest travel in counts without a travel limit. `emf` is the back EMF constant in V per count/s, and `battery` is
/// in V.
fn full_travel(emf: f32, battery: f32) -> f32 {
    TRAVEL_S * battery / emf
}

/// An identification that runs.
///
/// ```text
/// Resting ── at rest for 0.2 s ──▶ Moving ── all phases over ──▶ Identification::Found
///    │                               │
///    └──── any reason to refuse ─────┴─────────────────────────▶ Identification::Refused
/// ```
#[derive(Clone, Copy, Debug)]
pub enum Identifier {
    /// The bridge is open, to find out whether the motor is at rest.
    Resting {
        /// Travel limit, in counts.
        limit: u32,
        /// Sample at the first step; `None` before the first step.
        since: Option<Reading>,
        /// Last sample; `None` before the first sample.
        last: Option<Reading>,
    },
    /// The motor is driven.
    Moving(Excitation),
}

/// The motion by which a motor is identified.
#[derive(Clone, Copy, Debug)]
pub struct Excitation {
    /// Ratio of the durations of all phases to the planned durations.
    scale: f32,
    /// Shortest duration of a segment, in s.
    segment_s: f32,
    /// Index of the present phase.
    phase: usize,
    /// Time at which the present phase began.
    began: Micros,
    segments: Segments,
    regression: Regression,
    /// True if the speed of the last segment was above [`FAST_CPS`].
    fast: bool,
}

impl Identifier {
    /// Creates an identification that begins at its first step. `limit` is the travel limit, as for [`travel`].
    pub const fn new(limit: u32) -> Self {
        Self::Resting { limit, since: None, last: None }
    }

    /// Progress of the identification.
    pub fn progress(&self) -> Identification {
        Identification::Running(match self {
            Self::Resting { .. } => 0,
            Self::Moving(excitation) => excitation.percent(),
        })
    }

    /// Takes a sample of the encoder. The result is best with a sample every millisecond.
    pub fn sample(&mut self, reading: &Reading) {
        match self {
            Self::Resting { last, .. } => *last = Some(*reading),
            Self::Moving(excitation) => excitation.segments.sample(*reading),
        }
    }

    /// Sets the voltage that the bridge applies from now on.
    pub const fn drive(&mut self, voltage: Voltage) {
        if let Self::Moving(excitation) = self {
            excitation.segments.set_voltage(voltage.to_volts());
        }
    }

    /// Executes a tick. Must be called after the newest sample of the tick was taken. Returns the voltage until the
    /// next tick; `None` for an open bridge. `battery` is in V.
    ///
    /// # Errors
    /// Returns the outcome, found or refused, if the identification has ended.
    pub fn step(
        &mut self,
        emf: EmfConstant,
        battery: f32,
        period: Period,
    ) -> Result<Option<Voltage>, Identification> {
        let share = match self {
            Self::Resting { limit, since, last } => {
                let limit = *limit;
                let Some(reading) = rest(since, *last)? else { return Ok(None) };
                *self = Self::Moving(Excitation::new(emf.to_volts(), battery, limit, period, reading)?);
                let [Phase { share, .. }, ..] = PHASES;
                share
            }
            Self::Moving(excitation) => excitation.step(battery)?,
        };
        Ok(Some(Voltage::from_volts(share * battery)))
    }
}

/// Returns the last sample if the motor has been at rest for [`REST_MS`]; `None` if the time is not over. The first
/// call stores the last sample in `since`. A motor that has moved by more than one count from this sample is refused.
fn rest(since: &mut Option<Reading>, last: Option<Reading>) -> Result<Option<Reading>, Identification> {
    let Some(last) = last else { return Err(Identification::Refused(Refusal::Interrupted)) };
    let since = since.get_or_insert(last);
    if last.position.wrapping_sub(since.position).unsigned_abs() > 1 {
        return Err(Identification::Refused(Refusal::NotAtRest));
    }
    Ok(Some(last).filter(|last| last.at.since(since.at) >= u64::from(1000 * REST_MS)))
}

impl Excitation {
    fn new(
        emf: f32,
        battery: f32,
        limit: u32,
        period: Period,
        reading: Reading,
    ) -> Result<Self, Identification> {
        let full = full_travel(emf, battery);
        let announced_travel = full.min(limit as f32);
        let segment_ms = shortest_segment_ms(period);
        let scale = announced_travel / full;
        if battery < LEAST_VOLTS {
            return Err(Identification::Refused(Refusal::Battery));
        }
        if scale * MOTION_MS < LEAST_SEGMENTS * segment_ms {
            return Err(Identification::Refused(Refusal::TravelLimit));
        }
        Ok(Self {
            scale,
            // Half a millisecond less allows for rounding.
            segment_s: (segment_ms - 0.5) / 1000.0,
            phase: 0,
            began: reading.at,
            segments: Segments::new(reading),
            regression: Regression::new(emf, battery, announced_travel),
            fast: false,
        })
    }

    /// Executes a tick of the motion. Returns the share of the battery voltage until the next tick, or the outcome as
    /// an error.
    fn step(&mut self, battery: f32) -> Result<f32, Identification> {
        self.check(battery).map_err(Identification::Refused)?;
        let (seconds, counts) = self.segments.running();
        if seconds > self.segment_s * self.segment_stretch()
            && (counts.unsigned_abs() >= SEGMENT_COUNTS || seconds > LONGEST_SEGMENT_S)
        {
            self.fast = counts.unsigned_abs() as f32 > FAST_CPS * seconds;
            if let Some(change) = self.segments.end() {
                self.regression.add(&change);
            }
        }
        if let Some(phase) = PHASES.get(self.phase)
            && self.is_over(phase.ms)
        {
            self.phase += 1;
            self.began = self.segments.now();
        }
        match PHASES.get(self.phase) {
            Some(phase) => Ok(phase.share),
            None => Err(self.regression.result().map_or_else(Identification::Refused, Identification::Found)),
        }
    }

    /// Refuses the motion if battery voltage, travel, direction or time without a count is out of its limits.
    fn check(&self, battery: f32) -> Result<(), Refusal> {
        let moved = self.segments.moved();
        let stalled_ms = if self.fast { STALLED_MS } else { (SLOW_STALLED_MS * self.scale).max(STALLED_MS) };
        if battery < LEAST_VOLTS.max((1.0 - LARGEST_SAG) * self.regression.battery) {
            Err(Refusal::Battery)
        } else if self.phase == 0 && moved < -VIBRATION_COUNTS {
            Err(Refusal::Backwards)
        } else if moved.saturating_abs().saturating_sub(VIBRATION_COUNTS) as f32
            > self.regression.announced_travel
        {
            Err(Refusal::TooFar)
        } else if self.segments.still_ms() >= stalled_ms {
            // The motor has turned in the phases before the last one.
            let last = self.phase + 1 == PHASES.len();
            Err(if last { Refusal::HeldAtLowVoltage } else { Refusal::NoCounts })
        } else {
            Ok(())
        }
    }

    /// Lengthens the phases if the motor is slow. Returns true if the present phase, with this planned length in ms, is
    /// over. If the first phase was made longer, the other phases become longer by the same factor.
    fn is_over(&mut self, length: f32) -> bool {
        let ms = self.phase_ms();
        if self.phase == 0 {
            let enough = FIRST_PHASE_COUNTS.min(self.regression.announced_travel / 4.0);
            if (self.segments.moved() as f32) < enough && ms < LONGEST_FIRST_PHASE_MS {
                return false;
            }
            self.scale = self.scale.max(ms / length);
        }
        // Ticks come at whole milliseconds.
        ms + 0.5 > self.scale * length
    }

    /// Factor by which a segment lasts longer than planned, at least 1. A segment is made longer by the same factor as
    /// the present phase.
    fn segment_stretch(&self) -> f32 {
        let [Phase { ms: length, .. }, ..] = PHASES;
        let present = if self.phase == 0 { self.phase_ms() / length } else { 0.0 };
        self.scale.max(present).max(1.0)
    }

    /// Time since the present phase began, in ms.
    fn phase_ms(&self) -> f32 {
        self.segments.now().since(self.began) as f32 / 1000.0
    }

    /// Progress of the motion, 0 to 99 percent.
    fn percent(&self) -> u8 {
        let before: f32 = PHASES.iter().take(self.phase).map(|phase| phase.ms).sum();
        let length = PHASES.get(self.phase).map_or(0.0, |phase| phase.ms);
        let passed = before + (self.phase_ms() / self.scale).min(length);
        ((100.0 * passed / MOTION_MS) as u8).min(99)
    }
}
