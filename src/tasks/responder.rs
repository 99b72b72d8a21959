//! The hub's end of the link to a host. Bytes become packets, and packets become commands and replies.
//!
//! Whether or not bytes arrive, the task also runs the keep-alive timer, the digital pins, and the status LED.

use super::store::Done;
use super::{Wires, micros};
use crate::board::DigitalPins;
use crate::hub::Snapshot;
use crate::protocol::{Colour, Decoder, frame};
use crate::responder::Responder;
use crate::responder::outputs::DigitalLines;
use crate::units::Micros;
use core::cell::Cell;
use core::future::pending;
use embassy_futures::select::{Either, Either3, select, select3};
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, TICK_HZ, Timer};
use embedded_io_async::{Read, Write};

/// Longest time between two updates of the status LED, of the pins and of the battery state. The shortest step of an LED
/// pattern lasts twice this time.
pub const REFRESH: Duration = Duration::from_millis(50);

/// Most bytes that one read takes from the receiver.
const CHUNK: usize = 64;

/// Pause after a line error. Without the pause a broken line would keep the processor busy.
const RECOVERY: Duration = Duration::from_millis(1);

/// Answers the requests of hosts until `rx` reads 0 bytes. A serial line never reads 0 bytes.
///
/// A program whose connections end must call [`attend`] between two connections. Otherwise the keep-alive timer stops.
///
/// If the responder [expects stored settings](Responder::expecting_store), the task first waits until the settings are restored,
/// or for 5 s. It reads no requests during this wait.
///
/// Each reply is written by one `write_all`. The hub does not answer a damaged packet, and a reply that cannot be written
/// is discarded. Hosts then repeat the request. While a reply waits for the line, commands and timers continue.
///
/// The task drops the future of `rx.read` while it waits for bytes. Dropping the future must not lose bytes, so a receiver on a
/// chip needs its own buffer.
///
/// A board without digital pins passes `()` as `pins`. `show` receives the colour of the status LED at each update, also if the
/// colour has not changed.
pub async fn run<M: RawMutex, const N: usize>(
    mut rx: impl Read,
    mut tx: impl Write,
    mut pins: impl DigitalPins,
    responder: &mut Responder<N>,
    wires: &Wires<M, N>,
    mut show: impl FnMut(Colour),
) {
    await_store(responder, wires, &mut show).await;
    let mut decoder = Decoder::new();
    let mut chunk = [0; CHUNK];
    loop {
        let work = attend(responder, &mut pins, wires, &mut show);
        let length = match select3(rx.read(&mut chunk), until(decoder.deadline()), work).await {
            Either3::First(Ok(0)) => return,
            Either3::First(Ok(length)) => length,
            Either3::First(Err(_)) => {
                select(Timer::after(RECOVERY), attend(responder, &mut pins, wires, &mut show)).await;
                0
            }
            Either3::Second(()) => 0,
        };
        let mut input = chunk.get(..length).unwrap_or_default();
        let mut received_at = now();
        while let Some(packet) = decoder.next(&mut input, received_at) {
            exchange_pins(responder, &mut pins);
            responder.sense_bus(wires.bus.lock(Cell::get));
            take_update_result(responder, wires);
            let reply = wires.record.lock(|record| {
                // No task keeps the borrow across an await, so the borrow succeeds.
                let mut record = record.try_borrow_mut().ok();
                let record = record.as_mut().and_then(|record| record.as_mut());
                responder.receive_with(&packet, now(), &snapshot(wires), record)
            });
            let Some(reply) = reply else { continue };
            poll(responder, &mut pins, wires, &mut show);
            let frame = frame::encode(&reply);
            let write = async {
                // A host that gets no reply repeats its request. A flush after a failed write may never end.
                if tx.write_all(&frame).await.is_ok() {
                    let _ = tx.flush().await;
                }
            };
            select(write, attend(responder, &mut pins, wires, &mut show)).await;
            // The rest of `input` has waited for the write. The time-out of an unfinished frame must not include this wait.
            received_at = now();
        }
        poll(responder, &mut pins, wires, &mut show);
        // A host that sends without pauses must not keep other tasks from running.
        yield_now().await;
    }
}

/// Longest wait for the stored settings after a reset. An interrupted erasure is repeated first, which takes at most 4 s.
const STORE_TIMEOUT: Duration = Duration::from_secs(5);

