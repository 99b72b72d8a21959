//! Measures of motors that move in step: the time until all have settled, and the heading error of a drive base.

use motor_hub::group::DriveBase;
use motor_hub::motor::Setpoint;
use simulated::scenario::{Group, Motor};
use simulated::trace::{Tick, Trace};
use std::iter::Peekable;
use std::ops::Range;
use std::vec::IntoIter;

/// Longest time in seconds until all members have settled after the start of a course, for the courses that begin in
/// the window. A course ends with the next course or with the window. Infinite if a member does not settle; `None` if
/// no course begins in the window.
pub(crate) fn longest_arrival_s(group: &Group, trace: &Trace, window_s: &Range<f64>) -> Option<f64> {
    let starts = || group.courses.iter().map(|course| course.at_s).filter(|at_s| window_s.contains(at_s));
    let ends = starts().skip(1).chain([window_s.end]);
    starts().zip(ends).map(|(from_s, to_s)| arrival_s(group, trace, &(from_s..to_s))).reduce(f64::max)
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
/// of the window. `None` if there is no base, or no tick at which both wheels have references.
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

/// Counts by which the left and the right wheel have slipped in turns, and which the hub has not corrected yet. 0 for a
/// base without a gyro, because such a base measures its heading by its wheels alone.
fn slip_counts(group: &Group, tick: &Tick) -> [i64; 2] {
    let none = [0; 2];
    // The simulated gyro stands on the base of the motors 0 and 1.
    let (Some(base), Some(state), [left, right, ..]) = (group.base, tick.base, tick.motors.as_slice()) else {
        return none;
    };
    if !group.use_gyro {
        return none;
    }
    let by_wheels = heading(&base, [left.counts as f64, right.counts as f64]);
    let [left, right] = base.turn(by_wheels - tick.pose.heading_degrees).unwrap_or_default();
    let [left_corrected, right_corrected] = state.correction;
    [i64::from(left) - i64::from(left_corrected), i64::from(right) - i64::from(right_corrected)]
}

/// The heading error of a base, from tick to tick.
///
/// If a wheel no longer follows the group, for example after a fault, the last references of both wheels stay in force.
/// Therefore a base that turns while it halts has an error. References end with the next course, or with a set-point of
/// a single wheel.
pub(crate) struct HeadingError {
    base: DriveBase,
    wheels: [usize; 2],
    /// Times in seconds at which references end, ascending.
    ends: Peekable<IntoIter<f64>>,
    /// The last references of both wheels, in counts; `None` if there are none.
    led: Option<[f64; 2]>,
}

impl HeadingError {
    /// Creates the error without references; `None` if the group is no drive base.
    pub(crate) fn new(group: &Group, motors: &[Motor]) -> Option<Self> {
        let &[left, right] = group.motors.as_slice() else { return None };
        let members = [left, right].map(|motor| motors.get(motor).map_or(&[][..], |motor| &motor.setpoints));
        let own = members.into_iter().flatten().map(|setpoint| setpoint.at_s);
        let mut ends: Vec<f64> = group.courses.iter().map(|course| course.at_s).chain(own).collect();
        ends.sort_by(f64::total_cmp);
        Some(Self { base: group.base?, wheels: [left, right], ends: ends.into_iter().peekable(), led: None })
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
        if let (Some(left), Some(right)) = (reference(left), reference(right)) {
            self.led = Some([left, right]);
        }
        let [left, right] = self.led?;
        Some(heading(&self.base, [left_counts as f64 - left, right_counts as f64 - right]).abs())
    }
}

/// The reference position in counts of a member of a group; `None` for another set-point.
fn reference(setpoint: Setpoint) -> Option<f64> {
    let Setpoint::Follow(reference) = setpoint else { return None };
    Some(f64::from(reference.position) + f64::from(reference.fraction) / 65_536.0)
}

/// The heading in degrees of a base whose wheels have turned by these counts, resolved to a thousandth of a count.
fn heading(base: &DriveBase, counts: [f64; 2]) -> f64 {
    const PARTS: f64 = 1_000.0;
    base.heading(counts.map(|counts| (PARTS * counts).round() as i32)) / PARTS
}
