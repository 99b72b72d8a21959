//! Checks the encoder of a regulated motor by drive voltage and counts. With an encoder that is unplugged or reversed,
//! a regulated motor runs away.
//!
//! ```text
//!                 full reverse, wrong speed                 free, or reversed request
//!   RunningAway ◀────────────────────────── Watching ◀───────────────────────────────┐
//!     │    │                                 ▲    │                                   │
//!     │    └──────── right speed ────────────┘    │ too few counts                    │
//!     │                                           ▼                                   │
//!     │ not slower                            Releasing ────────── counts ─────────▶ Stalled
//!     │                                           │ time over                         ▲
//!     ▼                                           ▼                                   │
//!   Faulty ◀────── expected distance ───────── Probing ─── counts, or no distance ────┘
//! ```
//!
//! Terms:
//!
//! * *Drive voltage*: the mean voltage across the motor.
//! * *Gain*: the motor's acceleration per volt. An *unknown motor* has no configured gain, and its estimate does not
//!   yet show a heavy motor.
//! * *Motion*: a step of two counts or more. An encoder with one broken wire makes no motion (see `last_motion`).
//! * *Silence*: the time since the last motion.
//! * *Expected distance*: the distance that a healthy motor covers at least in a silence or a probe (see `expected`).
//! * *Too few counts*: the expected distance of a silence has reached a limit. An unknown motor also has a time-out.
//! * *Stall*: a stop or a load holds the motor. A stall is no fault.
//!
//! States:
//!
//! * *Watching*: the regulator drives the motor. The check computes the expected distance of each silence.
//! * *Releasing*: the bridge brakes, so that a springy stop or a lifted load can move the motor. Counts mean a stall. If
//!   there is no time for a release, the motor is probed without one.
//! * *Probing*: the motor is driven in the other direction once. Counts mean a stall. If the expected distance is reached
//!   without counts, the encoder is stuck. On a low battery a jammed motor may have no expected distance, and counts as
//!   stalled. If the settings forbid probing, the motor gets the fault instead of a probe.
//! * *Stalled*: the regulator drives the motor, and there is no further probe. The stall ends when the requested
//!   direction changes, or when the motor turns beyond its stop. A stalled motor can run away too. The motor is stalled
//!   again when the runaway ends.
//! * *RunningAway*: the bridge is in reverse at the end of the control range. Still the motor turns in the wrong
//!   direction, or at least twice as fast as requested. A motor with a sound encoder becomes slower, unless its load
//!   exceeds the stall torque. If the motor does not become slower, its encoder is reversed.
//! * *Faulty*: the encoder is stuck or reversed. The check has ended: the motor latches the fault until it is disabled.
//!
//! | motor | time to a fault |
//! |---|---|
//! | turned steadily, then silent | 250 ms, at every control period |
//! | other clear cases | 250 ms from full drive voltage on |
//! | has few counts | longer, by the time that counts take |
//! | unknown, last turned in the other direction | 1 s, because a heavy motor may take that long to reverse |
//! | unknown, has toggled by a few counts | 1 s, because a heavy motor may take that long to start |
//! | unknown, with fewer than 1000 counts/s at 12 V | some 4 s |
//! | unknown, runs away after its encoder counted in the right direction | 2.2 s if it does not become faster, because the motor may be heavy |
//!
//! The check excludes three kinds of motors. A motor in open loop needs no encoder. From a motor that holds its position,
//! no count is due. A motor at rest on a low battery may be unable to turn against friction.
//!
//! Constants without a stated source have none on record. `motor-hub soak --sweep` counts false alarms with the constants
//! (see `docs/concepts/faults.md`), and `tests/guard.rs` checks the times.

use super::expected::{Expected, LOAD, Tick};
use super::last_motion::{LastMotion, SteadyRun};
use crate::braking::{Regime, Scheme};
use crate::units::{Control, CountsPerSecond};
use libm::sqrtf;

/// Distance that a motor from rest should cover before missing counts matter, in counts.
const EXPECTED_COUNTS: f32 = 6.0;

