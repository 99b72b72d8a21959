//! What the hub remembers of one motor on behalf of the host, and what that makes the motor do.
//!
//! The host's counts are the motor's less an offset, which is what *reset encoder* sets. Targets are
//! kept as the host gave them, so after a reset they are where the host's new counts say.
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

use super::answer::Answer;
use super::setup;
use crate::hub::Action;
use crate::motion::Pidf;
use crate::motor::{self, OnFault, Report, Setpoint, Settings};
use crate::protocol::Nack;
use crate::protocol::motor::{Algorithm, ChannelMode, Coefficients, Loop, RunMode, Target, ToMotor};
use crate::protocol::setup::{Motion, Protection, ToSetup};
use crate::regulator;
use crate::regulator::identify::{Identification, travel};
use crate::units::{Coefficient, Control, CountsPerSecond, Millivolts, Period, is_included};

/// The speed limit on the way to a position, in counts per second, while no target velocity has ever
/// been set: the largest that one could set.
pub const SPEED_LIMIT: i16 = i16::MAX;

/// How far away a motor is sent at most: half of the ring of its counts, less what a load may push it back on the
/// way before the other half is the shorter one.
const FARTHEST: i32 = i32::MAX - (1 << 24);

/// One motor channel.
#[derive(Clone, Debug)]
pub struct MotorChannel {
    settings: Settings,
    velocity_algorithm: Algorithm,
    position_algorithm: Algorithm,
    mode: RunMode,
    enabled: bool,
    /// Targets; `None` if never set.
    power: Option<Control>,
    velocity: Option<i16>,
    position: Option<Target>,
    /// The limit of travel of an identification that nothing has come after.
    identify: Option<u32>,
    /// True if a group's course has replaced the motor's own target.
    in_group: bool,
    /// Number of the newest command with a set-point or a course, while no snapshot includes that command.
    awaited: Option<u32>,
    /// The motor's counts where the host's are 0.
    offset: i32,
    /// The motor's counts when the host last spoke of it.
    seen: i32,
    /// In milliamperes; 0 for none.
    current_alert: u16,
    pending: Pending,
}

/// What the motor has not been told yet, in the order in which it is told. The state is what is told,
/// not its history: a target that was replaced in time is never told. Disabling always is, because
/// it ends faults.
#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    /// To let go: disabled, or left to what its settings say of a fault.
    release: Option<Release>,
    configure: bool,
    set: bool,
}

/// Why a motor is to let go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Release {
    Disabled,
    Abandoned,
}

impl MotorChannel {
    /// A disabled motor in open loop without targets. `settings` are those that the motor starts with.
    pub const fn new(settings: Settings) -> Self {
        Self {
            settings,
            velocity_algorithm: Algorithm::Pidf,
            position_algorithm: Algorithm::Pidf,
            mode: RunMode::Power,
            enabled: false,
            power: None,
            velocity: None,
            position: None,
            identify: None,
            in_group: false,
            awaited: None,
            offset: 0,
            seen: 0,
            current_alert: 0,
            pending: Pending { release: None, configure: false, set: false },
        }
    }

