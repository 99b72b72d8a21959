//! N motors on one battery: one step for all of them, and one snapshot of everything.
//!
//! ```
//! use motor_hub::braking::Winding;
//! use motor_hub::bridge::{Drive, Mode};
//! use motor_hub::hub::{Action, Command, Hub, Inputs};
//! use motor_hub::motor::{Setpoint, Settings};
//! use motor_hub::supply::Battery;
//! use motor_hub::units::{Control, Micros, Millivolts, Period};
//!
//! let settings = Settings::new(Winding::NEVEREST_60);
//! let mut hub = Hub::new([settings; 2], Period::DEFAULT);
//! hub.apply(Command { motor: 1, action: Action::Set(Setpoint::ConstantPower(Control::MAX)) })?;
//!
//! let now = Micros::new(50_000);
//! let battery = Some(Battery::good(Millivolts::new(12_000), now));
//! let snapshot = hub.step(&Inputs { now, readings: [None; 2], battery });
//! assert_eq!(snapshot.motors[0].drive, Drive::COAST);
//! assert_eq!(snapshot.motors[1].drive.mode, Mode::Cw98);
//! // Open loop needs no encoder, but a missing one is reported.
//! assert!(snapshot.motors[1].faults.encoder_stale);
//! # Ok::<(), motor_hub::units::RangeError>(())
//! ```

mod bus;
mod groups;

use crate::bridge::{Drive, Sensed};
use crate::group::{Halt, Together};
use crate::motion::Reading;
use crate::motor::{Motor, Report, Setpoint, Settings, SupplyLimits};
use crate::supply::{Battery, Stage};
use crate::units::{CountsPerSecond, Micros, Millivolts, Period, RangeError, Share, is_included};
use bus::Account;
use groups::Groups;

pub use bus::Bus;

/// Something to do to one motor at the next tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Command {
    /// 0 to N - 1.
    pub motor: usize,
    /// What to do.
    pub action: Action,
}

/// What a command does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Action {
    /// Replaces the set-point.
    Set(Setpoint),
    /// Replaces all settings at once.
    Configure(Settings),
    /// Sends a group on a course; the command's motor is any of its members. Members of another group leave
    /// it. A group of the same members is sent on from where it is, without a step.
    Lead(Together),
}

/// What a tick is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inputs<const N: usize> {
    /// The time of the tick.
    pub now: Micros,
    /// The newest reading of each encoder, however old; `None` if none came.
    pub readings: [Option<Reading>; N],
    /// The newest battery reading, however old.
    pub battery: Option<Battery>,
}

/// Everything a host would want to see, as of one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Snapshot<const N: usize> {
    /// Ticks since boot, from 1; 0 before the first.
    pub tick: u32,
    /// The time of the tick.
    pub at: Micros,
    /// Ticks that were left out because the one before them ended too late.
    pub missed: u32,
    /// Number of the newest command that the snapshot includes, from 1; 0 before the first. After 2^32 - 1 comes 0.
    pub commands: u32,
    /// The battery voltage in force; `None` if unknown.
    pub battery: Option<Millivolts>,
    /// What the supply allows, and what it was given back.
    pub bus: Bus,
    /// By motor.
    pub motors: [Report; N],
}

impl Action {
    /// True if a motor can do it at once: let go, or go on at constant power.
    pub const fn is_direct(&self) -> bool {
        matches!(self, Self::Set(setpoint) if setpoint.is_direct())
    }
}

impl<const N: usize> Snapshot<N> {
    /// Before the first tick.
    pub const INITIAL: Self = Self {
        tick: 0,
        at: Micros::new(0),
        missed: 0,
        commands: 0,
        battery: None,
        bus: Bus::INITIAL,
        motors: [Report::INITIAL; N],
    };

    /// True if the snapshot includes the command of this number: it was made after the hub had applied the command.
    pub const fn includes(&self, number: u32) -> bool {
        is_included(number, self.commands)
    }

    /// The battery, if it is known and not low: motors may be enabled.
    pub fn good_battery(&self) -> Option<Millivolts> {
        self.battery.filter(|_| self.bus.stage == Stage::Full)
    }

    /// True if the battery is known to be low. It stays so until it has recovered.
    pub fn battery_low(&self) -> bool {
        self.battery.is_some() && self.bus.stage != Stage::Full
    }

    /// True if no motor is told to do anything.
    pub fn all_disabled(&self) -> bool {
        self.motors.iter().all(|motor| motor.setpoint == Setpoint::Disabled)
    }

    /// What the bridges are told.
    pub fn drives(&self) -> [Drive; N] {
        self.motors.map(|motor| motor.drive)
    }
}

/// N motors, each by itself or in a group.
///
/// A member that is given a set-point by itself leaves its group, and so does one with a fault; the others halt as
/// the group's setting says. Disabling one disables all.
#[derive(Clone, Debug)]
pub struct Hub<const N: usize> {
    motors: [Motor; N],
    groups: Groups<N>,
    period: Period,
    tick: u32,
    missed: u32,
    /// Number of the newest command that was applied.
    commands: u32,
    account: Account,
    /// What may be drawn, and how far returned energy is to be burnt.
    allowed: (Share, Share),
}

impl<const N: usize> Hub<N> {
    /// A hub of disabled motors that is stepped every `period`.
    pub fn new(settings: [Settings; N], period: Period) -> Self {
        let motors = settings.map(|settings| Motor::new(settings, period));
        Self {
            motors,
            groups: Groups::new(),
            period,
            tick: 0,
            missed: 0,
            commands: 0,
            account: Account::new(period),
            allowed: (Share::ALL, Share::NONE),
        }
    }

