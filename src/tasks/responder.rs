//! The hub's end of the link to a host. Bytes become packets, and packets become commands and replies. Requests from
//! the parent of a chain arrive on the chain line, and are answered on the chain line.
//!
//! Whether or not bytes arrive, the task also runs the keep-alive timer, digital pins and servo outputs, and the status
//! LED: see [`attend`].

use super::{OBSERVERS, Wires, instant, micros, until};
use crate::board::Devices;
use crate::hub::{Command, Snapshot};
use crate::motor::Setpoint;
use crate::protocol::{Colour, Decoder, HOST, Packet, frame};
use crate::responder::{Line, Responder};
use crate::store::StoreResult;
use crate::units::Micros;
use core::cell::Cell;
use core::future::pending;
use embassy_futures::select::{Either, Either3, Either4, select, select3, select4};
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::watch::AnonReceiver;
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::{Read, Write};

/// Longest time between two updates of the status LED, of the pins and of the battery state. The shortest step of an
/// LED pattern lasts twice this time.
pub const REFRESH: Duration = Duration::from_millis(50);

/// Most bytes that one read takes from the receiver.
const CHUNK: usize = 64;

/// Pause after a line error. Without the pause a broken line would keep the processor busy.
const RECOVERY: Duration = Duration::from_millis(1);

/// Answers the requests of hosts until `rx` reads 0 bytes. A serial line never reads 0 bytes.
///
/// A program whose connections end must call [`attend`] between two connections. Otherwise the keep-alive timer stops.
///
/// If the responder [expects stored settings](Responder::expecting_store), the task first waits until the settings are
/// restored, or for 5 s. The task reads no requests during this wait.
///
/// Each reply is written by one `write_all`. The hub does not answer a damaged packet, and a reply that cannot be
/// written is discarded. Hosts then repeat the request. While a reply waits for the line, commands and timers continue.
///
/// The task drops the future of `rx.read` while it waits for bytes. Dropping the future must not lose bytes, so a
/// receiver on a chip needs its own buffer.
///
/// A board without devices for hosts passes `&mut ()` as `devices`. `show` receives the colour of the status LED at
/// each update, also if the colour has not changed.
pub async fn run<M: RawMutex, const N: usize>(
    mut rx: impl Read,
    mut tx: impl Write,
    devices: &mut impl Devices,
    responder: &mut Responder<N>,
    wires: &Wires<M, N>,
    show: impl FnMut(Colour),
) {
    responder.outputs.equipment = devices.equipment();
    let mut service = Service::new(responder, devices, wires, show);
    service.await_store().await;
    // The parent no longer waits for answers to requests that have arrived during the wait.
    wires.chain_received.clear();
    let mut decoder = Decoder::new();
    let mut chunk = [0; CHUNK];
    loop {
        // `attend` is polled first, so that it also runs if bytes wait already.
        let from_chain = wires.chain_received.receive();
        let next =
            select4(service.attend(), rx.read(&mut chunk), until(decoder.deadline()), from_chain).await;
        let mut from_chain = None;
        let length = match next {
            Either4::Second(Ok(0)) => return,
            Either4::Second(Ok(length)) => length,
            Either4::Second(Err(_)) => {
                select(service.attend(), Timer::after(RECOVERY)).await;
                0
            }
            Either4::Third(()) => 0,
            Either4::Fourth(packet) => {
                from_chain = Some(packet);
                0
            }
        };
        let mut input = chunk.get(..length).unwrap_or_default();
        let mut received_at = now();
        loop {
            let packet = match from_chain.take() {
                Some(packet) if packet.destination == HOST => service.responder.pass_to_host(packet),
                Some(packet) => {
                    // The parent sends one request at a time, so the channel has room for the answer.
                    if let Some(reply) = service.answer(&packet, Line::Chain).await {
                        let _ = wires.chain_send.try_send(reply);
                    }
                    None
                }
                None => match decoder.next(&mut input, received_at) {
                    Some(packet) => service.answer(&packet, Line::Host).await,
                    None => break,
                },
            };
            let Some(packet) = packet else { continue };
            let frame = frame::encode(&packet);
            let write = async {
                // A host that gets no reply repeats its request. A flush after a failed write may never end.
                if tx.write_all(&frame).await.is_ok() {
                    let _ = tx.flush().await;
                }
            };
            // `attend` is polled first, so that the commands of a request are sent, and pins are set, before the reply
            // leaves.
            select(service.attend(), write).await;
            // The rest of `input` has waited for the write. The time-out of an unfinished frame must not include this
            // wait.
            received_at = now();
        }
        // A host that sends without pauses must not keep other tasks from running.
        yield_now().await;
    }
}

