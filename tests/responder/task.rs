//! The responder task between in-memory pipes, under virtual time.

use crate::host::{HUB, N, decode, frame_to, responder_with, settings};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_time::Timer;
use embassy_time::{Duration, Instant, MockDriver};
use embedded_hal_async::i2c::{self, I2c, NoAcknowledgeSource, Operation};
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use motor_hub::board::{AnalogReading, AnalogReadings, Devices, Equipment, I2cBus, SERVOS, ServoPulse};
use motor_hub::extension::state::StoreReport;
use motor_hub::hub::{Command, Snapshot};
use motor_hub::motor::Setpoint;
use motor_hub::protocol::payload::{Field, Fields};
use motor_hub::protocol::{Colour, Nack};
use motor_hub::responder::Responder;
use motor_hub::store::{Found, Outcome, SettingsRecord, StoreResult, Stored};
use motor_hub::supply::DrawStage;
use motor_hub::tasks::{self, COMMANDS, Wires};
use motor_hub::units::{CountsPerSecond, Millivolts};
use std::cell::{Cell, RefCell};
use std::future::{Future, poll_fn};
use std::pin::{Pin, pin};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};

/// All tests of the process share the clock of the mock driver, so they run one after another.
static CLOCK: Mutex<()> = Mutex::new(());

/// The line from the hub to the host.
#[derive(Default)]
struct Line {
    /// Each write.
    writes: RefCell<Vec<Vec<u8>>>,
    /// True if the host accepts no bytes.
    jammed: Cell<bool>,
    /// Largest number of bytes of one write; `None` for no limit.
    piece: Cell<Option<usize>>,
    /// True if the line refuses a write that is longer than `piece`. A flush after a refused write never ends.
    refuses: Cell<bool>,
    stuck: Cell<bool>,
}

impl ErrorType for &Line {
    type Error = ErrorKind;
}

impl Write for &Line {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        // The test polls the task again and again, so no waker is needed.
        poll_fn(|_| if self.jammed.get() { Poll::Pending } else { Poll::Ready(()) }).await;
        let taken = bytes.len().min(self.piece.get().unwrap_or(usize::MAX));
        let refused = self.refuses.get() && taken < bytes.len();
        self.stuck.set(refused);
        if refused {
            return Err(ErrorKind::Other);
        }
        self.writes.borrow_mut().push(bytes[..taken].to_vec());
        Ok(taken)
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        poll_fn(|_| if self.stuck.get() { Poll::Pending } else { Poll::Ready(Ok(())) }).await
    }
}

/// Pins 0 and 1 with a wire between them, servos, and an analog input.
#[derive(Default)]
struct Pins(Cell<(u8, u8)>, RefCell<Vec<[Option<ServoPulse>; SERVOS]>>);

impl Devices for &Pins {
    fn equipment(&self) -> Equipment {
        Equipment { digital: u8::MAX, servos: 6, analog: 1, i2c: 2, ..Equipment::default() }
    }

    fn set_servos(&mut self, servos: &[Option<ServoPulse>; SERVOS]) {
        self.1.borrow_mut().push(*servos);
    }

    fn analog(&mut self) -> AnalogReadings {
        let voltage = Millivolts::new(Instant::now().as_millis() as u16);
        let reading = AnalogReading { voltage, counts: 0 };
        AnalogReadings { inputs: [Some(reading), None, None, None], ..AnalogReadings::default() }
    }

    fn update_digital_pins(&mut self, driven: u8, levels: u8) -> u8 {
        self.0.set((driven, levels));
        if driven & 1 != 0 && levels & 1 == 0 { !3 } else { u8::MAX }
    }
}

/// A line that first gives errors, then the bytes of the pipe, and then the end of the line.
struct Rough<'a> {
    errors: u32,
    pipe: &'a Pipe<NoopRawMutex, 1024>,
}

impl ErrorType for Rough<'_> {
    type Error = ErrorKind;
}

impl Read for Rough<'_> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
        if self.errors > 0 {
            self.errors -= 1;
            return Err(ErrorKind::Other);
        }
        Ok(self.pipe.try_read(bytes).unwrap_or(0))
    }
}

fn responder() -> Responder<N> {
    responder_with(settings())
}

struct World {
    to_hub: Pipe<NoopRawMutex, 1024>,
    line: Line,
    wires: Wires<NoopRawMutex, N>,
    shown: Cell<Colour>,
    times_shown: Cell<u32>,
    pins: Pins,
    responder: Cell<Option<Responder<N>>>,
    _clock: MutexGuard<'static, ()>,
}

