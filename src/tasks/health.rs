//! The watchdog is fed only while every task has checked in.

use crate::board::Watchdog;
use core::cell::Cell;
use embassy_sync::blocking_mutex::CriticalSectionMutex;
use embassy_time::{Duration, Ticker};

/// A task that must check in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Task {
    /// [`super::capture`].
    Capture = 1,
    /// [`super::supply`].
    Supply = 2,
    /// [`super::control`].
    Control = 4,
    /// [`super::output`].
    Output = 8,
    /// [`super::responder`], on a board that has one.
    Responder = 16,
    /// [`super::bridges`], on a board that has one.
    Bridges = 32,
}

/// Those that every board has.
const ALWAYS: u8 = Task::Capture as u8 | Task::Supply as u8 | Task::Control as u8 | Task::Output as u8;

/// Who has checked in since the watchdog was last fed.
#[derive(Debug)]
pub struct Health {
    /// In a critical section, not an atomic: some cores can load and store but not read, modify and write.
    checked_in: CriticalSectionMutex<Cell<u8>>,
    expected: u8,
    rounds: CriticalSectionMutex<Cell<u32>>,
}

impl Default for Health {
    fn default() -> Self {
        Self::new()
    }
}

impl Health {
    /// Nobody has; the tasks that every board has are expected.
    pub const fn new() -> Self {
        let rounds = CriticalSectionMutex::new(Cell::new(0));
        Self { checked_in: CriticalSectionMutex::new(Cell::new(0)), expected: ALWAYS, rounds }
    }

    /// Another task is expected besides.
    #[must_use]
    pub const fn expecting(self, task: Task) -> Self {
        Self { expected: self.expected | task as u8, ..self }
    }

    /// A task says that it has done its work.
    pub fn check_in(&self, task: Task) {
        self.checked_in.lock(|tasks| tasks.set(tasks.get() | task as u8 & self.expected));
    }

    /// How often all have checked in since reset.
    pub fn rounds(&self) -> u32 {
        self.rounds.lock(Cell::get)
    }

    /// True if all have checked in; the round then starts anew.
    fn take_if_all(&self) -> bool {
        self.checked_in.lock(|tasks| {
            let all = tasks.get() == self.expected;
            if all {
                tasks.set(0);
            }
            all
        })
    }
}

/// How often the check-ins are looked at.
pub const HEALTH_INTERVAL: Duration = Duration::from_millis(10);

/// Runs for ever. A task is overdue when the watchdog's own time-out has passed, so that must exceed
/// the longest control period (100 ms) by a good margin.
pub async fn run(mut watchdog: impl Watchdog, health: &Health) -> ! {
    let mut ticker = Ticker::every(HEALTH_INTERVAL);
    loop {
        ticker.next().await;
        if health.take_if_all() {
            watchdog.feed();
            health.rounds.lock(|rounds| rounds.set(rounds.get().saturating_add(1)));
        }
    }
}
