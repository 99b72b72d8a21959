//! What a motor and its load are, learned from a short motion: three held voltages, and one least-squares
//! fit of the motor's own equation.
//!
//! ```text
//! rest 0.2 s | +65 % of the battery's voltage 1.1 s | -65 % 1.1 s | +29 % 0.6 s | the bridge is open
//! ```
//!
//! From the back EMF that it was told the hub says beforehand how many counts the motor will turn at most, either
//! way ([`travel`]); a limit of travel shortens the motion in proportion. A motor that has hardly moved by the
//! end of the first stretch is given longer, up to eight times, with no more travel. Anything else that is
//! asked of the motor ends it.
//!
//! What is fitted besides acceleration per volt, decay and friction is a constant load and a spring: both
//! are reasons to [refuse](Refusal), as are an encoder that does not count or counts backwards, a stop on
//! the way, and a motion that the equation does not explain. What is found is proposed, not put in force.
//!
//! The fit is in single precision, a row at a time and by rotations, which a chip's FPU does while the motor
//! turns; sums of products would have needed double precision (see `fit`).
//!
//! A motor that was told, from here or by its maker, is not followed any further while it works: from what a
//! working motor shows, its acceleration per volt is found to within some 10 %, by which an exact one gets worse
//! (1.7 % of drawn responses never settled, not 0.3 %). Of a motor of which nobody told it is worth a lot.
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
mod verdict;

pub use outcome::{Identification, Identified, Refusal};

use super::cells::Cells;
use crate::motion::Reading;
use crate::units::{EmfConstant, Micros, Millivolts, Period, Voltage};
use verdict::Evidence;

/// Shares of the battery's voltage, and for how many milliseconds.
const MOTION: [(f32, f32); 3] = [(0.65, 1_100.0), (-0.65, 1_100.0), (0.29, 600.0)];
/// All of them.
const MOTION_MS: f32 = 2_800.0;
/// Of the way at the speed whose back EMF is the battery's voltage, in seconds, with 15 % for a back EMF that is
/// not quite as told: no motor goes further under these voltages.
const TRAVEL_SECONDS: f32 = 1.15 * 0.65 * 1.1;
/// The bridge is open for so long, in which the motor must not turn.
const REST_MS: u32 = 200;
/// The shortest cell.
const CELL_MS: u32 = 40;
/// Cells with fewer counts than this are made longer,
const CELL_COUNTS: u32 = 5;
/// up to this, in seconds.
const LONGEST_CELL: f32 = 0.5;
/// Cells of the shortest motion.
const LEAST_CELLS: f32 = 16.0;
/// A first stretch with fewer counts than this, or a quarter of the travel, is made longer,
const ENOUGH_COUNTS: f32 = 100.0;
/// up to this.
const LONGEST_STRETCH_MS: f32 = 8_800.0;
/// Battery voltage, at least,
const LEAST_VOLTS: f32 = 6.0;
/// and share of it that may be lost under the motor's current.
const LARGEST_SAG: f32 = 0.3;
/// No counts for so long are none at all, of a motor that was faster than 50 counts/s before;
const HELD_MS: f32 = 300.0;
const QUICK: f32 = 50.0;
/// for so long, of any other, before it would have gone its way unseen.
const LONGEST_HELD_MS: f32 = 1_000.0;
/// Counts that a motor may be beyond a limit by the trembling of its shaft.
const TREMBLING: i32 = 3;

/// Counts from its place, either way, that a motor will turn at most while it is identified: `limit`, or
/// what it could at a battery voltage.
pub fn travel(emf: EmfConstant, battery: Millivolts, limit: u32) -> u32 {
    (full_travel(emf.to_volts(), battery.to_volts()) as u32).min(limit)
}

fn full_travel(emf: f32, battery: f32) -> f32 {
    TRAVEL_SECONDS * battery / emf
}

/// Identifies one motor, when it is asked to.
#[derive(Clone, Copy, Debug)]
pub struct Identifier {
    period: Period,
    state: Identification,
    stage: Stage,
}