/// Limits of the state Watching.
struct WatchLimits {
    /// Shortest silence that is examined, in µs.
    quiet_us: u32,
    /// Least requested speed that is watched, in counts/s.
    least_speed_cps: f32,
    /// Largest ratio of speed to requested speed at which a motor should keep turning. A faster motor should slow down,
    /// and may come to rest.
    speed_ratio: f32,
    /// Shortest silence with too few counts, in ms. At a control period of up to 51 ms, a release and a probe then end
    /// within [`ProbeLimits::decided_ms`].
    silence_ms: u32,
    /// Expected distance of a silence after a steady run, in counts. When a load reverses a motor with a sound encoder,
    /// fewer counts are missing.
    turning_counts: f32,
    /// Time-out of an unknown motor, in ms. The time runs while the drive voltage exceeds the heaviest friction.
    unknown_ms: u32,
    /// Time-out of an unknown motor that last turned in the other direction or creeps, in ms. A heavy motor may take that
    /// long to reverse or to start.
    heavy_ms: u32,
    /// Back EMF constant above which a motor has few counts, in V per count/s. The limit is 1000 counts/s at 12 V. A motor
    /// with few counts has its gear before the encoder, or a heavy rotor.
    few_counts_emf_volts_per_cps: f32,
    /// Time-out of an unknown motor with few counts, in ms.
    few_counts_ms: u32,
}

const WATCH: WatchLimits = WatchLimits {
    quiet_us: 10_000,
    least_speed_cps: 40.0,
    speed_ratio: 1.5,
    silence_ms: 46,
    turning_counts: 12.0,
    unknown_ms: 140,
    heavy_ms: 800,
    few_counts_emf_volts_per_cps: 0.012,
    few_counts_ms: 3_000,
};

/// Limits of the states Releasing and Probing.
struct ProbeLimits {
    /// Longest time from the last motion to a decision, in ms. Where a release would exceed this time, the motor is
    /// probed without a release.
    decided_ms: u32,
    /// Time in Releasing, in ms.
    release_ms: u32,
    /// Shortest time in Probing, in ms.
    probe_ms: u32,
    /// Longest time in Probing, in ms. A motor whose expected distance is still too short then counts as stalled.
    longest_ms: u32,
    /// Expected distance of the probe, in counts. If there is no motion within this distance, the encoder is stuck.
    counts: f32,
    /// Drive voltage of the probe, as a share of the battery voltage.
    drive_share: f32,
    /// Longest mechanical time constant of an unknown motor, in s.
    time_constant_s: f32,
    /// Longest mechanical time constant of an unknown motor with few counts, in s.
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

/// Limits of the state Stalled. A motor beyond all of these limits is free.
struct StallLimits {
    /// Least distance beyond the stop, in counts. Toggling by one count stays below this distance.
    counts: i32,
    /// Least speed, as a share of the requested speed.
    speed_share: f32,
    /// Shortest time beyond the stop at that speed, in ms.
    free_ms: u32,
}

const STALL: StallLimits = StallLimits { counts: 2, speed_share: 0.5, free_ms: 150 };

/// Limits of the state RunningAway. The check compares the mean speeds of two spans of time, *early* and *late*.
struct RunawayLimits {
    /// Least magnitude of a control value at the end of the control range: 15/16 of the range. The other 1/16 allows for
    /// rounding in the loop.
    full_control: i16,
    /// Length of the early span, in ms.
    early_ms: u32,
    /// Extension of the early span plus one tick, in ms. With a tick of 10 ms the extension is 40 ms. A springy stop throws
    /// a motor back for some 50 ms.
    extension_ms: u32,
    /// Length of the late span before a fault, in ms.
    late_ms: u32,
    /// Length of the first late span of a motor whose control range may end before full reverse, in ms. After this span
    /// the bridge gets full reverse. The early span of such a motor has no extension.
    hint_ms: u32,
    /// Fewest counts in 50 ms of the early span: 160 counts/s.
    counts_in_50_ms: i64,
    /// Drive voltage of the time for [`EXPECTED_COUNTS`], in volts.
    drive_volts: f32,
    /// Longest time for [`EXPECTED_COUNTS`] that needs no extension, in ms. The spans of a slower motor are extended by
    /// their time.
    slow_ms: u32,
    /// Longest extension of a span, in ms.
    longest_ms: u32,
    /// Least extension of the spans of an unknown motor whose encoder has counted in the right direction, in ms. The motor
    /// may be heavy, and slow down by less than a count in a short span.
    trusted_ms: u32,
    /// Counts beyond those of the early span with which such a motor has clearly become faster, so that its encoder is
    /// reversed. Each span has an error of one count.
    faster_counts: i64,
    /// Counts of a late span from which on the errors of both spans are small beside the speed. With fewer counts, and no
    /// more than `error_counts` beyond those of the early span, another late span follows.
    exact_counts: i64,
    /// Errors of both spans together, in counts.
    error_counts: i64,
}

const RUNAWAY: RunawayLimits = RunawayLimits {
    full_control: 30_720,
    early_ms: 50,
    extension_ms: 50,
    late_ms: 100,
    hint_ms: 50,
    counts_in_50_ms: 8,
    drive_volts: 6.0,
    slow_ms: 150,
    longest_ms: 2_000,
    trusted_ms: 1_000,
    faster_counts: 4,
    exact_counts: 40,
    error_counts: 2,
};

/// A fault of an encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncoderFault {
    /// The encoder does not count in either direction of drive.
    Stuck,
    /// The encoder counts against the drive voltage.
    Reversed,
}

