//! What a run was like for motors that move in step: when they arrived, and how far apart they were on the way.

use motor_hub::group::DriveBase;
use motor_hub::motor::Setpoint;
use simulated::scenario::Group;
use simulated::trace::{Sample, Tick, Trace};
use std::ops::Range;

/// Seconds from a course that begins in the window until all members have settled, up to the next course or the
/// window's end: the longest. Infinite if a member does not settle; `None` if there is no course.
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
    // Settled members report that they have settled until the next course.
    let last_away = ticks.iter().rposition(|tick| !settled(tick));
    last_away
        .and_then(|last| ticks.get(last + 1))
        .map_or(f64::INFINITY, |arrived| arrived.at_s - course_s.start)
}

/// By how many degrees the base of a group heads elsewhere than its members' references do: the most at any tick
/// of the window. `None` if there is no base, or no tick at which both wheels are led.
pub(crate) fn largest_heading_error(group: &Group, trace: &Trace, window_s: &Range<f64>) -> Option<f64> {
    let base = group.base?;
    let &[left, right] = group.motors.as_slice() else { return None };
    let ticks = trace.ticks.iter().filter(|tick| window_s.contains(&tick.at_s));
    let errors = ticks.filter_map(|tick| {
        let [left, right] = [left, right].map(|motor| tick.motors.get(motor).and_then(ahead));
        Some(heading(&base, [left?, right?]).abs())
    });
    errors.reduce(f64::max)
}

/// Counts by which a member is beyond its reference.
fn ahead(sample: &Sample) -> Option<f64> {
    let Setpoint::Together(reference) = sample.report.setpoint else { return None };
    let place = f64::from(reference.position) + f64::from(reference.fraction) / 65_536.0;
    Some(sample.counts as f64 - place)
}

/// To parts of a count.
fn heading(base: &DriveBase, counts: [f64; 2]) -> f64 {
    const PARTS: f64 = 1_000.0;
    base.heading(counts.map(|counts| (PARTS * counts).round() as i32)) / PARTS
}
