//! Requests to one motor, and the types of their answers. The motor's number, 0 to 3, goes before the fields of each request.
//!
//! ```
//! use motor_hub::protocol::motor::{Target, ToMotor};
//!
//! // To -1000 counts, within 25.
//! let request = ToMotor::SetPosition { target: Target { counts: -1000, tolerance: 25 } }.to(0);
//! assert_eq!(request.id(), 0x1013);
//! assert_eq!(*request.payload(), [0, 0x18, 0xFC, 0xFF, 0xFF, 25, 0]);
//! ```

use super::payload::{codes, flag, payload};
use super::request_table::requests;
use super::requests::FIRST_FUNCTION;
use crate::units::{Coefficient, Control};

requests! {
    /// A request to one motor.
    pub enum ToMotor from FIRST_FUNCTION => {
        /// Sets what regulates the motor, and whether the motor floats at zero.
        8 SetMode { mode: ChannelMode },
        /// The answer is a [`ChannelMode`].
        9 Mode,
        10 SetEnable { on: bool },
        /// The answer is a bool.
        11 Enable,
        12 SetCurrentAlert { milliamperes: u16 },
        /// The answer is a u16.
        13 CurrentAlert,
        14 ResetEncoder,
        15 SetPower { power: Control },
        /// The answer is a [`Control`].
        16 Power,
        /// Sets the velocity in counts per second. In position mode the velocity is the speed limit towards the target.
        17 SetVelocity { cps: i16 },
        /// The answer is an i16.
        18 Velocity,
        19 SetPosition { target: Target },
        /// The answer is a [`Target`].
        20 Position,
        /// The answer is a bool.
        21 AtTarget,
        /// The answer is an i32 in counts.
        22 Encoder,
        /// Sets coefficients without feed-forward.
        23 SetPid { of: Loop, p: Coefficient, i: Coefficient, d: Coefficient },
        /// The answer is P, I and D.
        24 Pid { of: Loop },
        51 SetPidf { of: Loop, coefficients: Coefficients },
        /// The answer is a [`Coefficients`].
        53 Pidf { of: Loop },
    }
}

/// What regulates a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RunMode {
    /// The motor is in open loop.
    #[default]
    Power,
    /// A velocity loop regulates the motor.
    Velocity,
    /// A position loop regulates the motor.
    Position,
}

codes!(RunMode { 0 = Power, 1 = Velocity, 2 = Position });

/// A loop that has coefficients; its code is the code of its mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Loop {
    /// The loop of [`RunMode::Velocity`].
    Velocity,
    /// The loop of [`RunMode::Position`].
    Position,
}

codes!(Loop { 1 = Velocity, 2 = Position });

/// How a host means its coefficients. This hub runs the same loops either way; it stores the value, which hosts read back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Algorithm {
    /// Without feed-forward.
    Legacy,
    /// With feed-forward.
    Pidf,
}

codes!(Algorithm { 0 = Legacy, 1 = Pidf });

payload! {
    /// What regulates a motor, and what the motor does at zero.
    #[derive(Copy)]
    pub struct ChannelMode {
        /// What regulates the motor.
        pub mode: RunMode,
        /// True if the motor floats at zero power, false if it brakes.
        pub floats: bool as flag,
    }
}

payload! {
    /// The target of a position loop.
    #[derive(Copy, Default)]
    pub struct Target {
        /// Position in encoder counts.
        pub counts: i32,
        /// Counts from the target within which the motor is at its target.
        pub tolerance: u16,
    }
}

payload! {
    /// Coefficients of a loop, read back bit for bit. I and D are by cycles of 50 ms; F is for full control at the battery's
    /// voltage.
    #[derive(Copy)]
    pub struct Coefficients {
        /// Proportional coefficient.
        pub p: Coefficient,
        /// Integral coefficient.
        pub i: Coefficient,
        /// Derivative coefficient.
        pub d: Coefficient,
        /// Feed-forward coefficient.
        pub f: Coefficient,
        /// How the host means the coefficients.
        pub algorithm: Algorithm,
    }
}
