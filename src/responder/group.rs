//! Courses of groups that must still be sent to the motors.

use crate::extension::group::GroupCourse;
use crate::group::{Course, GroupCommand, MOTORS};
use crate::protocol::CHANNELS;

/// Courses of groups that must still be sent. The *leader* of a course is the motor of the host's request.
#[derive(Clone, Debug)]
pub(super) struct Courses<const N: usize> {
    /// Element i is the pending course that a request to motor i has started.
    pending: [Option<GroupCommand>; N],
}

impl<const N: usize> Courses<N> {
    pub(super) const NONE: Self = Self { pending: [None; N] };

    /// Adds the course of a request to the motor `leader`. Removes pending courses that move a member of the new
    /// course.
    pub(super) fn add(&mut self, leader: usize, command: GroupCommand) {
        for (motor, member) in command.course.members().into_iter().enumerate() {
            if member {
                self.remove(motor);
            }
        }
        if let Some(slot) = self.pending.get_mut(leader) {
            *slot = Some(command);
        }
    }

    /// Removes the pending courses that move this motor.
    pub(super) fn remove(&mut self, motor: usize) {
        for slot in &mut self.pending {
            slot.take_if(|command| command.course.members().get(motor) == Some(&true));
        }
    }

    pub(super) const fn clear(&mut self) {
        *self = Self::NONE;
    }

    /// Returns the pending course to send next, with its leader.
    pub(super) fn next(&self) -> Option<(usize, GroupCommand)> {
        self.pending.iter().enumerate().find_map(|(leader, command)| Some((leader, (*command)?)))
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

fn by_motor<T: Copy>(channels: [Option<T>; CHANNELS]) -> [Option<T>; MOTORS] {
    let mut all = [None; MOTORS];
    for (slot, value) in all.iter_mut().zip(channels) {
        *slot = value;
    }
    all
}
