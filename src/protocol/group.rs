//! Motors that move in step, as a host asks for them: functions of this hub's [own interface](super::setup).
//!
//! | function | payload | answer |
//! |---|---|---|
//! | 6 send a group on a course | one of its motors, then the fields of a [`GroupMove`] | ACK |
//! | 7 ask how far it is | one of its motors | the byte of a [`GroupState`] |
//!
//! Function 6 is refused (51) unless every member is enabled. Whatever is said to a member alone afterwards (a
//! target, a mode, a reset of its encoder) takes it out of the group. A course is said so that saying it twice
//! does no harm: a host that hears no answer asks again.
//!
//! | field | |
//! |---|---|
//! | u8 | 0 to positions, 1 on at speeds |
//! | u8 | members: bit 0 is motor 0, up to bit 3 |
//! | i32, four times | by motor: position in counts, or speed in counts/s in steps of 1/256; 0 of who is no member |
//! | i32 | to positions: speed of the member that moves most, in steps of 1/256 counts/s |
//! | u32 | largest acceleration of any member, counts/s², from 1 |
//! | u16 | counts by which a member lags when all others wait for it |
//! | u16 | largest distance of each member to its end, in counts, at which the group can settle |
//! | u8 | when one is at fault, or leaves: 0 the others stop, 1 they are disabled |
//!
//! ```
//! use motor_hub::group::DriveBase;
//! use motor_hub::protocol::group::{GroupCourse, GroupMove, ToGroup};
//! use motor_hub::units::{Acceleration, CountsPerSecond};
//!
//! // A drive base on motors 0 and 1 turns a quarter to the left.
//! let base = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0; 2] };
//! let [left, right] = base.turn(90.0)?;
//! let course = GroupCourse::To([Some(left), Some(right), None, None]);
//! let turn = GroupMove::new(course, CountsPerSecond::new(2_000), Acceleration::new(5_000)?);
//! let request = ToGroup::Move { wanted: turn }.to(0);
//! assert_eq!((request.id(), request.payload().len()), (0x4D06, 32));
//! # Ok::<(), motor_hub::units::RangeError>(())
//! ```

use super::CHANNELS;
use super::fields::{ByteIn, Field, Fields, Payload, codes};
use super::nack::Nack;
use super::table::requests;
use crate::group::{Halt, TOLERANCE, usual_lag};
use crate::units::{Acceleration, CountsPerSecond};

requests! {
    /// A request to the group of one motor, whose number goes before the fields.
    pub enum ToGroup {
        6 Move { wanted: GroupMove },
        /// Answered by a [`GroupState`].
        7 State,
    }
}

/// Where a group goes, by motor; `None` for who is no member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum GroupCourse {
    /// To these counts, as the host counts them.
    To([Option<i32>; CHANNELS]),
    /// On at these speeds; all of them 0 stops the group.
    On([Option<CountsPerSecond>; CHANNELS]),
}

/// A group and its course.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GroupMove {
    /// Where to go, and who.
    pub course: GroupCourse,
    /// Magnitude of the speed of the member that moves most, on the way to positions.
    pub speed: CountsPerSecond,
    /// Largest acceleration of any member.
    pub acceleration: Acceleration,
    /// Counts by which a member lags when all others wait for it.
    pub lag: u16,
    /// Largest distance of each member to its end, in counts, at which the group can settle.
    pub tolerance: u16,
    /// What becomes of the others when one is lost.
    pub halt: Halt,
}

impl GroupMove {
    /// With lag, tolerance and halt as [`Together::new`](crate::group::Together::new) has them.
    pub const fn new(course: GroupCourse, speed: CountsPerSecond, acceleration: Acceleration) -> Self {
        let (lag, halt) = (usual_lag(speed), Halt::Stop);
        Self { course, speed, acceleration, lag, tolerance: TOLERANCE, halt }
    }
}

/// How far a motor's group is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum GroupState {
    /// The motor is in none.
    Alone,
    /// On its way, or on a course without an end.
    Moving,
    /// All members have settled at their ends.
    Settled,
}

codes!(Halt { 0 = Stop, 1 = Coast });
codes!(GroupState { 0 = Alone, 1 = Moving, 2 = Settled });

impl Field for GroupCourse {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let goes_on = bool::read(fields)?;
        let members = ByteIn::<0, 15>::read(fields)?.get();
        let values = <[i32; CHANNELS]>::read(fields)?;
        let mut all = [None; CHANNELS];
        for (motor, (slot, value)) in all.iter_mut().zip(values).enumerate() {
            *slot = (members >> motor & 1 == 1).then_some(value);
        }
        Ok(if goes_on {
            Self::On(all.map(|bits| bits.map(CountsPerSecond::from_bits)))
        } else {
            Self::To(all)
        })
    }

    fn write(&self, payload: &mut Payload) {
        let (goes_on, all) = match self {
            Self::To(counts) => (false, *counts),
            Self::On(speeds) => (true, speeds.map(|speed| speed.map(CountsPerSecond::to_bits))),
        };
        let members = all.iter().enumerate().map(|(motor, value)| u8::from(value.is_some()) << motor);
        goes_on.write(payload);
        members.sum::<u8>().write(payload);
        all.map(Option::unwrap_or_default).write(payload);
    }
}

impl Field for GroupMove {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Ok(Self {
            course: GroupCourse::read(fields)?,
            speed: CountsPerSecond::from_bits(i32::read(fields)?),
            acceleration: fields.checked(|limit: u32| Acceleration::new(limit).ok())?,
            lag: u16::read(fields)?,
            tolerance: u16::read(fields)?,
            halt: Halt::read(fields)?,
        })
    }

    fn write(&self, payload: &mut Payload) {
        self.course.write(payload);
        self.speed.to_bits().write(payload);
        self.acceleration.get().write(payload);
        self.lag.write(payload);
        self.tolerance.write(payload);
        self.halt.write(payload);
    }
}
