//! The control ticker: every sample of the encoders to the hub's observers, and with it what bridges say of themselves
//! and what is new of the bus, which may change the drives at once, as may commands that need no regulator; an alarm of the
//! bus, which waits for no sample; every period, all commands in, one step of the hub, drives and snapshot out.

use super::capture::CAPTURE_INTERVAL;
use super::{Health, Task, Wires, micros, whole_millisecond};
use crate::hub::{Hub, Inputs};
use crate::motion::Newest;
use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};

/// Runs for ever. (The hub is borrowed because a future holds an argument twice.)
///
/// Ticks stay on a grid of whole periods from the start. A tick that ends after the next one was due
/// makes that one be left out and counted, rather than followed by a burst.
pub async fn run<M: RawMutex, const N: usize>(hub: &mut Hub<N>, wires: &Wires<M, N>, health: &Health) -> ! {
    let period = Duration::from_micros(hub.period().as_micros());
    let snapshots = wires.snapshot.sender();
    let mut inputs = Inputs { now: micros(Instant::now()), readings: [None; N], battery: None };
    // Where every sample has a tick, its snapshot says it all.
    let between = period > CAPTURE_INTERVAL;
    let mut due = whole_millisecond(Instant::now()) + period;
    loop {
        if let Either::First(()) = select(wires.news.wait(), Timer::at(due)).await {
            // After an alarm of the bus these are those of before, of which nothing follows.
            look(wires, |newest| {
                hub.sample(newest.readings());
                if between {
                    newest.observe(hub.velocities());
                }
            });
            if wires.urgent.lock(|urgent| urgent.replace(false)) {
                obey(hub, wires);
                if let Some(drives) = hub.act(micros(Instant::now()), inputs.battery) {
                    wires.drives.signal(drives);
                }
            }
            if let Some(sensed) = wires.sensed.try_take() {
                hub.sense(&sensed);
            }
            if wires.battery.signaled() {
                inputs.battery = wires.battery.try_take();
                if let Some(drives) = inputs.battery.and_then(|sample| hub.watch_bus(sample)) {
                    wires.drives.signal(drives);
                }
            }
            continue;
        }
        // Capture is due at the same time; its sample goes first.
        yield_now().await;
        wires.news.reset();
        look(wires, |newest| inputs.readings = *newest.readings());
        inputs.now = micros(Instant::now());
        obey(hub, wires);
        if wires.battery.signaled() {
            inputs.battery = wires.battery.try_take();
        }
        let snapshot = hub.step(&inputs);
        wires.drives.signal(snapshot.drives());
        wires.record.lock(|record| {
            if let Ok(mut record) = record.try_borrow_mut()
                && let Some(record) = record.as_mut()
            {
                record.tick(&snapshot);
            }
        });
        snapshots.send(snapshot);
        health.check_in(Task::Control);

        due += period;
        if let Some(late) = Instant::now().checked_duration_since(due) {
            let missed = u32::try_from(late.as_ticks() / period.as_ticks() + 1).unwrap_or(u32::MAX);
            hub.note_missed(missed);
            due += period * missed;
        }
    }
}

/// All commands that wait, in their order.
fn obey<M: RawMutex, const N: usize>(hub: &mut Hub<N>, wires: &Wires<M, N>) {
    while let Ok(command) = wires.commands.try_receive() {
        // Refused if whoever sent it used an index beyond N; there is no motor to do anything to.
        let _ = hub.apply(command);
    }
}

/// At the newest samples.
fn look<M: RawMutex, const N: usize>(wires: &Wires<M, N>, at: impl FnOnce(&mut Newest<N>)) {
    wires.newest.lock(|newest| {
        // Nobody holds it over an await.
        if let Ok(mut newest) = newest.try_borrow_mut() {
            at(&mut newest);
        }
    });
}
