//! A headless Chromium, driven over its DevTools protocol.

pub(crate) mod page;

use crate::common::{PATIENCE, folder, wait_for};
use crate::page::read_text;
use data_encoding::BASE64;
use serde_json::{Value, json};
use std::io::Write;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket, client};

const PROGRAMS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// The browser of this machine. Without a browser a test says so and passes; on a build server it fails.
pub(crate) fn find() -> Option<PathBuf> {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let places = std::env::split_paths(&folders).flat_map(|folder| PROGRAMS.map(|name| folder.join(name)));
    let found =
        std::env::var_os("CHROMIUM").map(PathBuf::from).into_iter().chain(places).find(|path| path.exists());
    if found.is_none() {
        assert!(std::env::var_os("CI").is_none(), "there is no Chromium, which a build server must have");
        // Directly on the terminal: cargo hides the output of a test that passes.
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: there is no Chromium on this machine (apt install chromium)"
        );
    }
    found
}

/// How an event of a packet of a WebSocket begins.
const PACKET: &str = r#"{"method":"Network.webSocketFrame"#;

/// Interval between two questions to a page that a test waits for. Each question takes some of the page's time.
const POLL: Duration = Duration::from_millis(20);

/// Ends the browser and removes its profile when standard input is closed. The shell outlives Ctrl-C for this purpose.
/// Helpers of the browser may still write for a moment.
const KEEPER: &str = r#"trap '' INT; "$@" & read -r end; kill -KILL $!; wait
    while rm -rf "$PROFILE"; sleep 0.1; [ -e "$PROFILE" ]; do :; done"#;

/// A running Chromium with an empty profile. It ends with this value, or with the process of the tests.
pub(crate) struct Browser {
    /// The shell that runs [`KEEPER`].
    keeper: Child,
    /// The browser's DevTools.
    socket: WebSocket<TcpStream>,
    number: u64,
    /// Events that have arrived, except packets of WebSockets.
    events: Vec<Value>,
    /// True if a server has notified a page that the page in control showed nothing for 1 s.
    was_starved: bool,
}

impl Browser {
    pub(crate) fn start(program: &Path) -> Self {
        static STARTED: AtomicU32 = AtomicU32::new(0);
        let number = STARTED.fetch_add(1, Ordering::Relaxed);
        let folder = folder(&format!("browser-{}-{number}", std::process::id()));
        let keeper = Command::new("sh")
            .args(["-c", KEEPER, "sh"])
            .arg(program)
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
            .args(["--hide-scrollbars", "--force-color-profile=srgb", "--remote-debugging-port=0"])
            .arg(format!("--user-data-dir={}", folder.display()))
            .arg("about:blank")
            .env("PROFILE", &folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the browser starts");
        // The browser writes the port and the path of its DevTools to this file.
        let file = folder.join("DevToolsActivePort");
        let (port, path) = wait_for("the browser's port", || {
            let text = std::fs::read_to_string(&file).ok()?;
            let (port, path) = text.split_once('\n')?;
            Some((port.parse::<u16>().ok()?, path.trim().to_owned()))
        });
        let stream = TcpStream::connect(("127.0.0.1", port)).expect("the browser listens");
        stream.set_nodelay(true).expect("at once");
        let (socket, _) = client(format!("ws://127.0.0.1:{port}{path}"), stream).expect("a socket");
        socket.get_ref().set_read_timeout(Some(Duration::from_millis(20))).expect("a timeout");
        Self { keeper, socket, number: 0, events: Vec::new(), was_starved: false }
    }

    /// A new tab without content, by its number.
    fn tab(&mut self) -> Value {
        self.call(None, "Target.createTarget", json!({ "url": "about:blank" }))["targetId"].clone()
    }

    /// Sends a command, and returns its result.
    pub(crate) fn call(&mut self, session: Option<&str>, method: &str, parameters: Value) -> Value {
        self.number += 1;
        let number = self.number;
        let mut command = json!({ "id": number, "method": method, "params": parameters });
        if let Some(session) = session {
            command["sessionId"] = session.into();
        }
        self.socket.send(Message::text(command.to_string())).expect("the browser listens");
        let end = Instant::now() + PATIENCE;
        loop {
            assert!(Instant::now() < end, "{method}: no answer");
            if let Some(answer) = self.receive().filter(|message| message["id"] == number) {
                // A question to a page that gives way to another has no result.
                let gives_way = answer["error"]["message"] == "Inspected target navigated or closed";
                assert!(gives_way || answer.get("error").is_none(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
        }
    }

    /// An answer; events are kept.
    fn receive(&mut self) -> Option<Value> {
        let text = read_text(&mut self.socket)?;
        // A page receives 50 packets per second, which are not worth their parsing.
        if text.starts_with(PACKET) {
            self.was_starved |= text.contains("showed no new values for 1 s");
            return None;
        }
        let message: Value = serde_json::from_str(&text).expect("JSON");
        if message.get("id").is_some() {
            return Some(message);
        }
        self.events.push(message);
        None
    }

    /// A tab of this size, at an address.
    pub(crate) fn open(&mut self, url: &str, width: u32, height: u32) -> Tab<'_> {
        let target = json!({ "targetId": self.tab(), "flatten": true });
        let attached = self.call(None, "Target.attachToTarget", target);
        let session = attached["sessionId"].as_str().expect("a session").to_owned();
        let mut tab = Tab { browser: self, session };
        for domain in ["Page", "Runtime", "Log", "Network"] {
            tab.call(&format!("{domain}.enable"), json!({}));
        }
        tab.resize(width, height);
        tab.call("Page.navigate", json!({ "url": url }));
        tab
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        drop(self.keeper.stdin.take());
        let _ = self.keeper.wait();
    }
}

/// A page.
pub(crate) struct Tab<'a> {
    browser: &'a mut Browser,
    session: String,
}

impl Tab<'_> {
    pub(crate) fn call(&mut self, method: &str, parameters: Value) -> Value {
        let session = self.session.clone();
        self.browser.call(Some(&session), method, parameters)
    }

    pub(crate) fn resize(&mut self, width: u32, height: u32) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", size);
    }

