//! Is the encoder telling the truth? A regulated motor whose encoder is unplugged or reversed runs
//! away; this notices, from nothing but effort and counts.
//!
//! * **Reversed:** for 150 ms the control value is at the end of its range and the bridge in reverse, and
//!   still the motor turns the wrong way, or twice as fast as asked, at 160 counts/s or more, and does
//!   not slow down. A load that does this to a well-wired motor overpowers it by more than its stall
//!   torque. In Schemes C and D the end of the range may be less than full reverse, and a load may
//!   overpower that: there, after 100 ms, the bridge is put in full reverse for another 100 ms, which
//!   slows down a well-wired motor, and drives on one whose encoder is reversed.
//! * **Stuck:** at half of the control range or more, with a speed asked for at which at least six
//!   counts were due, no count comes for 150 ms. That is an unplugged encoder, or a motor held by a
//!   hard stop. Without a current sensor the two look alike, so the motor is driven the other way for
//!   50 ms: away from a stop it turns, and the encoder counts. If it does, the motor is *stalled*,
//!   which is reported and is no fault, and it is not probed again until it has passed the place or
//!   is sent the other way. If it does not, the encoder is at fault, or the motor is jammed both ways,
//!   which is as good a reason to coast.
//!
//! All times are longer for a motor that is known to be so slow that its counts take longer.
//!
//! Either is decided within 250 ms of a clear case (at control periods that divide 50 ms). Open-loop
//! power needs no encoder and is not watched; neither is a motor that holds its position, from which
//! no count is due.
//!
//! ```
//! use motor_hub::braking::Regime;
//! use motor_hub::motion::guard::{EncoderFault, Evidence, Finding, Guard};
//! use motor_hub::units::{Control, CountsPerSecond, Period};
//!
//! let mut guard = Guard::new(Period::DEFAULT);
//! let no_counts = Evidence {
//!     control: Control::MAX,
//!     regime: Regime::Forward,
//!     target: CountsPerSecond::new(1_000),
//!     moved: 0,
//!     velocity: CountsPerSecond::ZERO,
//!     gentle: false,
//! };
//! assert_eq!([(); 2].map(|()| guard.step(no_counts)), [Finding::Sound; 2]);
//! // 150 ms.
//! assert!(matches!(guard.step(no_counts), Finding::Probe(_)));
//! assert_eq!(guard.step(no_counts), Finding::Fault(EncoderFault::Stuck));
//! ```

use crate::braking::Regime;
use crate::units::{AccelerationPerVolt, Control, CountsPerSecond, Period};
use core::cmp::Ordering;
use libm::sqrtf;

/// How long no count must come under effort before the motor is probed, at least.
const STUCK_MS: i64 = 150;
/// How long a probe drives the motor the other way, at least.
const PROBE_MS: i64 = 50;
/// Neither is ever longer.
const LONGEST_MS: i64 = 2_000;
/// Counts that are due before no count means anything.
const DUE_COUNTS: f32 = 6.0;
/// Half of a 12 V battery, as [`HALF_EFFORT`] is of the control range.
const HALF_VOLTS: f32 = 6.0;
/// Counts that a probe must see. One may be the trembling of a shaft on an edge.
const PROBE_COUNTS: i64 = 2;
/// Effort at which counts must come, and of a probe: half of the control range, enough to move anything
/// that the motor should be able to move. At standstill, half of the stall torque in every scheme.
const HALF_EFFORT: i16 = 16_384;
/// Effort of a motor that is given all: the end of the control range, but for what the loop's rounding
/// leaves.
const FULL_EFFORT: i16 = 30_720;
/// Speed asked for at which six counts are due in [`STUCK_MS`]: 40 counts/s.
const COUNTING_SPEED: CountsPerSecond = CountsPerSecond::from_bits(40 << 8);
/// Whether a runaway slows down is told from two times that follow each other: this,
const RUNAWAY_EARLY_MS: i64 = 50;
/// and this, enough to be sure,
const RUNAWAY_LATE_MS: i64 = 100;
/// or this, enough to insist on full reverse.
const RUNAWAY_HINT_MS: i64 = 50;
/// Counts in the first, at least, if that is to be told: 160 counts/s.
const RUNAWAY_COUNTS: i64 = 8;

/// What is wrong with an encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncoderFault {
    /// No counts under effort, in neither direction.
    Stuck,
    /// Counts against the effort.
    Reversed,
}

