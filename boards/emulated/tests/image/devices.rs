//! Servos, analog inputs, digital pins and I2C buses, as a host uses them over its line, with four motors regulated.

use std::time::Duration;

use crate::common::{am60, base, board, booted, expect_motor, four_loads, ms};
use emulated::host_link::HostLink;
use emulated::{Bench, Board, Mounting, RegisterDevice, ServoPulse};
use motor_hub::extension::{HubFunction, Request};
use motor_hub::protocol::Nack;
use motor_hub::protocol::answers::Reply;
use motor_hub::protocol::requests::Standard;

// Numbers of requests (docs/reference/rev-protocol.md).
const ADC: u16 = 0x1007;
const SET_SERVO_PERIOD: u16 = 0x101F;
const SET_SERVO_WIDTH: u16 = 0x1021;
const SET_SERVO_ENABLE: u16 = 0x1023;
const WRITE_I2C: u16 = 0x1026;
const READ_I2C: u16 = 0x1028;
const POLL_I2C_READ: u16 = 0x1029;
const POLL_I2C_WRITE: u16 = 0x102A;
const SET_I2C_SPEED: u16 = 0x102B;
const READ_I2C_REGISTER: u16 = 0x1034;

/// Bits of an I2C result.
const NO_ADDRESS: u8 = 1;
const TIME_OUT: u8 = 1 << 3;

const MICROSECOND: Duration = Duration::from_micros(1);

/// A hub and its host.
struct Devices {
    bench: Bench,
    host: HostLink,
}

impl Devices {
    fn new() -> Self {
        Self { bench: booted(vec![am60()]), host: HostLink::default() }
    }

    /// Creates a hub that regulates these motors at a speed in counts/s.
    fn with_motors(motors: Vec<Mounting>, cps: i16) -> Self {
        let (mut bench, mut host) = (booted(motors), HostLink::default());
        for motor in 0..bench.motors() {
            host.velocity(&mut bench, motor as u8, cps);
        }
        bench.run(ms(800));
        Self { bench, host }
    }

    fn request(&mut self, id: u16, payload: &[u8]) -> Reply {
        self.host.request_raw(&mut self.bench, id, payload)
    }

    fn command(&mut self, id: u16, payload: &[u8]) {
        let reply = self.request(id, payload);
        assert!(matches!(reply, Reply::Ack { .. }), "{id:#x} {payload:02x?}: {reply:?}");
    }

    fn value(&mut self, id: u16, payload: &[u8]) -> Vec<u8> {
        match self.request(id, payload) {
            Reply::Data(data) => data.to_vec(),
            reply => panic!("{id:#x} {payload:02x?}: {reply:?}"),
        }
    }

    fn adc(&mut self, channel: u8, raw: bool) -> i16 {
        let value = self.value(ADC, &[channel, raw.into()]);
        i16::from_le_bytes([value[0], value[1]])
    }

    fn servo(&mut self, servo: u8, period_us: u16, width_us: u16) {
        let [a, b] = period_us.to_le_bytes();
        let [c, d] = width_us.to_le_bytes();
        self.command(SET_SERVO_PERIOD, &[servo, a, b]);
        self.command(SET_SERVO_WIDTH, &[servo, c, d]);
        self.command(SET_SERVO_ENABLE, &[servo, 1]);
    }

    /// Returns the pulses that began at this time or later.
    fn pulses(&mut self, servo: usize, since: Duration) -> Vec<ServoPulse> {
        self.bench.servo_pulses(servo).into_iter().filter(|pulse| pulse.at >= since).collect()
    }

    /// Polls a transfer that has been started. Returns its status, the bytes read, and an upper limit of its time.
    fn result(&mut self, poll: u16, bus: u8) -> (u8, Vec<u8>, Duration) {
        let started = self.bench.now();
        loop {
            match self.request(poll, &[bus]) {
                Reply::Data(data) => return (data[0], data[2..].to_vec(), self.bench.now() - started),
                Reply::Nack(Nack(41)) => assert!(self.bench.now() - started < ms(200), "the transfer ends"),
                reply => panic!("{reply:?}"),
            }
        }
    }

