//! Requests of REV's protocol, in tables. Each line of a table has the number of a request, its name, and its fields in
//! the order of the payload.
//!
//! * A *standard command* has the same packet type on every hub.
//! * A *function* belongs to an *interface*. The packet type of a function is the packet type of the interface's
//!   function 0 plus the number of the function. A host queries the packet type of function 0 from the hub.
//!
//! ```
//! use motor_hub::extension::Request;
//! use motor_hub::protocol::requests::{Standard, ToHub};
//!
//! let request = Request::from(ToHub::SetPhoneCharge { on: true });
//! assert_eq!((request.id(), request.number()), (0x102C, 44));
//! assert_eq!(*request.payload(), [1]);
//!
//! // The number of a standard command is also its packet type.
//! let status = Request::from(Standard::Status { clear: true });
//! assert_eq!((status.interface(), status.id()), (None, 0x7F03));
//! ```

use super::address::Address;
use super::answers::Functions;
use super::led::{Colour, LedPattern};
use super::payload::{ByteIn, Field, Fields, Payload, Text, append};
use super::refusal::Nack;
use super::request_table::requests;
use heapless::Vec;

/// The name of the motor interface, to which all of REV's functions belong.
pub const MOTOR_INTERFACE: &[u8] = b"DEKA";

/// The packet type of the motor interface's function 0, on hubs of this project.
pub const FIRST_FUNCTION: u16 = 0x1000;

/// The packet types of the motor interface, on hubs of this project.
///
/// The count includes functions that the hub refuses: PWM outputs, I2C transactions and bulk output. With a smaller
/// count hosts would not use the functions with the highest numbers, among them the coefficients and the version.
pub const MOTOR_FUNCTIONS: Functions = Functions { first: FIRST_FUNCTION, count: 58 };

/// The packet type of a discovery, which is the only request to all hubs that REV's hubs answer.
pub const DISCOVERY: u16 = 0x7F0F;

/// The packet type of a fail-safe. A hub of this project also accepts a fail-safe to all hubs.
pub const FAIL_SAFE: u16 = 0x7F05;

/// Length of the longest interface name in bytes.
const LONGEST_NAME: usize = 16;

/// The name of an interface. In a payload the name ends with a zero byte.
pub type InterfaceName = Vec<u8, LONGEST_NAME>;

impl Field for InterfaceName {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Self::from_slice(fields.zero_terminated()?).map_err(|_| Nack::UNKNOWN)
    }

    fn write(&self, payload: &mut Payload) {
        append(payload, self);
        0u8.write(payload);
    }
}

requests! {
    /// Standard commands.
    pub enum Standard from 0 => {
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
        /// Sets how many debug messages of one group the hub sends. A hub of this project sends none.
        0x7F0E DebugLevel { group: ByteIn<1, 12>, verbosity: ByteIn<0, 3> },
        /// The answer is a bool: true if the hub is connected to the host directly, and not through another hub.
        0x7F0F Discovery,
    }
}

/// An ADC channel.
pub type AdcChannel = ByteIn<0, 14>;

/// The channel of the current of the digital pins' supply, in milliamperes. The supplies of I2C buses and of servos
/// follow.
pub const FIRST_SUPPLY_CURRENT: AdcChannel = AdcChannel::new(4).expect("in range");

/// The channel of the battery current, in milliamperes.
pub const BATTERY_CURRENT: AdcChannel = AdcChannel::new(7).expect("in range");

/// The channel of the current of motor 0, in milliamperes. The channels of the other motors follow in their order.
pub const FIRST_CURRENT: AdcChannel = AdcChannel::new(8).expect("in range");

/// The channel of the 5 V rail, in millivolts.
pub const RAIL: AdcChannel = AdcChannel::new(12).expect("in range");

/// The channel of the battery, in millivolts.
pub const BATTERY: AdcChannel = AdcChannel::new(13).expect("in range");

/// The channel of the hub's temperature, in 0.1 degrees Celsius.
pub const TEMPERATURE: AdcChannel = AdcChannel::new(14).expect("in range");

requests! {
    /// Functions of the motor interface for the whole hub.
    pub enum ToHub from FIRST_FUNCTION => {
        /// The answer is a [`Bulk`](super::answers::Bulk).
        0 Bulk,
        /// The answer is an i16 in millivolts, milliamperes or 0.1 degrees, or in raw counts.
        7 Adc { channel: AdcChannel, raw: bool },
        44 SetPhoneCharge { on: bool },
        /// The answer is a bool.
        45 PhoneCharge,
        46 LogHint { text: Text },
        /// The answer is a [`Text`] with the numbers of a [`Version`](super::answers::Version).
        48 VersionText,
        /// Sets whether a hub of REV resets its USB bridge when the keep-alive timer runs out. A hub of this project
        /// only stores the value.
        49 SetFtdiReset { on: bool },
        /// The answer is a bool.
        50 FtdiReset,
        /// The answer is a [`Version`](super::answers::Version).
        57 Version,
    }
}
