//! The drive base: its configuration by a host, and the report of its odometry.

use super::Responder;
use super::motor::MotorChannel;
use crate::extension::base::OdometryReport;
use crate::group::BaseSettings;
use crate::hub::Snapshot;
use crate::protocol::{Nack, Reply};

impl<const N: usize> Responder<N> {
    /// Configures the drive base.
    ///
    /// # Errors
    /// Refuses a wheel that the hub does not have, and a gyro on a board without I2C. Refuses any base while the motor
    /// of a new wheel, or of a wheel of the base in force, is enabled.
    pub(super) fn set_base(&mut self, base: BaseSettings) -> Result<Reply, Nack> {
        self.check_base(&base)?;
        let is_enabled =
            |wheel: &u8| self.channels.get(usize::from(*wheel)).is_some_and(MotorChannel::enabled);
        // The wheels of the base in force may have corrected positions. Without this base their positions would jump.
        let replaced = self.base.iter().flat_map(|base| &base.wheels);
        if base.wheels.iter().chain(replaced).any(is_enabled) {
            return Err(Nack::MOTOR_ENABLED);
        }
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
        (self.base, self.base_due) = (settings, true);
    }

    /// Returns the odometry of the drive base.
    ///
    /// # Errors
    /// Returns [`Nack::NO_BASE`] if no base is configured. Returns [`Nack::NOT_MEASURED`] until a snapshot includes the
    /// newest configuration.
    pub(super) fn odometry(&self, snapshot: &Snapshot<N>) -> Result<OdometryReport, Nack> {
        let settings = self.base.ok_or(Nack::NO_BASE)?;
        let in_force = !self.base_due && self.base_awaited.is_none();
        let state = snapshot.base.filter(|_| in_force).ok_or(Nack::NOT_MEASURED)?;
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