impl Tick<'_> {
    /// Control value of the command.
    fn control(&self) -> Control {
        self.command.control(self.context.modulator)
    }

    /// True if the motor has fewer than 1000 counts/s at 12 V.
    fn has_few_counts(&self) -> bool {
        self.kappa() > WATCH.few_counts_emf_volts_per_cps
    }

    /// True if the end of the control range may be less than full reverse: by PID in Schemes C and D.
    fn ends_before_full_reverse(&self) -> bool {
        let settings = self.context.settings;
        settings.coefficients.is_some() && matches!(settings.scheme, Scheme::C | Scheme::D(_))
    }

    /// True if the motor turns in the wrong direction, or at least twice as fast as requested, against full control in
    /// reverse.
    fn runs_away(&self) -> bool {
        let velocity = i64::from(self.regulator.velocity().to_bits());
        let twice = 2 * i64::from(self.target.to_bits());
        let wrong_speed = if velocity < 0 { twice >= velocity } else { twice <= velocity };
        wrong_speed
            && self.command.limited.regime == Regime::Reverse
            && self.control().get().abs() >= RUNAWAY.full_control
    }
}

/// What the motor has to do at this tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Finding {
    /// Follow the regulator: there is no fault.
    Sound,
    /// Brake, and wait for counts.
    Release,
    /// Apply this control value in open loop.
    Probe(Control),
    /// Apply full reverse, in every scheme. The control value is the end of the range.
    FullReverse(Control),
    /// End the regulation: the encoder is at fault.
    Fault(EncoderFault),
}

/// The encoder check of one motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct EncoderCheck {
    state: State,
    /// True for an unknown motor whose encoder has counted in the right direction since the regulation began. A heavy motor
    /// turns against its voltage for so long that the regulator trusts the encoder no longer; the check still does.
    trusted: bool,
}

/// States of the check; the diagram at the top of the file has the transitions.
#[derive(Clone, Copy, Debug)]
enum State {
    /// The regulator drives the motor. The expectation covers the present silence.
    Watching(Expected),
    /// The regulator drives the motor in reverse, at the end of the control range.
    RunningAway(Runaway),
    /// The bridge has braked for this time, in ms.
    Releasing(Suspect, u32),
    /// The motor is driven in the other direction. The expectation covers the probe.
    Probing(Suspect, Expected),
    /// The regulator drives the motor against a stop.
    Stalled(Stall),
}

impl EncoderCheck {
    /// The check of a motor whose regulation begins.
    pub(super) const fn new() -> Self {
        Self { state: State::Watching(Expected::NONE), trusted: false }
    }

    /// True if the motor is stalled.
    pub(super) const fn is_stalled(&self) -> bool {
        matches!(self.state, State::Stalled(_) | State::RunningAway(Runaway { stall: Some(_), .. }))
    }

