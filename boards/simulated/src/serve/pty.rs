//! A pseudo-terminal: one end for the hub, and a path in `/dev` that hosts open as a serial port.

use rustix::fs::{Mode, OFlags, fcntl_setfl};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{self, OptionalActions};
use std::os::fd::OwnedFd;

#[derive(Debug)]
pub(super) struct Pty {
    ours: OwnedFd,
    /// Held open, so that hosts may come and go: the settings of a terminal that nobody has open are
    /// forgotten, and reading the other end of it fails.
    theirs: OwnedFd,
    path: String,
}

impl Pty {
    pub(super) fn open() -> Result<Self, Errno> {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&ours)?;
        unlockpt(&ours)?;
        let name = ptsname(&ours, Vec::new())?;
        let theirs = rustix::fs::open(&name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty())?;
        // Bytes as they are, not lines: what a serial port's driver does when a host asks for it.
        let mut settings = termios::tcgetattr(&theirs)?;
        settings.make_raw();
        termios::tcsetattr(&theirs, OptionalActions::Now, &settings)?;
        fcntl_setfl(&ours, OFlags::NONBLOCK)?;
        let path = name.to_string_lossy().into_owned();
        Ok(Self { ours, theirs, path })
    }

    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// Bytes that have come; 0 if there are none now.
    pub(super) fn receive(&self, bytes: &mut [u8]) -> usize {
        // A host that was killed while it had the port to itself would keep the next one out.
        let _ = termios::ioctl_tiocnxcl(&self.theirs);
        rustix::io::read(&self.ours, bytes).unwrap_or(0)
    }

    /// How many bytes were taken; 0 if the line is busy.
    pub(super) fn send(&self, bytes: &[u8]) -> usize {
        rustix::io::write(&self.ours, bytes).unwrap_or(0)
    }
}
