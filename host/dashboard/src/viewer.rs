//! One page: what comes in at its socket goes to the pilot, and what the pilot says goes out.

use crate::frame::refused;
use crate::order::Order;
use crate::pilot::Event;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::time::Duration;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error, Message, Utf8Bytes, WebSocket};

/// Texts that wait for a page before frames are left out. Less than a second's, so that a page is not taken to be there by
/// what it is shown late.
const BACKLOG: usize = 25;

/// A page for which so much waits is given up.
const MOST: usize = 500;

/// The longest order, in bytes.
const LONGEST: usize = 16 * 1024;

/// The longest that a frame waits for a page to say something.
const POLL: Duration = Duration::from_millis(3);

/// How a page is told something.
#[derive(Clone, Debug)]
pub(crate) struct Pen {
    say: Sender<Utf8Bytes>,
    waiting: Arc<AtomicUsize>,
}

impl Pen {
    /// False if the page is to be given up.
    pub(crate) fn tell(&self, text: Utf8Bytes) -> bool {
        self.waiting.fetch_add(1, Ordering::Relaxed) < MOST && self.say.send(text).is_ok()
    }

    /// The same of a frame, which a page that does not keep up misses.
    pub(crate) fn show(&self, text: Utf8Bytes) -> bool {
        self.waiting.load(Ordering::Relaxed) >= BACKLOG || self.tell(text)
    }
}

/// Until the page goes away, or the pilot does.
pub(crate) fn attend(stream: TcpStream, id: u32, events: &Sender<Event>) {
    if stream.set_read_timeout(Some(POLL)).is_err() {
        return;
    }
    let config = WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
    let mut socket = WebSocket::from_raw_socket(stream, Role::Server, Some(config));
    let (say, said) = channel();
    let waiting = Arc::<AtomicUsize>::default();
    let pen = Pen { say, waiting: Arc::clone(&waiting) };
    if events.send(Event::Joined(id, pen)).is_err() {
        return;
    }
    while hear(&mut socket, id, events) && tell(&mut socket, &said, &waiting) {}
    // The pilot may have ended before.
    let _ = events.send(Event::Left(id));
    let _ = socket.close(None);
}

/// False if the page is gone.
fn hear(socket: &mut WebSocket<TcpStream>, id: u32, events: &Sender<Event>) -> bool {
    match socket.read() {
        Ok(Message::Text(text)) => match serde_json::from_str::<Order>(&text) {
            Ok(order) => events.send(Event::Said(id, order)).is_ok(),
            Err(error) => socket.send(Message::Text(refused(&format!("this is no order: {error}")))).is_ok(),
        },
        Ok(Message::Close(_)) => false,
        Ok(_) => true,
        Err(Error::Io(error)) => matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut),
        Err(_) => false,
    }
}

/// False if the page is gone.
fn tell(socket: &mut WebSocket<TcpStream>, said: &Receiver<Utf8Bytes>, waiting: &AtomicUsize) -> bool {
    loop {
        match said.try_recv() {
            Ok(text) => {
                waiting.fetch_sub(1, Ordering::Relaxed);
                if socket.write(Message::Text(text)).is_err() {
                    return false;
                }
            }
            Err(TryRecvError::Empty) => return socket.flush().is_ok(),
            Err(TryRecvError::Disconnected) => return false,
        }
    }
}
