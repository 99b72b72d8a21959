//! A page without a browser: sends orders to a relay, and waits for messages. The tests of the program use the page over
//! a socket.
#![allow(dead_code, reason = "each test uses its own part")]

use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Longest wait for a message; a machine may have other work.
const PATIENCE: Duration = Duration::from_secs(20);

/// The connection between a page and its relay.
pub(crate) trait Connection {
    /// True if the page may be opened before the hub is connected. If false, a hub that is lost while a test waits for
    /// another message fails the test.
    const MAY_LACK_HUB: bool;

    /// Sends an order. Returns false if the connection is closed.
    fn send(&mut self, text: &str) -> bool;

    /// Returns the next message. Waits some milliseconds if there is none.
    fn receive(&mut self) -> Option<String>;
}

/// A page.
pub(crate) struct Page<C> {
    pub(crate) connection: C,
    /// The newest frame.
    pub(crate) frame: Value,
}

impl<C: Connection> Page<C> {
    pub(crate) fn new(connection: C) -> Self {
        Self { connection, frame: Value::Null }
    }

    pub(crate) fn order(&mut self, order: &str, fields: Value) {
        assert!(self.connection.send(&json!({ order: fields }).to_string()), "{order}");
    }

    /// Returns the next message, if there is one.
    pub(crate) fn receive(&mut self) -> Option<Value> {
        let message: Value = serde_json::from_str(&self.connection.receive()?).expect("JSON");
        if message["kind"] == "frame" {
            self.frame = message.clone();
            self.order("shown", json!({ "number": message["number"] }));
        }
        Some(message)
    }

    /// Returns the first message that `is` accepts.
    pub(crate) fn until(&mut self, what: &str, mut is: impl FnMut(&Self, &Value) -> bool) -> Value {
        let end = Instant::now() + PATIENCE;
        loop {
            assert!(Instant::now() < end, "never: {what}; {}", self.frame);
            let Some(message) = self.receive() else { continue };
            if is(self, &message) {
                return message;
            }
            assert!(C::MAY_LACK_HUB || message["connected"] != false, "before {what}: {message}");
        }
    }

    /// Receives messages for a time.
    pub(crate) fn stay(&mut self, time: Duration) {
        let end = Instant::now() + time;
        while Instant::now() < end {
            self.receive();
        }
    }

    /// Waits for a message of this kind.
    pub(crate) fn message(&mut self, kind: &str) -> Value {
        self.until(kind, |_, message| message["kind"] == kind)
    }

    /// Waits for a notice with these words, and returns its text.
    pub(crate) fn notice(&mut self, words: &str) -> String {
        let has_words = |message: &Value| message["text"].as_str().is_some_and(|text| text.contains(words));
        text(&self.until(words, |_, message| has_words(message))["text"])
    }

    /// Sends an order that is refused, and returns the reason.
    pub(crate) fn refused(&mut self, order: &str, fields: Value) -> String {
        self.order(order, fields);
        text(&self.message("refused")["why"])
    }

    /// Sends an order that changes settings of motor 0, and returns the new settings.
    pub(crate) fn settings(&mut self, order: &str, fields: Value) -> Value {
        // Settings that were sent before the order.
        while self.receive().is_some() {}
        self.order(order, fields);
        self.until("settings", |_, message| message["kind"] == "settings" && message["motor"] == 0)
    }

    /// Waits until the shown hub is the hub with this index.
    pub(crate) fn shows(&mut self, hub: usize) -> Value {
        self.until("another hub", |_, message| message["hubs"][hub]["shown"] == true)
    }

    /// Waits until the hub is connected or lost.
    pub(crate) fn line(&mut self, is_connected: bool) -> Value {
        self.until("the line", |_, message| message["kind"] == "line" && message["connected"] == is_connected)
    }

    pub(crate) fn enabled(&self, motor: usize) -> bool {
        self.frame["motors"][motor]["enabled"] == true
    }

    /// Enables a motor with constant power.
    pub(crate) fn enable(&mut self, motor: usize) {
        self.order("drive", json!({ "motor": motor, "mode": "power", "value": 0.3 }));
        self.order("enable", json!({ "motor": motor, "on": true }));
        self.until("an enabled motor", |page, _| page.enabled(motor));
    }

    /// Stops all motors, and returns the text of the notice.
    pub(crate) fn stop(&mut self) -> String {
        self.order("stop", Value::Null);
        text(&self.until("a stop", |_, message| message["motors_disabled"] == true)["text"])
    }
}

fn text(value: &Value) -> String {
    value.as_str().expect("a text").to_owned()
}
