//! Motors that move synchronously: the two wheels of a drive base, or the two or four screws of a gantry.
//!
//! * A *group* is a set of motors, its *members*, that follow a [`Course`] together.
//! * The *progress* of a group says how far along its course the group is. The speed and the acceleration of the
//!   progress are limited.
//! * A [`Reference`] is the position and the speed that a member should have now. Each tick the progress gives a
//!   reference for each member, and the member's own regulator follows the reference.
//! * The *lag* of a member is its distance behind its reference. For a member that should stand still, the lag is the
//!   distance to its reference in either direction. If the largest lag exceeds half of the permitted lag, the progress
//!   slows down, and so do all members. The larger the lag, the slower the progress. At the full permitted lag the
//!   group waits. The acceleration limit does not apply to this slowing.
//! * A member that is away from its reference returns to it. The speed of the member differs from the speed of the
//!   reference by the speed of the course at most.
//!
//! ```
//! use motor_hub::group::{Course, Group, GroupCommand};
//! use motor_hub::units::{Acceleration, CountsPerSecond, Period};
//!
//! // Motor 0 moves 1000 counts forward, motor 2 moves 500 counts back.
//! let course = Course::distances(&[(0, 1_000), (2, -500)])?;
//! let usual = GroupCommand::new(course, CountsPerSecond::new(2_000), Acceleration::new(4_000)?);
//! let command = GroupCommand { tolerance: 0, ..usual };
//! let mut positions = [70, 0, -30];
//! let mut group = Group::new(command, positions, [CountsPerSecond::ZERO; 3], Period::DEFAULT);
//! while !group.is_within_tolerance(&positions) {
//!     for (motor, reference) in group.step(&positions).into_iter().enumerate() {
//!         // Perfect motors.
//!         positions[motor] = reference.map_or(0, |reference| reference.position);
//!     }
//! }
//! assert_eq!(positions, [1_070, 0, -530]);
//! # Ok::<(), motor_hub::units::RangeError>(())
//! ```

mod drive_base;
mod odometry;
mod trajectory;

pub use drive_base::{BaseSettings, DriveBase};
pub use odometry::{GyroState, Odometry, Pose};

use crate::regulator::Reference;
use crate::units::{Acceleration, CountsPerSecond, Period, RangeError};
use trajectory::Trajectory;

/// Number of motors that may be members of groups: the motors 0 to 7.
pub const MOTORS: usize = 8;

/// Distances, target positions or speeds of the members of a group. The index of a value is the number of its motor.
/// The motors that have a value are the members.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Course {
    /// Each member moves by a distance in counts from its present reference. In a new group the member's position is
    /// the reference.
    Distance([Option<i32>; MOTORS]),
    /// Each member moves to a position in counts. Positions wrap, and members take the shorter direction.
    Position([Option<i32>; MOTORS]),
    /// Each member moves at a speed until the next command. Speeds of 0 stop the group.
    Velocity([Option<CountsPerSecond>; MOTORS]),
}

impl Course {
    /// Creates a course that moves each of these motors by a distance in counts.
    ///
    /// # Errors
    /// [`RangeError::Motor`] if a motor's number is not below [`MOTORS`].
    pub fn distances(members: &[(usize, i32)]) -> Result<Self, RangeError> {
        by_motor(members).map(Self::Distance)
    }

    /// Creates a course that moves each of these motors to a position in counts.
    ///
    /// # Errors
    /// [`RangeError::Motor`] if a motor's number is not below [`MOTORS`].
    pub fn positions(members: &[(usize, i32)]) -> Result<Self, RangeError> {
        by_motor(members).map(Self::Position)
    }

    /// Creates a course that moves each of these motors at a speed.
    ///
    /// # Errors
    /// [`RangeError::Motor`] if a motor's number is not below [`MOTORS`].
    pub fn velocities(members: &[(usize, CountsPerSecond)]) -> Result<Self, RangeError> {
        by_motor(members).map(Self::Velocity)
    }

    /// Returns for each motor whether it is a member.
    pub fn members(&self) -> [bool; MOTORS] {
        match self {
            Self::Distance(counts) | Self::Position(counts) => counts.map(|each| each.is_some()),
            Self::Velocity(speeds) => speeds.map(|each| each.is_some()),
        }
    }
}

/// Puts each value at the index of its motor.
fn by_motor<T: Copy>(members: &[(usize, T)]) -> Result<[Option<T>; MOTORS], RangeError> {
    let mut all = [None; MOTORS];
    for (motor, value) in members {
        *all.get_mut(*motor).ok_or(RangeError::Motor)? = Some(*value);
    }
    Ok(all)
}

