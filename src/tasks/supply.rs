//! Battery sampling: a conversion every 10 ms, or every millisecond while the bus is anything but quiet; filtered and
//! passed on while it is plausible.

use super::{Health, Task, Wires, micros, whole_millisecond};
use crate::board::SupplyAdc;
use crate::supply::Supply;
use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};

/// The sampling interval while the bus is quiet.
pub const SUPPLY_INTERVAL: Duration = Duration::from_millis(10);

/// While it is not: an ampere that braking motors return lifts 1000 uF by a volt meanwhile.
pub const WATCH_INTERVAL: Duration = Duration::from_millis(1);

/// Then a sample is taken so long before a whole millisecond, when control takes it with those of the encoders.
const AHEAD: Duration = Duration::from_micros(150);

/// Runs for ever. A dead converter or an implausible voltage sends nothing, and control then finds
/// the last voltage too old.
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
        // After an alarm, once without another one: noise at the edge of the band would raise one at once.
        let quiet = supply.quiet().filter(|_| !alarm);
        due = if quiet.is_some() {
            Instant::now().max(due + SUPPLY_INTERVAL)
        } else {
            whole_millisecond(Instant::now() + AHEAD) + WATCH_INTERVAL - AHEAD
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
