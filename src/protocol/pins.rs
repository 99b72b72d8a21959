//! Requests to digital pins, PWM outputs, servo outputs and I2C buses. Host software sends them also to a hub without these
//! outputs and buses.
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

use super::payload::{ByteIn, WordFrom};
use super::refusal::Nack;
use super::request_table::requests;
use super::requests::FIRST_FUNCTION;

/// The number of a digital pin.
pub type Pin = ByteIn<0, 7>;

/// The number of a PWM output.
pub type PwmOutput = ByteIn<0, 3>;

/// The number of a servo output.
pub type ServoOutput = ByteIn<0, 5>;

/// The number of an I2C bus.
pub type I2cBus = ByteIn<0, 3>;

requests! {
    /// A request to a pin or an output.
    ///
    /// Periods and widths of pulses are in microseconds. In `levels`, bit i stands for pin i. A fast I2C bus runs at 400 kbit/s,
    /// any other bus at 100 kbit/s. A request that reads a value is answered with the type of the field that sets the value.
    pub enum ToPin from FIRST_FUNCTION => {
        1 SetOutput { pin: Pin, high: bool },
        2 SetOutputs { levels: u8 },
        3 SetDirection { pin: Pin, output: bool },
        4 Direction { pin: Pin },
        5 Input { pin: Pin },
        6 Inputs,
        25 SetPwmPeriod { pwm: PwmOutput, period: u16 },
        26 PwmPeriod { pwm: PwmOutput },
        27 SetPwmWidth { pwm: PwmOutput, width: u16 },
        28 PwmWidth { pwm: PwmOutput },
        29 SetPwmEnable { pwm: PwmOutput, on: bool },
        30 PwmEnable { pwm: PwmOutput },
        31 SetServoPeriod { servo: ServoOutput, period: WordFrom<2> },
        32 ServoPeriod { servo: ServoOutput },
        33 SetServoWidth { servo: ServoOutput, width: WordFrom<1> },
        34 ServoWidth { servo: ServoOutput },
        35 SetServoEnable { servo: ServoOutput, on: bool },
        36 ServoEnable { servo: ServoOutput },
        43 SetI2cSpeed { bus: I2cBus, fast: bool },
        47 I2cSpeed { bus: I2cBus },
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
