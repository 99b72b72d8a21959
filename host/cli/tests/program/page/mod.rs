//! The program `motor-hub dashboard`, and the socket of its page.

#[path = "../../../../dashboard/tests/page/mod.rs"]
mod shared;

use crate::common::PROGRAM;
use shared::Connection;
use std::io::{BufRead, BufReader, ErrorKind};
use std::net::TcpStream;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Error, Message, WebSocket, client};

/// The program, and its URL.
pub(crate) struct Dashboard {
    process: Child,
    pub(crate) url: String,
    /// Standard output after the URL.
    pub(crate) output: BufReader<ChildStdout>,
}

impl Dashboard {
    pub(crate) fn start(arguments: &[&str]) -> Self {
        Self::start_with(arguments, &[])
    }

    /// Starts the program with these variables of the environment.
    pub(crate) fn start_with(arguments: &[&str], variables: &[(&str, &str)]) -> Self {
        let mut command = Command::new(PROGRAM);
        command.arg("dashboard").args(arguments).envs(variables.iter().copied());
        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut url = String::new();
        let mut output = BufReader::new(process.stdout.take().unwrap());
        output.read_line(&mut url).unwrap();
        Self { process, url: url.trim().to_owned(), output }
    }

    /// Asks the program to end, and waits until it has.
    pub(crate) fn end(&mut self) {
        assert!(Command::new("kill").arg(self.process.id().to_string()).status().unwrap().success());
        assert!(self.process.wait().unwrap().success());
    }
}

impl Drop for Dashboard {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A WebSocket whose reads end after some milliseconds.
type Socket = WebSocket<TcpStream>;

/// Returns the next text; `None` if no text has arrived.
pub(crate) fn read_text(socket: &mut Socket) -> Option<String> {
    match socket.read() {
        Ok(Message::Text(text)) => Some(text.to_string()),
        Ok(_) => None,
        Err(Error::Io(error)) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => None,
        Err(error) => panic!("the other end is gone: {error}"),
    }
}

impl Connection for Socket {
    const MAY_LACK_HUB: bool = true;

    fn send(&mut self, text: &str) -> bool {
        Self::send(self, Message::text(text)).is_ok()
    }

    fn receive(&mut self) -> Option<String> {
        read_text(self)
    }
}

/// A page without a browser.
pub(crate) type Page = shared::Page<Socket>;

impl Page {
    pub(crate) fn open(dashboard: &Dashboard) -> Self {
        let address = dashboard.url.strip_prefix("http://").unwrap();
        let (host, query) = address.split_once("/?").unwrap();
        let mut request = format!("ws://{host}/ws?{query}").into_client_request().unwrap();
        request.headers_mut().insert("Origin", format!("http://{host}").parse().unwrap());
        let (socket, _) = client(request, TcpStream::connect(host).unwrap()).unwrap();
        socket.get_ref().set_read_timeout(Some(Duration::from_millis(10))).unwrap();
        socket.get_ref().set_nodelay(true).unwrap();
        Self::new(socket)
    }

    /// A page that is connected to a hub with a good battery.
    pub(crate) fn ready(dashboard: &Dashboard) -> Self {
        let mut page = Self::open(dashboard);
        page.battery();
        page
    }

    /// Waits until the battery is good.
    pub(crate) fn battery(&mut self) {
        self.until("a battery", |page, _| page.frame["battery_v"].as_f64().is_some_and(|volts| volts > 11.0));
    }

    pub(crate) fn run(&mut self, motor: usize) {
        self.enable(motor);
        self.until("a motor that runs", |page, _| {
            page.enabled(motor) && page.frame["motors"][motor]["velocity"].as_f64() > Some(100.0)
        });
    }

    /// Waits for a notice with this text, and for motor 0 to be disabled.
    pub(crate) fn off(&mut self, says: &str) {
        let mut noticed = false;
        self.until(says, |page, message| {
            noticed |= message["kind"] == "notice" && message["text"].as_str().unwrap().contains(says);
            noticed && !page.enabled(0) && page.frame["motors"][0]["regime"].is_null()
        });
    }
}
