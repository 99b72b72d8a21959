//! Checks the encoder of a regulated motor by drive voltage and counts. With an encoder that is unplugged or reversed,
//! a regulated motor runs away.
//!
//! The diagram shows the main transitions. The text below the terms has further transitions.
//!
//! ```text
//!               largest reverse, wrong speed                free, or reversed request
//!   RunningAway ◀────────────────────────── Watching ◀───────────────────────────────┐
//!     │    │                                 ▲    │                                   │
//!     │    └─ no longer largest reverse, or ─┘    │ too few counts                    │
//!     │       right speed                         ▼                                   │
//!     │ not slower                            Releasing ────────── motion ─────────▶ Stalled
//!     │                                           │ time over                         ▲
//!     ▼                                           ▼                                   │
//!   Faulty ◀────── expected distance ───────── Probing ─ motion, or out of reach ─────┘
//! ```
//!
//! Terms:
//!
//! * *Drive voltage*: the mean voltage across the motor.
//! * *Gain*: the motor's acceleration per volt. Without configured dynamics the regulator estimates the gain.
//! * *Least gain*: a lower bound of the gain. The regulator has a least gain if the dynamics are configured, or if the
//!   estimated gain shows that the motor is heavy.
//! * *Toggle*: a change of the position that stays within a dead band of one count to either side of a centre (see
//!   `last_motion`). A shaft that rests on an edge of the encoder toggles.
//! * *Motion*: a change of the position that is no toggle.
//! * *Steady run*: motions in one direction for 200 ms or more, see `last_motion`.
//! * *Silence*: the time without a motion in Watching, while the requested speed is 40 counts/s or more.
//! * *Expected distance*: the least distance that a healthy motor covers in a silence or a probe (see `expected`).
//! * *Heaviest friction*: 6.6 V. Every 12 V motor moves with more drive voltage (see `expected`).
//! * *Time-out*: the longest time for which a motor without a least gain may be silent while the drive voltage exceeds
//!   the heaviest friction. The time starts again at 0 whenever the drive voltage falls to the heaviest friction.
//! * *Too few counts*: a silence of 46 ms or more whose expected distance has reached 12 counts after a steady run, or
//!   6 counts from rest; or a time-out.
//! * *Slow-counting motor*: a motor whose encoder sends fewer than 1000 counts/s at a back EMF of 12 V.
//! * *Reverse*: the bridge drives the motor against its motion.
//! * *Largest reverse*: reverse at the end of the control range. For PID in Schemes C and D the largest reverse may be
//!   less than *full reverse*, which is reverse with duty 1.
//! * *Examination*: a release or a probe.
//! * *Stall*: a stop or a load holds the motor. A stall is no fault.
//!
//! States:
//!
//! * *Watching*: the regulator drives the motor. The check computes the expected distance of each silence.
//! * *Releasing*: the bridge brakes, so that a springy stop or a lifted load can move the motor. If a motion follows,
//!   the motor counts as stalled. Otherwise the motor is probed after the release. If there is no time for a release,
//!   the motor is probed without one.
//! * *Probing*: the motor is driven in the other direction once. If a motion follows, the motor counts as stalled. If
//!   the expected distance is reached without a motion, the encoder is stuck. If the motor cannot reach the expected
//!   distance in the longest probe, as on a low battery or with a current limit, the motor counts as stalled too.
//! * *Stalled*: the regulator drives the motor, and there is no further examination. The stall ends when the requested
//!   direction changes, when the motor should stand, or when a host sets a set-point that is not regulated. It also
//!   ends when the motor has turned beyond its stop for 150 ms, at half of the requested speed or more. A fault that
//!   opens the bridge for some ticks does not end a stall. A stalled motor can run away too, and is stalled again after
//!   the runaway.
//! * *RunningAway*: the bridge is at the largest reverse. Nevertheless the motor turns in the wrong direction, or at
//!   least twice as fast as requested. A motor with a working encoder becomes slower, unless its load exceeds the
//!   stall torque. If the motor does not become slower, its encoder is reversed.
//! * *Faulty*: the encoder is stuck or reversed. The check has ended. The motor latches the fault until its
//!   set-point is disabled or fail-safe.
//!
//! An examination ends when a set-point of another kind or direction arrives, and at a tick without regulation. The
//! state is then Watching.
//!
//! | motor | time to a fault |
//! |---|---|
//! | turned steadily, then silent | 250 ms; 256 ms were seen at a control period of 42 ms |
//! | started from rest, and none of the cases below | 250 ms from full drive voltage on |
//! | is slow-counting or heavy, and turned steadily or has a least gain | more than 250 ms, until the expected distance is reached |
//! | without a least gain, and turned or was driven in the other direction before | 1 s: a heavy motor may take 0.8 s to reverse |
//! | without a least gain, has toggled one to three times | 2.8 s: a heavy motor may take 0.8 s to start, and 2 s in the probe |
//! | without a least gain and slow-counting | some 4 s, and 5 s if it has toggled |
//! | dynamics not configured, runs away after counts in the right direction | usually 2 s; sooner if it clearly becomes faster; longer or never if it already had its full speed (`docs/concepts/faults.md`) |
//!
//! The check for a stuck encoder needs a set-point of speed or position, also in a group, and a requested speed of at
//! least 40 counts/s. So open loop, constant current and identification are excluded, and so is a motor that holds its
//! position. A motor at rest is excluded while its drive voltage does not exceed the heaviest friction, as on a low
//! battery.
//!
//! Where a constant says *chosen*, no measurement of it is on record. Two commands judge the constants together.
//! `motor-hub soak --sweep` simulates many motors and counts false alarms (see `docs/concepts/faults.md`). `cargo test
//! --test encoder_check --test heavy_motors` checks the times of the table, and motors that are blocked or heavy.