    fn read_register(&mut self, bus: u8, register: u8, count: u8) -> (u8, Vec<u8>, Duration) {
        self.command(READ_I2C_REGISTER, &[bus, 0x28, count, register]);
        self.result(POLL_I2C_READ, bus)
    }
}

#[test]
fn servo_pulses_are_exact_to_a_microsecond_while_four_motors_are_regulated() {
    let mut hub = Devices::with_motors(four_loads(), 1500);
    let widths = [500, 1000, 1500, 2000, 2400, 2500];
    let periods = [20_000, 4_000, 15_000, 20_000, 65_535, 3_000];
    for servo in 0..6 {
        hub.servo(servo, periods[usize::from(servo)], widths[usize::from(servo)]);
    }
    hub.bench.run(ms(100));
    let start = hub.bench.now();
    // Bulk reads alternate with a silent line.
    for _ in 0..12 {
        hub.host.bulk(&mut hub.bench);
        hub.bench.run(ms(20));
    }
    let end = hub.bench.now();
    for servo in 0..6 {
        let pulses = hub.pulses(servo, start);
        let (width, period) = [widths, periods].map(|micros| MICROSECOND * u32::from(micros[servo])).into();
        let count = (end - start).as_micros() / period.as_micros();
        assert!((count - 1..=count + 1).contains(&(pulses.len() as u128)), "servo {servo}: {}", pulses.len());
        for pulse in &pulses {
            assert!(pulse.high.abs_diff(width) <= MICROSECOND, "servo {servo}: {pulse:?}");
        }
        for pair in pulses.windows(2) {
            assert!((pair[1].at - pair[0].at).abs_diff(period) <= MICROSECOND, "servo {servo}: {pair:?}");
        }
    }
    // The width is changed between two pulses and in the middle of a pulse. Each pulse has the old or the new width.
    let start = hub.bench.now();
    for step in 0..20_u16 {
        let width = if step % 2 == 0 { 600_u16 } else { 2400 }.to_le_bytes();
        hub.command(SET_SERVO_WIDTH, &[1, width[0], width[1]]);
        hub.bench.run(Duration::from_micros(u64::from(step) * 97));
    }
    let pulses = hub.pulses(1, start + ms(10));
    assert!(
        pulses.iter().all(|pulse| [600, 2400].iter().any(|us| pulse.high == MICROSECOND * *us)),
        "{pulses:?}"
    );
    // Servo 0 is disabled. The other servos continue.
    hub.command(SET_SERVO_ENABLE, &[0, 0]);
    hub.bench.run(ms(21));
    let start = hub.bench.now();
    hub.bench.run(ms(110));
    assert_eq!(hub.pulses(0, start).len(), 0);
    assert!((5..=6).contains(&hub.pulses(3, start).len()));
    (0..4).for_each(|motor| expect_motor(&mut hub.bench, motor, 1500.0, 60.0));
    hub.bench.assert_sound();
}

#[test]
fn servos_are_off_after_fail_safe_and_after_the_host_has_gone() {
    let mut hub = Devices::new();
    let off = |hub: &mut Devices| {
        // A pulse that has begun is completed.
        hub.bench.run(ms(21));
        let start = hub.bench.now();
        hub.bench.run(ms(100));
        hub.pulses(2, start).is_empty()
    };
    hub.servo(2, 20_000, 1500);
    hub.bench.run(ms(50));
    assert!(!off(&mut hub));
    hub.host.command(&mut hub.bench, Standard::FailSafe);
    assert!(off(&mut hub), "after fail-safe");
    hub.command(SET_SERVO_ENABLE, &[2, 1]);
    hub.bench.run(ms(50));
    assert!(!off(&mut hub));
    hub.bench.run(ms(2_600));
    assert!(off(&mut hub), "after the keep-alive time");
    // A servo that is not configured is refused, and so is any servo while the battery is below 7 V.
    assert_eq!(hub.request(SET_SERVO_ENABLE, &[4, 1]), Reply::Nack(Nack(30)));
    hub.bench.set_battery(6.5);
    hub.bench.run(ms(300));
    assert_eq!(hub.request(SET_SERVO_ENABLE, &[2, 1]), Reply::Nack(Nack(31)));
    hub.bench.assert_sound();
}

