//! Identification of a motor: from the moving motor to the result, one step at a time.
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
use std::io::{Read, Write};
use std::time::Duration;

/// Time without motion after which a braked motor stands.
const STANDS: Duration = Duration::from_millis(300);

/// Longest wait for a braked motor to stand. If the motor still turns after this time, its load drives the motor. The
/// identification then ends with `Refusal::NotAtRest`.
const LONGEST_REST: Duration = Duration::from_secs(5);

/// An identification of one motor.
#[derive(Clone, Debug)]
pub struct Identifying {
    motor: u8,
    travel_limit: u32,
    begun: Instant,
    /// The last position in counts, and since when the motor has it.
    position: Option<(i32, Instant)>,
    started: bool,
}

/// What a step has found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// The motor brakes until it stands.
    Braking,
    /// The hub has accepted the identification. The motor will turn at most this number of counts in either direction: the
    /// limit that was asked for, or less if the hub permits less.
    Started(u32),
    /// The identification runs. The number is the progress in percent.
    Turning(u8),
    /// The identification has ended.
    Ended(Identification),
}

impl Identifying {
    /// Sets a motor's power to 0, with which it brakes. The caller then enables the motor, takes steps until the
    /// identification has ended, and disables the motor.
    ///
    /// # Errors
    /// See [`Session::ask`], as for all commands.
    pub fn begin<L: Read + Write>(
        session: &mut Session<L>,
        motor: u8,
        travel_limit: u32,
    ) -> Result<Self, Error> {
        session.brake(motor)?;
        Ok(Self { motor, travel_limit, begun: Instant::now(), position: None, started: false })
    }

    /// Takes one step of the identification. The first steps wait until the motor stands. The next step starts the
    /// identification, and later steps ask the hub for the progress. To be called some ten times a second.
    ///
    /// # Errors
    /// The errors of all commands. The hub refuses to start if the battery is low, or if the motor is not enabled in the
    /// mode `Power` with power 0. A motor that still turns is no error: a later step returns [`Progress::Ended`].
    pub fn step<L: Read + Write>(&mut self, session: &mut Session<L>) -> Result<Progress, Error> {
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
        if since.elapsed() < STANDS && self.begun.elapsed() < LONGEST_REST {
            return Ok(Progress::Braking);
        }
        let travel = session.identify(self.motor, self.travel_limit)?;
        self.started = true;
        Ok(Progress::Started(travel))
    }
}
