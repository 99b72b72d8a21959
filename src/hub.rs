//! Controls N motors on one battery: one step for all motors returns one snapshot of the hub.
//!
//! ```
//! use motor_hub::braking::Winding;
//! use motor_hub::bridge::{Drive, Mode};
//! use motor_hub::hub::{Command, Hub};
//! use motor_hub::motor::{Setpoint, Settings};
//! use motor_hub::supply::Battery;
//! use motor_hub::units::{Control, Micros, Millivolts, Period};
//!
//! let settings = Settings::new(Winding::NEVEREST_60);
//! let mut hub = Hub::new([settings; 2], Period::DEFAULT);
//! hub.apply(Command::Set { motor: 1, setpoint: Setpoint::ConstantPower(Control::MAX) })?;
//!
//! let now = Micros::new(50_000);
//! let battery = Some(Battery::unlimited(Millivolts::new(12_000), now));
//! let snapshot = hub.step(now, &[None; 2], battery);
//! assert_eq!(snapshot.motors[0].drive, Drive::COAST);
//! assert_eq!(snapshot.motors[1].drive.mode, Mode::Cw98);
//! // Open loop needs no encoder, but a missing encoder is reported.
//! assert!(snapshot.motors[1].faults.encoder_stale);
//! # Ok::<(), motor_hub::units::RangeError>(())
//! ```

mod base;
mod groups;

use crate::bridge::{BridgeFeedback, Drive};
use crate::group::{BaseSettings, GroupCommand, Halt};
use crate::motion::Reading;
use crate::motor::{self, Motor, Report, Setpoint, Settings};
use crate::supply::{Battery, DrawStage};
use crate::units::{
    CountsPerSecond, Microjoules, Micros, Millivolts, Period, RangeError, Share, is_included,
};
use base::Base;
use groups::Groups;

pub use base::{BaseState, GyroReading};

/// A command to one motor, to a group or to the drive base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Replaces the set-point of a motor.
    Set {
        /// Index of the motor, 0 to N - 1.
        motor: usize,
        /// The new set-point.
        setpoint: Setpoint,
    },
    /// Replaces all settings of a motor.
    Configure {
        /// Index of the motor, 0 to N - 1.
        motor: usize,
        /// The new settings.
        settings: Settings,
    },
    /// Moves a group.
    ///
    /// If a group with exactly these members is moving already, the group takes the new course, and its references do
    /// not jump. Otherwise the members leave their old groups and form a new group. The new group starts when all
    /// members have a fresh encoder reading and no latched fault. Until then all members are held at speed 0.
    MoveGroup(GroupCommand),
    /// Replaces the drive base. The new base starts at the origin. The wheels of the old and of the new base leave
    /// their groups. `None` removes the drive base.
    SetBase(Option<BaseSettings>),
}

/// The state of the hub after one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Snapshot<const N: usize> {
    /// Number of ticks since boot. 0 before the first tick.
    pub tick: u32,
    /// Time of the tick.
    pub at: Micros,
    /// Number of ticks since boot that were skipped because the tick before them ended too late.
    pub missed_ticks: u32,
    /// Number of the newest command that the snapshot includes. 0 before the first command, which has number 1. Numbers
    /// wrap from 2^32 - 1 to 0.
    pub newest_command: u32,
    /// Battery voltage. `None` without a [fresh](Battery::is_fresh) state of the battery.
    pub battery: Option<Millivolts>,
    /// Stage of the limit on the current that motors draw from the supply. [`DrawStage::Cutoff`] without a fresh state
    /// of the battery.
    pub draw_stage: DrawStage,
    /// Strength with which braking motors dissipate their energy, as a share of full strength. [`Share::NONE`] while
    /// the supply takes the energy, and without a fresh state of the battery.
    pub dissipate: Share,
    /// Energy that braking motors have returned to the bus since boot. The hub computes the energy from motor constants
    /// and bridge commands.
    pub returned: Microjoules,
    /// Energy that braking motors have dissipated in windings and bridges since boot.
    pub dissipated: Microjoules,
    /// State of the drive base. `None` until a base is configured.
    pub base: Option<BaseState>,
    /// Report of each motor.
    pub motors: [Report; N],
}