#[test]
fn a_reset_ends_the_pulse_of_a_servo() {
    let mut hub = Devices::new();
    hub.servo(2, 20_000, 1500);
    hub.bench.run(ms(50));
    let last = hub.bench.servo_pulses(2).pop().expect("a pulse").at;
    // The reset comes in the middle of the pulse after the next one.
    let reset = last + ms(40) + 750 * MICROSECOND;
    hub.bench.pull_reset(reset);
    hub.bench.run(ms(400));
    hub.host = HostLink::default();
    hub.servo(2, 20_000, 1500);
    hub.bench.run(ms(50));
    let pulses = hub.pulses(2, last);
    let cut = pulses.iter().filter(|pulse| pulse.high.abs_diff(1500 * MICROSECOND) > MICROSECOND);
    let ends: Vec<_> = cut.map(|pulse| pulse.at + pulse.high).collect();
    assert_eq!(ends.len(), 1, "one pulse is cut off: {pulses:?}");
    assert!(ends[0].abs_diff(reset) <= MICROSECOND, "at the reset at {reset:?}: {pulses:?}");
    assert!(pulses.last().is_some_and(|pulse| pulse.at > reset), "pulses after the reset: {pulses:?}");
    hub.bench.assert_sound();
}

#[test]
pub(crate) fn analog_inputs_rail_and_temperature_are_measured_and_never_old() {
    let mut hub = Devices::new();
    hub.bench.set_five_volts(5_040);
    hub.bench.set_temperature(47);
    let volts = [0, 1_000, 2_500, 3_290];
    for (input, mv) in volts.into_iter().enumerate() {
        hub.bench.set_analog(input, mv);
    }
    hub.bench.run(ms(25));
    for (input, mv) in (0..).zip(volts) {
        let measured = hub.adc(input, false);
        assert!((i32::from(measured) - mv as i32).abs() <= 3, "input {input}: {measured} for {mv} mV");
        let counts = hub.adc(input, true);
        assert!((i32::from(counts) - mv as i32 * 4095 / 3300).abs() <= 2, "input {input}: {counts} counts");
    }
    assert!((hub.adc(12, false) - 5_040).abs() <= 6, "{}", hub.adc(12, false));
    assert!((hub.adc(14, false) - 470).abs() <= 10, "{}", hub.adc(14, false));
    // The voltage steps at different phases of the sampling. An answer shows a voltage that is at most 20 ms old.
    for step in 0..12_u32 {
        let mv = 300 + 200 * step;
        hub.bench.set_analog(3, mv);
        hub.bench.run(ms(19) + Duration::from_micros(u64::from(step) * 830));
        let measured = hub.adc(3, false);
        assert!((i32::from(measured) - mv as i32).abs() <= 3, "{measured} for {mv} mV");
    }
    // Channel 6 is measured by no board.
    assert!(matches!(hub.request(ADC, &[6, 0]), Reply::Nack(_)));
    hub.bench.assert_sound();
}