use super::Request;
use super::expected::{Expected, Tick};
use super::last_motion::{LastMotion, Run};
use crate::braking::{Regime, Scheme};
use crate::regulator::counts_due;
use crate::units::{Control, CountsPerSecond};
use libm::sqrtf;

/// Expected distance at which a silence from rest has too few counts, in counts: the distance of 150 ms at 40 counts/s,
/// the lowest checked speed. Release and probe then have the other 100 ms of the 250 ms.
const EXPECTED_COUNTS: f32 = 6.0;

/// A fault of an encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncoderFault {
    /// The encoder sends no counts although the motor should turn, or toggles by one count. An encoder with one broken
    /// wire toggles.
    Stuck,
    /// The encoder sends counts in the wrong direction.
    Reversed,
}

impl Tick<'_> {
    /// Control value of the last command.
    fn control(&self) -> Control {
        self.command.control(self.context.modulator)
    }

    /// True for a slow-counting motor.
    fn counts_slowly(&self) -> bool {
        self.emf_volts_per_cps() > EncoderCheck::SLOW_COUNTING_EMF_VOLTS_PER_CPS
    }

    /// True if the largest reverse may be less than full reverse: for PID in Schemes C and D.
    fn ends_before_full_reverse(&self) -> bool {
        let settings = self.context.settings;
        settings.coefficients.is_some() && matches!(settings.scheme, Scheme::C | Scheme::D(_))
    }

    /// True if the motor runs away: the bridge is at the largest reverse, and the motor turns in the wrong direction,
    /// or at least twice as fast as requested.
    fn runs_away(&self) -> bool {
        let velocity = i64::from(self.regulator.velocity().to_bits());
        let twice = 2 * i64::from(self.target.to_bits());
        let wrong_speed = if velocity < 0 { twice >= velocity } else { twice <= velocity };
        wrong_speed
            && self.command.request.at.regime(self.command.limited.drive) == Regime::Reverse
            && self.is_at_end_of_range()
    }

    /// True if the last command is at the end of the control range (see [`Runaway::FULL_CONTROL`]). If a limit has
    /// changed the request, the duty must be at the end of its range instead. The control value would not do: in
    /// Schemes C and D it may stay at the end of the control range when the voltage is reduced.
    fn is_at_end_of_range(&self) -> bool {
        if self.command.is_limited() {
            self.command.limited.drive.duty.to_bits() >= Runaway::FULL_CONTROL as u16
        } else {
            self.control().get().abs() >= Runaway::FULL_CONTROL
        }
    }
}

/// The encoder check of one motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct EncoderCheck {
    state: State,
    /// True if the motor has no configured dynamics, and the regulator has trusted its encoder at some tick of
    /// the check. The regulator may no longer trust the encoder while a heavy motor brakes, because the counts are then
    /// against the voltage. This field stays true.
    trusted: bool,
}

