//! What the hub stores of one motor for the host, and the commands to the motor that follow.
//!
//! The host's counts are the motor's counts less an offset, which *reset encoder* sets. Targets are stored as the host sent
//! them, so after *reset encoder* a target is a position in the new counts.
//!
//! ```text
//!           set enable, with a target and a good battery
//! disabled ---------------------------------------------> enabled
//!    ^  ^ ^---- disable, fail-safe: release is pending ------|
//!    |  '------ host silent: release as the settings say ----'
//! ```
//!
//! ```
//! use motor_hub::braking::Winding;
//! use motor_hub::motor::{Report, Settings};
//! use motor_hub::protocol::motor::ToMotor;
//! use motor_hub::responder::motor::MotorChannel;
//!
//! let mut channel = MotorChannel::new(Settings::new(Winding::NEVEREST_60));
//! let report = Report { position: 40, ..Report::INITIAL };
//! channel.receive(ToMotor::ResetEncoder, &report, true)?;
//! assert_eq!(channel.counts(&Report { position: 45, ..report }), 5);
//! # Ok::<(), motor_hub::protocol::Nack>(())
//! ```

use super::report::magnitude;
use crate::extension::settings::{MotorSettings, Values};
use crate::hub::Action;
use crate::motor::{self, OnFault, Report, Setpoint, Settings};
use crate::protocol::motor::{Algorithm, Coefficients, RunMode, Target, ToMotor};
use crate::protocol::{Nack, Reply};
use crate::regulator::identify::{Identification, travel};
use crate::units::{Coefficient, Control, CountsPerSecond, Milliamperes, Millivolts, is_included};

/// The speed limit towards a position in counts per second, until a host sets a velocity: the largest velocity that a host
/// can set.
pub const SPEED_LIMIT: i16 = i16::MAX;

/// The longest distance to a target, in counts: half of the ring of counts, less 2^24 counts. A load may push the motor back
/// by 2^24 counts before the other way round is shorter.
const LONGEST_DISTANCE: i32 = i32::MAX - (1 << 24);

/// One motor channel.
#[derive(Clone, Debug)]
pub struct MotorChannel {
    settings: MotorSettings,
    enabled: bool,
    /// Targets by mode; `None` until a host sets one.
    power: Option<Control>,
    velocity: Option<i16>,
    position: Option<Target>,
    /// An identification or a constant current, until another request of the host ends it.
    function: Option<Setpoint>,
    /// True if a group's course has replaced the motor's own target.
    in_group: bool,
    /// Number of the newest command with a set-point or a course, while no snapshot includes that command.
    awaited: Option<u32>,
    /// The motor's counts where the host's counts are 0.
    offset: i32,
    /// The motor's counts at the host's last request to the motor.
    last_position: i32,
    pending: Pending,
}

/// Commands that the motor has not received yet, in the order in which it receives them. A newer target replaces a pending
/// target. A release is always sent, because a release ends faults.
#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    release: Option<Release>,
    configure: bool,
    set: bool,
}

/// Why a motor is released.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Release {
    /// A host has disabled the motor.
    Disabled,
    /// The host is silent, and the settings say what the motor does.
    FailSafe,
}

impl MotorChannel {
    /// A disabled motor in open loop without targets, which starts with `settings`.
    pub const fn new(settings: Settings) -> Self {
        Self {
            settings: MotorSettings::new(settings),
            enabled: false,
            power: None,
            velocity: None,
            position: None,
            function: None,
            in_group: false,
            awaited: None,
            offset: 0,
            last_position: 0,
            pending: Pending { release: None, configure: false, set: false },
        }
    }