/// How the other members of a group halt when a member is *lost*. A member is lost when it has a fault, gets its own
/// set-point, or joins another group.
///
/// With either setting, a member that is disabled or enters fail-safe disables all other members.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Halt {
    /// The other members brake together, limited by the group's acceleration. The members then hold the positions where
    /// they stopped.
    #[default]
    Stop,
    /// The other members are disabled.
    Coast,
}

/// A command to a group. `C` is the type of the course. The hub uses [`Course`], whose positions are the motors'
/// counts. Hosts use [`GroupCourse`](crate::extension::group::GroupCourse), whose positions count from where the host
/// last reset the encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GroupCommand<C = Course> {
    /// Members, and where they move.
    pub course: C,
    /// Speed of the member that moves farthest. The sign of the speed has no effect. Not used for [`Course::Velocity`].
    pub speed: CountsPerSecond,
    /// Largest acceleration of any member's reference while no lag slows the group down.
    pub acceleration: Acceleration,
    /// Permitted lag in counts. The group slows down if a member lags by more than half of the permitted lag. The group
    /// waits if a member lags by the permitted lag.
    pub lag: u16,
    /// Tolerance in counts. The group can settle only while each member is within this distance of its end position.
    pub tolerance: u16,
    /// How the other members halt when a member is lost.
    pub halt: Halt,
}

impl<C> GroupCommand<C> {
    /// Creates a command with the [usual lag](default_lag) for `speed`, a tolerance of [`DEFAULT_TOLERANCE`] counts,
    /// and [`Halt::Stop`].
    pub const fn new(course: C, speed: CountsPerSecond, acceleration: Acceleration) -> Self {
        let (lag, halt) = (default_lag(speed), Halt::Stop);
        Self { course, speed, acceleration, lag, tolerance: DEFAULT_TOLERANCE, halt }
    }
}

/// Default tolerance of a group in counts. REV's host software has the same default for a motor.
pub const DEFAULT_TOLERANCE: u16 = 5;
/// Time in ms in which a member at full speed covers the usual lag.
const LAG_MS: u32 = 100;
/// Smallest usual lag in counts, for slow groups: twice the 12 counts by which a healthy member lags, see
/// [`default_lag`].
const MIN_LAG_COUNTS: u32 = 24;

/// Returns the default lag for members with this maximum speed: the distance of 0.1 s, and at least 24 counts.
///
/// A group slows down if a member lags by more than half of the permitted lag. Half of the permitted lag should
/// therefore be at least the lag of a healthy member. For a wheel of a simulated 6 kg robot the largest lags are:
///
/// * 12 counts with the model-based regulator, at control periods of 1 to 100 ms.
/// * More with PID, by its coefficients. The group then slows down.
///
/// A larger permitted lag would let members move farther apart.
pub const fn default_lag(speed: CountsPerSecond) -> u16 {
    // The bits of a speed are steps of 1/256 counts/s.
    let counts = (speed.to_bits().unsigned_abs() as u64 * LAG_MS as u64) / 256_000;
    if counts < MIN_LAG_COUNTS as u64 {
        MIN_LAG_COUNTS as u16
    } else if counts > u16::MAX as u64 {
        u16::MAX
    } else {
        counts as u16
    }
}

/// A moving group in a hub with N motors.
#[derive(Clone, Debug)]
pub struct Group<const N: usize> {
    /// For each motor, true if it is a member.
    members: [bool; N],
    trajectory: Trajectory<N>,
    lag: u16,
    tolerance: u16,
    halt: Halt,
    /// Control period in seconds.
    tick_s: f32,
}

impl<const N: usize> Group<N> {
    /// Creates a group that starts at these positions and speeds. Members that the hub does not have are ignored.
    pub fn new(
        command: GroupCommand,
        positions: [i32; N],
        mut speeds: [CountsPerSecond; N],
        period: Period,
    ) -> Self {
        let GroupCommand { course, acceleration, lag, tolerance, halt, .. } = command;
        let members = for_motors(course.members(), false);
        for (speed, member) in speeds.iter_mut().zip(members) {
            if !member {
                *speed = CountsPerSecond::ZERO;
            }
        }
        let trajectory = Trajectory::new(positions, speeds.map(CountsPerSecond::to_f32), acceleration);
        let tick_s = period.to_seconds();
        let mut group = Self { members, trajectory, lag, tolerance, halt, tick_s };
        group.redirect(command);
        group
    }