/// What a tick was, and what came of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Evidence {
    /// Control value that was in force until now.
    pub control: Control,
    /// Its regime.
    pub regime: Regime,
    /// Speed that was asked for until now.
    pub target: CountsPerSecond,
    /// Counts that came meanwhile.
    pub moved: i32,
    /// Speed that was measured.
    pub velocity: CountsPerSecond,
    /// The end of the control range may be less than full reverse.
    pub gentle: bool,
}

impl Evidence {
    fn effort(&self) -> i16 {
        self.control.get().abs()
    }

    fn counts(&self) -> i64 {
        i64::from(self.moved).abs()
    }

    /// No counts, though there is effort and some were due.
    fn lacks_counts(&self) -> bool {
        let speed = i64::from(self.target.to_bits()).abs();
        self.counts() == 0 && self.effort() >= HALF_EFFORT && speed >= i64::from(COUNTING_SPEED.to_bits())
    }

    /// The motor turns the wrong way, or at least twice as fast as asked, against all that control can do.
    fn runs_away(&self) -> bool {
        let (velocity, target) = (i64::from(self.velocity.to_bits()), i64::from(self.target.to_bits()));
        let astray = if velocity < 0 { 2 * target >= velocity } else { 2 * target <= velocity };
        astray && self.regime == Regime::Reverse && self.effort() >= FULL_EFFORT
    }
}

/// What to do about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// Nothing is wrong, or not yet.
    Sound,
    /// Held against a stop; nothing is wrong with the encoder.
    Stalled,
    /// Use this control value instead of the loop's.
    Probe(Control),
    /// Put the bridge in full reverse, whatever the scheme says to this control value, the end of its range.
    Insist(Control),
    /// Stop using the encoder.
    Fault(EncoderFault),
}

/// What is known of a motor that does not turn.
#[derive(Clone, Copy, Debug, Default)]
enum Phase {
    /// It turns, as far as is known.
    #[default]
    Watching,
    /// It is driven the other way.
    Probing { control: Control, ms: i64, counts: i64 },
    /// It is held.
    Stalled(Stall),
}

/// A stop that holds the motor.
#[derive(Clone, Copy, Debug)]
struct Stall {
    /// The direction in which it is held.
    clockwise: bool,
    /// Counts that it is beyond the stop in that direction.
    beyond: i64,
}

impl Stall {
    fn turn(&mut self, moved: i32) {
        let moved = i64::from(moved);
        self.beyond += if self.clockwise { moved } else { -moved };
    }

    /// It has passed the place, or is sent the other way.
    fn is_over(&self, target: CountsPerSecond) -> bool {
        let sent_back = match target.cmp(&CountsPerSecond::ZERO) {
            Ordering::Less => self.clockwise,
            Ordering::Equal => false,
            Ordering::Greater => !self.clockwise,
        };
        self.beyond >= PROBE_COUNTS || sent_back
    }
}

/// Counts in a time.
#[derive(Clone, Copy, Debug, Default)]
struct Span {
    ms: i64,
    counts: i64,
}

impl Span {
    fn plus(self, other: Self) -> Self {
        Self { ms: self.ms + other.ms, counts: self.counts + other.counts }
    }

    /// Fewer counts a millisecond.
    fn is_slower_than(self, other: Self) -> bool {
        self.counts * other.ms < other.counts * self.ms
    }
}

/// A motor that turns the wrong way against full effort: does it slow down?
#[derive(Clone, Copy, Debug, Default)]
struct Runaway {
    early: Span,
    /// While the bridge is in full reverse, if that is insisted on.
    late: Span,
    insisting: bool,
}

impl Runaway {
    /// Another tick of it; each of its times is so much longer.
    fn step(&mut self, tick: Span, evidence: &Evidence, more_ms: i64) -> Finding {
        let control = evidence.control;
        let insist = Finding::Insist(if control < Control::ZERO { Control::MIN } else { Control::MAX });
        if self.early.ms < RUNAWAY_EARLY_MS + more_ms {
            self.early = self.early.plus(tick);
            return Finding::Sound;
        }
        self.late = self.late.plus(tick);
        let in_doubt = evidence.gentle && !self.insisting;
        if self.late.ms < more_ms + if in_doubt { RUNAWAY_HINT_MS } else { RUNAWAY_LATE_MS } {
            return if self.insisting { insist } else { Finding::Sound };
        }
        if self.early.counts < RUNAWAY_COUNTS || self.late.is_slower_than(self.early) {
            *self = Self::default();
            Finding::Sound
        } else if in_doubt {
            *self = Self { early: self.early.plus(self.late), late: Span::default(), insisting: true };
            insist
        } else {
            Finding::Fault(EncoderFault::Reversed)
        }
    }
}

