//! Measures of motors that move in step: the time until all have settled, how far they are out of step, and the heading
//! error of a drive base.

use crate::measures::extent;
use motor_hub::group::{Course, DriveBase, GroupCommand};
use motor_hub::motor::{Report, Setpoint};
use motor_hub::regulator::Reference;
use motor_hub::units::CountsPerSecond;
use serde::Serialize;
use simulated::scenario::{Group, Motor, Scenario};
use simulated::trace::{Sample, Tick, Trace};
use std::iter::Peekable;
use std::ops::Range;
use std::vec::IntoIter;

/// All measures of one group in one run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct GroupMeasures {
    /// The courses that end. A course at speeds lasts until the next course.
    pub(crate) courses: Vec<CourseMeasures>,
    /// Largest difference in counts between the distances of two members to their references, at any tick; null if the
    /// members never move in step.
    pub(crate) out_of_step_counts: Option<f64>,
    /// Largest heading error in degrees; null if the group is no drive base.
    pub(crate) heading_error_degrees: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct CourseMeasures {
    /// Start of the course in seconds.
    pub(crate) at_s: f64,
    /// Seconds from the start until all members have settled; null if a member does not settle before the next course.
    pub(crate) settling_s: Option<f64>,
}

impl GroupMeasures {
    pub(crate) fn new(group: &Group, scenario: &Scenario, trace: &Trace) -> Self {
        let all_s = 0.0..scenario.duration_s;
        let ends = |course: &Course| match course {
            Course::Distance(_) | Course::Position(_) => true,
            Course::Velocity(speeds) => speeds.iter().flatten().all(|cps| *cps == CountsPerSecond::ZERO),
        };
        let courses = courses(group, &all_s).filter(|(command, _)| ends(&command.course));
        let measures = courses.map(|(_, span_s)| CourseMeasures {
            at_s: span_s.start,
            settling_s: Some(arrival_s(group, trace, &span_s)).filter(|arrival_s| arrival_s.is_finite()),
        });
        Self {
            courses: measures.collect(),
            out_of_step_counts: trace
                .ticks
                .iter()
                .filter_map(|tick| out_of_step(group, tick))
                .reduce(f64::max),
            heading_error_degrees: largest_heading_error(group, &scenario.motors, trace, &all_s),
        }
    }
}

/// Difference in counts between the largest and the smallest distance of a member to its reference; `None` if a member
/// has no reference at this tick.
fn out_of_step(group: &Group, tick: &Tick) -> Option<f64> {
    let distances = group.motors.iter().map(|motor| match tick.motors.get(*motor) {
        Some(Sample { report: Report { setpoint: Setpoint::Follow(reference), .. }, counts, .. }) => {
            Some(position(*reference) - *counts as f64)
        }
        _ => None,
    });
    let distances: Vec<f64> = distances.collect::<Option<_>>()?;
    extent(distances.into_iter()).map(|(least, most)| most - least)
}

/// Longest time in seconds until all members have settled after the start of a course, for the courses that begin in
/// the window. A course ends with the next course or with the window. Infinite if a member does not settle; `None` if
/// no course begins in the window.
pub(crate) fn longest_arrival_s(group: &Group, trace: &Trace, window_s: &Range<f64>) -> Option<f64> {
    courses(group, window_s).map(|(_, span_s)| arrival_s(group, trace, &span_s)).reduce(f64::max)
}

/// The courses that begin in the window, with their times in seconds.
fn courses(group: &Group, window_s: &Range<f64>) -> impl Iterator<Item = (GroupCommand, Range<f64>)> {
    let begun = || group.courses.iter().filter(|course| window_s.contains(&course.at_s));
    let ends = begun().skip(1).map(|next| next.at_s).chain([window_s.end]);
    begun().zip(ends).map(|(course, end_s)| (course.value, course.at_s..end_s))
}

fn arrival_s(group: &Group, trace: &Trace, course_s: &Range<f64>) -> f64 {
    let settled = |tick: &Tick| {
        let mut members = group.motors.iter().map(|&motor| tick.motors.get(motor));
        members.all(|sample| sample.is_some_and(|sample| sample.report.settled))
    };
    let ticks: Vec<&Tick> = trace.ticks.iter().filter(|tick| course_s.contains(&tick.at_s)).collect();
    // A member that has settled reports this until the next course.
    let last_away = ticks.iter().rposition(|tick| !settled(tick));
    last_away
        .and_then(|last| ticks.get(last + 1))
        .map_or(f64::INFINITY, |arrived| arrived.at_s - course_s.start)
}

/// Largest difference in degrees between the heading of a base and the heading of its wheels' references, at any tick
/// of the window. The heading of a base with a gyro is its true heading. `None` if there is no base, or no tick at which
/// both wheels have references.
pub(crate) fn largest_heading_error(
    group: &Group,
    motors: &[Motor],
    trace: &Trace,
    window_s: &Range<f64>,
) -> Option<f64> {
    let mut heading = HeadingError::new(group, motors)?;
    let ticks = trace.ticks.iter().take_while(|tick| tick.at_s < window_s.end);
    let errors = ticks.filter_map(|tick| {
        let slip = slip_counts(group, tick);
        let wheel = |motor: usize| {
            let sample = tick.motors.get(motor)?;
            Some((sample.report.setpoint, sample.counts - slip.get(motor).unwrap_or(&0)))
        };
        heading.step(tick.at_s, wheel).filter(|_| tick.at_s >= window_s.start)
    });
    errors.reduce(f64::max)
}

