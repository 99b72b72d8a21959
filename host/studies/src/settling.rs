//! Judges whether a motor has settled after a change. `run`, `compare`, `survey` and `[[expect]]` all use this
//! judgement.
//!
//! A motor has *settled* when its true motion stays within a band until the next change. The motion must stay in the
//! band for at least a tenth of the time between the two changes, and for at least one second. A motor that hunts in
//! and out of the band therefore never settles. A change is not judged if the next change follows within a second.
//!
//! ```
//! use simulated::trace::Point;
//! use studies::settling::{Goal, Settling, settling};
//!
//! // The speed rises by 10 counts/s in each millisecond until it is 1000 counts/s.
//! let speed_cps = |ms: u32| f64::from(ms.min(100)) * 10.0;
//! let point = |ms| Point { at_s: f64::from(ms) / 1e3, speed_cps: speed_cps(ms), counts: 0 };
//! let points: Vec<Point> = (0..2_000).map(point).collect();
//! // The band is 2 % of 1000 counts/s.
//! assert_eq!(settling(Goal::Velocity(1000.0), 0.0, 0.0..2.0, &points), Settling::After(0.098));
//! assert_eq!(settling(Goal::Velocity(1000.0), 0.0, 0.0..0.9, &points), Settling::TooShort);
//! ```

use motor_hub::motor::Setpoint;
use simulated::scenario::Motor;
use simulated::trace::Point;
use std::ops::Range;

/// Band of a speed, as a share of the new speed and of the step to it, the larger of both.
const SPEED_BAND: f64 = 0.02;
/// Least band of a speed, in counts/s. At a few counts/s, 2 % is less than an encoder resolves.
const LEAST_BAND_CPS: f64 = 2.0;
/// Band of a motor at standstill about the position at which it comes to rest, in counts.
const STANDSTILL_BAND: f64 = 3.0;
/// Share of the time between two changes for which a motor must stay within the band.
const REST_SHARE: f64 = 0.1;
/// Least time for which a motor must stay within the band, in seconds. A shorter time would not show a slow hunting.
const LEAST_REST_S: f64 = 1.0;
/// Largest rounding error of a difference of two times, in seconds.
const ROUNDING_S: f64 = 1e-9;

/// Explains settling and overshoot below tables.
pub(crate) fn definitions() -> String {
    format!(
        "Settling: time until the speed stays within {:.0} % of the new speed or of the step, whichever is more, at least \
         {LEAST_BAND_CPS} counts/s; a position within its tolerance; a motor at standstill within {STANDSTILL_BAND} counts. It \
         must stay there until the next change, for a tenth of the time and for {LEAST_REST_S} s at least. Overshoot: largest \
         error beyond the set-point in % of the step; after a change of torque the largest deviation in % of the set-point.",
        100.0 * SPEED_BAND
    )
}

/// What a regulated motor should do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// Turn at this speed, in counts/s.
    Velocity(f64),
    /// Move to a position.
    Position {
        /// The position in counts.
        counts: f64,
        /// Largest error in counts.
        tolerance: f64,
        /// Largest speed on the way, in counts/s, at least 0.
        limit_cps: f64,
    },
}

impl Goal {
    /// The goal of a set-point; `None` if the set-point regulates neither speed nor position of a motor alone.
    pub fn of(setpoint: Setpoint) -> Option<Self> {
        match setpoint {
            Setpoint::Velocity(cps) => Some(Self::Velocity(cps.to_f64())),
            Setpoint::Position { target, tolerance, speed_limit } => Some(Self::Position {
                counts: target.into(),
                tolerance: tolerance.into(),
                limit_cps: speed_limit.to_f64().abs(),
            }),
            _ => None,
        }
    }

    /// The speed or position of the goal, in its unit.
    pub(crate) const fn target(self) -> f64 {
        match self {
            Self::Velocity(target) | Self::Position { counts: target, .. } => target,
        }
    }

    /// The speed or position of a motor, in the unit of the goal.
    pub(crate) const fn value(self, point: &Point) -> f64 {
        match self {
            Self::Velocity(_) => point.speed_cps,
            Self::Position { .. } => point.counts as f64,
        }
    }

    /// The speed before a change, in counts/s: of the previous goal if it was a velocity, else the motor's own speed at
    /// the change.
    pub fn speed_before(before: Option<Self>, points: &[Point]) -> f64 {
        match before {
            Some(Self::Velocity(cps)) => cps,
            _ => points.first().map_or(0.0, |point| point.speed_cps),
        }
    }

