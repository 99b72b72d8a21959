//! Reads the settings of motors before a change, and restores these settings if the change fails.

use crate::{Error, Session};
use motor_hub::extension::Request;
use motor_hub::extension::settings::{Group, MotorSettings, Values};
use motor_hub::group::BaseSettings;
use motor_hub::protocol::motor::{Loop, LoopCoefficients};
use motor_hub::regulator::Kind;

/// All settings of a motor.
#[derive(Clone, Debug)]
pub struct KeptSettings {
    /// All settings except the coefficients of the loops.
    pub settings: MotorSettings,
    /// Coefficients of velocity and position loop; `None` if the model regulated the motor.
    loops: Option<[LoopCoefficients; 2]>,
}

/// Settings that were not put in force.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The hub refuses a setting. The settings before the import are in force again.
    #[error("{part}: {error}; the settings before the import are in force{failed}")]
    Refused {
        /// Part whose setting is refused: `motor 0` or `the drive base`.
        part: String,
        /// Reason of the refusal.
        error: Error,
        /// Text `; motor 0 could not be restored: `, followed by the reason, for each motor whose settings could not be
        /// restored.
        failed: String,
    },
    /// The exchange with the hub failed.
    #[error("{0}; some of the settings may be in force until the hub's next reset")]
    Lost(#[from] Error),
    /// The hub was reset.
    #[error("the hub was reset meanwhile, so that some of the settings are not in force: import them again")]
    Reset,
}

impl Session {
    /// Reads all settings of a motor, for [`restore_settings`](Self::restore_settings).
    pub fn keep_settings(&mut self, motor: u8) -> Result<KeptSettings, Error> {
        // The regulator in the report may be older than coefficients that a host has just set.
        self.catch_up()?;
        let settings = self.settings(motor)?;
        let report = self.report()?;
        let of = report.as_ref().and_then(|report| report.motors.get(usize::from(motor)));
        let loops = match of {
            Some(of) if of.regulator == Kind::Pid => {
                Some([self.coefficients(motor, Loop::Velocity)?, self.coefficients(motor, Loop::Position)?])
            }
            _ => None,
        };
        Ok(KeptSettings { settings, loops })
    }

    /// Restores all settings of a motor except its mode. Coefficients are restored only if PID regulated the motor when
    /// the settings were kept.
    pub fn restore_settings(&mut self, motor: u8, kept: &KeptSettings) -> Result<(), Error> {
        let present = self.settings(motor)?;
        for group in Group::ALL {
            let restored = match group {
                Group::Mode | Group::VelocityLoop | Group::PositionLoop => false,
                // Sending the set-up deletes the motion and the coefficients that a host has set, so the motion is sent
                // again after it.
                Group::SetUp | Group::Motion => true,
                _ => Values::of(group, &present) != Values::of(group, &kept.settings),
            };
            if restored {
                self.set(motor, group, &kept.settings)?;
            }
        }
        self.restore_coefficients(motor, kept)
    }

    /// Restores the coefficients of a motor if PID regulated the motor when the settings were kept.
    pub fn restore_coefficients(&mut self, motor: u8, kept: &KeptSettings) -> Result<(), Error> {
        for (of, pidf) in [Loop::Velocity, Loop::Position].into_iter().zip(kept.loops.into_iter().flatten()) {
            self.set_coefficients(motor, of, pidf)?;
        }
        Ok(())
    }

    /// Puts settings of motors and of the drive base in force. If the hub refuses one of the settings, the former
    /// settings are restored. `None` leaves the base unchanged. Returns the former settings of the motors. All motors
    /// must be disabled, because a change of the mode may put an earlier set-point in force.
    ///
    /// # Errors
    /// The hub refuses a setting, the exchange fails, or the hub is reset meanwhile.
    pub fn apply_settings(
        &mut self,
        settings: Vec<(u8, Vec<Values>)>,
        base: Option<BaseSettings>,
    ) -> Result<Vec<(u8, KeptSettings)>, ImportError> {
        let mut kept: Vec<(u8, KeptSettings)> = Vec::new();
        self.report()?;
        let resets = self.resets();
        // A hub with fewer motors refuses to report the settings of a motor. No setting has changed then.
        for &(motor, _) in &settings {
            match self.keep_settings(motor) {
                Ok(before) => kept.push((motor, before)),
                Err(error) => return Err(self.refused(format!("motor {motor}"), error, &[])),
            }
        }
        for (motor, values) in settings {
            for values in values {
                if let Err(error) = self.command(Request::Set(motor, values)) {
                    return Err(self.refused(format!("motor {motor}"), error, &kept));
                }
            }
        }
        if let Some(Err(error)) = base.map(|base| self.set_base(base)) {
            return Err(self.refused("the drive base".to_owned(), error, &kept));
        }
        self.report()?;
        if self.resets() == resets { Ok(kept) } else { Err(ImportError::Reset) }
    }

    /// Restores the settings of motors after the hub has refused to set `part`. After any other error the settings are
    /// not restored.
    fn refused(&mut self, part: String, error: Error, kept: &[(u8, KeptSettings)]) -> ImportError {
        match error {
            Error::Refused { .. } | Error::TooOld { .. } | Error::Unexpected { .. } => self
                .roll_back(kept)
                .map_or_else(|lost| lost, |failed| ImportError::Refused { part, error, failed }),
            error => ImportError::Lost(error),
        }
    }

    /// Restores the settings and the modes of motors. The text names the motors whose settings could not be restored.
    fn roll_back(&mut self, kept: &[(u8, KeptSettings)]) -> Result<String, ImportError> {
        let mut failed = String::new();
        for (motor, before) in kept {
            let restored = self
                .restore_settings(*motor, before)
                .and_then(|()| self.set(*motor, Group::Mode, &before.settings));
            match restored {
                Ok(()) => (),
                Err(why @ Error::Refused { .. }) => {
                    failed.push_str(&format!("; motor {motor} could not be restored: {why}"));
                }
                Err(error) => return Err(error.into()),
            }
        }
        Ok(failed)
    }
}