#[test]
pub(crate) fn i2c_devices_are_read_and_written_at_both_speeds_on_every_bus() {
    let mut hub = Devices::new();
    let buses = if board() == Board::NucleoH743zi2 { 4 } else { 3 };
    hub.bench.attach(0, RegisterDevice::bno055());
    let numbers: [u8; 256] = std::array::from_fn(|number| number as u8 ^ 0xA5);
    for bus in 1..buses {
        hub.bench.attach(bus.into(), RegisterDevice::new(numbers));
    }
    assert_eq!(hub.read_register(0, 0x00, 1).0, 0);
    assert_eq!(hub.read_register(0, 0x00, 1).1, [0xA0]);
    // Sets the sensor to a fusion mode, and reads its status and its quaternion.
    hub.command(WRITE_I2C, &[0, 0x28, 2, 0x3D, 0x08]);
    assert_eq!(hub.result(POLL_I2C_WRITE, 0).0, 0);
    hub.bench.run(ms(30));
    assert_eq!(hub.read_register(0, 0x39, 1).1, [5]);
    assert_eq!(hub.read_register(0, 0x20, 8).1, [0, 0x40, 0, 0, 0, 0, 0, 0]);
    for bus in 1..buses {
        for fast in [0, 1] {
            hub.command(SET_I2C_SPEED, &[bus, fast]);
            for count in [1, 2, 3, 4, 100] {
                let (status, bytes, time) = hub.read_register(bus, 0x10, count);
                assert_eq!((status, &bytes[..]), (0, &numbers[0x10..0x10 + usize::from(count)]), "bus {bus}");
                // A byte takes nine clocks. The transfer also has two addresses and the number of the register.
                let least = (u64::from(count) + 3) * if fast == 0 { 90 } else { 22 };
                assert!(
                    time < Duration::from_micros(2 * least) + ms(4),
                    "bus {bus}: {count} bytes in {time:?}"
                );
            }
        }
        hub.command(WRITE_I2C, &[bus, 0x28, 4, 0x40, 1, 2, 3]);
        assert_eq!(hub.result(POLL_I2C_WRITE, bus).0, 0);
        let written =
            hub.bench.device(bus.into(), 0, |device| [0x40, 0x41, 0x42].map(|r| device.register(r)));
        assert_eq!(written, [1, 2, 3], "bus {bus}");
        // A read without a register number begins after the last register that was read.
        hub.command(READ_I2C, &[bus, 0x28, 2]);
        assert_eq!(hub.result(POLL_I2C_READ, bus).1, numbers[0x43..0x45], "bus {bus}");
    }
    let no_bus = hub.request(READ_I2C_REGISTER, &[3, 0x28, 1, 0]);
    assert_eq!(matches!(no_bus, Reply::Nack(_)), buses == 3, "{no_bus:?}");
    hub.bench.assert_sound();
}

#[test]
fn faults_of_an_i2c_bus_end_and_neither_motors_nor_the_line_notice() {
    let mut hub = Devices::with_motors(vec![am60()], 600);
    hub.bench.attach(0, RegisterDevice::bno055());
    let works = |hub: &mut Devices| {
        let (status, bytes, _) = hub.read_register(0, 0x00, 4);
        assert_eq!((status, &bytes[..]), (0, &[0xA0, 0xFB, 0x32, 0x0F][..]));
    };
    works(&mut hub);
    // No device is at the address, for reads and for writes.
    hub.bench.device(0, 0, |device| device.absent = true);
    assert_eq!(hub.read_register(0, 0x00, 4).0, NO_ADDRESS);
    hub.command(WRITE_I2C, &[0, 0x28, 2, 0x3E, 0]);
    assert_eq!(hub.result(POLL_I2C_WRITE, 0).0, NO_ADDRESS);
    hub.bench.device(0, 0, |device| device.absent = false);
    works(&mut hub);
    // A device stretches the clock for 30 ms in the middle of a transfer.
    hub.command(READ_I2C_REGISTER, &[0, 0x28, 8, 0x00]);
    hub.bench.hold_scl(0, ms(30));
    let (status, bytes, time) = hub.result(POLL_I2C_READ, 0);
    assert_eq!((status, bytes.len()), (0, 8));
    assert!(time >= ms(29), "{time:?}");
    // A device holds the clock for 100 ms, longer than the time-out of a transfer. Meanwhile the hub answers the host
    // immediately.
    hub.command(READ_I2C_REGISTER, &[0, 0x28, 8, 0x00]);
    hub.bench.hold_scl(0, ms(100));
    let asked = hub.bench.now();
    hub.host.bulk(&mut hub.bench);
    assert!(hub.bench.now() - asked < ms(3), "{:?}", hub.bench.now() - asked);
    let (status, bytes, time) = hub.result(POLL_I2C_READ, 0);
    assert_eq!((status, bytes.len()), (TIME_OUT, 0));
    assert!(time < ms(60), "{time:?}");
    let (status, _, time) = hub.read_register(0, 0x00, 1);
    assert_eq!(status, TIME_OUT);
    assert!(time < ms(10), "a held clock is found before a transfer: {time:?}");
    hub.bench.run(ms(60));
    works(&mut hub);
    // A device that was cut off in the middle of a byte holds SDA until it has its clocks.
    for clocks in [4, 9] {
        hub.bench.hold_sda(0, clocks);
        assert_eq!(hub.bench.bus_levels(0), [true, false]);
        assert_eq!(hub.read_register(0, 0x00, 1).0, TIME_OUT);
        assert_eq!(hub.bench.bus_levels(0), [true, true], "{clocks} clocks");
        works(&mut hub);
    }
    // The hub is reset in the middle of a transfer.
    hub.command(READ_I2C_REGISTER, &[0, 0x28, 100, 0x00]);
    let at = hub.bench.now() + ms(2);
    expect_motor(&mut hub.bench, 0, 600.0, 30.0);
    hub.bench.pull_reset(at);
    hub.bench.run(ms(300));
    hub.host = HostLink::default();
    works(&mut hub);
    hub.bench.assert_sound();
}