    /// Does what a request says. `battery_good` is whether motors may be enabled.
    ///
    /// # Errors
    /// Why the request is refused; nothing has changed then.
    pub fn receive(&mut self, request: ToMotor, report: &Report, battery_good: bool) -> Result<Answer, Nack> {
        self.seen = report.position;
        match request {
            ToMotor::SetMode { mode, zero_power } => {
                self.mode = mode;
                self.settings.zero_power = zero_power;
                self.pending.configure = true;
                self.retarget();
            }
            ToMotor::SetEnable { on: false } => self.disable(),
            ToMotor::SetEnable { on: true } => self.enable(battery_good)?,
            ToMotor::SetCurrentAlert { milliamperes } => self.current_alert = milliamperes,
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
                let pidf = Pidf { p, i, d, f: Coefficient::ZERO };
                self.set_pidf(of, Coefficients { pidf, algorithm: Algorithm::Legacy });
            }
            ToMotor::SetPidf { of, coefficients } => self.set_pidf(of, coefficients),
            ToMotor::Mode => return Ok(Answer::data(&self.mode())),
            ToMotor::Enable => return Ok(Answer::data(&self.enabled)),
            ToMotor::CurrentAlert => return Ok(Answer::data(&self.current_alert)),
            ToMotor::Power => return Ok(Answer::data(&self.power.unwrap_or_default())),
            ToMotor::Velocity => return Ok(Answer::data(&self.velocity.unwrap_or_default())),
            ToMotor::Position => return Ok(Answer::data(&self.position.unwrap_or_default())),
            ToMotor::AtTarget if self.mode != RunMode::Position => return Err(Nack::WRONG_MODE),
            ToMotor::AtTarget => return Ok(Answer::data(&self.within_tolerance(report))),
            ToMotor::Encoder => return Ok(Answer::data(&self.counts(report))),
            ToMotor::Pidf { of } => return Ok(Answer::data(&self.pidf(of))),
            ToMotor::Pid { of } => {
                let Pidf { p, i, d, f } = self.pidf(of).pidf;
                if f != Coefficient::ZERO {
                    // An answer without F would not be the truth; hosts then ask for all four.
                    return Err(Nack::parameter(2));
                }
                return Ok(Answer::data(&[p, i, d]));
            }
        }
        Ok(Answer::Ack)
    }

    /// Does what a request says. `battery` is its voltage, if motors may be enabled.
    ///
    /// # Errors
    /// Why the request is refused; nothing has changed then.
    pub fn receive_setup(
        &mut self,
        request: ToSetup,
        report: &Report,
        battery: Option<Millivolts>,
    ) -> Result<Answer, Nack> {
        Ok(match request {
            ToSetup::SetUp { setup: wanted } => {
                self.settings = setup::settings(wanted, &self.settings);
                self.pending.configure = true;
                Answer::Ack
            }
            ToSetup::Setup => Answer::data(&setup::of(&self.settings)),
            ToSetup::SetMotion { motion: Motion { dynamics, acceleration } } => {
                self.settings = Settings { dynamics, acceleration, ..self.settings };
                self.pending.configure = true;
                Answer::Ack
            }
            ToSetup::Motion => {
                let Settings { dynamics, acceleration, .. } = self.settings;
                Answer::data(&Motion { dynamics, acceleration })
            }
            ToSetup::SetProtection { protection: Protection { on_fault, thermal } } => {
                self.settings = Settings { on_fault, thermal, ..self.settings };
                self.pending.configure = true;
                Answer::Ack
            }
            ToSetup::Protection => {
                let Settings { on_fault, thermal, .. } = self.settings;
                Answer::data(&Protection { on_fault, thermal })
            }
            ToSetup::SetTiming { timing } => {
                self.settings.bridge = self.settings.bridge.with_timing(timing);
                self.pending.configure = true;
                Answer::Ack
            }
            ToSetup::Timing => Answer::data(&self.settings.bridge.timing()),
            ToSetup::Condition => Answer::data(&setup::condition(report)),
            ToSetup::Identify { travel_limit } => {
                let battery = battery.ok_or(Nack::BATTERY_LOW)?;
                if !self.enabled || self.mode != RunMode::Power || self.power != Some(Control::ZERO) {
                    return Err(Nack::WRONG_MODE);
                }
                self.retarget();
                self.identify = Some(travel_limit);
                Answer::data(&travel(self.settings.winding.emf, battery, travel_limit))
            }
            // The report is about the time before the identification.
            ToSetup::Identification if self.identify.is_some() && self.awaits_snapshot() => {
                Answer::data(&Identification::Running(0))
            }
            ToSetup::Identification => Answer::data(&report.identification),
        })
    }

    /// From the first of them on the motor is regulated by PID.
    fn set_pidf(&mut self, of: Loop, Coefficients { pidf, algorithm }: Coefficients) {
        let mut both = self.coefficients();
        match of {
            Loop::Velocity => (both.velocity, self.velocity_algorithm) = (pidf, algorithm),
            Loop::Position => (both.position, self.position_algorithm) = (pidf, algorithm),
        }
        self.settings.coefficients = Some(both);
        self.pending.configure = true;
    }

    pub(super) fn pidf(&self, of: Loop) -> Coefficients {
        let both = self.coefficients();
        let (pidf, algorithm) = match of {
            Loop::Velocity => (both.velocity, self.velocity_algorithm),
            Loop::Position => (both.position, self.position_algorithm),
        };
        Coefficients { pidf, algorithm }
    }

    /// Those that a host gave, or such as the hub would use if it knew nothing of the load.
    fn coefficients(&self) -> regulator::Coefficients {
        let Settings { winding, scheme, coefficients, .. } = self.settings;
        coefficients.unwrap_or_else(|| regulator::Coefficients::guessed(winding.emf, scheme, Period::DEFAULT))
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

    /// The output floats; everything else is kept.
    pub const fn disable(&mut self) {
        self.enabled = false;
        self.release(Release::Disabled);
    }

    /// The host has fallen silent: an enabled motor does what its settings say of a fault. One that does so already
    /// goes on.
    pub fn abandon(&mut self) {
        match self.settings.on_fault {
            OnFault::Coast => self.disable(),
            OnFault::Brake if self.enabled => {
                self.enabled = false;
                self.release(Release::Abandoned);
            }
            OnFault::Brake => (),
        }
    }

    const fn release(&mut self, release: Release) {
        self.identify = None;
        self.in_group = false;
        self.pending.release = Some(release);
        self.pending.set = false;
    }

    /// An enabled motor hears of what has changed.
    const fn retarget(&mut self) {
        self.identify = None;
        self.in_group = false;
        self.pending.set = self.enabled;
    }

    /// The set-point of the present mode; `None` if its target was never set.
    fn target(&self) -> Option<Setpoint> {
        if let Some(travel_limit) = self.identify {
            return Some(Setpoint::Identify { travel_limit });
        }
        match self.mode {
            RunMode::Power => self.power.map(Setpoint::ConstantPower),
            RunMode::Velocity => {
                self.velocity.map(|cps| Setpoint::Velocity(CountsPerSecond::new(cps.into())))
            }
            RunMode::Position => self.position.map(|Target { counts, tolerance }| {
                let speed_limit = i32::from(self.velocity.unwrap_or(SPEED_LIMIT)).abs();
                Setpoint::Position {
                    target: self.goal(counts, self.seen),
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
                Release::Abandoned => Setpoint::FailSafe,
            }))
        } else if self.pending.configure {
            Some(Action::Configure(self.settings))
        } else if self.pending.set {
            // An enabled motor that is switched to a mode without a target floats until it has one.
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

    /// True while no snapshot includes the motor's newest set-point or course. What reports say of the motor's set-point is
    /// out of date then.
    pub(super) const fn awaits_snapshot(&self) -> bool {
        self.has_new_target() || self.awaited.is_some()
    }

    /// True if a group's course has replaced the motor's own target.
    pub(super) const fn in_group(&self) -> bool {
        self.in_group
    }

    /// True if the motor is about to be told to let go, which is urgent.
    pub const fn urgent(&self) -> bool {
        self.pending.release.is_some()
    }

    /// Takes a group's course in place of the motor's own target.
    pub(super) const fn join(&mut self) {
        self.pending.set = false;
        self.in_group = true;
    }

    /// It is about to be told to go somewhere by itself, or to let go.
    pub(super) const fn has_new_target(&self) -> bool {
        self.pending.set || self.urgent()
    }

    /// A target of the host's in the motor's counts, of a motor that is at `position`.
    ///
    /// The motor takes the short way round the ring of its counts. What the host's numbers say to be ahead is sent no
    /// farther than that is the way ahead; only between the two ends of the numbers, where they jump, is the short
    /// way the one that is meant.
    pub(super) fn goal(&self, counts: i32, position: i32) -> i32 {
        let from = self.told_counts(position);
        let short_way = counts.wrapping_sub(from);
        let across_the_ends = counts.checked_sub(from).is_none() && short_way.unsigned_abs() < 1 << 30;
        let distance = if across_the_ends { short_way } else { counts.saturating_sub(from) };
        position.wrapping_add(distance.clamp(-FARTHEST, FARTHEST))
    }

    /// Its settings, as the host has left them.
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// What regulates it, and what zero means to it.
    pub(super) const fn mode(&self) -> ChannelMode {
        ChannelMode { mode: self.mode, zero_power: self.settings.zero_power }
    }

    /// In milliamperes; 0 for none.
    pub(super) const fn current_alert(&self) -> u16 {
        self.current_alert
    }

    /// What a host has set is forgotten, but for targets and where its counts begin. For a motor that is off.
    pub(super) const fn forget_settings(&mut self, settings: Settings) {
        self.settings = settings;
        (self.velocity_algorithm, self.position_algorithm) = (Algorithm::Pidf, Algorithm::Pidf);
        self.mode = RunMode::Power;
        self.current_alert = 0;
        self.pending.configure = true;
    }

    /// The last valid *set enable*, unless fail-safe came after it.
    pub const fn enabled(&self) -> bool {
        self.enabled
    }

    /// More current flows than the host's alert allows, measured or modelled.
    pub fn is_over_current(&self, report: &Report) -> bool {
        let level = self.current_alert;
        level != 0 && setup::magnitude(report.best_current()) > level
    }

    /// The host's counts.
    pub const fn counts(&self, report: &Report) -> i32 {
        self.told_counts(report.position)
    }

    /// Counts of the motor's in the host's.
    pub(super) const fn told_counts(&self, counts: i32) -> i32 {
        counts.wrapping_sub(self.offset)
    }

    /// True if the motor is enabled in position mode, in no group, and [within tolerance](motor::within_tolerance) of the
    /// host's target.
    pub fn within_tolerance(&self, report: &Report) -> bool {
        let near =
            |Target { counts, tolerance }| motor::within_tolerance(counts, self.counts(report), tolerance);
        let regulated = self.enabled && !self.in_group && self.mode == RunMode::Position;
        regulated && self.position.is_some_and(near)
    }
}