    /// Executes a request. `battery_good` allows enabling.
    ///
    /// # Errors
    /// The reason of a refusal; nothing has changed then.
    pub fn receive(&mut self, request: ToMotor, report: &Report, battery_good: bool) -> Result<Reply, Nack> {
        self.last_position = report.position;
        match request {
            ToMotor::SetMode { mode } => {
                self.settings.set_channel_mode(mode);
                self.pending.configure = true;
                self.retarget();
            }
            ToMotor::SetEnable { on: false } => self.disable(),
            ToMotor::SetEnable { on: true } => self.enable(battery_good)?,
            ToMotor::SetCurrentAlert { milliamperes } => self.settings.current_alert_ma = milliamperes,
            ToMotor::ResetEncoder => {
                self.offset = report.position;
                self.retarget();
            }
            ToMotor::SetPower { power } => {
                self.power = Some(power);
                self.retarget();
            }
            ToMotor::SetVelocity { cps } => {
                self.velocity = Some(cps);
                self.retarget();
            }
            ToMotor::SetPosition { target } => {
                self.position = Some(target);
                self.retarget();
            }
            ToMotor::SetPid { of, p, i, d } => {
                let algorithm = Algorithm::Legacy;
                self.settings.set_coefficients(of, Coefficients { p, i, d, f: Coefficient::ZERO, algorithm });
                self.pending.configure = true;
            }
            ToMotor::SetPidf { of, coefficients } => {
                self.settings.set_coefficients(of, coefficients);
                self.pending.configure = true;
            }
            ToMotor::Mode => return Ok(Reply::data(&self.settings.channel_mode())),
            ToMotor::Enable => return Ok(Reply::data(&self.enabled)),
            ToMotor::CurrentAlert => return Ok(Reply::data(&self.settings.current_alert_ma)),
            ToMotor::Power => return Ok(Reply::data(&self.power.unwrap_or_default())),
            ToMotor::Velocity => return Ok(Reply::data(&self.velocity.unwrap_or_default())),
            ToMotor::Position => return Ok(Reply::data(&self.position.unwrap_or_default())),
            ToMotor::AtTarget if self.settings.mode != RunMode::Position => return Err(Nack::WRONG_MODE),
            ToMotor::AtTarget => return Ok(Reply::data(&self.within_tolerance(report))),
            ToMotor::Encoder => return Ok(Reply::data(&self.counts(report))),
            ToMotor::Pidf { of } => return Ok(Reply::data(&self.settings.coefficients(of))),
            ToMotor::Pid { of } => {
                let Coefficients { p, i, d, f, .. } = self.settings.coefficients(of);
                if f != Coefficient::ZERO {
                    // P, I and D alone would be wrong; after a refusal hosts ask for all four coefficients.
                    return Err(Nack::parameter(2));
                }
                return Ok(Reply::data(&[p, i, d]));
            }
        }
        Ok(Reply::ACK)
    }

    /// Sets a group of settings.
    ///
    /// # Errors
    /// The number of a field that does not go with the other fields; nothing has changed then.
    pub fn set(&mut self, values: &Values) -> Result<(), Nack> {
        self.settings = values.put(&self.settings)?;
        self.pending.configure = true;
        Ok(())
    }

    /// Starts an identification. `battery` is the battery voltage if motors may be enabled. Returns the counts that the motor
    /// will turn at most.
    ///
    /// # Errors
    /// The battery is low, or the motor is not enabled in constant power of 0.
    pub fn identify(&mut self, travel_limit: u32, battery: Option<Millivolts>) -> Result<u32, Nack> {
        let battery = battery.ok_or(Nack::BATTERY_LOW)?;
        if !self.enabled || self.settings.mode != RunMode::Power || self.power != Some(Control::ZERO) {
            return Err(Nack::WRONG_MODE);
        }
        self.retarget();
        self.function = Some(Setpoint::Identify { travel_limit });
        Ok(travel(self.settings.motor.winding.emf, battery, travel_limit))
    }

    /// State or result of the last requested identification.
    pub fn identification(&self, report: &Report) -> Identification {
        if matches!(self.function, Some(Setpoint::Identify { .. })) && self.awaits_snapshot() {
            // The report is older than the identification.
            return Identification::Running(0);
        }
        report.identification
    }

    /// Gives the motor a constant current.
    ///
    /// # Errors
    /// The motor is not enabled.
    pub fn set_current(&mut self, current: Milliamperes, speed_limit: CountsPerSecond) -> Result<(), Nack> {
        if !self.enabled {
            return Err(Nack::WRONG_MODE);
        }
        self.retarget();
        self.function = Some(Setpoint::Current { current, speed_limit });
        Ok(())
    }

    fn enable(&mut self, battery_good: bool) -> Result<(), Nack> {
        if self.target().is_none() {
            return Err(Nack::NOT_CONFIGURED);
        }
        if !battery_good {
            return Err(Nack::BATTERY_LOW);
        }
        self.enabled = true;
        self.retarget();
        Ok(())
    }

    /// Disables the motor: its bridge opens. Mode, targets and settings are kept.
    pub const fn disable(&mut self) {
        self.enabled = false;
        self.release(Release::Disabled);
    }

    /// Disables the motor because the host is silent: the motor does what its settings say of a fault. A motor that brakes
    /// already goes on braking.
    pub fn fail_safe(&mut self) {
        match self.settings.motor.on_fault {
            OnFault::Coast => self.disable(),
            OnFault::Brake if self.enabled => {
                self.enabled = false;
                self.release(Release::FailSafe);
            }
            OnFault::Brake => (),
        }
    }

    const fn release(&mut self, release: Release) {
        self.function = None;
        self.in_group = false;
        self.pending.release = Some(release);
        self.pending.set = false;
    }

    /// Ends an identification or a constant current, and sends the present target to an enabled motor.
    const fn retarget(&mut self) {
        self.function = None;
        self.in_group = false;
        self.pending.set = self.enabled;
    }

