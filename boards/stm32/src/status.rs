//! The log of a hub: some lines every second, which a debug probe reads over RTT (real-time transfer).

use defmt::{info, warn};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Ticker};
use motor_hub::hub::Snapshot;
use motor_hub::tasks::Wires;

const INTERVAL: Duration = Duration::from_secs(1);

/// Logs the first line of a run, which names the board.
pub fn started(board: &str) {
    info!("motor-hub {=str} on {=str}", env!("CARGO_PKG_VERSION"), board);
}

/// Logs the newest snapshot, and a new fault, every second.
pub async fn run<M: RawMutex, const N: usize>(wires: &Wires<M, N>) -> ! {
    let mut ticker = Ticker::every(INTERVAL);
    let mut last = None;
    loop {
        ticker.next().await;
        let newest = wires.record.lock(|record| record.try_borrow().ok()?.as_ref()?.heads().next());
        if let Some(head) = newest.filter(|head| last != Some((head.number, head.times))) {
            last = Some((head.number, head.times));
            // Each number has a section in docs/reference/fault-numbers.md.
            let (number, run) = (head.fault.number(), head.run);
            warn!(
                "on record: fault {=u8} in run {=u16} after {=u32} ms, motor {}",
                number, run, head.uptime_ms, head.motor
            );
        }
        match wires.snapshot.try_get() {
            Some(snapshot) => log(&snapshot),
            None => warn!("no control tick yet"),
        }
    }
}

fn log<const N: usize>(snapshot: &Snapshot<N>) {
    info!("tick {=u32} missed {=u32} battery {}", snapshot.tick, snapshot.missed_ticks, snapshot.battery);
    for (motor, report) in snapshot.motors.iter().enumerate() {
        let cps = report.velocity.round();
        info!("motor {=usize}: {=i32} counts/s, {}, {}", motor, cps, report.voltage, report.regime);
        if report.faults.any() {
            warn!("motor {=usize}: {}", motor, report.faults);
        }
    }
}
