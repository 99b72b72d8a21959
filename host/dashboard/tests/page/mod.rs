//! A relay with one page.

use dashboard::Place;
use dashboard::outbox::{Texts, outbox};
use dashboard::relay::{Event, INTERVAL, Relay};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// A relay with one page.
pub(crate) struct Page {
    relay: Relay,
    texts: Texts,
}

impl Page {
    /// Opens the session with the hub, and then the page.
    pub(crate) fn new(place: Place) -> Self {
        let mut relay = Relay::new(place);
        relay.tick();
        let (sender, texts) = outbox();
        relay.handle(Event::Joined(1, sender));
        Self { relay, texts }
    }

    pub(crate) fn order(&mut self, order: &Value) {
        self.relay.handle(Event::Ordered(1, order.to_string()));
    }

    /// Ends the relay, as a server does that ends.
    #[allow(dead_code, reason = "not each test ends the relay")]
    pub(crate) fn end(mut self) {
        self.relay.end("the server has ended");
    }

    /// Returns the first message that `is` accepts. Fails if the relay drops its session before that message.
    pub(crate) fn until(&mut self, what: &str, is: impl Fn(&Value) -> bool) -> Value {
        let end = Instant::now() + Duration::from_secs(10);
        while Instant::now() < end {
            self.relay.tick();
            while let Ok(text) = self.texts.next() {
                let message: Value = serde_json::from_str(&text).unwrap();
                if message["kind"] == "frame" {
                    self.order(&json!({ "shown": { "number": message["number"] } }));
                }
                if is(&message) {
                    return message;
                }
                assert!(message["connected"] != false, "before {what}: {message}");
            }
            std::thread::sleep(INTERVAL);
        }
        panic!("never: {what}");
    }

    /// Returns the next frame.
    pub(crate) fn frame(&mut self) -> Value {
        self.until("a frame", |message| message["kind"] == "frame")
    }
}
