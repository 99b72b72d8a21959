//! Requests to digital pins, servo outputs and I2C buses. A hub refuses requests to pins, outputs and buses that the
//! hub does not have.
//!
//! A transfer on an I2C bus takes two requests. The first request starts the transfer, and is acknowledged immediately.
//! The second request *polls* the transfer: its answer is the result, or the refusal that the transfer is still
//! running.
//!
//! ```
//! use motor_hub::extension::Request;
//! use motor_hub::protocol::pins::{Pin, ToPin};
//!
//! let pin = Pin::new(7).expect("0 to 7");
//! let request = Request::from(ToPin::SetOutput { pin, high: true });
//! assert_eq!(request.number(), 1);
//! assert_eq!(*request.payload(), [7, 1]);
//! ```

use super::payload::{ByteIn, Text, WordFrom};
use super::refusal::Nack;
use super::request_table::requests;
use super::requests::FIRST_FUNCTION;

/// The number of a digital pin.
pub type Pin = ByteIn<0, 7>;

/// The number of a servo output.
pub type ServoOutput = ByteIn<0, 5>;

/// The number of an I2C bus.
pub type I2cBus = ByteIn<0, 3>;

/// The address of a device on an I2C bus, without the bit that says read or write.
pub type I2cAddress = ByteIn<0, 127>;

/// The number of bytes of an I2C transfer.
pub type I2cCount = ByteIn<1, 100>;

requests! {
    /// A request to a pin, an output or a bus.
    ///
    /// Periods and widths of pulses are in microseconds. In `levels`, bit i stands for pin i. A fast I2C bus runs at
    /// 400 kbit/s, any other bus at 100 kbit/s. The answer to a request that reads a setting has the type of the field
    /// that sets it. The answer to `Input` is a bool, and the answer to `Inputs` is a u8.
    pub enum ToPin from FIRST_FUNCTION => {
        1 SetOutput { pin: Pin, high: bool },
        2 SetOutputs { levels: u8 },
        3 SetDirection { pin: Pin, output: bool },
        4 Direction { pin: Pin },
        5 Input { pin: Pin },
        6 Inputs,
        31 SetServoPeriod { servo: ServoOutput, period: WordFrom<2> },
        32 ServoPeriod { servo: ServoOutput },
        33 SetServoWidth { servo: ServoOutput, width: WordFrom<1> },
        34 ServoWidth { servo: ServoOutput },
        35 SetServoEnable { servo: ServoOutput, on: bool },
        36 ServoEnable { servo: ServoOutput },
        37 WriteI2cByte { bus: I2cBus, address: I2cAddress, byte: u8 },
        /// A write has 1 to 100 bytes.
        38 WriteI2c { bus: I2cBus, address: I2cAddress, bytes: Text },
        39 ReadI2cByte { bus: I2cBus, address: I2cAddress },
        40 ReadI2c { bus: I2cBus, address: I2cAddress, count: I2cCount },
        /// Polls a read. The answer is an [`I2cRead`](super::answers::I2cRead).
        41 PollI2cRead { bus: I2cBus },
        /// Polls a write. The answer is an [`I2cWritten`](super::answers::I2cWritten).
        42 PollI2cWrite { bus: I2cBus },
        43 SetI2cSpeed { bus: I2cBus, fast: bool },
        47 I2cSpeed { bus: I2cBus },
        /// Writes the number of a register, and reads `count` bytes after a repeated start.
        52 ReadI2cRegister { bus: I2cBus, address: I2cAddress, count: I2cCount, register: u8 },
    }
}

impl Nack {
    /// Creates the refusal to set a digital pin that is an input.
    pub const fn not_an_output(pin: Pin) -> Self {
        Self(10 + pin.get())
    }

    /// Creates the refusal to read a digital pin that is an output.
    pub const fn not_an_input(pin: Pin) -> Self {
        Self(20 + pin.get())
    }
}