/// How long a motor may take to show that it moves.
#[derive(Clone, Copy, Debug)]
struct Patience {
    stuck_ms: i64,
    probe_ms: i64,
    /// Added to each of a runaway's times.
    runaway_ms: i64,
}

impl Patience {
    /// A motor whose acceleration is known is given the time that its counts take at half of the effort, from
    /// rest: `sqrt(2 counts / acceleration)`.
    fn new(gain: Option<AccelerationPerVolt>) -> Self {
        let due = |counts: f32, least: i64| {
            let takes = gain.map_or(0.0, |gain| sqrtf(2.0 * counts / (HALF_VOLTS * gain.to_f32())));
            least.max((1_000.0 * takes) as i64).min(LONGEST_MS)
        };
        let runaway_ms = due(DUE_COUNTS, 0);
        Self {
            stuck_ms: due(DUE_COUNTS, STUCK_MS),
            probe_ms: due(PROBE_COUNTS as f32, PROBE_MS),
            // Of a motor that is quick enough the times as they are will do.
            runaway_ms: if runaway_ms > STUCK_MS { runaway_ms } else { 0 },
        }
    }
}

/// Watches one regulated motor.
#[derive(Clone, Copy, Debug)]
pub struct Guard {
    period: Period,
    patience: Patience,
    phase: Phase,
    /// How long no count came that was due.
    stuck_ms: i64,
    runaway: Runaway,
}

impl Guard {
    /// For a motor that is stepped every `period`, of which nothing is known. Nothing is suspected.
    pub fn new(period: Period) -> Self {
        Self {
            period,
            patience: Patience::new(None),
            phase: Phase::Watching,
            stuck_ms: 0,
            runaway: Runaway::default(),
        }
    }

    /// What a tick says of the encoder, together with those before it.
    pub fn step(&mut self, evidence: Evidence) -> Finding {
        let tick = Span { ms: self.period.as_millis().into(), counts: evidence.counts() };
        if let Phase::Probing { control, ms, counts } = self.phase {
            return self.probe(control, Span { ms, counts }.plus(tick), evidence.moved);
        }
        self.stuck_ms = if evidence.lacks_counts() { self.stuck_ms + tick.ms } else { 0 };

        if evidence.runs_away() {
            let finding = self.runaway.step(tick, &evidence, self.patience.runaway_ms);
            if finding != Finding::Sound {
                return finding;
            }
        } else {
            self.runaway = Runaway::default();
        }
        if let Phase::Stalled(mut stall) = self.phase {
            stall.turn(evidence.moved);
            if !stall.is_over(evidence.target) {
                self.phase = Phase::Stalled(stall);
                return Finding::Stalled;
            }
            self.phase = Phase::Watching;
            self.stuck_ms = 0;
        }
        if self.stuck_ms >= self.patience.stuck_ms {
            self.stuck_ms = 0;
            let against = if evidence.control < Control::ZERO { HALF_EFFORT } else { -HALF_EFFORT };
            return self.probe(Control::new(against), Span::default(), 0);
        }
        Finding::Sound
    }

    /// Goes on with a probe that has seen so much, `moved` of it in the last tick.
    fn probe(&mut self, control: Control, seen: Span, moved: i32) -> Finding {
        if seen.counts >= PROBE_COUNTS {
            let mut stall = Stall { clockwise: control < Control::ZERO, beyond: 0 };
            stall.turn(moved);
            self.phase = Phase::Stalled(stall);
            return Finding::Stalled;
        }
        if seen.ms >= self.patience.probe_ms {
            return Finding::Fault(EncoderFault::Stuck);
        }
        self.phase = Phase::Probing { control, ms: seen.ms, counts: seen.counts };
        Finding::Probe(control)
    }

    /// Suspects nothing any more, as when the motor is no longer regulated.
    pub fn reset(&mut self) {
        *self = Self { patience: self.patience, ..Self::new(self.period) };
    }

    /// So fast the motor accelerates, if that is known: a slow one is given time.
    pub fn expect(&mut self, gain: Option<AccelerationPerVolt>) {
        self.patience = Patience::new(gain);
    }
}