impl World {
    fn new() -> Self {
        Self::with(responder())
    }

    fn with(responder: Responder<N>) -> Self {
        let clock = CLOCK.lock().unwrap_or_else(PoisonError::into_inner);
        MockDriver::get().reset();
        let wires = Wires::new();
        let battery = Some(Millivolts::new(12_000));
        let snapshot = Snapshot { battery, draw_stage: DrawStage::Full, ..Snapshot::INITIAL };
        wires.snapshot.sender().send(snapshot);
        Self {
            to_hub: Pipe::new(),
            line: Line::default(),
            wires,
            shown: Cell::default(),
            times_shown: Cell::default(),
            pins: Pins::default(),
            responder: Cell::new(Some(responder)),
            _clock: clock,
        }
    }

    async fn task(&self) {
        let mut responder = self.responder.take().expect("one task");
        let show = |colour| {
            self.shown.set(colour);
            self.times_shown.set(self.times_shown.get() + 1);
        };
        tasks::responder::run(&self.to_hub, &self.line, &mut &self.pins, &mut responder, &self.wires, show)
            .await;
    }

    fn send(&self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            // A pipe takes what fits before its wrap.
            let length = self.to_hub.try_write(bytes).expect("room");
            bytes = &bytes[length..];
        }
    }

    fn call(&self, function: u16, payload: &[u8]) {
        self.send(&frame_to(HUB, 1, 0x1000 + function, payload));
    }

    fn drive_motor_0(&self) {
        self.call(15, &[0, 0, 64]);
        self.call(10, &[0, 1]);
    }

    /// Types and first bytes of the replies since the last time.
    fn replies(&self) -> Vec<(u16, u8)> {
        let packets = self.line.writes.take().into_iter().map(|write| decode(&write));
        packets.map(|packet| (packet.id, packet.payload[0])).collect()
    }

    fn new_commands(&self) -> Vec<Command> {
        std::iter::from_fn(|| self.wires.next_command()).collect()
    }
}

/// Polls the task several times, so that everything happens that is due now or becomes due by a poll.
fn poll(task: &mut Pin<&mut impl Future<Output = ()>>) -> bool {
    let mut context = Context::from_waker(Waker::noop());
    (0..50).any(|_| task.as_mut().poll(&mut context).is_ready())
}

fn run_ms(task: &mut Pin<&mut impl Future<Output = ()>>, ms: u64) {
    assert!(!poll(task));
    for _ in 0..ms {
        MockDriver::get().advance(Duration::from_millis(1));
        assert!(!poll(task));
    }
}

fn disabled(motor: usize) -> Command {
    Command::Set { motor, setpoint: Setpoint::Disabled }
}

#[test]
fn each_reply_is_one_write_however_the_requests_come() {
    let world = World::new();
    let mut task = pin!(world.task());
    run_ms(&mut task, 1);
    let many: Vec<u8> = (1..=9).flat_map(|number| frame_to(HUB, number, 0x7F04, &[])).collect();
    world.send(&many);
    run_ms(&mut task, 1);
    let writes = world.line.writes.take();
    assert_eq!(
        writes.iter().map(|write| decode(write).reference).collect::<Vec<_>>(),
        (1..=9).collect::<Vec<_>>()
    );
    for byte in many {
        world.send(&[byte]);
        run_ms(&mut task, 1);
    }
    assert_eq!(world.replies(), [(0x7F01, 1); 9]);
}

#[test]
fn the_button_is_permitted_until_the_first_packet_to_this_hub() {
    let world = World::new();
    let mut task = pin!(world.task());
    run_ms(&mut task, 5);
    let permitted = || world.wires.button_permitted.lock(Cell::get);
    world.send(b"noise");
    world.send(&frame_to(HUB + 1, 1, 0x7F04, &[]));
    run_ms(&mut task, 1000);
    assert!(permitted());
    world.send(&frame_to(HUB, 1, 0x7F04, &[]));
    run_ms(&mut task, 1);
    assert!(!permitted());
    // The button also stays forbidden after the host has been silent for 3 s.
    run_ms(&mut task, 3000);
    assert!(!permitted());
}

