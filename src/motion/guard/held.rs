//! A motor that does not turn though it should: a stop holds it, or its encoder is silent, or speaks with one wire
//! only and trembles by a count.
//!
//! What is due follows from the voltage, less what the heaviest friction takes, and the motor's acceleration per volt;
//! what came is the *net* way. Where that is missed:
//!
//! 1. The motor is released: braked, driven nowhere. A stop that gives, or a load that was lifted, moves it, and the
//!    encoder is heard: the motor is stalled.
//! 2. If nothing moves it, it is driven the other way once, if that is allowed. Nothing pulled it that way, so it
//!    is not driven with a load. If it turns, it is stalled; if it should have turned and did not, the encoder is at
//!    fault, and where nothing was due, as of a jammed motor on a low battery, it is taken for stalled.
//!
//! A stalled motor is not examined again until it was sent back, or has turned on beyond its stop for a while, at
//! half of the speed that it should or more.

use super::{DUE_COUNTS, EncoderFault, Evidence, Finding};
use crate::units::{Control, CountsPerSecond, Period};

/// Speed asked for from which on counts are due: 40 counts/s.
const COUNTING_SPEED: CountsPerSecond = CountsPerSecond::from_bits(40 << 8);
/// Time without the way that is due, in milliseconds: of a motor that is known, and of any other.
const STUCK_MS: u32 = 60;
const ANYWAY_MS: u32 = 140;
/// The same of one that is not known and was last heard turning the wrong way: it may be that slow to turn back.
const TURNING_BACK_MS: u32 = 800;
/// How long the motor is released, and driven the other way, at least,
const RELEASE_MS: u32 = 50;
const REVERSE_MS: u32 = 50;
/// and until it was due to have moved.
const REVERSE_COUNTS: f32 = 2.0;
/// If that is not enough for it to turn, it cannot be told.
const LONGEST_REVERSE_MS: u32 = 2_000;
/// A stalled motor that turns beyond its stop for so long is free.
const FREE_MS: u32 = 150;
/// All of it must be over by then, in milliseconds: where it would not be, as of a motor that is not known, the motor
/// is not released first.
const DECIDED_MS: u32 = 250;
/// A net way of so many counts is no trembling of a shaft on an edge, nor of one wire.
const MOVED_COUNTS: i64 = 2;
/// What heaviest friction takes of a motor for 12 V: 40 % of its stall torque, and a third more to break away.
const HELD_VOLTS: f32 = 6.6;
/// And of what there is on a low battery.
const HELD_SHARE: f32 = 0.8;
/// Share of the battery's voltage with which a motor is driven the other way.
const REVERSE_SHARE: f32 = 0.9;
const REVERSE: i16 = 29_490;

/// What is known of a motor that may be held.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    period: Period,
    phase: Phase,
    heard: Heard,
}

/// Which way the motor was last heard turning, by a net way that no trembling makes.
#[derive(Clone, Copy, Debug, Default)]
struct Heard {
    /// Since then.
    moved: i64,
    clockwise: Option<bool>,
}

impl Heard {
    /// Another tick; whether the motor was heard.
    const fn step(&mut self, moved: i32) -> bool {
        self.moved += moved as i64;
        let heard = self.moved.abs() >= MOVED_COUNTS;
        if heard {
            *self = Self { moved: 0, clockwise: Some(self.moved > 0) };
        }
        heard
    }
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    Watching(Due),
    /// With the direction in which it should have turned.
    Releasing(bool, Due),
    Reversing(bool, Due),
    Stalled(Stall),
}

/// A stop that holds the motor.
#[derive(Clone, Copy, Debug)]
struct Stall {
    clockwise: bool,
    /// Counts that it is beyond the stop in that direction.
    beyond: i64,
    /// For how long it has turned there as it should.
    free_ms: u32,
}

impl Stall {
    /// Another tick; whether it is over.
    fn step(&mut self, period: Period, evidence: &Evidence) -> bool {
        let moved = i64::from(evidence.moved);
        self.beyond += if self.clockwise { moved } else { -moved };
        let asked = along(self.clockwise, evidence.order.target);
        let free = self.beyond >= MOVED_COUNTS && 2.0 * along(self.clockwise, evidence.velocity) >= asked;
        self.free_ms = if free { self.free_ms.saturating_add(period.as_millis()) } else { 0 };
        asked < 0.0 || (asked > 0.0 && self.free_ms >= FREE_MS)
    }
}

/// What was due since some time, and what came.
#[derive(Clone, Copy, Debug)]
struct Due {
    ms: u32,
    moved: i64,
    /// Counts/s and counts.
    speed: f32,
    way: f32,
}

impl Default for Due {
    fn default() -> Self {
        Self { ms: 0, moved: 0, speed: f32::MIN, way: 0.0 }
    }
}

impl Due {
    /// From now on; what moved is kept.
    fn anew(self) -> Self {
        Self { moved: self.moved, ..Self::default() }
    }

    /// One more tick with this acceleration in counts/s² of a motor that turned at this speed: the wrong way it
    /// must be stopped first, the right way is a gift.
    fn plus(self, period: Period, moved: i32, acceleration: f32, turns: f32) -> Self {
        let before = self.speed.max(turns.min(0.0));
        let speed = before + acceleration.max(0.0) * period.to_seconds();
        Self {
            ms: self.ms.saturating_add(period.as_millis()),
            moved: self.moved + i64::from(moved),
            speed,
            way: self.way + f32::midpoint(before, speed) * period.to_seconds(),
        }
    }

