//! Identifies a motor, one step at a time: brakes the motor until it stands, starts the identification, and reads its
//! result.
//!
//! ```
//! use motor_hub_client::identification::{Identifying, Progress};
//! use motor_hub_client::motor_hub::protocol::Address;
//! use motor_hub_client::{Session, memory::MemoryHub};
//! use std::time::Duration;
//!
//! let mut session = Session::new(MemoryHub::default(), Address::DEFAULT, Duration::from_secs(1));
//! let mut identifying = Identifying::begin(&mut session, 0, 2_000)?;
//! // With its power 0, an enabled motor brakes until it stands.
//! assert_eq!(identifying.step(&mut session)?, Progress::Braking);
//! # Ok::<(), motor_hub_client::Error>(())
//! ```

use crate::clock::Instant;
use crate::{Error, Session};
use motor_hub::regulator::identify::Identification;
use std::time::Duration;

/// Time without a count after which a braked motor counts as standing.
const STANDSTILL_TIME: Duration = Duration::from_millis(300);

/// Longest wait for a braked motor to stand. If the motor still turns after this time, its load drives the motor. The
/// identification then ends with `Refusal::NotAtRest`.
const LONGEST_REST: Duration = Duration::from_secs(5);

/// An identification of one motor.
#[derive(Clone, Debug)]
pub struct Identifying {
    motor: u8,
    travel_limit: u32,
    begun: Instant,
    /// Last position in counts, and the time of the reading at which the motor reached this position.
    position: Option<(i32, Instant)>,
    started: bool,
}

/// Result of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// The motor is braked and does not stand yet.
    Braking,
    /// The hub has accepted the identification. The motor will turn at most this number of counts in either direction:
    /// the requested limit, or less if the hub permits less.
    Started(u32),
    /// The identification runs. The number is the progress in percent.
    Turning(u8),
    /// The identification has ended.
    Ended(Identification),
}

impl Identifying {
    /// Selects constant power 0 for a motor, so that the motor brakes when it is enabled. The caller then enables the
    /// motor, takes steps until the identification has ended, and disables the motor.
    pub fn begin(session: &mut Session, motor: u8, travel_limit: u32) -> Result<Self, Error> {
        session.brake(motor)?;
        Ok(Self { motor, travel_limit, begun: Instant::now(), position: None, started: false })
    }

    /// Takes one step of the identification. The first steps wait until the motor stands. The next step starts the
    /// identification, and later steps ask the hub for the progress. Call this function about ten times a second.
    ///
    /// # Errors
    /// [`Session::request`] lists the errors of all commands. The hub refuses to start if the battery is low, or if the
    /// motor is not enabled in the mode `Power` with power 0. A motor that still turns is no error: a later step
    /// returns [`Progress::Ended`].
    pub fn step(&mut self, session: &mut Session) -> Result<Progress, Error> {
        if self.started {
            return Ok(match session.identification(self.motor)? {
                Identification::Running(percent) => Progress::Turning(percent),
                outcome => Progress::Ended(outcome),
            });
        }
        let position = session.bulk()?.encoders.get(usize::from(self.motor)).copied().unwrap_or_default();
        let since = match self.position {
            Some((before, since)) if before == position => since,
            _ => Instant::now(),
        };
        self.position = Some((position, since));
        if since.elapsed() < STANDSTILL_TIME && self.begun.elapsed() < LONGEST_REST {
            return Ok(Progress::Braking);
        }
        let travel = session.identify(self.motor, self.travel_limit)?;
        self.started = true;
        Ok(Progress::Started(travel))
    }
}
