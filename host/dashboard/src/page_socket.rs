//! The socket of one page: passes orders to the relay, and messages of the relay to the page.

use crate::outbox::{Texts, outbox};
use crate::relay::Event;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::sync::mpsc::{SyncSender, TryRecvError};
use std::time::Duration;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error, Message, WebSocket};

/// Longest order in bytes. `link.js` refuses a longer order.
const LONGEST: usize = 16 * 1024;

/// Longest wait for an order before waiting texts are sent.
const POLL: Duration = Duration::from_millis(3);

/// Serves the socket of a page until the page or the relay ends.
pub(crate) fn attend(stream: TcpStream, id: u32, events: &SyncSender<Event>) {
    if stream.set_read_timeout(Some(POLL)).is_err() {
        return;
    }
    let config = WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
    let mut socket = WebSocket::from_raw_socket(stream, Role::Server, Some(config));
    let (outbox, texts) = outbox();
    if events.send(Event::Joined(id, outbox)).is_err() {
        return;
    }
    while receive(&mut socket, id, events) && send(&mut socket, &texts) {}
    // Sending fails if the relay has ended already.
    let _ = events.send(Event::Left(id));
    let _ = socket.close(None);
}

/// Reads an order and passes it to the relay; false if the page is gone.
fn receive(socket: &mut WebSocket<TcpStream>, id: u32, events: &SyncSender<Event>) -> bool {
    match socket.read() {
        Ok(Message::Text(text)) => events.send(Event::Ordered(id, text.to_string())).is_ok(),
        Ok(Message::Close(_)) => false,
        Ok(_) => true,
        Err(Error::Io(error)) => matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut),
        Err(_) => false,
    }
}

/// Sends all waiting texts; false if the page is gone.
fn send(socket: &mut WebSocket<TcpStream>, texts: &Texts) -> bool {
    loop {
        match texts.next() {
            Ok(text) => {
                if socket.write(Message::text(&*text)).is_err() {
                    return false;
                }
            }
            Err(TryRecvError::Empty) => return socket.flush().is_ok(),
            Err(TryRecvError::Disconnected) => return false,
        }
    }
}
