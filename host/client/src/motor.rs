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

use crate::clock::Instant;
use crate::error::none_if_unsupported;
use crate::{Error, KEEP_ALIVE, Session};
use motor_hub::braking::Winding;
use motor_hub::extension::report::Condition;
use motor_hub::extension::settings::{Group, MotorSettings, Values};
use motor_hub::extension::{MotorFunction, Request};
use motor_hub::motor::{Settings, ZeroPower};
use motor_hub::protocol::motor::{ChannelMode, Loop, LoopCoefficients, RunMode, Target, ToMotor};
use motor_hub::protocol::{CHANNELS, Nack};
use motor_hub::regulator::Dynamics;
use motor_hub::regulator::identify::Identification;
use motor_hub::units::Control;
use std::ops::RangeInclusive;
use std::time::Duration;

/// Largest constant current of a motor in amperes. The largest current limit of a motor has this value too, because its
/// field has 16 bits in mA.
pub const LARGEST_CURRENT_A: f64 = 65.535;

/// Largest speed limit of a constant current in counts per second. No motor reaches this speed, so it is no limit.
pub const NO_SPEED_LIMIT_CPS: u16 = i16::MAX.unsigned_abs();

/// Speed limits of a constant current and of a regulated position that this crate's users may request, in counts per
/// second.
pub const SPEED_LIMITS_CPS: RangeInclusive<u16> = 1..=NO_SPEED_LIMIT_CPS;

/// Text for a hub that regulates no current: [`Session::report`] returns `None` for such a hub.
pub const NO_CURRENT: &str = "the hub regulates no current: it is not a hub of this project, or its firmware is too old; use power, velocity or position";

/// Refusal of a hub that has no motor with the requested number: the first parameter is out of range.
pub const NO_SUCH_MOTOR: Nack = Nack::parameter(0);

/// A constant current is larger than [`LARGEST_CURRENT_A`], or is not a number.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("a current of {amperes} A is out of range; allowed is -{most} to {most} A", most = LARGEST_CURRENT_A)]
pub struct CurrentOutOfRange {
    /// The current in amperes.
    pub amperes: f64,
}

/// Converts a constant current from amperes to milliamperes, the unit of [`Session::set_current`].
///
/// # Errors
/// The current is out of range: see [`LARGEST_CURRENT_A`].
///
/// ```
/// use motor_hub_client::motor::constant_current_ma;
///
/// assert_eq!(constant_current_ma(-0.4), Ok(-400));
/// let refused = constant_current_ma(70.0).unwrap_err().to_string();
/// assert_eq!(refused, "a current of 70 A is out of range; allowed is -65.535 to 65.535 A");
/// ```
pub fn constant_current_ma(amperes: f64) -> Result<i32, CurrentOutOfRange> {
    if amperes.abs() <= LARGEST_CURRENT_A {
        Ok((1e3 * amperes).round() as i32)
    } else {
        Err(CurrentOutOfRange { amperes })
    }
}

/// Interval between two attempts to disable motors.
const RETRY: Duration = Duration::from_millis(10);

/// Mode, enable and targets of one motor, as a host has set them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorState {
    /// Constant power, regulated velocity or regulated position.
    pub mode: RunMode,
    /// What the motor does at power 0 or velocity 0: brake or float.
    pub zero_power: ZeroPower,
    /// True if the motor is enabled.
    pub enabled: bool,
    /// Target in constant power, as a share of full control.
    pub power: Control,
    /// Target in regulated velocity, in counts per second.
    pub velocity: i16,
    /// Target in regulated position, in counts.
    pub position: Target,
}

/// Set-point that a host gives to a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setpoint {
    /// Constant power as a share of full power.
    Power(Control),
    /// Constant current in mA, and a speed limit in counts per second: see [`Session::set_current`].
    Current {
        /// Current in mA.
        ma: i32,
        /// Speed limit in counts per second.
        speed_limit: u16,
    },
    /// Regulated velocity in counts per second.
    Velocity(i16),
    /// Regulated position.
    Position {
        /// Target in counts.
        counts: i32,
        /// Largest distance to the target, in counts, at which the motor is within tolerance.
        tolerance: u16,
        /// Speed limit in counts per second.
        speed_limit: i16,
    },
}