    /// Largest error of a motor that has settled, in counts/s, or in counts for a position and for standstill.
    pub fn band(self, speed_before: f64) -> f64 {
        match self {
            Self::Velocity(0.0) => STANDSTILL_BAND,
            Self::Velocity(cps) => {
                (SPEED_BAND * cps.abs().max((cps - speed_before).abs())).max(LEAST_BAND_CPS)
            }
            Self::Position { tolerance, .. } => tolerance,
        }
    }

    /// The error at each point, in the unit of the [band](Self::band). At standstill it is the distance to the mean
    /// position of the last second, because an estimated speed may vary while the position stays within one count.
    pub fn errors(self, points: &[Point]) -> Vec<f64> {
        let distance_to =
            |counts: f64| points.iter().map(move |point| point.counts as f64 - counts).collect();
        match self {
            Self::Velocity(0.0) => {
                let end_s = points.last().map_or(0.0, |point| point.at_s);
                let ending = || points.iter().filter(|point| point.at_s > end_s - LEAST_REST_S);
                let sum: f64 = ending().map(|point| point.counts as f64).sum();
                distance_to(sum / ending().count().max(1) as f64)
            }
            Self::Velocity(cps) => points.iter().map(|point| point.speed_cps - cps).collect(),
            Self::Position { counts, .. } => distance_to(counts),
        }
    }
}

/// The judgement of a change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Settling {
    /// The motor settled after this time, in seconds.
    After(f64),
    /// The motor did not settle.
    Never,
    /// The next change, or the end, comes too soon to judge.
    TooShort,
}

impl Settling {
    /// Seconds until the motor settled; `None` if the motor did not settle, or was not judged.
    pub const fn seconds(self) -> Option<f64> {
        match self {
            Self::After(seconds) => Some(seconds),
            Self::Never | Self::TooShort => None,
        }
    }
}

/// Time in seconds for which a motor must stay within the band up to the next change. `length_s` is the time between
/// the two changes.
pub fn rest_s(length_s: f64) -> f64 {
    (REST_SHARE * length_s).max(LEAST_REST_S)
}

/// A change of the set-point of a motor or of the torque on its shaft, for a motor whose speed or position is regulated.
#[derive(Clone, Debug)]
pub(crate) struct Change {
    /// Time of the change and of the next one, in seconds.
    pub(crate) span_s: Range<f64>,
    /// The goal before the change; `None` if the motor was not regulated.
    pub(crate) old: Option<Goal>,
    pub(crate) goal: Goal,
    /// Torque on the output shaft before the change, in N m.
    pub(crate) old_torque: f64,
    /// Torque on the output shaft after the change, in N m.
    pub(crate) torque: f64,
}

/// The changes of a motor by time. The last one extends to `end_s`. The torque at the start is no change, nor is a
/// set-point or a torque that the motor already has.
pub(crate) fn changes(motor: &Motor, end_s: f64) -> Vec<Change> {
    let torques = motor.torques.iter().map(|timed| timed.at_s).filter(|at_s| *at_s > 0.0);
    let mut times: Vec<f64> = motor.setpoints.iter().map(|timed| timed.at_s).chain(torques).collect();
    times.retain(|at_s| *at_s < end_s);
    times.push(end_s);
    times.sort_by(f64::total_cmp);
    times.dedup();
    let (mut old, mut old_torque, mut changes) = (None, 0.0, Vec::<Change>::new());
    for pair in times.windows(2) {
        let &[from_s, to_s] = pair else { continue };
        let (goal, torque) = (Goal::of(motor.setpoint_at(from_s)), motor.torque_at(from_s));
        match changes.last_mut() {
            Some(last) if goal.is_some() && (goal, torque) == (old, old_torque) => last.span_s.end = to_s,
            _ => changes.extend(goal.map(|goal| Change {
                span_s: from_s..to_s,
                old,
                goal,
                old_torque,
                torque,
            })),
        }
        (old, old_torque) = (goal, torque);
    }
    changes
}

