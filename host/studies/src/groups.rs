//! What a run was like for motors that move in step: when they arrived, and how far apart they were on the way.

use motor_hub::group::DriveBase;
use motor_hub::motor::Setpoint;
use simulated::scenario::{Group, Motor};
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

/// Largest difference in degrees between the heading of a base and the heading of its wheels' references, at any tick of
/// the window. `None` if there is no base, or no tick at which both wheels are led.
///
/// After a wheel is lost, its last reference and that of the other wheel stay in force. So a base that turns while it
/// halts has an error. They end with the next course, or with a set-point of a wheel's own.
pub(crate) fn largest_heading_error(
    group: &Group,
    motors: &[Motor],
    trace: &Trace,
    window_s: &Range<f64>,
) -> Option<f64> {
    let base = group.base?;
    let &[left, right] = group.motors.as_slice() else { return None };
    let members = [left, right].map(|motor| motors.get(motor).map_or(&[][..], |motor| &motor.setpoints));
    let own = members.into_iter().flatten().map(|setpoint| setpoint.at_s);
    let mut ends: Vec<f64> = group.courses.iter().map(|course| course.at_s).chain(own).collect();
    ends.sort_by(f64::total_cmp);
    let mut ends = ends.into_iter().peekable();
    let mut led: Option<[f64; 2]> = None;
    let mut largest = None;
    for tick in trace.ticks.iter().take_while(|tick| tick.at_s < window_s.end) {
        while ends.next_if(|end_s| *end_s < tick.at_s).is_some() {
            led = None;
        }
        let [left, right] = [left, right].map(|motor| tick.motors.get(motor));
        let (Some(left), Some(right)) = (left, right) else { continue };
        if let (Some(left), Some(right)) = (reference(left), reference(right)) {
            led = Some([left, right]);
        }
        if let Some(led) = led.filter(|_| tick.at_s >= window_s.start) {
            let error = heading(&base, [left.counts as f64 - led[0], right.counts as f64 - led[1]]).abs();
            largest = Some(largest.map_or(error, |largest: f64| largest.max(error)));
        }
    }
    largest
}

/// The position in counts that leads a member of a group.
fn reference(sample: &Sample) -> Option<f64> {
    let Setpoint::Together(reference) = sample.report.setpoint else { return None };
    Some(f64::from(reference.position) + f64::from(reference.fraction) / 65_536.0)
}

/// The heading in degrees of a base whose wheels have turned by so many counts, resolved to a thousandth of a count.
fn heading(base: &DriveBase, counts: [f64; 2]) -> f64 {
    const PARTS: f64 = 1_000.0;
    base.heading(counts.map(|counts| (PARTS * counts).round() as i32)) / PARTS
}
