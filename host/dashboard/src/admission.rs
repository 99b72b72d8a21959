//! Decides which requests the server admits.
//!
//! A page of another site in the same browser can also send requests to this server, and its name may even resolve to this
//! machine. Therefore the Host of a request must be the address that was connected to, or the [`PublicUrl`] that the user has
//! given. The Origin of a socket must be this server's own page. Page and socket both need the token, which only readers of
//! the printed URL know.

use std::borrow::Cow;
use std::fmt;
use std::net::SocketAddr;
use std::str::FromStr;
use tungstenite::handshake::server::{Request, Response, create_response};

/// Number of random bytes in a token, which is written as hexadecimal digits.
const TOKEN_BYTES: usize = 16;

/// The path of the socket.
const SOCKET: &str = "/ws";

/// Admits requests with the right token.
#[derive(Clone, Debug)]
pub(crate) struct Admission {
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
#[derive(Debug)]
pub(crate) enum Wanted {
    /// The page itself.
    Page,
    /// A file of the page, which is not secret.
    Asset(String),
    /// The socket, with the answer to its handshake.
    Socket(Response),
}

/// Why a request is refused.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Refusal {
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
    pub(crate) const fn status(&self) -> &'static str {
        match self {
            Self::Host { .. } => "421 Misdirected Request",
            Self::Origin | Self::Token => "403 Forbidden",
            Self::Handshake => "426 Upgrade Required",
        }
    }
}

impl Admission {
    /// Admits requests with a token of 128 random bits.
    pub(crate) fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        let token = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Self { token, public: None })
    }

    /// Admits requests for this URL too.
    pub(crate) fn reached_as(self, public: PublicUrl) -> Self {
        Self { public: Some(public), ..self }
    }

    /// The URL that was given, by which browsers reach the server; `None` if they connect to its address.
    pub(crate) const fn public(&self) -> Option<&PublicUrl> {
        self.public.as_ref()
    }

    /// The token.
    pub(crate) fn token(&self) -> &str {
        &self.token
    }

    /// Checks a request that arrived at the address `local`, and returns the resource that the request asks for.
    pub(crate) fn admit(&self, request: &Request, local: SocketAddr) -> Result<Wanted, Refusal> {
        let own = self.origin(request, local)?;
        let origins = values(request, "origin");
        let query = request.uri().query().unwrap_or_default();
        let path = request.uri().path();
        if path == SOCKET {
            // Browsers always send an Origin with a WebSocket handshake.
            if origins != [own] {
                return Err(Refusal::Origin);
            }
            self.check(query)?;
            return create_response(request).map(Wanted::Socket).map_err(|_| Refusal::Handshake);
        }
        if origins.iter().any(|origin| *origin != own) {
            return Err(Refusal::Origin);
        }
        if path == "/" {
            self.check(query)?;
            return Ok(Wanted::Page);
        }
        Ok(Wanted::Asset(path.to_owned()))
    }

    /// The Origin of this server's own page, by the Host of a request.
    fn origin(&self, request: &Request, local: SocketAddr) -> Result<String, Refusal> {
        let hosts = values(request, "host");
        let refused = || Refusal::Host { given: hosts.join(", "), own: local };
        let [host] = hosts.as_slice() else { return Err(refused()) };
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

/// The values of all headers with this name: a repeated header is refused. Bytes that are no text differ from any text.
fn values<'a>(request: &'a Request, name: &str) -> Vec<Cow<'a, str>> {
    request.headers().get_all(name).iter().map(|value| String::from_utf8_lossy(value.as_bytes())).collect()
}

/// Compares in constant time, so that the time does not reveal where the two differ.
fn is_same(one: &[u8], other: &[u8]) -> bool {
    one.len() == other.len()
        && one.iter().zip(other).fold(0, |differs, (one, other)| differs | (one ^ other)) == 0
}
