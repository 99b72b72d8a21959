//! The *extension*: the hub's own interface, with functions that REV's protocol lacks. The functions are about
//! settings, reports, groups, drive bases, constant current, identification, the record of faults, stored settings, and
//! new firmware.
//!
//! A host finds the interface by its name, [`INTERFACE`]. Hosts that do not query this name are not affected. Settings
//! last until the next start of the hub, unless they are stored. `docs/reference/extension.md` describes each function
//! with its fields and refusals.
//!
//! ```
//! use motor_hub::extension::{HubFunction, Request};
//! use motor_hub::protocol::payload::Text;
//!
//! let request = Request::from(HubFunction::Chunk { offset: 96, bytes: Text::from_slice(&[7, 8]).unwrap() });
//! assert_eq!((request.id(), &*request.payload()), (0x4D16, &[96, 0, 0, 0, 2, 7, 8][..]));
//! ```

pub mod base;
pub mod group;
mod identification;
pub mod record;
pub mod report;
pub mod settings;
pub mod state;

use crate::group::{BaseSettings, GroupCommand};
use crate::protocol::answers::Functions;
use crate::protocol::motor::ToMotor;
use crate::protocol::payload::{Field, Fields, Payload, Text};
use crate::protocol::pins::ToPin;
use crate::protocol::request_table::requests;
use crate::protocol::requests::{MOTOR_FUNCTIONS, MOTOR_INTERFACE, Standard, ToHub};
use crate::protocol::{HOST, Nack, Packet};
use group::GroupCourse;
use settings::{Group, Values};

/// The name of the interface.
pub const INTERFACE: &[u8] = b"MOTOR_HUB";

/// The packet type of function 0, on hubs of this project.
pub const FIRST_FUNCTION: u16 = 0x4D00;

/// The packet types of the interface, on hubs of this project.
pub const FUNCTIONS: Functions = Functions { first: FIRST_FUNCTION, count: 37 };

requests! {
    /// A function for one motor. The first field of the request is the motor's number. Requests for the settings of a
    /// motor are [`Request::Set`] and [`Request::Get`].
    pub enum MotorFunction from FIRST_FUNCTION => {
        /// Starts an identification. The motor stays within the travel limit, in counts in either direction. The answer
        /// is a u32: the largest number of counts that the motor will turn in either direction.
        4 Identify { travel_limit: u32 },
        /// The answer is an [`Identification`](crate::regulator::identify::Identification).
        5 Identification,
        /// Moves a group. The motor must be one of its members.
        6 Move { wanted: GroupCommand<GroupCourse> },
        /// The answer is a [`GroupState`](group::GroupState).
        7 Group,
        /// The answer is a [`Condition`](report::Condition).
        10 Condition,
        /// Regulates the enabled motor to a constant current, up to a speed limit. The regulation ends when a host sets
        /// a target or a mode, enables or disables the motor, resets its encoder, starts an identification, or moves
        /// the motor in a group. The regulation also ends with a fail-safe.
        30 Current { current_ma: i32, speed_limit_cps: u16 },
    }
}

requests! {
    /// A function for the whole hub.
    pub enum HubFunction from FIRST_FUNCTION => {
        /// The answer is a [`BusReport`](report::BusReport).
        13 Bus,
        /// Stores the settings and the address in force.
        14 Save,
        /// Puts the stored settings in force. The address does not change.
        15 Load,
        /// Deletes the stored settings and the stored address, and puts the firmware's settings in force. The address
        /// in force stays until the next start of the hub.
        16 Reset,
        /// The answer is a [`StoreReport`](state::StoreReport).
        17 Stored,
        /// The answer is [`Entries`](record::Entries) without the newest `from` entries. If `clear` is true, all
        /// entries are then deleted.
        18 Entries { from: u8, clear: bool },
        /// The answer is [`Ticks`](record::Ticks) of the entry with this number, without the oldest `from` ticks.
        ///
        /// The number 19 is not used, because firmware 0.1.0 answers function 19 with control values instead of
        /// voltages.
        33 Ticks { number: u16, from: u8 },
        /// The answer is a [`HubReport`](report::HubReport).
        20 Report,
        /// Announces new firmware with its length in bytes, its CRC-32 (IEEE 802.3) and its version.
        21 BeginUpdate { length: u32, crc: u32, version: Text },
        /// Sends the bytes of new firmware that begin at this offset. Each chunk has 96 bytes. The last chunk may have
        /// fewer bytes.
        22 Chunk { offset: u32, bytes: Text },
        /// Ends the transfer; the hub checks and arms the new firmware.
        23 FinishUpdate,
        /// Restarts the hub with the armed firmware.
        24 Restart,
        /// Cancels the update. The next restart then starts the present firmware, also if new firmware was armed.
        25 AbandonUpdate,
        /// The answer is an [`UpdateReport`](state::UpdateReport).
        26 Update,
        /// Sends a public key (Ed25519), and its signature of the firmware's SHA-512 hash.
        27 Sign { key: [u8; 32], signature: [u8; 64] },
        /// The answer is an [`Equipment`](crate::devices::Equipment).
        32 Equipment,
        /// The answer is a [`ChainReport`](crate::chain::ChainReport). A board without a chain line refuses the
        /// request.
        31 Chain,
        /// Configures the drive base, which then starts at the origin.
        34 SetBase { base: BaseSettings },
        /// The answer is an [`OdometryReport`](base::OdometryReport).
        35 Odometry,
        /// The answer is the [`BaseSettings`] in force. The request is refused if no drive base is configured.
        36 Base,
    }
}