/// Limits of the state Watching.
impl EncoderCheck {
    /// Shortest silence that is checked, in µs. During a shorter silence the motor counts as turning. Chosen: a motor
    /// with a working encoder and at least 100 counts/s is not checked.
    const QUIET_US: u32 = 10_000;
    /// Largest ratio of the speed before the silence to the requested speed. Up to this ratio the silence is checked as
    /// a silence after a steady run. The regulator slows a faster motor down, and this motor may come to rest. Chosen.
    const SPEED_RATIO: f32 = 1.5;
    /// Shortest silence, in ms, that can have too few counts by its expected distance. At a control period of 50 ms
    /// such a silence is found within another period, after at most 96 ms. A release of 50 ms and a probe of up to 100
    /// ms then end within 250 ms.
    const SILENCE_MS: u32 = 46;
    /// Expected distance at which a silence after a steady run has too few counts, in counts. When a load reverses a
    /// motor with a working encoder, fewer counts are missing (decision 29).
    const TURNING_COUNTS: f32 = 12.0;
    /// Time-out, in ms, of a motor to which neither of the two longer time-outs applies. At a control period of 50 ms
    /// the time-out is found after at most 190 ms, and a probe of 50 ms ends within 250 ms.
    const TIME_OUT_MS: u32 = 140;
    /// Time-out, in ms, of a motor that last turned in the other direction, or was first driven in the other direction
    /// and has not turned yet. Also the time-out of a motor whose encoder has toggled one to three times in the
    /// silence. A heavy motor may take 800 ms to reverse or to start. Chosen: with a probe of 50 ms a fault is found
    /// within the 1 s of the table. A motor that has toggled has a probe of 2 s.
    const HEAVY_TIME_OUT_MS: u32 = 800;
    /// Back EMF constant above which a motor is slow-counting, in V per count/s: 12 V at 1000 counts/s. The encoder
    /// of such a motor has few lines or is behind the gear, so its first count from rest may take long.
    const SLOW_COUNTING_EMF_VOLTS_PER_CPS: f32 = 0.012;
    /// Time-out of a slow-counting motor, in ms. Chosen: a fault is found within the 4 s of the table.
    const SLOW_COUNTING_TIME_OUT_MS: u32 = 3_000;
}

/// States of the check.
#[derive(Clone, Copy, Debug)]
enum State {
    /// The regulator drives the motor. `Expected` holds the expected distance of the present silence.
    Watching(Expected),
    /// The bridge is at the largest reverse, and the motor turns at the wrong speed.
    RunningAway(Runaway),
    /// The bridge brakes.
    Releasing {
        suspect: Suspect,
        /// Time in this state, in ms.
        ms: u32,
    },
    /// The motor is driven in the other direction. `expected` holds the expected distance of the probe.
    Probing { suspect: Suspect, expected: Expected },
    /// The regulator drives the motor against a stop.
    Stalled(Stall),
    /// The encoder is at fault. The motor latches the fault and takes no further step of this check.
    Faulty(EncoderFault),
}

impl EncoderCheck {
    /// Creates the check of a motor whose regulation begins.
    pub(super) const fn new() -> Self {
        Self { state: State::Watching(Expected::NONE), trusted: false }
    }

    /// True if the motor is stalled, or was stalled when it began to run away.
    pub(super) const fn is_stalled(&self) -> bool {
        matches!(self.state, State::Stalled(_) | State::RunningAway(Runaway { stall: Some(_), .. }))
    }

    /// Ends an examination, so that the next set-point begins in Watching. Returns true if the motor may press against
    /// a stop: if there was an examination, or if the motor is stalled. A stall does not end.
    ///
    /// Must be called for a set-point of another kind or direction, and at a tick without regulation. Must not be
    /// called for a set-point that only changes the target, because a host that streams set-points would then hide a
    /// fault of the encoder.
    pub(super) const fn end_examination(&mut self, last_motion: &mut LastMotion) -> bool {
        let examining = matches!(self.state, State::Releasing { .. } | State::Probing { .. });
        if examining {
            self.state = State::Watching(Expected::NONE);
            last_motion.forget();
        }
        examining || self.is_stalled()
    }

    /// Ends a stall, also during a runaway, because the motor should stand. A motor that stands does not press against
    /// its stop.
    pub(super) const fn end_stall(&mut self) {
        if self.is_stalled() {
            self.state = State::Watching(Expected::NONE);
        }
    }

