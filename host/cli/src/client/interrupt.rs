//! Signals that end a command which drives motors: Ctrl-C, SIGTERM, SIGQUIT, a closed terminal, Ctrl-Z. The command ends as
//! after any error: it disables the motors that it has enabled. Further signals do not interrupt that.
//!
//! Ctrl-Z would suspend the command: its motors would turn until the hub's keep-alive has ended, and turn again when the
//! command continues.

use crate::output::Failure;
#[cfg(unix)]
use signal_hook::consts::{SIGHUP, SIGQUIT, SIGTSTP};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::register_usize;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Signals that end the program in good order, with their names for messages.
pub(crate) const SIGNALS: &[(i32, &str)] = &[
    (SIGINT, "Ctrl-C"),
    (SIGTERM, "SIGTERM"),
    #[cfg(unix)]
    (SIGHUP, "SIGHUP: the terminal is gone"),
    #[cfg(unix)]
    (SIGQUIT, "SIGQUIT"),
];

/// Signals that end a command which drives motors, and only such a command.
const SUSPENDS: &[(i32, &str)] = &[
    #[cfg(unix)]
    (SIGTSTP, "Ctrl-Z"),
];

/// Interval between two checks for signals.
const LOOK: Duration = Duration::from_millis(5);

/// Time after a signal from which a command that has not ended counts as hanging. The next signal then ends the program;
/// by that time the hub's keep-alive has disabled the motors.
const HANGS: Duration = Duration::from_secs(3);

/// Name of the first signal received, and the condition variable that announces it.
static CAUGHT: (Mutex<Option<&str>>, Condvar) = (Mutex::new(None), Condvar::new());
static LISTENING: OnceLock<()> = OnceLock::new();

/// Makes signals end the command in good order instead of ending the program.
pub(super) fn listen() -> Result<(), Failure> {
    if LISTENING.set(()).is_err() {
        return Ok(());
    }
    let raised = Arc::new(AtomicUsize::new(0));
    for (place, (signal, _)) in (1..).zip(SIGNALS.iter().chain(SUSPENDS)) {
        register_usize(*signal, Arc::clone(&raised), place)
            .map_err(|error| Failure::Work(format!("no handler for signals could be installed: {error}")))?;
    }
    thread::spawn(move || watch(&raised));
    Ok(())
}

fn watch(raised: &AtomicUsize) {
    let mut first: Option<Instant> = None;
    loop {
        thread::sleep(LOOK);
        let place = raised.swap(0, Ordering::Relaxed);
        let mut signals = SIGNALS.iter().chain(SUSPENDS);
        let Some((_, name)) = place.checked_sub(1).and_then(|place| signals.nth(place)) else { continue };
        match first {
            None => {
                first = Some(Instant::now());
                *CAUGHT.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(name);
                CAUGHT.1.notify_all();
            }
            Some(first) if first.elapsed() > HANGS => std::process::exit(1),
            Some(_) => (),
        }
    }
}

/// Waits until a time; fails as soon as a signal has been received.
pub(super) fn wait(until: Instant) -> Result<(), Failure> {
    let length = until.saturating_duration_since(Instant::now());
    let caught = CAUGHT.0.lock().unwrap_or_else(PoisonError::into_inner);
    let waited = CAUGHT.1.wait_timeout_while(caught, length, |caught| caught.is_none());
    let (caught, _) = waited.unwrap_or_else(PoisonError::into_inner);
    caught.map_or(Ok(()), |name| Err(Failure::Work(format!("stopped by {name}"))))
}
