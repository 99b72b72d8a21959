//! A *channel*: the settings and targets that hosts have set for one motor, and the commands that follow from them.
//!
//! * The *host's counts* are the motor's counts minus an offset. *Reset encoder* sets the offset so that the present
//!   position is 0. Targets are stored in the host's counts, so a target means another position after *reset encoder*.
//! * A *release* is a command that ends the motor's motion: disable, or fail-safe with braking.
//!
//! ```text
//!                 set enable, with a target                        a group's course
//!                 and a good battery                               with this motor
//! [Disabled] -------------------------------> [OwnSetpoint] ---------------------------> [InGroup]
//!     ^                                           |   ^                                    |  |
//!     |                                           |   '--- new mode, target or override ---'  |
//!     '--------------- release -------------------+-------------------------------------------'
//! ```
//!
//! *Reset encoder* also takes a motor out of a group. *Set enable* changes nothing of an enabled motor, because hosts
//! repeat it. An *override* is a set-point that replaces the target of the mode: an identification, a constant current,
//! or the halt of a group. A group halts in this way if a member leaves before the group's course was sent.
//!
//! If a host disables the motor, also by its request *fail-safe*, the release is [`Setpoint::Disabled`]. If the host is
//! silent, the setting [`OnFault`] decides: with [`OnFault::Coast`] the release is [`Setpoint::Disabled`], and with
//! [`OnFault::Brake`] it is [`Setpoint::FailSafe`].

use crate::extension::settings::{MotorSettings, Values};
use crate::hub::Command;
use crate::motor::{self, OnFault, Report, Setpoint, Settings};
use crate::protocol::motor::{LoopCoefficients, RunMode, Target, Terms, ToMotor};
use crate::protocol::{Nack, Reply};
use crate::regulator::identify::{Identification, travel};
use crate::units::{Coefficient, Control, CountsPerSecond, Milliamperes, Millivolts, is_included};

/// Speed limit on the way to a position, in counts per second, until a host sets a velocity. It is the largest velocity
/// that a host can set.
const SPEED_LIMIT: i16 = i16::MAX;

/// Longest distance to a target, in counts.
///
/// Counts wrap at 2^32, and the motor takes the shorter way to its target. This distance is 2^24 counts less than half
/// of 2^32. So a load may push the motor back by 2^24 counts before the other way is shorter.
const LONGEST_DISTANCE: i32 = i32::MAX - (1 << 24);

/// The settings, targets and pending commands of one motor.
#[derive(Clone, Debug)]
pub(super) struct MotorChannel {
    settings: MotorSettings,
    state: MotorState,
    /// Target of mode power. `None` until a host sets the target.
    power: Option<Control>,
    /// Target of mode velocity in counts per second, and speed limit of mode position. `None` until a host sets the
    /// velocity.
    velocity: Option<i16>,
    /// Target of mode position in the host's counts. `None` until a host sets the target.
    position: Option<Target>,
    /// Number of the command with the newest sent set-point or course. `None` once a snapshot includes the command.
    awaited: Option<u32>,
    /// The motor's counts where the host's counts are 0.
    offset: i32,
    /// The motor's counts at the last request of REV's protocol to this motor. A target is converted to a distance from
    /// this position.
    last_position: i32,
    /// A release that must be sent: the motor then coasts or brakes. A release is sent also to a disabled motor, because
    /// a release clears latched faults.
    release_due: Option<OnFault>,
    /// True if the settings must be sent.
    settings_due: bool,
}

/// What moves a motor. Only a valid *set enable* ends the state `Disabled`.
#[derive(Clone, Copy, Debug)]
enum MotorState {
    /// Nothing moves the motor.
    Disabled,
    /// The motor has its own set-point.
    OwnSetpoint {
        /// An identification, a constant current or the halt of a group, which replaces the target of the mode. `None`
        /// for the target of the mode.
        override_setpoint: Option<Setpoint>,
        /// True if the set-point must be sent. The set-point is computed when the command is sent, not when the request
        /// arrives.
        due: bool,
    },
    /// A group's course moves the motor.
    InGroup,
}

impl MotorState {
    /// An enabled motor with the target of its mode, which must be sent.
    ///
    /// *Set enable* of a disabled motor leads to this state, and so do a new mode and a new target of the present mode,
    /// which end an override and a course. *Reset encoder* ends a course.
    const NEW_TARGET: Self = Self::OwnSetpoint { override_setpoint: None, due: true };
}

impl MotorChannel {
    /// Creates the channel of a disabled motor with these settings, in mode power and without targets.
    pub(super) const fn new(settings: Settings) -> Self {
        Self {
            settings: MotorSettings::new(settings),
            state: MotorState::Disabled,
            power: None,
            velocity: None,
            position: None,
            awaited: None,
            offset: 0,
            last_position: 0,
            release_due: None,
            settings_due: false,
        }
    }

