//! A pseudo-terminal: one end for the hub, and a path in `/dev` that hosts open as a serial port.

#[cfg(target_os = "linux")]
use rustix::fs::inotify;
use rustix::fs::{Mode, OFlags, fcntl_setfl};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{self, OptionalActions};
#[cfg(target_os = "linux")]
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

/// A host that has motors run speaks more often than this: the hub's keep-alive time.
const KEEP_ALIVE: Duration = Duration::from_millis(2500);

#[derive(Debug)]
pub(super) struct Pty {
    ours: OwnedFd,
    /// Held open, so that hosts may come and go: the settings of a terminal that nobody has open are
    /// forgotten, and reading the other end of it fails.
    theirs: OwnedFd,
    path: String,
    /// When a host was heard last, unless it has closed the port since.
    heard: Option<Instant>,
    /// Somebody has closed the port, and nobody has opened it since or been heard: replies go nowhere.
    shut: bool,
    /// What is read may have been written before that.
    backlog: bool,
    /// Tells when somebody opens or closes the port, if the system can.
    #[cfg(target_os = "linux")]
    comings: Option<OwnedFd>,
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
        Ok(Self {
            ours,
            theirs,
            #[cfg(target_os = "linux")]
            comings: watch(&path).ok(),
            path,
            heard: None,
            shut: false,
            backlog: false,
        })
    }

    /// What one host has left unread is nothing to the next: it is thrown away when the port is closed. (A host that
    /// shares the port with another may miss a reply by that.) Systems other than Linux keep it.
    fn forget_what_was_left(&mut self) {
        #[cfg(target_os = "linux")]
        if let Some(comings) = &self.comings {
            // They come one by one or in bunches; how many there were does not matter.
            let mut buffer = [MaybeUninit::uninit(); 512];
            let mut events = inotify::Reader::new(comings, &mut buffer);
            let mut last = None;
            while let Ok(event) = events.next() {
                last = Some(event.events());
            }
            if let Some(last) = last {
                let _ = termios::tcflush(&self.theirs, termios::QueueSelector::IFlush);
                self.shut = !last.contains(inotify::ReadFlags::OPEN);
                self.backlog = self.shut;
            }
        }
    }

    pub(super) fn path(&self) -> &str {
        &self.path
    }

    /// Bytes that have come; 0 if there are none now.
    pub(super) fn receive(&mut self, bytes: &mut [u8]) -> usize {
        self.forget_what_was_left();
        // A host that was killed while it had the port to itself would keep the next one out.
        let _ = termios::ioctl_tiocnxcl(&self.theirs);
        let received = rustix::io::read(&self.ours, bytes).unwrap_or(0);
        if received == 0 {
            self.backlog = false;
        } else if !self.backlog {
            // One that shared the port with whoever closed it.
            self.shut = false;
            self.heard = Some(Instant::now());
        }
        if self.shut {
            self.heard = None;
        }
        received
    }

    pub(super) fn is_taken(&self) -> bool {
        self.heard.is_some_and(|heard| heard.elapsed() < KEEP_ALIVE)
    }

    /// How many bytes were taken; 0 if the line is busy. Without a host they go nowhere.
    pub(super) fn send(&self, bytes: &[u8]) -> usize {
        if self.shut {
            return bytes.len();
        }
        rustix::io::write(&self.ours, bytes).unwrap_or(0)
    }
}

#[cfg(target_os = "linux")]
fn watch(path: &str) -> Result<OwnedFd, Errno> {
    let comings = inotify::init(inotify::CreateFlags::NONBLOCK | inotify::CreateFlags::CLOEXEC)?;
    inotify::add_watch(&comings, path, inotify::WatchFlags::OPEN | inotify::WatchFlags::CLOSE)?;
    Ok(comings)
}
