//! A relay in this process, and its page.

use crate::page::{Connection, Page};
use dashboard::Place;
use dashboard::outbox::{Texts, outbox};
use dashboard::relay::{Event, INTERVAL, Relay};

/// A relay with one page.
pub(crate) struct Local {
    pub(crate) relay: Relay,
    texts: Texts,
}

impl Connection for Local {
    const MAY_LACK_HUB: bool = false;

    fn send(&mut self, text: &str) -> bool {
        self.relay.handle(Event::Ordered(1, text.to_owned()));
        true
    }

    fn receive(&mut self) -> Option<String> {
        let text = self.texts.next();
        if text.is_err() {
            std::thread::sleep(INTERVAL);
            self.relay.tick();
        }
        text.ok().map(|text| text.to_string())
    }
}

/// Opens the session with the hub, and then the page.
pub(crate) fn page(place: Place) -> Page<Local> {
    let mut relay = Relay::new(place);
    relay.tick();
    let (sender, texts) = outbox();
    relay.handle(Event::Joined(1, sender));
    Page::new(Local { relay, texts })
}