/// Counts by which the left and the right wheel have slipped in turns. 0 for a base without a gyro, because such a base
/// measures its heading by its wheels alone.
fn slip_counts(group: &Group, tick: &Tick) -> [i64; 2] {
    // The simulated gyro stands on the base of the motors 0 and 1.
    match (group.base, tick.motors.as_slice()) {
        (Some(base), [left, right, ..]) if group.use_gyro => {
            let by_wheels = heading(&base, [left.counts as f64, right.counts as f64]);
            base.turn(by_wheels - tick.pose.heading_degrees).unwrap_or_default().map(i64::from)
        }
        _ => [0; 2],
    }
}

/// The heading error of a base, from tick to tick.
///
/// If a wheel no longer follows the group, for example after a fault, the last references of both wheels stay in force.
/// Therefore a base that turns while it halts has an error. References end with the next course, or with a set-point of
/// a single wheel.
///
/// The hub adds the slip of the wheels of a base with a gyro to the positions of their references. The error must not
/// trust the hub in this. So the references of such a base are the sums of their speeds, which hold no slip, from the first
/// tick at which both wheels follow a group.
pub(crate) struct HeadingError {
    base: DriveBase,
    wheels: [usize; 2],
    /// Times in seconds at which references end, ascending.
    ends: Peekable<IntoIter<f64>>,
    /// The last references of both wheels, in counts; `None` if there are none.
    led: Option<[f64; 2]>,
    use_gyro: bool,
    /// Time of the last tick in seconds, and the mean speeds of both references from this tick to the next, in counts/s;
    /// `None` if a wheel did not follow a group.
    speeds: Option<(f64, [f64; 2])>,
}

impl HeadingError {
    /// Creates the error without references; `None` if the group is no drive base.
    pub(crate) fn new(group: &Group, motors: &[Motor]) -> Option<Self> {
        let &[left, right] = group.motors.as_slice() else { return None };
        let members = [left, right].map(|motor| motors.get(motor).map_or(&[][..], |motor| &motor.setpoints));
        let own = members.into_iter().flatten().map(|setpoint| setpoint.at_s);
        // The references of a base with a gyro are summed up over all courses.
        let courses = group.courses.iter().filter(|_| !group.use_gyro).map(|course| course.at_s);
        let mut ends: Vec<f64> = courses.chain(own).collect();
        ends.sort_by(f64::total_cmp);
        let (wheels, ends) = ([left, right], ends.into_iter().peekable());
        Some(Self { base: group.base?, wheels, ends, led: None, use_gyro: group.use_gyro, speeds: None })
    }

    /// The error in degrees at a tick; `None` without references. `wheel` gives the set-point and the true counts of a
    /// motor.
    pub(crate) fn step(
        &mut self,
        at_s: f64,
        wheel: impl Fn(usize) -> Option<(Setpoint, i64)>,
    ) -> Option<f64> {
        while self.ends.next_if(|end_s| *end_s < at_s).is_some() {
            self.led = None;
        }
        let [left, right] = self.wheels.map(wheel);
        let ((left, left_counts), (right, right_counts)) = (left?, right?);
        let counts = [left_counts as f64, right_counts as f64];
        let speeds = self.speeds.take();
        if let (Setpoint::Follow(left), Setpoint::Follow(right)) = (left, right) {
            let references = [left, right];
            self.led = Some(match (self.led, speeds) {
                _ if !self.use_gyro => references.map(position),
                (Some(led), Some((last_s, cps))) => {
                    [0, 1].map(|wheel| led[wheel] + (at_s - last_s) * cps[wheel])
                }
                _ => counts,
            });
            let mean = |reference: Reference| (reference.speed.to_f64() + reference.next.to_f64()) / 2.0;
            self.speeds = Some((at_s, references.map(mean)));
        }
        let [left, right] = self.led?;
        let [left_counts, right_counts] = counts;
        Some(heading(&self.base, [left_counts - left, right_counts - right]).abs())
    }
}

/// The position of a reference in counts.
fn position(reference: Reference) -> f64 {
    f64::from(reference.position) + f64::from(reference.fraction) / 65_536.0
}

/// The heading in degrees of a base whose wheels have turned by these counts, resolved to a thousandth of a count.
fn heading(base: &DriveBase, counts: [f64; 2]) -> f64 {
    const PARTS: f64 = 1_000.0;
    base.heading(counts.map(|counts| (PARTS * counts).round() as i32)) / PARTS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gyro_base_that_the_hub_turns_too_little_has_an_error_whatever_its_references_are() {
        let base = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0; 2] };
        let group = Group {
            label: "base".into(),
            motors: vec![0, 1],
            base: Some(base),
            use_gyro: true,
            courses: Vec::new(),
        };
        for lost in [0.0, 0.1] {
            let mut error = HeadingError::new(&group, &[]).expect("a base");
            let mut last = None;
            // The references turn by 90 degrees in 1.4 s.
            for tick in 0..=140 {
                let counts = f64::from(10 * tick);
                let wheel = |motor: usize| {
                    let side = if motor == 0 { -1.0 } else { 1.0 };
                    let speed = CountsPerSecond::new((1_000.0 * side) as i32);
                    let moved = (side * counts * (1.0 - lost)).round();
                    let position = moved as i32;
                    let reference = Reference { position, speed, next: speed, ..Reference::default() };
                    Some((Setpoint::Follow(reference), moved as i64))
                };
                last = error.step(f64::from(tick) / 100.0, wheel);
            }
            assert!((last.expect("references") - 90.0 * lost).abs() < 0.1, "{lost}: {last:?}");
        }
    }
}
