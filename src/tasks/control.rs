//! Runs the hub: a tick each control period, and faster reactions between two ticks.
//!
//! * Between two ticks the task wakes at each encoder sample, and at the first plausible sample of the bus after an
//!   alarm. The task then updates the estimates of the hub, and passes the feedback of the bridges to the hub. If a
//!   direct command waits, the task applies all waiting commands, and executes the direct commands immediately. A new
//!   state of the bus may change the bridge commands too.
//! * At each tick the task applies the commands that still wait, and steps the hub. Then the task publishes the bridge
//!   commands and the snapshot.

use super::capture::CAPTURE_INTERVAL;
use super::{Health, Task, Wires, micros, whole_millisecond};
use crate::hub::Hub;
use core::cell::Cell;
use core::future::{Future, poll_fn};
use core::pin::{Pin, pin};
use core::task::Poll;
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};

/// Runs the task. Never returns. The hub is borrowed, because an async function would hold an owned hub twice in its
/// memory.
///
/// The first tick is due one control period after the first whole millisecond, and the next ticks each one period
/// later. If a tick ends after the next tick was due, the due ticks are skipped and counted as missed.
pub async fn run<M: RawMutex, const N: usize>(hub: &mut Hub<N>, wires: &Wires<M, N>, health: &Health) -> ! {
    let period = Duration::from_micros(hub.period().as_micros());
    let snapshots = wires.snapshot.sender();
    let (mut readings, mut battery) = ([None; N], None);
    // True if the estimated speeds must be published between ticks. At a control period of 1 ms each sample comes with
    // a tick, and the snapshot has the newest speeds.
    let samples_between_ticks = period > CAPTURE_INTERVAL;
    let mut due = whole_millisecond(Instant::now()) + period;
    let mut timer_is_registered = false;
    loop {
        if woken_before(due, &mut timer_is_registered, wires).await {
            // After an alarm of the bus the readings are unchanged. Processing unchanged readings does not change the
            // estimates.
            wires.update_newest(|newest| {
                hub.sample(&newest.readings);
                if samples_between_ticks {
                    newest.set_velocities(hub.velocities());
                }
            });
            if wires.urgent.lock(|urgent| urgent.replace(false)) {
                apply_commands(hub, wires);
                if let Some(drives) = hub.execute_direct(micros(Instant::now()), battery) {
                    wires.drives.signal(drives);
                }
            }
            if let Some(sensed) = wires.sensed.try_take() {
                hub.set_bridge_feedback(&sensed);
            }
            if wires.battery.signaled() {
                battery = wires.battery.try_take();
                if let Some(drives) = battery.and_then(|sample| hub.apply_limits(sample)) {
                    wires.drives.signal(drives);
                }
            }
            continue;
        }
        // The capture task is due at the same time, and must take its sample before the tick.
        yield_now().await;
        wires.control_wake.reset();
        wires.update_newest(|newest| readings = newest.readings);
        let now = micros(Instant::now());
        apply_commands(hub, wires);
        if wires.battery.signaled() {
            battery = wires.battery.try_take();
        }
        wires.gyro_wanted.lock(|wanted| wanted.set(hub.uses_gyro()));
        hub.set_gyro_reading(wires.gyro.lock(Cell::get));
        let snapshot = hub.step(now, &readings, battery);
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
            hub.add_missed_ticks(missed);
            due += period * missed;
        }
        timer_is_registered = false;
    }
}

/// Waits for the signal `control_wake` or for the time `due` of the next tick. Returns true if the signal came first.
/// Capture signals `control_wake` at each encoder sample, and supply at the first plausible sample of the bus after an
/// alarm.
///
/// The function does what `select(wires.control_wake.wait(), Timer::at(due))` does, but asks the time driver only when
/// a wait begins for a tick, and when the tick is due. The time driver keeps one wake-up time for each task in a queue.
/// Each poll of a timer searches the whole queue. A plain `select` would poll the timer at each signal, which comes
/// every millisecond. With a plain `select` the hub needs 2.09 % of an F429 for unknown motors and 2.15 % for PID at 50
/// ms, and so exceeds its limit of 2 % (`the_whole_hub_needs_little_of_the_core`).
///
/// * `timer_is_registered` is true once the queue has the time `due`. The queue keeps this time when the timer is
///   dropped.
/// * While `timer_is_registered` is true, the function only compares the clock with `due`.
/// * A board may poll other futures in the same task. Their timers may replace the wake-up time in the queue. One of
///   these futures must then wake the task every millisecond, as [`super::capture::run`] does. The function then sees
///   the time `due` at most a millisecond late.
async fn woken_before<M: RawMutex, const N: usize>(
    due: Instant,
    timer_is_registered: &mut bool,
    wires: &Wires<M, N>,
) -> bool {
    let (mut control_wake, mut timer) = (pin!(wires.control_wake.wait()), Timer::at(due));
    poll_fn(|context| {
        if control_wake.as_mut().poll(context).is_ready() {
            return Poll::Ready(true);
        }
        if *timer_is_registered && Instant::now() < due {
            return Poll::Pending;
        }
        *timer_is_registered = true;
        Pin::new(&mut timer).poll(context).map(|()| false)
    })
    .await
}

/// Applies all waiting commands in their order.
fn apply_commands<M: RawMutex, const N: usize>(hub: &mut Hub<N>, wires: &Wires<M, N>) {
    while let Some(command) = wires.next_command() {
        // The hub also counts a refused command, so the error needs no other reaction.
        let _ = hub.apply(command);
    }
}