    /// Steps the check by a tick of a regulated motor, and enters the next state. Returns the request of this state;
    /// `None` if the regulator drives the motor.
    ///
    /// # Errors
    /// Returns the fault of the encoder if the check has found one.
    pub(super) fn step(
        &mut self,
        last_motion: &mut LastMotion,
        tick: &Tick<'_>,
    ) -> Result<Option<Request>, EncoderFault> {
        let moved = last_motion.take_moved();
        self.trusted |= tick.regulator.trusts_encoder();
        let turns = last_motion.silent_us() < Self::QUIET_US;
        let runs_away = turns && tick.runs_away();
        self.state = match self.state {
            State::Watching(_) if runs_away => Runaway::new(tick, None, self.trusted).step(tick),
            State::Stalled(stall) if runs_away => Runaway::new(tick, Some(stall), self.trusted).step(tick),
            State::RunningAway(runaway) if runs_away => runaway.step(tick),
            State::Watching(_) if turns => State::Watching(Expected::NONE),
            State::Watching(_) if moved => watch(Expected::NONE, last_motion, tick),
            State::Watching(expected) => watch(expected, last_motion, tick),
            State::RunningAway(Runaway { stall: Some(stall), .. }) | State::Stalled(stall) => {
                last_motion.forget();
                stall.step(tick)
            }
            State::RunningAway(_) => State::Watching(Expected::NONE),
            State::Releasing { suspect, .. } | State::Probing { suspect, .. } if moved => suspect.stall(),
            State::Releasing { suspect, ms } => suspect.release(ms + tick.period_ms(), tick),
            State::Probing { suspect, expected } => suspect.probe(expected, last_motion.may_creep(), tick),
            State::Faulty(fault) => State::Faulty(fault),
        };
        let at = tick.context.at;
        match &self.state {
            State::Watching(_) | State::Stalled(_) => Ok(None),
            State::RunningAway(runaway) => {
                Ok(runaway.full_reverse.then_some(Request::full_reverse(at, tick.context.modulator)))
            }
            State::Releasing { .. } => Ok(Some(Request::braking(at))),
            // The probe is in open loop, because the measured speed may be wrong.
            State::Probing { suspect, .. } => {
                Ok(Some(Request::open_loop(at, suspect.probe_control(), tick.context.modulator)))
            }
            State::Faulty(fault) => Err(*fault),
        }
    }
}

/// Executes a tick of Watching: extends the expected distance in a silence, and releases or probes a motor with too few
/// counts.
fn watch(expected: Expected, last_motion: &mut LastMotion, tick: &Tick<'_>) -> State {
    if !counts_due(tick.target) {
        last_motion.forget();
        return State::Watching(Expected::NONE);
    }
    let requested = tick.target.to_f32().abs();
    let clockwise = tick.target > CountsPerSecond::ZERO;
    let drive_volts = along(clockwise, tick.command.limited.voltage.to_volts());
    // The first tick of a silence adds the time since the last motion, but at most a period and `QUIET_US`. Each later
    // tick adds a period.
    let ms = match expected.ms {
        0 => (last_motion.silent_us() / 1_000).min(tick.period_ms() + EncoderCheck::QUIET_US / 1_000),
        _ => tick.period_ms(),
    };
    // A motor that brakes may come to rest, so its silence is checked as from rest. The motor brakes if it was much
    // faster than requested. No load can drive a motor at a steady speed with more than the stall torque. If the
    // estimated load seems to do so, the estimate is wrong, and the motor is braking.
    let run = last_motion.steady(clockwise).filter(|run| {
        run.speed_cps <= EncoderCheck::SPEED_RATIO * requested
            && run.resisting_volts(tick) >= -Expected::LARGEST_DRIVING_VOLTS
    });
    let least_gain = tick.regulator.least_gain();
    let (mut expected, counts) = match run {
        Some(run) => (expected.keep_turning(ms, &run, drive_volts, tick), EncoderCheck::TURNING_COUNTS),
        None if drive_volts <= Expected::FRICTION_VOLTS => return State::Watching(Expected::NONE),
        None => {
            let acceleration = least_gain.unwrap_or(0.0) * (drive_volts - Expected::FRICTION_VOLTS);
            let speed = along(clockwise, tick.speed_at_command());
            (expected.accelerate(ms, acceleration, speed), EXPECTED_COUNTS)
        }
    };
    if drive_volts > Expected::FRICTION_VOLTS {
        expected.driven_ms = expected.driven_ms.saturating_add(ms);
        last_motion.assume_driven(clockwise);
    } else {
        expected.driven_ms = 0;
    }
    let too_few = expected.ms >= EncoderCheck::SILENCE_MS && expected.distance_counts >= counts;
    let timed_out = least_gain.is_none() && expected.driven_ms >= time_out_ms(last_motion, clockwise, tick);
    if !too_few && !timed_out {
        return State::Watching(expected);
    }
    let suspect = Suspect::new(clockwise, run, tick);
    // The time-out of a motor from rest leaves no time for a release.
    let has_time = least_gain.is_some() || run.is_some();
    if has_time && tick.period_ms() <= Suspect::SHORTEST_MS {
        State::Releasing { suspect, ms: 0 }
    } else {
        State::Probing { suspect, expected: Expected::NONE }
    }
}