/// Waits until the stored settings are restored, or for [`STORE_TIMEOUT`]. A hub without a memory does not wait.
///
/// The hub then answers hosts, and refuses requests that need the memory, until the task of the memory reports.
async fn await_store<M: RawMutex, const N: usize>(
    responder: &mut Responder<N>,
    wires: &Wires<M, N>,
    mut show: impl FnMut(Colour),
) {
    let end = Instant::now() + STORE_TIMEOUT;
    while responder.awaits_store() && Instant::now() < end {
        show(responder.led(now()));
        let result = select(wires.store.done.wait(), Timer::after(REFRESH)).await;
        if let Either::First(Done { found: Some(found), .. }) = result {
            responder.restore(found);
        }
    }
}

/// Runs the responder while no bytes arrive. Sends pending commands and requests to the other tasks, and updates keep-alive
/// timer, pins and LED.
///
/// Never returns. The future may be dropped at any time, and no command is lost or sent twice.
pub async fn attend<M: RawMutex, const N: usize>(
    responder: &mut Responder<N>,
    mut pins: impl DigitalPins,
    wires: &Wires<M, N>,
    mut show: impl FnMut(Colour),
) -> ! {
    loop {
        poll(responder, &mut pins, wires, &mut show);
        let refresh = Instant::now() + REFRESH;
        let due = responder.deadline().map_or(refresh, |deadline| instant(deadline).min(refresh));
        match responder.pending() {
            Some(command) => {
                if let Either::First(number) = select(wires.send(command), Timer::at(due)).await {
                    responder.sent(number);
                }
            }
            None => Timer::at(due).await,
        }
    }
}

/// Does all work of the responder that needs no wait.
fn poll<M: RawMutex, const N: usize>(
    responder: &mut Responder<N>,
    pins: &mut impl DigitalPins,
    wires: &Wires<M, N>,
    mut show: impl FnMut(Colour),
) {
    let (now, snapshot) = (now(), snapshot(wires));
    responder.tick(now, &snapshot);
    if let Some(Done { found, outcome }) = wires.store.done.try_take() {
        responder.store_done(found, outcome);
    }
    if let Some(request) = responder.store_request(&snapshot) {
        wires.store.request.signal(request);
    }
    take_update_result(responder, wires);
    if let Some(request) = responder.update_request() {
        wires.update.request.signal(request);
    }
    wires.button_permitted.lock(|permitted| permitted.set(responder.permits_button()));
    while let Some(command) = responder.pending() {
        let Ok(number) = wires.try_send(command) else { break };
        responder.sent(number);
    }
    exchange_pins(responder, pins);
    show(responder.led(now));
}

/// Passes a result of the update task to the responder. The responder must know the result before it accepts the next chunk.
fn take_update_result<M: RawMutex, const N: usize>(responder: &mut Responder<N>, wires: &Wires<M, N>) {
    if let Some(done) = wires.update.done.try_take() {
        responder.update_done(done);
    }
}

/// Drives the digital outputs, and reads the levels of all pins.
fn exchange_pins<const N: usize>(responder: &mut Responder<N>, pins: &mut impl DigitalPins) {
    let DigitalLines { driven, levels } = responder.digital_lines();
    responder.sense_pins(pins.exchange(driven, levels));
}

/// Returns the newest snapshot, or the initial snapshot before the first tick. If a motor has an encoder sample that is newer than
/// the snapshot, the snapshot gets position and velocity of the sample.
fn snapshot<M: RawMutex, const N: usize>(wires: &Wires<M, N>) -> Snapshot<N> {
    let mut snapshot = wires.snapshot.try_get().unwrap_or(Snapshot::INITIAL);
    wires.newest.lock(|newest| {
        let Ok(newest) = newest.try_borrow() else { return };
        for (motor, report) in snapshot.motors.iter_mut().enumerate() {
            if let Some((position, velocity)) = newest.look(motor, snapshot.at) {
                report.position = position;
                report.velocity = velocity.unwrap_or(report.velocity);
            }
        }
    });
    snapshot
}

fn now() -> Micros {
    micros(Instant::now())
}

async fn until(deadline: Option<Micros>) {
    match deadline {
        Some(deadline) => Timer::at(instant(deadline)).await,
        None => pending().await,
    }
}

/// Converts a time of the core to the first tick of the time driver that is not before `at`.
fn instant(at: Micros) -> Instant {
    let ticks = u128::from(at.get()) * u128::from(TICK_HZ);
    Instant::from_ticks(u64::try_from(ticks.div_ceil(1_000_000)).unwrap_or(u64::MAX))
}
