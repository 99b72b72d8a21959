//! The responses that a scenario asks of its motors, judged by the true motion at every millisecond.

use crate::StudyError;
use motor_hub::motor::Setpoint;
use serde::Serialize;
use simulated::direct;
use simulated::scenario::{Motor, Scenario};

/// A speed has settled within this share of the larger of the old and the new one,
const SPEED_BAND: f64 = 0.02;
/// but at least within this, in counts/s.
const LEAST_BAND_CPS: f64 = 2.0;
/// A position has settled within this, in counts.
const POSITION_BAND: f64 = 10.0;
/// A motor that should stand has settled within this of where it comes to rest, in counts.
const STANDSTILL_BAND: f64 = 3.0;
/// Of the time to the next change this much must be left once a response has settled.
pub(super) const REST: f64 = 0.1;
/// Length of the end of a response in which swings are counted, in milliseconds.
const SWING_MS: usize = 1_000;

/// The set-point of a response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Goal {
    /// Counts/s.
    Velocity(f64),
    /// Counts, and the speed on the way.
    Position { counts: f64, limit_cps: f64 },
}

/// The change that begins a response.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A new speed of the same direction, or from or to standstill.
    Speed,
    /// A new speed of the other direction.
    Reversal,
    /// A new speed below 60 counts/s, but not 0.
    Crawl,
    /// Another torque of the load.
    Load,
    /// A new position.
    Position,
}

/// Below this, in counts/s, a speed is a crawl.
const CRAWL_CPS: f64 = 60.0;

/// A change that a motor responds to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Challenge {
    pub(super) motor: usize,
    pub(super) from_ms: usize,
    pub(super) to_ms: usize,
    pub(super) kind: Kind,
    /// Before; `None` of a motor that was not regulated.
    pub(super) old: Option<Goal>,
    pub(super) goal: Goal,
    /// Newton metres on the output shaft, before
    pub(super) old_torque: f64,
    /// and during the response.
    pub(super) torque: f64,
}

impl Challenge {
    /// Seconds.
    pub(super) fn length_s(&self) -> f64 {
        (self.to_ms - self.from_ms) as f64 / 1e3
    }

    /// Largest error of a motor that has settled, in counts/s or counts.
    fn band(&self) -> f64 {
        match self.goal {
            Goal::Velocity(0.0) => STANDSTILL_BAND,
            Goal::Velocity(to) => {
                let from = if let Some(Goal::Velocity(from)) = self.old { from } else { 0.0 };
                (SPEED_BAND * f64::max(from.abs(), to.abs())).max(LEAST_BAND_CPS)
            }
            Goal::Position { .. } => POSITION_BAND,
        }
    }
}

/// All changes of a scenario, by motor and time.
pub(super) fn challenges(scenario: &Scenario) -> Vec<Challenge> {
    scenario.motors.iter().enumerate().flat_map(|(index, motor)| of_motor(scenario, index, motor)).collect()
}

fn millisecond(at_s: f64) -> usize {
    (1e3 * at_s).round() as usize
}

fn of_motor(scenario: &Scenario, index: usize, motor: &Motor) -> Vec<Challenge> {
    let torques = motor.torques.iter().map(|timed| timed.at_s).filter(|&at_s| at_s > 0.0);
    let mut times: Vec<f64> = motor.setpoints.iter().map(|timed| timed.at_s).chain(torques).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let ends = times.iter().copied().skip(1).chain([scenario.duration_s]);
    let mut before = (None, 0.0);
    let mut all = Vec::new();
    for (from_s, to_s) in times.iter().copied().zip(ends) {
        let (old, old_torque) = before;
        let (goal, torque) = (goal(motor.setpoint_at(from_s)), motor.torque_at(from_s));
        before = (goal, torque);
        let Some(goal) = goal else { continue };
        let kind = match (old, goal) {
            (Some(old), _) if old == goal => Kind::Load,
            (_, Goal::Position { .. }) => Kind::Position,
            (_, Goal::Velocity(to)) if to != 0.0 && to.abs() < CRAWL_CPS => Kind::Crawl,
            (Some(Goal::Velocity(from)), Goal::Velocity(to)) if from * to < 0.0 => Kind::Reversal,
            _ => Kind::Speed,
        };
        let (from_ms, to_ms) = (millisecond(from_s), millisecond(to_s));
        all.push(Challenge { motor: index, from_ms, to_ms, kind, old, goal, old_torque, torque });
    }
    all
}

fn goal(setpoint: Setpoint) -> Option<Goal> {
    match setpoint {
        Setpoint::Disabled
        | Setpoint::FailSafe
        | Setpoint::ConstantPower(_)
        | Setpoint::Current { .. }
        | Setpoint::Identify { .. }
        | Setpoint::Together(_) => None,
        Setpoint::Velocity(cps) => Some(Goal::Velocity(cps.to_f64())),
        Setpoint::Position { target, speed_limit, .. } => {
            Some(Goal::Position { counts: target.into(), limit_cps: speed_limit.to_f64().abs() })
        }
    }
}

