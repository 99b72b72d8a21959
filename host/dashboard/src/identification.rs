//! A running identification of a motor, and its progress and result for pages.

use crate::hub::{Hub, RequestError, or_refusal};
use crate::proposal::{catalogue_motor, inertia_ratio, proposal};
use motor_hub::extension::settings::MotorSettings;
use motor_hub::regulator::identify::{self, Identified};
use motor_hub::units::Acceleration;
use motor_hub_client::Error;
use motor_hub_client::clock::Instant;
use motor_hub_client::identification::{Identifying, Progress as Step};
use serde::Serialize;
use std::time::Duration;

/// Interval between requests for the progress of a running identification.
const INTERVAL: Duration = Duration::from_millis(100);

/// A running identification.
#[derive(Debug)]
pub(crate) struct Identification {
    pub(crate) motor: u8,
    identifying: Identifying,
    /// Time of the last request for the progress.
    asked: Instant,
}

/// Progress or result of an identification.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "state", rename_all = "kebab-case")]
pub(crate) enum Progress {
    Running {
        /// Progress in percent, 0 to 100.
        percent: u8,
    },
    Found {
        /// Proposed dynamics and acceleration limit, which the order `Apply` applies.
        #[serde(skip)]
        proposal: (motor_hub::regulator::Dynamics, Option<Acceleration>),
        found: Found,
    },
    Refused {
        why: String,
    },
}

/// Response of a motor to a voltage.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Dynamics {
    /// Acceleration per volt, in counts/s² per volt.
    gain: f64,
    /// Decay in 1/s.
    decay: f64,
    /// Friction in volts.
    friction_v: f64,
}

/// Result of an identification.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Found {
    #[serde(flatten)]
    dynamics: Dynamics,
    /// Back EMF with drag, in mV s/count.
    emf_mv_s_per_count: f64,
    /// Standard error of the acceleration per volt, as a share of the acceleration per volt.
    gain_error: f64,
    /// Standard error of the decay, as a share of the decay.
    decay_error: f64,
    /// Share of the changes of speed that the identified dynamics do not explain.
    residual: f64,
    /// Largest acceleration before and as proposed, in counts/s²; `None` for no limit.
    acceleration: [Option<u32>; 2],
    /// The configured motor in the catalogue; `None` for other constants.
    catalogue: Option<Bare>,
}

/// The configured motor of the catalogue without a load, for comparison with the identified motor.
#[derive(Clone, Copy, Debug, Serialize)]
struct Bare {
    name: &'static str,
    #[serde(flatten)]
    dynamics: Dynamics,
    /// Inertia of the identified motor with its load, divided by the inertia of the catalogue motor without a load.
    inertia_ratio: f64,
}

impl Identification {
    /// Starts an identification: enables the motor with power 0, so that it brakes until it stands.
    pub(crate) fn begin(session: &mut Hub, motor: u8, travel: Option<u32>) -> Result<Self, RequestError> {
        let identifying = Identifying::begin(session, motor, travel.unwrap_or(u32::MAX))?;
        session.enable(motor, true)?;
        Ok(Self { motor, identifying, asked: Instant::now() })
    }

    /// Continues the identification. Returns the progress, or `None` if there is nothing new. A refusal of the hub ends
    /// the identification.
    ///
    /// # Errors
    /// The exchange with the hub fails.
    pub(crate) fn step(&mut self, session: &mut Hub) -> Result<Option<Progress>, Error> {
        if self.asked.elapsed() < INTERVAL {
            return Ok(None);
        }
        self.asked = Instant::now();
        let progress = or_refusal(self.progress(session))?;
        Ok(progress.unwrap_or_else(|why| Some(Progress::Refused { why })))
    }

    fn progress(&mut self, session: &mut Hub) -> Result<Option<Progress>, Error> {
        let outcome = match self.identifying.step(session)? {
            Step::Braking | Step::Started(_) => return Ok(None),
            Step::Turning(percent) => return Ok(Some(Progress::Running { percent })),
            Step::Ended(outcome) => outcome,
        };
        Ok(Some(match outcome {
            identify::Identification::Found(found) => {
                let (before, battery) = (session.settings(self.motor)?, session.battery()?);
                let proposed = proposal(&before, &found.dynamics, battery);
                Progress::Found {
                    proposal: (found.dynamics, proposed.motor.acceleration),
                    found: Found::of(&found, &before, &proposed),
                }
            }
            identify::Identification::Refused(why) => Progress::Refused { why: why.to_string() },
            _ => Progress::Refused { why: "the identification was interrupted".to_owned() },
        }))
    }
}

impl Dynamics {
    pub(crate) fn of(known: motor_hub::regulator::Dynamics) -> Self {
        Self {
            gain: known.gain.to_f32().into(),
            decay: known.decay.to_f32().into(),
            friction_v: f64::from(known.friction.get()) / 1e3,
        }
    }
}

impl Found {
    fn of(found: &Identified, before: &MotorSettings, proposed: &MotorSettings) -> Self {
        let catalogue = catalogue_motor(&before.motor).map(|(motor, bare)| Bare {
            name: motor.name,
            dynamics: Dynamics::of(bare),
            inertia_ratio: inertia_ratio(&bare, &found.dynamics),
        });
        let acceleration = |of: &MotorSettings| of.motor.acceleration.map(Acceleration::get);
        Self {
            dynamics: Dynamics::of(found.dynamics),
            emf_mv_s_per_count: f64::from(found.emf.to_bits()) / f64::from(1 << 20),
            gain_error: f64::from(found.gain_error) / 1e3,
            decay_error: f64::from(found.decay_error) / 1e3,
            residual: f64::from(found.residual) / 1e3,
            acceleration: [acceleration(before), acceleration(proposed)],
            catalogue,
        }
    }
}
