//! Measures the bus, and passes its state to control. [`crate::supply`] defines the *quiet range* of the voltage.
//!
//! While the bus is quiet, the task samples every 10 ms, and otherwise every millisecond. If the voltage leaves the
//! quiet range between two samples, the converter's analog watchdog raises an *alarm*, and the task samples
//! immediately.

use super::{Health, Task, Wires, micros, whole_millisecond};
use crate::board::SupplyAdc;
use crate::supply::Supply;
use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};

/// Sampling interval while the bus is quiet.
pub const SUPPLY_INTERVAL: Duration = Duration::from_millis(10);

/// Sampling interval while the bus is not quiet. In this time one ampere from braking motors lifts a capacitor of 1000
/// uF by one volt.
pub const WATCH_INTERVAL: Duration = Duration::from_millis(1);

/// Time by which a sample precedes a whole millisecond, while the bus is not quiet. Control runs at whole milliseconds,
/// and processes the sample together with the encoder samples.
const LEAD: Duration = Duration::from_micros(150);

/// Runs the task. Never returns.
///
/// If the converter fails or the voltage is not plausible, the task sends no new state, and the last state becomes
/// stale. One exception: for a [collapsed](Supply::step) bus the task sends the last state with its old time, and with
/// a draw of 0.
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
                wires.control_wake.signal(());
            }
        }
        wires.bus.lock(|bus| bus.set(supply.last_reading()));
        health.check_in(Task::Supply);
        // In the interval after an alarm the task does not wait for another alarm. Noise at a limit of the quiet range
        // would otherwise raise alarms without a pause.
        let quiet = supply.quiet().filter(|_| !alarm);
        due = if quiet.is_some() {
            Instant::now().max(due + SUPPLY_INTERVAL)
        } else {
            whole_millisecond(Instant::now() + LEAD) + WATCH_INTERVAL - LEAD
        };
        alarm = match quiet {
            Some(quiet) => {
                matches!(select(adc.wait_until_outside(quiet), Timer::at(due)).await, Either::First(()))
            }
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
