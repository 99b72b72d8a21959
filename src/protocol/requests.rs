//! Requests of REV's protocol: a line of a table states the number of a request, its name, and its fields in their order.
//! Reading and writing follow from the tables.
//!
//! A function belongs to an interface. The hub tells a host where the packet types of an interface begin.
//!
//! ```
//! use motor_hub::protocol::requests::{Request, Standard, ToHub};
//!
//! let request = Request::from(ToHub::SetPhoneCharge { on: true });
//! assert_eq!((request.id(), request.number()), (0x102C, 44));
//! assert_eq!(*request.payload(), [1]);
//!
//! // The number of a standard command is its packet type.
//! let status = Request::from(Standard::Status { clear: true });
//! assert_eq!((status.is_standard(), status.id()), (true, 0x7F03));
//! ```

use super::address::{Address, HOST};
use super::answers::Functions;
use super::frame::Packet;
use super::led::{Colour, LedPattern};
use super::motor::ToMotor;
use super::payload::{ByteIn, Field, Fields, Payload, Text, append};
use super::pins::ToPin;
use super::refusal::Nack;
use super::request_table::requests;
use heapless::Vec;

/// The name of the motor interface, to which all of REV's functions belong.
pub const MOTOR_INTERFACE: &[u8] = b"DEKA";

/// The packet type of the motor interface's function 0, on hubs of this project.
pub const FIRST_FUNCTION: u16 = 0x1000;

/// The packet types of the motor interface, on hubs of this project. The count covers all functions that hosts know, also the
/// refused ones (I2C transfers and bulk output): a smaller count would hide coefficients and version.
pub const MOTOR_FUNCTIONS: Functions = Functions { first: FIRST_FUNCTION, count: 58 };

/// The packet type of a discovery, the only request that hubs answer when it is sent to all hubs.
pub const DISCOVERY: u16 = 0x7F0F;

/// The most bytes of an interface's name.
const LONGEST_NAME: usize = 16;

/// The name of an interface. A payload has a zero behind the name.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InterfaceName(Vec<u8, LONGEST_NAME>);

impl InterfaceName {
    /// The name of these bytes, which have no zero; `None` if there are more than 16.
    pub fn new(name: &[u8]) -> Option<Self> {
        Vec::from_slice(name).ok().map(Self)
    }

    /// The name without the zero.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}

impl Field for InterfaceName {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Self::new(fields.zero_terminated()?).ok_or(Nack::UNKNOWN)
    }

    fn write(&self, payload: &mut Payload) {
        append(payload, &self.0);
        0u8.write(payload);
    }
}

requests! {
    /// Commands of every hub, numbered by their packet types.
    pub enum Standard {
        /// The answer is a [`Status`](super::answers::Status).
        0x7F03 Status { clear: bool },
        0x7F04 KeepAlive,
        0x7F05 FailSafe,
        0x7F06 SetAddress { address: Address },
        /// The answer is a [`Functions`].
        0x7F07 QueryInterface { name: InterfaceName },
        0x7F0A SetLedColour { colour: Colour },
        /// The answer is a [`Colour`].
        0x7F0B LedColour,
        0x7F0C SetLedPattern { pattern: LedPattern },
        /// The answer is a [`LedPattern`].
        0x7F0D LedPattern,
        /// Sets the verbosity of a group of messages.
        0x7F0E DebugLevel { group: ByteIn<1, 12>, verbosity: ByteIn<0, 3> },
        /// The answer is true if there is no hub between this hub and the host, else false.
        0x7F0F Discovery,
    }
}

/// A channel of the hub's converter.
pub type AdcChannel = ByteIn<0, 14>;

/// The channel of the battery current, in milliamperes.
pub const BATTERY_CURRENT: AdcChannel = AdcChannel::new(7).expect("in range");

/// The channel of the current of motor 0, in milliamperes; the channels of the other motors follow.
pub const FIRST_CURRENT: AdcChannel = AdcChannel::new(8).expect("in range");

/// The channel of the 5 V rail, in millivolts.
pub const RAIL: AdcChannel = AdcChannel::new(12).expect("in range");

/// The channel of the battery, in millivolts.
pub const BATTERY: AdcChannel = AdcChannel::new(13).expect("in range");

