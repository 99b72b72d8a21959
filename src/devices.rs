//! What a board may have for hosts besides motors: digital pins, servo outputs, analog inputs and I2C buses. The board,
//! the responder and both protocols share the types of this module.
//!
//! ```
//! use motor_hub::devices::{AnalogReading, Equipment, SERVOS};
//! use motor_hub::units::Millivolts;
//!
//! // A board with servos and two digital pins. The hub refuses everything else.
//! let equipment = Equipment { digital: 0b11, servos: SERVOS as u8, ..Equipment::default() };
//! assert_eq!((equipment.analog, equipment.rail), (0, false));
//! // With 12 bits and a reference of 3.3 V.
//! let reading = AnalogReading { voltage: Millivolts::new(1_650), counts: 2_048 };
//! assert!(reading.counts < 4_096);
//! ```

pub mod bno055;

use crate::units::{Milliamperes, Millivolts};
use heapless::Vec;

/// Number of digital pins in REV's protocol.
pub const DIGITAL_PINS: usize = 8;
/// Number of servo outputs in REV's protocol.
pub const SERVOS: usize = 6;
/// Number of analog inputs in REV's protocol.
pub const ANALOG_INPUTS: usize = 4;
/// Number of I2C buses in REV's protocol.
pub const I2C_BUSES: usize = 4;
/// Largest number of bytes that a transfer on an I2C bus writes, and largest number that it reads.
pub const I2C_BYTES: usize = 100;

/// What a board has for hosts besides its motors. The hub refuses requests to anything else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Equipment {
    /// The board's digital pins. Bit i stands for pin i.
    pub digital: u8,
    /// Number of servo outputs, 0 to [`SERVOS`], numbered from 0.
    pub servos: u8,
    /// Number of analog inputs, 0 to [`ANALOG_INPUTS`], numbered from 0.
    pub analog: u8,
    /// Number of I2C buses, 0 to [`I2C_BUSES`], numbered from 0. Each bus has a task `tasks::i2c`.
    pub i2c: u8,
    /// True if the board measures its 5 V rail.
    pub rail: bool,
    /// True if the board measures its temperature.
    pub temperature: bool,
}

/// The pulses of one servo output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ServoPulse {
    /// Time from the start of a pulse to the start of the next pulse, in microseconds, at least 2.
    pub period_us: u16,
    /// Time that the output is high in each period, in microseconds: at least 1, and at most `period_us`.
    pub width_us: u16,
}

/// A transfer on an I2C bus: a write, a read, or a write and a read after a repeated start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct I2cTransfer {
    /// Address of the device, 0 to 127.
    pub address: u8,
    /// True for 400 kbit/s, false for 100 kbit/s.
    pub fast: bool,
    /// The bytes to write; empty for a read.
    pub write: Vec<u8, I2C_BYTES>,
    /// Number of bytes to read after the write, 0 to [`I2C_BYTES`].
    pub read: u8,
}

/// One reading of an analog input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AnalogReading {
    /// Voltage at the pin.
    pub voltage: Millivolts,
    /// The converter's reading, with 12 bits.
    pub counts: u16,
}

/// The newest readings of a board's converters for hosts. A value is `None` if the board does not measure the value, or
/// if the last reading is older than 20 ms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AnalogReadings {
    /// The analog inputs in their order.
    pub inputs: [Option<AnalogReading>; ANALOG_INPUTS],
    /// Voltage of the 5 V rail.
    pub rail: Option<Millivolts>,
    /// Temperature of the board or of its chip in 0.1 degrees Celsius.
    pub temperature_decidegrees: Option<i16>,
    /// Currents of the supplies for digital pins, I2C buses and servos, in this order. `None` in place of all currents
    /// only if the board measures none of them.
    pub supply_currents: Option<[Option<Milliamperes>; 3]>,
}
