//! Is the encoder telling the truth? A regulated motor whose encoder is unplugged or reversed runs
//! away; this notices, from nothing but effort and counts.
//!
//! * **Reversed:** at half of the control range or more the motor turns against the effort, above a
//!   tenth of the battery voltage in back EMF, and does not slow down for 150 ms. A load that does
//!   this to a well-wired motor overpowers it by more than its stall torque.
//! * **Stuck:** at half of the control range or more, with a speed asked for at which at least six
//!   counts were due, no count comes for 150 ms. That is an unplugged encoder, or a motor held by a
//!   hard stop. Without a current sensor the two look alike, so the motor is driven the other way for
//!   50 ms: away from a stop it turns, and the encoder counts. If it does, the motor is *stalled*,
//!   which is reported and is no fault, and it is not probed again until it has passed the place or
//!   is sent the other way. If it does not, the encoder is at fault, or the motor is jammed both ways, which is as good a reason to
//!   coast.
//!
//! Either is decided 200 ms after the case is clear (at control periods that divide 50 ms). Open-loop
//! power needs no encoder and is not watched; neither is a motor that holds its position, from which
//! no count is due.

use crate::braking::OperatingPoint;
use crate::units::{Control, CountsPerSecond, Period};

/// How long the evidence must last.
const SUSPICIOUS_MS: u32 = 150;
/// How long the motor is driven the other way.
const PROBE_MS: u32 = 50;
/// Half of the control range: enough to move anything that the motor should be able to move.
const EFFORT: i16 = 1 << 14;
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
    /// Speed that was asked for until now.
    pub target: CountsPerSecond,
    /// Counts that came meanwhile.
    pub moved: i32,
    /// Speed that was measured.
    pub velocity: CountsPerSecond,
    /// That speed's back EMF, and the battery voltage.
    pub at: OperatingPoint,
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

/// Watches one regulated motor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Guard {
    state: State,
    stuck_ms: u32,
    reversed_ms: u32,
    last_speed: u32,
}

impl Guard {
    /// One tick of a regulated motor.
    #[inline(always)]
    pub fn step(&mut self, period: Period, evidence: Evidence) -> Finding {
        let Evidence { control, target, moved, velocity, at } = evidence;
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

        let effort = control.get().unsigned_abs() >= EFFORT.unsigned_abs();
        if !effort && self.state == State::Watching {
            (self.stuck_ms, self.reversed_ms, self.last_speed) = (0, 0, 0);
            return Finding::Sound;
        }
        let stuck = effort && counts == 0 && target.to_bits().unsigned_abs() >= DUE;
        self.stuck_ms = if stuck { self.stuck_ms.saturating_add(ms) } else { 0 };

        let speed = velocity.to_bits().unsigned_abs();
        let against = (velocity.to_bits() < 0) != (control.get() < 0);
        let reversed = effort && against && at.is_above_a_tenth() && speed >= self.last_speed;
        self.reversed_ms = if reversed { self.reversed_ms.saturating_add(ms) } else { 0 };
        self.last_speed = speed;

        if self.reversed_ms >= SUSPICIOUS_MS {
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

/// Counts in the direction of a stall.
const fn along(moved: i32, positive: bool) -> i32 {
    if positive { moved } else { moved.saturating_neg() }
}