/// The channel of the hub's temperature, in 0.1 degrees Celsius.
pub const TEMPERATURE: AdcChannel = AdcChannel::new(14).expect("in range");

requests! {
    /// Functions of the motor interface that concern the whole hub.
    pub enum ToHub {
        /// The answer is a [`Bulk`](super::answers::Bulk).
        0 Bulk,
        /// The answer is an i16 in millivolts, milliamperes or 0.1 degrees, or in raw counts.
        7 Adc { channel: AdcChannel, raw: bool },
        44 SetPhoneCharge { on: bool },
        /// The answer is a bool.
        45 PhoneCharge,
        46 LogHint { text: Text },
        /// The answer is a [`Text`], in which hosts read numbers: see [`Version`](super::answers::Version).
        48 VersionText,
        /// Sets whether the hub resets its USB bridge when the keep-alive timer runs out.
        49 SetFtdiReset { on: bool },
        /// The answer is a bool.
        50 FtdiReset,
        /// The answer is a [`Version`](super::answers::Version).
        57 Version,
    }
}

/// A request of REV's protocol with all its parameters in range.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// A command of every hub.
    Standard(Standard),
    /// A function that concerns the whole hub.
    Hub(ToHub),
    /// A function of the motor with this number.
    Motor(u8, ToMotor),
    /// A function of a pin or output.
    Pin(ToPin),
}

impl Request {
    /// Reads a packet, for a hub with `motors` motors.
    ///
    /// # Errors
    /// The refusal to answer. A payload that is too short is refused with the number of the first missing parameter.
    pub fn read(packet: &Packet, motors: usize) -> Result<Self, Nack> {
        let fields = &mut Fields::new(&packet.payload);
        let Some(number) = MOTOR_FUNCTIONS.number(packet.id) else {
            if Standard::NUMBERS.contains(&packet.id) {
                return Standard::read(packet.id, fields).map(Self::Standard);
            }
            return Err(Nack::UNKNOWN);
        };
        if ToMotor::NUMBERS.contains(&number) {
            return Ok(Self::Motor(fields.motor(motors)?, ToMotor::read(number, fields)?));
        }
        if ToPin::NUMBERS.contains(&number) {
            return ToPin::read(number, fields).map(Self::Pin);
        }
        // The tables lack transfers by I2C (37 to 42, 52, 54, 55), because hosts poll an accepted transfer without end. They
        // lack bulk output (56) too.
        ToHub::read(number, fields).map(Self::Hub)
    }

    /// True for a command of every hub, which belongs to no interface.
    pub const fn is_standard(&self) -> bool {
        matches!(self, Self::Standard(_))
    }

    /// The number of the function within its interface, or the packet type of a standard command.
    pub const fn number(&self) -> u16 {
        match self {
            Self::Standard(request) => request.number(),
            Self::Hub(request) => request.number(),
            Self::Motor(_, request) => request.number(),
            Self::Pin(request) => request.number(),
        }
    }

    /// The packet type on hubs of this project.
    pub const fn id(&self) -> u16 {
        if self.is_standard() { self.number() } else { FIRST_FUNCTION + self.number() }
    }

    /// The fields as bytes.
    pub fn payload(&self) -> Payload {
        let mut payload = Payload::new();
        match self {
            Self::Standard(request) => request.write(&mut payload),
            Self::Hub(request) => request.write(&mut payload),
            Self::Pin(request) => request.write(&mut payload),
            Self::Motor(motor, request) => {
                motor.write(&mut payload);
                request.write(&mut payload);
            }
        }
        payload
    }

    /// A host's packet of type `id`, which is [`id`](Self::id) unless the hub reports other packet types.
    pub fn packet(&self, destination: u8, number: u8, id: u16) -> Packet {
        Packet { destination, source: HOST, number, reference: 0, id, payload: self.payload() }
    }
}

impl From<Standard> for Request {
    fn from(request: Standard) -> Self {
        Self::Standard(request)
    }
}

impl From<ToHub> for Request {
    fn from(request: ToHub) -> Self {
        Self::Hub(request)
    }
}

impl From<ToPin> for Request {
    fn from(request: ToPin) -> Self {
        Self::Pin(request)
    }
}