    /// Notes a set-point of another kind or direction, or a tick without regulation. A release or a probe ends, so that
    /// the next motion is not disturbed. A set-point that continues the motion must not end them: a host that streams
    /// set-points would hide a fault of the encoder. Returns true if there was a release, a probe or a stall.
    pub(super) const fn interrupt(&mut self, last_motion: &mut LastMotion) -> bool {
        let examining = matches!(self.state, State::Releasing(..) | State::Probing(..));
        if examining {
            self.state = State::Watching(Expected::NONE);
            last_motion.forget();
        }
        examining || self.is_stalled()
    }

    /// Takes a regulated tick: chooses the next state, and says what the motor has to do.
    pub(super) fn step(&mut self, last_motion: &mut LastMotion, tick: &Tick<'_>) -> Finding {
        let moved = last_motion.take_moved();
        self.trusted |= tick.regulator.trusts_encoder();
        let turns = last_motion.silent_us() < WATCH.quiet_us;
        let (state, finding) = match self.state {
            State::Watching(_) if turns && tick.runs_away() => {
                Runaway::new(tick, None, self.trusted).step(tick)
            }
            State::Stalled(stall) if turns && tick.runs_away() => {
                Runaway::new(tick, Some(stall), self.trusted).step(tick)
            }
            State::RunningAway(runaway) if turns && tick.runs_away() => runaway.step(tick),
            State::Watching(_) if moved => watch(Expected::NONE, last_motion, tick),
            State::Watching(expected) => watch(expected, last_motion, tick),
            State::RunningAway(Runaway { stall: Some(stall), .. }) | State::Stalled(stall) => {
                last_motion.forget();
                stall.step(tick)
            }
            State::RunningAway(_) => watch(Expected::NONE, last_motion, tick),
            State::Releasing(suspect, _) | State::Probing(suspect, _) if moved => suspect.stall(),
            State::Releasing(suspect, ms) => suspect.release(ms + tick.period_ms(), tick),
            State::Probing(suspect, expected) => suspect.probe(expected, last_motion.may_creep(), tick),
        };
        self.state = state;
        finding
    }
}

/// Takes a tick in Watching: extends the expectation in a silence, and releases or probes a motor with too few counts.
fn watch(expected: Expected, last_motion: &mut LastMotion, tick: &Tick<'_>) -> (State, Finding) {
    let silent_us = last_motion.silent_us();
    if silent_us < WATCH.quiet_us {
        return (State::Watching(expected), Finding::Sound);
    }
    let requested = tick.target.to_f32().abs();
    if requested < WATCH.least_speed_cps {
        last_motion.forget();
        return (State::Watching(Expected::NONE), Finding::Sound);
    }
    let clockwise = tick.target > CountsPerSecond::ZERO;
    let drive_volts = along(clockwise, tick.command.voltage.to_volts());
    // The silence began at the last motion, some time before this tick.
    let ms = match expected.ms {
        0 => (silent_us / 1_000).min(tick.period_ms() + WATCH.quiet_us / 1_000),
        _ => tick.period_ms(),
    };
    // A motor that should slow down may come to rest.
    let run = last_motion.steady(clockwise).filter(|run| run.speed_cps <= WATCH.speed_ratio * requested);
    let least_gain = tick.regulator.least_gain();
    let (mut expected, counts) = match run {
        Some(run) => (expected.keep_turning(ms, &run, drive_volts, tick), WATCH.turning_counts),
        None if drive_volts <= LOAD.friction_volts => {
            return (State::Watching(Expected::NONE), Finding::Sound);
        }
        None => {
            let acceleration = least_gain.unwrap_or(0.0) * (drive_volts - LOAD.friction_volts);
            let speed = along(clockwise, tick.commanded_at_speed());
            (expected.accelerate(ms, acceleration, speed), EXPECTED_COUNTS)
        }
    };
    expected.driven_ms =
        if drive_volts > LOAD.friction_volts { expected.driven_ms.saturating_add(ms) } else { 0 };
    let too_few = expected.ms >= WATCH.silence_ms && expected.distance_counts >= counts;
    let timed_out = least_gain.is_none() && expected.driven_ms >= time_out_ms(last_motion, clockwise, tick);
    if !too_few && !timed_out {
        return (State::Watching(expected), Finding::Sound);
    }
    let suspect = Suspect::new(clockwise, run, tick);
    // The time-out of an unknown motor leaves no time for a release.
    let known = least_gain.is_some() || run.is_some();
    if known && 4 * tick.period_ms() + WATCH.silence_ms <= PROBE.decided_ms {
        (State::Releasing(suspect, 0), Finding::Release)
    } else {
        suspect.begin_probe(tick)
    }
}

