//! Decides why a motor does not count: a stop blocks it (a *stall*), or its encoder is stuck (a *fault*).
//!
//! ```text
//!                      too few counts
//!     ┌── Watching ────────────────────────▶ Releasing ─── counts ───┐
//!     │    ▲  ▲  │                               │                   │
//!     └────┘  │  │ too few counts,               │ release           │
//!     counts  │  │ no time for a release         │ time over         ▼
//!             │  ▼                               │                Stalled ───▶ Watching
//!       fault └─ Probing ◀───────────────────────┘                   ▲    free, or turned back
//!                  │                                                 │
//!                  └──────── counts, or no distance expected ────────┘
//! ```
//!
//! * *Silence*: no motion, which is a step of two counts or more (see `last_motion`). One broken wire makes no motion.
//! * *Too few counts*: in a silence the expected distance (see `expected`) has reached a limit. A motor of unknown gain
//!   also has a time-out.
//! * *Releasing*: the bridge brakes. A springy stop or a lifted load moves the motor, so counts mean a stall.
//! * *Probing*: the motor is driven in the other direction once. A released motor that did not move has no load in that
//!   direction, which the probe could accelerate. Counts mean a stall; a missing distance means a fault.
//! * *Stalled*: the loop drives the motor as before, without another probe. The stall ends when the requested direction
//!   changes, or when the motor turns beyond its stop.
//!
//! A jammed motor on a low battery may be unable to turn in the probe. No distance is expected then, and the motor
//! counts as stalled. Where probing is not allowed, the fault is reported instead of a probe.

use super::expected::{Expected, LOAD};
use super::last_motion::{LastMotion, SteadyMotion};
use super::{EXPECTED_COUNTS, EncoderFault, Evidence, Finding};
use crate::motion::Reading;
use crate::units::{Control, CountsPerSecond, Period, Voltage};

/// Limits of the state Watching: they say when a motor that should turn has too few counts.
struct WatchLimits {
    /// Longest time between two motions that is no silence, in µs.
    quiet_us: u32,
    /// Least requested speed that is watched, in counts/s.
    least_speed_cps: f32,
    /// Largest ratio of speed to requested speed of a motor that should keep its speed. A faster motor should slow
    /// down.
    speed_ratio: f32,
    /// Shortest silence with too few counts, in ms. Released and probed at a period of up to 51 ms, the motor is then
    /// judged within [`ProbeLimits::decided_ms`].
    silence_ms: u32,
    /// Expected distance of a motor that turned steadily, in counts. A sound encoder misses fewer when a load reverses
    /// the motor, between the last motion before and the first one after.
    turning_counts: f32,
    /// Time-out of a motor of unknown gain, in ms. It runs while the drive voltage exceeds the heaviest friction.
    unknown_ms: u32,
    /// Time-out of a motor of unknown gain that last turned in the other direction, in ms. A heavy motor
    /// may take that long to reverse.
    reversing_ms: u32,
    /// Back EMF constant above which a motor has few counts, in V per count/s: fewer than 1000 counts/s at 12 V. Such a
    /// motor has its gear before the encoder, or a heavy rotor.
    few_counts_emf_volts_per_cps: f32,
    /// Time-out of a motor of unknown gain that has few counts, in ms.
    few_counts_ms: u32,
}

const WATCH: WatchLimits = WatchLimits {
    quiet_us: 10_000,
    least_speed_cps: 40.0,
    speed_ratio: 1.5,
    silence_ms: 46,
    turning_counts: 12.0,
    unknown_ms: 140,
    reversing_ms: 800,
    few_counts_emf_volts_per_cps: 0.012,
    few_counts_ms: 3_000,
};

/// Limits of the states Releasing and Probing.
struct ProbeLimits {
    /// Longest time from the last motion to a decision, in ms. Where a release would exceed the time, the motor is
    /// probed without one.
    decided_ms: u32,
    /// Time in Releasing, in ms.
    release_ms: u32,
    /// Shortest time in Probing, in ms.
    probe_ms: u32,
    /// Longest time in Probing, in ms. A motor whose expected distance is too short until then counts as stalled.
    longest_ms: u32,
    /// Expected distance of the probe, in counts. Without a motion until then, the encoder is at fault.
    counts: f32,
    /// Drive voltage of the probe, as a share of the battery voltage.
    drive_share: f32,
    /// Longest mechanical time constant of a motor of unknown gain, in s.
    time_constant_s: f32,
    /// Longest mechanical time constant of a motor of unknown gain that has few counts, in s.
    few_counts_time_constant_s: f32,
}

