//! Motors that move in step: two wheels of a drive base, the two or four screws of a gantry.
//!
//! A group goes along a [`Course`]: one progress, with limits of speed and acceleration, and from it a
//! [`Reference`] for each member, which is where that member should be now and how fast. Whatever disturbs a
//! member, its own regulator brings it back to its reference. A member that cannot follow holds up the
//! progress, and so all others: the further it lags the slower it gets, down to nothing.
//!
//! ```
//! use motor_hub::group::{Course, Group, Together};
//! use motor_hub::units::{Acceleration, CountsPerSecond, Period};
//!
//! // Motor 0 moves 1000 counts on, motor 2 moves 500 counts back.
//! let course = Course::by(&[(0, 1_000), (2, -500)])?;
//! let usual = Together::new(course, CountsPerSecond::new(2_000), Acceleration::new(4_000)?);
//! let together = Together { tolerance: 0, ..usual };
//! let mut positions = [70, 0, -30];
//! let mut group = Group::new(together, positions, [CountsPerSecond::ZERO; 3], Period::DEFAULT);
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
mod path;

pub use drive_base::DriveBase;

use crate::regulator::Reference;
use crate::units::{Acceleration, CountsPerSecond, Period, RangeError};
use path::{Path, Way};

/// Motors that may be members: those with a number below this.
pub const MOTORS: usize = 8;

/// Something for each member, by the motor's number.
pub type ByMotor<T> = [Option<T>; MOTORS];

/// Where a group goes. What is given by motor says which motors are its members.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Course {
    /// By so many counts each, from where each should be now.
    By(ByMotor<i32>),
    /// To these positions, the short way round.
    To(ByMotor<i32>),
    /// On at these speeds until something else is said; all of them 0 stops the group.
    On(ByMotor<CountsPerSecond>),
}

impl Course {
    /// Each of these motors by so many counts.
    ///
    /// # Errors
    /// [`RangeError::Motor`] of a number that is not below [`MOTORS`].
    pub fn by(members: &[(usize, i32)]) -> Result<Self, RangeError> {
        by_motor(members).map(Self::By)
    }

    /// Each of these motors to a position in counts.
    ///
    /// # Errors
    /// [`RangeError::Motor`] of a number that is not below [`MOTORS`].
    pub fn to(members: &[(usize, i32)]) -> Result<Self, RangeError> {
        by_motor(members).map(Self::To)
    }

    /// Each of these motors on at a speed.
    ///
    /// # Errors
    /// [`RangeError::Motor`] of a number that is not below [`MOTORS`].
    pub fn on(members: &[(usize, CountsPerSecond)]) -> Result<Self, RangeError> {
        by_motor(members).map(Self::On)
    }

    /// By motor: is it a member?
    pub fn members(&self) -> [bool; MOTORS] {
        match self {
            Self::By(counts) | Self::To(counts) => counts.map(|each| each.is_some()),
            Self::On(speeds) => speeds.map(|each| each.is_some()),
        }
    }
}

fn by_motor<T: Copy>(members: &[(usize, T)]) -> Result<ByMotor<T>, RangeError> {
    let mut all = [None; MOTORS];
    for (motor, value) in members {
        *all.get_mut(*motor).ok_or(RangeError::Motor)? = Some(*value);
    }
    Ok(all)
}

/// What becomes of the others when a member is at fault or is told something else by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Halt {
    /// They brake in step, with the group's acceleration, and hold where they come to rest.
    #[default]
    Stop,
    /// They are disabled.
    Coast,
}

/// What a group is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Together {
    /// Where to go, and who.
    pub course: Course,
    /// Magnitude of the speed of the member that moves most; a course that goes on has speeds of its own.
    pub speed: CountsPerSecond,
    /// Largest acceleration of any member.
    pub acceleration: Acceleration,
    /// Counts by which a member lags when all others wait for it; from half of that on they slow down.
    pub lag: u16,
    /// Largest distance of each member to its end, in counts, at which the group can settle.
    pub tolerance: u16,
    /// What ends it.
    pub halt: Halt,
}

impl Together {
    /// With the [usual lag](usual_lag), a tolerance of [`TOLERANCE`] counts, and a stop when a member is lost. Of a
    /// course that goes on, `speed` is what the lag follows from.
    pub const fn new(course: Course, speed: CountsPerSecond, acceleration: Acceleration) -> Self {
        let (lag, halt) = (usual_lag(speed), Halt::Stop);
        Self { course, speed, acceleration, lag, tolerance: TOLERANCE, halt }
    }
}

/// Default tolerance of a group in counts; that of REV's host software.
pub const TOLERANCE: u16 = 5;
/// A lag is usually the way of so many milliseconds,
const LAG_MS: u32 = 100;
/// and so many counts at least.
const LEAST_LAG: u32 = 24;

/// The lag for a group whose members move at this speed at most: the way of 0.1 s, and at least 24 counts.
///
/// A group slows down from half of its lag on, which should not be by what a sound member lags anyway. By its model
/// a wheel of a robot of 6 kg lags up to 12 counts at periods of 1 to 100 ms, by PID with guessed coefficients up to
/// 52 ms of its way at periods up to 50 ms. More lag than needed would only let members run apart.
pub const fn usual_lag(speed: CountsPerSecond) -> u16 {
    // In steps of 1/256.
    let counts = (speed.to_bits().unsigned_abs() as u64 * LAG_MS as u64) / 256_000;
    if counts < LEAST_LAG as u64 {
        LEAST_LAG as u16
    } else if counts > u16::MAX as u64 {
        u16::MAX
    } else {
        counts as u16
    }
}

