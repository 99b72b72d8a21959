//! The terminal as keys instead of lines.

use crate::output::Failure;
use rustix::termios::{OptionalActions, Termios, tcgetattr, tcsetattr};
use std::io::{Read, stdin};
use std::sync::mpsc::{Receiver, channel};

/// Keys come one by one, unseen, and none of them is a signal, until this is dropped.
pub(super) struct Raw(Termios);

impl Raw {
    pub(super) fn enter() -> Result<Self, Failure> {
        let before = tcgetattr(stdin())
            .map_err(|_| Failure::Work("standard input is no terminal, whose keys could drive".to_owned()))?;
        let mut raw = before.clone();
        raw.make_raw();
        tcsetattr(stdin(), OptionalActions::Now, &raw).map_err(Failure::work)?;
        Ok(Self(before))
    }
}

impl Drop for Raw {
    fn drop(&mut self) {
        // Where it fails the terminal is gone. Keys that are left over are not for the shell.
        let _ = tcsetattr(stdin(), OptionalActions::Flush, &self.0);
    }
}

/// What is typed, until the terminal is gone.
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