    /// The set-point of the present mode; `None` if no host has set its target.
    fn target(&self) -> Option<Setpoint> {
        if self.function.is_some() {
            return self.function;
        }
        match self.settings.mode {
            RunMode::Power => self.power.map(Setpoint::ConstantPower),
            RunMode::Velocity => {
                self.velocity.map(|cps| Setpoint::Velocity(CountsPerSecond::new(cps.into())))
            }
            RunMode::Position => self.position.map(|Target { counts, tolerance }| {
                let speed_limit = i32::from(self.velocity.unwrap_or(SPEED_LIMIT)).abs();
                Setpoint::Position {
                    target: self.goal(counts, self.last_position),
                    tolerance,
                    speed_limit: CountsPerSecond::new(speed_limit),
                }
            }),
        }
    }

    /// The next command to the motor; [`sent`](Self::sent) when it has been sent.
    pub fn pending(&self) -> Option<Action> {
        if let Some(release) = self.pending.release {
            Some(Action::Set(match release {
                Release::Disabled => Setpoint::Disabled,
                Release::FailSafe => Setpoint::FailSafe,
            }))
        } else if self.pending.configure {
            Some(Action::Configure(self.settings.motor))
        } else if self.pending.set {
            // An enabled motor that is switched to a mode without a target floats until a host sets one.
            Some(Action::Set(self.target().unwrap_or_default()))
        } else {
            None
        }
    }

    /// Notes that the command in [`pending`](Self::pending) has been sent with this number.
    pub const fn sent(&mut self, number: u32) {
        if self.pending.release.is_some() {
            self.pending.release = None;
            self.awaited = Some(number);
        } else if self.pending.configure {
            self.pending.configure = false;
        } else {
            self.pending.set = false;
            self.awaited = Some(number);
        }
    }

    /// Notes that a course of the motor's group has been sent as the command of this number.
    pub(super) const fn course_sent(&mut self, number: u32) {
        self.awaited = Some(number);
    }

    /// Takes the number of the newest command that the newest snapshot includes.
    pub(super) fn note_snapshot(&mut self, commands: u32) {
        self.awaited.take_if(|number| is_included(*number, commands));
    }

    /// True while no snapshot includes the motor's newest set-point or course. Reports of the motor's set-point are out of
    /// date then.
    pub(super) const fn awaits_snapshot(&self) -> bool {
        self.has_new_target() || self.awaited.is_some()
    }

    /// True if a group's course has replaced the motor's own target.
    pub(super) const fn in_group(&self) -> bool {
        self.in_group
    }

    /// True if a release is pending, which goes before the commands of other motors.
    pub const fn urgent(&self) -> bool {
        self.pending.release.is_some()
    }

    /// Takes a group's course in place of the motor's own target.
    pub(super) const fn join(&mut self) {
        self.pending.set = false;
        self.in_group = true;
    }

    /// True if a release or a target of the motor's own is pending.
    pub(super) const fn has_new_target(&self) -> bool {
        self.pending.set || self.urgent()
    }

    /// The motor's counts of a host's target, for a motor at `position`.
    ///
    /// The motor takes the short way round the ring of its counts. A target ahead of the motor by the host's counts is limited
    /// to the distance that is still ahead on the ring. Only across the ends of the host's counts, where they jump, the short
    /// way is the way that the host means.
    pub(super) fn goal(&self, counts: i32, position: i32) -> i32 {
        let from = self.host_counts(position);
        let short_way = counts.wrapping_sub(from);
        let across_the_ends = counts.checked_sub(from).is_none() && short_way.unsigned_abs() < 1 << 30;
        let distance = if across_the_ends { short_way } else { counts.saturating_sub(from) };
        position.wrapping_add(distance.clamp(-LONGEST_DISTANCE, LONGEST_DISTANCE))
    }

    /// The settings in force.
    pub const fn settings(&self) -> &MotorSettings {
        &self.settings
    }

    /// Replaces the settings of a motor that is off. Targets and the offset of the host's counts are kept.
    pub(super) const fn restore(&mut self, settings: MotorSettings) {
        self.settings = settings;
        self.pending.configure = true;
    }

    /// True from a valid *set enable* until a host disables the motor or fail-safe does.
    pub const fn enabled(&self) -> bool {
        self.enabled
    }

    /// True if the current, measured or modelled, exceeds the host's current alert.
    pub fn is_over_current(&self, report: &Report) -> bool {
        let level = self.settings.current_alert_ma;
        level != 0 && magnitude(report.best_current()) > level
    }

    /// The motor's position in the host's counts.
    pub const fn counts(&self, report: &Report) -> i32 {
        self.host_counts(report.position)
    }

    /// The host's counts of a position in the motor's counts.
    pub(super) const fn host_counts(&self, counts: i32) -> i32 {
        counts.wrapping_sub(self.offset)
    }

    /// True if the motor is enabled in position mode, in no group, and [within tolerance](motor::within_tolerance) of the
    /// host's target.
    pub fn within_tolerance(&self, report: &Report) -> bool {
        let near =
            |Target { counts, tolerance }| motor::within_tolerance(counts, self.counts(report), tolerance);
        let regulated = self.enabled && !self.in_group && self.settings.mode == RunMode::Position;
        regulated && self.position.is_some_and(near)
    }
}
