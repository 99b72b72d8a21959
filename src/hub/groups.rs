//! Manages the groups of a hub. A *group* is a set of motors that move synchronously, see [`crate::group`].
//!
//! ```text
//!       command         all members are ready        no member left, or others disabled
//! none ------> Waiting ---------------------> Moving ------------------------------------> none
//!                 |  a member leaves
//!                 '-------------------> none
//! ```
//!
//! A member is *ready* if its encoder reading and the battery voltage are fresh, and if it has no latched fault. A
//! group that started with a member at fault would drive its other members for a tick, until the member is lost.
//!
//! A member of a moving group is *lost* when it has a fault, gets a set-point of its own, which may be disabled or
//! fail-safe, or joins another group. Also lost are the wheels of a drive base that is configured, replaced or removed.
//! The other members are disabled (they coast) if the lost member was disabled or put into fail-safe, or if the group's
//! setting is [`Halt::Coast`]. With [`Halt::Stop`] the other members stop on their course. A group stays `Moving` after
//! the end of its course, and holds the positions of its members. A command for exactly the members of a moving group
//! changes its course, unless the group has lost a member.

use super::base::Base;
use crate::group::{Group, GroupCommand, Halt, MOTORS, for_motors};
use crate::motion::Reading;
use crate::motor::{self, Motor, Report, Setpoint, SettleDetector};
use crate::units::{CountsPerSecond, Micros, Period, RangeError};

/// The state of one group.
#[derive(Clone, Debug)]
enum ActiveGroup<const N: usize> {
    /// The group waits for the first tick at which all members are ready.
    Waiting(GroupCommand),
    /// The group follows its course, and then holds its end positions.
    Moving {
        group: Group<N>,
        /// The members with which the group has started. A wheel of a drive base keeps its correction by the gyro when
        /// the other wheel leaves: without the correction its reference would jump.
        started_with: [bool; N],
        /// Reports when all members have settled at the end positions.
        settle_detector: SettleDetector,
    },
}

impl<const N: usize> ActiveGroup<N> {
    /// Returns for each motor whether it is a member.
    fn members(&self) -> [bool; N] {
        match self {
            Self::Waiting(command) => for_motors(command.course.members(), false),
            Self::Moving { group, .. } => *group.members(),
        }
    }
}

/// All groups of a hub. A motor is in one group at most, so there are at most N groups.
#[derive(Clone, Debug)]
pub(super) struct Groups<const N: usize> {
    states: [Option<ActiveGroup<N>>; N],
}

impl<const N: usize> Groups<N> {
    /// Creates the state without any group.
    pub(super) const fn new() -> Self {
        Self { states: [const { None }; N] }
    }

    /// Changes the course of the moving group that started with exactly the members of `command`, and has lost none. If
    /// there is no such group, each member leaves its old group, and a new group waits to start. The other members of
    /// the old groups halt according to the setting of their group. A group that has lost members does not continue
    /// with a new course, even if its remaining members are the members of `command`: after one wheel of a drive base
    /// is lost, the remaining wheel keeps its correction by the gyro. A new group of one wheel has no correction.
    ///
    /// # Errors
    /// Returns [`RangeError::Motor`] if the hub does not have all members, or if there are no members.
    pub(super) fn command(
        &mut self,
        command: GroupCommand,
        motors: &mut [Motor; N],
    ) -> Result<(), RangeError> {
        let new_members = command.course.members();
        if new_members == [false; MOTORS] || new_members.iter().skip(N).any(|member| *member) {
            return Err(RangeError::Motor);
        }
        let members: [bool; N] = for_motors(new_members, false);
        for state in self.states.iter_mut().flatten() {
            if let ActiveGroup::Moving { group, started_with, .. } = state
                && *started_with == members
                && *group.members() == members
            {
                group.redirect(command);
                return Ok(());
            }
        }
        self.release_and_stop(members, motors);
        if let Some(free) = self.states.iter_mut().find(|state| state.is_none()) {
            *free = Some(ActiveGroup::Waiting(command));
        }
        Ok(())
    }

