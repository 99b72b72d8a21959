//! A session with a hub, and errors of its requests.

use motor_hub::protocol::{Address, CHANNELS};
use motor_hub_client::kept_settings::ImportError;
use motor_hub_client::{Error, Line, Session};
use std::ops::RangeInclusive;
use std::time::Duration;

/// A session that is open, and the hubs on its line.
#[derive(Debug)]
pub struct Opened {
    /// The session, with the hub that is shown first.
    pub session: Session,
    /// Addresses of the hubs. The first hub is the hub on the line, which is the parent of a chain.
    pub hubs: Vec<u8>,
}

impl Opened {
    /// Finds the parent on a line, and the hubs behind the parent.
    ///
    /// # Errors
    /// Not exactly one hub answers as parent.
    pub fn with_parent(line: impl Into<Line>, timeout: Duration) -> Result<Self, Error> {
        let mut session = Session::new(line, Address::DEFAULT, timeout);
        let found = session.find_parent()?;
        let mut found: Vec<_> = found.iter().filter(|hub| !hub.duplicate).collect();
        found.sort_by_key(|hub| (!hub.parent, hub.address));
        let hubs = found.iter().map(|hub| hub.address).collect();
        Ok(Self { session, hubs })
    }
}

impl From<Session> for Opened {
    /// A session with the only hub.
    fn from(session: Session) -> Self {
        Self { hubs: vec![session.address()], session }
    }
}

/// Opens a session with a hub at `HOST:PORT` or on a serial port, as [`Session::open`]. Without an address the session
/// is with the parent.
///
/// # Errors
/// The line cannot be opened. Without an address, it is also an error if not exactly one hub answers as parent.
#[cfg(feature = "server")]
pub fn open(place: &str, address: Option<Address>) -> Result<Opened, motor_hub_client::OpenError> {
    /// Time-out of answers.
    const TIMEOUT: Duration = Duration::from_secs(1);
    let line = Line::open(place, TIMEOUT)?;
    Ok(match address {
        Some(address) => Session::new(line, address, TIMEOUT).into(),
        None => Opened::with_parent(line, TIMEOUT)?,
    })
}

/// Why an order was not executed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RequestError {
    /// The server or the hub refuses the order.
    #[error("{0}")]
    Refused(String),
    /// The exchange with the hub failed; the hub may be gone.
    #[error("{0}")]
    Hub(Error),
}

/// Returns the value of an answer, or the text of a refusal as the inner error.
///
/// # Errors
/// The exchange with the hub failed.
pub(crate) fn or_refusal<T>(answer: Result<T, impl Into<RequestError>>) -> Result<Result<T, String>, Error> {
    match answer.map_err(Into::into) {
        Ok(value) => Ok(Ok(value)),
        Err(RequestError::Refused(why)) => Ok(Err(why)),
        Err(RequestError::Hub(error)) => Err(error),
    }
}

/// Checks a motor's number.
pub(crate) fn channel(motor: u8) -> Result<u8, RequestError> {
    if usize::from(motor) < CHANNELS { Ok(motor) } else { Err(no_motor(motor)) }
}

/// Returns the element of a list for the motor with this number.
pub(crate) fn of_motor<T>(list: &mut [T], motor: u8) -> Result<&mut T, RequestError> {
    list.get_mut(usize::from(motor)).ok_or_else(|| no_motor(motor))
}

fn no_motor(motor: u8) -> RequestError {
    format!("there is no motor {motor}; allowed is 0 to {}", CHANNELS - 1).into()
}

/// Returns a value that is in the allowed range. `what` names the quantity ("a power"), `unit` is "" for none.
///
/// # Errors
/// A text with the value and the allowed range.
pub(crate) fn within(
    what: &str,
    value: f64,
    allowed: RangeInclusive<f64>,
    unit: &str,
) -> Result<f64, RequestError> {
    if allowed.contains(&value) {
        return Ok(value);
    }
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let (least, most) = (allowed.start(), allowed.end());
    Err(format!("{what} of {value}{unit} is out of range; allowed is {least} to {most}{unit}").into())
}

impl From<String> for RequestError {
    fn from(why: String) -> Self {
        Self::Refused(why)
    }
}

impl From<&str> for RequestError {
    fn from(why: &str) -> Self {
        Self::Refused(why.to_owned())
    }
}

impl From<Error> for RequestError {
    fn from(error: Error) -> Self {
        match error {
            Error::Refused { .. }
            | Error::TooOld { .. }
            | Error::Unexpected { .. }
            | Error::Unconfirmed { .. } => Self::Refused(error.to_string()),
            error => Self::Hub(error),
        }
    }
}

impl From<ImportError> for RequestError {
    fn from(error: ImportError) -> Self {
        match error {
            ImportError::Lost(error) => error.into(),
            error => Self::Refused(error.to_string()),
        }
    }
}
