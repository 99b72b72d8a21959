//! The groups of a hub: who is in which, and what ends them.

use super::Inputs;
use crate::group::{Group, Halt, MOTORS, Together};
use crate::motor::{self, Motor, Report, Setpoint, SettleDetector};
use crate::units::{CountsPerSecond, Period, RangeError};

/// A group as the hub has it.
#[derive(Clone, Debug)]
enum Led<const N: usize> {
    /// Begins at the first tick at which it is known where all of its members are.
    Due(Together),
    /// Follows its course. The detector says whether all members have settled at its end.
    Moving(Group<N>, SettleDetector),
}

/// All groups. No motor is in two of them, so there are no more than motors.
#[derive(Clone, Debug)]
pub(super) struct Groups<const N: usize> {
    led: [Option<Led<N>>; N],
}

impl<const N: usize> Groups<N> {
    pub(super) const fn new() -> Self {
        Self { led: [const { None }; N] }
    }

    /// Sends a group on a course: one that there is, if these are its members, or else a new one.
    pub(super) fn lead(
        &mut self,
        leader: usize,
        together: Together,
        motors: &mut [Motor; N],
    ) -> Result<(), RangeError> {
        let wanted = together.course.members();
        let is_wanted = |motor: usize| wanted.get(motor) == Some(&true);
        if !is_wanted(leader) || (N..MOTORS).any(is_wanted) {
            return Err(RangeError::Motor);
        }
        for led in self.led.iter_mut().flatten() {
            if let Led::Moving(group, settle_detector) = led
                && group.members().iter().enumerate().all(|(motor, member)| *member == is_wanted(motor))
            {
                group.redirect(together);
                settle_detector.reset();
                of(group.members(), motors).for_each(Motor::retarget);
                return Ok(());
            }
        }
        for motor in (0..N).filter(|motor| is_wanted(*motor)) {
            if self.leave(motor, None, motors)
                && let Some(motor) = motors.get_mut(motor)
            {
                // Until the new group begins.
                motor.set(Setpoint::Velocity(CountsPerSecond::ZERO));
            }
        }
        if let Some(free) = self.led.iter_mut().find(|led| led.is_none()) {
            *free = Some(Led::Due(together));
        }
        Ok(())
    }

    /// Takes a motor out of its group; false if it was in none that moves. The others halt as told here, or
    /// else as the group's own setting says.
    pub(super) fn leave(&mut self, motor: usize, halt: Option<Halt>, motors: &mut [Motor; N]) -> bool {
        let mut moved = false;
        for slot in &mut self.led {
            match slot {
                Some(Led::Due(together)) if together.course.members().get(motor) == Some(&true) => {
                    *slot = None
                }
                Some(Led::Moving(group, _)) if group.members().get(motor) == Some(&true) => {
                    moved = true;
                    group.remove(motor);
                    if ends(group, halt.unwrap_or(group.halt()), motors) {
                        *slot = None;
                    }
                }
                _ => (),
            }
        }
        moved
    }

    /// Tells the members where to be at this tick.
    pub(super) fn step(&mut self, inputs: &Inputs<N>, period: Period, motors: &mut [Motor; N]) {
        if self.led.iter().all(Option::is_none) {
            return;
        }
        let fresh = inputs.readings.map(|reading| motor::fresh(reading, inputs.now));
        let mut positions = motors.each_ref().map(|motor| motor.position());
        for (position, reading) in positions.iter_mut().zip(fresh) {
            *position = reading.map_or(*position, |reading| reading.position);
        }
        for led in self.led.iter_mut().flatten() {
            if let Led::Due(together) = led {
                let members = together.course.members();
                if members.iter().zip(&fresh).all(|(member, reading)| !member || reading.is_some()) {
                    let speeds = motors.each_ref().map(|motor| motor.velocity());
                    let group = Group::new(*together, positions, speeds, period);
                    *led = Led::Moving(group, SettleDetector::new(period));
                }
            }
            let Led::Moving(group, _) = led else { continue };
            for (motor, reference) in motors.iter_mut().zip(group.step(&positions)) {
                if let Some(reference) = reference {
                    motor.set(Setpoint::Together(reference));
                }
            }
        }
    }

    /// Reviews the reports of a tick: members settle together, and a fault of one member ends the group for all.
    pub(super) fn review(&mut self, reports: &mut [Report; N], motors: &mut [Motor; N]) {
        for slot in &mut self.led {
            let Some(Led::Moving(group, settle_detector)) = slot else { continue };
            let members = *group.members();
            let within_tolerance =
                group.is_within_tolerance(&reports.each_ref().map(|report| report.position));
            let settled = settle_detector.step(within_tolerance, fastest(&members, reports));
            for (index, (report, motor)) in reports.iter_mut().zip(motors.iter_mut()).enumerate() {
                if members.get(index) != Some(&true) {
                    continue;
                }
                report.settled = settled;
                if report.faults.any() {
                    group.remove(index);
                    // Not disabled, which would end a fault of the encoder before anyone has seen it.
                    motor.set(Setpoint::Velocity(CountsPerSecond::ZERO));
                }
            }
            if *group.members() != members && ends(group, group.halt(), motors) {
                *slot = None;
            }
        }
    }
}

/// The velocity of the member that moves fastest.
fn fastest<const N: usize>(members: &[bool; N], reports: &[Report; N]) -> CountsPerSecond {
    let velocities =
        reports.iter().zip(members).filter(|(_, member)| **member).map(|(report, _)| report.velocity);
    velocities.max_by_key(|velocity| velocity.to_bits().unsigned_abs()).unwrap_or(CountsPerSecond::ZERO)
}

/// Halts who is left of a group; true if that is the end of it.
fn ends<const N: usize>(group: &mut Group<N>, halt: Halt, motors: &mut [Motor; N]) -> bool {
    match halt {
        Halt::Stop => group.stop(),
        Halt::Coast => of(group.members(), motors).for_each(|motor| motor.set(Setpoint::Disabled)),
    }
    halt == Halt::Coast || *group.members() == [false; N]
}

/// The motors that are members.
fn of<'a, const N: usize>(
    members: &'a [bool; N],
    motors: &'a mut [Motor; N],
) -> impl Iterator<Item = &'a mut Motor> {
    motors.iter_mut().zip(members).filter_map(|(motor, member)| member.then_some(motor))
}
