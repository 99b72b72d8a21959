//! Every request, as both ends see it: a line of a table says its number, its name, and its fields in
//! their order. Reading and writing follow from the tables.
//!
//! Functions belong to an [`Interface`], and where the types of an interface begin, a hub tells.
//!
//! ```
//! use motor_hub::protocol::requests::{Interface, Request, Standard, ToHub};
//!
//! let request = Request::from(ToHub::SetPhoneCharge { on: true });
//! assert_eq!((request.interface(), request.number()), (Some(Interface::Motors), 44));
//! assert_eq!(*request.payload(), [1]);
//!
//! // Standard commands are numbered by their types.
//! let status = Request::from(Standard::Status { clear: true });
//! assert_eq!((status.interface(), status.id()), (None, 0x7F03));
//! ```

use super::address::{Address, HOST};
use super::answers::Functions;
use super::bus;
use super::fields::{ByteIn, Field, Fields, Payload, Text, append};
use super::frame::Packet;
use super::group::ToGroup;
use super::led::{Colour, LedPattern};
use super::motor::ToMotor;
use super::nack::Nack;
use super::pins::ToPin;
use super::record::ToRecord;
use super::report;
use super::setup::{self, ToSetup};
use super::store::ToStore;
use super::table::requests;
use super::update::ToUpdate;

/// The type of the motor interface's function 0, on hubs of this project.
pub const FIRST_FUNCTION: u16 = 0x1000;

/// Functions of the motor interface: all that hosts know of. Some of them are refused: those of I2C, and bulk output. A
/// smaller number would hide what lies behind them, coefficients and version.
pub const FUNCTION_COUNT: u16 = 58;

/// Type of a discovery, the only request that is answered when it is sent to every hub.
pub const DISCOVERY: u16 = 0x7F0F;

/// Some types with a name to ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Interface {
    /// That of motors and all else on a hub.
    Motors,
    /// This hub's own: see [`setup`].
    Setup,
}

impl Interface {
    /// What to ask for.
    pub const fn name(self) -> &'static [u8] {
        match self {
            Self::Motors => b"DEKA",
            Self::Setup => b"MOTOR_HUB",
        }
    }

    /// Its types, on hubs of this project.
    pub const fn functions(self) -> Functions {
        match self {
            Self::Motors => Functions { first: FIRST_FUNCTION, count: FUNCTION_COUNT },
            Self::Setup => Functions { first: setup::FIRST_FUNCTION, count: setup::FUNCTION_COUNT },
        }
    }
}

/// A name, ended by a zero.
impl Field for Interface {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let name = fields.zero_terminated()?;
        let interface = [Self::Motors, Self::Setup].into_iter().find(|interface| interface.name() == name);
        interface.ok_or(Nack::UNKNOWN)
    }

    fn write(&self, payload: &mut Payload) {
        append(payload, self.name());
        0u8.write(payload);
    }
}

requests! {
    /// What any hub understands, numbered by type.
    pub enum Standard {
        /// Answered by a [`Status`](super::answers::Status).
        0x7F03 Status { clear: bool },
        0x7F04 KeepAlive,
        0x7F05 FailSafe,
        0x7F06 SetAddress { address: Address },
        /// Answered by [`Functions`].
        0x7F07 QueryInterface { interface: Interface },
        0x7F0A SetLedColour { colour: Colour },
        /// Answered by a [`Colour`].
        0x7F0B LedColour,
        0x7F0C SetLedPattern { pattern: LedPattern },
        /// Answered by a [`LedPattern`].
        0x7F0D LedPattern,
        /// Of a group of messages.
        0x7F0E DebugLevel { group: ByteIn<1, 12>, verbosity: ByteIn<0, 3> },
        /// Answered by true if there is no hub between this one and the host, false if there is.
        0x7F0F Discovery,
    }
}

/// A channel of the hub's converter.
pub type AdcChannel = ByteIn<0, 14>;

/// The current out of the battery, in milliamperes.
pub const BATTERY_CURRENT: AdcChannel = AdcChannel::new(7).expect("in range");

/// The 5 V rail, in millivolts.
pub const RAIL: AdcChannel = AdcChannel::new(12).expect("in range");

/// The hub's temperature, in 0.1 degrees Celsius.
pub const TEMPERATURE: AdcChannel = AdcChannel::new(14).expect("in range");

/// The battery's, in millivolts.
pub const BATTERY: AdcChannel = AdcChannel::new(13).expect("in range");

/// That of the current of motor 0, in milliamperes; those of the others follow.
pub const FIRST_CURRENT: AdcChannel = AdcChannel::new(8).expect("in range");

requests! {
    /// Functions of the motor interface that concern the whole hub.
    pub enum ToHub {
        /// Answered by a [`Bulk`](super::answers::Bulk).
        0 Bulk,
        /// In millivolts, milliamperes or 0.1 degrees, or raw; answered by an i16.
        7 Adc { channel: AdcChannel, raw: bool },
        44 SetPhoneCharge { on: bool },
        /// Answered by a bool.
        45 PhoneCharge,
        46 LogHint { text: Text },
        /// Answered by a [`Text`], of which hosts read numbers: see [`Version`](super::answers::Version).
        48 VersionText,
        /// Whether to reset the USB bridge when the keep-alive timer runs out.
        49 SetFtdiReset { on: bool },
        /// Answered by a bool.
        50 FtdiReset,
        /// Answered by a [`Version`](super::answers::Version).
        57 Version,
    }
}

