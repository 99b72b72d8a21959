//! What all motors and the bus do, in one answer: a function of this hub's [own interface](super::setup), for hosts that
//! draw, tune or record while motors run. One exchange, however many motors there are.
//!
//! | function | payload | answer |
//! |---|---|---|
//! | 20 tell what motors and bus do | | the fields of a [`HubReport`] |
//!
//! Motors are as of the last control tick, but for position and velocity, which are newer.
//!
//! | field | |
//! |---|---|
//! | u8 | version of these fields, [`VERSION`]; a higher one has more of them, behind those of the motors or of each motor |
//! | u8, u8 | motors; bytes of each, from 36 on |
//! | u32 | time of the tick since boot, ms; begins again at 2^32 |
//! | u16 | battery voltage in force, mV; 0 if unknown |
//! | u8, u16 | state of the bus, and how far it is burnt, in 1/1000: see [`bus`](super::bus) |
//!
//! Of each motor:
//!
//! | field | |
//! |---|---|
//! | u8 | told: 0 off, 1 fail-safe, 2 power, 3 velocity, 4 position, 5 in step with others, 6 to be learned |
//! | i32 | of these: control value, counts/s, counts, where it should be now in counts, counts that it may turn; else 0 |
//! | i32, i16 | position, counts; velocity, counts/s |
//! | u8 | regulator: 0 by the motor's model, 1 PID |
//! | i16 | control value |
//! | u8 | regime: 0 none, as the bridge is open; 1 reverse, 2 braking, 3 forward |
//! | u8, u16 | mode of the bridge: 0 9/8, 1 6/2, 2 5/0; duty in steps of 2^-15 |
//! | i16, u16 | mean current by the motor's constants, mA; its magnitude as measured, mA, 65535 if it is not |
//! | i16 | current that would just balance the load, mA; -32768 if the motor is not known |
//! | u16 | heat of the winding, in 1/1000 of its limit; 0 without one |
//! | u8 | bits from 0: enabled, settled, stalled, derated because hot |
//! | u8 | bits from 0: battery unknown, encoder silent, stuck, reversed, winding too hot, bridge off |
//! | i16 * 4 | points S, T, Z, G at this speed and battery as control values, those beyond the range at its end; all 0 if unknown |
//!
//! Behind the motors, from version 2 on:
//!
//! | field | |
//! |---|---|
//! | u32 | number of the newest command that these values include, but for position and velocity |
//! | u32 | number of the newest command that follows from the requests before this one |
//!
//! Commands are counted since boot; both numbers begin again at 2^32. The values are out of date while the second number is
//! ahead of the first.
//!
//! ```
//! use motor_hub::protocol::Request;
//! use motor_hub::protocol::report::{FUNCTION, HubReport, MotorReport};
//! use motor_hub::protocol::fields::{Field, Fields, Payload};
//!
//! assert_eq!(Request::Report.number(), FUNCTION);
//! // A longer answer of a newer hub is read as far as it is known.
//! let mut payload = Payload::new();
//! HubReport { motors: [MotorReport::default(); 2].into_iter().collect(), ..HubReport::default() }.write(&mut payload);
//! payload.extend_from_slice(&[1, 2, 3]).unwrap();
//! assert_eq!(HubReport::read(&mut Fields::new(&payload)).unwrap().motors.len(), 2);
//! ```

use super::CHANNELS;
use super::fields::{ByteIn, Field, Fields, Payload, codes};
use super::nack::Nack;
use crate::braking::Regime;
use crate::bridge::{Drive, Mode};
use crate::motion::EncoderFault;
use crate::motor::{Faults, best_current};
use crate::regulator::Kind;
use crate::supply::BusState;
use crate::units::{Control, Duty, Milliamperes, Millivolts, is_included};
use heapless::Vec;

/// Its number.
pub const FUNCTION: u16 = 20;

/// Of the fields.
pub const VERSION: u8 = 2;

/// The first version whose fields include [`Commands`].
const WITH_COMMANDS: u8 = 2;

/// Bytes of a motor's fields.
const STRIDE: u8 = 36;

const NOT_MEASURED: u16 = u16::MAX;
const UNKNOWN: i16 = i16::MIN;

codes!(Mode { 0 = Cw98, 1 = Ccw62, 2 = Brake50 });
codes!(Kind { 0 = Model, 1 = Pid });

/// What motors and bus do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HubReport {
    /// Time of the control tick in milliseconds; begins again at 2^32.
    pub at_ms: u32,
    /// The battery voltage in force, if it is known.
    pub battery: Option<Millivolts>,
    /// In which of its ranges the bus is.
    pub bus: BusState,
    /// How far braking motors burn what they would return, in 1/1000.
    pub burning: u16,
    /// By motor.
    pub motors: Vec<MotorReport, CHANNELS>,
    /// Which commands the report includes; `None` of a hub that does not report it.
    pub commands: Option<Commands>,
}

