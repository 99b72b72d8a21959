//! The socket of one page: passes orders to the pilot, and messages of the pilot to the page.

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

/// Number of waiting texts from which frames to a page are skipped. It is less than one second's frames, so that the page
/// never shows frames as old as [`SILENCE`](crate::desk::SILENCE).
const BACKLOG: usize = 25;

/// Number of waiting texts from which a page is dropped.
const MOST: usize = 500;

/// Longest order in bytes.
const LONGEST: usize = 16 * 1024;

/// Longest wait for an order before waiting texts are sent.
const POLL: Duration = Duration::from_millis(3);

/// Sends texts to a page.
#[derive(Clone, Debug)]
pub(crate) struct Pen {
    say: Sender<Utf8Bytes>,
    waiting: Arc<AtomicUsize>,
}

impl Pen {
    /// Sends a text; false if the page must be dropped.
    pub(crate) fn tell(&self, text: Utf8Bytes) -> bool {
        self.waiting.fetch_add(1, Ordering::Relaxed) < MOST && self.say.send(text).is_ok()
    }

    /// Sends a frame, which is skipped if the page is too slow; false if the page must be dropped.
    pub(crate) fn show(&self, text: Utf8Bytes) -> bool {
        self.waiting.load(Ordering::Relaxed) >= BACKLOG || self.tell(text)
    }
}

/// Serves the socket of a page until the page or the pilot ends.
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

/// Reads an order and passes it to the pilot; false if the page is gone.
fn hear(socket: &mut WebSocket<TcpStream>, id: u32, events: &Sender<Event>) -> bool {
    match socket.read() {
        Ok(Message::Text(text)) => match serde_json::from_str::<Order>(&text) {
            Ok(order) => events.send(Event::Said(id, order)).is_ok(),
            Err(error) => socket.send(Message::Text(refused(&format!("not an order: {error}")))).is_ok(),
        },
        Ok(Message::Close(_)) => false,
        Ok(_) => true,
        Err(Error::Io(error)) => matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut),
        Err(_) => false,
    }
}

/// Sends all waiting texts; false if the page is gone.
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