#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is no heap")]
enum Stage {
    Idle,
    Resting { limit: u32, since: Option<Reading>, last: Option<Reading> },
    Moving(Motion),
}

/// A motion under way.
#[derive(Clone, Copy, Debug)]
struct Motion {
    /// Volts, before it began.
    battery: f32,
    /// Counts that were announced.
    span: f32,
    /// Of the lengths of its stretches.
    scale: f32,
    /// Shortest, in seconds.
    cell: f32,
    stretch: usize,
    /// Since the stretch began.
    began: Micros,
    cells: Cells,
    evidence: Evidence,
    /// Speed of the last cell was more than [`QUICK`].
    quick: bool,
}

impl Identifier {
    /// For a motor that is stepped every `period`.
    pub const fn new(period: Period) -> Self {
        Self { period, state: Identification::None, stage: Stage::Idle }
    }

    /// What has become of it.
    pub const fn state(&self) -> Identification {
        self.state
    }

    /// True while it is under way.
    pub const fn is_running(&self) -> bool {
        matches!(self.state, Identification::Running(_))
    }

    /// Begins at the next step; see [`travel`] for the limit.
    pub const fn start(&mut self, limit: u32) {
        self.state = Identification::Running(0);
        self.stage = Stage::Resting { limit, since: None, last: None };
    }

    /// Ends it, if it is under way.
    pub const fn stop(&mut self, why: Refusal) {
        if self.is_running() {
            self.end(Identification::Refused(why));
        }
    }

    const fn end(&mut self, outcome: Identification) {
        self.state = outcome;
        self.stage = Stage::Idle;
    }

    /// Takes a sample of the encoder, best every millisecond.
    pub fn sample(&mut self, reading: &Reading) {
        match &mut self.stage {
            Stage::Idle => (),
            Stage::Resting { last, .. } => *last = Some(*reading),
            Stage::Moving(motion) => motion.cells.sample(*reading),
        }
    }

    /// What the bridge makes of it until the next step: this voltage across the motor, or nothing.
    pub const fn drive(&mut self, voltage: Option<Voltage>) {
        if let Stage::Moving(motion) = &mut self.stage {
            match voltage {
                Some(voltage) => motion.cells.drive(voltage.to_volts()),
                None => self.stop(Refusal::Interrupted),
            }
        }
    }

    /// One tick, with the newest sample taken and `battery` in volts: the voltage until the next one, or `None` to coast.
    pub fn step(&mut self, emf: EmfConstant, battery: f32) -> Option<Voltage> {
        let next = match &mut self.stage {
            Stage::Idle => return None,
            Stage::Resting { limit, since, last } => {
                let limit = *limit;
                rest(since, *last).and_then(|over| {
                    let Some(reading) = over else { return Ok(None) };
                    let motion = Motion::new(emf.to_volts(), battery, limit, self.period, reading)?;
                    let [(share, _), ..] = MOTION;
                    self.stage = Stage::Moving(motion);
                    Ok(Some(share))
                })
            }
            Stage::Moving(motion) => motion.step(battery).map(Some),
        };
        match next {
            Ok(share) => {
                if let Stage::Moving(motion) = &self.stage {
                    self.state = Identification::Running(motion.percent());
                }
                share.map(|share| Voltage::from_volts(share * battery))
            }
            Err(outcome) => {
                self.end(outcome);
                None
            }
        }
    }
}

/// The reading at which a motor has rested long enough; `None` while it has not.
fn rest(since: &mut Option<Reading>, last: Option<Reading>) -> Result<Option<Reading>, Identification> {
    let Some(last) = last else { return Err(Identification::Refused(Refusal::Interrupted)) };
    let since = since.get_or_insert(last);
    if last.position.wrapping_sub(since.position).unsigned_abs() > 1 {
        return Err(Identification::Refused(Refusal::NotAtRest));
    }
    Ok(Some(last).filter(|last| last.at.since(since.at) >= u64::from(1000 * REST_MS)))
}