/// Longest time that the answer to a request waits for a running I2C transfer. Many hosts start a transfer immediately
/// after another one, or poll only once. Most transfers end within this time.
const TRANSFER_WAIT: Duration = Duration::from_millis(5);

/// Longest wait for the stored settings after a reset. An interrupted erasure is repeated first, which takes at most 4
/// s.
const STORE_TIMEOUT: Duration = Duration::from_secs(5);

/// Runs the responder while no bytes arrive. Sends pending commands and requests to the other tasks, and updates
/// keep-alive timer, pins and LED.
///
/// Never returns. The future may be dropped at any time, and no command is lost or sent twice.
pub async fn attend<M: RawMutex, const N: usize>(
    responder: &mut Responder<N>,
    devices: &mut impl Devices,
    wires: &Wires<M, N>,
    show: impl FnMut(Colour),
) -> ! {
    Service::new(responder, devices, wires, show).attend().await
}

/// The responder with its devices, the other tasks and the LED.
struct Service<'a, M: RawMutex, const N: usize, D, S> {
    responder: &'a mut Responder<N>,
    devices: &'a mut D,
    wires: &'a Wires<M, N>,
    /// Receives the colour of the status LED.
    show: S,
    snapshots: AnonReceiver<'a, M, Snapshot<N>, OBSERVERS>,
    /// The newest snapshot. The initial snapshot before the first tick.
    snapshot: Snapshot<N>,
}

impl<'a, M: RawMutex, const N: usize, D: Devices, S: FnMut(Colour)> Service<'a, M, N, D, S> {
    fn new(responder: &'a mut Responder<N>, devices: &'a mut D, wires: &'a Wires<M, N>, show: S) -> Self {
        let snapshots = wires.snapshot.anon_receiver();
        Self { responder, devices, wires, show, snapshots, snapshot: Snapshot::INITIAL }
    }

    /// Waits until the stored settings are restored, or for [`STORE_TIMEOUT`]. A hub without a memory does not wait.
    ///
    /// After the time-out the hub answers hosts. The hub refuses requests that need the memory until the task of the
    /// memory reports.
    async fn await_store(&mut self) {
        let end = Instant::now() + STORE_TIMEOUT;
        while self.responder.awaits_store() && Instant::now() < end {
            (self.show)(self.responder.led(now()));
            let result = select(self.wires.store.done.wait(), Timer::after(REFRESH)).await;
            if let Either::First(StoreResult { found: Some(found), .. }) = result {
                self.responder.restore(found);
            }
        }
    }

    /// Runs the responder, see [`attend`].
    async fn attend(&mut self) -> ! {
        loop {
            let command = self.poll();
            let refresh = Instant::now() + REFRESH;
            let chain = self.responder.chain.as_ref().filter(|_| may_send_on_chain(self.wires));
            let deadlines = [self.responder.deadline(), chain.and_then(|chain| chain.deadline())];
            let due = deadlines.into_iter().flatten().map(instant).fold(refresh, Instant::min);
            let send = async {
                match command {
                    Some(command) => self.wires.send(command).await,
                    None => pending().await,
                }
            };
            match select3(send, self.wires.chain_sent.wait(), Timer::at(due)).await {
                Either3::First(number) => self.responder.sent(number),
                Either3::Second(()) => note_sent_on_chain(self.responder),
                Either3::Third(()) => (),
            }
        }
    }

    /// Does all work of the responder that needs no wait. Returns the next command if the queue of commands is full.
    fn poll(&mut self) -> Option<Command> {
        let Self { responder, wires, .. } = self;
        let now = now();
        if let Some(newer) = self.snapshots.try_changed() {
            self.snapshot = newer;
        }
        responder.tick(now, &self.snapshot);
        attend_chain(now, responder, wires);
        if let Some(StoreResult { found, outcome }) = wires.store.done.try_take() {
            responder.store_done(found, outcome);
        }
        if let Some(request) = responder.store_request(&self.snapshot) {
            wires.store.request.signal(request);
        }
        take_update_result(responder, wires);
        if let Some(request) = responder.update_request() {
            wires.update.request.signal(request);
        }
        for (bus, channel) in responder.i2c.iter_mut().zip(&wires.i2c) {
            if let Some(transfer) = bus.take_request() {
                channel.request.signal(transfer);
            }
        }
        let permitted = responder.permits_button();
        wires.button_permitted.lock(|cell| cell.set(permitted));
        // Motors that the button drives are disabled here, before the first command of a host is sent. The task of the
        // button only polls the permission, so its own command could come after the host's command.
        let is_released = permitted || wires.try_send_by_button(Setpoint::Disabled);
        let mut command = if is_released { responder.pending() } else { None };
        while let Some(next) = command
            && let Ok(number) = wires.try_send(next)
        {
            responder.sent(number);
            command = responder.pending();
        }
        (self.show)(responder.led(now));
        if let Some(servos) = responder.outputs.new_servo_pulses() {
            self.devices.set_servos(&servos);
        }
        self.exchange_pins();
        command
    }

