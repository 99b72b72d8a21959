//! Requests to one motor, and the types of their answers. The first field of a request is the motor's number, 0 to 3.
//!
//! ```
//! use motor_hub::protocol::motor::{Target, ToMotor};
//!
//! // A host sets a target of -1000 counts, with a tolerance of 25 counts.
//! let request = ToMotor::SetPosition { target: Target { counts: -1000, tolerance: 25 } }.to(0);
//! assert_eq!(request.id(), 0x1013);
//! assert_eq!(*request.payload(), [0, 0x18, 0xFC, 0xFF, 0xFF, 25, 0]);
//! ```

use super::payload::{codes, flag, payload};
use super::request_table::requests;
use super::requests::FIRST_FUNCTION;
use crate::units::{Coefficient, Control};

requests! {
    /// A request to one motor. The motor's number comes before these fields.
    pub enum ToMotor from FIRST_FUNCTION => {
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
        /// The answer is a bool: true if the motor is within the tolerance of its target.
        21 AtTarget,
        /// The answer is an i32 in counts.
        22 Encoder,
        /// Sets coefficients without feed-forward.
        23 SetPid { of: Loop, p: Coefficient, i: Coefficient, d: Coefficient },
        /// The answer is P, I and D.
        24 Pid { of: Loop },
        51 SetPidf { of: Loop, coefficients: LoopCoefficients },
        /// The answer is a [`LoopCoefficients`].
        53 Pidf { of: Loop },
    }
}

/// Mode of a motor: the kind of its set-point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum RunMode {
    /// A control value, in open loop.
    #[default]
    Power,
    /// A velocity.
    Velocity,
    /// A position.
    Position,
}

codes!(RunMode { 0 = Power, 1 = Velocity, 2 = Position });

/// A loop that has coefficients. Its code is the code of the mode that uses the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Loop {
    /// The loop of [`RunMode::Velocity`].
    Velocity,
    /// The loop of [`RunMode::Position`].
    Position,
}

codes!(Loop { 1 = Velocity, 2 = Position });

/// Terms of a control loop that a host states with the coefficients. The hub stores the terms, so that hosts can read
/// them back. The terms have no effect on the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Terms {
    /// Proportional, integral and derivative.
    Pid,
    /// Proportional, integral, derivative and feed-forward.
    Pidf,
}

codes!(Terms { 0 = Pid, 1 = Pidf });

payload! {
    /// Mode of a motor, and what the motor does at zero power.
    #[derive(Copy)]
    pub struct ChannelMode {
        /// Kind of the motor's set-point.
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
        /// Largest distance from the target, in counts, at which the motor is within tolerance.
        pub tolerance: u16,
    }
}

payload! {
    /// Coefficients of a loop. A host reads back the same bits that a host has set. I and D are for cycles of 50 ms.
    #[derive(Copy)]
    pub struct LoopCoefficients {
        /// Proportional coefficient.
        pub p: Coefficient,
        /// Integral coefficient.
        pub i: Coefficient,
        /// Derivative coefficient.
        pub d: Coefficient,
        /// Feed-forward coefficient.
        pub f: Coefficient,
        /// Terms that the host has stated.
        pub terms: Terms,
    }
}
