//! Courses of groups that the motors have not received yet.

use crate::extension::group::GroupCourse;
use crate::group::{ByMotor, Course, GroupCommand, MOTORS};
use crate::protocol::CHANNELS;

/// Pending courses, by the motor that the host's request names.
#[derive(Clone, Debug)]
pub(super) struct Courses<const N: usize> {
    pending: [Option<GroupCommand>; N],
}

impl<const N: usize> Courses<N> {
    pub(super) const NONE: Self = Self { pending: [None; N] };

    /// Adds a course, and removes all pending courses of its members.
    pub(super) fn put(&mut self, leader: usize, together: GroupCommand) {
        for (motor, member) in together.course.members().into_iter().enumerate() {
            if member {
                self.remove(motor);
            }
        }
        if let Some(slot) = self.pending.get_mut(leader) {
            *slot = Some(together);
        }
    }

    /// Removes the pending courses of a motor.
    pub(super) fn remove(&mut self, motor: usize) {
        for slot in &mut self.pending {
            slot.take_if(|together| together.course.members().get(motor) == Some(&true));
        }
    }

    pub(super) const fn clear(&mut self) {
        *self = Self::NONE;
    }

    /// The first pending course.
    pub(super) fn next(&self) -> Option<(usize, GroupCommand)> {
        self.pending.iter().enumerate().find_map(|(leader, together)| Some((leader, (*together)?)))
    }

    /// Removes the first pending course, because it has been sent.
    pub(super) fn sent(&mut self) -> Option<GroupCommand> {
        self.pending.iter_mut().find_map(Option::take)
    }

    /// True if a course of this motor is pending.
    pub(super) fn concern(&self, motor: usize) -> bool {
        self.pending.iter().flatten().any(|together| together.course.members().get(motor) == Some(&true))
    }
}

/// A host's course in the counts of the motors. `goal` converts a motor's number and a target in the host's counts.
pub(super) fn together(wanted: GroupCommand<GroupCourse>, goal: impl Fn(usize, i32) -> i32) -> GroupCommand {
    let GroupCommand { course, speed, acceleration, lag, tolerance, halt } = wanted;
    let course = match course {
        GroupCourse::To(counts) => {
            let mut targets = by_motor(counts);
            for (motor, counts) in targets.iter_mut().enumerate() {
                *counts = counts.map(|counts| goal(motor, counts));
            }
            Course::To(targets)
        }
        GroupCourse::On(speeds) => Course::On(by_motor(speeds)),
    };
    GroupCommand { course, speed, acceleration, lag, tolerance, halt }
}

fn by_motor<T: Copy>(channels: [Option<T>; CHANNELS]) -> ByMotor<T> {
    let mut all = [None; MOTORS];
    for (slot, value) in all.iter_mut().zip(channels) {
        *slot = value;
    }
    all
}