const PROBE: ProbeLimits = ProbeLimits {
    decided_ms: 250,
    release_ms: 50,
    probe_ms: 50,
    longest_ms: 2_000,
    counts: 2.0,
    drive_share: 0.9,
    time_constant_s: 2.5,
    few_counts_time_constant_s: 50.0,
};

/// Limits beyond which a stalled motor is free.
struct StallLimits {
    /// Least distance beyond the stop, in counts. Toggling by one count stays below it.
    counts: i64,
    /// Least share of the requested speed.
    speed_share: f32,
    /// Time that the motor must spend beyond the stop at that speed, in ms.
    free_ms: u32,
}

const STALL: StallLimits = StallLimits { counts: 2, speed_share: 0.5, free_ms: 150 };

/// The check of one motor for a stuck encoder.
#[derive(Clone, Copy, Debug)]
pub(super) struct StuckCheck {
    period: Period,
    state: State,
    motion: LastMotion,
    /// Drive voltage at the tick of the last motion.
    drive_at_motion: Voltage,
}

/// States of the check; the diagram at the top of the file has the transitions.
#[derive(Clone, Copy, Debug)]
enum State {
    /// The loop drives the motor. The expectation covers the present silence.
    Watching(Expected),
    /// The bridge brakes. The expectation counts the time.
    Releasing(Suspect, Expected),
    /// The motor is driven in the other direction.
    Probing(Suspect, Expected),
    /// The loop drives the motor against a stop.
    Stalled(Stall),
}

/// A motor that had too few counts.
#[derive(Clone, Copy, Debug)]
struct Suspect {
    /// True if the requested direction is clockwise.
    clockwise: bool,
    /// Least gain: acceleration per volt, in counts/s².
    gain_cps2_per_volt: f32,
    /// Largest resisting torque in the probe, as a voltage.
    resisting_volts: f32,
}

impl Suspect {
    /// `steady` is the motion before the silence; `None` for a motor that started from rest.
    fn new(clockwise: bool, steady: Option<SteadyMotion>, evidence: &Evidence) -> Self {
        let time_constant =
            if evidence.has_few_counts() { PROBE.few_counts_time_constant_s } else { PROBE.time_constant_s };
        let slowest = 1.0 / (time_constant * evidence.emf.to_volts());
        let least = steady.map_or(slowest, |steady| steady.least_gain().max(slowest));
        // A load that resisted the motion helps the probe, so the probe meets no more resistance than the motion. The
        // uncertainty is counted twice.
        let resisting = steady.map(|steady| steady.resisting_volts(evidence));
        let resisting_volts = resisting
            .filter(|volts| *volts > LOAD.uncertainty_volts)
            .map_or(LOAD.friction_volts, |volts| LOAD.friction_volts.min(volts + LOAD.uncertainty_volts));
        Self { clockwise, gain_cps2_per_volt: evidence.gain.unwrap_or(least), resisting_volts }
    }

    /// Control value of the probe.
    fn probe_control(&self) -> Control {
        let value = (PROBE.drive_share * Control::MAX.get() as f32) as i16;
        Control::new(if self.clockwise { -value } else { value })
    }
}

/// A stop that blocks the motor.
#[derive(Clone, Copy, Debug)]
struct Stall {
    /// True if the stop blocks clockwise motion.
    clockwise: bool,
    /// Distance beyond the stop in the blocked direction, in counts.
    beyond: i64,
    /// Time for which the motor has turned beyond the stop as requested, in ms.
    free_ms: u32,
}

impl Stall {
    /// `moved` is the distance since the stop, in counts, positive clockwise.
    const fn new(clockwise: bool, moved: i64) -> Self {
        Self { clockwise, beyond: if clockwise { moved } else { -moved }, free_ms: 0 }
    }