    /// Executes a request of REV's protocol. The motor can only be enabled if `battery_good` is true.
    ///
    /// # Errors
    /// Returns why the request is refused. The settings and targets have not changed then.
    pub(super) fn receive(
        &mut self,
        request: ToMotor,
        report: &Report,
        battery_good: bool,
    ) -> Result<Reply, Nack> {
        self.last_position = report.position;
        match request {
            ToMotor::SetMode { mode } => {
                self.settings.set_channel_mode(mode);
                self.settings_due = true;
                self.follow(MotorState::NEW_TARGET);
            }
            ToMotor::SetEnable { on: false } => self.disable(),
            ToMotor::SetEnable { on: true } => self.enable(battery_good)?,
            ToMotor::SetCurrentAlert { milliamperes } => self.settings.current_alert_ma = milliamperes,
            ToMotor::ResetEncoder => {
                self.offset = report.position;
                if self.override_setpoint().is_none() {
                    self.follow(MotorState::NEW_TARGET);
                }
            }
            ToMotor::SetPower { power } => {
                self.power = Some(power);
                self.follow_target(&[RunMode::Power]);
            }
            ToMotor::SetVelocity { cps } => {
                self.velocity = Some(cps);
                self.follow_target(&[RunMode::Velocity, RunMode::Position]);
            }
            ToMotor::SetPosition { target } => {
                self.position = Some(target);
                self.follow_target(&[RunMode::Position]);
            }
            ToMotor::SetPid { of, p, i, d } => {
                let terms = Terms::Pid;
                self.settings.set_coefficients(of, LoopCoefficients { p, i, d, f: Coefficient::ZERO, terms });
                self.settings_due = true;
            }
            ToMotor::SetPidf { of, coefficients } => {
                self.settings.set_coefficients(of, coefficients);
                self.settings_due = true;
            }
            ToMotor::Mode => return Ok(Reply::data(&self.settings.channel_mode())),
            ToMotor::Enable => return Ok(Reply::data(&self.enabled())),
            ToMotor::CurrentAlert => return Ok(Reply::data(&self.settings.current_alert_ma)),
            ToMotor::Power => return Ok(Reply::data(&self.power.unwrap_or_default())),
            ToMotor::Velocity => return Ok(Reply::data(&self.velocity.unwrap_or_default())),
            ToMotor::Position => return Ok(Reply::data(&self.position.unwrap_or_default())),
            ToMotor::AtTarget if self.settings.mode != RunMode::Position => return Err(Nack::WRONG_MODE),
            ToMotor::AtTarget => return Ok(Reply::data(&self.within_tolerance(report))),
            ToMotor::Encoder => return Ok(Reply::data(&self.counts(report))),
            ToMotor::Pidf { of } => return Ok(Reply::data(&self.settings.coefficients(of))),
            ToMotor::Pid { of } => {
                let LoopCoefficients { p, i, d, f, .. } = self.settings.coefficients(of);
                if f != Coefficient::ZERO {
                    // With feed-forward, P, I and D alone would not describe the loop. After a refusal hosts ask for
                    // PIDF.
                    return Err(Nack::parameter(2));
                }
                return Ok(Reply::data(&[p, i, d]));
            }
        }
        Ok(Reply::ACK)
    }

    /// Sets the settings of one group.
    ///
    /// # Errors
    /// Refuses values that do not fit the other settings, see [`Values::apply_to`].
    pub(super) fn set(&mut self, values: &Values) -> Result<(), Nack> {
        self.settings = values.apply_to(&self.settings)?;
        self.settings_due = true;
        Ok(())
    }

    /// Starts an identification, in which the motor stays within `travel_limit` counts of where it starts. Returns the
    /// largest number of counts that the motor will turn. `battery` is `None` while the battery is low or unknown.
    ///
    /// A repeated request has no further effect while the identification runs. The present battery voltage would give
    /// another travel than the first request, so a running identification with at most the requested travel counts as
    /// the same.
    ///
    /// # Errors
    /// Refuses the request if the battery is low or unknown, or if the motor is not enabled in mode power with power 0.
    pub(super) fn identify(
        &mut self,
        travel_limit: u32,
        battery: Option<Millivolts>,
        report: &Report,
    ) -> Result<u32, Nack> {
        if let Some(Setpoint::Identify { travel_limit: announced }) = self.override_setpoint()
            && announced <= travel_limit
            && matches!(self.identification(report), Identification::Running(_))
        {
            return Ok(announced);
        }
        let battery = battery.ok_or(Nack::BATTERY_LOW)?;
        if !self.enabled() || self.settings.mode != RunMode::Power || self.power != Some(Control::ZERO) {
            return Err(Nack::WRONG_MODE);
        }
        // A hot motor would compute a longer travel, because its back EMF constant in force is lower. So the announced
        // travel becomes the limit.
        let announced = travel(self.settings.motor.winding.emf, battery, travel_limit);
        self.start(Setpoint::Identify { travel_limit: announced });
        Ok(announced)
    }