#[test]
fn a_second_hold_of_a_line_and_levels_on_pins_outlast_the_first_hold_and_a_reset() {
    let mut hub = Devices::new();
    hub.bench.connect_pin(2, Some(true));
    // More clocks than the hub gives.
    hub.bench.hold_sda(0, 200);
    hub.bench.hold_scl(0, ms(1));
    hub.bench.run(ms(5));
    assert_eq!(hub.bench.bus_levels(0), [true, false]);
    hub.bench.pull_reset(hub.bench.now());
    hub.bench.run(ms(50));
    assert_eq!(hub.bench.bus_levels(0), [true, false]);
    assert!(hub.bench.pin_level(2));
}

#[test]
fn a_base_reads_its_gyro_and_goes_on_without_it_while_motors_run() {
    let mut hub = Devices { bench: booted(vec![am60(), am60()]), host: HostLink::default() };
    hub.bench.attach(0, RegisterDevice::bno055());
    hub.host.command(&mut hub.bench, HubFunction::SetBase { base: base() });
    for motor in 0..2 {
        hub.host.velocity(&mut hub.bench, motor, 600);
    }
    let gyro = |hub: &mut Devices| {
        let report = hub.value(Request::from(HubFunction::Odometry).id(), &[]);
        (report[20], report[21])
    };
    hub.bench.run(ms(350));
    assert_eq!(gyro(&mut hub), (2, 0), "good");
    // Transfers of the host continue beside the transfers of the hub.
    assert_eq!(hub.read_register(0, 0x00, 4).1, [0xA0, 0xFB, 0x32, 0x0F]);
    // A device holds the clock. Each reading of the gyro ends by its time-out, and the hub answers the host
    // immediately.
    hub.bench.hold_scl(0, ms(400));
    hub.bench.run(ms(300));
    let asked = hub.bench.now();
    assert_eq!(gyro(&mut hub), (3, 1), "lost");
    assert!(hub.bench.now() - asked < ms(3), "{:?}", hub.bench.now() - asked);
    expect_motor(&mut hub.bench, 0, 600.0, 30.0);
    hub.bench.assert_sound();
}

#[test]
fn the_line_that_speaks_first_is_the_hosts_until_a_reset() {
    let (mut bench, mut host) = (booted(vec![am60()]), HostLink::default());
    let answers = |bench: &mut Bench, host: &mut HostLink, line| {
        bench.use_line(line);
        host.send(bench, Standard::KeepAlive);
        bench.run(ms(5));
        !host.arrivals(bench).is_empty()
    };
    // Noise does not choose a line.
    bench.send(&[0x44, 0x00, 0xFF]);
    bench.run(ms(5));
    assert!(answers(&mut bench, &mut host, 1), "the first packet is answered");
    assert!(!answers(&mut bench, &mut host, 0), "a request on the other line is not answered");
    bench.use_line(1);
    host.bulk(&mut bench);
    let at = bench.now() + ms(1);
    bench.pull_reset(at);
    bench.run(ms(300));
    assert!(answers(&mut bench, &mut host, 0), "after a reset");
    assert!(!answers(&mut bench, &mut host, 1));
    bench.assert_sound();
}
