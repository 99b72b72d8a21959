//! The drive base: its configuration by a host, and the report of its odometry.

use super::Responder;
use crate::extension::base::OdometryReport;
use crate::group::BaseSettings;
use crate::hub::Snapshot;
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
    /// The snapshot includes the configuration, if there is one.
    #[default]
    InForce,
}

impl BaseCommand {
    /// Returns the configuration that must be sent.
    pub(super) fn pending(&self) -> Option<BaseSettings> {
        self.settings.filter(|_| self.state == State::Pending)
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
        for (index, wheel) in (0..).zip(base.wheels) {
            let channel = self.channels.get(usize::from(wheel)).ok_or(Nack::parameter(index))?;
            if channel.enabled() {
                return Err(Nack::MOTOR_ENABLED);
            }
        }
        if base.use_gyro && self.outputs.equipment.i2c == 0 {
            return Err(Nack::UNSUPPORTED);
        }
        self.base = BaseCommand { settings: Some(base), state: State::Pending };
        Ok(Reply::ACK)
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
