//! Who is in control, and whether they are still there. Pure: it is told what happens and when.
//!
//! Frames are numbered, and a page returns the number of each that it has shown. The page in control is there as long
//! as it has shown one that was sent less than [`SILENCE`] ago, and was not hidden for [`HIDDEN`]. So neither a dead tab
//! nor one that is fed from a long queue is taken for somebody who watches.
//!
//! ```
//! use dashboard::desk::{Desk, Gone, SILENCE};
//! use std::time::{Duration, Instant};
//!
//! let start = Instant::now();
//! let mut desk = Desk::new();
//! // The first page that comes is in control.
//! desk.join(1, start);
//! assert_eq!(desk.controller(), Some(1));
//! desk.sent(7, start);
//! desk.shown(1, 7);
//! assert_eq!(desk.review(start + SILENCE), None);
//! assert_eq!(desk.review(start + SILENCE + Duration::from_millis(1)), Some(Gone::Silent));
//! assert_eq!(desk.controller(), None);
//! ```

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

/// A page that has shown nothing newer than this is gone.
pub const SILENCE: Duration = Duration::from_secs(1);

/// A page that was not to be seen for so long is gone.
pub const HIDDEN: Duration = Duration::from_secs(10);

/// Frames of which it is known when they were sent: more than [`SILENCE`] of them.
const REMEMBERED: usize = 128;

/// Why the page in control is taken to be gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Gone {
    /// Its socket is closed.
    #[error("the page in control was closed")]
    Closed,
    /// It has shown nothing.
    #[error("the page in control showed nothing for a second")]
    Silent,
    /// It was not to be seen.
    #[error("the page in control was hidden for ten seconds")]
    Hidden,
}

/// Pages, and which of them is in control.
#[derive(Clone, Debug, Default)]
pub struct Desk {
    pages: BTreeMap<u32, Page>,
    controller: Option<u32>,
    sent: VecDeque<(u64, Instant)>,
}

#[derive(Clone, Copy, Debug)]
struct Page {
    /// When the newest frame that it has shown was sent.
    fresh_at: Instant,
    hidden_since: Option<Instant>,
}

impl Desk {
    /// Nobody is there.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A page comes. It is in control if no other is.
    pub fn join(&mut self, id: u32, now: Instant) {
        self.pages.insert(id, Page { fresh_at: now, hidden_since: None });
        self.controller = self.controller.or(Some(id));
    }

    /// A page is gone; says so if it was in control.
    pub fn leave(&mut self, id: u32) -> Option<Gone> {
        self.pages.remove(&id);
        self.gives_up(id).then_some(Gone::Closed)
    }

    /// It wants to be in control; false if another is.
    pub fn take(&mut self, id: u32, now: Instant) -> bool {
        if self.controller.is_some_and(|other| other != id) {
            return false;
        }
        let Some(page) = self.pages.get_mut(&id) else { return false };
        if self.controller.is_none() {
            // Somebody has just touched it.
            page.fresh_at = now;
        }
        self.controller = Some(id);
        true
    }

    /// It wants to be in control no more; true if it was.
    pub fn gives_up(&mut self, id: u32) -> bool {
        let was = self.controller == Some(id);
        self.controller = self.controller.filter(|controller| *controller != id);
        was
    }

    /// Who is in control.
    #[must_use]
    pub const fn controller(&self) -> Option<u32> {
        self.controller
    }

    /// How many pages there are.
    #[must_use]
    pub fn pages(&self) -> usize {
        self.pages.len()
    }

    /// A frame goes out to all.
    pub fn sent(&mut self, number: u64, now: Instant) {
        self.sent.push_back((number, now));
        if self.sent.len() > REMEMBERED {
            self.sent.pop_front();
        }
    }

    /// A page has shown a frame. One that was never sent, or too long ago, is none.
    pub fn shown(&mut self, id: u32, number: u64) {
        let at = self.sent.iter().rev().find(|(sent, _)| *sent == number).map(|(_, at)| *at);
        if let (Some(page), Some(at)) = (self.pages.get_mut(&id), at) {
            page.fresh_at = page.fresh_at.max(at);
        }
    }

    /// A page is hidden, or is seen again.
    pub fn hide(&mut self, id: u32, hidden: bool, now: Instant) {
        if let Some(page) = self.pages.get_mut(&id) {
            page.hidden_since = hidden.then(|| page.hidden_since.unwrap_or(now));
        }
    }

    /// Says once that the page in control is gone, which then is in control no more.
    pub fn review(&mut self, now: Instant) -> Option<Gone> {
        let id = self.controller?;
        let page = self.pages.get(&id)?;
        let passed = |since: Instant| now.saturating_duration_since(since);
        let gone = if passed(page.fresh_at) > SILENCE {
            Some(Gone::Silent)
        } else if page.hidden_since.is_some_and(|since| passed(since) > HIDDEN) {
            Some(Gone::Hidden)
        } else {
            None
        };
        if gone.is_some() {
            self.controller = None;
        }
        gone
    }
}
