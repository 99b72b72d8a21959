//! Notices on standard error while a hub is served. The first notice of a kind is printed immediately, later ones at
//! intervals.

/// Shortest interval between two notices of a kind, in seconds.
const INTERVAL_S: f64 = 5.0;

/// Totals whose growth is printed: lost real time in seconds, and rejected hosts.
#[derive(Default)]
pub(super) struct Notices {
    lost_s: Total,
    rejected_hosts: Total,
}

/// One total.
#[derive(Default)]
struct Total {
    /// The total at the last notice.
    printed: f64,
    /// Time in seconds of the earliest next notice.
    next_s: f64,
}

impl Total {
    /// Returns the growth since the last notice. `None` if the total has not grown or the interval is not over.
    fn growth(&mut self, at_s: f64, now: f64) -> Option<f64> {
        if now == self.printed || at_s < self.next_s {
            return None;
        }
        let growth = now - self.printed;
        (self.printed, self.next_s) = (now, at_s + INTERVAL_S);
        Some(growth)
    }
}

impl Notices {
    /// Returns the notices to print at the time `at_s` in seconds. The totals at this time are the lost real time in
    /// seconds, and the number of rejected hosts.
    pub(super) fn due(&mut self, at_s: f64, [lost_s, rejected_hosts]: [f64; 2]) -> Vec<String> {
        let lost = self.lost_s.growth(at_s, lost_s).map(|more| {
            format!("this machine is too slow for real time: {more:.1} s lost, {lost_s:.1} s in total")
        });
        let rejected = self.rejected_hosts.growth(at_s, rejected_hosts).map(|more| {
            let s = if more == 1.0 { "" } else { "s" };
            format!("the hub accepts one host at a time: closed {more} further connection{s}")
        });
        lost.into_iter().chain(rejected).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_lost_is_said_at_once_and_then_every_five_seconds() {
        let mut notices = Notices::default();
        assert!(notices.due(1.0, [0.0, 0.0]).is_empty());
        assert_eq!(
            notices.due(1.1, [0.3, 0.0]),
            ["this machine is too slow for real time: 0.3 s lost, 0.3 s in total"]
        );
        assert!(notices.due(2.0, [0.9, 0.0]).is_empty());
        assert_eq!(notices.due(2.1, [0.9, 1.0]).len(), 1, "another kind is not kept waiting");
        assert!(notices.due(6.2, [0.9, 1.0])[0].contains("0.6 s lost, 0.9 s in total"));
        assert!(notices.due(60.0, [0.9, 1.0]).is_empty());
        assert!(notices.due(60.1, [1.0, 1.0])[0].contains("0.1 s"));
        assert!(notices.due(60.2, [1.2, 1.0]).is_empty());
        assert!(notices.due(f64::INFINITY, [1.2, 1.0])[0].contains("0.2 s lost, 1.2 s"));
        assert!(notices.due(f64::INFINITY, [1.2, 1.0]).is_empty());
    }
}
