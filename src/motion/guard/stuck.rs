//! A motor that does not turn though it should: a stop holds it, or its encoder is silent, or speaks with one wire
//! only and trembles by a count.
//!
//! What is due of a motor at rest follows from the voltage, less what the heaviest friction takes, and the motor's
//! acceleration per volt; what came is the *net* way. A motor that has turned evenly and then falls silent should have gone
//! on under the load that it had ([`Due::turning_on`]); whatever stopped it at once must have found it light
//! ([`Turned::gain`]), so that it can soon be told. Where the way is missed:
//!
//! 1. The motor is released: braked, driven nowhere. A stop that gives, or a load that was lifted, moves it, and the
//!    encoder is heard: the motor is stalled.
//! 2. If nothing moves it, it is driven the other way once, if that is allowed. Nothing pulled it that way, so it
//!    is not driven with a load. If it turns, it is stalled; if it should have turned and did not, the encoder is at
//!    fault, and where nothing was due, as of a jammed motor on a low battery, it is taken for stalled.
//!
//! A stalled motor is not examined again until it was sent back, or has turned on beyond its stop for a while, at
//! half of the speed that it should or more.

use super::heard::{Heard, Turned};
use super::{DUE_COUNTS, EncoderFault, Evidence, Finding};
use crate::braking::Regime;
use crate::motion::Reading;
use crate::units::{Control, CountsPerSecond, Period, Voltage};

/// Speed asked for from which on counts are due: 40 counts/s.
const COUNTING_SPEED: CountsPerSecond = CountsPerSecond::from_bits(40 << 8);
/// Time without the way that is due, in milliseconds: of a motor of which something is known, and of any other.
const STUCK_MS: u32 = 46;
const ANYWAY_MS: u32 = 140;
/// A motor that was heard within so many microseconds is not silent.
const QUIET_US: u32 = 10_000;
/// Of a back EMF of more than this, in volts per count/s, a motor has fewer than 1000 counts/s at 12 V: those have gears
/// before their encoder, or heavy rotors, and take so long.
const FEW_COUNTS: f32 = 0.012;
const FEW_COUNTS_MS: u32 = 3_000;
/// Time constants are no longer than this, in seconds: of those, and of any other.
const LONGEST_OF_FEW_COUNTS: f32 = 50.0;
const LONGEST_TIME_CONSTANT: f32 = 2.5;
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
/// What a load may change by, in volts: it stalls a motor for 12 V, besides the heaviest friction.
const STOPPING_VOLTS: f32 = 18.0;
/// Within so many counts a motor stops that is silent from one moment to the next.
const STOPPING_COUNTS: f32 = 4.0;
/// The way that is missed of a motor that should have gone on as it did: more than what one does not go that is turned back
/// by another load, from the last count that was heard before to the first one after.
const GOING_ON_COUNTS: f32 = 12.0;
/// A motor that turns no faster than so many times what it is asked for has not to become slower.
const AS_ASKED: f32 = 1.5;
/// What a known load takes beyond what is thought: a third, to break away, and this, for what is not known so well.
const BREAKAWAY: f32 = 4.0 / 3.0;
const IN_DOUBT_VOLTS: f32 = 1.0;
/// Share of the battery's voltage with which a motor is driven the other way.
const REVERSE_SHARE: f32 = 0.9;
const REVERSE: i16 = 29_490;

/// What is known of a motor that may be held.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    period: Period,
    phase: Phase,
    heard: Heard,
    /// What the bridge made of the motor when it was heard last.
    push_when_heard: Voltage,
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    Watching(Due),
    Releasing(Suspect, Due),
    Reversing(Suspect, Due),
    Stalled(Stall),
}

/// A motor that should have turned and did not.
#[derive(Clone, Copy, Debug)]
struct Suspect {
    clockwise: bool,
    /// What a volt accelerates it by at least, in counts/s².
    gain: f32,
    /// What may hold it when it is driven the other way, in volts.
    holds: f32,
}

