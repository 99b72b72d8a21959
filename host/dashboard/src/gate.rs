//! Which requests are let in. A page of another site that is open in the same browser can send requests here too, and its
//! name may even resolve to this machine: so the name that was asked for must be the address that was connected to,
//! the socket must be asked for by this server's own page, and both page and socket need the token that only whoever
//! read the printed URL knows.
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

/// Bytes of a token, before they are written as hexadecimal digits.
const TOKEN_BYTES: usize = 16;

/// The path of the socket.
pub const SOCKET: &str = "/ws";

/// Knows the token.
#[derive(Clone, Debug)]
pub struct Gate {
    token: String,
}

/// What is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// The page itself.
    Page,
    /// What it is made of, none of it secret.
    Asset(String),
    /// The socket, with the key of its handshake.
    Socket(String),
}

/// Why a request is not let in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Something else than GET.
    #[error("only GET is answered here")]
    Method,
    /// None, several, or another name than the address that was connected to.
    #[error("the Host must be the address and port of this server")]
    Host,
    /// Another site asks.
    #[error("the Origin must be this server")]
    Origin,
    /// None, or another.
    #[error("the token is missing or wrong: open the whole URL that `motor-hub dashboard` printed")]
    Token,
    /// The socket, by something that is no WebSocket handshake of version 13.
    #[error("this is a WebSocket: its handshake must ask for an upgrade, version 13, with a key")]
    Handshake,
}

impl Refusal {
    /// Of the answer.
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
    /// Lets in who knows this token.
    #[must_use]
    pub const fn new(token: String) -> Self {
        Self { token }
    }

    /// With a token of 128 random bits.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self::new(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// Its token.
    #[must_use]
    pub fn token(&self) -> &str {
        &self.token
    }

    /// What a request that came in at `local` is let in for.
    ///
    /// # Errors
    /// Why it is not.
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
            // Browsers always say it; who does not is none.
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

/// In a time that does not tell where they differ.
fn is_same(one: &[u8], other: &[u8]) -> bool {
    one.len() == other.len()
        && one.iter().zip(other).fold(0, |differs, (one, other)| differs | (one ^ other)) == 0
}