/// Numbers of commands to the motors. They count commands since the hub's start, and begin again at 2^32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Commands {
    /// Number of the newest command that the report includes.
    pub included: u32,
    /// Number of the newest command that follows from the requests that the hub has answered.
    pub newest: u32,
}

impl HubReport {
    /// True if the report includes all commands that follow from the requests before it. A hub that does not report its
    /// commands counts as up to date.
    pub fn is_up_to_date(&self) -> bool {
        self.commands.is_none_or(|Commands { included, newest }| is_included(newest, included))
    }
}

/// What one motor does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorReport {
    /// What it is told to do.
    pub told: Told,
    /// Counts, from where the host has set 0.
    pub position: i32,
    /// Counts per second.
    pub velocity: i16,
    /// What regulates it.
    pub regulator: Kind,
    /// The control value; 0 while coasting.
    pub control: Control,
    /// Its regime; `None` while the bridge is open because the motor is disabled, floating or at fault.
    pub regime: Option<Regime>,
    /// What the bridge is told.
    pub drive: Drive,
    /// Mean current by the motor's constants and what the bridge is told; 32.767 A at most.
    pub current: Milliamperes,
    /// Magnitude of the mean current in milliamperes, where it is measured; 65 534 at most.
    pub measured_ma: Option<u16>,
    /// The current that would just balance the load; `None` of a motor that is not known.
    pub load: Option<Milliamperes>,
    /// Of the winding: 1000 at its limit, 0 without one.
    pub heat: u16,
    /// It may run.
    pub enabled: bool,
    /// True if the motor has settled at its target, or its group at its end.
    pub settled: bool,
    /// Held against a stop.
    pub stalled: bool,
    /// So hot that its current is limited.
    pub derated: bool,
    /// What keeps it from obeying.
    pub faults: Faults,
    /// S, T, Z and G as control values, at this speed and battery; `None` if the battery is unknown.
    pub points: Option<[Control; 4]>,
}

impl MotorReport {
    /// The [best current](best_current) of the motor.
    pub fn best_current(&self) -> Milliamperes {
        best_current(self.current, self.measured_ma.map(|ma| Milliamperes::new(ma.into())))
    }
}

/// What a motor is told to do, with the number that goes with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Told {
    /// Nothing.
    #[default]
    Off,
    /// Nothing, because its host is gone.
    FailSafe,
    /// Constant power.
    Power(Control),
    /// Counts per second.
    Velocity(i32),
    /// Counts, from where the host has set 0.
    Position(i32),
    /// To be where its group wants it, in counts from there too.
    Together(i32),
    /// To be learned, within so many counts either way.
    Identify(u32),
}

impl Default for MotorReport {
    /// Of a disabled motor of which nothing is known.
    fn default() -> Self {
        Self {
            told: Told::Off,
            position: 0,
            velocity: 0,
            regulator: Kind::Pid,
            control: Control::ZERO,
            regime: None,
            drive: Drive::COAST,
            current: Milliamperes::ZERO,
            measured_ma: None,
            load: None,
            heat: 0,
            enabled: false,
            settled: false,
            stalled: false,
            derated: false,
            faults: Faults::default(),
            points: None,
        }
    }
}

impl Field for HubReport {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let version = ByteIn::<1, { u8::MAX }>::read(fields)?.get();
        let (count, stride) = (u8::read(fields)?, ByteIn::<STRIDE, { u8::MAX }>::read(fields)?.get());
        let at_ms = u32::read(fields)?;
        let battery = Some(u16::read(fields)?).filter(|mv| *mv != 0).map(Millivolts::new);
        let (bus, burning) = (BusState::read(fields)?, u16::read(fields)?);
        let mut motors = Vec::new();
        for _ in 0..count {
            let of_motor = fields.slice(stride.into())?;
            // Motors that a host of this protocol has no numbers for are left out.
            let _ = motors.push(MotorReport::read(&mut Fields::new(of_motor))?);
        }
        let commands = match version {
            WITH_COMMANDS.. => Some(Commands { included: u32::read(fields)?, newest: u32::read(fields)? }),
            _ => None,
        };
        Ok(Self { at_ms, battery, bus, burning, motors, commands })
    }

    fn write(&self, payload: &mut Payload) {
        let version = if self.commands.is_some() { VERSION } else { WITH_COMMANDS - 1 };
        [version, self.motors.len() as u8, STRIDE].write(payload);
        self.at_ms.write(payload);
        self.battery.map_or(0, Millivolts::get).write(payload);
        self.bus.write(payload);
        self.burning.write(payload);
        self.motors.iter().for_each(|motor| motor.write(payload));
        if let Some(Commands { included, newest }) = self.commands {
            [included, newest].write(payload);
        }
    }
}