/// Time-out of an unknown motor, in ms.
fn time_out_ms(last_motion: &LastMotion, clockwise: bool, tick: &Tick<'_>) -> u32 {
    if tick.has_few_counts() {
        WATCH.few_counts_ms
    } else if last_motion.clockwise() == Some(!clockwise) || last_motion.may_creep() {
        WATCH.heavy_ms
    } else {
        WATCH.unknown_ms
    }
}

/// A motor that had too few counts, and is released or probed.
#[derive(Clone, Copy, Debug)]
struct Suspect {
    /// True if the requested direction is clockwise.
    clockwise: bool,
    /// Position at which the motor had too few counts, in counts.
    position: i32,
    /// Least gain: acceleration per volt, in counts/s².
    gain_cps2_per_volt: f32,
    /// Largest resisting torque in the probe, in volts.
    resisting_volts: f32,
    /// True for an unknown motor that started from rest: the motor may be too heavy for the expected distance.
    may_be_heavy: bool,
}

impl Suspect {
    /// `run` is the steady run before the silence; `None` for a motor that started from rest.
    fn new(clockwise: bool, run: Option<SteadyRun>, tick: &Tick<'_>) -> Self {
        let time_constant =
            if tick.has_few_counts() { PROBE.few_counts_time_constant_s } else { PROBE.time_constant_s };
        let slowest = 1.0 / (time_constant * tick.kappa());
        let least = run.map_or(slowest, |run| run.least_gain().max(slowest));
        // A load that resisted the motion helps the probe. So the probe meets no more resistance than the motion did. The
        // uncertainty is counted twice. A motor that started from rest may have the heaviest friction.
        let resisting_volts = run
            .map(|run| run.resisting_volts(tick))
            .filter(|volts| *volts > LOAD.uncertainty_volts)
            .map_or(LOAD.friction_volts, |volts| LOAD.friction_volts.min(volts + LOAD.uncertainty_volts));
        let known = tick.regulator.least_gain();
        Self {
            clockwise,
            position: tick.position,
            gain_cps2_per_volt: known.unwrap_or(least),
            resisting_volts,
            may_be_heavy: known.is_none() && run.is_none(),
        }
    }

    /// Takes a tick in Releasing without a motion, `ms` after its beginning.
    fn release(self, ms: u32, tick: &Tick<'_>) -> (State, Finding) {
        if ms < PROBE.release_ms {
            (State::Releasing(self, ms), Finding::Release)
        } else {
            self.begin_probe(tick)
        }
    }

    /// Begins the probe. Where probing is not allowed, the encoder is at fault without a probe.
    fn begin_probe(self, tick: &Tick<'_>) -> (State, Finding) {
        if tick.context.settings.probing {
            (State::Probing(self, Expected::NONE), Finding::Probe(self.probe_control()))
        } else {
            (State::Watching(Expected::NONE), Finding::Fault(EncoderFault::Stuck))
        }
    }

    /// Takes a tick in Probing without a motion: the encoder is at fault when the expected distance is long enough. A heavy
    /// motor that `may_creep` gets the longest time.
    fn probe(self, expected: Expected, may_creep: bool, tick: &Tick<'_>) -> (State, Finding) {
        let volts = PROBE.drive_share * tick.context.at.battery_volts() - self.resisting_volts;
        let expected = expected.accelerate(tick.period_ms(), self.gain_cps2_per_volt * volts, 0.0);
        let shortest_ms = if self.may_be_heavy && may_creep { PROBE.longest_ms } else { PROBE.probe_ms };
        if expected.ms >= shortest_ms && expected.distance_counts >= PROBE.counts {
            (State::Watching(Expected::NONE), Finding::Fault(EncoderFault::Stuck))
        } else if expected.ms >= PROBE.longest_ms || volts <= 0.0 && expected.ms >= PROBE.probe_ms {
            self.stall()
        } else {
            (State::Probing(self, expected), Finding::Probe(self.probe_control()))
        }
    }

