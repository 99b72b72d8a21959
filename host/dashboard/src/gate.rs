//! Decides which requests the server admits.
//!
//! A page of another site in the same browser can also send requests to this server, and its name may even resolve to this
//! machine. Therefore the Host of a request must be the address that was connected to. The Origin of a socket must be this
//! server's own page. Page and socket both need the token, which only readers of the printed URL know.
//!
//! ```
//! use dashboard::gate::{Gate, Refusal, Wanted};
//! use dashboard::http::Head;
//!
//! let gate = Gate::new("0123456789abcdef".to_owned());
//! let asked = |host: &str, target: &str| {
//!     let head = Head { method: "GET".into(), target: target.into(), host: vec![host.into()], ..Head::default() };
//!     gate.admit(&head, "127.0.0.1:8000".parse().unwrap())
//! };
//! assert_eq!(asked("127.0.0.1:8000", "/?token=0123456789abcdef"), Ok(Wanted::Page));
//! assert_eq!(asked("evil.example:8000", "/?token=0123456789abcdef"), Err(Refusal::Host));
//! assert_eq!(asked("127.0.0.1:8000", "/"), Err(Refusal::Token));
//! ```

use crate::http::Head;
use std::net::SocketAddr;

/// Number of random bytes in a token, which is written as hexadecimal digits.
const TOKEN_BYTES: usize = 16;

/// The path of the socket.
pub const SOCKET: &str = "/ws";

/// Admits requests with the right token.
#[derive(Clone, Debug)]
pub struct Gate {
    token: String,
}

/// The resource that an admitted request asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// The page itself.
    Page,
    /// A file of the page, which is not secret.
    Asset(String),
    /// The socket, with the key of its handshake.
    Socket(String),
}

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// The method is not GET.
    #[error("only GET requests are allowed")]
    Method,
    /// The Host is missing, repeated, or not the address that was connected to.
    #[error("the Host header must be the address and port of this server")]
    Host,
    /// The request comes from a page of another site.
    #[error("the Origin header must be this server")]
    Origin,
    /// The token is missing, repeated or wrong.
    #[error("the token is missing or wrong: open the whole URL that `motor-hub dashboard` printed")]
    Token,
    /// A request for the socket is not a WebSocket handshake of version 13.
    #[error("this path is a WebSocket: request an upgrade, version 13, with a key")]
    Handshake,
}

impl Refusal {
    /// HTTP status of the answer.
    #[must_use]
    pub const fn status(self) -> &'static str {
        match self {
            Self::Method => "405 Method Not Allowed",
            Self::Host => "421 Misdirected Request",
            Self::Origin | Self::Token => "403 Forbidden",
            Self::Handshake => "426 Upgrade Required",
        }
    }
}

impl Gate {
    /// Admits requests with this token.
    #[must_use]
    pub const fn new(token: String) -> Self {
        Self { token }
    }

    /// Makes a token of 128 random bits.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self::new(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// The token.
    #[must_use]
    pub fn token(&self) -> &str {
        &self.token
    }

    /// Checks a request that arrived at the address `local`, and returns the resource that it asks for.
    ///
    /// # Errors
    /// The reason of the refusal.
    pub fn admit(&self, head: &Head, local: SocketAddr) -> Result<Wanted, Refusal> {
        if head.method != "GET" {
            return Err(Refusal::Method);
        }
        let [host] = head.host.as_slice() else { return Err(Refusal::Host) };
        let named = local.ip().is_loopback() && *host == format!("localhost:{}", local.port());
        if *host != local.to_string() && !named {
            return Err(Refusal::Host);
        }
        let own = |origin: &String| *origin == format!("http://{host}");
        let (path, query) = head.target.split_once('?').unwrap_or((&head.target, ""));
        if path == SOCKET {
            // Browsers always send an Origin with a WebSocket handshake.
            let [origin] = head.origin.as_slice() else { return Err(Refusal::Origin) };
            if !own(origin) {
                return Err(Refusal::Origin);
            }
            self.check(query)?;
            return head.socket_key().map(Wanted::Socket).ok_or(Refusal::Handshake);
        }
        if !head.origin.iter().all(own) {
            return Err(Refusal::Origin);
        }
        if path == "/" {
            self.check(query)?;
            return Ok(Wanted::Page);
        }
        Ok(Wanted::Asset(path.to_owned()))
    }

    fn check(&self, query: &str) -> Result<(), Refusal> {
        let given = query.split('&').filter_map(|pair| pair.strip_prefix("token="));
        match given.collect::<Vec<_>>().as_slice() {
            [given] if is_same(given.as_bytes(), self.token.as_bytes()) => Ok(()),
            _ => Err(Refusal::Token),
        }
    }
}

/// Compares in constant time, so that the time does not reveal where the two differ.
fn is_same(one: &[u8], other: &[u8]) -> bool {
    one.len() == other.len()
        && one.iter().zip(other).fold(0, |differs, (one, other)| differs | (one ^ other)) == 0
}