/// The time-out of a motor without a least gain, in ms.
fn time_out_ms(last_motion: &LastMotion, clockwise: bool, tick: &Tick<'_>) -> u32 {
    if tick.counts_slowly() {
        EncoderCheck::SLOW_COUNTING_TIME_OUT_MS
    } else if last_motion.clockwise() == Some(!clockwise) || last_motion.may_creep() {
        EncoderCheck::HEAVY_TIME_OUT_MS
    } else {
        EncoderCheck::TIME_OUT_MS
    }
}

/// A motor with too few counts that is released or probed.
#[derive(Clone, Copy, Debug)]
struct Suspect {
    /// True if the requested direction is clockwise.
    clockwise: bool,
    /// Position at which the examination began, in counts.
    position: i32,
    /// Lower bound of the gain, in counts/s² per V: the least gain. A motor without a least gain has the gain of the
    /// longest time constant or, after a steady run, the larger of this gain and
    /// [`likely_least_gain`](crate::regulator::Regulator::likely_least_gain).
    gain_cps2_per_volt: f32,
    /// Largest resisting torque in the probe, in volts.
    resisting_volts: f32,
    /// True for a motor without a least gain that started from rest: the motor may be too heavy for the expected
    /// distance.
    may_be_heavy: bool,
}

/// Limits of the states Releasing and Probing.
impl Suspect {
    /// Time in Releasing, and shortest time in Probing, in ms: the longest control period at which both fit into 250
    /// ms. With a longer control period a motor is probed without a release, and the decision is still taken within 250
    /// ms.
    const SHORTEST_MS: u32 = 50;
    /// Longest time in Probing, in ms. If the expected distance is still too short after this time, the motor counts as
    /// stalled. Also the longest [extension](Runaway::extension_ms) of a span in RunningAway. Chosen.
    const LONGEST_MS: u32 = 2_000;
    /// Expected distance of the probe, in counts. If there is no motion within this distance, the encoder is stuck. A
    /// toggle is no motion, because a shaft that trembles on an edge of the encoder toggles too.
    const COUNTS: f32 = 2.0;
    /// Requested drive voltage of the probe, before limits, as a share of the battery voltage. Chosen.
    const DRIVE_SHARE: f32 = 0.9;
    /// Longest mechanical time constant that is assumed of a motor without a least gain, in s: that of a NeveRest 60
    /// with 25 times the inertia of its rotor. Heavier motors exist, and may be taken for stuck (decision 29).
    const TIME_CONSTANT_S: f32 = 2.5;
    /// Longest mechanical time constant that is assumed of a slow-counting motor without a least gain, and of a
    /// runaway whose encoder is trusted, in s. Chosen.
    const SLOW_COUNTING_TIME_CONSTANT_S: f32 = 50.0;
}