    /// Control value of the probe.
    fn probe_control(&self) -> Control {
        let value = (PROBE.drive_share * Control::MAX.get() as f32) as i16;
        Control::new(if self.clockwise { -value } else { value })
    }

    /// Begins a stall at the position where the motor had too few counts.
    const fn stall(self) -> (State, Finding) {
        let Self { clockwise, position, .. } = self;
        (State::Stalled(Stall { clockwise, position, free_ms: 0 }), Finding::Sound)
    }
}

/// A stop that blocks the motor.
#[derive(Clone, Copy, Debug)]
struct Stall {
    /// True if the stop blocks clockwise motion.
    clockwise: bool,
    /// Position of the stop, in counts.
    position: i32,
    /// Time for which the motor has turned beyond the stop as requested, in ms.
    free_ms: u32,
}

impl Stall {
    /// Takes a tick in Stalled: ends the stall of a free motor, or when the requested direction has changed.
    fn step(mut self, tick: &Tick<'_>) -> (State, Finding) {
        let moved = tick.position.wrapping_sub(self.position);
        let beyond = if self.clockwise { moved } else { moved.saturating_neg() };
        let requested = along(self.clockwise, tick.target.to_f32());
        let speed = along(self.clockwise, tick.regulator.velocity().to_f32());
        let free = speed >= STALL.speed_share * requested && beyond >= STALL.counts;
        self.free_ms = if free { self.free_ms.saturating_add(tick.period_ms()) } else { 0 };
        if requested < 0.0 || (requested > 0.0 && self.free_ms >= STALL.free_ms) {
            (State::Watching(Expected::NONE), Finding::Sound)
        } else {
            (State::Stalled(self), Finding::Sound)
        }
    }
}

/// A span of time, and the counts in this time.
#[derive(Clone, Copy, Debug, Default)]
struct Span {
    /// Length in ms.
    ms: u32,
    /// Counts in the direction of motion.
    counts: i64,
}

impl Span {
    /// The sum of two spans.
    fn plus(self, other: Self) -> Self {
        Self { ms: self.ms.saturating_add(other.ms), counts: self.counts + other.counts }
    }

    /// True if the mean speed of this span is below the mean speed of the other.
    fn is_slower_than(self, other: Self) -> bool {
        self.counts * i64::from(other.ms) < other.counts * i64::from(self.ms)
    }

    /// True if the mean speed of this span is above the mean speed of the other, even if this span has `error` counts too
    /// many.
    fn is_faster_than(self, other: Self, error: i64) -> bool {
        (self.counts - error) * i64::from(other.ms) > other.counts * i64::from(self.ms)
    }
}

/// A motor that turns at the wrong speed against full control in reverse.
#[derive(Clone, Copy, Debug)]
struct Runaway {
    /// Stall of the motor before; `None` if the motor was not stalled.
    stall: Option<Stall>,
    /// Extension of both spans of a slow motor, in ms.
    slow_ms: u32,
    /// True for an unknown motor whose encoder is trusted. If the short spans do not show that the motor has become faster,
    /// longer spans follow.
    trusted: bool,
    /// True in the second comparison. Its early span contains the spans of the first one. The spans of a trusted motor are
    /// longer in it.
    long: bool,
    /// True if the motor turns clockwise.
    clockwise: bool,
    /// First span of the comparison.
    early: Span,
    /// Second span of the comparison.
    late: Span,
    /// True while the check commands full reverse, because the control range may end before full reverse.
    full_reverse: bool,
}

