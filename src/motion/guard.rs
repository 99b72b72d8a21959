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
//! Either is decided within 250 ms of a clear case (at control periods that divide 50 ms). Open-loop
//! power needs no encoder and is not watched; neither is a motor that holds its position, from which
//! no count is due.

use crate::braking::Regime;
use crate::units::{Control, CountsPerSecond, Period};

/// How long no count must come.
const SUSPICIOUS_MS: u32 = 150;
/// How long the motor is driven the other way.
const PROBE_MS: u32 = 50;
/// Half of the control range: enough to move anything that the motor should be able to move. At
/// standstill, half of the stall torque in every scheme.
const EFFORT: i16 = 1 << 14;
/// The end of the control range, but for what the loop's rounding leaves.
const ALL: u16 = 15 << 11;
/// Whether the motor slows down is told from two times that follow each other: this, and one of the next.
const EARLY_MS: u32 = 50;
/// Enough to be sure.
const LATE_MS: u32 = 100;
/// Enough to look closer.
const HINT_MS: u32 = 50;
/// Counts in the first, at least, if that is to be told: 160 counts/s.
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
    /// The end of the control range may be less than full reverse.
    pub gentle: bool,
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
    /// Put the bridge in full reverse, whatever the scheme says.
    Insist,
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

/// A motor that turns the wrong way: its counts early, and later.
#[derive(Clone, Copy, Debug, Default)]
struct Astray {
    /// 0 if it does not; the rest then means nothing.
    early_ms: u32,
    early: u32,
    late_ms: u32,
    late: u32,
    /// Later is while the bridge is in full reverse.
    insisting: bool,
}

impl Astray {
    /// Another tick of it. `gentle` is whether the end of the control range may be less than full reverse.
    fn step(&mut self, ms: u32, counts: u32, gentle: bool) -> Finding {
        if self.early_ms == 0 {
            *self = Self::default();
        }
        if !self.insisting && self.early_ms < EARLY_MS {
            self.early_ms += ms;
            self.early = self.early.saturating_add(counts);
            return Finding::Sound;
        }
        self.late_ms += ms;
        self.late = self.late.saturating_add(counts);
        let hint = gentle && !self.insisting;
        if self.late_ms < if hint { HINT_MS } else { LATE_MS } {
            return if self.insisting { Finding::Insist } else { Finding::Sound };
        }
        // Counts a millisecond, later and before.
        let late = u64::from(self.late) * u64::from(self.early_ms);
        if self.early < ENOUGH || late < u64::from(self.early) * u64::from(self.late_ms) {
            self.early_ms = 0;
            Finding::Sound
        } else if hint {
            let early = self.early.saturating_add(self.late);
            *self =
                Self { early_ms: self.early_ms + self.late_ms, early, insisting: true, ..Self::default() };
            Finding::Insist
        } else {
            Finding::Fault(EncoderFault::Reversed)
        }
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
            (self.stuck_ms, self.astray.early_ms) = (0, 0);
        }
        trusts
    }

    /// Second question, unless the answer was yes. Kept apart, so that it costs nothing then.
    #[cold]
    #[inline(never)]
    pub fn examine(&mut self, period: Period, evidence: Evidence) -> Finding {
        let Evidence { control, regime, target, moved, velocity, gentle } = evidence;
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
            self.astray.early_ms = 0;
        } else {
            let finding = self.astray.step(ms, counts, gentle);
            if finding != Finding::Sound {
                return finding;
            }
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