impl Suspect {
    /// Begins an examination. `run` is the steady run before the silence; `None` for a motor that started from rest.
    fn new(clockwise: bool, run: Option<Run>, tick: &Tick<'_>) -> Self {
        // `volts` is the largest resisting torque of the run. A motor from rest may have the heaviest friction.
        let resisting_volts = run.map_or(Expected::FRICTION_VOLTS, |run| {
            let volts = run.resisting_volts(tick);
            if volts > Expected::UNCERTAINTY_VOLTS {
                // The load resisted the run. The probe turns in the other direction, so it meets no larger resistance.
                Expected::FRICTION_VOLTS.min(volts + Expected::UNCERTAINTY_VOLTS)
            } else {
                // The load drove the motor, so it resists the probe. The uncertainty is added to its torque once more.
                Expected::FRICTION_VOLTS.max(2.0 * Expected::UNCERTAINTY_VOLTS - volts)
            }
        });
        let time_constant =
            if tick.counts_slowly() { Self::SLOW_COUNTING_TIME_CONSTANT_S } else { Self::TIME_CONSTANT_S };
        let slowest = 1.0 / (time_constant * tick.emf_volts_per_cps());
        let least = if run.is_some() { tick.regulator.likely_least_gain().max(slowest) } else { slowest };
        let known = tick.regulator.least_gain();
        Self {
            clockwise,
            position: tick.regulator.position(),
            gain_cps2_per_volt: known.unwrap_or(least),
            resisting_volts,
            may_be_heavy: known.is_none() && run.is_none(),
        }
    }

    /// Executes a tick of Releasing without a motion. `ms` is the time since the release began. Begins the probe at the
    /// tick that is nearest to the time of a release.
    fn release(self, ms: u32, tick: &Tick<'_>) -> State {
        if 2 * ms + tick.period_ms() > 2 * Self::SHORTEST_MS {
            State::Probing { suspect: self, expected: Expected::NONE }
        } else {
            State::Releasing { suspect: self, ms }
        }
    }

    /// Executes a tick of Probing without a motion. The encoder is at fault when the expected distance is reached. If a
    /// motor may be heavy and its encoder has toggled (`may_creep`), the probe lasts [`LONGEST_MS`](Self::LONGEST_MS).
    fn probe(self, expected: Expected, may_creep: bool, tick: &Tick<'_>) -> State {
        // A limit may reduce the drive voltage. Without a limit the requested voltage is used. The voltage of the
        // command is slightly lower, and would make a probe on the NUCLEO-F429ZI one tick of 50 ms longer.
        let drive_volts = if tick.command.is_limited() {
            -along(self.clockwise, tick.command.limited.voltage.to_volts())
        } else {
            Self::DRIVE_SHARE * tick.context.at.battery_volts()
        };
        let volts = drive_volts - self.resisting_volts;
        let expected = expected.accelerate(tick.period_ms(), self.gain_cps2_per_volt * volts, 0.0);
        let shortest_ms = if self.may_be_heavy && may_creep { Self::LONGEST_MS } else { Self::SHORTEST_MS };
        if expected.ms >= shortest_ms && expected.distance_counts >= Self::COUNTS {
            State::Faulty(EncoderFault::Stuck)
        } else if expected.ms >= Self::LONGEST_MS || volts <= 0.0 && expected.ms >= Self::SHORTEST_MS {
            self.stall()
        } else {
            State::Probing { suspect: self, expected }
        }
    }

    /// Control value of the probe.
    fn probe_control(&self) -> Control {
        let value = (Self::DRIVE_SHARE * Control::MAX.get() as f32) as i16;
        Control::new(if self.clockwise { -value } else { value })
    }

    /// Begins a stall at the position where the examination began.
    const fn stall(self) -> State {
        let Self { clockwise, position, .. } = self;
        State::Stalled(Stall { clockwise, position, free_ms: 0 })
    }
}

/// A stop that blocks the motor.
#[derive(Clone, Copy, Debug)]
struct Stall {
    /// True if the stop blocks clockwise motion.
    clockwise: bool,
    /// Position of the stop, in counts.
    position: i32,
    /// Time in ms for which the motor has been beyond the stop, and fast enough to be free.
    free_ms: u32,
}

/// Limits of the state Stalled. A motor is free when all of these limits are reached.
impl Stall {
    /// Least distance beyond the stop, in counts. Toggling by one count stays below this distance.
    const COUNTS: i32 = 2;
    /// Least speed, as a share of the requested speed. Chosen.
    const SPEED_SHARE: f32 = 0.5;
    /// Shortest time beyond the stop at that speed, in ms. Chosen.
    const FREE_MS: u32 = 150;
}

