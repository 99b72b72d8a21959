//! A pseudo-terminal: one end for the hub, and a path in `/dev` that hosts open as a serial port.

use super::line::Line;
#[cfg(target_os = "linux")]
use rustix::fs::inotify;
use rustix::fs::{Mode, OFlags, fcntl_setfl};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{self, OptionalActions};
use std::fmt::{self, Display, Formatter};
#[cfg(target_os = "linux")]
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

/// The hub's keep-alive time. A host that runs motors sends more often.
const KEEP_ALIVE: Duration = Duration::from_millis(2500);

#[derive(Debug)]
pub(super) struct Pty {
    ours: OwnedFd,
    /// The hosts' end, kept open. A terminal that is closed on this end loses its settings, and reading the hub's end
    /// fails.
    theirs: OwnedFd,
    path: String,
    /// Time of the last bytes of a host; `None` if the host has closed the port since.
    last_byte: Option<Instant>,
    /// True if the port was closed, and neither opened nor written to since. Replies are then dropped.
    shut: bool,
    /// True if bytes may be left from before the port was closed.
    backlog: bool,
    /// True if unread replies fill the port, so that the last reply could not be sent.
    #[cfg(target_os = "linux")]
    blocked: bool,
    /// Notifications of opening and closing the port; `None` if the system has none.
    #[cfg(target_os = "linux")]
    notifications: Option<OwnedFd>,
}

impl Pty {
    pub(super) fn open() -> Result<Self, Errno> {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&ours)?;
        unlockpt(&ours)?;
        let name = ptsname(&ours, Vec::new())?;
        let theirs = rustix::fs::open(&name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty())?;
        // Raw bytes instead of lines, as of a serial port.
        let mut settings = termios::tcgetattr(&theirs)?;
        settings.make_raw();
        termios::tcsetattr(&theirs, OptionalActions::Now, &settings)?;
        fcntl_setfl(&ours, OFlags::NONBLOCK)?;
        let path = name.to_string_lossy().into_owned();
        Ok(Self {
            ours,
            theirs,
            #[cfg(target_os = "linux")]
            notifications: watch(&path).ok(),
            path,
            last_byte: None,
            shut: false,
            backlog: false,
            #[cfg(target_os = "linux")]
            blocked: false,
        })
    }

    /// Checks whether a host has opened or closed the port since the last check. If so, discards replies that a host
    /// left unread, and returns true. A host that shares the port with another host may miss a reply. Systems other
    /// than Linux keep the replies.
    ///
    /// If the port was blocked, unread requests are discarded too: they are as old as the replies that nobody has read.
    fn note_opened_or_closed(&mut self) -> bool {
        #[cfg(target_os = "linux")]
        if let Some(notifications) = &self.notifications {
            // Several notifications may come together; only the last one counts.
            let mut buffer = [MaybeUninit::uninit(); 512];
            let mut events = inotify::Reader::new(notifications, &mut buffer);
            let mut last = None;
            while let Ok(event) = events.next() {
                last = Some(event.events());
            }
            if let Some(last) = last {
                discard(&self.ours, &self.theirs);
                if self.blocked {
                    discard(&self.theirs, &self.ours);
                }
                self.shut = !last.contains(inotify::ReadFlags::OPEN);
                (self.backlog, self.blocked) = (self.shut, false);
                return true;
            }
        }
        false
    }
}

impl Line for Pty {
    fn receive(&mut self, bytes: &mut [u8]) -> usize {
        self.note_opened_or_closed();
        // A host that was killed while it had exclusive use of the port would lock out the next host.
        let _ = termios::ioctl_tiocnxcl(&self.theirs);
        let received = rustix::io::read(&self.ours, bytes).unwrap_or(0);
        if received == 0 {
            self.backlog = false;
        } else if !self.backlog {
            // Another host has the port open, and has sent these bytes.
            self.shut = false;
            self.last_byte = Some(Instant::now());
        }
        if self.shut {
            self.last_byte = None;
        }
        received
    }

    fn is_taken(&self) -> bool {
        self.last_byte.is_some_and(|last_byte| last_byte.elapsed() < KEEP_ALIVE)
    }

    fn send(&mut self, bytes: &[u8]) -> usize {
        // After a change the reply is dropped: its host has gone, or its first bytes were discarded.
        if self.note_opened_or_closed() || self.shut {
            return bytes.len();
        }
        let sent = rustix::io::write(&self.ours, bytes).unwrap_or(0);
        #[cfg(target_os = "linux")]
        {
            self.blocked = sent == 0;
        }
        sent
    }
}

impl Display for Pty {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.path)
    }
}

/// Discards the bytes that one end of the terminal has sent and the other end has not read. The system keeps a part of
/// them at each end.
#[cfg(target_os = "linux")]
fn discard(from: &OwnedFd, to: &OwnedFd) {
    let _ = termios::tcflush(from, termios::QueueSelector::OFlush);
    let _ = termios::tcflush(to, termios::QueueSelector::IFlush);
}

#[cfg(target_os = "linux")]
fn watch(path: &str) -> Result<OwnedFd, Errno> {
    let notifications = inotify::init(inotify::CreateFlags::NONBLOCK | inotify::CreateFlags::CLOEXEC)?;
    inotify::add_watch(&notifications, path, inotify::WatchFlags::OPEN | inotify::WatchFlags::CLOSE)?;
    Ok(notifications)
}
