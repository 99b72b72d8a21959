//! Commands to one motor, 0 to 3.
//!
//! ```
//! use motor_hub_client::motor_hub::motor::ZeroPower;
//! use motor_hub_client::motor_hub::protocol::{Address, motor::RunMode};
//! use motor_hub_client::motor_hub::units::Millivolts;
//! use motor_hub_client::{Session, memory::MemoryHub};
//! use std::time::Duration;
//!
//! let mut hub = MemoryHub::default();
//! // A hub enables no motor while its battery voltage is unknown.
//! hub.snapshot.battery = Some(Millivolts::new(12_000));
//! let mut session = Session::new(hub, Address::DEFAULT, Duration::from_secs(1));
//! session.set_mode(0, RunMode::Velocity, ZeroPower::Brake)?;
//! session.set_velocity(0, 500)?; // encoder counts per second
//! session.enable(0, true)?;
//! let state = session.motor(0)?;
//! assert!(state.enabled);
//! assert_eq!(state.velocity, 500);
//! # Ok::<(), motor_hub_client::Error>(())
//! ```

use crate::{Error, Session};
use motor_hub::bridge::Timing;
use motor_hub::motion::Pidf;
use motor_hub::motor::ZeroPower;
use motor_hub::protocol::motor::{Algorithm, ChannelMode, Coefficients, Loop, RunMode, Target, ToMotor};
use motor_hub::protocol::setup::{Condition, Motion, Protection, Setup, ToSetup};
use motor_hub::regulator::identify::Identification;
use motor_hub::units::Control;
use std::io::{Read, Write};

/// Mode, enable and targets of one motor, as a host has set them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorState {
    /// Constant power, regulated velocity or regulated position.
    pub mode: RunMode,
    /// Whether the motor brakes or floats at zero.
    pub zero_power: ZeroPower,
    /// True if the motor is enabled.
    pub enabled: bool,
    /// Target in constant power.
    pub power: Control,
    /// Target in regulated velocity, in counts per second.
    pub velocity: i16,
    /// Target in regulated position, in counts.
    pub position: Target,
}

impl<L: Read + Write> Session<L> {
    /// Mode, enable and all targets of a motor.
    ///
    /// # Errors
    /// See [`Session::ask`], as for all commands.
    pub fn motor(&mut self, motor: u8) -> Result<MotorState, Error> {
        let ChannelMode { mode, zero_power } = self.ask(ToMotor::Mode.to(motor))?;
        Ok(MotorState {
            mode,
            zero_power,
            enabled: self.enabled(motor)?,
            power: self.ask(ToMotor::Power.to(motor))?,
            velocity: self.ask(ToMotor::Velocity.to(motor))?,
            position: self.ask(ToMotor::Position.to(motor))?,
        })
    }

    /// Sets the mode of a motor, and whether it brakes or floats at zero.
    pub fn set_mode(&mut self, motor: u8, mode: RunMode, zero_power: ZeroPower) -> Result<(), Error> {
        self.order(ToMotor::SetMode { mode, zero_power }.to(motor))
    }

    /// Enables or disables a motor. A disabled motor floats.
    pub fn enable(&mut self, motor: u8, on: bool) -> Result<(), Error> {
        self.order(ToMotor::SetEnable { on }.to(motor))
    }

    /// True if the motor is enabled.
    pub fn enabled(&mut self, motor: u8) -> Result<bool, Error> {
        self.ask(ToMotor::Enable.to(motor))
    }

    /// Makes the motor's present position 0 counts.
    pub fn reset_encoder(&mut self, motor: u8) -> Result<(), Error> {
        self.order(ToMotor::ResetEncoder.to(motor))
    }

    /// Sets the target of constant power.
    pub fn set_power(&mut self, motor: u8, power: Control) -> Result<(), Error> {
        self.order(ToMotor::SetPower { power }.to(motor))
    }

