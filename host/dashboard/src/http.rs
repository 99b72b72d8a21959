//! Reads requests and writes answers: the part of HTTP/1.1 that a browser needs for a page and a socket. The connection
//! is closed after each answer. [`tungstenite`] parses requests, and makes the answers to handshakes of sockets.

use crate::admission::Refusal;
use std::io::{self, ErrorKind, Read, Write};
use std::time::Instant;
use tungstenite::error::{CapacityError, ProtocolError};
use tungstenite::handshake::machine::TryParse;
use tungstenite::handshake::server::Request;

/// Longest head of a request, in bytes.
pub(crate) const LONGEST_HEAD: usize = 8 * 1024;

/// Headers of every answer. The page loads nothing from other servers, cannot be put in a frame, and is not cached. Its
/// URL with the token is not sent to other sites.
const ALWAYS: &str = "Content-Security-Policy: default-src 'self'; base-uri 'none'; form-action 'none'; \
frame-ancestors 'none'\r\n\
X-Content-Type-Options: nosniff\r\n\
Referrer-Policy: no-referrer\r\n\
Cross-Origin-Resource-Policy: same-origin\r\n\
Cross-Origin-Opener-Policy: same-origin\r\n\
Cache-Control: no-store\r\n\
Connection: close\r\n";

/// Reads the head of a request, which must be complete at the time `by`.
pub(crate) fn read_head(stream: &mut impl Read, by: Instant) -> Result<Request, Refusal> {
    let mut bytes = Vec::new();
    let mut one = [0; 1];
    // Bytes are read one by one, because bytes after the head belong to the socket.
    while !bytes.ends_with(b"\r\n\r\n") {
        if bytes.len() >= LONGEST_HEAD {
            return Err(Refusal::TooLong);
        }
        let read = stream.read(&mut one);
        match read {
            _ if Instant::now() >= by => return Err(Refusal::CutShort),
            Ok(1..) => bytes.extend(one),
            // The stream's own time-out is much shorter than the time until `by`, so that `by` is checked often enough.
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => (),
            _ => return Err(Refusal::CutShort),
        }
    }
    match Request::try_parse(&bytes) {
        Ok(Some((_, request))) => Ok(request),
        Err(tungstenite::Error::Capacity(CapacityError::TooManyHeaders)) => Err(Refusal::TooLong),
        Err(tungstenite::Error::Protocol(ProtocolError::WrongHttpMethod)) => Err(Refusal::Method),
        _ => Err(Refusal::Malformed),
    }
}

/// Sends an answer with a body.
pub(crate) fn answer(stream: &mut impl Write, status: &str, kind: &str, body: &[u8]) -> io::Result<()> {
    let length = body.len();
    let head =
        format!("HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n{ALWAYS}\r\n");
    stream.write_all(head.as_bytes())?;
    stream.write_all(body)?;
    stream.flush()
}