impl Stall {
    /// Executes a tick of Stalled. Ends the stall if the motor is free or should stand, or if the requested direction
    /// has changed.
    fn step(mut self, tick: &Tick<'_>) -> State {
        let moved = tick.regulator.position().wrapping_sub(self.position);
        let beyond = if self.clockwise { moved } else { moved.saturating_neg() };
        let requested = along(self.clockwise, tick.target.to_f32());
        let speed = along(self.clockwise, tick.regulator.velocity().to_f32());
        let free = speed >= Self::SPEED_SHARE * requested && beyond >= Self::COUNTS;
        self.free_ms = if free { self.free_ms.saturating_add(tick.period_ms()) } else { 0 };
        if requested <= 0.0 || self.free_ms >= Self::FREE_MS {
            State::Watching(Expected::NONE)
        } else {
            State::Stalled(self)
        }
    }
}

/// A span of time, and the counts within the span.
#[derive(Clone, Copy, Debug, Default)]
struct Span {
    /// Length in ms.
    ms: u32,
    /// Counts in the direction of motion.
    counts: i32,
}

impl Span {
    /// The sum of two spans.
    fn plus(self, other: Self) -> Self {
        Self { ms: self.ms.saturating_add(other.ms), counts: self.counts.saturating_add(other.counts) }
    }

    /// Mean speed in counts/s, if the span has `error` counts too many.
    fn speed_cps(self, error: i32) -> f32 {
        1_000.0 * self.counts.saturating_sub(error) as f32 / self.ms.max(1) as f32
    }
}

/// A motor that turns at the wrong speed although the bridge is at the largest reverse.
#[derive(Clone, Copy, Debug)]
struct Runaway {
    /// Stall of the motor before the runaway; `None` if the motor was not stalled.
    stall: Option<Stall>,
    /// Extension of the late span in the second comparison, in ms: the time in which a heavy motor covers
    /// [`EXPECTED_COUNTS`] from rest, accelerated by a voltage as large as the heaviest friction. Its gain is the least
    /// gain or, if the encoder is trusted, the gain of the longest mechanical time constant. The extension
    /// is 0 for a motor without a least gain whose encoder is not trusted.
    extension_ms: u32,
    /// True in the second comparison, whose early span contains both spans of the first comparison.
    second: bool,
    /// True if the motor turns clockwise.
    clockwise: bool,
    /// First span of the comparison.
    early: Span,
    /// Second span of the comparison.
    late: Span,
    /// True while the check commands full reverse, because the largest reverse may be less.
    full_reverse: bool,
}

/// Limits of the state RunningAway. The check compares the mean speeds of two spans of time, *early* and *late*.
impl Runaway {
    /// Least magnitude of a control value that counts as the end of the control range: 15/16 of the range. The other
    /// 1/16 is a margin for rounding in the regulator.
    const FULL_CONTROL: i16 = 30_720;
    /// Length of a span, in ms. A springy stop pushes a motor back for some 50 ms, which are within the early span.
    const SPAN_MS: u32 = 100;
    /// Length in ms of both spans for PID in Schemes C and D, whose largest reverse may be less than full reverse.
    /// After these two spans the check commands full reverse, and a late span of `SPAN_MS` follows. All three spans fit
    /// into 250 ms. For all other motors the early span is one control period shorter than `SPAN_MS`, but at most
    /// `SHORT_SPAN_MS` shorter.
    const SHORT_SPAN_MS: u32 = 50;
    /// Least mean speed of the early span with which the spans can be compared, in counts/s: eight counts in
    /// `SHORT_SPAN_MS`. With a lower speed the comparison begins again.
    const LEAST_SPEED_CPS: f32 = 160.0;
    /// Counts by which the late span of a heavy motor, whose extension is above `SPAN_MS`, must exceed the counts at
    /// the mean speed of the early span. Otherwise a second comparison follows. Each span has an error of one count.
    /// The other two counts are a margin. Chosen.
    const FASTER_COUNTS: i32 = 4;
    /// Counts of a late span for which the errors of both spans are negligible: `ERROR_COUNTS` are 5 % of them. A late
    /// span with fewer counts must be as fast as the early span after `ERROR_COUNTS` were subtracted from its counts.
    /// Otherwise a second comparison follows.
    const EXACT_COUNTS: i32 = 40;
    /// Errors of both spans together, in counts: one count at the end of each span.
    const ERROR_COUNTS: i32 = 2;
}

