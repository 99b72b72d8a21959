//! Ctrl-C while motors run: the command ends as on any error, by disabling what it has enabled.

use crate::output::Failure;
use signal_hook::consts::SIGINT;
use signal_hook::flag::{register, register_conditional_shutdown};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

static PRESSED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// From now on Ctrl-C is noted; pressed once more, before anybody has looked, it ends the program at once.
pub(super) fn listen() -> Result<(), Failure> {
    let pressed = PRESSED.get_or_init(Arc::default);
    let impatient = register_conditional_shutdown(SIGINT, 1, Arc::clone(pressed));
    let noted = impatient.and_then(|_| register(SIGINT, Arc::clone(pressed)));
    noted.map(drop).map_err(|error| Failure::Work(format!("Ctrl-C cannot be listened for: {error}")))
}

/// An error if it was pressed since.
pub(super) fn check() -> Result<(), Failure> {
    let pressed = PRESSED.get().is_some_and(|pressed| pressed.load(Ordering::Relaxed));
    if pressed { Err(Failure::Work("stopped by Ctrl-C".to_owned())) } else { Ok(()) }
}
