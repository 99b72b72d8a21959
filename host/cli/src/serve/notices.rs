//! Notices on standard error while a hub is served. The first notice of a kind is printed immediately, later ones at
//! intervals.

use std::time::Duration;

/// Shortest interval between two notices of a kind, in seconds.
const INTERVAL_S: f64 = 5.0;

/// Totals, and what has been printed of them.
pub(super) struct Notices {
    lost: Kind<Duration>,
    turned_away: Kind<u32>,
}

/// A total of one kind of notice.
#[derive(Default)]
struct Kind<T> {
    now: T,
    said: T,
    /// Time in seconds of the earliest next notice.
    again_s: f64,
}

impl<T: Copy + PartialEq> Kind<T> {
    /// True if the total has grown since the last notice, and the interval is over.
    fn is_due(&mut self, at_s: f64, now: T) -> bool {
        self.now = now;
        let is_due = now != self.said && at_s >= self.again_s;
        if is_due {
            self.again_s = at_s + INTERVAL_S;
        }
        is_due
    }
}

impl Notices {
    pub(super) fn new() -> Self {
        Self { lost: Kind::default(), turned_away: Kind::default() }
    }

    /// Notices to print at a time in seconds, by the totals so far.
    pub(super) fn due(&mut self, at_s: f64, lost: Duration, turned_away: u32) -> Vec<String> {
        let is_due = [self.lost.is_due(at_s, lost), self.turned_away.is_due(at_s, turned_away)];
        self.say(is_due)
    }

    /// Notices that remain at the end.
    pub(super) fn rest(&mut self) -> Vec<String> {
        let is_due = [self.lost.now != self.lost.said, self.turned_away.now != self.turned_away.said];
        self.say(is_due)
    }

    fn say(&mut self, [lost, turned_away]: [bool; 2]) -> Vec<String> {
        let mut lines = Vec::new();
        if lost {
            let (more, all) = (self.lost.now - self.lost.said, self.lost.now);
            let (more, all) = (more.as_secs_f64(), all.as_secs_f64());
            lines.push(format!(
                "this machine is too slow for real time: {more:.1} s lost, {all:.1} s in total"
            ));
            self.lost.said = self.lost.now;
        }
        if turned_away {
            let more = self.turned_away.now - self.turned_away.said;
            let s = if more == 1 { "" } else { "s" };
            lines.push(format!("the hub accepts one host at a time: closed {more} further connection{s}"));
            self.turned_away.said = self.turned_away.now;
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_lost_is_said_at_once_and_then_every_five_seconds() {
        let mut notices = Notices::new();
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