/// A request with all its parameters in range.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// To any hub.
    Standard(Standard),
    /// To a hub with motors.
    Hub(ToHub),
    /// To the motor with this number.
    Motor(u8, ToMotor),
    /// To a pin or output.
    Pin(ToPin),
    /// To the motor with this number, on hubs of this project.
    Setup(u8, ToSetup),
    /// To the group of the motor with this number, on hubs of this project.
    Group(u8, ToGroup),
    /// How the bus of battery and bridges is, on hubs of this project.
    Bus,
    /// What happened, on hubs of this project.
    Record(ToRecord),
    /// To where settings are stored, on hubs of this project.
    Store(ToStore),
    /// What motors and bus do, on hubs of this project.
    Report,
    /// About new firmware, on hubs of this project.
    Update(ToUpdate),
}

impl Request {
    /// Reads a packet, for a hub of so many motors.
    ///
    /// # Errors
    /// What to answer if it is not a request that such a hub can take. A payload that is too short is
    /// refused with the number of the first parameter that is missing.
    pub fn read(packet: &Packet, motors: usize) -> Result<Self, Nack> {
        let mut fields = Fields::new(&packet.payload);
        let fields = &mut fields;
        let motor = |fields: &mut Fields<'_>| {
            fields.checked(|motor: u8| Some(motor).filter(|motor| usize::from(*motor) < motors))
        };
        if let Some(number) = Interface::Motors.functions().number(packet.id) {
            if ToMotor::NUMBERS.contains(&number) {
                return Ok(Self::Motor(motor(fields)?, ToMotor::read(number, fields)?));
            }
            if ToPin::NUMBERS.contains(&number) {
                return ToPin::read(number, fields).map(Self::Pin);
            }
            // Not among them are transfers by I2C (37 to 42, 52, 54, 55), which must be refused when they are asked
            // for, as hosts poll an accepted one for ever; and bulk output (56).
            return ToHub::read(number, fields).map(Self::Hub);
        }
        if let Some(number) = Interface::Setup.functions().number(packet.id) {
            if ToGroup::NUMBERS.contains(&number) {
                return Ok(Self::Group(motor(fields)?, ToGroup::read(number, fields)?));
            }
            if number == bus::FUNCTION {
                return Ok(Self::Bus);
            }
            if ToRecord::NUMBERS.contains(&number) {
                return ToRecord::read(number, fields).map(Self::Record);
            }
            if ToStore::NUMBERS.contains(&number) {
                return ToStore::read(number, fields).map(Self::Store);
            }
            if number == report::FUNCTION {
                return Ok(Self::Report);
            }
            if ToUpdate::NUMBERS.contains(&number) {
                return ToUpdate::read(number, fields).map(Self::Update);
            }
            return Ok(Self::Setup(motor(fields)?, ToSetup::read(number, fields)?));
        }
        if Standard::NUMBERS.contains(&packet.id) {
            return Standard::read(packet.id, fields).map(Self::Standard);
        }
        Err(Nack::UNKNOWN)
    }

    /// The interface that it belongs to; `None` for a standard command.
    pub const fn interface(&self) -> Option<Interface> {
        match self {
            Self::Standard(_) => None,
            Self::Hub(_) | Self::Motor(..) | Self::Pin(_) => Some(Interface::Motors),
            Self::Setup(..)
            | Self::Group(..)
            | Self::Bus
            | Self::Report
            | Self::Record(_)
            | Self::Store(_)
            | Self::Update(_) => Some(Interface::Setup),
        }
    }

    /// Its number within its interface; a standard command's is its type.
    pub const fn number(&self) -> u16 {
        match self {
            Self::Standard(request) => request.number(),
            Self::Hub(request) => request.number(),
            Self::Motor(_, request) => request.number(),
            Self::Pin(request) => request.number(),
            Self::Setup(_, request) => request.number(),
            Self::Group(_, request) => request.number(),
            Self::Bus => bus::FUNCTION,
            Self::Record(request) => request.number(),
            Self::Store(request) => request.number(),
            Self::Report => report::FUNCTION,
            Self::Update(request) => request.number(),
        }
    }

    /// Its type on hubs of this project.
    pub const fn id(&self) -> u16 {
        match self.interface() {
            None => self.number(),
            Some(interface) => interface.functions().first + self.number(),
        }
    }

    /// Its fields.
    pub fn payload(&self) -> Payload {
        let mut payload = Payload::new();
        let out = &mut payload;
        match self {
            Self::Standard(request) => request.write(out),
            Self::Hub(request) => request.write(out),
            Self::Pin(request) => request.write(out),
            Self::Bus | Self::Report => (),
            Self::Record(request) => request.write(out),
            Self::Store(request) => request.write(out),
            Self::Update(request) => request.write(out),
            Self::Motor(motor, request) => {
                motor.write(out);
                request.write(out);
            }
            Self::Setup(motor, request) => {
                motor.write(out);
                request.write(out);
            }
            Self::Group(motor, request) => {
                motor.write(out);
                request.write(out);
            }
        }
        payload
    }

    /// A host's packet of type `id`, which is [`id`](Self::id) unless a hub tells otherwise.
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

impl From<ToRecord> for Request {
    fn from(request: ToRecord) -> Self {
        Self::Record(request)
    }
}

impl From<ToUpdate> for Request {
    fn from(request: ToUpdate) -> Self {
        Self::Update(request)
    }
}

impl From<ToStore> for Request {
    fn from(request: ToStore) -> Self {
        Self::Store(request)
    }
}

impl ToMotor {
    /// To the motor with this number, 0 to 3.
    pub const fn to(self, motor: u8) -> Request {
        Request::Motor(motor, self)
    }
}

impl ToSetup {
    /// To the motor with this number, 0 to 3.
    pub const fn to(self, motor: u8) -> Request {
        Request::Setup(motor, self)
    }
}

impl ToGroup {
    /// To the group of the motor with this number, 0 to 3.
    pub const fn to(self, motor: u8) -> Request {
        Request::Group(motor, self)
    }
}
