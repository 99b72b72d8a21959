//! Courses of groups that must still be sent to the motors.

use crate::extension::group::GroupCourse;
use crate::group::{Course, GroupCommand, for_motors};

/// Courses of groups that must still be sent.
#[derive(Clone, Debug)]
pub(super) struct Courses<const N: usize> {
    /// The pending courses. No motor is a member of two pending courses, so N elements are enough.
    pending: [Option<GroupCommand>; N],
}

impl<const N: usize> Courses<N> {
    pub(super) const NONE: Self = Self { pending: [None; N] };

    /// Adds a course. The caller first removes pending courses that move a member of the new course.
    pub(super) fn add(&mut self, command: GroupCommand) {
        if let Some(free) = self.pending.iter_mut().find(|slot| slot.is_none()) {
            *free = Some(command);
        }
    }

    /// Removes a pending course that moves one of these motors, and returns the course. `None` if there is none.
    pub(super) fn remove(&mut self, leaving: &[bool; N]) -> Option<GroupCommand> {
        let leaves = |command: &mut GroupCommand| {
            leaving.iter().zip(command.course.members()).any(|(leaves, member)| *leaves && member)
        };
        self.pending.iter_mut().find_map(|slot| slot.take_if(leaves))
    }

    pub(super) const fn clear(&mut self) {
        *self = Self::NONE;
    }

    /// Returns the pending course to send next.
    pub(super) fn next(&self) -> Option<GroupCommand> {
        self.pending.iter().find_map(|command| *command)
    }

    /// Removes and returns the course that [`next`](Self::next) returns, because the course has been sent.
    pub(super) fn sent(&mut self) -> Option<GroupCommand> {
        self.pending.iter_mut().find_map(Option::take)
    }

    /// True if a course that moves this motor is pending.
    pub(super) fn moves(&self, motor: usize) -> bool {
        self.pending.iter().flatten().any(|command| command.course.members().get(motor) == Some(&true))
    }
}

/// Converts a command from the host's counts to the motors' counts. `goal(motor, counts)` converts a target of the
/// motor with this number.
pub(super) fn in_motor_counts(
    wanted: GroupCommand<GroupCourse>,
    goal: impl Fn(usize, i32) -> i32,
) -> GroupCommand {
    let GroupCommand { course, speed, acceleration, lag, tolerance, halt } = wanted;
    let course = match course {
        GroupCourse::Position(counts) => {
            let mut targets = for_motors(counts, None);
            for (motor, counts) in targets.iter_mut().enumerate() {
                *counts = counts.map(|counts| goal(motor, counts));
            }
            Course::Position(targets)
        }
        GroupCourse::Velocity(speeds) => Course::Velocity(for_motors(speeds, None)),
    };
    GroupCommand { course, speed, acceleration, lag, tolerance, halt }
}
