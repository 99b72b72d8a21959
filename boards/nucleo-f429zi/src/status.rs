//! What a person at the bench reads: a log line a second over RTT.

use defmt::{Format, info, warn};
use embassy_stm32::pac;
use embassy_time::{Duration, Ticker};
use motor_hub::braking::Regime;
use motor_hub::hub::Snapshot;
use motor_hub::motor::{Faults, Report};

use crate::{MOTORS, Wires};

const INTERVAL: Duration = Duration::from_secs(1);

/// A motor's part of the line.
#[derive(Format)]
struct Brief {
    cps: i32,
    control: i16,
    regime: Option<Regime>,
    faults: Faults,
}

impl Brief {
    fn new(report: Report) -> Self {
        Self {
            cps: report.velocity.round(),
            control: report.control.get(),
            regime: report.regime,
            faults: report.faults,
        }
    }
}

/// Runs for ever.
pub(crate) async fn run(links: &'static Wires) -> ! {
    let mut ticker = Ticker::every(INTERVAL);
    loop {
        ticker.next().await;
        match links.snapshot.try_get() {
            Some(snapshot) => log(&snapshot),
            None => warn!("no control tick yet"),
        }
    }
}

fn log(snapshot: &Snapshot<MOTORS>) {
    info!(
        "tick {=u32} missed {=u32} battery {}: {}",
        snapshot.tick,
        snapshot.missed,
        snapshot.battery,
        snapshot.motors.map(Brief::new)
    );
}

/// Says so if it was the watchdog that started the chip: the last run ended in a fault or a hang.
pub(crate) fn log_reset_cause() {
    if pac::RCC.csr().read().wdgrstf() {
        warn!("started by the watchdog");
    }
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
}
