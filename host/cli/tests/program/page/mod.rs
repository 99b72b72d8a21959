//! The program `motor-hub dashboard`, and the socket of a page, for tests.

use crate::common::{PATIENCE, PROGRAM};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, ErrorKind};
use std::net::TcpStream;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};
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

/// The socket of a page, without a browser.
pub(crate) struct Page {
    socket: WebSocket<TcpStream>,
    /// The newest frame.
    pub(crate) frame: Value,
}

impl Page {
    pub(crate) fn open(dashboard: &Dashboard) -> Self {
        let address = dashboard.url.strip_prefix("http://").unwrap();
        let (host, query) = address.split_once("/?").unwrap();
        let mut request = format!("ws://{host}/ws?{query}").into_client_request().unwrap();
        request.headers_mut().insert("Origin", format!("http://{host}").parse().unwrap());
        let (socket, _) = client(request, TcpStream::connect(host).unwrap()).unwrap();
        socket.get_ref().set_read_timeout(Some(Duration::from_millis(10))).unwrap();
        socket.get_ref().set_nodelay(true).unwrap();
        Self { socket, frame: Value::Null }
    }

    /// A page that is connected to a hub with a good battery.
    pub(crate) fn ready(dashboard: &Dashboard) -> Self {
        let mut page = Self::open(dashboard);
        page.until("a battery", |page, _| page.frame["battery_v"].as_f64().is_some_and(|volts| volts > 11.0));
        page
    }

    pub(crate) fn order(&mut self, order: &str, fields: Value) {
        self.send(&json!({ order: fields }).to_string()).unwrap();
    }

    /// Sends any text.
    pub(crate) fn send(&mut self, text: &str) -> Result<(), Error> {
        self.socket.send(Message::text(text))
    }

    /// The next message, if there is one.
    pub(crate) fn receive(&mut self) -> Option<Value> {
        match self.socket.read() {
            Ok(Message::Text(text)) => {
                let message: Value = serde_json::from_str(&text).unwrap();
                if message["kind"] == "frame" {
                    self.frame = message.clone();
                    self.order("shown", json!({ "number": message["number"] }));
                }
                Some(message)
            }
            Ok(_) => None,
            Err(Error::Io(e)) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => None,
            Err(error) => panic!("{error}"),
        }
    }

    pub(crate) fn until(&mut self, what: &str, mut is: impl FnMut(&Self, &Value) -> bool) -> Value {
        let end = Instant::now() + PATIENCE;
        loop {
            assert!(Instant::now() < end, "never: {what}; {}", self.frame);
            if let Some(message) = self.receive()
                && is(self, &message)
            {
                return message;
            }
        }
    }

    /// Waits for a message of this kind.
    pub(crate) fn message(&mut self, kind: &str) -> Value {
        self.until(kind, |_, message| message["kind"] == kind)
    }

    /// Waits for a notice with these words.
    pub(crate) fn notice(&mut self, words: &str) {
        self.until(words, |_, message| message["text"].as_str().is_some_and(|text| text.contains(words)));
    }

    /// Receives messages for a time.
    pub(crate) fn stay(&mut self, time: Duration) {
        let end = Instant::now() + time;
        while Instant::now() < end {
            self.receive();
        }
    }

    pub(crate) fn enabled(&self, motor: usize) -> bool {
        self.frame["motors"][motor]["enabled"] == true
    }

    pub(crate) fn run(&mut self, motor: usize) {
        self.order("drive", json!({ "motor": motor, "mode": "power", "value": 0.3 }));
        self.order("enable", json!({ "motor": motor, "on": true }));
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

    pub(crate) fn refused(&mut self, order: &str, fields: Value) -> String {
        self.order(order, fields);
        self.message("refused")["why"].as_str().unwrap().to_owned()
    }
}