    /// Changes the course. The references continue from their present positions and speeds without a step. A repeated
    /// course to positions does not start again, because hosts repeat commands. The members of the group stay as they
    /// are: a motor that is only in the course gets no reference, and a member that is not in the course stops.
    pub fn redirect(&mut self, command: GroupCommand) {
        let GroupCommand { course, speed, acceleration, lag, tolerance, halt } = command;
        (self.lag, self.tolerance, self.halt) = (lag, tolerance, halt);
        let same_acceleration = self.trajectory.set_acceleration(acceleration);
        let (values, are_distances) = match course {
            Course::Distance(distances) => (distances, true),
            Course::Position(positions) => (positions, false),
            Course::Velocity(speeds) => {
                let speeds = for_motors(speeds.map(Option::unwrap_or_default), CountsPerSecond::ZERO);
                return self.trajectory.turn_at(speeds);
            }
        };
        let mut targets = self.trajectory.references().map(|reference| (reference >> 16) as i32);
        for (target, value) in targets.iter_mut().zip(values) {
            if let Some(value) = value {
                *target = if are_distances { target.wrapping_add(value) } else { value };
            }
        }
        if !same_acceleration || !self.trajectory.leads_to(&targets, speed.to_f32()) {
            self.trajectory.move_to(targets, speed.to_f32(), self.tick_s);
        }
    }

    /// Brakes all members together. The members hold the positions where they stop.
    pub fn stop(&mut self) {
        self.trajectory.turn_at([CountsPerSecond::ZERO; N]);
    }

    /// Returns for each motor whether it is a member.
    pub const fn members(&self) -> &[bool; N] {
        &self.members
    }

    /// Removes a member. The course of the other members does not change.
    pub fn remove(&mut self, motor: usize) {
        if let Some(member) = self.members.get_mut(motor) {
            *member = false;
            self.trajectory.remove(motor);
        }
    }

    /// Returns how the other members halt when a member is lost.
    pub const fn halt(&self) -> Halt {
        self.halt
    }

    /// True if the course is at its end, and every member is within the tolerance of its end position.
    pub fn is_within_tolerance(&self, positions: &[i32; N]) -> bool {
        let near = |error: i64| error.unsigned_abs() <= u64::from(self.tolerance);
        self.trajectory.is_at_end() && self.errors(positions).into_iter().all(near)
    }

    /// Returns the position error of each motor, reference minus position, in whole counts; 0 for motors that are not
    /// members.
    fn errors(&self, positions: &[i32; N]) -> [i64; N] {
        let mut errors = [0; N];
        let pairs = self.trajectory.references().into_iter().zip(positions).zip(self.members);
        for (error, ((reference, position), member)) in errors.iter_mut().zip(pairs) {
            if member {
                *error = i64::from(((reference >> 16) as i32).wrapping_sub(*position));
            }
        }
        errors
    }

    /// Returns the reference of each member for this tick, and advances the trajectory to the next tick. `positions`
    /// are the present positions in counts. `None` for a motor that is not a member.
    pub fn step(&mut self, positions: &[i32; N]) -> [Option<Reference>; N] {
        let references = self.trajectory.references();
        let now = self.trajectory.speeds_cps();
        let time_scale = self.time_scale(positions, &now);
        self.trajectory.step(time_scale * self.tick_s);
        let next = self.trajectory.speeds_cps();
        let speed_limit = self.trajectory.speed_limit();
        let mut all = [None; N];
        let members = references.into_iter().zip(now).zip(next).zip(self.members);
        for (slot, (((position, now), next), member)) in all.iter_mut().zip(members) {
            if member {
                *slot =
                    Some(trajectory::reference(position, time_scale * now, time_scale * next, speed_limit));
            }
        }
        all
    }

    /// Returns the rate at which the trajectory's time passes: 1 up to half of the permitted lag, then falling linearly
    /// to 0 at the permitted lag.
    fn time_scale(&self, positions: &[i32; N], speeds_cps: &[f32; N]) -> f32 {
        let lags = self.errors(positions).into_iter().zip(speeds_cps).map(|(error, speed)| {
            // A member that is ahead of its reference does not lag. For a member that should stand still every error is
            // a lag.
            if *speed > 0.0 {
                error
            } else if *speed < 0.0 {
                -error
            } else {
                error.abs()
            }
        });
        let lag = lags.max().unwrap_or_default() as f32;
        let limit = f32::from(self.lag.max(1));
        let margin = (limit - lag).max(0.0);
        (2.0 * margin / limit).min(1.0)
    }
}

/// Converts values by motor to an array for another number of motors. Motors without a value get `default`, and values
/// beyond the last motor are dropped.
pub(crate) fn for_motors<T: Copy, const FROM: usize, const N: usize>(
    values: [T; FROM],
    default: T,
) -> [T; N] {
    let mut all = [default; N];
    for (slot, value) in all.iter_mut().zip(values) {
        *slot = value;
    }
    all
}
