//! From a packet to a typed request, with every parameter checked.

use super::fields::{Fields, Nack};
use super::frame::Packet;
use super::led::{Colour, Pattern};
use super::pins::{self, Pins};
use super::setup::{self, Setup};
use crate::motion::Pidf;
use crate::motor::ZeroPower;
use crate::units::{Coefficient, Control};

/// The name of the interface that motors belong to.
pub const INTERFACE: &[u8] = b"DEKA";

/// The type of the interface's function 0.
pub const FIRST: u16 = 0x1000;

/// Functions of the interface: all that hosts know of.
pub const COUNT: u16 = 58;

/// Type of a discovery, the only request that is answered when it is sent to every hub.
pub const DISCOVERY: u16 = 0x7F0F;

/// A hub's address, 1 to 254.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Address(u8);

impl Address {
    /// What a hub has until it is given another: 2. Hosts find it by discovery.
    pub const DEFAULT: Self = Self(2);

    /// `None` for 0, which is the host, and 255, which is every hub.
    pub const fn new(address: u8) -> Option<Self> {
        if address == super::HOST || address == super::BROADCAST { None } else { Some(Self(address)) }
    }

    /// 1 to 254.
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl Default for Address {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// What regulates a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// 0: open loop.
    #[default]
    Power,
    /// 1: velocity.
    Velocity,
    /// 2: position.
    Position,
}

impl Mode {
    fn new(byte: u8) -> Option<Self> {
        Some(match byte {
            0 => Self::Power,
            1 => Self::Velocity,
            2 => Self::Position,
            _ => return None,
        })
    }
}

/// A loop that has coefficients; numbered by its mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Loop {
    /// 1.
    Velocity,
    /// 2.
    Position,
}

impl Loop {
    fn new(byte: u8) -> Option<Self> {
        Some(match byte {
            1 => Self::Velocity,
            2 => Self::Position,
            _ => return None,
        })
    }
}

/// A host's word for how coefficients are to be understood. This hub runs the same loops either way;
/// it remembers the word, which hosts read back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Algorithm {
    /// 0: without feed-forward.
    Legacy,
    /// 1.
    Pidf,
}

impl Algorithm {
    fn new(byte: u8) -> Option<Self> {
        Some(match byte {
            0 => Self::Legacy,
            1 => Self::Pidf,
            _ => return None,
        })
    }
}

/// A request to one motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "each is named as the protocol names it")]
pub enum ToMotor {
    SetMode(Mode, ZeroPower),
    Mode,
    SetEnable(bool),
    Enable,
    /// In milliamperes.
    SetCurrentAlert(u16),
    CurrentAlert,
    ResetEncoder,
    SetPower(Control),
    Power,
    /// In counts per second.
    SetVelocity(i16),
    Velocity,
    /// In counts.
    SetPosition {
        target: i32,
        tolerance: u16,
    },
    Position,
    AtTarget,
    Encoder,
    SetPidf(Loop, Pidf, Algorithm),
    Pidf(Loop),
    /// P, I and D only.
    Pid(Loop),
    SetUp(Setup),
    Setup,
}

/// A request with all its parameters in range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "each is named as the protocol names it")]
pub enum Request {
    Status {
        clear: bool,
    },
    KeepAlive,
    FailSafe,
    SetAddress(Address),
    /// The types of an interface that was asked for by its name: the first, and how many.
    QueryInterface {
        first: u16,
        count: u16,
    },
    SetLedColour(Colour),
    LedColour,
    SetLedPattern(Pattern),
    LedPattern,
    /// There is nothing to be verbose about: taken and forgotten.
    DebugLevel,
    Discovery,
    Bulk,
    Battery,
    Motor(usize, ToMotor),
    Pins(Pins),
    SetPhoneCharge(bool),
    PhoneCharge,
    /// Taken and forgotten.
    LogHint,
    VersionText,
    /// Whether to reset the USB bridge when the keep-alive timer runs out: remembered only.
    SetFtdiReset(bool),
    FtdiReset,
    Version,
}

impl Request {
    /// Reads a packet, for a hub of so many motors.
    ///
    /// # Errors
    /// What to answer if it is not a request that the hub can take. A payload that is too short is
    /// refused with the number of the first parameter that is missing.
    pub fn read(packet: &Packet, motors: usize) -> Result<Self, Nack> {
        let mut fields = Fields::new(&packet.payload);
        match packet.id {
            FIRST.. if packet.id - FIRST < COUNT => Self::function(packet.id - FIRST, &mut fields, motors),
            setup::FIRST.. if packet.id - setup::FIRST < setup::COUNT => {
                let motor = fields.index(motors)?;
                let read = packet.id != setup::FIRST;
                let request = if read { ToMotor::Setup } else { ToMotor::SetUp(Setup::read(&mut fields)?) };
                Ok(Self::Motor(motor, request))
            }
            _ => Self::standard(packet.id, &mut fields),
        }
    }

