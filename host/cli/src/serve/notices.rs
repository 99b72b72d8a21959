//! Notices on standard error while a hub is served. The first notice of a kind is printed immediately, later ones at
//! intervals.

use std::ops::Sub;
use std::time::Duration;

/// Shortest interval between two notices of a kind, in seconds.
const INTERVAL_S: f64 = 5.0;

/// Totals whose growth is printed: lost real time and closed connections.
#[derive(Default)]
pub(super) struct Notices {
    lost: Total<Duration>,
    turned_away: Total<u32>,
}

/// One total, with its value at the last notice.
#[derive(Default)]
struct Total<T> {
    now: T,
    /// The total at the last notice.
    said: T,
    /// Time in seconds of the earliest next notice.
    again_s: f64,
}

impl<T: Copy + PartialEq + Sub<Output = T>> Total<T> {
    /// Returns the growth since the last notice. `None` if the total has not grown or the interval is not over.
    fn growth(&mut self, at_s: f64, now: T) -> Option<T> {
        self.now = now;
        if now == self.said || at_s < self.again_s {
            return None;
        }
        let growth = now - self.said;
        (self.said, self.again_s) = (now, at_s + INTERVAL_S);
        Some(growth)
    }
}

impl Notices {
    /// Returns the notices to print at the time `at_s` in seconds. `lost` and `turned_away` are the totals at this
    /// time.
    pub(super) fn due(&mut self, at_s: f64, lost: Duration, turned_away: u32) -> Vec<String> {
        let all = lost.as_secs_f64();
        let lost = self.lost.growth(at_s, lost).map(|more| {
            let more = more.as_secs_f64();
            format!("this machine is too slow for real time: {more:.1} s lost, {all:.1} s in total")
        });
        let turned_away = self.turned_away.growth(at_s, turned_away).map(|more| {
            let s = if more == 1 { "" } else { "s" };
            format!("the hub accepts one host at a time: closed {more} further connection{s}")
        });
        lost.into_iter().chain(turned_away).collect()
    }

    /// Returns the notices of growth that has not been printed at the end.
    pub(super) fn rest(&mut self) -> Vec<String> {
        self.due(f64::INFINITY, self.lost.now, self.turned_away.now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_lost_is_said_at_once_and_then_every_five_seconds() {
        let mut notices = Notices::default();
        let lost = |ms| Duration::from_millis(ms);
        assert!(notices.due(1.0, lost(0), 0).is_empty());
        assert_eq!(
            notices.due(1.1, lost(300), 0),
            ["this machine is too slow for real time: 0.3 s lost, 0.3 s in total"]
        );
        assert!(notices.due(2.0, lost(900), 0).is_empty());
        assert_eq!(notices.due(2.1, lost(900), 1).len(), 1, "another kind is not kept waiting");
        assert!(notices.due(6.2, lost(900), 1)[0].contains("0.6 s lost, 0.9 s in total"));
        assert!(notices.due(60.0, lost(900), 1).is_empty());
        assert!(notices.due(60.1, lost(1_000), 1)[0].contains("0.1 s"));
        assert!(notices.due(60.2, lost(1_200), 1).is_empty());
        assert!(notices.rest()[0].contains("0.2 s lost, 1.2 s"));
        assert!(notices.rest().is_empty());
    }
}
