//! Motors by name, for people: an unknown name is answered with the names that exist.

use motor_hub::model::catalogue::{Motor, find, motors};

/// The motor of this name; letters and digits count, in either case.
///
/// # Errors
/// What is wrong with the name, and which names there are.
pub fn find_motor(name: &str) -> Result<Motor, String> {
    let known = || motors().map(|m| m.name).collect::<Vec<_>>().join(", ");
    match find(name).map(|entry| entry.motor) {
        Some(Some(motor)) => Ok(motor),
        Some(None) => Err(format!("motor {name:?} was never characterised; known are {}", known())),
        None => Err(format!("no motor {name:?}; known are {}", known())),
    }
}