    /// Sets the target of regulated velocity, which is also the speed limit of regulated position, in counts per second.
    pub fn set_velocity(&mut self, motor: u8, cps: i16) -> Result<(), Error> {
        self.order(ToMotor::SetVelocity { cps }.to(motor))
    }

    /// Sets the target of regulated position, in counts. The motor is within tolerance if its distance to the target is at
    /// most `tolerance` counts.
    pub fn set_position(&mut self, motor: u8, counts: i32, tolerance: u16) -> Result<(), Error> {
        self.order(ToMotor::SetPosition { target: Target { counts, tolerance } }.to(motor))
    }

    /// Configured motor constants, scheme and duty rule. Needs this project's firmware.
    pub fn setup(&mut self, motor: u8) -> Result<Setup, Error> {
        self.ask(ToSetup::Setup.to(motor))
    }

    /// Configures motor constants, scheme and duty rule. The coefficients become the defaults of that motor.
    pub fn set_up(&mut self, motor: u8, setup: Setup) -> Result<(), Error> {
        self.order(ToSetup::SetUp { setup }.to(motor))
    }

    /// Configured dynamics and acceleration limit. Needs this project's firmware.
    pub fn motion(&mut self, motor: u8) -> Result<Motion, Error> {
        self.ask(ToSetup::Motion.to(motor))
    }

    /// Configures dynamics and acceleration limit.
    pub fn set_motion(&mut self, motor: u8, motion: Motion) -> Result<(), Error> {
        self.order(ToSetup::SetMotion { motion }.to(motor))
    }

    /// Configured behaviour at faults, and thermal limit. Needs this project's firmware.
    pub fn protection(&mut self, motor: u8) -> Result<Protection, Error> {
        self.ask(ToSetup::Protection.to(motor))
    }

    /// Configured timing of the motor's bridge. Needs this project's firmware.
    pub fn timing(&mut self, motor: u8) -> Result<Timing, Error> {
        self.ask(ToSetup::Timing.to(motor))
    }

    /// Configures the timing of the motor's bridge, which limits its duties.
    pub fn set_timing(&mut self, motor: u8, timing: Timing) -> Result<(), Error> {
        self.order(ToSetup::SetTiming { timing }.to(motor))
    }

    /// Current, heat and faults of the motor and its bridge. Needs this project's firmware.
    pub fn condition(&mut self, motor: u8) -> Result<Condition, Error> {
        self.ask(ToSetup::Condition.to(motor))
    }

    /// Configures the motor's protection: whether it coasts or brakes at a fault or when the host is silent, and its
    /// thermal limit.
    pub fn set_protection(&mut self, motor: u8, protection: Protection) -> Result<(), Error> {
        self.order(ToSetup::SetProtection { protection }.to(motor))
    }

    /// Starts an identification. The motor must be enabled, at rest, with a constant power of 0. It turns at most
    /// `travel_limit` counts either way. Returns the limit in counts that the hub applies.
    pub fn identify(&mut self, motor: u8, travel_limit: u32) -> Result<u32, Error> {
        self.ask(ToSetup::Identify { travel_limit }.to(motor))
    }

    /// State or result of the last identification.
    pub fn identification(&mut self, motor: u8) -> Result<Identification, Error> {
        self.ask(ToSetup::Identification.to(motor))
    }

    /// The coefficients of a loop.
    pub fn coefficients(&mut self, motor: u8, of: Loop) -> Result<Pidf, Error> {
        let Coefficients { pidf, .. } = self.ask(ToMotor::Pidf { of }.to(motor))?;
        Ok(pidf)
    }

    /// Sets the coefficients of a loop.
    pub fn set_coefficients(&mut self, motor: u8, of: Loop, pidf: Pidf) -> Result<(), Error> {
        let coefficients = Coefficients { pidf, algorithm: Algorithm::Pidf };
        self.order(ToMotor::SetPidf { of, coefficients }.to(motor))
    }
}