    /// Value of an expression.
    pub(crate) fn ask(&mut self, expression: &str) -> Value {
        let parameters = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.call("Runtime.evaluate", parameters);
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub(crate) fn wait(&mut self, expression: &str) {
        assert!(self.becomes(expression, PATIENCE), "never: {expression}; {:#?}", self.complaints());
    }

    /// Returns the text of an element.
    pub(crate) fn text(&mut self, selector: &str) -> String {
        let text = self.ask(&format!("document.querySelector({selector:?}).textContent"));
        text.as_str().expect("a text").to_owned()
    }

    /// Waits until the text of an element begins with these words.
    pub(crate) fn says(&mut self, selector: &str, words: &str) {
        self.wait(&format!("document.querySelector({selector:?}).textContent.startsWith({words:?})"));
    }

    /// Waits until this is the whole text of an element.
    pub(crate) fn reads(&mut self, selector: &str, text: &str) {
        self.wait(&format!("document.querySelector({selector:?}).textContent === {text:?}"));
    }

    /// Waits until an expression is true. Returns false if the expression is not true within this time.
    pub(crate) fn becomes(&mut self, expression: &str, within: Duration) -> bool {
        let end = Instant::now() + within;
        while self.ask(&format!("Boolean({expression})")) != true {
            if Instant::now() >= end {
                return false;
            }
            std::thread::sleep(POLL);
        }
        true
    }

    /// Waits until the page has been painted again, and no colour changes any more.
    pub(crate) fn settle(&mut self) {
        self.ask(
            "(async () => { const painted = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))); \
                await painted(); await Promise.allSettled(document.getAnimations().map(({ finished }) => finished)); await painted(); })()",
        );
    }

    /// True if a page of this browser has lost its motors because it showed nothing for 1 s, or if no page is in control now.
    /// A page that loses control while no motor is enabled gets no notice.
    pub(crate) fn was_starved(&mut self) -> bool {
        // Events arrive before the answer to a later question.
        let is_free = self.ask("window.dashboard?.state.controller === null") == true;
        self.browser.was_starved || is_free
    }

    /// Presses a key and releases it.
    pub(crate) fn press(&mut self, (key, code): (&str, u32)) {
        for kind in ["rawKeyDown", "keyUp"] {
            let mut event = json!({ "type": kind, "key": key, "code": if key == " " { "Space" } else { key }, "windowsVirtualKeyCode": code });
            if kind == "rawKeyDown" && key == "Enter" {
                event["type"] = "keyDown".into();
                event["text"] = "\r".into();
            }
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// Clicks in the middle of an element.
    pub(crate) fn click(&mut self, selector: &str) {
        let (x, y) = page::point(self, selector, "b.width / 2", "b.height / 2");
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", event);
        }
    }

    /// Changes the value of a field, as typing or choosing does.
    pub(crate) fn fill(&mut self, selector: &str, value: &str) {
        self.ask(&format!(
            "(() => {{ const e = document.querySelector('{selector}'); e.value = '{value}'; e.dispatchEvent(new Event('input', {{bubbles: true}})); e.dispatchEvent(new Event('change', {{bubbles: true}})); }})()"
        ));
    }

    /// Saves a picture of the window, or of the whole page.
    pub(crate) fn picture(&mut self, path: &Path, whole: bool) {
        let picture =
            self.call("Page.captureScreenshot", json!({ "format": "png", "captureBeyondViewport": whole }));
        let bytes = BASE64.decode(picture["data"].as_str().expect("a picture").as_bytes()).expect("Base64");
        std::fs::write(path, bytes).expect("it can be written");
    }

    /// Errors and warnings of the console, and requests to other servers.
    pub(crate) fn complaints(&mut self) -> Vec<String> {
        // Events arrive before the answer to a later question.
        let own = self.ask("location.host").as_str().unwrap_or_default().to_owned();
        let is_foreign = |url: &str| {
            !["http", "ws"].iter().any(|scheme| url.starts_with(&format!("{scheme}://{own}/")))
                && !["about:", "blob:", "data:"].iter().any(|scheme| url.starts_with(scheme))
        };
        let events = self.browser.events.iter().filter(|event| event["sessionId"] == *self.session);
        events
            .filter(|event| match event["method"].as_str().unwrap_or_default() {
                "Runtime.exceptionThrown" => true,
                "Runtime.consoleAPICalled" => {
                    ["error", "warning", "assert"].iter().any(|kind| event["params"]["type"] == *kind)
                }
                "Log.entryAdded" => {
                    ["error", "warning"].iter().any(|level| event["params"]["entry"]["level"] == *level)
                }
                "Network.requestWillBeSent" => {
                    is_foreign(event["params"]["request"]["url"].as_str().unwrap_or_default())
                }
                "Network.webSocketCreated" => is_foreign(event["params"]["url"].as_str().unwrap_or_default()),
                _ => false,
            })
            .map(Value::to_string)
            .collect()
    }

    /// Shows another tab of the same window.
    pub(crate) fn hide(&mut self) {
        self.browser.tab();
        self.wait("document.hidden");
    }

    /// Ends the tab's process, as the system does when there is no memory left.
    pub(crate) fn kill(self) {
        // A process that has crashed does not answer.
        let command = json!({ "id": 0, "method": "Page.crash", "params": {}, "sessionId": self.session });
        self.browser.socket.send(Message::text(command.to_string())).expect("the browser listens");
    }

    /// Keeps the page's own thread busy, so that it can do nothing else.
    pub(crate) fn hang(&mut self) {
        let command = json!({ "id": 0, "method": "Runtime.evaluate", "params": { "expression": "for (;;);" }, "sessionId": self.session });
        self.browser.socket.send(Message::text(command.to_string())).expect("the browser listens");
    }

    /// Number of the process that paints the browser's pages.
    pub(crate) fn painter(&mut self) -> u32 {
        let info = self.browser.call(None, "SystemInfo.getProcessInfo", json!({}));
        let processes = info["processInfo"].as_array().expect("processes");
        let painter =
            processes.iter().find(|process| process["type"] == "GPU").expect("a process that paints");
        u32::try_from(painter["id"].as_u64().expect("a number")).expect("a process")
    }
}