    /// Removes these motors from their groups. The members that stay halt according to the setting of their group. A
    /// motor that has left a group gets the velocity 0 as its set-point. With the setting `ZeroPower::Float` this motor
    /// coasts, otherwise it stops and holds its position.
    pub(super) fn release_and_stop(&mut self, leaving: [bool; N], motors: &mut [Motor; N]) {
        let left = self.remove_members(leaving, None, motors);
        members_of(&left, motors).for_each(|motor| motor.set(Setpoint::Velocity(CountsPerSecond::ZERO)));
    }

    /// Removes these motors from their groups. The members that stay halt according to `halt`; `None` stands for the
    /// group's own setting. A waiting group that loses a member ends. Returns the motors of `leaving` that were in a
    /// group.
    pub(super) fn remove_members(
        &mut self,
        leaving: [bool; N],
        halt: Option<Halt>,
        motors: &mut [Motor; N],
    ) -> [bool; N] {
        let mut have_left = [false; N];
        for slot in &mut self.states {
            let Some(state) = slot else { continue };
            let members = state.members();
            let mut staying = members;
            for ((stays, left), leaves) in staying.iter_mut().zip(&mut have_left).zip(leaving) {
                if *stays && leaves {
                    (*stays, *left) = (false, true);
                }
            }
            if staying == members {
                continue;
            }
            let ended = match state {
                ActiveGroup::Waiting(command) => {
                    // Without a tick since the command of this group, the members may have their old set-points.
                    let setpoint = match halt.unwrap_or(command.halt) {
                        Halt::Stop => Setpoint::Velocity(CountsPerSecond::ZERO),
                        Halt::Coast => Setpoint::Disabled,
                    };
                    members_of(&staying, motors).for_each(|motor| motor.set(setpoint));
                    true
                }
                ActiveGroup::Moving { group, .. } => {
                    for (motor, (member, stays)) in members.into_iter().zip(staying).enumerate() {
                        if member != stays {
                            group.remove(motor);
                        }
                    }
                    halt_group(group, halt.unwrap_or(group.halt()), motors)
                }
            };
            if ended {
                *slot = None;
            }
        }
        have_left
    }

    /// Starts the waiting groups whose members are all ready. Sets the set-points of all members of moving groups for
    /// this tick. `has_battery` is true if the battery voltage is fresh. Groups are computed in corrected positions:
    /// the corrections by the gyro are subtracted from the encoder positions, and added to the set-points.
    pub(super) fn step(
        &mut self,
        now: Micros,
        readings: &[Option<Reading>; N],
        has_battery: bool,
        period: Period,
        base: Option<&Base>,
        motors: &mut [Motor; N],
    ) {
        if self.states.iter().all(Option::is_none) {
            return;
        }
        let fresh = readings.map(|reading| motor::fresh(reading, now));
        let mut positions = motors.each_ref().map(|motor| motor.position());
        for (position, reading) in positions.iter_mut().zip(fresh) {
            *position = reading.map_or(*position, |reading| reading.position);
        }
        for state in self.states.iter_mut().flatten() {
            if let ActiveGroup::Waiting(command) = state {
                let members = for_motors(command.course.members(), false);
                let ready = members.iter().zip(&fresh).zip(&*motors).all(|((member, reading), motor)| {
                    !member || reading.is_some() && has_battery && !motor.has_latched_fault()
                });
                if ready {
                    let speeds = motors.each_ref().map(|motor| motor.velocity());
                    let positions = minus(&positions, &corrections_of(base, &members));
                    let group = Group::new(*command, positions, speeds, period);
                    let settle_detector = SettleDetector::default();
                    *state = ActiveGroup::Moving { group, started_with: members, settle_detector };
                } else {
                    // While the group waits, its members stand. They would otherwise follow their old set-points.
                    members_of(&members, motors)
                        .for_each(|motor| motor.set(Setpoint::Velocity(CountsPerSecond::ZERO)));
                }
            }
            let ActiveGroup::Moving { group, started_with, .. } = state else { continue };
            let corrections = corrections_of(base, started_with);
            let references = group.step(&minus(&positions, &corrections));
            for ((motor, reference), correction) in motors.iter_mut().zip(references).zip(corrections) {
                if let Some(mut reference) = reference {
                    reference.position = reference.position.wrapping_add(correction);
                    motor.set(Setpoint::Follow(reference));
                }
            }
        }
    }

