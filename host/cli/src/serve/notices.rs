//! What is said on standard error while a hub is served: each kind of thing at once, and then no oftener than it can be
//! read.

use std::time::Duration;

/// Between two lines of a kind, in seconds.
const INTERVAL_S: f64 = 5.0;

/// What has been said.
pub(super) struct Notices {
    lost: Kind<Duration>,
    turned_away: Kind<u32>,
}

/// Something that adds up.
#[derive(Default)]
struct Kind<T> {
    now: T,
    said: T,
    /// When it may be said again.
    again_s: f64,
}

impl<T: Copy + PartialEq> Kind<T> {
    /// True if there is more than was said, and it may be said.
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

    /// What is to be said at a time in seconds, of what has added up so far.
    pub(super) fn due(&mut self, at_s: f64, lost: Duration, turned_away: u32) -> Vec<String> {
        let is_due = [self.lost.is_due(at_s, lost), self.turned_away.is_due(at_s, turned_away)];
        self.say(is_due)
    }

    /// What is left to be said in the end.
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
                "this machine is too slow for real time: {more:.1} s were lost, {all:.1} s in all"
            ));
            self.lost.said = self.lost.now;
        }
        if turned_away {
            let more = self.turned_away.now - self.turned_away.said;
            lines
                .push(format!("the hub is taken, one host at a time: hung up on {more} that came meanwhile"));
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
            ["this machine is too slow for real time: 0.3 s were lost, 0.3 s in all"]
        );
        assert!(notices.due(2.0, lost(900), 0).is_empty());
        assert_eq!(notices.due(2.1, lost(900), 1).len(), 1, "another kind is not kept waiting");
        assert!(notices.due(6.2, lost(900), 1)[0].contains("0.6 s were lost, 0.9 s in all"));
        assert!(notices.due(60.0, lost(900), 1).is_empty());
        assert!(notices.due(60.1, lost(1_000), 1)[0].contains("0.1 s"));
        assert!(notices.due(60.2, lost(1_200), 1).is_empty());
        assert!(notices.rest()[0].contains("0.2 s were lost, 1.2 s"));
        assert!(notices.rest().is_empty());
    }
}
