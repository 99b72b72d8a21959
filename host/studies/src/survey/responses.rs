//! Finds the changes in a scenario to which its motors respond, and judges the responses by the true motion at every
//! millisecond.

use crate::StudyError;
use crate::measures::rms;
use crate::settling::{Change, Goal, changes, rest_s, settling};
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

impl Kind {
    fn of(change: &Change) -> Self {
        match (change.old, change.goal) {
            (Some(old), goal) if old == goal => Self::Load,
            (_, Goal::Position { .. }) => Self::Position,
            (_, Goal::Velocity(to)) if to != 0.0 && to.abs() < CRAWL_CPS => Self::Crawl,
            (Some(Goal::Velocity(from)), Goal::Velocity(to)) if from * to < 0.0 => Self::Reversal,
            _ => Self::Speed,
        }
    }
}

/// Speeds below this limit, in counts/s, are a crawl.
const CRAWL_CPS: f64 = 60.0;

/// A change that a motor responds to.
#[derive(Clone, Debug)]
pub(super) struct Challenge {
    pub(super) motor: usize,
    pub(super) kind: Kind,
    pub(super) change: Change,
}

impl Challenge {
    /// Time to the next change, in seconds.
    pub(super) fn length_s(&self) -> f64 {
        (self.end_ms() - self.begin_ms()) as f64 / 1e3
    }

    /// Time of the change in milliseconds.
    pub(super) fn begin_ms(&self) -> usize {
        millisecond(self.change.span_s.start)
    }

    /// Time of the next change in milliseconds.
    pub(super) fn end_ms(&self) -> usize {
        millisecond(self.change.span_s.end)
    }
}

fn millisecond(at_s: f64) -> usize {
    (1e3 * at_s).round() as usize
}

/// All changes of a scenario, by motor and time.
pub(super) fn challenges(scenario: &Scenario) -> Vec<Challenge> {
    let of_motor = |(motor, plan): (usize, &Motor)| {
        let changes = changes(plan, scenario.duration_s).into_iter();
        changes.map(move |change| Challenge { motor, kind: Kind::of(&change), change })
    };
    scenario.motors.iter().enumerate().flat_map(of_motor).collect()
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
        let motors = moment.view.motors.iter().zip(&moment.snapshot.motors);
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
    let (Change { old, goal, .. }, from_ms, to_ms) =
        (&challenge.change, challenge.begin_ms(), challenge.end_ms());
    let span = track.get(from_ms..to_ms.min(track.len())).unwrap_or_default();
    let points: Vec<Point> = span.iter().map(|at| at.point).collect();
    let before = Goal::speed_before(*old, &points);
    let band = goal.band(before);
    let errors = goal.errors(&points);
    let deviations: Vec<f64> = points.iter().map(|point| goal.value(point) - goal.target()).collect();
    let span_s = from_ms as f64 / 1e3..to_ms as f64 / 1e3;
    let last = |length: usize| errors.get(errors.len().saturating_sub(length)..).unwrap_or_default();
    let rest = (1e3 * rest_s(challenge.length_s())).round() as usize;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let ending = last(SWING_MS);
    let low = ending.iter().copied().fold(f64::INFINITY, f64::min);
    let high = ending.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Verdict {
        settling_s: settling(*goal, before, span_s, &points).seconds(),
        beyond_percent: beyond(challenge, &deviations),
        cycles: low < -band && high > band,
        last_error: mean(last(rest)),
        last_rms: rms(ending),
        last_swing: (low, high),
        fault: span.iter().any(|at| at.fault),
        stalled: span.iter().any(|at| at.stalled),
    }
}

fn beyond(challenge: &Challenge, errors: &[f64]) -> Option<f64> {
    let peak = |error: &mut dyn FnMut(&f64) -> f64| errors.iter().map(error).fold(0.0, f64::max);
    let &Change { goal, torque, old_torque, .. } = &challenge.change;
    if challenge.kind == Kind::Load {
        return match goal {
            Goal::Velocity(speed) if speed.abs() >= CRAWL_CPS => {
                Some(100.0 * peak(&mut |error| error.abs()) / speed.abs())
            }
            _ => None,
        };
    }
    let first = *errors.first()?;
    let position = matches!(goal, Goal::Position { .. });
    (first.abs() >= CRAWL_CPS && (position || torque == old_torque))
        .then(|| 100.0 * peak(&mut |error| -error * first.signum()) / first.abs())
}
