//! The load by the daemon of a robot controller: 18 requests every 12 ms, with at most 8 requests unanswered. The first
//! cycle has 38 requests (wpilibsuite/scservices, commit 4c3d7bd).

use std::collections::VecDeque;
use std::path::Path;
use std::time::Duration;

use crate::common::{base, board, booted, expect_speed, four_loads, ms};
use crate::recording::Configuration;
use emulated::host_link::HostLink;
use emulated::{Bench, RegisterDevice, elf};
use motor_hub::extension::base::OdometryReport;
use motor_hub::extension::group::GroupCourse;
use motor_hub::extension::{HubFunction, MotorFunction};
use motor_hub::group::{GroupCommand, GyroState};
use motor_hub::units::{Acceleration, CountsPerSecond};

/// Time from one cycle to the next.
const PERIOD: Duration = Duration::from_millis(12);
/// Largest number of requests that may be unanswered.
const UNANSWERED: usize = 8;
/// Time between two checks of the line. The daemon receives an answer at most this time late.
const STEP: Duration = Duration::from_micros(100);

type Request = (u16, Vec<u8>);

struct Daemon {
    bench: Bench,
    host: HostLink,
    power: i16,
}

impl Daemon {
    /// Creates the daemon of a hub that runs four motors and six servos.
    fn with_all_devices(image: &Path) -> Self {
        let bench = crate::boot::at_speed(image, Configuration::Configured);
        let mut daemon = Self { bench, host: HostLink::default(), power: 0 };
        let [width, period] = [1_500_u16, 20_000].map(u16::to_le_bytes);
        for (id, rest) in [(0x1021, &width[..]), (0x101F, &period), (0x1023, &[1])] {
            for (id, payload) in Self::of_channel(id, 0..6, rest) {
                daemon.host.request_raw(&mut daemon.bench, id, &payload);
            }
        }
        daemon
    }

    /// Makes motors 0 and 1 drive straight ahead as a drive base with a gyro.
    fn drive_base(&mut self) {
        (0..2).for_each(|motor| self.host.enable(&mut self.bench, motor, false));
        self.bench.run(ms(100));
        self.host.command(&mut self.bench, HubFunction::SetBase { base: base() });
        (0..2).for_each(|motor| self.host.velocity(&mut self.bench, motor, 1_000));
        let speed = CountsPerSecond::new(1_000);
        let course = GroupCourse::Velocity([Some(speed), Some(speed), None, None]);
        let wanted = GroupCommand::new(course, speed, Acceleration::new(5_000).expect("in range"));
        self.host.command(&mut self.bench, MotorFunction::Move { wanted }.to(0));
        self.bench.run(ms(1_500));
        self.host.keep_alive(&mut self.bench);
    }

    fn of_channel(id: u16, channels: std::ops::Range<u8>, rest: &[u8]) -> impl Iterator<Item = Request> {
        channels.map(move |channel| (id, [&[channel], rest].concat()))
    }

    /// Returns the requests of a cycle in two parts. The second part is sent after the first four answers of the cycle.
    fn requests(&mut self, full: bool) -> [VecDeque<Request>; 2] {
        self.power = (self.power + 100) % 2_000;
        let power = (8_000 + self.power).to_le_bytes();
        let [width, period] = [1_500_u16, 20_000].map(u16::to_le_bytes);
        let mut first: VecDeque<Request> =
            [(0x7F04, vec![]), (0x7F03, vec![1]), (0x1007, vec![13, 0]), (0x1000, vec![])].into();
        first.extend(Self::of_channel(0x1021, 0..6, &width));
        let mut then: VecDeque<Request> = Self::of_channel(0x100F, 0..4, &power).collect();
        then.extend(Self::of_channel(0x1007, 8..12, &[0]));
        if full {
            then.extend(Self::of_channel(0x1008, 0..4, &[0, 1]));
            then.extend(Self::of_channel(0x100A, 0..4, &[1]));
            then.extend(Self::of_channel(0x101F, 0..6, &period));
            then.extend(Self::of_channel(0x1023, 0..6, &[1]));
        }
        [first, then]
    }

