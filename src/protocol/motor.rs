//! Requests to one motor, and what they are answered. Before the fields of each goes the motor's number,
//! 0 to 3.
//!
//! ```
//! use motor_hub::protocol::motor::{Target, ToMotor};
//!
//! // To -1000 counts, within 25.
//! let request = ToMotor::SetPosition { target: Target { counts: -1000, tolerance: 25 } }.to(0);
//! assert_eq!(request.id(), 0x1013);
//! assert_eq!(*request.payload(), [0, 0x18, 0xFC, 0xFF, 0xFF, 25, 0]);
//! ```

use super::fields::{Field, Fields, Payload, codes, in_turn};
use super::nack::Nack;
use super::table::requests;
use crate::motion::Pidf;
use crate::motor::ZeroPower;
use crate::units::{Coefficient, Control};

requests! {
    /// A request to one motor.
    pub enum ToMotor {
        8 SetMode { mode: RunMode, zero_power: ZeroPower },
        /// Answered by a [`ChannelMode`].
        9 Mode,
        10 SetEnable { on: bool },
        /// Answered by a bool.
        11 Enable,
        12 SetCurrentAlert { milliamperes: u16 },
        /// Answered by a u16.
        13 CurrentAlert,
        14 ResetEncoder,
        15 SetPower { power: Control },
        /// Answered by a [`Control`].
        16 Power,
        /// In counts per second. In position mode it is the speed limit on the way.
        17 SetVelocity { cps: i16 },
        /// Answered by an i16.
        18 Velocity,
        19 SetPosition { target: Target },
        /// Answered by a [`Target`].
        20 Position,
        /// Answered by a bool.
        21 AtTarget,
        /// In counts; answered by an i32.
        22 Encoder,
        /// Without feed-forward.
        23 SetPid { of: Loop, p: Coefficient, i: Coefficient, d: Coefficient },
        /// Answered by P, I and D.
        24 Pid { of: Loop },
        51 SetPidf { of: Loop, coefficients: Coefficients },
        /// Answered by [`Coefficients`].
        53 Pidf { of: Loop },
    }
}

/// What regulates a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RunMode {
    /// Nothing: open loop.
    #[default]
    Power,
    /// A velocity loop.
    Velocity,
    /// A position loop.
    Position,
}

codes!(RunMode { 0 = Power, 1 = Velocity, 2 = Position });

/// A loop that has coefficients; numbered by its mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Loop {
    /// That of [`RunMode::Velocity`].
    Velocity,
    /// That of [`RunMode::Position`].
    Position,
}

codes!(Loop { 1 = Velocity, 2 = Position });

/// A host's word for how coefficients are to be understood. This hub runs the same loops either way;
/// it remembers the word, which hosts read back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Algorithm {
    /// Without feed-forward.
    Legacy,
    /// With.
    Pidf,
}

codes!(Algorithm { 0 = Legacy, 1 = Pidf });

/// What regulates a motor, and what zero means to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "the types say it")]
pub struct ChannelMode {
    pub mode: RunMode,
    pub zero_power: ZeroPower,
}

in_turn!(ChannelMode { mode, zero_power });

/// Where to go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Target {
    /// Encoder counts.
    pub counts: i32,
    /// So many counts from there are near enough.
    pub tolerance: u16,
}

in_turn!(Target { counts, tolerance });

/// A loop's coefficients: I and D by cycles of 50 ms, F for the battery's voltage, as [`Pidf`] says. They are read back bit
/// for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "the types say it")]
pub struct Coefficients {
    pub pidf: Pidf,
    pub algorithm: Algorithm,
}

impl Field for Coefficients {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let mut next = || Coefficient::read(fields);
        let pidf = Pidf { p: next()?, i: next()?, d: next()?, f: next()? };
        Ok(Self { pidf, algorithm: Algorithm::read(fields)? })
    }

    fn write(&self, payload: &mut Payload) {
        let Pidf { p, i, d, f } = self.pidf;
        [p, i, d, f].write(payload);
        self.algorithm.write(payload);
    }
}
