//! Commands to one motor, 0 to 3.

use super::hub::parse;
use super::{Error, Session};
use motor_hub::link::command::{Loop, Mode};
use motor_hub::link::fields::Fields;
use motor_hub::link::setup::Setup;
use motor_hub::motion::Pidf;
use motor_hub::motor::ZeroPower;
use motor_hub::units::Coefficient;
use std::io::{Read, Write};

/// With feed-forward, not the legacy algorithm.
const PIDF: u8 = 1;

/// What is kept of a motor for its host, as the host set it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// 0 power, 1 velocity, 2 position.
    pub mode: u8,
    /// At zero: 0 brake, 1 float.
    pub zero_behaviour: u8,
    /// It may run.
    pub enabled: bool,
    /// Share of full duty, -32767 to 32767.
    pub power: i16,
    /// Counts per second.
    pub velocity: i16,
    /// Counts.
    pub position: i32,
    /// At target within so many counts.
    pub tolerance: u16,
}

impl<L: Read + Write> Session<L> {
    /// Everything that is kept of a motor.
    ///
    /// # Errors
    /// See [`Session::ask`], as for all commands.
    pub fn channel(&mut self, motor: u8) -> Result<Channel, Error> {
        let mut get = |function, of| {
            let what = format!("tell the {of} of motor {motor}");
            self.get(&what, function, &[motor]).map(|data| (what, data))
        };
        let (what, mode) = get(9, "mode")?;
        let (mode, zero_behaviour) = parse(&what, &mode, |fields| Ok((fields.u8()?, fields.u8()?)))?;
        let (what, enabled) = get(11, "enable")?;
        let enabled = parse(&what, &enabled, Fields::u8)? != 0;
        let (what, power) = get(16, "power")?;
        let power = parse(&what, &power, Fields::i16)?;
        let (what, velocity) = get(18, "target velocity")?;
        let velocity = parse(&what, &velocity, Fields::i16)?;
        let (what, position) = get(20, "target position")?;
        let (position, tolerance) = parse(&what, &position, |fields| Ok((fields.i32()?, fields.u16()?)))?;
        Ok(Channel { mode, zero_behaviour, enabled, power, velocity, position, tolerance })
    }

    /// How the motor is regulated, and what zero means to it.
    pub fn set_mode(&mut self, motor: u8, mode: Mode, zero: ZeroPower) -> Result<(), Error> {
        let payload = [motor, mode as u8, u8::from(zero == ZeroPower::Float)];
        self.set(&format!("set the mode of motor {motor}"), 8, &payload)
    }

    /// Lets the motor run, or float.
    pub fn enable(&mut self, motor: u8, enabled: bool) -> Result<(), Error> {
        let verb = if enabled { "enable" } else { "disable" };
        self.set(&format!("{verb} motor {motor}"), 10, &[motor, u8::from(enabled)])
    }

    /// False if the motor floats.
    pub fn enabled(&mut self, motor: u8) -> Result<bool, Error> {
        let what = format!("tell the enable of motor {motor}");
        let data = self.get(&what, 11, &[motor])?;
        Ok(parse(&what, &data, Fields::u8)? != 0)
    }

    /// Here is 0.
    pub fn reset_encoder(&mut self, motor: u8) -> Result<(), Error> {
        self.set(&format!("reset the encoder of motor {motor}"), 14, &[motor])
    }

    /// Target of constant power: share of full duty, -32767 to 32767.
    pub fn set_power(&mut self, motor: u8, power: i16) -> Result<(), Error> {
        let [low, high] = power.to_le_bytes();
        self.set(&format!("set the power of motor {motor}"), 15, &[motor, low, high])
    }

    /// Target of regulated velocity, and the speed limit of regulated position, in counts per second.
    pub fn set_velocity(&mut self, motor: u8, cps: i16) -> Result<(), Error> {
        let [low, high] = cps.to_le_bytes();
        self.set(&format!("set the target velocity of motor {motor}"), 17, &[motor, low, high])
    }

    /// Target of regulated position: counts, reached within `tolerance` counts.
    pub fn set_position(&mut self, motor: u8, counts: i32, tolerance: u16) -> Result<(), Error> {
        let what = format!("set the target position of motor {motor}");
        let payload = [&[motor][..], &counts.to_le_bytes(), &tolerance.to_le_bytes()].concat();
        self.set(&what, 19, &payload)
    }

    /// Which motor it is, and how it is controlled; this hub's own firmware tells.
    pub fn setup(&mut self, motor: u8) -> Result<Setup, Error> {
        let what = format!("tell the set-up of motor {motor}");
        let id = self.own(&what, 1)?;
        let data = self.read(&what, id, &[motor])?;
        parse(&what, &data, Setup::read)
    }

    /// Says which motor it is, and how to control it. Its coefficients become those that go with it.
    pub fn set_up(&mut self, motor: u8, setup: Setup) -> Result<(), Error> {
        let what = format!("set up motor {motor}");
        let id = self.own(&what, 0)?;
        self.write(&what, id, &[&[motor][..], &setup.bytes()].concat()).map(drop)
    }

    /// A loop's coefficients.
    pub fn coefficients(&mut self, motor: u8, of: Loop) -> Result<Pidf, Error> {
        let what = format!("tell the coefficients of motor {motor}");
        let data = self.get(&what, 53, &[motor, number(of)])?;
        parse(&what, &data, |fields| {
            let mut next = || fields.i32().map(Coefficient::from_bits);
            Ok(Pidf { p: next()?, i: next()?, d: next()?, f: next()? })
        })
    }

    /// Sets a loop's coefficients.
    pub fn set_coefficients(&mut self, motor: u8, of: Loop, pidf: Pidf) -> Result<(), Error> {
        let what = format!("set the coefficients of motor {motor}");
        let mut payload = vec![motor, number(of)];
        for coefficient in [pidf.p, pidf.i, pidf.d, pidf.f] {
            payload.extend(coefficient.to_bits().to_le_bytes());
        }
        payload.push(PIDF);
        self.set(&what, 51, &payload)
    }
}

/// A loop is numbered by its mode.
const fn number(of: Loop) -> u8 {
    match of {
        Loop::Velocity => Mode::Velocity as u8,
        Loop::Position => Mode::Position as u8,
    }
}