    /// Runs a cycle to its last answer, and then to the start of the next cycle. Returns the time to the last answer.
    fn cycle(&mut self, full: bool) -> Duration {
        let start = self.bench.now();
        let [mut first, mut then] = self.requests(full);
        let mut left = first.len() + then.len();
        let (mut unanswered, mut last) = (0, start);
        // The second part is sent after four answers, because the daemon waits for the answers to its first four
        // requests.
        let mut awaited = 4;
        while left > 0 {
            while unanswered < UNANSWERED {
                let next = first.pop_front().or_else(|| if awaited == 0 { then.pop_front() } else { None });
                let Some((id, payload)) = next else { break };
                self.host.send_raw(&mut self.bench, id, &payload);
                unanswered += 1;
            }
            self.bench.run(STEP);
            for arrival in self.host.arrivals(&mut self.bench) {
                assert_ne!(arrival.packet.id, 0x7F02, "NACK: {:02x?}", arrival.packet);
                awaited = usize::saturating_sub(awaited, 1);
                (left, unanswered, last) = (left - 1, unanswered - 1, arrival.at);
            }
            assert!(self.bench.now() - start < ms(100), "{left} requests are not answered");
        }
        let time = last - start;
        let ticks = time.as_micros().div_ceil(PERIOD.as_micros()) as u32;
        self.bench.run_until(start + PERIOD * ticks);
        time
    }

    /// Runs one full cycle, and then `cycles` further cycles. Returns the time of the full cycle, and the times of the
    /// others in ascending order.
    fn run(cycles: usize) -> (Duration, Vec<Duration>) {
        let mut daemon = Self { bench: booted(four_loads()), host: HostLink::default(), power: 0 };
        let first = daemon.cycle(true);
        let mut times: Vec<Duration> = (0..cycles).map(|_| daemon.cycle(false)).collect();
        times.sort_unstable();
        daemon.bench.assert_sound();
        (first, times)
    }
}

/// Returns the time that this percentage of the cycles does not exceed.
fn percentile(times: &[Duration], percent: usize) -> Duration {
    times[(times.len() * percent / 100).min(times.len() - 1)]
}

#[test]
fn a_daemons_cycle_takes_at_most_9_ms() {
    let (first, times) = Daemon::run(40);
    println!("first {first:?}, median {:?}, p99 {:?}", percentile(&times, 50), percentile(&times, 99));
    assert!(percentile(&times, 99) <= ms(9), "{:?}", percentile(&times, 99));
    assert!(first <= ms(24), "{first:?}");
}

/// Returns the core's load in percent while the hub uses all its devices: four motors, of which two are a drive base
/// with a gyro on the I2C bus, six servos, and all inputs. The three loads are without requests of a host, with the
/// daemon's cycles, and with the daemon's cycles and a read of eight bytes from an I2C device in each cycle.
fn loads() -> [f64; 3] {
    const CYCLES: u32 = 40;
    let mut daemon = Daemon::with_all_devices(&elf::build(board().name(), elf::Variant::Usual));
    daemon.bench.attach(0, RegisterDevice::bno055());
    daemon.drive_base();
    let odometry: OdometryReport = daemon.host.read(&mut daemon.bench, HubFunction::Odometry);
    assert_eq!(odometry.gyro, GyroState::Good);
    let loads = [0, 1, 2].map(|host| {
        let (start, before) = (daemon.bench.now(), daemon.bench.instructions());
        for _ in 0..CYCLES {
            if host == 2 {
                daemon.host.request_raw(&mut daemon.bench, 0x1034, &[0, 0x28, 8, 0x20]);
                daemon.host.request_raw(&mut daemon.bench, 0x1029, &[0]);
            }
            if host > 0 {
                daemon.cycle(false);
            } else {
                daemon.bench.run(PERIOD);
            }
        }
        let instructions = (daemon.bench.instructions() - before) as f64;
        100.0 * instructions / (daemon.bench.now() - start).as_secs_f64() / board().core_hz() as f64
    });
    expect_speed(&mut daemon.bench, 0..4, 100.0);
    daemon.bench.assert_sound();
    loads
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn the_whole_hub_with_all_devices_needs_little_of_the_core() {
    let loads = loads();
    println!("{:?} % of {}", loads.map(|load| (100.0 * load).round() / 100.0), board());
    assert!(loads[0] <= 3.0, "{loads:?}");
}

/// `cargo test --test image daemon::report_of_10000 -- --ignored --nocapture`: two minutes of the hub's time.
#[test]
#[ignore = "a report, not a test"]
fn report_of_10000_cycles_without_a_lost_request() {
    let (first, times) = Daemon::run(10_000);
    let [median, p99, worst] = [50, 99, 100].map(|percent| percentile(&times, percent));
    println!("first {first:?}, median {median:?}, p99 {p99:?}, worst {worst:?}");
    assert!(p99 <= ms(9), "{p99:?}");
}
