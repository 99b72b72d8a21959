//! Battery sampling: a conversion every 10 ms, filtered and passed on while it is plausible.

use super::{Health, Task, Wires, micros};
use crate::board::SupplyAdc;
use crate::supply::Supply;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Ticker};

/// The sampling interval.
pub const SUPPLY_INTERVAL: Duration = Duration::from_millis(10);

/// Runs for ever. A dead converter or an implausible voltage sends nothing, and control then finds
/// the last voltage too old.
pub async fn run<M: RawMutex, const N: usize>(
    mut adc: impl SupplyAdc,
    mut supply: Supply,
    wires: &Wires<M, N>,
    health: &Health,
) -> ! {
    let mut ticker = Ticker::every(SUPPLY_INTERVAL);
    loop {
        let voltage = adc.sample().await;
        if let Some(battery) = supply.step(voltage, micros(Instant::now())) {
            wires.battery.signal(battery);
        }
        health.check_in(Task::Supply);
        ticker.next().await;
    }
}
