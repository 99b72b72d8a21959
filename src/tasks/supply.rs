//! Battery sampling: measures the bus every 10 ms, or every millisecond while the bus is not quiet, and passes the state
//! on to control.
//!
//! While the bus is quiet, the converter's watchdog raises an alarm when the voltage leaves the quiet range. The next
//! sample is then taken immediately.

use super::{Health, Task, Wires, micros, whole_millisecond};
use crate::board::SupplyAdc;
use crate::supply::Supply;
use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};

/// Sampling interval while the bus is quiet.
pub const SUPPLY_INTERVAL: Duration = Duration::from_millis(10);

/// Sampling interval while the bus is not quiet. One ampere from braking motors lifts 1000 uF by one volt in this time.
pub const WATCH_INTERVAL: Duration = Duration::from_millis(1);

/// Time from a sample to the next whole millisecond, while the bus is not quiet. At the whole millisecond control
/// processes the sample together with the encoder samples.
const LEAD: Duration = Duration::from_micros(150);

/// Runs the task. Never returns.
///
/// If the converter fails or the voltage is implausible, the task sends no new state. Control finds then that the last
/// state is stale.
pub async fn run<M: RawMutex, const N: usize>(
    mut adc: impl SupplyAdc,
    mut supply: Supply,
    wires: &Wires<M, N>,
    health: &Health,
) -> ! {
    let mut due = Instant::now();
    let mut alarm = false;
    loop {
        let voltage = adc.sample().await;
        if let Some(battery) = supply.step(voltage, micros(Instant::now())) {
            wires.battery.signal(battery);
            if alarm {
                wires.news.signal(());
            }
        }
        wires.bus.lock(|bus| bus.set(supply.seen()));
        health.check_in(Task::Supply);
        // The interval after an alarm has no alarm. Noise at the limit of the quiet range would raise one immediately.
        let quiet = supply.quiet().filter(|_| !alarm);
        due = if quiet.is_some() {
            Instant::now().max(due + SUPPLY_INTERVAL)
        } else {
            whole_millisecond(Instant::now() + LEAD) + WATCH_INTERVAL - LEAD
        };
        alarm = match quiet {
            Some(quiet) => matches!(select(adc.leaves(quiet), Timer::at(due)).await, Either::First(())),
            None => {
                Timer::at(due).await;
                false
            }
        };
        if alarm {
            due = Instant::now();
        }
    }
}
