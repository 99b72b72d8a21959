//! A running identification of a motor, and its progress and result for pages.

use crate::hub::{RequestError, or_refusal, within};
use crate::proposal::{catalogue_motor, inertia_ratio, proposal};
use motor_hub::extension::settings::MotorSettings;
use motor_hub::motor::Settings;
use motor_hub::regulator::Dynamics;
use motor_hub::regulator::identify::{self, Identified};
use motor_hub::units::Acceleration;
use motor_hub_client::identification::{Identifying, Progress as Step};
use motor_hub_client::{Error, Session};
use serde::Serialize;
use serde_json::{Value, json};

/// A running identification.
#[derive(Debug)]
pub(crate) struct Identification {
    pub(crate) motor: u8,
    identifying: Identifying,
}

/// Progress or result of an identification.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "state", rename_all = "kebab-case")]
pub(crate) enum Progress {
    /// Progress in percent, 0 to 100.
    Running {
        percent: u8,
    },
    Found {
        /// Proposed settings, of which the order `Apply` applies the dynamics and the acceleration limit.
        #[serde(skip)]
        proposal: Settings,
        found: Value,
    },
    Refused {
        why: String,
    },
}

impl Identification {
    /// Starts an identification: enables the motor with power 0, so that it brakes until it stands.
    pub(crate) fn begin(session: &mut Session, motor: u8, travel: Option<f64>) -> Result<Self, RequestError> {
        let most = f64::from(u32::MAX);
        let travel = within("a travel", travel.unwrap_or(most).round(), 0.0..=most, "counts")?;
        let identifying = Identifying::begin(session, motor, travel as u32)?;
        session.enable(motor, true)?;
        Ok(Self { motor, identifying })
    }

    /// Continues the identification. Returns the progress, or `None` if there is nothing new. A refusal of the hub ends
    /// the identification.
    ///
    /// # Errors
    /// The exchange with the hub fails.
    pub(crate) fn step(&mut self, session: &mut Session) -> Result<Option<Progress>, Error> {
        let progress = or_refusal(self.progress(session))?;
        Ok(progress.unwrap_or_else(|why| Some(Progress::Refused { why })))
    }

    fn progress(&mut self, session: &mut Session) -> Result<Option<Progress>, Error> {
        let outcome = match self.identifying.step(session)? {
            Step::Braking | Step::Started(_) => return Ok(None),
            Step::Turning(percent) => return Ok(Some(Progress::Running { percent })),
            Step::Ended(outcome) => outcome,
        };
        Ok(Some(match outcome {
            identify::Identification::Found(found) => {
                let (before, battery) = (session.settings(self.motor)?, session.battery()?);
                let proposed = proposal(&before, &found.dynamics, battery);
                Progress::Found { proposal: proposed.motor, found: found_json(&found, &before, &proposed) }
            }
            identify::Identification::Refused(why) => Progress::Refused { why: why.to_string() },
            _ => Progress::Refused { why: "the identification was interrupted".to_owned() },
        }))
    }
}

/// Dynamics of a motor as JSON: acceleration per volt in counts/s² per volt, decay in 1/s, friction in volts.
pub(crate) fn dynamics_json(dynamics: &Dynamics) -> Value {
    json!({
        "gain": f64::from(dynamics.gain.to_f32()),
        "decay": f64::from(dynamics.decay.to_f32()),
        "friction_v": f64::from(dynamics.friction.get()) / 1e3,
    })
}

/// Result of an identification as JSON. The errors are standard errors as shares of their values. `residual` is the
/// share of the changes of speed that the identified dynamics do not explain. `acceleration` has the largest
/// acceleration before and as proposed, in counts/s²; `null` is no limit. `catalogue` has the configured motor of the
/// catalogue without a load, and the inertia of the identified motor with its load in relation to it; `null` for other
/// constants.
fn found_json(found: &Identified, before: &MotorSettings, proposed: &MotorSettings) -> Value {
    let mut result = dynamics_json(&found.dynamics);
    result["emf_mv_s_per_count"] = found.emf.to_millivolt_seconds().into();
    result["gain_error"] = (f64::from(found.gain_error) / 1e3).into();
    result["decay_error"] = (f64::from(found.decay_error) / 1e3).into();
    result["residual"] = (f64::from(found.residual) / 1e3).into();
    result["acceleration"] = json!([before, proposed].map(|of| of.motor.acceleration.map(Acceleration::get)));
    result["catalogue"] = Value::Null;
    if let Some((motor, bare)) = catalogue_motor(&before.motor) {
        let mut catalogue = dynamics_json(&bare);
        catalogue["name"] = motor.name.into();
        catalogue["inertia_ratio"] = inertia_ratio(&bare, &found.dynamics).into();
        result["catalogue"] = catalogue;
    }
    result
}