impl Session {
    /// Gives a motor a set-point and its mode. A disabled motor applies the set-point once it is enabled. For a constant
    /// current a disabled motor gets power 0, because a hub accepts a constant current for enabled motors only: call
    /// this function again once the motor is enabled.
    ///
    /// Each request takes effect immediately. The order of the requests prevents that an enabled motor follows an
    /// earlier target of the new mode, or takes a speed limit for a target.
    pub fn set_setpoint(
        &mut self,
        motor: u8,
        setpoint: Setpoint,
        zero_power: ZeroPower,
    ) -> Result<(), Error> {
        match setpoint {
            Setpoint::Power(power) => {
                self.set_power(motor, power)?;
                self.set_mode(motor, RunMode::Power, zero_power)
            }
            Setpoint::Current { ma, speed_limit } => {
                let enabled = self.enabled(motor)?;
                // A motor follows the target of its mode again when its constant current ends. So the mode must have
                // power 0 before the current starts.
                if !enabled || !self.has_power_zero(motor)? {
                    self.set_power(motor, Control::ZERO)?;
                    self.set_mode(motor, RunMode::Power, zero_power)?;
                }
                if enabled { self.set_current(motor, ma, speed_limit) } else { Ok(()) }
            }
            Setpoint::Velocity(cps) => {
                self.set_velocity(motor, cps)?;
                self.set_mode(motor, RunMode::Velocity, zero_power)
            }
            Setpoint::Position { counts, tolerance, speed_limit } => {
                // The speed limit is the target of mode velocity, so a motor in mode velocity gets it last.
                let had_velocity = self.mode(motor)?.mode == RunMode::Velocity;
                if !had_velocity {
                    self.set_velocity(motor, speed_limit)?;
                }
                self.set_position(motor, counts, tolerance)?;
                self.set_mode(motor, RunMode::Position, zero_power)?;
                if had_velocity { self.set_velocity(motor, speed_limit) } else { Ok(()) }
            }
        }
    }

    fn mode(&mut self, motor: u8) -> Result<ChannelMode, Error> {
        self.request(ToMotor::Mode.to(motor))
    }

    fn power(&mut self, motor: u8) -> Result<Control, Error> {
        self.request(ToMotor::Power.to(motor))
    }

    /// True if the motor is in mode power with power 0.
    fn has_power_zero(&mut self, motor: u8) -> Result<bool, Error> {
        Ok(self.mode(motor)?.mode == RunMode::Power && self.power(motor)? == Control::ZERO)
    }

    /// Disables motors that a former host has left enabled, and returns them. Without this call the motors would keep
    /// running, because every packet resets the hub's keep-alive. A line has one host at a time, so the host that
    /// enabled the motors is gone.
    pub fn disable_left_enabled(&mut self) -> Result<Vec<u8>, Error> {
        let mut found = Vec::new();
        for motor in 0..CHANNELS as u8 {
            // A hub with fewer motors refuses the request.
            let Some(enabled) = none_if_unsupported(self.enabled(motor))? else { break };
            if enabled {
                self.enable(motor, false)?;
                found.push(motor);
            }
        }
        Ok(found)
    }

    /// Disables motors. After an error all motors are tried again for 2.5 s, the time-out of the hub's keep-alive. An
    /// error of one motor does not prevent the attempt to disable the others.
    ///
    /// # Errors
    /// The first error of the last attempt. A closed connection ends the attempts.
    pub fn disable_all(&mut self, motors: &[u8]) -> Result<(), Error> {
        let end = Instant::now() + KEEP_ALIVE;
        loop {
            let disabled = motors.iter().map(|motor| self.enable(*motor, false)).fold(Ok(()), Result::and);
            match disabled {
                Err(error) if Instant::now() < end && !error.is_hung_up() => std::thread::sleep(RETRY),
                done => return done,
            }
        }
    }

    /// Selects constant power 0 with braking for a motor. An enabled motor then brakes.
    pub fn brake(&mut self, motor: u8) -> Result<(), Error> {
        self.set_power(motor, Control::ZERO)?;
        self.set_mode(motor, RunMode::Power, ZeroPower::Brake)
    }

    /// Mode, enable and all targets of a motor.
    pub fn motor(&mut self, motor: u8) -> Result<MotorState, Error> {
        let ChannelMode { mode, floats } = self.mode(motor)?;
        Ok(MotorState {
            mode,
            zero_power: if floats { ZeroPower::Float } else { ZeroPower::Brake },
            enabled: self.enabled(motor)?,
            power: self.power(motor)?,
            velocity: self.request(ToMotor::Velocity.to(motor))?,
            position: self.request(ToMotor::Position.to(motor))?,
        })
    }

    /// Sets the mode of a motor, and whether it brakes or floats at zero.
    pub fn set_mode(&mut self, motor: u8, mode: RunMode, zero_power: ZeroPower) -> Result<(), Error> {
        let mode = ChannelMode { mode, floats: zero_power == ZeroPower::Float };
        self.command(ToMotor::SetMode { mode }.to(motor))
    }

    /// Enables or disables a motor. A disabled motor floats.
    pub fn enable(&mut self, motor: u8, on: bool) -> Result<(), Error> {
        self.command(ToMotor::SetEnable { on }.to(motor))
    }

    /// True if the motor is enabled.
    pub fn enabled(&mut self, motor: u8) -> Result<bool, Error> {
        self.request(ToMotor::Enable.to(motor))
    }

    /// Makes the motor's present position 0 counts.
    pub fn reset_encoder(&mut self, motor: u8) -> Result<(), Error> {
        self.command(ToMotor::ResetEncoder.to(motor))
    }

    /// Sets the target of constant power.
    pub fn set_power(&mut self, motor: u8, power: Control) -> Result<(), Error> {
        self.command(ToMotor::SetPower { power }.to(motor))
    }

