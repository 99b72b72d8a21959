//! The hub's end of the host's protocol: bytes to packets, packets to commands and replies, digital pins, and the clock for
//! the keep-alive timer and the status LED.

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

/// How often the status LED and the battery are looked after: a step of a pattern lasts at least twice as long, and a
/// battery that breaks down is low for about as long, until it is unknown.
pub const REFRESH: Duration = Duration::from_millis(50);

/// Bytes taken from the line at once.
const CHUNK: usize = 64;

/// The wait after a line error, so that a broken line does not keep the processor busy.
const RECOVERY: Duration = Duration::from_millis(1);

/// Talks to hosts until `rx` ends (reads nothing), which a serial line never does. Where connections
/// come and go, [`attend`] to the responder between them: the keep-alive timer runs on.
///
/// A responder that [expects a store](Responder::expecting_store) hears nothing before that has told what is in it.
///
/// Every reply is one `write_all`. A packet that is cut short or damaged by a line error goes
/// unanswered, as does one whose reply cannot be written; hosts ask again. While a host does not take
/// its reply, time goes on for the motors all the same.
///
/// `rx.read` must lose nothing when it is dropped before it is ready: on a chip, a receiver with a
/// buffer of its own. `pins` is `()` on a board without. `show` is given the colour of the status LED, changed or not.
pub async fn run<M: RawMutex, const N: usize>(
    mut rx: impl Read,
    mut tx: impl Write,
    mut pins: impl DigitalPins,
    responder: &mut Responder<N>,
    wires: &Wires<M, N>,
    mut show: impl FnMut(Colour),
) {
    recall(responder, wires, &mut show).await;
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
        let mut came = now();
        while let Some(packet) = decoder.next(&mut input, came) {
            exchange(responder, &mut pins);
            responder.sense_bus(wires.bus.lock(Cell::get));
            hear_slot(responder, wires);
            let reply = wires.record.lock(|record| {
                // Nobody holds it over an await.
                let mut record = record.try_borrow_mut().ok();
                let record = record.as_mut().and_then(|record| record.as_mut());
                responder.receive_with(&packet, now(), &snapshot(wires), record)
            });
            let Some(reply) = reply else { continue };
            settle(responder, &mut pins, wires, &mut show);
            let frame = frame::encode(&reply);
            let write = async {
                // Without a reply the host asks again. What was not taken whole may never be flushed.
                if tx.write_all(&frame).await.is_ok() {
                    let _ = tx.flush().await;
                }
            };
            select(write, attend(responder, &mut pins, wires, &mut show)).await;
            // What is left had to wait for that, and whatever belongs to it still does.
            came = now();
        }
        settle(responder, &mut pins, wires, &mut show);
        // A host that never pauses must not keep other tasks from running.
        yield_now().await;
    }
}

/// A memory that has not told so long after a reset what is in it never will: an erasure that power had cut, and that is
/// done again, takes 4 s at the most.
const RECALL: Duration = Duration::from_secs(5);

/// Waits for what is stored, if there is a memory for it.
async fn recall<M: RawMutex, const N: usize>(
    responder: &mut Responder<N>,
    wires: &Wires<M, N>,
    mut show: impl FnMut(Colour),
) {
    let end = Instant::now() + RECALL;
    while responder.awaits_store() && Instant::now() < end {
        show(responder.led(now()));
        let told = select(wires.store.done.wait(), Timer::after(REFRESH)).await;
        if let Either::First(Done { found: Some(found), .. }) = told {
            responder.restore(found);
        }
    }
}

/// All that does not depend on bytes: motors are told what they have not been told yet, the keep-alive
/// timer runs, and the LED shows it. Runs for ever; dropping it loses nothing.
pub async fn attend<M: RawMutex, const N: usize>(
    responder: &mut Responder<N>,
    mut pins: impl DigitalPins,
    wires: &Wires<M, N>,
    mut show: impl FnMut(Colour),
) -> ! {
    loop {
        settle(responder, &mut pins, wires, &mut show);
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

/// What can be done without waiting.
fn settle<M: RawMutex, const N: usize>(
    responder: &mut Responder<N>,
    pins: &mut impl DigitalPins,
    wires: &Wires<M, N>,
    mut show: impl FnMut(Colour),
) {
    let (now, snapshot) = (now(), snapshot(wires));
    responder.tick(now, &snapshot);
    if let Some(Done { found, outcome }) = wires.store.done.try_take() {
        responder.carried_out(found, outcome);
    }
    if let Some(order) = responder.store_request(&snapshot) {
        wires.store.request.signal(order);
    }
    hear_slot(responder, wires);
    if let Some(order) = responder.update_request() {
        wires.update.request.signal(order);
    }
    wires.host_spoke.lock(|spoke| spoke.set(responder.host_spoke()));
    while let Some(command) = responder.pending() {
        let Ok(number) = wires.try_send(command) else { break };
        responder.sent(number);
    }
    exchange(responder, pins);
    show(responder.led(now));
}

/// What became of a chunk, before the next one is looked at.
fn hear_slot<M: RawMutex, const N: usize>(responder: &mut Responder<N>, wires: &Wires<M, N>) {
    if let Some(done) = wires.update.done.try_take() {
        responder.update_done(done);
    }
}

/// Digital pins are told what to do, and tell how they are.
fn exchange<const N: usize>(responder: &mut Responder<N>, pins: &mut impl DigitalPins) {
    let DigitalLines { driven, levels } = responder.digital_lines();
    responder.sense_pins(pins.exchange(driven, levels));
}

/// The latest, or none yet; where the motors are, and how fast, is newer than the last tick.
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

/// The first tick of the time driver that is not before `at`.
fn instant(at: Micros) -> Instant {
    let ticks = u128::from(at.get()) * u128::from(TICK_HZ);
    Instant::from_ticks(u64::try_from(ticks.div_ceil(1_000_000)).unwrap_or(u64::MAX))
}