impl Command {
    /// True if the command is *direct*: a motor can execute the command between two ticks, because no encoder is
    /// needed. Direct commands disable a motor, start its fail-safe, or set constant power.
    pub const fn is_direct(&self) -> bool {
        matches!(self, Self::Set { setpoint, .. } if setpoint.is_direct())
    }
}

impl<const N: usize> Snapshot<N> {
    /// The state before the first tick.
    pub const INITIAL: Self = Self {
        tick: 0,
        at: Micros::new(0),
        missed_ticks: 0,
        newest_command: 0,
        battery: None,
        draw_stage: DrawStage::Cutoff,
        dissipate: Share::NONE,
        returned: Microjoules::ZERO,
        dissipated: Microjoules::ZERO,
        base: None,
        motors: [Report::INITIAL; N],
    };

    /// True if the snapshot was made after the hub had applied the command with this number.
    pub const fn includes(&self, number: u32) -> bool {
        is_included(number, self.newest_command)
    }

    /// Returns the battery voltage if motors may be enabled. `None` if the voltage is unknown, low, or above
    /// [`Levels::max`](crate::supply::Levels::max).
    pub fn good_battery(&self) -> Option<Millivolts> {
        self.battery.filter(|_| self.draw_stage == DrawStage::Full)
    }

    /// True if the battery voltage is known, and the battery is low and has not recovered.
    pub fn battery_low(&self) -> bool {
        self.battery.is_some() && matches!(self.draw_stage, DrawStage::Derated | DrawStage::Cutoff)
    }

    /// True if every motor is disabled or in fail-safe, so that no motor is driven.
    pub fn all_disabled(&self) -> bool {
        self.motors.iter().all(|motor| matches!(motor.setpoint, Setpoint::Disabled | Setpoint::FailSafe))
    }

    /// Returns the commands of all bridges.
    pub fn drives(&self) -> [Drive; N] {
        self.motors.map(|motor| motor.drive)
    }
}

/// N motors, each alone or in a group.
///
/// A member leaves its group when it gets its own set-point, joins another group, or has a fault. The wheels of the old
/// and of the new drive base also leave their groups when a base is configured or removed. The other members then halt
/// according to [`GroupCommand::halt`]. One exception: if a member of a group is disabled or enters fail-safe, all
/// other members are disabled. A group that waits to start ends when a member leaves: with [`Halt::Stop`] the others
/// get the velocity 0.
#[derive(Clone, Debug)]
pub struct Hub<const N: usize> {
    motors: [Motor; N],
    groups: Groups<N>,
    /// The drive base. `None` until a base is configured.
    base: Option<Base>,
    /// Newest reading of the gyro. `None` without a gyro that works.
    gyro: Option<GyroReading>,
    period: Period,
    tick: u32,
    missed_ticks: u32,
    /// Number of the newest command that was applied.
    newest_command: u32,
    /// Energy that braking motors have returned to the bus.
    returned: Microjoules,
    /// Energy that braking motors have dissipated.
    dissipated: Microjoules,
    /// Time up to which `returned` and `dissipated` are computed; `None` before the first computation.
    energy_until: Option<Micros>,
    /// The newest [`Battery::draw`] that the motors were limited to.
    draw: Share,
    /// The newest [`Battery::dissipate`] that the motors were limited to.
    dissipate: Share,
}

impl<const N: usize> Hub<N> {
    /// Creates a hub of disabled motors that is stepped every `period`.
    pub fn new(settings: [Settings; N], period: Period) -> Self {
        let motors = settings.map(|settings| Motor::new(settings, period));
        Self {
            motors,
            groups: Groups::new(),
            base: None,
            gyro: None,
            period,
            tick: 0,
            missed_ticks: 0,
            newest_command: 0,
            returned: Microjoules::ZERO,
            dissipated: Microjoules::ZERO,
            energy_until: None,
            draw: Share::ALL,
            dissipate: Share::NONE,
        }
    }

    /// Returns the control period.
    pub const fn period(&self) -> Period {
        self.period
    }