    /// Sets the target of regulated velocity, which is also the speed limit of regulated position, in counts per
    /// second.
    pub fn set_velocity(&mut self, motor: u8, cps: i16) -> Result<(), Error> {
        self.command(ToMotor::SetVelocity { cps }.to(motor))
    }

    /// Sets the target of regulated position, in counts. The motor is within tolerance if its distance to the target is
    /// at most `tolerance` counts.
    pub fn set_position(&mut self, motor: u8, counts: i32, tolerance: u16) -> Result<(), Error> {
        self.command(ToMotor::SetPosition { target: Target { counts, tolerance } }.to(motor))
    }

    /// Reads all settings of a motor except the coefficients of its loops, which [`coefficients`](Self::coefficients)
    /// reads. Needs this project's firmware.
    pub fn settings(&mut self, motor: u8) -> Result<MotorSettings, Error> {
        // The groups that the hub reports replace these initial values.
        let mut settings = MotorSettings::new(Settings::new(Winding::NEVEREST_60));
        for group in Group::without_coefficients() {
            match self.get(motor, group, &settings) {
                // Older firmware lacks groups of settings that were added later.
                Err(Error::TooOld { .. }) => (),
                read => settings = read?,
            }
        }
        Ok(settings)
    }

    /// Returns `settings`, with the values of one group replaced by the values that the hub reports. Older firmware may
    /// lack the last fields of a group, whose values in `settings` are then kept.
    ///
    /// # Errors
    /// [`Error::Unexpected`] if the values of the answer contradict each other. See also [`Session::request`].
    pub fn get(&mut self, motor: u8, group: Group, settings: &MotorSettings) -> Result<MotorSettings, Error> {
        let read = |payload: &[u8]| -> Result<MotorSettings, Nack> {
            Values::read_over(group, payload, settings)?.apply_to(settings)
        };
        self.request_with(Request::Get(motor, group), read)
    }

    /// Sends the values of one group in `settings` to the hub. With [`Group::SetUp`] the hub deletes the motion and the
    /// coefficients that a host has set.
    pub fn set(&mut self, motor: u8, group: Group, settings: &MotorSettings) -> Result<(), Error> {
        self.command(Request::Set(motor, Values::of(group, settings)))
    }

    /// Sends the set-up and then the motion, because the hub deletes the motion and a host's coefficients when it
    /// receives a set-up.
    pub fn set_up(&mut self, motor: u8, settings: &MotorSettings) -> Result<(), Error> {
        self.set(motor, Group::SetUp, settings)?;
        self.set(motor, Group::Motion, settings)
    }

    /// Sets the dynamics of a motor's model; `None` makes the motor an unknown motor. The hub deletes coefficients that
    /// a host has set, so the model regulates the motor.
    pub fn set_dynamics(&mut self, motor: u8, dynamics: Option<Dynamics>) -> Result<(), Error> {
        let mut settings = self.settings(motor)?;
        settings.motor.dynamics = dynamics;
        self.set_up(motor, &settings)
    }

    /// Current, heat and faults of the motor and its bridge. Needs this project's firmware.
    pub fn condition(&mut self, motor: u8) -> Result<Condition, Error> {
        self.request(MotorFunction::Condition.to(motor))
    }

    /// Sets a constant current in mA for an enabled motor; [`constant_current_ma`] converts from amperes and checks the
    /// range. The hub reduces the current at the speed limit in counts/s; [`NO_SPEED_LIMIT_CPS`] is no limit.
    /// Another target, or a mode, ends the constant current: the motor then follows the target of its mode.
    /// [`set_setpoint`](Self::set_setpoint) therefore selects power 0 first. Needs this project's firmware.
    pub fn set_current(&mut self, motor: u8, current_ma: i32, speed_limit_cps: u16) -> Result<(), Error> {
        self.command(MotorFunction::Current { current_ma, speed_limit_cps }.to(motor))
    }

    /// Starts an identification. The motor must be enabled, at rest, with a constant power of 0. The motor turns at
    /// most `travel_limit` counts in either direction. Returns the limit in counts that the hub applies, which may be
    /// smaller.
    pub fn identify(&mut self, motor: u8, travel_limit: u32) -> Result<u32, Error> {
        self.request(MotorFunction::Identify { travel_limit }.to(motor))
    }

    /// State or result of the last identification.
    pub fn identification(&mut self, motor: u8) -> Result<Identification, Error> {
        self.request(MotorFunction::Identification.to(motor))
    }

    /// Reads the coefficients of a loop.
    pub fn coefficients(&mut self, motor: u8, of: Loop) -> Result<LoopCoefficients, Error> {
        self.request(ToMotor::Pidf { of }.to(motor))
    }

    /// Sets the coefficients of a loop. PID then regulates the motor instead of the model.
    pub fn set_coefficients(
        &mut self,
        motor: u8,
        of: Loop,
        coefficients: LoopCoefficients,
    ) -> Result<(), Error> {
        self.command(ToMotor::SetPidf { of, coefficients }.to(motor))
    }
}
