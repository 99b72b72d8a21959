//! Supervises the tasks. A task *checks in* when it has done its work once. When every *expected* task has checked in,
//! the supervision feeds the watchdog. A *round* is the time from one feeding to the next.
//!
//! The store task and the update task do not check in, because both may wait for a host or for a slow flash.

use core::cell::Cell;
use embassy_sync::blocking_mutex::CriticalSectionMutex;
use embassy_time::{Duration, Ticker};

/// A task that can check in. Its value is its bit in [`Health`].
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
    /// [`super::responder`], on boards that have this task.
    Responder = 16,
    /// [`super::bridges`], on boards that have this task.
    Bridges = 32,
}

/// Bits of the tasks that every board has.
const ALWAYS_EXPECTED: u8 =
    Task::Capture as u8 | Task::Supply as u8 | Task::Control as u8 | Task::Output as u8;

/// The tasks that have checked in since the watchdog was last fed.
#[derive(Debug)]
pub struct Health {
    /// Bits of the tasks that have checked in. The bits are in a mutex, because some cores have no atomic
    /// read-modify-write.
    checked_in: CriticalSectionMutex<Cell<u8>>,
    /// Bits of the tasks that must check in.
    expected: u8,
    /// Number of completed rounds since reset.
    rounds: CriticalSectionMutex<Cell<u32>>,
}

impl Default for Health {
    fn default() -> Self {
        Self::new()
    }
}

impl Health {
    /// Creates a state in which no task has checked in. Expects only the tasks that every board has.
    pub const fn new() -> Self {
        let rounds = CriticalSectionMutex::new(Cell::new(0));
        Self { checked_in: CriticalSectionMutex::new(Cell::new(0)), expected: ALWAYS_EXPECTED, rounds }
    }

    /// Expects one more task.
    #[must_use]
    pub const fn expecting(self, task: Task) -> Self {
        Self { expected: self.expected | task as u8, ..self }
    }

    /// Checks in a task, because the task has done its work. A task that is not expected has no effect.
    pub fn check_in(&self, task: Task) {
        self.checked_in.lock(|tasks| tasks.set(tasks.get() | task as u8 & self.expected));
    }

    /// Returns the number of completed rounds since reset.
    pub fn rounds(&self) -> u32 {
        self.rounds.lock(Cell::get)
    }

    /// Returns true if all expected tasks have checked in. The next round then begins, in which no task has checked in
    /// yet.
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

/// Interval at which the supervision checks whether all expected tasks have checked in.
pub const HEALTH_INTERVAL: Duration = Duration::from_millis(10);

/// Runs the task. Never returns. `feed` restarts the time-out of a watchdog, which resets the chip when the time is
/// over. A reset opens all bridges.
///
/// If an expected task does not check in within the watchdog's time-out, the watchdog resets the chip. Control checks
/// in once per control period, so the time-out must be clearly longer than the longest period (100 ms).
pub async fn run(mut feed: impl FnMut(), health: &Health) -> ! {
    let mut ticker = Ticker::every(HEALTH_INTERVAL);
    loop {
        ticker.next().await;
        if health.take_if_all() {
            feed();
            health.rounds.lock(|rounds| rounds.set(rounds.get().saturating_add(1)));
        }
    }
}
