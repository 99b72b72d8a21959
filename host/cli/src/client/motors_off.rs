//! Disables motors that a command has enabled when the command ends: normally, by an error, by a panic or by a signal
//! other than SIGKILL. Also disables motors, servos and digital outputs that a former host has left on, before a command
//! sends its own requests.

use super::interrupt;
use crate::output::{Failure, print_error_line};
use motor_hub_client::devices::LeftOutputs;
use motor_hub_client::{Error, KEEP_ALIVE, Session};
use std::ops::{Deref, DerefMut};
use std::time::Duration;

/// Longest time-out of the request that disables a motor, so that the other motors need not wait longer. A shorter
/// `--timeout-ms` stays in force.
const REQUEST_TIMEOUT: Duration = Duration::from_millis(500);

/// A session whose motors are disabled when it is dropped.
pub(super) struct DrivingSession<'a> {
    session: &'a mut Session,
    /// Motors that may be enabled. A motor is listed before the request is sent, because the hub's answer may be lost.
    motors: Vec<u8>,
}

impl<'a> DrivingSession<'a> {
    /// Runs `work`, then disables the motors that it has enabled: after success, an error, a panic, or a signal. `work`
    /// notices a signal by `interrupt::wait`. After an error, a panic or a signal, standard error names the disabled
    /// motors.
    pub(super) fn run<T>(
        session: &'a mut Session,
        work: impl FnOnce(&mut Self) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        interrupt::listen()?;
        let mut driven = Self { session, motors: Vec::new() };
        let done = work(&mut driven);
        match (done, driven.stop()) {
            (Ok(done), Ok(_)) => Ok(done),
            (Ok(_), Err(failure)) => Err(failure),
            (Err(failure), stopped) => {
                let answers = stopped.is_ok();
                report(stopped);
                // A hub that was reset refuses a request for a reason that does not name the reset.
                if answers && driven.session.report().is_ok() && driven.session.resets() > 0 {
                    print_error_line("note: the hub was reset meanwhile");
                }
                Err(failure)
            }
        }
    }

    /// Enables a motor. The motor is disabled when the work ends. A motor that the hub refuses to enable is disabled
    /// immediately, because the hub may have enabled it before a retransmission that it has refused.
    pub(super) fn enable(&mut self, motor: u8) -> Result<(), Error> {
        if !self.motors.contains(&motor) {
            self.motors.push(motor);
        }
        let enabled = self.session.enable(motor, true);
        if matches!(enabled, Err(Error::Refused { .. })) {
            self.disable(motor)?;
        }
        enabled
    }

    /// Disables a motor before the work ends.
    pub(super) fn disable(&mut self, motor: u8) -> Result<(), Error> {
        self.session.enable(motor, false)?;
        self.motors.retain(|other| *other != motor);
        Ok(())
    }

    /// Disables the motors that were enabled, and returns them.
    pub(super) fn stop(&mut self) -> Result<Vec<u8>, Failure> {
        let motors = std::mem::take(&mut self.motors);
        self.session.limit_timeout(REQUEST_TIMEOUT);
        match self.session.disable_all(&motors) {
            Ok(()) => Ok(motors),
            Err(error) => Err(Failure::Work(format!(
                "{} could not be disabled: {error}; the hub disables all motors {} s after the last packet",
                names(&motors),
                KEEP_ALIVE.as_secs_f64()
            ))),
        }
    }
}

/// Prints which motors were disabled, or that they could not be disabled.
pub(super) fn report(stopped: Result<Vec<u8>, Failure>) {
    match stopped {
        Ok(motors) if motors.is_empty() => (),
        Ok(motors) => print_error_line(&format!("disabled {}", names(&motors))),
        Err(failure) => print_error_line(&format!("warning: {failure}")),
    }
}

/// Returns a text such as "motor 0" or "motors 0, 2".
pub(super) fn names(motors: &[u8]) -> String {
    numbered("motor", motors.iter().copied())
}

fn numbered(what: &str, numbers: impl Iterator<Item = u8>) -> String {
    let numbers: Vec<String> = numbers.map(|number| number.to_string()).collect();
    format!("{what}{} {}", if numbers.len() == 1 { "" } else { "s" }, numbers.join(", "))
}

impl Drop for DrivingSession<'_> {
    fn drop(&mut self) {
        // The list has motors only if the work has panicked.
        if !self.motors.is_empty() {
            report(self.stop());
        }
    }
}

impl Deref for DrivingSession<'_> {
    type Target = Session;

    fn deref(&self) -> &Session {
        self.session
    }
}

impl DerefMut for DrivingSession<'_> {
    fn deref_mut(&mut self) -> &mut Session {
        self.session
    }
}

/// Disables motors, servos and digital outputs that a former host has left on, and reports that.
pub(super) fn disable_left_enabled(session: &mut Session) -> Result<(), Error> {
    let found = session.disable_left_enabled()?;
    if !found.is_empty() {
        print_error_line(&format!("disabled {}, left running by another host", names(&found)));
    }
    let LeftOutputs { servos, pins } = session.end_left_outputs()?;
    if !servos.is_empty() {
        let servos = numbered("servo", servos.iter().map(|servo| servo.get()));
        print_error_line(&format!("disabled {servos}, left running by another host"));
    }
    if !pins.is_empty() {
        let pins = numbered("digital pin", pins.iter().map(|pin| pin.get()));
        print_error_line(&format!("released {pins}, left as output by another host"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use motor_hub::units::{Control, Millivolts};
    use motor_hub_client::memory::MemoryHub;
    use motor_hub_client::motor_hub::protocol::Address;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    fn session() -> Session {
        let mut hub = MemoryHub::default();
        hub.snapshot.battery = Some(Millivolts::new(12_000));
        Session::new(hub, Address::DEFAULT, Duration::from_secs(1))
    }

    #[test]
    fn a_motor_that_the_hub_refuses_to_enable_is_not_named_as_disabled() {
        let mut session = session();
        let done = DrivingSession::run(&mut session, |driven| {
            // No target is set.
            assert!(matches!(driven.enable(1), Err(Error::Refused { .. })));
            assert!(driven.motors.is_empty(), "{:?}", driven.motors);
            Ok(())
        });
        assert!(done.is_ok());
    }

    #[test]
    fn a_panic_disables_what_was_enabled() {
        let mut session = session();
        let panicked = catch_unwind(AssertUnwindSafe(|| {
            DrivingSession::run(&mut session, |driven| -> Result<(), Failure> {
                driven.set_power(1, Control::MAX)?;
                driven.enable(1)?;
                assert!(driven.enabled(1)?);
                panic!("in the middle of it")
            })
        }));
        assert!(panicked.is_err());
        assert!(!session.enabled(1).unwrap());
    }
}
