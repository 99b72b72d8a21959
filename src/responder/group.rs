//! What the hub remembers of groups on behalf of the host: courses that the motors have not been told yet.

use crate::group::{ByMotor, Course, MOTORS, Together};
use crate::protocol::CHANNELS;
use crate::protocol::group::{GroupCourse, GroupMove};

/// Courses that are still to be told, by the motor that each was said to.
#[derive(Clone, Debug)]
pub(super) struct Courses<const N: usize> {
    untold: [Option<Together>; N],
}

impl<const N: usize> Courses<N> {
    pub(super) const NONE: Self = Self { untold: [None; N] };

    /// Instead of whatever its members were to be told.
    pub(super) fn put(&mut self, leader: usize, together: Together) {
        for (motor, member) in together.course.members().into_iter().enumerate() {
            if member {
                self.forget(motor);
            }
        }
        if let Some(slot) = self.untold.get_mut(leader) {
            *slot = Some(together);
        }
    }

    /// The courses of a motor that has been told something else.
    pub(super) fn forget(&mut self, motor: usize) {
        for slot in &mut self.untold {
            slot.take_if(|together| together.course.members().get(motor) == Some(&true));
        }
    }

    pub(super) const fn clear(&mut self) {
        *self = Self::NONE;
    }

    /// Of all that are untold the first.
    pub(super) fn next(&self) -> Option<(usize, Together)> {
        self.untold.iter().enumerate().find_map(|(leader, together)| Some((leader, (*together)?)))
    }

    /// Takes out that first course, because it has been sent.
    pub(super) fn sent(&mut self) -> Option<Together> {
        self.untold.iter_mut().find_map(Option::take)
    }

    pub(super) fn concern(&self, motor: usize) -> bool {
        self.untold.iter().flatten().any(|together| together.course.members().get(motor) == Some(&true))
    }
}

/// What a host's course is in the counts of the motors, `goal` of a motor's number and a target of the host's.
pub(super) fn together(wanted: GroupMove, goal: impl Fn(usize, i32) -> i32) -> Together {
    let GroupMove { course, speed, acceleration, lag, tolerance, halt } = wanted;
    let course = match course {
        GroupCourse::To(counts) => {
            let mut places = by_motor(counts);
            for (motor, counts) in places.iter_mut().enumerate() {
                *counts = counts.map(|counts| goal(motor, counts));
            }
            Course::To(places)
        }
        GroupCourse::On(speeds) => Course::On(by_motor(speeds)),
    };
    Together { course, speed, acceleration, lag, tolerance, halt }
}

fn by_motor<T: Copy>(channels: [Option<T>; CHANNELS]) -> ByMotor<T> {
    let mut all = [None; MOTORS];
    for (slot, value) in all.iter_mut().zip(channels) {
        *slot = value;
    }
    all
}