impl Suspect {
    fn new(clockwise: bool, turned: Option<Turned>, evidence: &Evidence) -> Self {
        let longest = if evidence.has_few_counts() { LONGEST_OF_FEW_COUNTS } else { LONGEST_TIME_CONSTANT };
        let heaviest = 1.0 / (longest * evidence.emf.to_volts());
        let stopped = turned.map_or(heaviest, |turned| turned.gain().max(heaviest));
        // What it had to overcome helps it back; as sure as that must be, it is in doubt twice.
        let overcame = turned.map(|turned| turned.holds(evidence)).filter(|volts| *volts > IN_DOUBT_VOLTS);
        let holds = overcame.map_or(HELD_VOLTS, |volts| HELD_VOLTS.min(volts + IN_DOUBT_VOLTS));
        Self { clockwise, gain: evidence.gain.unwrap_or(stopped), holds }
    }
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
    /// Counts/s, if it was looked at already, and counts.
    speed: Option<f32>,
    way: f32,
    /// For how long it was given what turns any motor.
    pushed_ms: u32,
}

impl Due {
    const NONE: Self = Self { ms: 0, moved: 0, speed: None, way: 0.0, pushed_ms: 0 };

    /// From now on; what moved is kept.
    fn anew(self) -> Self {
        Self { moved: self.moved, ..Self::NONE }
    }

    /// So much later, with this acceleration in counts/s² of a motor that turned at this speed: the wrong way it
    /// must be stopped first, the right way is a gift.
    fn plus(self, ms: u32, moved: i32, acceleration: f32, turns: f32) -> Self {
        let before = self.speed.map_or(turns.min(0.0), |speed| speed.max(turns.min(0.0)));
        self.at_speeds(ms, moved, before, before + acceleration.max(0.0) * seconds(ms))
    }

    /// So much later, of a motor that turned on under the load that it had, pushed by so many volts: with more than that
    /// takes it becomes faster by no less than the least gain, with less slower by no more than what a volt is thought to do.
    fn turning_on(self, ms: u32, moved: i32, turned: &Turned, push: f32, evidence: &Evidence) -> Self {
        let before = self.speed.unwrap_or(turned.pace);
        let (mut volts, mut kappa) = (push - turned.holds(evidence), evidence.emf.to_volts());
        if evidence.order.regime == Regime::Braking {
            // What a short lets through goes with the speed.
            let then = evidence.order.velocity.to_f32().abs().max(1.0);
            (volts, kappa) = (volts - push, (kappa - push / then).max(0.0));
        }
        let least = evidence.gain.unwrap_or(0.0).max(turned.gain());
        // By its end, so that no step is too long.
        let step = seconds(ms) * if volts > kappa * before { least } else { evidence.volt };
        let speed = (before + step * volts) / (1.0 + step * kappa);
        if speed > 0.0 {
            self.at_speeds(ms, moved, before, speed)
        } else {
            // It may have come to rest.
            Self { speed: Some(0.0), ..Self::NONE }
        }
    }

    fn at_speeds(self, ms: u32, moved: i32, before: f32, speed: f32) -> Self {
        Self {
            ms: self.ms.saturating_add(ms),
            moved: self.moved + i64::from(moved),
            speed: Some(speed),
            way: self.way + f32::midpoint(before, speed) * seconds(ms),
            ..self
        }
    }

    /// It is held, and has moved so far from the stop meanwhile.
    const fn stalled(self, clockwise: bool) -> (Phase, Finding) {
        let beyond = if clockwise { self.moved } else { -self.moved };
        (Phase::Stalled(Stall { clockwise, beyond, free_ms: 0 }), Finding::Stalled)
    }
}

impl Turned {
    /// What a volt accelerates by at least, in counts/s², what a load has stopped from this pace within some counts.
    fn gain(&self) -> f32 {
        self.pace * self.pace / (2.0 * STOPPING_COUNTS * STOPPING_VOLTS)
    }

