//! One page: what comes in at its socket goes to the pilot, and what the pilot says goes out.

use crate::order::Order;
use crate::pilot::Event;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, sync_channel};
use std::time::Duration;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error, Message, Utf8Bytes, WebSocket};

/// Frames that wait for a page that does not take them; what comes then is left out. Less than a second's, so that a page
/// is not taken to be there by what it is shown late.
pub(crate) const BACKLOG: usize = 25;

/// The longest order, in bytes.
const LONGEST: usize = 16 * 1024;

/// The longest that a frame waits for a page to say something.
const POLL: Duration = Duration::from_millis(3);

/// Until the page goes away, or the pilot does.
pub(crate) fn attend(stream: TcpStream, id: u32, events: &Sender<Event>) {
    if stream.set_read_timeout(Some(POLL)).is_err() {
        return;
    }
    let config = WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
    let mut socket = WebSocket::from_raw_socket(stream, Role::Server, Some(config));
    let (say, said) = sync_channel(BACKLOG);
    if events.send(Event::Joined(id, say.clone())).is_err() {
        return;
    }
    let mut answer = |why: String| {
        // A page that takes nothing needs no answer either.
        let _ = say.try_send(crate::frame::refused(&why));
    };
    while hear(&mut socket, id, events, &mut answer) && tell(&mut socket, &said) {}
    // The pilot may have ended before.
    let _ = events.send(Event::Left(id));
    let _ = socket.close(None);
}

/// False if the page is gone.
fn hear(
    socket: &mut WebSocket<TcpStream>,
    id: u32,
    events: &Sender<Event>,
    answer: &mut impl FnMut(String),
) -> bool {
    match socket.read() {
        Ok(Message::Text(text)) => match serde_json::from_str::<Order>(&text) {
            Ok(order) => events.send(Event::Said(id, order)).is_ok(),
            Err(error) => {
                answer(format!("this is no order: {error}"));
                true
            }
        },
        Ok(Message::Close(_)) => false,
        Ok(_) => true,
        Err(Error::Io(error)) => matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut),
        Err(_) => false,
    }
}

/// False if the page is gone.
fn tell(socket: &mut WebSocket<TcpStream>, said: &Receiver<Utf8Bytes>) -> bool {
    loop {
        match said.try_recv() {
            Ok(text) => {
                if socket.write(Message::Text(text)).is_err() {
                    return false;
                }
            }
            Err(TryRecvError::Empty) => return socket.flush().is_ok(),
            Err(TryRecvError::Disconnected) => return false,
        }
    }
}