/// A motor at one millisecond.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instant {
    /// Counts/s.
    pub(super) speed: f64,
    pub(super) counts: f64,
    /// An encoder fault is latched.
    pub(super) fault: bool,
    /// The hub reports a stall.
    pub(super) stalled: bool,
}

/// Runs a scenario; gives every millisecond of every motor.
pub(super) fn watch(scenario: &Scenario) -> Result<Vec<Vec<Instant>>, StudyError> {
    let mut all: Vec<Vec<Instant>> = vec![Vec::new(); scenario.motors.len()];
    direct::run(scenario, |moment| {
        let motors = moment.motors.iter().zip(&moment.snapshot.motors);
        for (track, (&(speed, counts), report)) in all.iter_mut().zip(motors) {
            let fault = report.faults.encoder.is_some();
            track.push(Instant { speed, counts: counts as f64, fault, stalled: report.stalled });
        }
    })?;
    Ok(all)
}

/// The judgement of a response.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Seconds until the motor stayed within the band to the end, with a tenth of the time to spare; `None` if
    /// it never did.
    pub settling_s: Option<f64>,
    /// How far it went beyond its goal, in percent of the step; after another torque how far it was pushed away, in
    /// percent of the speed. `None` where there is no step to speak of: less than 60 counts/s or 60 counts, a
    /// torque on a motor that crawls or holds a position; or where torque and speed change together.
    pub beyond_percent: Option<f64>,
    /// It swings about its goal, beyond the band on both sides within the last second.
    pub cycles: bool,
    /// Mean error of the last tenth, counts/s or counts.
    pub last_error: f64,
    /// Root mean square of the error in the last second, counts/s or counts.
    pub last_rms: f64,
    /// Largest error to either side in the last second, counts/s or counts.
    pub last_swing: (f64, f64),
    /// The hub reported an encoder fault.
    pub fault: bool,
    /// The hub reported the motor as stalled, at some time.
    pub stalled: bool,
}

/// Judges a response by the motion of its motor.
pub(super) fn judge(challenge: &Challenge, track: &[Instant]) -> Verdict {
    let span = track.get(challenge.from_ms..challenge.to_ms.min(track.len())).unwrap_or_default();
    let band = challenge.band();
    let error = |at: &Instant| match challenge.goal {
        Goal::Velocity(to) => at.speed - to,
        // A count is from its number to the next.
        Goal::Position { counts, .. } => at.counts - counts,
    };
    let deviations: Vec<f64> = span.iter().map(error).collect();
    let errors: Vec<f64> = if challenge.goal == Goal::Velocity(0.0) {
        // Within a count a motor may tremble as fast as it likes.
        let ending = span.get(span.len().saturating_sub(SWING_MS)..).unwrap_or_default();
        let rest = ending.iter().map(|at| at.counts).sum::<f64>() / ending.len().max(1) as f64;
        span.iter().map(|at| at.counts - rest).collect()
    } else {
        deviations.clone()
    };
    let settled = errors.iter().rposition(|error| error.abs() > band).map_or(0, |last| last + 1);
    let last = |length: usize| errors.get(errors.len().saturating_sub(length)..).unwrap_or_default();
    let rest = (REST * errors.len() as f64).ceil() as usize;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let ending = last(SWING_MS);
    let low = ending.iter().copied().fold(f64::INFINITY, f64::min);
    let high = ending.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let squares: Vec<f64> = ending.iter().map(|error| error * error).collect();
    Verdict {
        settling_s: (settled + rest <= errors.len()).then_some(settled as f64 / 1e3),
        beyond_percent: beyond(challenge, &deviations),
        cycles: low < -band && high > band,
        last_error: mean(last(rest)),
        last_rms: mean(&squares).sqrt(),
        last_swing: (low, high),
        fault: span.iter().any(|at| at.fault),
        stalled: span.iter().any(|at| at.stalled),
    }
}

fn beyond(challenge: &Challenge, errors: &[f64]) -> Option<f64> {
    let peak = |error: &mut dyn FnMut(&f64) -> f64| errors.iter().map(error).fold(0.0, f64::max);
    if challenge.kind == Kind::Load {
        return match challenge.goal {
            Goal::Velocity(speed) if speed.abs() >= CRAWL_CPS => {
                Some(100.0 * peak(&mut |error| error.abs()) / speed.abs())
            }
            _ => None,
        };
    }
    let first = *errors.first()?;
    let position = matches!(challenge.goal, Goal::Position { .. });
    (first.abs() >= CRAWL_CPS && (position || challenge.torque == challenge.old_torque))
        .then(|| 100.0 * peak(&mut |error| -error * first.signum()) / first.abs())
}