#[test]
fn motors_that_the_button_drives_are_disabled_before_the_first_command_of_a_host_is_sent() {
    let world = World::new();
    let mut task = pin!(world.task());
    run_ms(&mut task, 5);
    let turn = Setpoint::Velocity(CountsPerSecond::new(1000));
    assert!(world.wires.try_send_by_button(turn));
    assert_eq!(world.new_commands().len(), N);
    world.drive_motor_0();
    run_ms(&mut task, 1);
    let commands = world.new_commands();
    assert_eq!(commands[..N], [0, 1, 2, 3].map(disabled));
    assert!(matches!(commands[N..], [Command::Set { motor: 0, .. }]), "{commands:?}");
    // The task of the button sees later that it must not drive motors.
    assert!(world.wires.try_send_by_button(Setpoint::Disabled));
    assert_eq!(world.new_commands(), []);
}

#[test]
fn a_host_s_command_waits_until_the_queue_has_room_to_disable_the_motors_of_the_button() {
    let world = World::new();
    let mut task = pin!(world.task());
    run_ms(&mut task, 5);
    let turn = Setpoint::Velocity(CountsPerSecond::new(1000));
    assert!(world.wires.try_send_by_button(turn));
    while world.wires.try_send(disabled(0)).is_ok() {}
    assert!(!world.wires.try_send_by_button(Setpoint::Velocity(CountsPerSecond::ZERO)));
    world.drive_motor_0();
    run_ms(&mut task, 1);
    assert_eq!(world.new_commands().len(), COMMANDS);
    run_ms(&mut task, 100);
    let commands = world.new_commands();
    assert_eq!(commands[..N], [0, 1, 2, 3].map(disabled));
    assert_eq!(commands.len(), N + 1);
}

#[test]
fn motors_are_released_2500_ms_after_the_last_packet_to_the_millisecond_also_if_noise_follows() {
    for noise in [&[][..], &[0x44, 0x4B, 0xF0, 0, 3, 0x44]] {
        let world = World::new();
        let mut task = pin!(world.task());
        run_ms(&mut task, 5);
        world.drive_motor_0();
        run_ms(&mut task, 0);
        assert_eq!(world.new_commands().len(), 1);
        for _ in 0..2500 {
            assert!(world.new_commands().is_empty());
            world.send(noise);
            run_ms(&mut task, 1);
        }
        assert_eq!(world.new_commands(), [0, 1, 2, 3].map(disabled));
        assert_eq!(Instant::now().as_millis(), 2505);
    }
}

#[test]
fn a_host_that_takes_no_replies_loses_its_motors_too() {
    let world = World::new();
    let mut task = pin!(world.task());
    world.drive_motor_0();
    run_ms(&mut task, 0);
    world.new_commands();
    world.line.jammed.set(true);
    world.call(22, &[0]);
    run_ms(&mut task, 2500);
    assert_eq!(world.new_commands(), [0, 1, 2, 3].map(disabled));
    assert_eq!(world.shown.get(), Colour::BLUE);
}

#[test]
fn a_reply_that_is_longer_than_the_lines_buffer_goes_out_in_pieces() {
    let world = World::new();
    let mut task = pin!(world.task());
    world.line.piece.set(Some(16));
    world.call(0, &[]);
    run_ms(&mut task, 0);
    let pieces = world.line.writes.take();
    // 46 bytes: a bulk read's 35 and the frame's 11.
    assert_eq!(pieces.iter().map(Vec::len).collect::<Vec<_>>(), [16, 16, 14]);
    world.line.writes.borrow_mut().push(pieces.concat());
    assert_eq!(world.replies().len(), 1);
}

#[test]
fn a_line_that_refuses_a_reply_does_not_block_the_hub() {
    let world = World::new();
    let mut task = pin!(world.task());
    world.line.piece.set(Some(16));
    world.line.refuses.set(true);
    // The host sends a bulk read, whose answer is long, and a request that is answered by a short ACK.
    world.call(0, &[]);
    world.call(10, &[0, 0]);
    run_ms(&mut task, 0);
    assert_eq!(world.replies().len(), 1);
}

#[test]
fn a_request_that_comes_while_a_reply_waits_is_not_late() {
    let world = World::new();
    let mut task = pin!(world.task());
    world.line.jammed.set(true);
    let request = frame_to(HUB, 7, 0x7F04, &[]);
    let (begin, end) = request.split_at(4);
    world.send(&[&request, begin].concat());
    run_ms(&mut task, 1000);
    world.line.jammed.set(false);
    run_ms(&mut task, 40);
    world.send(end);
    run_ms(&mut task, 1);
    assert_eq!(world.replies().len(), 2);
    // A request of which a part is missing for more than 50 ms is late.
    world.send(begin);
    run_ms(&mut task, 51);
    world.send(end);
    run_ms(&mut task, 1);
    assert_eq!(world.replies().len(), 0);
}