    /// Finishes a tick of all moving groups. Removes members with a fault from their group, and halts the other
    /// members. Sets `settled` in the members' reports: true for all members if the whole group has settled. A group
    /// that has lost a member never settles.
    pub(super) fn review(
        &mut self,
        reports: &mut [Report; N],
        motors: &mut [Motor; N],
        base: Option<&Base>,
        period: Period,
    ) {
        for slot in &mut self.states {
            let Some(ActiveGroup::Moving { group, started_with, settle_detector }) = slot else { continue };
            let members = *group.members();
            for (index, (report, motor)) in reports.iter().zip(motors.iter_mut()).enumerate() {
                if members.get(index) == Some(&true) && report.faults.any() {
                    group.remove(index);
                    // Disabling the motor would clear the fault before a host has read it.
                    motor.set(Setpoint::Velocity(CountsPerSecond::ZERO));
                }
            }
            let staying = *group.members();
            let positions = reports.each_ref().map(|report| report.position);
            // A group that has lost a member usually stops before its end positions, so it never counts as settled.
            let within_tolerance = staying == *started_with
                && group.is_within_tolerance(&minus(&positions, &corrections_of(base, started_with)));
            let settled = settle_detector.step(within_tolerance, fastest(&staying, reports), period);
            for (report, stays) in reports.iter_mut().zip(staying) {
                report.settled |= stays && settled;
            }
            if staying != members && halt_group(group, group.halt(), motors) {
                *slot = None;
            }
        }
    }
}

/// Returns the correction of each motor's position by the gyro, in counts, for a group that has started with these
/// members. The correction is 0 unless the members are the wheels of a drive base.
fn corrections_of<const N: usize>(base: Option<&Base>, members: &[bool; N]) -> [i32; N] {
    base.map_or([0; N], |base| base.corrections(members))
}

/// Returns the positions minus the corrections. Positions wrap.
fn minus<const N: usize>(positions: &[i32; N], corrections: &[i32; N]) -> [i32; N] {
    core::array::from_fn(|motor| {
        let [position, correction] =
            [positions, corrections].map(|of| of.get(motor).copied().unwrap_or_default());
        position.wrapping_sub(correction)
    })
}

/// Returns the velocity of the member that moves fastest.
fn fastest<const N: usize>(members: &[bool; N], reports: &[Report; N]) -> CountsPerSecond {
    let velocities =
        reports.iter().zip(members).filter(|(_, member)| **member).map(|(report, _)| report.velocity);
    velocities.max_by_key(|velocity| velocity.to_bits().unsigned_abs()).unwrap_or(CountsPerSecond::ZERO)
}

/// Halts the remaining members of a group. Returns true if the group has ended.
fn halt_group<const N: usize>(group: &mut Group<N>, halt: Halt, motors: &mut [Motor; N]) -> bool {
    match halt {
        Halt::Stop => group.stop(),
        Halt::Coast => members_of(group.members(), motors).for_each(|motor| motor.set(Setpoint::Disabled)),
    }
    halt == Halt::Coast || *group.members() == [false; N]
}

/// Iterates over the motors that are members of a group.
fn members_of<'a, const N: usize>(
    members: &'a [bool; N],
    motors: &'a mut [Motor; N],
) -> impl Iterator<Item = &'a mut Motor> {
    motors.iter_mut().zip(members).filter_map(|(motor, member)| member.then_some(motor))
}