impl Motion {
    fn new(
        emf: f32,
        battery: f32,
        limit: u32,
        period: Period,
        reading: Reading,
    ) -> Result<Self, Identification> {
        let full = full_travel(emf, battery);
        let span = full.min(limit as f32);
        let period = period.as_millis();
        let cell_ms = (CELL_MS / period * period).max(period) as f32;
        let scale = span / full;
        if battery < LEAST_VOLTS {
            return Err(Identification::Refused(Refusal::Battery));
        }
        if scale * MOTION_MS < LEAST_CELLS * cell_ms {
            return Err(Identification::Refused(Refusal::TravelLimit));
        }
        Ok(Self {
            battery,
            span,
            scale,
            // Half a millisecond less, for rounding.
            cell: (cell_ms - 0.5) / 1000.0,
            stretch: 0,
            began: reading.at,
            cells: Cells::new(reading),
            evidence: Evidence::new(emf, battery, span),
            quick: false,
        })
    }

    /// The share of the battery's voltage until the next tick.
    fn step(&mut self, battery: f32) -> Result<f32, Identification> {
        self.check(battery).map_err(Identification::Refused)?;
        let (seconds, counts) = self.cells.running();
        if seconds > self.cell * self.slowness()
            && (counts.unsigned_abs() >= CELL_COUNTS || seconds > LONGEST_CELL)
        {
            self.quick = counts.unsigned_abs() as f32 > QUICK * seconds;
            if let Some(change) = self.cells.close() {
                self.evidence.add(&change);
            }
        }
        if let Some(&(_, length)) = MOTION.get(self.stretch)
            && self.is_over(length)
        {
            self.stretch += 1;
            self.began = self.cells.now();
        }
        match MOTION.get(self.stretch) {
            Some(&(share, _)) => Ok(share),
            None => Err(self.evidence.judge().map_or_else(Identification::Refused, Identification::Found)),
        }
    }

    fn check(&self, battery: f32) -> Result<(), Refusal> {
        let moved = self.cells.moved();
        let held = if self.quick { HELD_MS } else { (LONGEST_HELD_MS * self.scale).max(HELD_MS) };
        if battery < LEAST_VOLTS.max((1.0 - LARGEST_SAG) * self.battery) {
            Err(Refusal::Battery)
        } else if self.stretch == 0 && moved < -TREMBLING {
            Err(Refusal::Backwards)
        } else if moved.saturating_abs().saturating_sub(TREMBLING) as f32 > self.span {
            Err(Refusal::TooFar)
        } else if self.cells.still_ms() >= held {
            Err(Refusal::NoCounts)
        } else {
            Ok(())
        }
    }

    /// Whether the present stretch is over. A first one that was made longer makes the others longer.
    fn is_over(&mut self, length: f32) -> bool {
        let ms = self.ms();
        if self.stretch == 0 {
            let enough = ENOUGH_COUNTS.min(self.span / 4.0);
            if (self.cells.moved() as f32) < enough && ms < LONGEST_STRETCH_MS {
                return false;
            }
            self.scale = self.scale.max(ms / length);
        }
        // Ticks come on whole milliseconds.
        ms + 0.5 > self.scale * length
    }

    /// By how much the stretches are longer than they should be: so are cells.
    fn slowness(&self) -> f32 {
        let [(_, length), ..] = MOTION;
        let present = if self.stretch == 0 { self.ms() / length } else { 0.0 };
        self.scale.max(present).max(1.0)
    }

    /// Since the stretch began.
    fn ms(&self) -> f32 {
        self.cells.now().since(self.began) as f32 / 1000.0
    }

    fn percent(&self) -> u8 {
        let before: f32 = MOTION.iter().take(self.stretch).map(|(_, length)| length).sum();
        let length = MOTION.get(self.stretch).map_or(0.0, |(_, length)| *length);
        let passed = before + (self.ms() / self.scale).min(length);
        ((100.0 * passed / MOTION_MS) as u8).min(99)
    }
}