    /// What may hold it under the load that it turned under, in volts; less than 0 of one that drives it.
    fn holds(&self, evidence: &Evidence) -> f32 {
        // A load that has just been met may be known too late, by what drove it then.
        let load = (-self.load / evidence.volt).max(self.push - evidence.emf.to_volts() * self.pace);
        let holds = load * if load > 0.0 { BREAKAWAY } else { 1.0 } + IN_DOUBT_VOLTS;
        holds.min(HELD_VOLTS)
    }
}

impl Evidence {
    fn has_few_counts(&self) -> bool {
        self.emf.to_volts() > FEW_COUNTS
    }
}

impl Held {
    pub(super) fn new(period: Period) -> Self {
        Self {
            period,
            phase: Phase::Watching(Due::NONE),
            heard: Heard::default(),
            push_when_heard: Voltage::from_volts(0.0),
        }
    }

    /// Nothing is due yet. Where the motor is stays known.
    pub(super) const fn reset(&mut self) {
        self.phase = Phase::Watching(Due::NONE);
        self.heard.forget();
    }

    /// It is being found out why the motor does not turn.
    pub(super) const fn is_examining(&self) -> bool {
        matches!(self.phase, Phase::Releasing(..) | Phase::Reversing(..))
    }

    /// Takes a sample of the encoder, and the load that is thought of then.
    pub(super) fn sample(&mut self, reading: &Reading, load: impl FnOnce() -> f32) {
        self.heard.sample(reading, load);
    }

    /// What a tick says, together with those before it.
    pub(super) fn step(&mut self, evidence: &Evidence) -> Finding {
        let heard = self.heard.lately();
        if heard {
            self.push_when_heard = evidence.order.push;
        }
        let (phase, finding) = match self.phase {
            Phase::Watching(due) => self.listen(if heard { Due::NONE } else { due }, evidence),
            Phase::Releasing(suspect, due) => self.release(suspect, due, heard, evidence),
            Phase::Reversing(suspect, due) => self.reverse(suspect, due, heard, evidence),
            Phase::Stalled(mut stall) => {
                self.heard.forget();
                if stall.step(self.period, evidence) {
                    (Phase::Watching(Due::NONE), Finding::Sound)
                } else {
                    (Phase::Stalled(stall), Finding::Stalled)
                }
            }
        };
        self.phase = phase;
        finding
    }

    /// Is the motor silent? This runs at every tick.
    fn listen(&mut self, due: Due, evidence: &Evidence) -> (Phase, Finding) {
        let silent_us = self.heard.silent_us();
        if silent_us < QUIET_US {
            return (Phase::Watching(due), Finding::Sound);
        }
        let period = self.period.as_millis();
        if due.ms == 0 {
            self.watch(due, (silent_us / 1_000).min(period + QUIET_US / 1_000), 0, evidence)
        } else {
            self.watch(due, period, evidence.moved, evidence)
        }
    }