impl Runaway {
    /// Creates a runaway whose spans are empty. The caller then passes the first tick to [`step`](Self::step).
    fn new(tick: &Tick<'_>, stall: Option<Stall>, trusted: bool) -> Self {
        let heaviest = 1.0 / (Suspect::SLOW_COUNTING_TIME_CONSTANT_S * tick.emf_volts_per_cps());
        let gain = if trusted { Some(heaviest) } else { tick.regulator.least_gain() };
        let ms = |gain| 1_000.0 * sqrtf(2.0 * EXPECTED_COUNTS / (Expected::FRICTION_VOLTS * gain));
        let clockwise = tick.regulator.velocity() >= CountsPerSecond::ZERO;
        let empty = Span::default();
        Self {
            stall,
            extension_ms: gain.map_or(0, |gain| ms(gain) as u32).min(Suspect::LONGEST_MS),
            second: false,
            clockwise,
            early: empty,
            late: empty,
            full_reverse: false,
        }
    }

    /// True if the spans do not show whether the motor has become faster. A heavy motor may slow down by less than a
    /// count. A motor that swings on a springy stop has few counts, and about the same number in both spans.
    fn is_uncertain(&self) -> bool {
        let Self { early, late, .. } = *self;
        let error = if self.extension_ms > Self::SPAN_MS {
            Self::FASTER_COUNTS
        } else if late.counts < Self::EXACT_COUNTS {
            Self::ERROR_COUNTS
        } else {
            0
        };
        late.speed_cps(error) < early.speed_cps(0)
    }

    /// Executes a tick of RunningAway. If the motor has reversed, has become slower or is too slow to be compared, the
    /// comparison begins again.
    fn step(mut self, tick: &Tick<'_>) -> State {
        // A motor that reversed has followed its drive voltage, even if the motor swings back later.
        let clockwise = tick.regulator.velocity() >= CountsPerSecond::ZERO;
        if clockwise != self.clockwise {
            self = self.again(clockwise);
        }
        let counts = if clockwise { tick.moved } else { tick.moved.saturating_neg() };
        let span = Span { ms: tick.period_ms(), counts };
        let before_full_reverse = tick.ends_before_full_reverse() && !self.full_reverse;
        let early_ms = if tick.ends_before_full_reverse() {
            Self::SHORT_SPAN_MS
        } else {
            Self::SPAN_MS - tick.period_ms().min(Self::SHORT_SPAN_MS)
        };
        if self.early.ms < early_ms {
            self.early = self.early.plus(span);
            return State::RunningAway(self);
        }
        self.late = self.late.plus(span);
        let late_ms = if before_full_reverse {
            Self::SHORT_SPAN_MS
        } else if self.second {
            Self::SPAN_MS + self.extension_ms
        } else {
            Self::SPAN_MS
        };
        // A motor at its full speed becomes neither faster nor slower. Its late span may lack a count by rounding.
        let slower = self.late.speed_cps(-1) < self.early.speed_cps(0);
        let both = Self { early: self.early.plus(self.late), late: Span::default(), ..self };
        if self.late.ms < late_ms {
            State::RunningAway(self)
        } else if slower || self.early.speed_cps(0) < Self::LEAST_SPEED_CPS {
            State::RunningAway(self.again(clockwise))
        } else if before_full_reverse {
            State::RunningAway(Self { full_reverse: true, ..both })
        } else if !self.second && self.is_uncertain() {
            State::RunningAway(Self { second: true, ..both })
        } else {
            State::Faulty(EncoderFault::Reversed)
        }
    }

    /// Begins the comparison again, for a motor that turns in this direction.
    fn again(self, clockwise: bool) -> Self {
        let empty = Span::default();
        Self { second: false, clockwise, early: empty, late: empty, full_reverse: false, ..self }
    }
}

/// Converts a value that is positive clockwise to a value that is positive in the direction `clockwise`.
fn along(clockwise: bool, value: f32) -> f32 {
    if clockwise { value } else { -value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motor_that_should_stand_is_not_stalled_even_if_it_has_run_away_from_its_stop() {
        let stall = Stall { clockwise: true, position: 0, free_ms: 0 };
        let runaway = Runaway {
            stall: Some(stall),
            extension_ms: 0,
            second: false,
            clockwise: false,
            early: Span::default(),
            late: Span::default(),
            full_reverse: false,
        };
        for state in [State::Stalled(stall), State::RunningAway(runaway)] {
            let mut check = EncoderCheck { state, trusted: false };
            assert!(check.is_stalled());
            check.end_stall();
            assert!(!check.is_stalled());
        }
    }
}