    /// Executes the request of a packet, and returns the reply.
    async fn answer(&mut self, packet: &Packet, from: Line) -> Option<Packet> {
        self.await_transfer(packet).await;
        self.exchange_pins();
        self.update_snapshot();
        let Self { responder, devices, wires, snapshot, .. } = self;
        responder.readings = devices.analog();
        responder.bus = wires.bus.lock(Cell::get);
        take_update_result(responder, wires);
        wires.record.lock(|record| {
            // No task keeps the borrow across an await, so the borrow succeeds.
            let mut record = record.try_borrow_mut().ok();
            let record = record.as_mut().and_then(|record| record.as_mut());
            responder.receive_with(packet, from, now(), snapshot, record)
        })
    }

    /// Takes the results of I2C transfers. If the answer to a packet depends on a transfer that is still running, first
    /// waits for the end of the transfer, or for [`TRANSFER_WAIT`].
    async fn await_transfer(&mut self, packet: &Packet) {
        let wires = self.wires;
        for (bus, channel) in self.responder.i2c.iter_mut().zip(&wires.i2c) {
            if let Some(result) = channel.done.try_take() {
                bus.done(result);
            }
        }
        let Some(bus) = self.responder.awaited_transfer(packet) else { return };
        let Some(channel) = wires.i2c.get(bus) else { return };
        let result = select3(self.attend(), channel.done.wait(), Timer::after(TRANSFER_WAIT)).await;
        if let (Either3::Second(result), Some(bus)) = (result, self.responder.i2c.get_mut(bus)) {
            bus.done(result);
        }
    }

    /// Drives the digital outputs, and reads the levels of all pins.
    fn exchange_pins(&mut self) {
        let outputs = &mut self.responder.outputs;
        outputs.sensed = self.devices.update_digital_pins(outputs.driven, outputs.levels);
    }

    /// Takes the newest snapshot. A motor whose encoder has a newer sample gets position and velocity of the sample.
    fn update_snapshot(&mut self) {
        let snapshot = &mut self.snapshot;
        if let Some(newer) = self.snapshots.try_changed() {
            *snapshot = newer;
        }
        self.wires.newest.lock(|newest| {
            let Ok(newest) = newest.try_borrow() else { return };
            for (motor, report) in snapshot.motors.iter_mut().enumerate() {
                if let Some((position, velocity)) = newest.newer_than(motor, snapshot.at) {
                    report.position = position;
                    report.velocity = velocity.unwrap_or(report.velocity);
                }
            }
        });
    }
}

/// Passes events of the chain line to the responder, and sends the next packet when the line is free.
fn attend_chain<M: RawMutex, const N: usize>(now: Micros, responder: &mut Responder<N>, wires: &Wires<M, N>) {
    if wires.chain_sent.try_take().is_some() {
        note_sent_on_chain(responder);
    }
    let Some(chain) = &mut responder.chain else { return };
    if !may_send_on_chain(wires) {
        return;
    }
    if wires.chain_bytes.try_take().is_some() {
        chain.note_bytes();
    }
    if let Some(packet) = chain.next(now) {
        let _ = wires.chain_send.try_send(packet);
    }
}

/// True if the chain may send its next packet: no answer waits to be processed, and the channel to the line has room.
/// An answer that has arrived must be processed before `Chain::next` checks its time-out. Until then a time-out that
/// has passed must not wake the task, because the task would wake without end.
fn may_send_on_chain<M: RawMutex, const N: usize>(wires: &Wires<M, N>) -> bool {
    wires.chain_received.is_empty() && !wires.chain_send.is_full()
}

fn note_sent_on_chain<const N: usize>(responder: &mut Responder<N>) {
    if let Some(chain) = &mut responder.chain {
        chain.sent(now());
    }
}

/// Passes a result of the update task to the responder. The responder must know the result before it accepts the next
/// chunk.
fn take_update_result<M: RawMutex, const N: usize>(responder: &mut Responder<N>, wires: &Wires<M, N>) {
    if let Some(done) = wires.update.done.try_take() {
        responder.update_done(done);
    }
}

fn now() -> Micros {
    micros(Instant::now())
}
