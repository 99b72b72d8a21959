//! Decides which requests the server admits.
//!
//! Pages of other sites in the same browser can also send requests to this server, and the host name of another site
//! may resolve to this machine (DNS rebinding). Therefore the Host header must be the address at which the connection
//! arrived, `localhost` with the port on a loopback address, or the host of the [`PublicUrl`]. The Origin header of a
//! socket must be this server's own page. Page and socket need the token, which only readers of the printed URL know.
//! The other files are not secret and need no token.

use crate::assets;
use std::borrow::Cow;
use std::fmt;
use std::net::SocketAddr;
use std::str::FromStr;
use tungstenite::handshake::server::{Request, Response, create_response};

/// Number of random bytes in a token, which is written as hexadecimal digits.
const TOKEN_BYTES: usize = 16;

/// Path of the page's WebSocket in its URL.
const SOCKET: &str = "/ws";

/// Admits requests with the right token.
#[derive(Clone, Debug)]
pub(crate) struct Admission {
    token: String,
    public: Option<PublicUrl>,
}

/// The URL by which browsers reach a server behind a tunnel, a host name or a proxy. It is not the server's own
/// address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PublicUrl {
    /// Scheme and host, as browsers send them in the Origin header. The port is left out if it is the usual port of the
    /// scheme.
    origin: String,
    /// Host, as browsers send it in the Host header. The port is left out if it is the usual port of the scheme.
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
    /// The page itself or one of its files: media type and contents.
    File(&'static str, &'static [u8]),
    /// The socket, with the answer to its handshake.
    Socket(Response),
}

/// Why a request is refused.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Refusal {
    /// The server has as many connections as it admits.
    #[error("too many connections: close other pages")]
    Busy,
    /// The connection ended or timed out before the end of the head.
    #[error("the request is incomplete")]
    CutShort,
    /// The head has more than [`LONGEST_HEAD`](crate::http::LONGEST_HEAD) bytes, or too many headers.
    #[error("the request is too long")]
    TooLong,
    /// The method is not GET.
    #[error("only GET requests are allowed")]
    Method,
    /// The head is not HTTP.
    #[error("the request is not HTTP")]
    Malformed,
    /// The page has no such file.
    #[error("no such file")]
    NotFound,
    /// The Host header is missing or repeated, or names neither this server's address nor the public URL's host.
    #[error(
        "this server is http://{own}, but the browser asked for `{given}`. Open the URL that `motor-hub dashboard` printed. \
         Behind a tunnel (ssh -L), a host name or a proxy, start it with --public-url and what stands in the browser's \
         address line, such as --public-url http://{given}"
    )]
    Host {
        /// The Host headers of the request.
        given: String,
        /// Server address at which the connection arrived.
        own: SocketAddr,
    },
    /// The Origin header names another site, or a request for the socket has not exactly one Origin header.
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
            Self::Busy => "503 Service Unavailable",
            Self::CutShort | Self::Malformed => "400 Bad Request",
            Self::TooLong => "431 Request Header Fields Too Large",
            Self::Method => "405 Method Not Allowed",
            Self::NotFound => "404 Not Found",
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

    /// The public URL of the server; `None` if browsers connect to the server's own address.
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
            return Ok(Wanted::File("text/html; charset=utf-8", assets::PAGE.as_bytes()));
        }
        let asset = assets::find(path).ok_or(Refusal::NotFound)?;
        Ok(Wanted::File(asset.kind(), asset.bytes))
    }

    /// Returns the Origin of this server's own page. The request's Host header chooses between the server's address and
    /// the public URL.
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

/// Returns the values of all headers with this name, so that the caller can refuse a repeated header. Bytes that are
/// not UTF-8 become U+FFFD, which no allowed value contains.
fn values<'a>(request: &'a Request, name: &str) -> Vec<Cow<'a, str>> {
    request.headers().get_all(name).iter().map(|value| String::from_utf8_lossy(value.as_bytes())).collect()
}

/// True if both are equal. The time of the comparison does not depend on the bytes that differ, so that the time
/// reveals nothing about the token.
fn is_same(one: &[u8], other: &[u8]) -> bool {
    one.len() == other.len()
        && one.iter().zip(other).fold(0, |differs, (one, other)| differs | (one ^ other)) == 0
}