    /// The control period.
    pub const fn period(&self) -> Period {
        self.period
    }

    /// Applies a command, which takes effect at the next step, or with [`act`](Self::act). Commands are counted, refused
    /// ones too: [`Snapshot::commands`] is the number of the newest one.
    ///
    /// # Errors
    /// [`RangeError::Motor`] if there is no such motor, or if it is to lead a group of which it is no member, or
    /// that has one that does not exist; only the count changes then.
    pub fn apply(&mut self, command: Command) -> Result<(), RangeError> {
        self.commands = self.commands.wrapping_add(1);
        let Self { motors, groups, .. } = self;
        let index = command.motor;
        let motor = motors.get_mut(index).ok_or(RangeError::Motor)?;
        match command.action {
            Action::Set(setpoint) => {
                motor.set(setpoint);
                let lets_go = matches!(setpoint, Setpoint::Disabled | Setpoint::FailSafe);
                groups.leave(index, lets_go.then_some(Halt::Coast), motors);
            }
            Action::Configure(settings) => motor.configure(settings),
            Action::Lead(together) => groups.lead(index, together, motors)?,
        }
        Ok(())
    }

    /// Does between two ticks what commands have asked for that needs no regulator: motors that are to let go do, and
    /// constant power is given. What the bridges are told from now on, if it is something else than before.
    pub fn act(&mut self, now: Micros, battery: Option<Battery>) -> Option<[Drive; N]> {
        let battery = battery.filter(|battery| battery.is_fresh(now)).map(|battery| battery.voltage);
        self.settle_account(now);
        let changed = self.motors.iter_mut().fold(false, |changed, motor| motor.act(battery) | changed);
        changed.then(|| self.motors.each_ref().map(Motor::drive))
    }

    /// Estimated, as of the newest samples: a snapshot is of a tick.
    pub fn velocities(&self) -> impl Iterator<Item = CountsPerSecond> {
        self.motors.iter().map(Motor::velocity)
    }

    /// Notes ticks that did not happen.
    pub const fn note_missed(&mut self, ticks: u32) {
        self.missed = self.missed.saturating_add(ticks);
    }

    /// Takes a sample of all encoders between two ticks, best every millisecond: the more of them, the better
    /// the motion of motors is known. `None` for an encoder of which nothing is known yet.
    pub fn sample(&mut self, readings: &[Option<Reading>; N]) {
        for (motor, reading) in self.motors.iter_mut().zip(readings) {
            if let Some(reading) = reading {
                motor.sample(*reading);
            }
        }
    }

    /// Takes what the bridges say of themselves, on a board that hears them; as often as they do, between two ticks.
    pub fn sense(&mut self, sensed: &[Sensed; N]) {
        for (motor, sensed) in self.motors.iter_mut().zip(sensed) {
            motor.sense(*sensed);
        }
    }

    /// Looks at the bus between two ticks, best every millisecond while it is not quiet: a bus that cannot take what
    /// braking motors return must not wait for a tick. What the bridges are told from now on, if it is something else
    /// than before.
    pub fn watch_bus(&mut self, battery: Battery) -> Option<[Drive; N]> {
        if !self.is_news(&battery) {
            return None;
        }
        self.allow(&battery, battery.at).then(|| self.motors.each_ref().map(Motor::drive))
    }

    /// It allows other things than before; or braking motors burn in portions, which are looked at every time.
    fn is_news(&self, battery: &Battery) -> bool {
        self.allowed != (battery.draw, battery.burn) || battery.burn != Share::NONE
    }

    /// What the supply allows from now on. True if a bridge is told otherwise for it.
    #[cold]
    fn allow(&mut self, battery: &Battery, now: Micros) -> bool {
        let &Battery { draw, burn, newest, .. } = battery;
        self.allowed = (draw, burn);
        self.settle_account(now);
        let limits = SupplyLimits { draw, dissipate: burn, bus: newest, from: now };
        let mut turn = true;
        self.motors.iter_mut().fold(false, |changed, motor| motor.limit_supply(limits, &mut turn) | changed)
    }

    /// What has been returned and burnt until now is added up.
    fn settle_account(&mut self, now: Micros) {
        self.account.settle(now, self.motors.iter().map(Motor::returned));
    }

    /// One tick of all motors. Each sees only its own encoder; outside of groups none sees another's fault.
    pub fn step(&mut self, inputs: &Inputs<N>) -> Snapshot<N> {
        let known = inputs.battery.as_ref().filter(|battery| battery.is_fresh(inputs.now));
        let battery = known.map(|known| known.voltage);
        if let Some(known) = known.filter(|known| self.is_news(known)) {
            self.allow(known, inputs.now);
        }
        if self.account.is_due(self.tick) {
            self.settle_account(inputs.now);
        }
        self.tick = self.tick.wrapping_add(1);
        self.groups.step(inputs, self.period, &mut self.motors);
        let mut motors = [Report::INITIAL; N];
        for ((motor, &reading), report) in self.motors.iter_mut().zip(&inputs.readings).zip(&mut motors) {
            *report = motor.step(inputs.now, reading, battery);
        }
        self.groups.review(&mut motors, &mut self.motors);
        let bus = self.account.report(known);
        let Self { tick, missed, commands, .. } = *self;
        Snapshot { tick, at: inputs.now, missed, commands, battery, bus, motors }
    }
}
