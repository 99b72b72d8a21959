//! Judges the responses of motors to changes by the true motion at every millisecond.

use crate::StudyError;
use crate::measures::{extent, rms};
use crate::settling::{Change, Goal, changes, rest_s, settling};
use motor_hub::motor::Report;
use serde::Serialize;
use simulated::scenario::Scenario;
use simulated::trace::Point;
use simulated::without_tasks;
use std::ops::Range;

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

impl Change {
    pub(super) fn kind(&self) -> Kind {
        match (self.old, self.goal) {
            (Some(old), goal) if old == goal => Kind::Load,
            (_, Goal::Position { .. }) => Kind::Position,
            (_, Goal::Velocity(to)) if to != 0.0 && to.abs() < CRAWL_CPS => Kind::Crawl,
            (Some(Goal::Velocity(from)), Goal::Velocity(to)) if from * to < 0.0 => Kind::Reversal,
            _ => Kind::Speed,
        }
    }

    /// Milliseconds from this change to the next one.
    pub(super) fn span_ms(&self) -> Range<usize> {
        let millisecond = |at_s: f64| (1e3 * at_s).round() as usize;
        millisecond(self.span_s.start)..millisecond(self.span_s.end)
    }

    /// Time from this change to the next one in seconds, in whole milliseconds.
    pub(super) fn length_s(&self) -> f64 {
        self.span_ms().len() as f64 / 1e3
    }
}

/// Speeds below this limit, in counts/s, are a crawl.
const CRAWL_CPS: f64 = 60.0;

/// A motor at one millisecond.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instant {
    pub(super) point: Point,
    /// The hub's newest report. Before the first control tick it is [`Report::INITIAL`].
    pub(super) report: Report,
}

/// Runs a scenario. Returns every millisecond of every motor.
pub(super) fn watch(scenario: &Scenario) -> Result<Vec<Vec<Instant>>, StudyError> {
    let mut all: Vec<Vec<Instant>> = vec![Vec::new(); scenario.motors.len()];
    without_tasks::run(scenario, |moment| {
        let motors = moment.view.motors.iter().zip(&moment.snapshot.motors);
        for (track, (&(speed_cps, counts), &report)) in all.iter_mut().zip(motors) {
            let point = Point { at_s: moment.ms as f64 / 1e3, speed_cps, counts };
            track.push(Instant { point, report });
        }
    })?;
    Ok(all)
}

/// Runs a scenario with one motor. Returns the verdicts on all its responses.
pub(super) fn verdicts(scenario: &Scenario) -> Result<Vec<Verdict>, StudyError> {
    let tracks = watch(scenario)?;
    let (Some(motor), Some(track)) = (scenario.motors.first(), tracks.first()) else { return Ok(Vec::new()) };
    Ok(changes(motor, scenario.duration_s).iter().map(|change| judge(change, track)).collect())
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
pub(super) fn judge(change: &Change, track: &[Instant]) -> Verdict {
    let (goal, span_ms) = (change.goal, change.span_ms());
    let span = track.get(span_ms.start..span_ms.end.min(track.len())).unwrap_or_default();
    let points: Vec<Point> = span.iter().map(|at| at.point).collect();
    let before = Goal::speed_before(change.old, &points);
    let band = goal.band(before);
    let errors = goal.errors(&points);
    let deviations: Vec<f64> = points.iter().map(|point| goal.value(point) - goal.target()).collect();
    let span_s = span_ms.start as f64 / 1e3..span_ms.end as f64 / 1e3;
    let last = |length: usize| errors.get(errors.len().saturating_sub(length)..).unwrap_or_default();
    let rest = (1e3 * rest_s(change.length_s())).round() as usize;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let ending = last(SWING_MS);
    let (low, high) = extent(ending.iter().copied()).unwrap_or((f64::INFINITY, f64::NEG_INFINITY));
    Verdict {
        settling_s: settling(goal, before, span_s, &points).seconds(),
        beyond_percent: beyond(change, &deviations),
        cycles: low < -band && high > band,
        last_error: mean(last(rest)),
        last_rms: rms(ending),
        last_swing: (low, high),
        fault: span.iter().any(|at| at.report.faults.encoder.is_some()),
        stalled: span.iter().any(|at| at.report.stalled),
    }
}

fn beyond(change: &Change, errors: &[f64]) -> Option<f64> {
    let peak = |error: &mut dyn FnMut(&f64) -> f64| errors.iter().map(error).fold(0.0, f64::max);
    let &Change { goal, torque, old_torque, .. } = change;
    if change.kind() == Kind::Load {
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