    /// Applies a command. The command takes effect at the next [`step`](Self::step). A [direct](Command::is_direct)
    /// command can take effect earlier, at the next [`execute_direct`](Self::execute_direct).
    ///
    /// # Errors
    /// [`RangeError::Motor`] if a motor of the command does not exist, if a group has no members, or if one motor would
    /// drive both wheels of the drive base. [`Snapshot::newest_command`] also counts refused commands.
    pub fn apply(&mut self, command: Command) -> Result<(), RangeError> {
        self.newest_command = self.newest_command.wrapping_add(1);
        let Self { motors, groups, .. } = self;
        match command {
            Command::Set { motor, setpoint } => {
                motors.get_mut(motor).ok_or(RangeError::Motor)?.set(setpoint);
                let disables_group = matches!(setpoint, Setpoint::Disabled | Setpoint::FailSafe);
                let leaving = core::array::from_fn(|index| index == motor);
                groups.remove_members(leaving, disables_group.then_some(Halt::Coast), motors);
            }
            Command::Configure { motor, settings } => {
                motors.get_mut(motor).ok_or(RangeError::Motor)?.configure(settings);
            }
            Command::MoveGroup(group) => groups.command(group, motors)?,
            Command::SetBase(settings) => {
                if let Some(BaseSettings { wheels: [left, right], .. }) = settings
                    && (left == right || usize::from(left.max(right)) >= N)
                {
                    return Err(RangeError::Motor);
                }
                // Without the old base its wheels lose their corrections, so the positions of their group would jump.
                let replaced = core::mem::replace(&mut self.base, settings.map(Base::new));
                for base in [&replaced, &self.base].into_iter().flatten() {
                    groups.release_and_stop(base.wheels(), motors);
                }
            }
        }
        Ok(())
    }

    /// Executes the applied [direct](Command::is_direct) commands, between two ticks. Returns the commands of all
    /// bridges if the command of a bridge has changed, otherwise `None`.
    pub fn execute_direct(&mut self, now: Micros, battery: Option<Battery>) -> Option<[Drive; N]> {
        let battery = battery.filter(|battery| battery.is_fresh(now));
        self.update_energy(now);
        let mut changed = false;
        for motor in &mut self.motors {
            changed |= motor.step_direct(now, battery.as_ref());
        }
        changed.then(|| self.motors.each_ref().map(Motor::drive))
    }

    /// Returns the estimated speed of each motor at its newest sample.
    pub fn velocities(&self) -> impl Iterator<Item = CountsPerSecond> {
        self.motors.iter().map(Motor::velocity)
    }

    /// True if the drive base uses a gyro.
    pub fn uses_gyro(&self) -> bool {
        self.base.as_ref().is_some_and(Base::uses_gyro)
    }

    /// Stores the newest reading of the gyro, of any age. `None` without a gyro that works.
    pub const fn set_gyro_reading(&mut self, reading: Option<GyroReading>) {
        self.gyro = reading;
    }

    /// Adds `ticks` to [`Snapshot::missed_ticks`].
    pub const fn add_missed_ticks(&mut self, ticks: u32) {
        self.missed_ticks = self.missed_ticks.saturating_add(ticks);
    }

    /// Updates the estimates of motion with a sample of all encoders, between two ticks. The estimates are best with a
    /// sample every millisecond. `None` stands for an encoder without a reading so far.
    pub fn sample(&mut self, readings: &[Option<Reading>; N]) {
        for (motor, reading) in self.motors.iter_mut().zip(readings) {
            if let Some(reading) = reading {
                motor.sample(reading);
            }
        }
    }

    /// Passes feedback of the bridges to the motors, between two ticks. Boards without feedback never call this.
    pub fn set_bridge_feedback(&mut self, feedback: &[BridgeFeedback; N]) {
        for (motor, feedback) in self.motors.iter_mut().zip(feedback) {
            motor.sense(*feedback);
        }
    }

    /// Limits all motors according to a new state of the bus, between two ticks. Returns the commands of all bridges if
    /// one of them has changed, otherwise `None`.
    ///
    /// The voltage of a bus that cannot take the energy of braking motors rises within milliseconds. New limits
    /// therefore must not wait for a tick.
    pub fn apply_limits(&mut self, battery: Battery) -> Option<[Drive; N]> {
        if !self.needs_limits(&battery) {
            return None;
        }
        self.update_energy(battery.at);
        self.limit_supply(&battery, battery.at).then(|| self.motors.each_ref().map(Motor::drive))
    }

