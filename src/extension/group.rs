//! Requests to groups of motors that move synchronously. A repeated request to a group has no further effect, because
//! hosts repeat a request whose answer is lost.
//!
//! ```
//! use motor_hub::extension::MotorFunction;
//! use motor_hub::extension::group::GroupCourse;
//! use motor_hub::group::{DriveBase, GroupCommand};
//! use motor_hub::units::{Acceleration, CountsPerSecond};
//!
//! // A drive base on motors 0 and 1 turns a quarter to the left.
//! let base = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0; 2] };
//! let [left, right] = base.turn(90.0)?;
//! let course = GroupCourse::Position([Some(left), Some(right), None, None]);
//! let turn = GroupCommand::new(course, CountsPerSecond::new(2_000), Acceleration::new(5_000)?);
//! let request = MotorFunction::Move { wanted: turn }.to(0);
//! assert_eq!((request.id(), request.payload().len()), (0x4D06, 32));
//! # Ok::<(), motor_hub::units::RangeError>(())
//! ```

use crate::group::{GroupCommand, Halt};
use crate::protocol::payload::{ByteIn, Field, Fields, Payload, bits, byte, codes, fields_in_order};
use crate::protocol::{CHANNELS, Nack};
use crate::units::CountsPerSecond;

/// Target positions or speeds of the members of a group. The motors that have a value are the members.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum GroupCourse {
    /// Each member moves to a position in the host's counts.
    Position([Option<i32>; CHANNELS]),
    /// Each member turns at a speed, until the next request to the group or to a member. If all speeds are 0, the group
    /// stops.
    Velocity([Option<CountsPerSecond>; CHANNELS]),
}

/// State of the group that a motor is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum GroupState {
    /// The motor is in no group, or its group waits for the first tick at which all members have a fresh encoder
    /// reading and no latched fault.
    Alone,
    /// The group moves, or its members have not settled yet, or the group has lost a member.
    Moving,
    /// All members have settled at their targets, and the group has lost no member.
    Settled,
}

codes!(Halt { 0 = Stop, 1 = Coast });
codes!(GroupState { 0 = Alone, 1 = Moving, 2 = Settled });

impl Field for GroupCourse {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let of_speeds = bool::read(fields)?;
        let members = bits(ByteIn::<0, 15>::read(fields)?.get());
        let values = <[i32; CHANNELS]>::read(fields)?;
        let mut all = [None; CHANNELS];
        for (slot, (member, value)) in all.iter_mut().zip(members.into_iter().zip(values)) {
            *slot = member.then_some(value);
        }
        Ok(if of_speeds {
            Self::Velocity(all.map(|bits| bits.map(CountsPerSecond::from_bits)))
        } else {
            Self::Position(all)
        })
    }

    fn write(&self, payload: &mut Payload) {
        let (of_speeds, all) = match self {
            Self::Position(counts) => (false, *counts),
            Self::Velocity(speeds) => (true, speeds.map(|speed| speed.map(CountsPerSecond::to_bits))),
        };
        of_speeds.write(payload);
        byte(all.map(|value| value.is_some())).write(payload);
        all.map(Option::unwrap_or_default).write(payload);
    }
}

fields_in_order!(GroupCommand<GroupCourse> { course, speed, acceleration, lag, tolerance, halt });
