//! Finds the changes in a scenario to which its motors respond, and judges the responses by the true motion at every
//! millisecond.

use crate::StudyError;
use crate::settling::{Goal, changes, rest_s, settling};
use serde::Serialize;
use simulated::scenario::{Motor, Scenario};
use simulated::trace::Point;
use simulated::without_tasks;

/// Length of the end of a response in which swings are counted, in milliseconds.
const SWING_MS: usize = 1_000;

/// The change that begins a response.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Any other new speed: in the same direction, or from or to standstill. Also the first speed after a position, or
    /// after a motor was not regulated.
    Speed,
    /// A new speed in the other direction.
    Reversal,
    /// A new speed below 60 counts/s, but not 0.
    Crawl,
    /// Another torque of the load.
    Load,
    /// A new position.
    Position,
}

/// Speeds below this limit, in counts/s, are a crawl.
const CRAWL_CPS: f64 = 60.0;

/// A change that a motor responds to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Challenge {
    pub(super) motor: usize,
    pub(super) from_ms: usize,
    pub(super) to_ms: usize,
    pub(super) kind: Kind,
    /// The goal before the change; `None` if the motor was not regulated.
    pub(super) old: Option<Goal>,
    pub(super) goal: Goal,
    /// Torque on the output shaft before the change, in N m.
    pub(super) old_torque: f64,
    /// Torque on the output shaft during the response, in N m.
    pub(super) torque: f64,
}

impl Challenge {
    /// Time to the next change, in seconds.
    pub(super) fn length_s(&self) -> f64 {
        (self.to_ms - self.from_ms) as f64 / 1e3
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
    let times = changes(motor);
    let ends = times.iter().copied().skip(1).chain([scenario.duration_s]);
    let mut before = (None, 0.0);
    let mut all = Vec::new();
    for (from_s, to_s) in times.iter().copied().zip(ends) {
        let (old, old_torque) = before;
        let (goal, torque) = (Goal::of(motor.setpoint_at(from_s)), motor.torque_at(from_s));
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

/// A motor at one millisecond.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instant {
    /// The true motion.
    pub(super) point: Point,
    /// True if an encoder fault is latched.
    pub(super) fault: bool,
    /// True if the hub reports a stall.
    pub(super) stalled: bool,
}

/// Runs a scenario. Returns every millisecond of every motor.
pub(super) fn watch(scenario: &Scenario) -> Result<Vec<Vec<Instant>>, StudyError> {
    let mut all: Vec<Vec<Instant>> = vec![Vec::new(); scenario.motors.len()];
    without_tasks::run(scenario, |moment| {
        let motors = moment.motors.iter().zip(&moment.snapshot.motors);
        for (track, (&(speed_cps, counts), report)) in all.iter_mut().zip(motors) {
            let fault = report.faults.encoder.is_some();
            let point = Point { at_s: moment.ms as f64 / 1e3, speed_cps, counts };
            track.push(Instant { point, fault, stalled: report.stalled });
        }
    })?;
    Ok(all)
}

/// The judgement of a response.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Seconds until the motor has [settled](crate::settling); `None` if the motor never settled.
    pub settling_s: Option<f64>,
    /// Largest error beyond the goal, in percent of the step. After a change of torque, the largest error in percent of
    /// the speed. `None` for a step of less than 60 counts/s or 60 counts. Also `None` for a torque on a motor that
    /// crawls or holds a position, and if torque and speed change together.
    pub beyond_percent: Option<f64>,
    /// True if the error was beyond the band on both sides within the last second.
    pub cycles: bool,
    /// Mean error of the last tenth of the response, or of its last second if that is longer, in counts/s or counts.
    pub last_error: f64,
    /// Root mean square of the error in the last second, in counts/s or counts.
    pub last_rms: f64,
    /// Lowest and highest error in the last second, in counts/s or counts.
    pub last_swing: (f64, f64),
    /// True if the hub reported an encoder fault.
    pub fault: bool,
    /// True if the hub ever reported the motor as stalled.
    pub stalled: bool,
}

/// Judges a response by the motion of its motor.
pub(super) fn judge(challenge: &Challenge, track: &[Instant]) -> Verdict {
    let span = track.get(challenge.from_ms..challenge.to_ms.min(track.len())).unwrap_or_default();
    let points: Vec<Point> = span.iter().map(|at| at.point).collect();
    let before = Goal::speed_before(challenge.old, &points);
    let band = challenge.goal.band(before);
    let errors = challenge.goal.errors(&points);
    let deviations: Vec<f64> = match challenge.goal {
        Goal::Velocity(to) => points.iter().map(|point| point.speed_cps - to).collect(),
        Goal::Position { .. } => errors.clone(),
    };
    let span_s = challenge.from_ms as f64 / 1e3..challenge.to_ms as f64 / 1e3;
    let last = |length: usize| errors.get(errors.len().saturating_sub(length)..).unwrap_or_default();
    let rest = (1e3 * rest_s(challenge.length_s())).round() as usize;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let ending = last(SWING_MS);
    let low = ending.iter().copied().fold(f64::INFINITY, f64::min);
    let high = ending.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let squares: Vec<f64> = ending.iter().map(|error| error * error).collect();
    Verdict {
        settling_s: settling(challenge.goal, before, span_s, &points).seconds(),
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