    /// It is held, and has moved so far from the stop meanwhile.
    const fn stalled(self, clockwise: bool) -> (Phase, Finding) {
        let beyond = if clockwise { self.moved } else { -self.moved };
        (Phase::Stalled(Stall { clockwise, beyond, free_ms: 0 }), Finding::Stalled)
    }

    const fn has_moved(&self) -> bool {
        self.moved.abs() >= MOVED_COUNTS
    }
}

impl Held {
    pub(super) fn new(period: Period) -> Self {
        Self { period, phase: Phase::Watching(Due::default()), heard: Heard::default() }
    }

    /// It is being found out why the motor does not turn.
    pub(super) const fn is_examining(&self) -> bool {
        matches!(self.phase, Phase::Releasing(..) | Phase::Reversing(..))
    }

    /// What a tick says, together with those before it.
    pub(super) fn step(&mut self, evidence: &Evidence) -> Finding {
        let heard = self.heard.step(evidence.moved);
        let (phase, finding) = match self.phase {
            Phase::Watching(_) if heard => (Phase::Watching(Due::default()), Finding::Sound),
            Phase::Watching(due) => self.watch(due, evidence),
            Phase::Releasing(clockwise, due) => self.release(clockwise, due, evidence),
            Phase::Reversing(clockwise, due) => self.reverse(clockwise, due, evidence),
            Phase::Stalled(mut stall) => {
                if stall.step(self.period, evidence) {
                    (Phase::Watching(Due::default()), Finding::Sound)
                } else {
                    (Phase::Stalled(stall), Finding::Stalled)
                }
            }
        };
        self.phase = phase;
        finding
    }

    fn watch(&self, due: Due, evidence: &Evidence) -> (Phase, Finding) {
        let push = evidence.order.push.to_volts();
        let clockwise = push > 0.0;
        let effort = push.abs() - HELD_VOLTS.min(HELD_SHARE * evidence.battery);
        // Speeds are compared as they are stored: this runs at every tick.
        let asked = evidence.order.target.to_bits();
        let asked = if clockwise { asked } else { asked.saturating_neg() };
        if effort <= 0.0 || asked < COUNTING_SPEED.to_bits() {
            return (Phase::Watching(Due::default()), Finding::Sound);
        }
        let turned = along(clockwise, evidence.order.velocity);
        let due = due.plus(self.period, evidence.moved, acceleration(evidence, effort), turned);
        if due.has_moved() {
            return (Phase::Watching(Due::default()), Finding::Sound);
        }
        let least = match evidence.gain {
            Some(_) => STUCK_MS,
            None if self.heard.clockwise == Some(!clockwise) => TURNING_BACK_MS,
            None => ANYWAY_MS,
        };
        if due.ms < least || due.way < DUE_COUNTS {
            return (Phase::Watching(due), Finding::Sound);
        }
        if evidence.gain.is_none() || 3 * self.period.as_millis() > DECIDED_MS {
            return Self::driven_back(clockwise, due, evidence);
        }
        (Phase::Releasing(clockwise, due.anew()), Finding::Release)
    }

    fn release(&self, clockwise: bool, due: Due, evidence: &Evidence) -> (Phase, Finding) {
        let due = due.plus(self.period, evidence.moved, 0.0, 0.0);
        if due.has_moved() {
            due.stalled(clockwise)
        } else if due.ms < RELEASE_MS {
            (Phase::Releasing(clockwise, due), Finding::Release)
        } else {
            Self::driven_back(clockwise, due, evidence)
        }
    }

    /// The motor is driven the other way from now on, if it may be.
    fn driven_back(clockwise: bool, due: Due, evidence: &Evidence) -> (Phase, Finding) {
        if evidence.probing {
            (Phase::Reversing(clockwise, due.anew()), Finding::Probe(back(clockwise)))
        } else {
            (Phase::Watching(Due::default()), Finding::Fault(EncoderFault::Stuck))
        }
    }

    fn reverse(&self, clockwise: bool, due: Due, evidence: &Evidence) -> (Phase, Finding) {
        let effort = REVERSE_SHARE * evidence.battery - HELD_VOLTS;
        let due = due.plus(self.period, evidence.moved, acceleration(evidence, effort), 0.0);
        if due.has_moved() {
            due.stalled(clockwise)
        } else if due.ms >= REVERSE_MS && due.way >= REVERSE_COUNTS {
            (Phase::Watching(Due::default()), Finding::Fault(EncoderFault::Stuck))
        } else if due.ms >= REVERSE_MS && (effort <= 0.0 || due.ms >= LONGEST_REVERSE_MS) {
            due.stalled(clockwise)
        } else {
            (Phase::Reversing(clockwise, due), Finding::Probe(back(clockwise)))
        }
    }
}

/// What is due of a voltage; of a motor that is not known anything, in the time that it is given.
fn acceleration(evidence: &Evidence, volts: f32) -> f32 {
    evidence.gain.map_or(if volts > 0.0 { f32::MAX } else { 0.0 }, |gain| gain * volts)
}

/// Counts/s in that direction.
fn along(clockwise: bool, speed: CountsPerSecond) -> f32 {
    if clockwise { speed.to_f32() } else { -speed.to_f32() }
}

const fn back(clockwise: bool) -> Control {
    Control::new(if clockwise { -REVERSE } else { REVERSE })
}