    /// True if the limits have changed, or if braking motors must dissipate energy. At each new state of the bus, the
    /// burn pulse of each motor that dissipates energy continues or changes.
    fn needs_limits(&self, battery: &Battery) -> bool {
        (self.draw, self.dissipate) != (battery.draw, battery.dissipate) || battery.dissipate != Share::NONE
    }

    /// Limits all motors according to the state of the bus. The energy must have been updated until now. Returns true
    /// if the command of a bridge has changed.
    fn limit_supply(&mut self, battery: &Battery, now: Micros) -> bool {
        (self.draw, self.dissipate) = (battery.draw, battery.dissipate);
        // The end of a short circuit returns the energy of the winding to the bus. Therefore only one motor may end a
        // short circuit at each new state of the bus.
        let mut may_end_short = true;
        let mut changed = false;
        for motor in &mut self.motors {
            changed |= motor.limit_supply(now, battery, &mut may_end_short);
        }
        changed
    }

    /// Adds the energy that the motors have returned and dissipated with their present bridge commands, between the
    /// last addition and `now`. Must be called before a bridge command changes.
    fn update_energy(&mut self, now: Micros) {
        let passed_us = self.energy_until.map_or(0, |until| now.since(until)) as u32;
        self.energy_until = self.energy_until.max(Some(now));
        let (mut returned_watts, mut dissipated_watts) = (0.0, 0.0);
        for power in self.motors.iter().map(Motor::braking_power) {
            returned_watts += power.returned_watts;
            dissipated_watts += power.dissipated_watts;
        }
        // A watt is a microjoule per microsecond. The conversion to an integer saturates, and converts NaN to 0.
        let microjoules = |watts: f32| (watts * passed_us as f32) as u32;
        self.returned = self.returned.plus(microjoules(returned_watts));
        self.dissipated = self.dissipated.plus(microjoules(dissipated_watts));
    }

    /// Runs one tick of all motors at the time `now`, and returns the state after the tick. `readings` are the newest
    /// readings of the encoders, and `battery` is the newest state of the battery. Both may have any age. A reading is
    /// `None` before the encoder's first reading, and `battery` is `None` while no state is known.
    pub fn step(
        &mut self,
        now: Micros,
        readings: &[Option<Reading>; N],
        battery: Option<Battery>,
    ) -> Snapshot<N> {
        let battery = battery.filter(|battery| battery.is_fresh(now));
        self.update_energy(now);
        if let Some(battery) = battery.filter(|battery| self.needs_limits(battery)) {
            self.limit_supply(&battery, now);
        }
        self.tick = self.tick.wrapping_add(1);
        self.step_base(now, readings);
        let has_battery = battery.is_some();
        self.groups.step(now, readings, has_battery, self.period, self.base.as_ref(), &mut self.motors);
        let mut motors = [Report::INITIAL; N];
        for ((motor, &reading), report) in self.motors.iter_mut().zip(readings).zip(&mut motors) {
            *report = motor.step(now, reading, battery);
        }
        self.groups.review(&mut motors, &mut self.motors, self.base.as_ref(), self.period);
        let Self { tick, missed_ticks, newest_command, returned, dissipated, .. } = *self;
        Snapshot {
            tick,
            at: now,
            missed_ticks,
            newest_command,
            battery: battery.map(|battery| battery.voltage),
            draw_stage: battery.map_or(DrawStage::Cutoff, |battery| battery.stage),
            dissipate: battery.map_or(Share::NONE, |battery| battery.dissipate),
            returned,
            dissipated,
            base: self.base.as_ref().map(Base::state),
            motors,
        }
    }

    /// Updates the odometry of the drive base. A wheel without a fresh reading keeps the position that it had at the
    /// last tick with a fresh reading.
    fn step_base(&mut self, now: Micros, readings: &[Option<Reading>; N]) {
        let Some(base) = &mut self.base else { return };
        let mut positions =
            readings.map(|reading| motor::fresh(reading, now).map(|reading| reading.position));
        for ((position, motor), reading) in positions.iter_mut().zip(&self.motors).zip(readings) {
            *position = position.or_else(|| reading.map(|_| motor.position()));
        }
        base.step(now, &positions, self.gyro);
    }
}