impl Runaway {
    /// Begins with the first tick of a runaway.
    fn new(tick: &Tick<'_>, stall: Option<Stall>, trusted: bool) -> Self {
        let slow_ms = match tick.regulator.least_gain() {
            Some(gain) => {
                // Time from rest for the expected counts.
                let ms = (1_000.0 * sqrtf(2.0 * EXPECTED_COUNTS / (RUNAWAY.drive_volts * gain))) as u32;
                if ms > RUNAWAY.slow_ms { ms.min(RUNAWAY.longest_ms) } else { 0 }
            }
            None => 0,
        };
        let clockwise = tick.regulator.velocity() >= CountsPerSecond::ZERO;
        let empty = Span::default();
        Self {
            stall,
            slow_ms,
            trusted,
            long: false,
            clockwise,
            early: empty,
            late: empty,
            full_reverse: false,
        }
    }

    /// Extension of the present spans, in ms.
    fn longer_ms(&self) -> u32 {
        match (self.trusted, self.long) {
            (true, true) => self.slow_ms.max(RUNAWAY.trusted_ms),
            (true, false) => 0,
            (false, _) => self.slow_ms,
        }
    }

    /// True if the spans do not show whether the motor has become faster.
    fn is_uncertain(&self) -> bool {
        let Self { early, late, .. } = *self;
        if self.trusted {
            !late.is_faster_than(early, RUNAWAY.faster_counts)
        } else {
            // A motor that swings on a springy stop has few counts, and about the same number in both spans.
            late.counts < RUNAWAY.exact_counts
                && !late.is_slower_than(early)
                && !late.is_faster_than(early, RUNAWAY.error_counts)
        }
    }

    /// Takes a tick in RunningAway. If the late span is slower than the early span, the comparison begins again.
    fn step(mut self, tick: &Tick<'_>) -> (State, Finding) {
        // A motor that reversed has followed its drive, even if it swings back later.
        let clockwise = tick.regulator.velocity() >= CountsPerSecond::ZERO;
        if clockwise != self.clockwise {
            self = self.again(clockwise);
        }
        let counts = i64::from(tick.moved) * if clockwise { 1 } else { -1 };
        let span = Span { ms: tick.period_ms(), counts };
        let end = if tick.control() < Control::ZERO { Control::MIN } else { Control::MAX };
        let undecided = tick.ends_before_full_reverse() && !self.full_reverse;
        let extension_ms = if tick.ends_before_full_reverse() {
            0
        } else {
            RUNAWAY.extension_ms.saturating_sub(tick.period_ms()) + self.longer_ms()
        };
        if self.early.ms < RUNAWAY.early_ms + extension_ms {
            self.early = self.early.plus(span);
            return (State::RunningAway(self), Finding::Sound);
        }
        self.late = self.late.plus(span);
        let late_ms = if undecided { RUNAWAY.hint_ms } else { RUNAWAY.late_ms + self.longer_ms() };
        let too_slow = 50 * self.early.counts < RUNAWAY.counts_in_50_ms * i64::from(self.early.ms);
        if self.late.ms < late_ms {
            let finding = if self.full_reverse { Finding::FullReverse(end) } else { Finding::Sound };
            (State::RunningAway(self), finding)
        } else if !self.long && !undecided && self.is_uncertain() {
            let early = self.early.plus(self.late);
            (State::RunningAway(Self { early, late: Span::default(), long: true, ..self }), Finding::Sound)
        } else if too_slow || self.late.is_slower_than(self.early) {
            (State::RunningAway(self.again(clockwise)), Finding::Sound)
        } else if undecided {
            let early = self.early.plus(self.late);
            let next = Self { early, late: Span::default(), full_reverse: true, ..self };
            (State::RunningAway(next), Finding::FullReverse(end))
        } else {
            (State::Watching(Expected::NONE), Finding::Fault(EncoderFault::Reversed))
        }
    }

    /// Begins the comparison again.
    fn again(self, clockwise: bool) -> Self {
        let empty = Span::default();
        Self { long: false, clockwise, early: empty, late: empty, full_reverse: false, ..self }
    }
}

/// Converts a value that is positive clockwise to a value that is positive in the direction `clockwise`.
fn along(clockwise: bool, value: f32) -> f32 {
    if clockwise { value } else { -value }
}