    /// Adds a tick. Returns true if the stall is over.
    fn step(&mut self, period: Period, evidence: &Evidence) -> bool {
        let moved = i64::from(evidence.moved);
        self.beyond += if self.clockwise { moved } else { -moved };
        let requested = signed(self.clockwise, evidence.order.target);
        let turns = signed(self.clockwise, evidence.velocity) >= STALL.speed_share * requested;
        let free = turns && self.beyond >= STALL.counts;
        self.free_ms = if free { self.free_ms.saturating_add(period.as_millis()) } else { 0 };
        requested < 0.0 || (requested > 0.0 && self.free_ms >= STALL.free_ms)
    }
}

impl Evidence {
    /// True if the motor has fewer than 1000 counts/s at 12 V.
    fn has_few_counts(&self) -> bool {
        self.emf.to_volts() > WATCH.few_counts_emf_volts_per_cps
    }
}

impl StuckCheck {
    /// Creates a check that is stepped every `period`.
    pub(super) fn new(period: Period) -> Self {
        Self {
            period,
            state: State::Watching(Expected::NONE),
            motion: LastMotion::default(),
            drive_at_motion: Voltage::from_volts(0.0),
        }
    }

    /// Expects nothing until the next silence. Position and direction of the last motion stay known.
    pub(super) const fn reset(&mut self) {
        self.state = State::Watching(Expected::NONE);
        self.motion.forget();
    }

    /// True in the states Releasing and Probing.
    pub(super) const fn is_examining(&self) -> bool {
        matches!(self.state, State::Releasing(..) | State::Probing(..))
    }

    /// Takes a sample of the encoder, and the estimated disturbance in counts/s².
    pub(super) fn sample(&mut self, reading: &Reading, disturbance: impl FnOnce() -> f32) {
        self.motion.sample(reading, disturbance);
    }

    /// Takes a tick: chooses the next state and what the motor has to do.
    pub(super) fn step(&mut self, evidence: &Evidence) -> Finding {
        let moved = self.motion.take_moved();
        if moved {
            self.drive_at_motion = evidence.order.push;
        }
        let (state, finding) = match self.state {
            State::Watching(expected) => self.watch(if moved { Expected::NONE } else { expected }, evidence),
            State::Releasing(suspect, expected) | State::Probing(suspect, expected) if moved => {
                let stall = Stall::new(suspect.clockwise, expected.moved + i64::from(evidence.moved));
                (State::Stalled(stall), Finding::Stalled)
            }
            State::Releasing(suspect, expected) => self.release(suspect, expected, evidence),
            State::Probing(suspect, expected) => self.probe(suspect, expected, evidence),
            State::Stalled(mut stall) => {
                self.motion.forget();
                if stall.step(self.period, evidence) {
                    (State::Watching(Expected::NONE), Finding::Sound)
                } else {
                    (State::Stalled(stall), Finding::Stalled)
                }
            }
        };
        self.state = state;
        finding
    }

