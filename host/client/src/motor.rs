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
//! // Without a battery no motor is enabled.
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

/// What a hub keeps of a motor for its host, as the host set it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorState {
    /// What regulates it.
    pub mode: RunMode,
    /// What zero means to it.
    pub zero_power: ZeroPower,
    /// It may run.
    pub enabled: bool,
    /// Target of constant power.
    pub power: Control,
    /// Target of regulated velocity, in counts per second.
    pub velocity: i16,
    /// Target of regulated position.
    pub position: Target,
}

impl<L: Read + Write> Session<L> {
    /// Everything that is kept of a motor.
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

    /// How the motor is regulated, and what zero means to it.
    pub fn set_mode(&mut self, motor: u8, mode: RunMode, zero_power: ZeroPower) -> Result<(), Error> {
        self.order(ToMotor::SetMode { mode, zero_power }.to(motor))
    }

    /// Lets the motor run, or float.
    pub fn enable(&mut self, motor: u8, on: bool) -> Result<(), Error> {
        self.order(ToMotor::SetEnable { on }.to(motor))
    }

    /// False if the motor floats.
    pub fn enabled(&mut self, motor: u8) -> Result<bool, Error> {
        self.ask(ToMotor::Enable.to(motor))
    }

    /// Here is 0.
    pub fn reset_encoder(&mut self, motor: u8) -> Result<(), Error> {
        self.order(ToMotor::ResetEncoder.to(motor))
    }

    /// Target of constant power: share of full duty.
    pub fn set_power(&mut self, motor: u8, power: Control) -> Result<(), Error> {
        self.order(ToMotor::SetPower { power }.to(motor))
    }

    /// Target of regulated velocity, and the speed limit of regulated position, in counts per second.
    pub fn set_velocity(&mut self, motor: u8, cps: i16) -> Result<(), Error> {
        self.order(ToMotor::SetVelocity { cps }.to(motor))
    }

    /// Target of regulated position: counts, reached within `tolerance` counts.
    pub fn set_position(&mut self, motor: u8, counts: i32, tolerance: u16) -> Result<(), Error> {
        self.order(ToMotor::SetPosition { target: Target { counts, tolerance } }.to(motor))
    }

    /// Which motor it is, and how it is controlled; this project's own firmware tells.
    pub fn setup(&mut self, motor: u8) -> Result<Setup, Error> {
        self.ask(ToSetup::Setup.to(motor))
    }

    /// Says which motor it is, and how to control it. Its coefficients become those that go with it.
    pub fn set_up(&mut self, motor: u8, setup: Setup) -> Result<(), Error> {
        self.order(ToSetup::SetUp { setup }.to(motor))
    }

    /// How it moves and may, as far as the hub knows; this project's own firmware tells.
    pub fn motion(&mut self, motor: u8) -> Result<Motion, Error> {
        self.ask(ToSetup::Motion.to(motor))
    }

    /// Says how it moves, and how it may.
    pub fn set_motion(&mut self, motor: u8, motion: Motion) -> Result<(), Error> {
        self.order(ToSetup::SetMotion { motion }.to(motor))
    }

    /// What protects it; this project's own firmware tells.
    pub fn protection(&mut self, motor: u8) -> Result<Protection, Error> {
        self.ask(ToSetup::Protection.to(motor))
    }

    /// How its bridge switches, and what that must be spared; this project's own firmware tells.
    pub fn timing(&mut self, motor: u8) -> Result<Timing, Error> {
        self.ask(ToSetup::Timing.to(motor))
    }

    /// Says how its bridge switches, and what that must be spared.
    pub fn set_timing(&mut self, motor: u8, timing: Timing) -> Result<(), Error> {
        self.order(ToSetup::SetTiming { timing }.to(motor))
    }

    /// How it and its bridge are: current, heat, what has switched it off; this project's own firmware tells.
    pub fn condition(&mut self, motor: u8) -> Result<Condition, Error> {
        self.ask(ToSetup::Condition.to(motor))
    }

    /// Says what protects it: what becomes of it at a fault, and when this host falls silent; what its winding stands.
    pub fn set_protection(&mut self, motor: u8, protection: Protection) -> Result<(), Error> {
        self.order(ToSetup::SetProtection { protection }.to(motor))
    }

    /// Makes the hub learn how an enabled motor that stands in constant power of 0 moves, within so many counts
    /// either way; returns how many it will take at most.
    pub fn identify(&mut self, motor: u8, travel_limit: u32) -> Result<u32, Error> {
        self.ask(ToSetup::Identify { travel_limit }.to(motor))
    }

    /// What came of that.
    pub fn identification(&mut self, motor: u8) -> Result<Identification, Error> {
        self.ask(ToSetup::Identification.to(motor))
    }

    /// A loop's coefficients.
    pub fn coefficients(&mut self, motor: u8, of: Loop) -> Result<Pidf, Error> {
        let Coefficients { pidf, .. } = self.ask(ToMotor::Pidf { of }.to(motor))?;
        Ok(pidf)
    }

    /// Sets a loop's coefficients.
    pub fn set_coefficients(&mut self, motor: u8, of: Loop, pidf: Pidf) -> Result<(), Error> {
        let coefficients = Coefficients { pidf, algorithm: Algorithm::Pidf };
        self.order(ToMotor::SetPidf { of, coefficients }.to(motor))
    }
}
