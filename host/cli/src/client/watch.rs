//! Implements the command `motor-hub client watch`.

use super::drive;
use super::hub::HubOptions;
use super::motors_off::disable_left_enabled;
use super::readings::{Live, Reading, repeat};
use super::shaft_speed::ShaftOptions;
use crate::output::{Failure, print, versioned};
use crate::parse::{whole, within_a_day};
use std::time::{Duration, Instant};

/// Interval between two checks for motors that another host has enabled; shorter than the hub's keep-alive of 2.5 s.
const CHECK: Duration = Duration::from_secs(1);

/// Shows positions, velocities, battery and status repeatedly; disables running motors first
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Time between readings in milliseconds
    #[arg(long = "interval-ms", alias = "interval", value_name = "MS", default_value_t = 100)]
    #[arg(value_parser = whole("an interval", 10..=2000_u64, "ms"))]
    interval: u64,
    /// Duration in seconds [default: until Ctrl-C]
    #[arg(long = "for-s", alias = "for", value_name = "S", value_parser = within_a_day)]
    length: Option<Duration>,
    /// One JSON document per line; the default if standard output is not a terminal
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    shaft: ShaftOptions,
}

impl Options {
    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let counts_per_turn = self.shaft.counts();
        let session = &mut hub.open(None)?;
        let mut live = Live::new();
        let interval = Duration::from_millis(self.interval);
        let mut checked = Instant::now();
        repeat(interval, self.length, |since| {
            let reading = Reading::take(session, since)?;
            if checked.elapsed() > CHECK {
                disable_left_enabled(session)?;
                checked = Instant::now();
            }
            if live.terminal && !self.json {
                live.redraw(&reading.table(&drive::ALL, counts_per_turn))?;
            } else {
                print(&format!("{}\n", versioned(&reading.json(&drive::ALL, counts_per_turn))?))?;
            }
            Ok(false)
        })
        .map(drop)
    }
}
