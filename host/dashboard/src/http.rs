//! Reads requests and writes answers: the part of HTTP/1.1 that a browser needs for a page and a socket. The connection is
//! closed after each answer.
//!
//! ```
//! use dashboard::http::{Head, HeadError};
//! use std::time::{Duration, Instant};
//!
//! let soon = Instant::now() + Duration::from_secs(1);
//! let head = Head::read(&mut &b"GET /?token=1 HTTP/1.1\r\nHost: 127.0.0.1:8000\r\n\r\n"[..], soon).unwrap();
//! assert_eq!((head.method.as_str(), head.target.as_str()), ("GET", "/?token=1"));
//! assert!(matches!(Head::read(&mut &b"GET /"[..], soon), Err(HeadError::CutShort)));
//! ```

use std::io::{self, ErrorKind, Read, Write};
use std::time::Instant;

/// Longest head of a request, in bytes.
pub const LONGEST_HEAD: usize = 8 * 1024;
/// Largest number of headers in a request.
const MOST_HEADERS: usize = 64;

/// Headers of every answer. The page loads nothing from other servers, cannot be put in a frame, and is not cached. Its URL
/// with the token is not sent to other sites.
const ALWAYS: &str = "Content-Security-Policy: default-src 'self'; base-uri 'none'; form-action 'none'; \
frame-ancestors 'none'\r\n\
X-Content-Type-Options: nosniff\r\n\
Referrer-Policy: no-referrer\r\n\
Cross-Origin-Resource-Policy: same-origin\r\n\
Cross-Origin-Opener-Policy: same-origin\r\n\
Cache-Control: no-store\r\n\
Connection: close\r\n";

/// The parts of a request that the server uses. Repeated headers are all kept, so that the rules of admission can refuse them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Head {
    /// Method, as sent.
    pub method: String,
    /// Path and query.
    pub target: String,
    /// Values of all `Host` headers.
    pub host: Vec<String>,
    /// Values of all `Origin` headers.
    pub origin: Vec<String>,
    /// Values of all `Upgrade` headers, in lower case.
    pub upgrade: Vec<String>,
    /// Values of all `Sec-WebSocket-Version` headers.
    pub version: Vec<String>,
    /// Values of all `Sec-WebSocket-Key` headers.
    pub key: Vec<String>,
}

/// Why a request could not be read.
#[derive(Debug, thiserror::Error)]
pub enum HeadError {
    /// The connection ended or timed out before the end of the head.
    #[error("the request is incomplete")]
    CutShort,
    /// The head has more than [`LONGEST_HEAD`] bytes, or too many headers.
    #[error("the request is too long")]
    TooLong,
    /// The head is not HTTP.
    #[error("the request is not HTTP")]
    Malformed,
}

impl Head {
    /// Reads a head, which must be complete at the time `by`.
    ///
    /// # Errors
    /// The head is incomplete, too long, or not HTTP.
    pub fn read(stream: &mut impl Read, by: Instant) -> Result<Self, HeadError> {
        let mut bytes = Vec::new();
        let mut one = [0; 1];
        // Bytes are read one by one, because bytes after the head belong to the socket.
        while !bytes.ends_with(b"\r\n\r\n") {
            if bytes.len() >= LONGEST_HEAD {
                return Err(HeadError::TooLong);
            }
            let read = stream.read(&mut one);
            match read {
                _ if Instant::now() >= by => return Err(HeadError::CutShort),
                Ok(1..) => bytes.extend(one),
                // The stream's own time-out is shorter, so that the time `by` is kept.
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => (),
                _ => return Err(HeadError::CutShort),
            }
        }
        Self::parse(&bytes)
    }

    fn parse(bytes: &[u8]) -> Result<Self, HeadError> {
        let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
        let mut request = httparse::Request::new(&mut headers);
        match request.parse(bytes) {
            Ok(httparse::Status::Complete(_)) => (),
            Err(httparse::Error::TooManyHeaders) => return Err(HeadError::TooLong),
            _ => return Err(HeadError::Malformed),
        }
        let mut head = Self {
            method: request.method.unwrap_or_default().to_owned(),
            target: request.path.unwrap_or_default().to_owned(),
            ..Self::default()
        };
        for header in request.headers.iter() {
            let value = std::str::from_utf8(header.value).map_err(|_| HeadError::Malformed)?.to_owned();
            match header.name.to_ascii_lowercase().as_str() {
                "host" => head.host.push(value),
                "origin" => head.origin.push(value),
                "upgrade" => head.upgrade.push(value.to_ascii_lowercase()),
                "sec-websocket-version" => head.version.push(value),
                "sec-websocket-key" => head.key.push(value),
                _ => (),
            }
        }
        Ok(head)
    }

    /// The key of a WebSocket handshake; `None` for any other request.
    #[must_use]
    pub fn socket_key(&self) -> Option<String> {
        let asks = self.upgrade == ["websocket"] && self.version == ["13"];
        let [key] = self.key.as_slice() else { return None };
        asks.then(|| key.clone())
    }
}

/// Sends an answer with a body.
///
/// # Errors
/// The connection fails.
pub fn answer(stream: &mut impl Write, status: &str, kind: &str, body: &[u8]) -> io::Result<()> {
    let length = body.len();
    let head =
        format!("HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n{ALWAYS}\r\n");
    stream.write_all(head.as_bytes())?;
    stream.write_all(body)?;
    stream.flush()
}

/// Sends the answer that switches the connection to a WebSocket.
///
/// # Errors
/// The connection fails.
pub fn upgrade(stream: &mut impl Write, key: &str) -> io::Result<()> {
    let accept = tungstenite::handshake::derive_accept_key(key.as_bytes());
    let head = format!(
        "HTTP/1.1 101 Switching Protocols\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Accept: {accept}\r\n\r\n"
    );
    stream.write_all(head.as_bytes())?;
    stream.flush()
}