impl Field for MotorReport {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let told = Told::read(fields)?;
        let (position, velocity) = (i32::read(fields)?, i16::read(fields)?);
        let regulator = Kind::read(fields)?;
        let control = Control::read(fields)?;
        let regime = read_regime(fields)?;
        let drive = Drive { mode: Mode::read(fields)?, duty: Duty::from_bits(u16::read(fields)?) };
        let current = Milliamperes::new(i16::read(fields)?.into());
        let measured_ma = Some(u16::read(fields)?).filter(|ma| *ma != NOT_MEASURED);
        let load = Some(i16::read(fields)?).filter(|ma| *ma != UNKNOWN);
        let heat = u16::read(fields)?;
        let [enabled, settled, stalled, derated, ..] = bits(u8::read(fields)?);
        let faults = faults(u8::read(fields)?);
        let points: [i16; 4] = Field::read(fields)?;
        Ok(Self {
            told,
            position,
            velocity,
            regulator,
            control,
            regime,
            drive,
            current,
            measured_ma,
            load: load.map(|ma| Milliamperes::new(ma.into())),
            heat,
            enabled,
            settled,
            stalled,
            derated,
            faults,
            points: (points != [0; 4]).then_some(points.map(Control::new)),
        })
    }

    fn write(&self, payload: &mut Payload) {
        self.told.write(payload);
        self.position.write(payload);
        self.velocity.write(payload);
        self.regulator.write(payload);
        self.control.write(payload);
        regime_code(self.regime).write(payload);
        self.drive.mode.write(payload);
        self.drive.duty.to_bits().write(payload);
        milliamperes(self.current).write(payload);
        self.measured_ma.map_or(NOT_MEASURED, |ma| ma.min(NOT_MEASURED - 1)).write(payload);
        self.load.map_or(UNKNOWN, milliamperes).write(payload);
        self.heat.write(payload);
        byte(&[self.enabled, self.settled, self.stalled, self.derated]).write(payload);
        fault_bits(self.faults).write(payload);
        self.points.map_or([0; 4], |points| points.map(Control::get)).write(payload);
    }
}

impl Field for Told {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let code = ByteIn::<0, 6>::read(fields)?.get();
        let value = i32::read(fields)?;
        Ok(match code {
            0 => Self::Off,
            1 => Self::FailSafe,
            2 => Self::Power(Control::saturating(value.into())),
            3 => Self::Velocity(value),
            4 => Self::Position(value),
            5 => Self::Together(value),
            _ => Self::Identify(value.cast_unsigned()),
        })
    }

    fn write(&self, payload: &mut Payload) {
        let (code, value) = match *self {
            Self::Off => (0u8, 0),
            Self::FailSafe => (1, 0),
            Self::Power(control) => (2, control.get().into()),
            Self::Velocity(cps) => (3, cps),
            Self::Position(counts) => (4, counts),
            Self::Together(counts) => (5, counts),
            Self::Identify(travel) => (6, travel.cast_signed()),
        };
        code.write(payload);
        value.write(payload);
    }
}

fn read_regime(fields: &mut Fields<'_>) -> Result<Option<Regime>, Nack> {
    Ok(match ByteIn::<0, 3>::read(fields)?.get() {
        0 => None,
        1 => Some(Regime::Reverse),
        2 => Some(Regime::Braking),
        _ => Some(Regime::Forward),
    })
}

const fn regime_code(regime: Option<Regime>) -> u8 {
    match regime {
        None => 0,
        Some(Regime::Reverse) => 1,
        Some(Regime::Braking) => 2,
        Some(Regime::Forward) => 3,
    }
}

/// As far as 15 bits go, either way.
fn milliamperes(current: Milliamperes) -> i16 {
    current.get().clamp(-i32::from(i16::MAX), i16::MAX.into()) as i16
}

fn bits(byte: u8) -> [bool; 8] {
    core::array::from_fn(|bit| byte & 1 << bit != 0)
}

fn byte(bits: &[bool]) -> u8 {
    bits.iter().rev().fold(0, |byte, bit| byte << 1 | u8::from(*bit))
}

fn fault_bits(faults: Faults) -> u8 {
    let Faults { battery_unknown, encoder_stale, encoder, overheated, bridge } = faults;
    let [stuck, reversed] = [EncoderFault::Stuck, EncoderFault::Reversed].map(|fault| encoder == Some(fault));
    byte(&[battery_unknown, encoder_stale, stuck, reversed, overheated, bridge])
}

fn faults(byte: u8) -> Faults {
    let [battery_unknown, encoder_stale, stuck, reversed, overheated, bridge, ..] = bits(byte);
    let encoder = match (stuck, reversed) {
        (true, _) => Some(EncoderFault::Stuck),
        (false, true) => Some(EncoderFault::Reversed),
        (false, false) => None,
    };
    Faults { battery_unknown, encoder_stale, encoder, overheated, bridge }
}