#[test]
fn commands_wait_for_room_and_are_answered_immediately() {
    let world = World::new();
    let mut task = pin!(world.task());
    while world.wires.try_send(disabled(0)).is_ok() {}
    for power in 0..30 {
        world.call(15, &[1, power, 0]);
        world.call(10, &[1, 1]);
        run_ms(&mut task, 1);
    }
    assert_eq!(world.replies().len(), 60);
    assert_eq!(world.new_commands().len(), COMMANDS);
    run_ms(&mut task, 0);
    let commands = world.new_commands();
    assert!(
        matches!(
            commands[..],
            [Command::Set { motor: 1, setpoint: Setpoint::ConstantPower(power) }] if power.get() == 29
        ),
        "{commands:?}"
    );
}

#[test]
fn a_packet_behind_an_unfinished_frame_is_answered_after_the_time_out() {
    let world = World::new();
    let mut task = pin!(world.task());
    run_ms(&mut task, 1);
    world.send(&[0x44, 0x4B, 0xFF, 0x00]);
    world.send(&frame_to(HUB, 1, 0x7F04, &[]));
    run_ms(&mut task, 49);
    assert!(world.replies().is_empty());
    run_ms(&mut task, 1);
    assert_eq!(world.replies(), [(0x7F01, 1)]);
}

#[test]
fn the_led_follows() {
    let world = World::new();
    let mut task = pin!(world.task());
    run_ms(&mut task, 1);
    assert_eq!(world.shown.get(), Colour::BLUE);
    world.send(&frame_to(HUB, 1, 0x7F04, &[]));
    run_ms(&mut task, 1);
    assert_eq!(world.shown.get(), Colour::GREEN);
    run_ms(&mut task, 2500);
    let seen: Vec<_> = (0..4)
        .map(|_| {
            run_ms(&mut task, 500);
            world.shown.get()
        })
        .collect();
    assert_eq!(seen.iter().filter(|colour| **colour == Colour::BLUE).count(), 2, "{seen:?}");
}

#[test]
fn digital_pins_are_set_before_the_acknowledgement_and_read_at_the_request() {
    let world = World::new();
    let mut task = pin!(world.task());
    // First pin 0 becomes a low output, then it becomes high. Pin 1 is read immediately after each request.
    for (level, function) in [(0, 3), (1, 1)] {
        world.call(function, &[0, 1]);
        world.call(5, &[1]);
        run_ms(&mut task, 1);
        assert_eq!(world.pins.0.get(), (1, level));
        assert_eq!(world.replies(), [(0x7F01, 1), (0x9005, level)]);
    }
    // After the host has fallen silent, no pin is an output.
    run_ms(&mut task, 2_600);
    assert_eq!(world.pins.0.get().0, 0);
}

#[test]
fn servos_are_set_before_the_acknowledgement_and_only_when_they_change() {
    let world = World::new();
    let mut task = pin!(world.task());
    run_ms(&mut task, 100);
    world.call(33, &[2, 0xDC, 5]);
    world.call(35, &[2, 1]);
    run_ms(&mut task, 200);
    let pulses = |width_us| [None, None, Some(ServoPulse { period_us: 20_000, width_us }), None, None, None];
    assert_eq!(world.pins.1.take(), [pulses(1_500)]);
    world.call(33, &[2, 0xDD, 5]);
    // The host then falls silent.
    run_ms(&mut task, 2_600);
    assert_eq!(world.pins.1.take(), [pulses(1_501), [None; SERVOS]]);
}

#[test]
fn analog_inputs_are_read_at_the_request() {
    let world = World::new();
    let mut task = pin!(world.task());
    for ms in [3, 8] {
        run_ms(&mut task, 5);
        world.call(7, &[0, 0]);
        run_ms(&mut task, 1);
        let writes = world.line.writes.take();
        let low = decode(&writes[0]).payload[0];
        assert!(low.abs_diff(ms + 2) <= 3, "{low} {ms}");
    }
}