/// A group of motors of a hub with N of them.
#[derive(Clone, Debug)]
pub struct Group<const N: usize> {
    members: [bool; N],
    path: Path<N>,
    acceleration: Acceleration,
    lag: u16,
    tolerance: u16,
    halt: Halt,
    /// A tick in seconds.
    tick: f32,
}

impl<const N: usize> Group<N> {
    /// From these positions and speeds. Members that the hub does not have are left out.
    pub fn new(
        together: Together,
        positions: [i32; N],
        mut speeds: [CountsPerSecond; N],
        period: Period,
    ) -> Self {
        let Together { course, acceleration, lag, tolerance, halt, .. } = together;
        let members = first(course.members(), false);
        for (speed, member) in speeds.iter_mut().zip(members) {
            if !member {
                *speed = CountsPerSecond::ZERO;
            }
        }
        let path = Path::new(positions, speeds.map(CountsPerSecond::to_f32), acceleration);
        let tick = period.to_seconds();
        let mut group = Self { members, path, acceleration, lag, tolerance, halt, tick };
        group.redirect(together);
        group
    }

    /// Takes another course from the present references and their speeds, so that nothing steps. Members stay
    /// who they are.
    pub fn redirect(&mut self, together: Together) {
        let Together { course, speed, acceleration, lag, tolerance, halt } = together;
        (self.acceleration, self.lag, self.tolerance, self.halt) = (acceleration, lag, tolerance, halt);
        let here = self.path.references().map(|reference| (reference >> 16) as i32);
        let to = |counts: ByMotor<i32>, target: fn(i32, i32) -> i32| {
            let mut targets = here;
            for (place, counts) in targets.iter_mut().zip(counts) {
                *place = counts.map_or(*place, |counts| target(*place, counts));
            }
            Way::To(targets, speed.to_f32())
        };
        let way = match course {
            Course::By(counts) => to(counts, i32::wrapping_add),
            Course::To(counts) => to(counts, |_, counts| counts),
            Course::On(speeds) => {
                Way::On(first(speeds.map(Option::unwrap_or_default), CountsPerSecond::ZERO))
            }
        };
        self.path.turn(way, acceleration, self.tick);
    }

    /// Brakes in step, and holds where that ends.
    pub fn stop(&mut self) {
        self.path.turn(Way::On([CountsPerSecond::ZERO; N]), self.acceleration, self.tick);
    }

    /// By motor: is it a member?
    pub const fn members(&self) -> &[bool; N] {
        &self.members
    }

    /// Goes on without a member.
    pub fn remove(&mut self, motor: usize) {
        if let Some(member) = self.members.get_mut(motor) {
            *member = false;
        }
    }

    /// What becomes of it when a member is lost.
    pub const fn halt(&self) -> Halt {
        self.halt
    }

    /// True if the course is at its end and every member is within the tolerance of its own end.
    pub fn is_within_tolerance(&self, positions: &[i32; N]) -> bool {
        let near = |error: i64| error.unsigned_abs() <= u64::from(self.tolerance);
        self.path.is_at_end() && self.errors(positions).into_iter().all(near)
    }

    /// How far each member is behind its reference, in whole counts.
    fn errors(&self, positions: &[i32; N]) -> [i64; N] {
        let mut errors = [0; N];
        let places = self.path.references().into_iter().zip(positions).zip(self.members);
        for (error, ((reference, position), member)) in errors.iter_mut().zip(places) {
            if member {
                *error = i64::from(((reference >> 16) as i32).wrapping_sub(*position));
            }
        }
        errors
    }

    /// One tick, at which the motors are at these positions: where each member should be.
    pub fn step(&mut self, positions: &[i32; N]) -> [Option<Reference>; N] {
        let references = self.path.references();
        let now = self.path.speeds();
        let pace = self.pace(positions, &now);
        self.path.step(pace * self.tick);
        let next = self.path.speeds();
        let mut all = [None; N];
        let members = references.into_iter().zip(now).zip(next).zip(self.members);
        for (slot, (((reference, now), next), member)) in all.iter_mut().zip(members) {
            if member {
                *slot = Some(path::reference(reference, pace * now, pace * next));
            }
        }
        all
    }

    /// How fast time passes for the group: 1, or less if a member lags.
    fn pace(&self, positions: &[i32; N], speeds: &[f32; N]) -> f32 {
        let lags = self.errors(positions).into_iter().zip(speeds).map(|(error, speed)| {
            // Who is ahead need not be waited for; who should stand should stand.
            if *speed > 0.0 {
                error
            } else if *speed < 0.0 {
                -error
            } else {
                error.abs()
            }
        });
        let lag = lags.max().unwrap_or_default() as f32;
        let most = f32::from(self.lag.max(1));
        let left = (most - lag).max(0.0);
        (2.0 * left / most).min(1.0)
    }
}

/// As many as a hub has motors, which may be more.
fn first<T: Copy, const N: usize>(all: [T; MOTORS], none: T) -> [T; N] {
    let mut some = [none; N];
    for (slot, value) in some.iter_mut().zip(all) {
        *slot = value;
    }
    some
}