    /// Returns the state or the result of the last identification that a host has requested.
    pub(super) fn identification(&self, report: &Report) -> Identification {
        if matches!(self.override_setpoint(), Some(Setpoint::Identify { .. })) && self.awaits_snapshot() {
            // The report is older than the identification.
            return Identification::Running(0);
        }
        report.identification
    }

    /// Regulates the motor to a constant current, up to a speed limit.
    ///
    /// # Errors
    /// Refuses the request if the motor is not enabled.
    pub(super) fn set_current(
        &mut self,
        current: Milliamperes,
        speed_limit: CountsPerSecond,
    ) -> Result<(), Nack> {
        if !self.enabled() {
            return Err(Nack::WRONG_MODE);
        }
        self.start(Setpoint::Current { current, speed_limit });
        Ok(())
    }

    fn enable(&mut self, battery_good: bool) -> Result<(), Nack> {
        if self.target().is_none() {
            return Err(Nack::NOT_CONFIGURED);
        }
        if !battery_good {
            return Err(Nack::BATTERY_LOW);
        }
        if !self.enabled() {
            self.state = MotorState::NEW_TARGET;
        }
        Ok(())
    }

    /// Disables the motor, so its bridge opens. Mode, targets and settings do not change.
    pub(super) const fn disable(&mut self) {
        self.release(OnFault::Coast);
    }

    /// Disables the motor because the keep-alive timer has run out. The motor then coasts or brakes according to its
    /// setting `on_fault`. If the setting is brake, a motor that is already disabled keeps its present command, which
    /// may be the brake of an earlier fail-safe.
    pub(super) fn fail_safe(&mut self) {
        match self.settings.motor.on_fault {
            OnFault::Brake if !self.enabled() => (),
            on_fault => self.release(on_fault),
        }
    }

    /// Disables the motor, and makes a release pending.
    const fn release(&mut self, release: OnFault) {
        self.state = MotorState::Disabled;
        self.release_due = Some(release);
    }

    /// Changes what moves the motor. A disabled motor stays disabled.
    const fn follow(&mut self, state: MotorState) {
        if self.enabled() {
            self.state = state;
        }
    }

    /// Follows a new target, if the motor is in one of these modes. A target of another mode waits for its mode.
    fn follow_target(&mut self, modes: &[RunMode]) {
        if modes.contains(&self.settings.mode) {
            self.follow(MotorState::NEW_TARGET);
        }
    }

    /// Replaces the target of the mode by an identification, a constant current or the halt of a group.
    pub(super) const fn start(&mut self, override_setpoint: Setpoint) {
        self.follow(MotorState::OwnSetpoint { override_setpoint: Some(override_setpoint), due: true });
    }

    /// Returns the set-point that replaces the target of the mode.
    const fn override_setpoint(&self) -> Option<Setpoint> {
        match self.state {
            MotorState::OwnSetpoint { override_setpoint, .. } => override_setpoint,
            MotorState::Disabled | MotorState::InGroup => None,
        }
    }

    /// Returns the motor's own set-point: the override, or the target of the present mode.
    /// `None` if no host has set a target for the mode.
    fn target(&self) -> Option<Setpoint> {
        let of_mode = match self.settings.mode {
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
        };
        self.override_setpoint().or(of_mode)
    }

    /// True if a command to the motor is pending.
    pub(super) const fn is_pending(&self) -> bool {
        self.has_new_target() || self.settings_due
    }

    /// Returns the next command to the motor, whose index is `motor`: first a release, then the settings, then the
    /// motor's own set-point. After sending the command, call [`sent`](Self::sent).
    pub(super) fn pending(&self, motor: usize) -> Option<Command> {
        if let Some(release) = self.release_due {
            let setpoint = match release {
                OnFault::Coast => Setpoint::Disabled,
                OnFault::Brake => Setpoint::FailSafe,
            };
            Some(Command::Set { motor, setpoint })
        } else if self.settings_due {
            Some(Command::Configure { motor, settings: self.settings.motor })
        } else if self.is_setpoint_due() {
            // An enabled motor whose new mode has no target coasts until a host sets a target.
            Some(Command::Set { motor, setpoint: self.target().unwrap_or_default() })
        } else {
            None
        }
    }

