//! Groups: moves them at a host's request, and reports their state.

use super::motor::MotorChannel;
use super::{NO_MOTOR, Responder};
use crate::extension::group::{GroupCourse, GroupState};
use crate::group::{Course, GroupCommand, Halt, for_motors};
use crate::hub::Snapshot;
use crate::motor::Setpoint;
use crate::protocol::{Nack, Reply};
use crate::units::CountsPerSecond;

impl<const N: usize> Responder<N> {
    /// Queues the course of a group that has the motor `addressed` as a member.
    ///
    /// # Errors
    /// Refuses a group without the motor `addressed`, a member that the hub does not have, and a member that is not
    /// enabled.
    pub(super) fn move_group(
        &mut self,
        addressed: usize,
        wanted: GroupCommand<GroupCourse>,
        snapshot: &Snapshot<N>,
    ) -> Result<Reply, Nack> {
        let GroupCommand { course, speed, acceleration, lag, tolerance, halt } = wanted;
        let course = self.in_motor_counts(course, snapshot);
        let members = course.members();
        let mut others = members.iter().skip(N);
        if members.get(addressed) != Some(&true) || others.any(|member| *member) {
            return Err(Nack::parameter(2));
        }
        if !self.channels.iter().zip(members).all(|(channel, member)| !member || channel.enabled()) {
            return Err(Nack::WRONG_MODE);
        }
        self.delete_courses(for_motors(members, false));
        for (channel, member) in self.channels.iter_mut().zip(members) {
            if member {
                channel.join();
            }
        }
        if let Some(free) = self.courses.iter_mut().find(|slot| slot.is_none()) {
            *free = Some(GroupCommand { course, speed, acceleration, lag, tolerance, halt });
        }
        Ok(Reply::ACK)
    }

    /// Converts a course from the host's counts to the motors' counts.
    fn in_motor_counts(&self, course: GroupCourse, snapshot: &Snapshot<N>) -> Course {
        match course {
            GroupCourse::Position(mut counts) => {
                let motors = self.channels.iter().zip(&snapshot.motors);
                for (counts, (channel, report)) in counts.iter_mut().zip(motors) {
                    *counts = counts.map(|counts| channel.goal(counts, report.position));
                }
                Course::Position(for_motors(counts, None))
            }
            GroupCourse::Velocity(speeds) => Course::Velocity(for_motors(speeds, None)),
        }
    }

    /// Deletes the pending courses that move one of these motors. The other members of a deleted course halt, as the
    /// members of a group that waits to start: with [`Halt::Stop`] they get the velocity 0, with [`Halt::Coast`] the
    /// set-point [`Setpoint::Disabled`]. If a host has disabled a member of the course, the others always get this
    /// set-point.
    pub(super) fn delete_courses(&mut self, leaving: [bool; N]) {
        for slot in &mut self.courses {
            let leaves = |command: &mut GroupCommand| {
                leaving.iter().zip(command.course.members()).any(|(leaves, member)| *leaves && member)
            };
            let Some(GroupCommand { course, halt, .. }) = slot.take_if(leaves) else { continue };
            let members = || course.members().into_iter().zip(leaving);
            let is_disabled = |(channel, (member, _)): (&MotorChannel, _)| member && !channel.enabled();
            let any_disabled = self.channels.iter().zip(members()).any(is_disabled);
            let setpoint = match halt {
                Halt::Stop if !any_disabled => Setpoint::Velocity(CountsPerSecond::ZERO),
                Halt::Stop | Halt::Coast => Setpoint::Disabled,
            };
            for (channel, (member, leaves)) in self.channels.iter_mut().zip(members()) {
                if member && !leaves {
                    channel.start(setpoint);
                }
            }
        }
    }

    /// Returns the state of the group that a motor is in.
    pub(super) fn group_state(&self, motor: usize, snapshot: &Snapshot<N>) -> Result<Reply, Nack> {
        let report = snapshot.motors.get(motor).ok_or(NO_MOTOR)?;
        let channel = self.channels.get(motor).ok_or(NO_MOTOR)?;
        let state = match (self.awaits_snapshot(motor), report.setpoint) {
            (true, _) if channel.in_group() => GroupState::Moving,
            (true, _) => GroupState::Alone,
            (false, Setpoint::Follow(_)) if report.settled => GroupState::Settled,
            (false, Setpoint::Follow(_)) => GroupState::Moving,
            (false, _) => GroupState::Alone,
        };
        Ok(Reply::data(&state))
    }
}
