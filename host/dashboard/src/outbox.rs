//! Queues of texts for pages, one for each page.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};

/// Number of waiting texts from which frames to a page are skipped: the frames of half a second. The page therefore
/// never shows frames as old as [`SILENCE`](crate::pages::SILENCE).
const BACKLOG: usize = 25;

/// Number of waiting texts from which a page is dropped.
const MAX_WAITING_TEXTS: usize = 500;

/// The relay's end of a queue: the relay puts texts in.
#[derive(Clone, Debug)]
pub struct Outbox {
    texts: Sender<Arc<str>>,
    waiting: Arc<AtomicUsize>,
}

/// The page's end of a queue: the page's socket takes texts out.
#[derive(Debug)]
pub struct Texts {
    texts: Receiver<Arc<str>>,
    waiting: Arc<AtomicUsize>,
}

/// Creates the queue of a new page, and returns both ends.
pub fn outbox() -> (Outbox, Texts) {
    let (sender, receiver) = channel();
    let waiting = Arc::<AtomicUsize>::default();
    (Outbox { texts: sender, waiting: Arc::clone(&waiting) }, Texts { texts: receiver, waiting })
}

impl Outbox {
    /// Sends a text; false if the page must be dropped.
    pub(crate) fn send(&self, text: Arc<str>) -> bool {
        self.waiting.fetch_add(1, Ordering::Relaxed) < MAX_WAITING_TEXTS && self.texts.send(text).is_ok()
    }

    /// Sends a frame, which is skipped if the page is too slow; false if the page must be dropped.
    pub(crate) fn show(&self, text: Arc<str>) -> bool {
        self.waiting.load(Ordering::Relaxed) >= BACKLOG || self.send(text)
    }
}

impl Texts {
    /// The next text.
    ///
    /// # Errors
    /// No text waits now, or the relay has dropped the page.
    pub fn next(&self) -> Result<Arc<str>, TryRecvError> {
        let text = self.texts.try_recv()?;
        self.waiting.fetch_sub(1, Ordering::Relaxed);
        Ok(text)
    }
}