    fn standard(id: u16, fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Ok(match id {
            0x7F03 => Self::Status { clear: fields.flag()? },
            0x7F04 => Self::KeepAlive,
            0x7F05 => Self::FailSafe,
            0x7F06 => Self::SetAddress(fields.u8_as(Address::new)?),
            0x7F07 => {
                let name = fields.zero_terminated()?;
                let (first, count) = match name {
                    INTERFACE => (FIRST, COUNT),
                    setup::INTERFACE => (setup::FIRST, setup::COUNT),
                    _ => return Err(Nack::Unknown),
                };
                Self::QueryInterface { first, count }
            }
            0x7F0A => Self::SetLedColour(Colour::read(fields)?),
            0x7F0B => Self::LedColour,
            0x7F0C => Self::SetLedPattern(Pattern::read(fields)?),
            0x7F0D => Self::LedPattern,
            0x7F0E => {
                let (_group, _verbosity) = (fields.u8_in(1..=12)?, fields.u8_in(0..=3)?);
                Self::DebugLevel
            }
            DISCOVERY => Self::Discovery,
            _ => return Err(Nack::Unknown),
        })
    }

    fn function(number: u16, fields: &mut Fields<'_>, motors: usize) -> Result<Self, Nack> {
        Ok(match number {
            0 => Self::Bulk,
            1..=6 | 25..=36 => Self::Pins(pins::read(number, fields)?),
            7 => adc(fields)?,
            8..=24 | 51 | 53 => {
                let motor = fields.index(motors)?;
                Self::Motor(motor, to_motor(number, fields)?)
            }
            44 => Self::SetPhoneCharge(fields.flag()?),
            45 => Self::PhoneCharge,
            46 => {
                let length = fields.u8_in(0..=100)?;
                fields.slice(usize::from(length))?;
                Self::LogHint
            }
            48 => Self::VersionText,
            49 => Self::SetFtdiReset(fields.flag()?),
            50 => Self::FtdiReset,
            57 => Self::Version,
            // I2C (37 to 43, 47, 52, 54, 55), which must be refused when a transfer is asked for, as
            // hosts poll an accepted one for ever; and bulk output (56).
            _ => return Err(Nack::Unsupported),
        })
    }
}

/// Of the converter's channels, this hub has the battery only. A zero would be a lie about the others.
fn adc(fields: &mut Fields<'_>) -> Result<Request, Nack> {
    const BATTERY: u8 = 13;
    let channel = fields.u8_in(0..=14)?;
    let raw = fields.flag()?;
    if channel == BATTERY && !raw { Ok(Request::Battery) } else { Err(Nack::Unsupported) }
}

fn to_motor(number: u16, fields: &mut Fields<'_>) -> Result<ToMotor, Nack> {
    Ok(match number {
        8 => {
            let mode = fields.u8_as(Mode::new)?;
            ToMotor::SetMode(mode, if fields.flag()? { ZeroPower::Float } else { ZeroPower::Brake })
        }
        9 => ToMotor::Mode,
        10 => ToMotor::SetEnable(fields.flag()?),
        11 => ToMotor::Enable,
        12 => ToMotor::SetCurrentAlert(fields.u16()?),
        13 => ToMotor::CurrentAlert,
        14 => ToMotor::ResetEncoder,
        15 => ToMotor::SetPower(Control::new(fields.i16()?)),
        16 => ToMotor::Power,
        17 => ToMotor::SetVelocity(fields.i16()?),
        18 => ToMotor::Velocity,
        19 => ToMotor::SetPosition { target: fields.i32()?, tolerance: fields.u16()? },
        20 => ToMotor::Position,
        21 => ToMotor::AtTarget,
        22 => ToMotor::Encoder,
        23 => {
            let of = fields.u8_as(Loop::new)?;
            let [p, i, d] = [coefficient(fields)?, coefficient(fields)?, coefficient(fields)?];
            ToMotor::SetPidf(of, Pidf { p, i, d, f: Coefficient::ZERO }, Algorithm::Legacy)
        }
        24 => ToMotor::Pid(fields.u8_as(Loop::new)?),
        51 => {
            let of = fields.u8_as(Loop::new)?;
            let [p, i] = [coefficient(fields)?, coefficient(fields)?];
            let [d, f] = [coefficient(fields)?, coefficient(fields)?];
            ToMotor::SetPidf(of, Pidf { p, i, d, f }, fields.u8_as(Algorithm::new)?)
        }
        53 => ToMotor::Pidf(fields.u8_as(Loop::new)?),
        _ => return Err(Nack::Unsupported),
    })
}

/// Signed Q16.16.
fn coefficient(fields: &mut Fields<'_>) -> Result<Coefficient, Nack> {
    fields.i32_as(|bits| Some(Coefficient::from_bits(bits)))
}