    /// Removes the command that [`pending`](Self::pending) returns, because it was sent with this number.
    pub(super) const fn sent(&mut self, number: u32) {
        if self.release_due.is_some() {
            self.release_due = None;
            self.awaited = Some(number);
        } else if self.settings_due {
            self.settings_due = false;
        } else if let MotorState::OwnSetpoint { due, .. } = &mut self.state {
            *due = false;
            self.awaited = Some(number);
        }
    }

    /// Records the number of the command with which a course of the motor's group was sent.
    pub(super) const fn course_sent(&mut self, number: u32) {
        self.awaited = Some(number);
    }

    /// Ends the wait for the awaited command if it is included in a snapshot whose newest command has the number
    /// `commands`.
    pub(super) fn note_snapshot(&mut self, commands: u32) {
        self.awaited.take_if(|number| is_included(*number, commands));
    }

    /// True until a snapshot includes the newest set-point or the newest sent course. Until then the motor's reports
    /// are out of date.
    pub(super) const fn awaits_snapshot(&self) -> bool {
        self.has_new_target() || self.awaited.is_some()
    }

    /// True if a group's course has replaced the motor's own set-point.
    pub(super) const fn in_group(&self) -> bool {
        matches!(self.state, MotorState::InGroup)
    }

    /// True if the motor's own set-point is pending.
    const fn is_setpoint_due(&self) -> bool {
        matches!(self.state, MotorState::OwnSetpoint { due: true, .. })
    }

    /// True if a release is pending. A release is sent before the commands of all other motors.
    pub(super) const fn urgent(&self) -> bool {
        self.release_due.is_some()
    }

    /// Replaces the motor's own set-point by a group's course.
    pub(super) const fn join(&mut self) {
        self.follow(MotorState::InGroup);
    }

    /// True if a release or the motor's own set-point is pending.
    const fn has_new_target(&self) -> bool {
        self.is_setpoint_due() || self.urgent()
    }

    /// Converts a target from the host's counts to the motor's counts. The motor is at `position` in its own counts.
    ///
    /// The regulator takes the shorter way round the ring of 2^32 counts, but a host expects the direction of target
    /// minus position. The distance is therefore limited to [`LONGEST_DISTANCE`] in the direction that the host
    /// expects.
    ///
    /// There is one exception: a host whose counts wrap. Target minus position then does not fit in 32 bits, but the
    /// way across the ends of the 32-bit range is shorter than 2^30 counts. The motor takes this way.
    pub(super) fn goal(&self, counts: i32, position: i32) -> i32 {
        let from = self.host_counts(position);
        let short_way = counts.wrapping_sub(from);
        let across_the_ends = counts.checked_sub(from).is_none() && short_way.unsigned_abs() < 1 << 30;
        let distance = if across_the_ends { short_way } else { counts.saturating_sub(from) };
        position.wrapping_add(distance.clamp(-LONGEST_DISTANCE, LONGEST_DISTANCE))
    }

    /// Returns the motor's settings, including changes that must still be sent to the motor.
    pub(super) const fn settings(&self) -> &MotorSettings {
        &self.settings
    }

    /// Replaces all settings. Targets and the offset of the host's counts do not change. The motor must be disabled.
    pub(super) const fn restore(&mut self, settings: MotorSettings) {
        self.settings = settings;
        self.settings_due = true;
    }

    /// True from a valid *set enable* until a host or fail-safe disables the motor.
    pub(super) const fn enabled(&self) -> bool {
        !matches!(self.state, MotorState::Disabled)
    }

    /// True if the magnitude of the [best current](Report::best_current) exceeds the current alert. False without an
    /// alert.
    pub(super) fn is_over_current(&self, report: &Report) -> bool {
        let level = self.settings.current_alert_ma;
        level != 0 && report.best_current().magnitude() > level
    }

    /// Returns the motor's position in the host's counts.
    pub(super) const fn counts(&self, report: &Report) -> i32 {
        self.host_counts(report.position)
    }

    /// Converts a position from the motor's counts to the host's counts.
    pub(super) const fn host_counts(&self, counts: i32) -> i32 {
        counts.wrapping_sub(self.offset)
    }

    /// True if the motor is [within tolerance](motor::within_tolerance) of the host's target. False unless the motor is
    /// enabled in mode position, without an override, and in no group.
    pub(super) fn within_tolerance(&self, report: &Report) -> bool {
        let near =
            |Target { counts, tolerance }| motor::within_tolerance(counts, self.counts(report), tolerance);
        let follows_mode = matches!(self.state, MotorState::OwnSetpoint { override_setpoint: None, .. });
        let regulated = follows_mode && self.settings.mode == RunMode::Position;
        regulated && self.position.is_some_and(near)
    }
}