/// Judges the points of a motor from a change to the next one.
pub fn settling(goal: Goal, speed_before: f64, span_s: Range<f64>, points: &[Point]) -> Settling {
    let Range { start, end } = span_s;
    let rest = rest_s(end - start);
    if end - start <= rest {
        return Settling::TooShort;
    }
    let band = goal.band(speed_before);
    let outside = goal.errors(points).iter().rposition(|error| error.abs() > band);
    let since = match outside {
        // Without points the motor is not known to be within the band.
        None => points.first().map(|_| start),
        Some(last) => points.get(last + 1).map(|point| point.at_s),
    };
    match since {
        Some(since) if end - since >= rest - ROUNDING_S => Settling::After(since - start),
        _ => Settling::Never,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motor_hub::model::catalogue::characterised;
    use motor_hub::model::load::Load;
    use simulated::scenario::Timed;

    /// A motion with a point at every millisecond.
    fn motion(seconds: u32, speed_cps: impl Fn(f64) -> f64, counts: impl Fn(f64) -> f64) -> Vec<Point> {
        let point = |at_s: f64| Point { at_s, speed_cps: speed_cps(at_s), counts: counts(at_s) as i64 };
        (0..1_000 * seconds).map(|ms| point(f64::from(ms) / 1e3)).collect()
    }

    #[test]
    fn a_motor_of_which_nothing_was_recorded_does_not_settle() {
        assert_eq!(settling(Goal::Velocity(1000.0), 0.0, 0.0..2.0, &[]), Settling::Never);
    }

    #[test]
    fn a_speed_that_hunts_never_settles_whatever_the_length() {
        // Within the band for nine tenths of each period of 0.8 s.
        let speed = |at_s: f64| if at_s.rem_euclid(0.8) < 0.08 { 1030.0 } else { 1000.0 };
        for seconds in 2..40 {
            let points = motion(seconds, speed, |_| 0.0);
            let settling = settling(Goal::Velocity(1000.0), 0.0, 0.0..seconds.into(), &points);
            assert_eq!(settling, Settling::Never, "{seconds} s");
        }
    }

    #[test]
    fn the_band_of_a_speed_is_of_the_new_speed_and_of_the_step() {
        let band = |new, old| Goal::Velocity(new).band(old);
        assert_eq!(band(1000.0, 900.0), 20.0);
        assert_eq!(band(100.0, 2000.0), 38.0);
        assert_eq!(band(-500.0, 500.0), 20.0);
        assert_eq!(band(20.0, 10.0), 2.0);
    }

    #[test]
    fn standstill_is_judged_by_the_place_and_a_creeping_motor_does_not_stand() {
        let judge = |counts: &dyn Fn(f64) -> f64| {
            settling(Goal::Velocity(0.0), 1000.0, 0.0..3.0, &motion(3, |_| 0.0, counts))
        };
        assert_eq!(judge(&|at_s| if at_s < 0.5 { 0.0 } else { 700.0 }), Settling::After(0.5));
        assert_eq!(judge(&|at_s| 40.0 * at_s), Settling::Never);
    }

    #[test]
    fn a_position_is_judged_by_its_tolerance_and_a_late_one_never_settles() {
        let goal = Goal::Position { counts: 500.0, tolerance: 5.0, limit_cps: 1000.0 };
        let arrives = |late_s: f64, error: f64| {
            let counts = |at_s: f64| if at_s < late_s { 0.0 } else { 500.0 + error };
            settling(goal, 0.0, 0.0..4.0, &motion(4, |_| 0.0, counts))
        };
        assert_eq!(arrives(1.0, 5.0), Settling::After(1.0));
        assert_eq!(arrives(1.0, -6.0), Settling::Never);
        assert_eq!(arrives(3.0, 0.0), Settling::After(3.0));
        assert_eq!(arrives(3.001, 0.0), Settling::Never);
    }

    #[test]
    fn a_set_point_or_torque_that_the_motor_already_has_is_no_change() {
        let constants = characterised("AM 60 A").expect("in the catalogue");
        let at = |at_s, cps| Timed { at_s, value: crate::velocity(cps) };
        let torque = |at_s, value| Timed { at_s, value };
        let motor = Motor {
            setpoints: vec![at(0.5, 1000), at(1.5, 1000), at(4.0, 500), at(6.0, 500)],
            torques: vec![torque(0.0, 0.1), torque(2.0, 0.1), torque(6.0, 0.2)],
            ..Motor::new(constants, Load::NONE)
        };
        let spans: Vec<Range<f64>> = changes(&motor, 8.0).into_iter().map(|change| change.span_s).collect();
        assert_eq!(spans, [0.5..4.0, 4.0..6.0, 6.0..8.0]);
    }
}