/// A bus with devices at these addresses. 0x28: transfers take 1 ms. 0x29: transfers take 20 ms. 0x2A: the device
/// refuses data. 0x2B: the device holds the clock. 0x2C: the hub loses the arbitration. 0x2D: each transfer is a bus
/// error.
struct Bus<'a> {
    freed: &'a Cell<u32>,
    fast: &'a Cell<bool>,
}

impl i2c::ErrorType for Bus<'_> {
    type Error = i2c::ErrorKind;
}

impl I2c for Bus<'_> {
    async fn transaction(
        &mut self,
        address: u8,
        operations: &mut [Operation<'_>],
    ) -> Result<(), i2c::ErrorKind> {
        let ms = match address {
            0x28 => 1,
            0x29 => 20,
            0x2A => return Err(i2c::ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data)),
            0x2B => u64::MAX / 10_000,
            0x2C => return Err(i2c::ErrorKind::ArbitrationLoss),
            0x2D => return Err(i2c::ErrorKind::Bus),
            _ => return Err(i2c::ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address)),
        };
        Timer::after(Duration::from_millis(ms)).await;
        for operation in operations {
            if let Operation::Read(bytes) = operation {
                bytes.iter_mut().zip(1..).for_each(|(byte, number)| *byte = number);
            }
        }
        Ok(())
    }
}

impl I2cBus for Bus<'_> {
    fn set_speed(&mut self, fast: bool) {
        self.fast.set(fast);
    }

    async fn recover(&mut self) {
        self.freed.set(self.freed.get() + 1);
    }
}

#[test]
fn i2c_transfers_run_beside_the_link_and_always_end() {
    let world = World::new();
    let (freed, fast) = (Cell::new(0), Cell::new(false));
    let bus = Bus { freed: &freed, fast: &fast };
    let mut task = pin!(async {
        embassy_futures::join::join(world.task(), async {
            tasks::i2c::run(bus, 1, &world.wires).await;
        })
        .await;
    });
    run_ms(&mut task, 1);
    assert_eq!(freed.get(), 1, "a reset may have left the bus in a transfer");

    // A poll waits for a short transfer.
    world.call(43, &[1, 1]);
    world.call(52, &[1, 0x28, 2, 0]);
    world.call(41, &[1]);
    run_ms(&mut task, 2);
    let writes = world.line.writes.take();
    assert_eq!(*decode(&writes[2]).payload, [0, 2, 1, 2]);
    assert!(fast.get());

    // A long transfer does not delay a poll by more than 5 ms, and requests to other functions not at all.
    world.call(39, &[1, 0x29]);
    world.call(42, &[1]);
    world.call(38, &[1, 0x28, 1, 0]);
    run_ms(&mut task, 9);
    assert_eq!(world.replies(), [(0x7F01, 1), (0x7F02, 41)]);
    run_ms(&mut task, 2);
    assert_eq!(world.replies(), [(0x7F02, 40)]);
    world.call(15, &[0, 0, 64]);
    world.call(41, &[0]);
    run_ms(&mut task, 0);
    assert_eq!(world.replies(), [(0x7F01, 1), (0x7F02, 42)]);
    run_ms(&mut task, 20);
    world.call(41, &[1]);
    run_ms(&mut task, 1);
    assert_eq!(world.replies(), [(0x9029, 0)]);

    // Errors are a status. Errors of the bus and a time-out also free the bus.
    for (address, ms, status, frees) in
        [(0x10, 0, 1, 0), (0x2A, 0, 2, 0), (0x2C, 0, 4, 1), (0x2D, 0, 8, 1), (0x2B, 50, 8, 1)]
    {
        let before = freed.get();
        world.call(37, &[1, address, 0]);
        run_ms(&mut task, ms);
        world.call(42, &[1]);
        run_ms(&mut task, 1);
        assert_eq!(world.replies(), [(0x7F01, 1), (0x902A, status)], "{address:#x}");
        assert_eq!(freed.get() - before, frees, "{address:#x}");
    }
}

#[test]
fn line_errors_are_survived_and_the_end_of_the_line_ends_the_task() {
    let world = World::new();
    world.send(&frame_to(HUB, 1, 0x7F04, &[]));
    let rough = Rough { errors: 5, pipe: &world.to_hub };
    let (mut responder, devices) = (responder(), &mut ());
    let mut task =
        pin!(tasks::responder::run(rough, &world.line, devices, &mut responder, &world.wires, |_| ()));
    run_ms(&mut task, 4);
    MockDriver::get().advance(Duration::from_millis(1));
    assert!(poll(&mut task));
    assert_eq!(world.replies(), [(0x7F01, 1)]);
}

