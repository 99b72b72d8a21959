//! Decides which page is in control, and whether that page is still open. The module does no input or output, and reads
//! no clock: events and times are arguments.
//!
//! Frames are numbered, and a page returns the number of each frame that it has shown. The page in control counts as
//! gone if a frame that was sent after its newest shown frame is older than [`SILENCE`]. A page that is hidden for more
//! than [`HIDDEN`] counts as gone too. A page that has crashed, and a page that shows old frames from a long queue,
//! therefore count as gone. While the hub does not answer, no frames are sent, and the page keeps control.

use motor_hub_client::clock::Instant;
use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

/// Age of a frame that was not shown from which a page counts as gone.
pub const SILENCE: Duration = Duration::from_secs(1);

/// Time after which a hidden page counts as gone.
pub const HIDDEN: Duration = Duration::from_secs(10);

/// Number of frames whose times of sending are kept: more than are sent in [`SILENCE`].
const REMEMBERED: usize = 128;

/// Why the page in control counts as gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Gone {
    /// The page's socket is closed.
    #[error("the page in control was closed")]
    Closed,
    /// The page has not shown the frames that were sent to it for [`SILENCE`].
    #[error("the page in control showed no new values for 1 s")]
    Silent,
    /// The page was hidden for [`HIDDEN`].
    #[error("the page in control was hidden for 10 s")]
    Hidden,
}

/// All pages, and which of them is in control.
#[derive(Clone, Debug, Default)]
pub struct Pages {
    pages: BTreeMap<u32, Page>,
    controller: Option<u32>,
    /// The page that has asked for control last, while another page is in control.
    asks: Option<u32>,
    sent: VecDeque<(u64, Instant)>,
}

#[derive(Clone, Copy, Debug)]
struct Page {
    /// Time at which the newest shown frame was sent.
    fresh_at: Instant,
    hidden_since: Option<Instant>,
}

impl Pages {
    /// Creates the state without any page.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a page. The page is in control if no other page is.
    pub fn join(&mut self, id: u32, now: Instant) {
        self.pages.insert(id, Page { fresh_at: now, hidden_since: None });
        self.controller = self.controller.or(Some(id));
    }

    /// Removes a page; returns [`Gone::Closed`] if the page was in control.
    pub fn leave(&mut self, id: u32) -> Option<Gone> {
        self.pages.remove(&id);
        self.asks = self.asks.filter(|asks| *asks != id);
        self.loses(id).then_some(Gone::Closed)
    }

    /// Puts a page in control if no other page is in control. Otherwise notes that the page asks for control, and
    /// returns true.
    pub fn take(&mut self, id: u32, now: Instant) -> bool {
        let Some(page) = self.pages.get_mut(&id) else { return false };
        if self.controller.is_some_and(|controller| controller != id) {
            self.asks = Some(id);
            return true;
        }
        if self.controller.is_none() {
            // The user has just clicked in this page, so the page is open.
            page.fresh_at = now;
            (self.controller, self.asks) = (Some(id), None);
        }
        false
    }

    /// Ends a page's control, and gives it to the page that has asked for it; false if the page was not in control.
    pub fn release(&mut self, id: u32) -> bool {
        let was = self.controller == Some(id);
        if was {
            self.controller = self.asks.take();
        }
        was
    }

    /// Ends the control of a page that is gone. An open page gets control only when its user takes it.
    fn loses(&mut self, id: u32) -> bool {
        let was = self.controller == Some(id);
        if was {
            (self.controller, self.asks) = (None, None);
        }
        was
    }

    /// Number of the page that asks for control; `None` if no page asks.
    pub const fn asks(&self) -> Option<u32> {
        self.asks
    }

    /// Number of the page in control; `None` if no page is in control.
    pub const fn controller(&self) -> Option<u32> {
        self.controller
    }

    /// Number of pages.
    pub fn count(&self) -> usize {
        self.pages.len()
    }

    /// Notes that a frame was sent to all pages.
    pub fn sent(&mut self, number: u64, now: Instant) {
        self.sent.push_back((number, now));
        if self.sent.len() > REMEMBERED {
            self.sent.pop_front();
        }
    }

    /// Notes that a page has shown a frame, or has received one while it is hidden. Numbers that were not sent recently are ignored.
    pub fn shown(&mut self, id: u32, number: u64) {
        let at = self.sent.iter().rev().find(|(sent, _)| *sent == number).map(|(_, at)| *at);
        if let (Some(page), Some(at)) = (self.pages.get_mut(&id), at) {
            page.fresh_at = page.fresh_at.max(at);
        }
    }

    /// True if a page has shown a frame that was sent after this time.
    pub fn has_shown_since(&self, id: u32, at: Instant) -> bool {
        self.pages.get(&id).is_some_and(|page| page.fresh_at > at)
    }

    /// Notes that a page is hidden or visible.
    pub fn hide(&mut self, id: u32, hidden: bool, now: Instant) {
        if let Some(page) = self.pages.get_mut(&id) {
            page.hidden_since = hidden.then(|| page.hidden_since.unwrap_or(now));
        }
    }

    /// Ends the control of a page that counts as gone, and returns why.
    pub fn review(&mut self, now: Instant) -> Option<Gone> {
        let id = self.controller?;
        let page = self.pages.get(&id)?;
        let passed = |since: Instant| now.saturating_duration_since(since);
        let not_shown = self.sent.iter().map(|(_, at)| *at).find(|at| *at > page.fresh_at);
        let gone = if not_shown.is_some_and(|at| passed(at) > SILENCE) {
            Some(Gone::Silent)
        } else if page.hidden_since.is_some_and(|since| passed(since) > HIDDEN) {
            Some(Gone::Hidden)
        } else {
            None
        };
        if gone.is_some() {
            self.loses(id);
        }
        gone
    }
}
