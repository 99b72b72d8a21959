//! The drive base: its configuration by a host, and the report of its odometry.

use super::Responder;
use super::motor::MotorChannel;
use crate::extension::base::OdometryReport;
use crate::group::BaseSettings;
use crate::hub::{Action, Snapshot};
use crate::protocol::{Nack, Reply};
use crate::units::is_included;

/// The newest configuration of the drive base.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BaseCommand {
    settings: Option<BaseSettings>,
    state: State,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    /// The configuration must still be sent to control.
    Pending,
    /// Sent as the command with this number, which no snapshot includes yet.
    Sent(u32),
    /// The snapshot includes the configuration.
    #[default]
    InForce,
}

impl BaseCommand {
    /// Returns the action that must be sent.
    pub(super) fn pending(&self) -> Option<Action> {
        (self.state == State::Pending).then_some(Action::Base(self.settings))
    }

    /// Returns the newest configuration. `None` without a drive base.
    pub(super) const fn settings(&self) -> Option<BaseSettings> {
        self.settings
    }

    /// Notes that the configuration was sent as the command with this number.
    pub(super) const fn sent(&mut self, number: u32) {
        self.state = State::Sent(number);
    }

    /// Notes that a snapshot includes the commands up to this number.
    pub(super) fn note_snapshot(&mut self, commands: u32) {
        if let State::Sent(number) = self.state
            && is_included(number, commands)
        {
            self.state = State::InForce;
        }
    }
}

impl<const N: usize> Responder<N> {
    /// Configures the drive base.
    ///
    /// # Errors
    /// Refuses a wheel that the hub does not have, a wheel whose motor is enabled, and a gyro on a board without I2C.
    pub(super) fn set_base(&mut self, base: BaseSettings) -> Result<Reply, Nack> {
        self.check_base(&base)?;
        let is_enabled =
            |wheel: &u8| self.channels.get(usize::from(*wheel)).is_some_and(MotorChannel::enabled);
        if base.wheels.iter().any(is_enabled) {
            return Err(Nack::MOTOR_ENABLED);
        }
        self.changed = true;
        self.command_base(Some(base));
        Ok(Reply::ACK)
    }

    /// Checks that the hub has what a drive base needs.
    ///
    /// # Errors
    /// Refuses a wheel that the hub does not have, and a gyro on a board without I2C.
    pub(super) fn check_base(&self, base: &BaseSettings) -> Result<(), Nack> {
        for (index, wheel) in (0..).zip(base.wheels) {
            if usize::from(wheel) >= N {
                return Err(Nack::parameter(index));
            }
        }
        if base.use_gyro && self.outputs.equipment.i2c == 0 {
            return Err(Nack::UNSUPPORTED);
        }
        Ok(())
    }

    /// Replaces the drive base, which then starts at the origin. `None` removes the drive base.
    pub(super) const fn command_base(&mut self, settings: Option<BaseSettings>) {
        self.base = BaseCommand { settings, state: State::Pending };
    }

    /// Returns the odometry of the drive base.
    ///
    /// # Errors
    /// [`Nack::NO_BASE`] if no base is configured, [`Nack::NOT_MEASURED`] until control has applied the configuration.
    pub(super) fn odometry(&self, snapshot: &Snapshot<N>) -> Result<OdometryReport, Nack> {
        let settings = self.base.settings.ok_or(Nack::NO_BASE)?;
        let state = snapshot.base.filter(|_| self.base.state == State::InForce).ok_or(Nack::NOT_MEASURED)?;
        let mut counts = [0; 2];
        for ((counts, wheel), correction) in counts.iter_mut().zip(settings.wheels).zip(state.correction) {
            let wheel = usize::from(wheel);
            if let (Some(channel), Some(report)) = (self.channels.get(wheel), snapshot.motors.get(wheel)) {
                *counts = channel.counts(report).wrapping_sub(correction);
            }
        }
        Ok(OdometryReport {
            x_um: state.x_um,
            y_um: state.y_um,
            heading_millidegrees: state.heading_millidegrees,
            counts,
            gyro: state.gyro,
            losses: state.losses,
        })
    }
}