/// A request of REV's protocol or of the extension, with all its parameters in range.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// A standard command of REV's protocol.
    Standard(Standard),
    /// A function of REV's protocol for the whole hub.
    ToHub(ToHub),
    /// A function of REV's protocol for the motor with this number.
    ToMotor(u8, ToMotor),
    /// A function of REV's protocol for a pin or an output.
    ToPin(ToPin),
    /// Sets one group of settings of the motor with this number.
    Set(u8, Values),
    /// Asks for one group of settings of the motor with this number. The answer has the fields of the group.
    Get(u8, Group),
    /// A function of the extension for the motor with this number.
    Motor(u8, MotorFunction),
    /// A function of the extension for the whole hub.
    Hub(HubFunction),
}

impl Request {
    /// Reads the request of a packet, for a hub with `motors` motors.
    ///
    /// Some groups of settings have requests of REV's protocol. Such a request is read as [`ToMotor`](Self::ToMotor),
    /// not as [`Set`](Self::Set) or [`Get`](Self::Get).
    ///
    /// # Errors
    /// Returns the refusal with which the hub must answer.
    pub fn read(packet: &Packet, motors: usize) -> Result<Self, Nack> {
        let (id, fields) = (packet.id, &mut Fields::new(&packet.payload));
        if Standard::has(id) {
            Standard::read(id, fields).map(Self::Standard)
        } else if ToHub::has(id) {
            ToHub::read(id, fields).map(Self::ToHub)
        } else if ToPin::has(id) {
            ToPin::read(id, fields).map(Self::ToPin)
        } else if HubFunction::has(id) {
            HubFunction::read(id, fields).map(Self::Hub)
        } else if ToMotor::has(id) {
            Ok(Self::ToMotor(fields.motor(motors)?, ToMotor::read(id, fields)?))
        } else if MotorFunction::has(id) {
            Ok(Self::Motor(fields.motor(motors)?, MotorFunction::read(id, fields)?))
        } else if let Some(group) = Group::ALL.into_iter().find(|group| group.set_id() == id) {
            Ok(Self::Set(fields.motor(motors)?, Values::read(group, fields)?))
        } else if let Some(group) = Group::ALL.into_iter().find(|group| group.get_id() == id) {
            Ok(Self::Get(fields.motor(motors)?, group))
        } else {
            // The tables lack PWM outputs (functions 25 to 30), which no hub of this project has, I2C transactions (54,
            // 55), whose flags are not published, and bulk output (56).
            Err(if MOTOR_FUNCTIONS.number(id).is_some() { Nack::UNSUPPORTED } else { Nack::UNKNOWN })
        }
    }

    /// Returns the name of the interface that the request belongs to. `None` for a standard command.
    pub fn interface(&self) -> Option<&'static [u8]> {
        match self {
            Self::Standard(_) => None,
            _ if FUNCTIONS.number(self.id()).is_some() => Some(INTERFACE),
            _ => Some(MOTOR_INTERFACE),
        }
    }

    /// Returns the number of the function within its interface, or the packet type of a standard command.
    pub fn number(&self) -> u16 {
        let id = self.id();
        FUNCTIONS.number(id).or(MOTOR_FUNCTIONS.number(id)).unwrap_or(id)
    }

    /// Returns the packet type, on hubs of this project.
    pub const fn id(&self) -> u16 {
        match self {
            Self::Standard(request) => request.id(),
            Self::ToHub(request) => request.id(),
            Self::ToMotor(_, request) => request.id(),
            Self::ToPin(request) => request.id(),
            Self::Set(_, values) => values.group().set_id(),
            Self::Get(_, group) => group.get_id(),
            Self::Motor(_, function) => function.id(),
            Self::Hub(function) => function.id(),
        }
    }

    /// Returns the fields as bytes.
    pub fn payload(&self) -> Payload {
        let mut payload = Payload::new();
        match self {
            Self::ToMotor(motor, _) | Self::Motor(motor, _) => motor.write(&mut payload),
            Self::Set(motor, values) => values.group().write_name(*motor, &mut payload),
            Self::Get(motor, group) => group.write_name(*motor, &mut payload),
            Self::Standard(_) | Self::ToHub(_) | Self::ToPin(_) | Self::Hub(_) => (),
        }
        match self {
            Self::Standard(request) => request.write(&mut payload),
            Self::ToHub(request) => request.write(&mut payload),
            Self::ToMotor(_, request) => request.write(&mut payload),
            Self::ToPin(request) => request.write(&mut payload),
            Self::Set(_, values) => values.write(&mut payload),
            Self::Get(..) => (),
            Self::Motor(_, function) => function.write(&mut payload),
            Self::Hub(function) => function.write(&mut payload),
        }
        payload
    }

    /// Builds a host's packet for this request. `id` is the packet type that the hub has reported for the function.
    /// Hubs of this project report [`id`](Self::id).
    pub fn packet(&self, destination: u8, number: u8, id: u16) -> Packet {
        Packet { destination, source: HOST, number, reference: 0, id, payload: self.payload() }
    }
}

/// Converts the enums of requests to [`Request`]. A request to a motor also needs the motor's number.
macro_rules! from_tables {
    (hub { $($request:ident($table:ident)),+ } motor { $($of_motor:ident($of_motor_table:ident)),+ }) => {
        $(impl From<$table> for Request {
            fn from(request: $table) -> Self {
                Self::$request(request)
            }
        })+

        $(impl $of_motor_table {
            /// Returns the request to the motor with this number, 0 to 3.
            pub const fn to(self, motor: u8) -> Request {
                Request::$of_motor(motor, self)
            }
        })+
    };
}

from_tables! {
    hub { Standard(Standard), ToHub(ToHub), ToPin(ToPin), Hub(HubFunction) }
    motor { ToMotor(ToMotor), Motor(MotorFunction) }
}
