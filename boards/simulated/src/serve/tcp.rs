//! A TCP port with one host at a time.

use super::line::Line;
use std::collections::VecDeque;
use std::fmt::{self, Display, Formatter};
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

/// Time that a second host waits before it is disconnected. The first host may have closed its connection. The program
/// detects a closed connection only after it has read the last bytes.
const GRACE: Duration = Duration::from_millis(200);

/// A host that has sent nothing for this time is disconnected when another host connects. The hub has disabled the
/// motors after half of this time.
pub(super) const IDLE: Duration = Duration::from_secs(5);

/// Largest number of bytes that wait for the hub, which reads at the speed of a serial line. Further bytes are dropped.
/// Otherwise a host that sends noise would fill the buffers of the system, and the hub would be busy for a minute after
/// the host has gone.
const INBOX: usize = 4096;

/// Largest number of reads in a step, so that a host cannot delay the hub. The rest is read in the next step.
const READS: usize = 64;

#[derive(Debug)]
pub(super) struct Tcp {
    listener: TcpListener,
    host: Option<TcpStream>,
    /// Bytes from the host that the hub has not received yet.
    inbox: VecDeque<u8>,
    /// True if the host has closed its connection. The inbox may still hold its last bytes.
    at_end: bool,
    /// Time of the host's last bytes, or of its connection.
    last_byte: Instant,
    /// True if the host takes no more replies. Its last bytes are still read: they may stop motors.
    takes_no_replies: bool,
    /// A second host, and the time since when it waits.
    waiting: Option<(TcpStream, Instant)>,
    rejected_hosts: u32,
}

impl Tcp {
    pub(super) fn listen(address: &str) -> std::io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            host: None,
            inbox: VecDeque::new(),
            at_end: false,
            last_byte: Instant::now(),
            takes_no_replies: false,
            waiting: None,
            rejected_hosts: 0,
        })
    }

    fn look_for_another(&mut self) {
        match &self.waiting {
            None => self.waiting = self.accept().map(|stream| (stream, Instant::now())),
            // The next call connects the waiting host.
            Some(_) if !self.is_taken() => self.forget_host(),
            Some((_, since)) if since.elapsed() > GRACE => {
                self.waiting = None;
                self.rejected_hosts += 1;
            }
            Some(_) => (),
        }
    }

    fn accept(&self) -> Option<TcpStream> {
        // An error means that no host waits, or that the waiting host has gone.
        let (stream, _) = self.listener.accept().ok()?;
        // A reply is one burst and should be sent without delay.
        (stream.set_nonblocking(true).is_ok() && stream.set_nodelay(true).is_ok()).then_some(stream)
    }

    /// Reads from the host. A host that has hung up is released after its last bytes are read.
    fn read(&mut self, bytes: &mut [u8]) -> usize {
        self.fill_inbox();
        let received = bytes.len().min(self.inbox.len());
        for (byte, next) in bytes.iter_mut().zip(self.inbox.drain(..received)) {
            *byte = next;
        }
        if self.at_end && received == 0 {
            self.forget_host();
        }
        received
    }

    fn fill_inbox(&mut self) {
        let Some(stream) = self.host.as_mut().filter(|_| !self.at_end) else { return };
        let mut chunk = [0; INBOX];
        for _ in 0..READS {
            match moved(stream.read(&mut chunk)) {
                Some(0) => return,
                Some(length) => {
                    self.last_byte = Instant::now();
                    let room = INBOX - self.inbox.len();
                    self.inbox.extend(chunk.iter().take(length.min(room)));
                }
                None => {
                    self.at_end = true;
                    return;
                }
            }
        }
    }

    fn forget_host(&mut self) {
        (self.host, self.takes_no_replies, self.at_end) = (None, false, false);
        self.inbox.clear();
    }
}

impl Line for Tcp {
    fn receive(&mut self, bytes: &mut [u8]) -> usize {
        if self.host.is_none() {
            self.host = self.waiting.take().map(|(stream, _)| stream).or_else(|| self.accept());
            self.last_byte = Instant::now();
        }
        let received = self.read(bytes);
        if self.host.is_some() {
            self.look_for_another();
        }
        received
    }

    fn send(&mut self, bytes: &[u8]) -> usize {
        let Some(stream) = self.host.as_mut().filter(|_| !self.takes_no_replies) else { return bytes.len() };
        match moved(stream.write(bytes)) {
            // The host leaves replies unread. The hub receives nothing until this reply is sent, so a host that is
            // silent must give way here.
            Some(0) => {
                self.fill_inbox();
                self.look_for_another();
                0
            }
            Some(sent) => sent,
            None => {
                self.takes_no_replies = true;
                bytes.len()
            }
        }
    }

    fn is_taken(&self) -> bool {
        self.host.is_some() && self.last_byte.elapsed() < IDLE
    }

    fn rejected_hosts(&self) -> u32 {
        self.rejected_hosts
    }
}

impl Display for Tcp {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.listener.local_addr() {
            Ok(address) => address.fmt(f),
            Err(error) => error.fmt(f),
        }
    }
}

/// Returns the number of moved bytes, 0 if the connection is busy; `None` at the end of the connection.
fn moved(done: std::io::Result<usize>) -> Option<usize> {
    match done {
        Ok(moved) => Some(moved).filter(|moved| *moved > 0),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Some(0),
        Err(_) => None,
    }
}
