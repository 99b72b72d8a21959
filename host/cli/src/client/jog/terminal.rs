//! Reads single keys from the terminal instead of lines.

use crate::output::Failure;
use rustix::termios::{OptionalActions, Termios, tcgetattr, tcsetattr};
use std::io::{Read, stdin};
use std::sync::mpsc::{Receiver, channel};

/// Raw mode of the terminal until dropped: keys arrive one by one, are not echoed, and raise no signals.
pub(super) struct Raw(Termios);

impl Raw {
    pub(super) fn enter() -> Result<Self, Failure> {
        let before = tcgetattr(stdin())
            .map_err(|_| Failure::Work("standard input is not a terminal; jog needs its keys".to_owned()))?;
        let mut raw = before.clone();
        raw.make_raw();
        tcsetattr(stdin(), OptionalActions::Now, &raw).map_err(Failure::work)?;
        Ok(Self(before))
    }
}

impl Drop for Raw {
    fn drop(&mut self) {
        // This call fails only if the terminal is gone. `Flush` drops unread keys, so that the shell does not receive
        // them.
        let _ = tcsetattr(stdin(), OptionalActions::Flush, &self.0);
    }
}

/// Starts a thread that sends the typed bytes until the terminal is gone.
pub(super) fn keys() -> Receiver<Vec<u8>> {
    let (typed, keys) = channel();
    std::thread::spawn(move || {
        let mut bytes = [0; 64];
        while let Ok(count @ 1..) = stdin().lock().read(&mut bytes) {
            let typed = typed.send(bytes.get(..count).unwrap_or_default().to_vec());
            if typed.is_err() {
                break;
            }
        }
    });
    keys
}
