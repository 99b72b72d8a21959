//! Decides which requests the server admits.
//!
//! A page of another site in the same browser can also send requests to this server, and its name may even resolve to this
//! machine. Therefore the Host of a request must be the address that was connected to, or the [`PublicUrl`] that the user has
//! given. The Origin of a socket must be this server's own page. Page and socket both need the token, which only readers of
//! the printed URL know.
//!
//! ```
//! use dashboard::admission::{Admission, Refusal, Wanted};
//! use dashboard::http::Head;
//!
//! let admission = Admission::new("0123456789abcdef".to_owned());
//! let asked = |host: &str, target: &str| {
//!     let head = Head { method: "GET".into(), target: target.into(), host: vec![host.into()], ..Head::default() };
//!     admission.admit(&head, "127.0.0.1:8000".parse().unwrap())
//! };
//! assert_eq!(asked("127.0.0.1:8000", "/?token=0123456789abcdef"), Ok(Wanted::Page));
//! assert!(matches!(asked("evil.example:8000", "/?token=0123456789abcdef"), Err(Refusal::Host { .. })));
//! assert_eq!(asked("127.0.0.1:8000", "/"), Err(Refusal::Token));
//! ```

use crate::http::Head;
use std::fmt;
use std::net::SocketAddr;
use std::str::FromStr;

/// Number of random bytes in a token, which is written as hexadecimal digits.
const TOKEN_BYTES: usize = 16;

/// The path of the socket.
pub const SOCKET: &str = "/ws";

/// Admits requests with the right token.
#[derive(Clone, Debug)]
pub struct Admission {
    token: String,
    public: Option<PublicUrl>,
}

/// A URL by which browsers reach the server and that is not the server's own address: behind a tunnel, a host name or a proxy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PublicUrl {
    /// `http://` or `https://`, and host with port, as browsers send them in an Origin.
    origin: String,
    /// Host, with its port unless the port is the scheme's own, as browsers send it in a Host.
    host: String,
}

/// The text is not a URL of a server's root.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not the URL of a page's root: give http://HOST, https://HOST, or either with :PORT")]
pub struct NotPublicUrl(String);

impl FromStr for PublicUrl {
    type Err = NotPublicUrl;

    fn from_str(text: &str) -> Result<Self, NotPublicUrl> {
        let wrong = || NotPublicUrl(text.to_owned());
        let (scheme, rest) = text.split_once("://").ok_or_else(wrong)?;
        let scheme = scheme.to_ascii_lowercase();
        let usual_port = match scheme.as_str() {
            "http" => ":80",
            "https" => ":443",
            _ => return Err(wrong()),
        };
        let host = rest.strip_suffix('/').unwrap_or(rest).to_ascii_lowercase();
        let allowed = |letter: char| letter.is_ascii_alphanumeric() || ".-_:[]".contains(letter);
        if host.is_empty() || host.starts_with(':') || !host.chars().all(allowed) {
            return Err(wrong());
        }
        let host = host.strip_suffix(usual_port).unwrap_or(&host).to_owned();
        Ok(Self { origin: format!("{scheme}://{host}"), host })
    }
}

impl fmt::Display for PublicUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.origin)
    }
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
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// The method is not GET.
    #[error("only GET requests are allowed")]
    Method,
    /// The Host is missing, repeated, or neither the address that was connected to nor the public URL's.
    #[error(
        "this server is http://{own}, but the browser asked for `{given}`. Open the URL that `motor-hub dashboard` printed. \
         Behind a tunnel (ssh -L), a host name or a proxy, start it with --public-url and what stands in the browser's \
         address line, such as --public-url http://{given}"
    )]
    Host {
        /// The Host headers of the request.
        given: String,
        /// The address that was connected to.
        own: SocketAddr,
    },
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
    pub const fn status(&self) -> &'static str {
        match self {
            Self::Method => "405 Method Not Allowed",
            Self::Host { .. } => "421 Misdirected Request",
            Self::Origin | Self::Token => "403 Forbidden",
            Self::Handshake => "426 Upgrade Required",
        }
    }
}

impl Admission {
    /// Admits requests with this token.
    #[must_use]
    pub const fn new(token: String) -> Self {
        Self { token, public: None }
    }

    /// Admits requests for this URL too.
    #[must_use]
    pub fn reached_as(self, public: PublicUrl) -> Self {
        Self { public: Some(public), ..self }
    }

    /// The URL that was given, by which browsers reach the server; `None` if they connect to its address.
    #[must_use]
    pub const fn public(&self) -> Option<&PublicUrl> {
        self.public.as_ref()
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
        let own = self.origin(head, local)?;
        let own = |origin: &String| *origin == own;
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

    /// The Origin of this server's own page, by the Host of a request.
    fn origin(&self, head: &Head, local: SocketAddr) -> Result<String, Refusal> {
        let refused = || Refusal::Host { given: head.host.join(", "), own: local };
        let [host] = head.host.as_slice() else { return Err(refused()) };
        if let Some(public) = self.public.as_ref().filter(|public| public.host == *host) {
            return Ok(public.origin.clone());
        }
        let named = local.ip().is_loopback() && *host == format!("localhost:{}", local.port());
        if *host == local.to_string() || named { Ok(format!("http://{host}")) } else { Err(refused()) }
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
