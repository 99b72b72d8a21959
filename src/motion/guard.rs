//! Is the encoder telling the truth? A regulated motor whose encoder is unplugged or reversed runs
//! away; this notices, from nothing but effort and counts.
//!
//! * **Reversed:** for 150 ms the control value is at the end of its range and the bridge in reverse, and
//!   still the motor turns the wrong way, or twice as fast as asked, at 160 counts/s or more, and does
//!   not slow down. A load that does this to a well-wired motor overpowers all that its scheme can set
//!   against it. The control value alone would not tell: in Schemes C and D its end may mean gentle
//!   braking, in spite of which a load may well drive a healthy motor on.
//! * **Stuck:** at half of the control range or more, with a speed asked for at which at least six
//!   counts were due, no count comes for 150 ms. That is an unplugged encoder, or a motor held by a
//!   hard stop. Without a current sensor the two look alike, so the motor is driven the other way for
//!   50 ms: away from a stop it turns, and the encoder counts. If it does, the motor is *stalled*,
//!   which is reported and is no fault, and it is not probed again until it has passed the place or
//!   is sent the other way. If it does not, the encoder is at fault, or the motor is jammed both ways,
//!   which is as good a reason to coast.
//!
//! Either is decided 200 ms after the case is clear (at control periods that divide 50 ms). Open-loop
//! power needs no encoder and is not watched; neither is a motor that holds its position, from which
//! no count is due.

use crate::braking::Regime;
use crate::units::{Control, CountsPerSecond, Period};

/// How long the evidence must last.
const SUSPICIOUS_MS: u32 = 150;
/// How long the motor is driven the other way.
const PROBE_MS: u32 = 50;
/// Half of the control range: enough to move anything that the motor should be able to move. At
/// standstill, half of the stall torque in every scheme.
const EFFORT: i16 = 1 << 14;
/// The end of the control range, but for what the loop's rounding leaves.
const ALL: u16 = 15 << 11;
/// Whether the motor slows down is told from the time before this and after it.
const EARLY_MS: u32 = 50;
/// Counts until then, at least, if that is to be told: 160 counts/s.
const ENOUGH: u32 = 8;
/// Speed bits of 40 counts/s, at which six counts are due in the time of suspicion.
const DUE: u32 = 40 << 8;
/// Counts that a probe must see. One may be the trembling of a shaft on an edge.
const ALIVE: u32 = 2;

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
    /// Stop using the encoder.
    Fault(EncoderFault),
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    #[default]
    Watching,
    Probing {
        against: Control,
        for_ms: u32,
        counts: u32,
    },
    /// How far beyond the stop the motor is, in the direction in which it was held.
    Stalled {
        positive: bool,
        beyond: i32,
    },
}

/// A motor that turns the wrong way.
#[derive(Clone, Copy, Debug, Default)]
struct Astray {
    /// For how long; 0 if it does not, and then there are no counts.
    for_ms: u32,
    /// Counts up to [`EARLY_MS`], and later.
    early: u32,
    late: u32,
}

impl Astray {
    /// Another tick of it. True if it has lasted and does not slow down.
    fn step(&mut self, ms: u32, counts: u32) -> bool {
        if self.for_ms == 0 {
            (self.early, self.late) = (0, 0);
        }
        let part = if self.for_ms < EARLY_MS { &mut self.early } else { &mut self.late };
        *part = part.saturating_add(counts);
        self.for_ms += ms;
        if self.for_ms < SUSPICIOUS_MS {
            return false;
        }
        let early_ms = EARLY_MS.next_multiple_of(ms.max(1));
        let late_ms = self.for_ms.saturating_sub(early_ms);
        self.for_ms = 0;
        // Counts a millisecond, later and before.
        let late = u64::from(self.late) * u64::from(early_ms);
        self.early >= ENOUGH && late >= u64::from(self.early) * u64::from(late_ms)
    }
}

/// Watches one regulated motor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Guard {
    state: State,
    stuck_ms: u32,
    astray: Astray,
}

impl Guard {
    /// First of two questions in a tick: is nothing suspected, and no reason to begin? True nearly always,
    /// and cheap: no effort, or counts that come while the bridge does not work against the motion.
    #[inline(always)]
    pub fn trusts(&mut self, control: Control, regime: Regime, moved: i32) -> bool {
        let effort = control.get().unsigned_abs() >= EFFORT.unsigned_abs();
        let obeys = moved != 0 && regime != Regime::Reverse;
        let trusts = self.state == State::Watching && (!effort || obeys);
        if trusts {
            (self.stuck_ms, self.astray.for_ms) = (0, 0);
        }
        trusts
    }

    /// Second question, unless the answer was yes. Kept apart, so that it costs nothing then.
    #[cold]
    #[inline(never)]
    pub fn examine(&mut self, period: Period, evidence: Evidence) -> Finding {
        let Evidence { control, regime, target, moved, velocity } = evidence;
        let (ms, counts) = (period.as_millis(), moved.unsigned_abs());

        if let State::Probing { against, for_ms, counts: before } = self.state {
            let counts = before.saturating_add(counts);
            let for_ms = for_ms + ms;
            if counts >= ALIVE {
                let positive = against.get() < 0;
                self.state = State::Stalled { positive, beyond: along(moved, positive) };
                return Finding::Stalled;
            }
            if for_ms >= PROBE_MS {
                return Finding::Fault(EncoderFault::Stuck);
            }
            self.state = State::Probing { against, for_ms, counts };
            return Finding::Probe(against);
        }

        let effort = control.get().unsigned_abs();
        let stuck = effort >= EFFORT.unsigned_abs() && counts == 0 && target.to_bits().unsigned_abs() >= DUE;
        self.stuck_ms = if stuck { self.stuck_ms.saturating_add(ms) } else { 0 };

        if regime != Regime::Reverse || effort < ALL || !astray(velocity, target) {
            self.astray.for_ms = 0;
        } else if self.astray.step(ms, counts) {
            return Finding::Fault(EncoderFault::Reversed);
        }
        if let State::Stalled { positive, beyond } = self.state {
            let beyond = beyond.saturating_add(along(moved, positive));
            let sent_back = target.to_bits() != 0 && (target.to_bits() > 0) != positive;
            if beyond < ALIVE as i32 && !sent_back {
                self.state = State::Stalled { positive, beyond };
                return Finding::Stalled;
            }
            self.state = State::Watching;
            self.stuck_ms = 0;
        }
        if self.stuck_ms >= SUSPICIOUS_MS {
            self.stuck_ms = 0;
            let against = Control::new(if control.get() < 0 { EFFORT } else { -EFFORT });
            self.state = State::Probing { against, for_ms: 0, counts: 0 };
            return Finding::Probe(against);
        }
        Finding::Sound
    }
}

/// True if the motor turns the wrong way, or at least twice as fast as asked.
const fn astray(velocity: CountsPerSecond, target: CountsPerSecond) -> bool {
    let (half, target) = (velocity.to_bits() / 2, target.to_bits());
    if half < 0 { target >= half } else { target <= half }
}

/// Counts in the direction of a stall.
const fn along(moved: i32, positive: bool) -> i32 {
    if positive { moved } else { moved.saturating_neg() }
}