    /// Takes a tick in Watching: extends the expectation in a silence, and examines a motor with too few counts.
    fn watch(&mut self, expected: Expected, evidence: &Evidence) -> (State, Finding) {
        let silent_us = self.motion.silent_us();
        if silent_us < WATCH.quiet_us {
            return (State::Watching(expected), Finding::Sound);
        }
        let target = evidence.order.target;
        let requested = target.to_f32().abs();
        if requested < WATCH.least_speed_cps {
            self.motion.forget();
            return (State::Watching(Expected::NONE), Finding::Sound);
        }
        let clockwise = target > CountsPerSecond::ZERO;
        let drive_volts = evidence.order.push.to_volts();
        let drive_volts = if clockwise { drive_volts } else { -drive_volts };
        let period_ms = self.period.as_millis();
        let (ms, moved) = if expected.ms == 0 {
            // The silence began at the last motion, some time before this tick.
            ((silent_us / 1_000).min(period_ms + WATCH.quiet_us / 1_000), 0)
        } else {
            (period_ms, evidence.moved)
        };
        // A motor that should slow down may come to rest.
        let steady = self
            .motion
            .steady(clockwise, self.drive_at_motion.to_volts())
            .filter(|steady| steady.speed_cps <= WATCH.speed_ratio * requested);
        let (mut expected, counts) = match steady {
            Some(steady) => {
                (expected.keep_turning(ms, moved, &steady, drive_volts, evidence), WATCH.turning_counts)
            }
            None if drive_volts <= LOAD.friction_volts => {
                return (State::Watching(Expected::NONE), Finding::Sound);
            }
            None => {
                let acceleration = evidence.gain.unwrap_or(0.0) * (drive_volts - LOAD.friction_volts);
                let speed = signed(clockwise, evidence.order.velocity);
                (expected.accelerate(ms, moved, acceleration, speed), EXPECTED_COUNTS)
            }
        };
        expected.driven_ms =
            if drive_volts > LOAD.friction_volts { expected.driven_ms.saturating_add(ms) } else { 0 };
        let too_few = expected.ms >= WATCH.silence_ms && expected.distance_counts >= counts;
        let timed_out =
            evidence.gain.is_none() && expected.driven_ms >= self.time_out_ms(clockwise, evidence);
        if !too_few && !timed_out {
            return (State::Watching(expected), Finding::Sound);
        }
        let suspect = Suspect::new(clockwise, steady, evidence);
        // The time-out of a motor of unknown gain leaves no time for a release.
        let known = evidence.gain.is_some() || steady.is_some();
        if known && 4 * period_ms + WATCH.silence_ms <= PROBE.decided_ms {
            (State::Releasing(suspect, expected.restart()), Finding::Release)
        } else {
            Self::begin_probe(suspect, expected, evidence)
        }
    }

    /// Time-out of a motor of unknown gain, in ms.
    fn time_out_ms(&self, clockwise: bool, evidence: &Evidence) -> u32 {
        if evidence.has_few_counts() {
            WATCH.few_counts_ms
        } else if self.motion.clockwise() == Some(!clockwise) {
            WATCH.reversing_ms
        } else {
            WATCH.unknown_ms
        }
    }

    /// Takes a tick in Releasing without a motion.
    fn release(&self, suspect: Suspect, expected: Expected, evidence: &Evidence) -> (State, Finding) {
        let expected = expected.accelerate(self.period.as_millis(), evidence.moved, 0.0, 0.0);
        if expected.ms < PROBE.release_ms {
            (State::Releasing(suspect, expected), Finding::Release)
        } else {
            Self::begin_probe(suspect, expected, evidence)
        }
    }

    /// Begins the probe. Where probing is not allowed, the encoder is at fault without a probe.
    fn begin_probe(suspect: Suspect, expected: Expected, evidence: &Evidence) -> (State, Finding) {
        if evidence.probing {
            (State::Probing(suspect, expected.restart()), Finding::Probe(suspect.probe_control()))
        } else {
            (State::Watching(Expected::NONE), Finding::Fault(EncoderFault::Stuck))
        }
    }

    /// Takes a tick in Probing without a motion: the encoder is at fault once a distance was expected.
    fn probe(&self, suspect: Suspect, expected: Expected, evidence: &Evidence) -> (State, Finding) {
        let volts = PROBE.drive_share * evidence.battery - suspect.resisting_volts;
        let acceleration = suspect.gain_cps2_per_volt * volts;
        let expected = expected.accelerate(self.period.as_millis(), evidence.moved, acceleration, 0.0);
        if expected.ms >= PROBE.probe_ms && expected.distance_counts >= PROBE.counts {
            (State::Watching(Expected::NONE), Finding::Fault(EncoderFault::Stuck))
        } else if expected.ms >= PROBE.probe_ms && (volts <= 0.0 || expected.ms >= PROBE.longest_ms) {
            let stall = Stall::new(suspect.clockwise, expected.moved);
            (State::Stalled(stall), Finding::Stalled)
        } else {
            (State::Probing(suspect, expected), Finding::Probe(suspect.probe_control()))
        }
    }
}

/// The speed in counts/s, positive in the direction `clockwise`.
fn signed(clockwise: bool, speed: CountsPerSecond) -> f32 {
    if clockwise { speed.to_f32() } else { -speed.to_f32() }
}
