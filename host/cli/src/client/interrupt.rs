//! Signals that end a command which drives motors: Ctrl-C, SIGTERM, SIGQUIT, a closed terminal, Ctrl-Z, and on Windows
//! a closed console and the end of the session. The command ends as after an error: it disables the motors that it has
//! enabled. Further signals within 3 s are ignored.
//!
//! Ctrl-Z must not suspend the command. The motors of a suspended command would turn until the hub's keep-alive ends,
//! and would turn again when the command continues.

use crate::output::Failure;
#[cfg(unix)]
use signal_hook::consts::{SIGHUP, SIGQUIT, SIGTSTP};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag::register_usize;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

/// Name of the signal by which a user ends a command.
pub(super) const CTRL_C: &str = "Ctrl-C";

/// Signals that end the program in good order, with their names for messages.
pub(crate) const SIGNALS: &[(i32, &str)] = &[
    (SIGINT, CTRL_C),
    (SIGTERM, "SIGTERM"),
    #[cfg(unix)]
    (SIGHUP, "SIGHUP: the terminal is gone"),
    #[cfg(unix)]
    (SIGQUIT, "SIGQUIT"),
];

/// Signals that suspend a command. A command that has called [`listen`] ends instead.
const SUSPENDS: &[(i32, &str)] = &[
    #[cfg(unix)]
    (SIGTSTP, "Ctrl-Z"),
];

/// Interval between two checks for signals.
const CHECK_INTERVAL: Duration = Duration::from_millis(5);

/// Time after the first signal until a further signal ends the program immediately. If the command has sent no requests
/// for this time, the hub's keep-alive of 2.5 s has disabled its motors.
const FORCED_EXIT_AFTER: Duration = Duration::from_secs(3);

/// Name of the first signal received.
static RECEIVED_SIGNAL: OnceLock<&str> = OnceLock::new();

/// True for SIGHUP if this program was started to outlive its terminal, as by `nohup`. Only Linux reports that.
#[cfg(unix)]
pub(crate) fn is_ignored(signal: i32) -> bool {
    if signal != SIGHUP {
        return false;
    }
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_some_and(|mask| mask & 1 << (SIGHUP - 1) != 0)
}

#[cfg(not(unix))]
pub(crate) const fn is_ignored(_: i32) -> bool {
    false
}

/// Makes signals end the command in good order instead of ending the program. A command calls this function once.
pub(super) fn listen() -> Result<(), Failure> {
    let raised = Arc::new(AtomicUsize::new(0));
    let signals = (1..).zip(SIGNALS.iter().chain(SUSPENDS));
    for (number, (signal, _)) in signals.filter(|(_, (signal, _))| !is_ignored(*signal)) {
        register_usize(*signal, Arc::clone(&raised), number)
            .map_err(|error| Failure::Work(format!("no handler for signals could be installed: {error}")))?;
    }
    #[cfg(windows)]
    console::listen()
        .map_err(|error| Failure::Work(format!("no handler for the console could be installed: {error}")))?;
    thread::spawn(move || watch(&raised));
    Ok(())
}

fn watch(raised: &AtomicUsize) {
    let mut first: Option<Instant> = None;
    loop {
        thread::sleep(CHECK_INTERVAL);
        let number = raised.swap(0, Ordering::Relaxed);
        let mut signals = SIGNALS.iter().chain(SUSPENDS);
        let signal = number.checked_sub(1).and_then(|number| signals.nth(number)).map(|(_, name)| *name);
        #[cfg(windows)]
        let signal = signal.or_else(console::ended);
        let Some(name) = signal else { continue };
        match first {
            None => {
                first = Some(Instant::now());
                let _ = RECEIVED_SIGNAL.set(name);
            }
            Some(first) if first.elapsed() > FORCED_EXIT_AFTER => std::process::exit(1),
            Some(_) => (),
        }
    }
}

/// The console of Windows: its window is closed, its user logs off, or the computer shuts down.
#[cfg(windows)]
mod console {
    use std::io;
    use std::sync::atomic::{AtomicBool, Ordering};
    use windows_sys::Win32::System::Console::{
        CTRL_CLOSE_EVENT, CTRL_LOGOFF_EVENT, CTRL_SHUTDOWN_EVENT, SetConsoleCtrlHandler,
    };
    use windows_sys::core::BOOL;

    static ENDS: AtomicBool = AtomicBool::new(false);

    /// Installs the handler, which makes the end of the console end the command in good order.
    #[expect(unsafe_code, reason = "the standard library has no handler of the console")]
    pub(super) fn listen() -> io::Result<()> {
        // SAFETY: the handler is a function of the program, and touches one atomic.
        let done = unsafe { SetConsoleCtrlHandler(Some(handle), 1) };
        if done == 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
    }

    /// Returns the text for the end of the console at the first call after this event; otherwise `None`.
    pub(super) fn ended() -> Option<&'static str> {
        ENDS.swap(false, Ordering::Relaxed).then_some("the end of the console")
    }

    /// Windows calls this function in a separate thread, and ends the program when the function returns, or after 5 s.
    /// The function does not return, so the program has 5 s to disable its motors.
    #[expect(unsafe_code, reason = "the type that Windows asks for")]
    unsafe extern "system" fn handle(event: u32) -> BOOL {
        if !matches!(event, CTRL_CLOSE_EVENT | CTRL_LOGOFF_EVENT | CTRL_SHUTDOWN_EVENT) {
            return 0;
        }
        ENDS.store(true, Ordering::Relaxed);
        loop {
            std::thread::park();
        }
    }
}

/// Waits until the time `until`. Fails as soon as a signal has been received.
pub(super) fn wait(until: Instant) -> Result<(), Failure> {
    loop {
        if let Some(name) = RECEIVED_SIGNAL.get() {
            return Err(Failure::Stopped(name));
        }
        let rest = until.saturating_duration_since(Instant::now());
        if rest.is_zero() {
            return Ok(());
        }
        thread::sleep(rest.min(CHECK_INTERVAL));
    }
}