    /// The motor was silent for so long.
    fn watch(&mut self, due: Due, ms: u32, moved: i32, evidence: &Evidence) -> (Phase, Finding) {
        // Speeds are compared as they are stored: this runs at every tick.
        let asked = evidence.order.target.to_bits();
        if asked.unsigned_abs() < COUNTING_SPEED.to_bits().unsigned_abs() {
            self.heard.forget();
            return (Phase::Watching(Due::NONE), Finding::Sound);
        }
        let clockwise = asked > 0;
        let push = evidence.order.push.to_volts();
        let push = if clockwise { push } else { -push };
        // One that should become slower may come to rest.
        let asked = along(clockwise, evidence.order.target);
        let turned = self
            .heard
            .turned(clockwise, self.push_when_heard.to_volts())
            .filter(|turned| turned.pace <= AS_ASKED * asked);
        let (due, counts) = match turned {
            Some(turned) => (due.turning_on(ms, moved, &turned, push, evidence), GOING_ON_COUNTS),
            None if push <= HELD_VOLTS => return (Phase::Watching(Due::NONE), Finding::Sound),
            None => {
                let acceleration = evidence.gain.unwrap_or(0.0) * (push - HELD_VOLTS);
                let turns = along(clockwise, evidence.order.velocity);
                (due.plus(ms, moved, acceleration, turns), DUE_COUNTS)
            }
        };
        let pushed_ms = if push > HELD_VOLTS { due.pushed_ms.saturating_add(ms) } else { 0 };
        let due = Due { pushed_ms, ..due };
        let missed = due.ms >= STUCK_MS && due.way >= counts;
        let missed_anyway = evidence.gain.is_none() && pushed_ms >= self.anyway_ms(clockwise, evidence);
        if !missed && !missed_anyway {
            return (Phase::Watching(due), Finding::Sound);
        }
        let suspect = Suspect::new(clockwise, turned, evidence);
        // A motor of which nothing is known takes too long.
        let known = evidence.gain.is_some() || turned.is_some();
        if known && 4 * self.period.as_millis() + STUCK_MS <= DECIDED_MS {
            (Phase::Releasing(suspect, due.anew()), Finding::Release)
        } else {
            Self::driven_back(suspect, due, evidence)
        }
    }

    /// After so long a motor of which nothing is known should have moved.
    fn anyway_ms(&self, clockwise: bool, evidence: &Evidence) -> u32 {
        if evidence.has_few_counts() {
            FEW_COUNTS_MS
        } else if self.heard.clockwise() == Some(!clockwise) {
            TURNING_BACK_MS
        } else {
            ANYWAY_MS
        }
    }

    fn release(&self, suspect: Suspect, due: Due, heard: bool, evidence: &Evidence) -> (Phase, Finding) {
        let due = due.plus(self.period.as_millis(), evidence.moved, 0.0, 0.0);
        if heard {
            due.stalled(suspect.clockwise)
        } else if due.ms < RELEASE_MS {
            (Phase::Releasing(suspect, due), Finding::Release)
        } else {
            Self::driven_back(suspect, due, evidence)
        }
    }

    /// The motor is driven the other way from now on, if it may be.
    fn driven_back(suspect: Suspect, due: Due, evidence: &Evidence) -> (Phase, Finding) {
        if evidence.probing {
            (Phase::Reversing(suspect, due.anew()), Finding::Probe(back(suspect.clockwise)))
        } else {
            (Phase::Watching(Due::NONE), Finding::Fault(EncoderFault::Stuck))
        }
    }

    fn reverse(&self, suspect: Suspect, due: Due, heard: bool, evidence: &Evidence) -> (Phase, Finding) {
        let effort = REVERSE_SHARE * evidence.battery - suspect.holds;
        let due = due.plus(self.period.as_millis(), evidence.moved, suspect.gain * effort, 0.0);
        if heard {
            due.stalled(suspect.clockwise)
        } else if due.ms >= REVERSE_MS && due.way >= REVERSE_COUNTS {
            (Phase::Watching(Due::NONE), Finding::Fault(EncoderFault::Stuck))
        } else if due.ms >= REVERSE_MS && (effort <= 0.0 || due.ms >= LONGEST_REVERSE_MS) {
            due.stalled(suspect.clockwise)
        } else {
            (Phase::Reversing(suspect, due), Finding::Probe(back(suspect.clockwise)))
        }
    }
}

fn seconds(ms: u32) -> f32 {
    1e-3 * ms as f32
}

/// Counts/s in that direction.
fn along(clockwise: bool, speed: CountsPerSecond) -> f32 {
    if clockwise { speed.to_f32() } else { -speed.to_f32() }
}

const fn back(clockwise: bool) -> Control {
    Control::new(if clockwise { -REVERSE } else { REVERSE })
}
