//! A TCP port with one host at a time.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

/// So long another host is kept waiting: one that has hung up may have left something to be read before that shows.
const GRACE: Duration = Duration::from_millis(200);

/// A host that has been silent for this time gives way to another. The hub has disabled its motors after half of it.
pub(super) const IDLE: Duration = Duration::from_secs(5);

/// Bytes that wait for the hub, which takes them as slowly as from a serial line. What comes beyond them is lost: else a
/// host that sends noise would fill the buffers of the system, and keep the hub busy for a minute after it has gone.
const INBOX: usize = 4096;

/// Reads of the connection at a time. What is left is read the next time, so that no host keeps the hub from its work.
const READS: usize = 64;

#[derive(Debug)]
pub(super) struct Tcp {
    listener: TcpListener,
    host: Option<TcpStream>,
    /// What the host has sent and the hub has not received yet.
    inbox: VecDeque<u8>,
    /// The host sends nothing more.
    at_end: bool,
    /// When the host last sent something, or came.
    heard: Instant,
    /// It takes no more replies. What it has sent before it hung up is still to be read: it may be what stops motors.
    deaf: bool,
    /// Another one, and since when it waits.
    waiting: Option<(TcpStream, Instant)>,
    turned_away: u32,
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
            heard: Instant::now(),
            deaf: false,
            waiting: None,
            turned_away: 0,
        })
    }

    pub(super) fn address(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Hosts that found another one here, and were hung up on.
    pub(super) const fn turned_away(&self) -> u32 {
        self.turned_away
    }

    pub(super) fn is_taken(&self) -> bool {
        self.host.is_some() && self.heard.elapsed() < IDLE
    }

    /// Bytes that have come; 0 if there are none now.
    pub(super) fn receive(&mut self, bytes: &mut [u8]) -> usize {
        if self.host.is_none() {
            self.host = self.waiting.take().map(|(stream, _)| stream).or_else(|| self.accept());
            self.heard = Instant::now();
        }
        let received = self.read(bytes);
        if self.host.is_some() {
            self.look_for_another();
        }
        received
    }

    fn look_for_another(&mut self) {
        match &self.waiting {
            None => self.waiting = self.accept().map(|stream| (stream, Instant::now())),
            // The next call takes the host that waits.
            Some(_) if !self.is_taken() => self.forget_host(),
            Some((_, since)) if since.elapsed() > GRACE => {
                self.waiting = None;
                self.turned_away += 1;
            }
            Some(_) => (),
        }
    }

    /// How many bytes were taken; 0 if the line is busy. Without a host they go nowhere.
    pub(super) fn send(&mut self, bytes: &[u8]) -> usize {
        let Some(stream) = self.host.as_mut().filter(|_| !self.deaf) else { return bytes.len() };
        moved(stream.write(bytes)).unwrap_or_else(|| {
            self.deaf = true;
            bytes.len()
        })
    }

    fn accept(&self) -> Option<TcpStream> {
        // Nobody there, or gone already.
        let (stream, _) = self.listener.accept().ok()?;
        // A reply is one burst, and it is wanted now.
        (stream.set_nonblocking(true).is_ok() && stream.set_nodelay(true).is_ok()).then_some(stream)
    }

    /// A host that has hung up, or whose connection is broken, is forgotten once all that it sent is read.
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
                    self.heard = Instant::now();
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
        (self.host, self.deaf, self.at_end) = (None, false, false);
        self.inbox.clear();
    }
}

/// Bytes moved, 0 if the connection is busy; `None` if it is at its end.
fn moved(done: std::io::Result<usize>) -> Option<usize> {
    match done {
        Ok(moved) => Some(moved).filter(|moved| *moved > 0),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Some(0),
        Err(_) => None,
    }
}