#[test]
fn between_connections_the_timer_runs_on() {
    let world = World::new();
    let mut responder = responder();
    world.drive_motor_0();
    let connection = Rough { errors: 0, pipe: &world.to_hub };
    {
        let devices = &mut ();
        let session =
            tasks::responder::run(connection, &world.line, devices, &mut responder, &world.wires, |_| ());
        assert!(poll(&mut pin!(session)));
    }
    assert_eq!(world.new_commands().len(), 1);
    let mut task = pin!(async {
        tasks::responder::attend(&mut responder, &mut (), &world.wires, |_| ()).await;
    });
    run_ms(&mut task, 2500);
    assert_eq!(world.new_commands(), [0, 1, 2, 3].map(disabled));
}

#[test]
fn a_hub_with_a_memory_reads_packets_once_the_memory_has_reported() {
    let world = World::with(responder().expecting_store());
    let mut task = pin!(world.task());
    // The current alert of motor 2.
    world.call(13, &[2]);
    run_ms(&mut task, 400);
    assert_eq!((world.replies(), world.new_commands()), (vec![], vec![]));
    world.wires.store.done.signal(alert_of_motor_2());
    run_ms(&mut task, 2);
    assert_eq!(world.replies(), [(0x900D, 7)]);
    assert!(world.new_commands().iter().all(|command| matches!(command, Command::Configure { .. })));
    // A request reaches the memory's task, and its result comes back.
    world.send(&frame_to(HUB, 2, 0x4D0E, &[]));
    run_ms(&mut task, 2);
    let order = world.wires.store.request.try_take().expect("an order");
    assert_eq!(order.record.map(|record| record.number()), Some(2));
    assert_eq!(world.replies(), [(0x7F01, 1)]);
    // The task of the LED feeds the watchdog meanwhile.
    assert!(world.times_shown.get() >= 8, "{:?}", world.times_shown);
}

/// A memory with a current alert for motor 2.
fn alert_of_motor_2() -> StoreResult {
    let mut record = SettingsRecord::new(1);
    record.push(0x100C, &[2, 7, 0]).expect("room");
    StoreResult { found: Some(Found { stored: Stored::Whole, version: 1, record }), outcome: Outcome::None }
}

/// Runs a hub whose memory reports 6 s after the start, which is after the time-out of 5 s. If a host `speaks`, the host
/// has sent a keep-alive before. Returns the current alert of motor 2 and the report of the memory, as hosts read them.
fn late_memory(speaks: bool) -> (u8, StoreReport) {
    let world = World::with(responder().expecting_store());
    let mut task = pin!(world.task());
    let permitted = || world.wires.button_permitted.lock(Cell::get);
    if speaks {
        world.send(&frame_to(HUB, 1, 0x7F04, &[]));
    }
    run_ms(&mut task, 4_900);
    assert_eq!(world.replies(), []);
    run_ms(&mut task, 200);
    assert_eq!(world.replies(), if speaks { vec![(0x7F01, 1)] } else { vec![] });
    // Runs for longer than hosts wait for an answer.
    run_ms(&mut task, 900);
    assert!(!permitted(), "the memory may be erased");
    if speaks {
        // The hub has a memory. A save must wait until the memory has reported.
        world.send(&frame_to(HUB, 2, 0x4D0E, &[]));
        run_ms(&mut task, 2);
        assert_eq!(world.replies(), [(0x7F02, Nack::STORE_BUSY.0)]);
    }
    world.wires.store.done.signal(alert_of_motor_2());
    run_ms(&mut task, 60);
    assert_eq!(permitted(), !speaks);
    world.call(13, &[2]);
    world.send(&frame_to(HUB, 3, 0x4D11, &[]));
    run_ms(&mut task, 2);
    let answers: Vec<_> = world.line.writes.take().iter().map(|write| decode(write).payload).collect();
    (answers[0][0], StoreReport::read(&mut Fields::new(&answers[1])).expect("a report"))
}

#[test]
fn a_memory_that_reports_after_the_time_out_is_restored_only_if_no_host_has_spoken() {
    for speaks in [false, true] {
        let (alert, report) = late_memory(speaks);
        assert_eq!(alert == 7, !speaks, "{alert}");
        assert_eq!((report.stored, report.number, report.differs), (Stored::Whole, 1, speaks));
    }
}
