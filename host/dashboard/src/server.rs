//! Listens for connections, and serves each one in its own thread.

use crate::admission::{Admission, PublicUrl, Refusal, Wanted};
use crate::http::{self, LONGEST_HEAD};
use crate::page_socket;
use crate::place::Place;
use crate::relay::{Event, INTERVAL, Relay};
use std::io::{BufWriter, Read};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::time::{Duration, Instant};
use tungstenite::handshake::server::write_response;

/// Largest number of simultaneous connections. A page has one connection, and some more while it loads.
const MAX_CONNECTIONS: u32 = 48;

/// Time in which a client must have sent its whole request. Anybody may open a connection without the token. The time
/// is short, so that 48 silent connections keep a page out for no longer than this time.
const ADMISSION: Duration = Duration::from_secs(1);

/// Time-out of one read during [`ADMISSION`].
const READ: Duration = Duration::from_millis(100);

/// Longest delay of frames that is caught up by sending later frames sooner.
const CATCH_UP: Duration = Duration::from_millis(100);

/// Shortest wait for an event before a frame. A page with several events needs some of this time between two of them.
const NEXT_EVENT: Duration = Duration::from_millis(1);

/// Time-out for sending an answer.
const SENDING: Duration = Duration::from_secs(5);

/// The server of the page: its listener, and the rules of admission.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
    admission: Admission,
}

/// Why the server could not start.
#[derive(Debug, thiserror::Error)]
pub enum BindError {
    /// Listening at the address failed.
    #[error("cannot listen at {address}: {error}")]
    Address {
        /// Address as given.
        address: String,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// The system gave no random numbers for a token.
    #[error("the system gives no random numbers for a token: {0}")]
    Random(getrandom::Error),
}

impl Server {
    /// Listens at an address; port 0 chooses a free port.
    ///
    /// # Errors
    /// Listening fails, or the system gives no random numbers.
    pub fn bind(address: &str) -> Result<Self, BindError> {
        let fails = |error| BindError::Address { address: address.to_owned(), error };
        let listener = TcpListener::bind(address).map_err(fails)?;
        let address = listener.local_addr().map_err(fails)?;
        let admission = Admission::random().map_err(BindError::Random)?;
        Ok(Self { listener, address, admission })
    }

    /// Admits requests for this URL too, by which browsers reach the server.
    pub fn reached_as(self, public: PublicUrl) -> Self {
        Self { admission: self.admission.reached_as(public), ..self }
    }

    /// Address at which the server listens.
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// URL of the page, with the token.
    pub fn url(&self) -> String {
        let root = self
            .admission
            .public()
            .map_or_else(|| format!("http://{}", reachable(self.address)), PublicUrl::to_string);
        format!("{root}/?token={}", self.admission.token())
    }

    /// Serves the hub at a place until `stop` is set, then ends a running update and disables the hub's motors.
    pub fn run(self, place: Place, stop: &AtomicBool) {
        // Without a queue a page waits until the relay takes its event, and pages take turns.
        let (events, received) = mpsc::sync_channel(0);
        let Self { listener, admission, .. } = self;
        std::thread::spawn(move || listen(&listener, &admission, &events));
        relay_until(stop, Relay::new(place), &received);
    }
}

/// Passes events to the relay, and calls the relay for each frame, until `stop` is set. Then ends the relay.
fn relay_until(stop: &AtomicBool, mut relay: Relay, events: &Receiver<Event>) {
    let mut next = Instant::now();
    // Events are handled before a late frame, but many events delay a frame by no more than an interval.
    let mut latest = next;
    while !stop.load(Ordering::Relaxed) {
        match events.recv_timeout(next.saturating_duration_since(Instant::now()).max(NEXT_EVENT)) {
            Ok(event) => {
                relay.handle(event);
                if Instant::now() < latest {
                    continue;
                }
            }
            Err(RecvTimeoutError::Timeout) => (),
            Err(RecvTimeoutError::Disconnected) => break,
        }
        relay.tick();
        let now = Instant::now();
        // After a short delay of the hub the missed frames are caught up, but at most CATCH_UP.
        next = (next + INTERVAL).max(now.checked_sub(CATCH_UP).unwrap_or(next));
        latest = next.max(now) + INTERVAL;
    }
    relay.end("the server has ended");
}

/// An address that other machines can reach. For a server that listens at all addresses it is the source address of
/// packets to the internet. No packet is sent to find it.
fn reachable(address: SocketAddr) -> SocketAddr {
    if !address.ip().is_unspecified() {
        return address;
    }
    // Addresses reserved for documentation (RFC 5737, RFC 3849).
    let outside = if address.is_ipv4() { "192.0.2.1:9" } else { "[2001:db8::1]:9" };
    let own = UdpSocket::bind((address.ip(), 0)).and_then(|socket| {
        socket.connect(outside)?;
        socket.local_addr()
    });
    own.map_or(address, |own| SocketAddr::new(own.ip(), address.port()))
}

fn listen(listener: &TcpListener, admission: &Admission, events: &SyncSender<Event>) {
    let connections = Arc::new(AtomicU32::new(0));
    let pages = Arc::new(AtomicU32::new(0));
    for stream in listener.incoming().flatten() {
        let (admission, events) = (admission.clone(), events.clone());
        let (connections, pages) = (Arc::clone(&connections), Arc::clone(&pages));
        let full = connections.fetch_add(1, Ordering::Relaxed) >= MAX_CONNECTIONS;
        std::thread::spawn(move || {
            // An error means that the client has closed the connection.
            let _ = serve(stream, &admission, full, &events, &pages);
            connections.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

/// Serves one request, and the WebSocket if the request asks for it.
fn serve(
    mut stream: TcpStream,
    admission: &Admission,
    full: bool,
    events: &SyncSender<Event>,
    pages: &AtomicU32,
) -> std::io::Result<()> {
    stream.set_read_timeout(Some(READ))?;
    stream.set_write_timeout(Some(SENDING))?;
    stream.set_nodelay(true)?;
    // A socket for IPv6 and IPv4 reports an IPv4 address as ::ffff:a.b.c.d. Browsers send a.b.c.d.
    let local = stream.local_addr()?;
    let local = SocketAddr::new(local.ip().to_canonical(), local.port());
    let wanted = if full {
        // A connection that is closed with an unread request loses its answer. A request may also arrive late or never.
        let _ = stream.read(&mut [0; LONGEST_HEAD]);
        Err(Refusal::Busy)
    } else {
        let request = http::read_head(&mut stream, Instant::now() + ADMISSION);
        request.and_then(|request| admission.admit(&request, local))
    };
    match wanted {
        Ok(Wanted::Socket(response)) => {
            write_response(BufWriter::new(&mut stream), &response).map_err(std::io::Error::other)?;
            page_socket::attend(stream, 1 + pages.fetch_add(1, Ordering::Relaxed), events);
            Ok(())
        }
        Ok(Wanted::File(kind, bytes)) => http::answer(&mut stream, "200 OK", kind, bytes),
        Err(refusal) => {
            let why = format!("{refusal}\n");
            http::answer(&mut stream, refusal.status(), "text/plain; charset=utf-8", why.as_bytes())
        }
    }
}
