//! A chain of simulated hubs, in virtual time: answers and reports that a host at the parent gets from the children.

use motor_hub::chain::ChainReport;
use motor_hub::extension::report::HubReport;
use motor_hub::extension::{HubFunction, Request};
use motor_hub::model::battery::Battery;
use motor_hub::model::catalogue::find;
use motor_hub::model::load::Load;
use motor_hub::model::si::{KgM2, Ohms, Volts};
use motor_hub::protocol::motor::{ChannelMode, RunMode, Target, ToMotor};
use motor_hub::protocol::payload::{Field, Fields};
use motor_hub::protocol::requests::{DISCOVERY, FAIL_SAFE, Standard};
use motor_hub::protocol::{Address, BROADCAST, Decoder, Packet, Reply, frame};
use motor_hub::units::{Control, Micros};
use simulated::encoder::{Encoder, Wire as EncoderWire};
use simulated::scenario::{Motor, Scenario, Timed};
use simulated::serve::interventions::{Interventions, OnMotor};
use simulated::serve::{self, Hubs, Line, LineFault, Wire};
use std::future::Future;
use std::io::{Read, Write};
use std::num::NonZeroU32;
use std::ops::RangeInclusive;
use std::pin::Pin;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::task::{Context, Waker};

/// All tests of the process share the clock of the mock driver, so they run one after another.
static CLOCK: Mutex<()> = Mutex::new(());

/// Time after which a motor can be enabled.
const AWAKE_MS: u32 = 200;

struct Chain {
    hubs: Pin<Box<dyn Future<Output = ()>>>,
    line: serve::ChainLine,
    host: Wire,
    decoder: Decoder,
    number: u8,
    ms: u64,
    _clock: MutexGuard<'static, ()>,
}

impl Chain {
    fn new(addresses: &[u8]) -> Self {
        Self::of(addresses, Scenario::to_serve(), |_, _| ())
    }

    /// Hubs with the motors of a scenario. `intervene` may change those of the first hub, at a time in ms.
    fn of(
        addresses: &[u8],
        scenario: Scenario,
        mut intervene: impl FnMut(&mut Interventions, u64) + 'static,
    ) -> Self {
        let clock = CLOCK.lock().unwrap_or_else(PoisonError::into_inner);
        let addresses = addresses.iter().map(|&address| Address::new(address).expect("1 to 254")).collect();
        let hubs = Hubs::chain(addresses);
        let (line, (end, host)) = (hubs.line.clone(), Line::within_process());
        let served = async move {
            let mut ms = 0;
            let mut intervene = |now: &mut Interventions| {
                intervene(now, ms);
                ms += 1;
            };
            serve::steps(&scenario, &hubs, end, None, &mut intervene, &mut |_| true).await.expect("it runs");
        };
        let mut chain = Self {
            hubs: Box::pin(served),
            line,
            host,
            decoder: Decoder::new(),
            number: 0,
            ms: 0,
            _clock: clock,
        };
        chain.pass(AWAKE_MS);
        chain
    }

    /// Lets a millisecond pass, and returns the packets that the host gets.
    fn step(&mut self) -> Vec<Packet> {
        self.ms += 1;
        assert!(self.hubs.as_mut().poll(&mut Context::from_waker(Waker::noop())).is_pending());
        let mut bytes = [0; 1024];
        let length = self.host.read(&mut bytes).unwrap_or(0);
        let mut input = &bytes[..length];
        let now = Micros::new(1_000 * self.ms);
        std::iter::from_fn(|| self.decoder.next(&mut input, now)).collect()
    }

    fn pass(&mut self, ms: u32) -> Vec<Packet> {
        (0..ms).flat_map(|_| self.step()).collect()
    }

    /// Sends a request, and returns its number.
    fn send(&mut self, request: impl Into<Request>, address: u8) -> u8 {
        self.number = self.number.checked_add(1).unwrap_or(1);
        let request = request.into();
        let packet = request.packet(address, self.number, request.id());
        self.host.write_all(&frame::encode(&packet)).expect("a queue");
        self.number
    }

    /// Sends a request, and returns the answer with the time that it took; `None` after 100 ms.
    fn ask(&mut self, request: impl Into<Request>, address: u8) -> Option<(Packet, u64)> {
        let (number, begun) = (self.send(request, address), self.ms);
        (0..100).find_map(|_| {
            let packets = self.step();
            let answer =
                packets.into_iter().find(|packet| packet.source == address && packet.reference == number);
            answer.map(|packet| (packet, self.ms - begun))
        })
    }

    fn obeys(&mut self, request: impl Into<Request>, address: u8) -> bool {
        let answer = self.ask(request, address);
        matches!(
            answer.and_then(|(packet, _)| Reply::read(&packet, packet.id & 0x7FFF)),
            Some(Reply::Ack { .. })
        )
    }

    fn is_enabled(&mut self, address: u8) -> bool {
        let (answer, _) = self.ask(ToMotor::Enable.to(0), address).expect("an answer");
        answer.payload.first() == Some(&1)
    }

    /// Lets motor 0 of the hub run with full power.
    fn drive(&mut self, address: u8) {
        assert!(self.obeys(ToMotor::SetPower { power: Control::MAX }.to(0), address));
        assert!(self.obeys(ToMotor::SetEnable { on: true }.to(0), address));
    }

    fn report(&mut self) -> ChainReport {
        let (answer, _) = self.ask(HubFunction::Chain, PARENT).expect("an answer");
        ChainReport::read(&mut Fields::new(&answer.payload)).expect("a report")
    }
}

const PARENT: u8 = 2;

#[test]
fn a_discovery_finds_the_parent_at_once_and_every_child_within_a_second() {
    let mut chain = Chain::new(&[PARENT, 1, 254, 130]);
    chain.send(Standard::Discovery, BROADCAST);
    let mut children: Vec<Packet> = chain.pass(600);
    let parent = children.remove(0);
    assert_eq!((parent.source, &*parent.payload), (PARENT, &[1][..]));
    let number = chain.number;
    assert!(children.iter().all(|packet| packet.reference == number && packet.id == DISCOVERY | 0x8000));
    assert_eq!(
        children.iter().map(|packet| (packet.source, packet.payload[0])).collect::<Vec<_>>(),
        [(1, 0), (130, 0), (254, 0)]
    );
    let report = chain.report();
    assert!(!report.discovering);
    assert_eq!(report.answering.iter().collect::<Vec<_>>(), [1, 130, 254]);
    assert_eq!(report.duplicate.iter().count(), 0);
}

#[test]
fn a_child_obeys_like_a_hub_on_the_line_and_stops_by_its_own_keep_alive() {
    let mut chain = Chain::new(&[PARENT, 3]);
    chain.drive(3);
    assert!(chain.is_enabled(3) && !chain.is_enabled(PARENT));
    // Packets to the parent do not keep the child alive.
    for _ in 0..26 {
        assert!(chain.obeys(Standard::KeepAlive, PARENT));
        chain.pass(99);
    }
    assert!(!chain.is_enabled(3));
    let (status, _) = chain.ask(Standard::Status { clear: false }, 3).expect("an answer");
    assert_eq!(status.payload[0] & 1, 1, "the keep-alive timer of the child has run out");
}

#[test]
fn the_parent_answers_within_two_milliseconds_whatever_its_child_does() {
    for fault in [
        None,
        Some(LineFault::Cut(1)),
        Some(LineFault::Babbles(1)),
        Some(LineFault::Late(1, 9)),
        Some(LineFault::Late(1, 60)),
    ] {
        let mut chain = Chain::new(&[PARENT, 3, 4]);
        chain.line.set_fault(fault);
        chain.send(Standard::Discovery, BROADCAST);
        chain.pass(3);
        let mut answers_of_other_child = 0;
        for _ in 0..100 {
            // The host sends to the child without waiting for its answer, and sends again in the next round.
            chain.send(Standard::Status { clear: false }, 3);
            let (_, ms) = chain.ask(Standard::KeepAlive, PARENT).expect("an answer");
            assert!(ms <= 2, "{fault:?}: {ms} ms");
            answers_of_other_child +=
                u32::from(chain.ask(Standard::KeepAlive, 4).is_some_and(|(_, ms)| ms <= 30));
            chain.pass(10);
        }
        if fault != Some(LineFault::Babbles(1)) {
            assert!(answers_of_other_child >= 99, "{fault:?}: {answers_of_other_child} of 100");
        }
        // The child answers again immediately after the end of the fault.
        chain.line.set_fault(None);
        chain.pass(100);
        assert!(chain.ask(Standard::KeepAlive, 3).is_some(), "{fault:?}");
    }
}

#[test]
fn a_stop_to_all_reaches_every_hub_within_fifty_milliseconds_also_beside_a_lost_child() {
    let mut chain = Chain::new(&[PARENT, 3, 4]);
    for address in [PARENT, 3, 4] {
        chain.drive(address);
    }
    chain.line.set_fault(Some(LineFault::Cut(1)));
    for _ in 0..8 {
        chain.send(Standard::KeepAlive, 3);
    }
    let stop = Request::from(Standard::FailSafe).packet(BROADCAST, 99, FAIL_SAFE);
    chain.host.write_all(&frame::encode(&stop)).expect("a queue");
    let answers = chain.pass(50);
    assert_eq!(answers.iter().map(|packet| packet.source).collect::<Vec<_>>(), [PARENT], "no child answers");
    assert!(!chain.is_enabled(PARENT));
    chain.pass(100);
    let (status, _) = chain.ask(Standard::Status { clear: false }, 4).expect("an answer");
    assert_eq!(status.payload[0] & 4, 4, "fail-safe");
    assert!(!chain.is_enabled(4));
}

#[test]
fn hubs_with_one_address_are_told() {
    for (addresses, clashing) in [(&[PARENT, 7, 7][..], 7), (&[PARENT, PARENT, 5], PARENT)] {
        let mut chain = Chain::new(addresses);
        chain.send(Standard::Discovery, BROADCAST);
        let found: Vec<u8> = chain.pass(600).iter().map(|packet| packet.source).collect();
        assert_eq!(chain.report().duplicate.iter().collect::<Vec<_>>(), [clashing], "{addresses:?}");
        assert!(!found.contains(&7), "{found:?}");
    }
    // The parent gets another address, and the child can be used.
    let mut chain = Chain::new(&[PARENT, PARENT]);
    assert!(chain.obeys(Standard::SetAddress { address: Address::new(9).expect("9") }, PARENT));
    assert!(chain.obeys(Standard::KeepAlive, PARENT) && chain.obeys(Standard::KeepAlive, 9));
}

/// Faults of the fault matrix in `docs/results` that a simulated hub can have.
enum Fault {
    Encoder(Encoder),
    /// The battery has this open-circuit voltage, V.
    Battery(f64),
    HostSilent,
}

/// Expected effect of a fault on a motor.
#[derive(Clone, Copy, Debug)]
enum Becomes {
    /// The motor turns as commanded.
    Works,
    /// The motor turns otherwise.
    Turns,
    /// The bridge opens within this time in ms.
    Opens(u64),
}

use Becomes::{Opens, Turns, Works};

struct Row {
    name: &'static str,
    fault: Fault,
    /// Expected effects on four motors: in open loop, and regulated to a speed, to a position, and to a speed against a
    /// load.
    motors: [Becomes; 4],
}

const fn row(name: &'static str, fault: Fault, motors: [Becomes; 4]) -> Row {
    Row { name, fault, motors }
}

const fn stuck(wire: EncoderWire, high: bool) -> Fault {
    Fault::Encoder(Encoder::Stuck { wire, high })
}

const fn glitches(per_second: u32) -> Fault {
    Fault::Encoder(Encoder::Glitches { per_second: NonZeroU32::new(per_second).expect("some") })
}

const SILENT: [Becomes; 4] = [Works, Opens(250), Opens(250), Opens(250)];
const SOME_LOST: [Becomes; 4] = [Works, Turns, Turns, Turns];

const ROWS: [Row; 16] = [
    row("encoder unplugged", Fault::Encoder(Encoder::Unplugged), SILENT),
    row("A low", stuck(EncoderWire::A, false), SILENT),
    row("A high", stuck(EncoderWire::A, true), SILENT),
    row("B low", stuck(EncoderWire::B, false), SILENT),
    row("B high", stuck(EncoderWire::B, true), SILENT),
    row(
        "A and B swapped",
        Fault::Encoder(Encoder::Reversed),
        [Works, Opens(2_300), Opens(2_300), Opens(400)],
    ),
    row("A loose", Fault::Encoder(Encoder::Loose { wire: EncoderWire::A }), SOME_LOST),
    row("B loose", Fault::Encoder(Encoder::Loose { wire: EncoderWire::B }), SOME_LOST),
    row(
        "one slot of 7 missing",
        Fault::Encoder(Encoder::MissingSlot { of: NonZeroU32::new(7).expect("some") }),
        SOME_LOST,
    ),
    row("20 glitches/s", glitches(20), [Works; 4]),
    row("200 glitches/s", glitches(200), [Works; 4]),
    row("19 V", Fault::Battery(19.0), [Turns, Works, Works, Works]),
    row("16 V", Fault::Battery(16.0), [Turns, Works, Works, Works]),
    row("6.5 V", Fault::Battery(6.5), [Turns, Works, Works, Works]),
    row("4.5 V", Fault::Battery(4.5), [Opens(165); 4]),
    row("host silent", Fault::HostSilent, [Opens(2_555); 4]),
];

/// Counts/s of motors that turn as commanded.
const SPEEDS: [RangeInclusive<i16>; 4] = [840..=950, 960..=1040, 940..=1060, 240..=360];

/// Time at which faults begin, in ms.
const BEGINS_MS: u64 = 1_500;

/// A parent and a child, of which one gets a fault of a row.
fn faulty_chain(row: &Row, in_parent: bool) -> Chain {
    let am60 = find("AM 60 A").and_then(|entry| entry.motor).expect("a motor").with_measured_rotor_inertia();
    let mut motors = vec![Motor::new(am60, Load::inertia(KgM2(0.004))); 4];
    let begins_s = BEGINS_MS as f64 * 1e-3;
    for motor in &mut motors {
        motor.torques.clear();
    }
    motors[3].torques = vec![Timed { at_s: 0.0, value: 0.8 }];
    let battery = Battery { emf: Volts(12.0), resistance: Ohms(0.05) };
    let mut scenario = Scenario::new("matrix", 10.0, battery, motors);
    let (mut sound, mut faulty) = (Interventions::default(), Interventions::default());
    // Both hubs have this scenario. For the parent, interventions replace values of the scenario.
    match row.fault {
        Fault::Encoder(encoder) if in_parent => {
            faulty.motors = [OnMotor { encoder: Some(encoder), ..OnMotor::default() }; 4];
        }
        Fault::Encoder(value) => {
            let encoder = vec![Timed { at_s: begins_s, value }];
            scenario.motors.iter_mut().for_each(|motor| motor.encoder.clone_from(&encoder));
            sound.motors = [OnMotor { encoder: Some(Encoder::Sound), ..OnMotor::default() }; 4];
            faulty = sound;
        }
        Fault::Battery(volts) if in_parent => faulty.emf_v = Some(volts),
        Fault::Battery(value) => {
            let steps = [(begins_s - 1e-3, 12.0), (begins_s, value)];
            scenario.emf_over_time = steps.map(|(at_s, value)| Timed { at_s, value }).to_vec();
            sound.emf_v = Some(12.0);
            faulty = sound;
        }
        Fault::HostSilent => (),
    }
    Chain::of(&[PARENT, CHILD], scenario, move |now, ms| *now = if ms < BEGINS_MS { sound } else { faulty })
}

/// The address of the child.
const CHILD: u8 = 3;

impl Chain {
    /// Starts four motors, each in another mode.
    fn start_modes(&mut self, address: u8) {
        let modes = [RunMode::Power, RunMode::Velocity, RunMode::Position, RunMode::Velocity];
        for ((motor, mode), cps) in (0..).zip(modes).zip([0, 1000, 1000, 300]) {
            let target = Target { counts: 1_000_000, tolerance: 10 };
            let mode = ChannelMode { mode, floats: false };
            let requests = [
                ToMotor::SetVelocity { cps },
                ToMotor::SetPosition { target },
                ToMotor::SetMode { mode },
                ToMotor::SetPower { power: Control::new(12_000) },
                ToMotor::SetVelocity { cps },
                ToMotor::SetEnable { on: true },
            ];
            for request in requests {
                // Set-points of other modes are refused.
                self.ask(request.to(motor), address).expect("an answer");
            }
        }
    }

    fn hub_report(&mut self, address: u8) -> HubReport {
        let (answer, _) = self.ask(HubFunction::Report, address).expect("an answer");
        HubReport::read(&mut Fields::new(&answer.payload)).expect("a report")
    }

    #[track_caller]
    fn turns_as_commanded(&mut self, address: u8, of: &str) {
        let report = self.hub_report(address);
        for (motor, speeds) in report.motors.iter().zip(&SPEEDS) {
            assert!(
                speeds.contains(&motor.velocity) && !motor.faults.any(),
                "{of}, hub {address}: {motor:?}"
            );
        }
    }
}

/// Applies a fault to one hub of a chain. Asserts that the motors of this hub do what the row expects, and that the
/// other hub is not disturbed.
fn judge(row: &Row, in_parent: bool) {
    let name = row.name;
    let mut chain = faulty_chain(row, in_parent);
    let (faulty, other) = if in_parent { (PARENT, CHILD) } else { (CHILD, PARENT) };
    [faulty, other].into_iter().for_each(|address| chain.start_modes(address));
    chain.pass((BEGINS_MS - chain.ms) as u32);
    [faulty, other].into_iter().for_each(|address| chain.turns_as_commanded(address, name));
    let last = row.motors.iter().map(|becomes| if let Opens(ms) = becomes { *ms } else { 0 }).max();
    let end = BEGINS_MS + last.unwrap_or_default().max(1_100);
    let mut open_since = [None; 4];
    let mut report = HubReport::default();
    while chain.ms < end {
        assert!(chain.obeys(Standard::KeepAlive, other), "{name}: hub {other} is silent");
        if matches!(row.fault, Fault::HostSilent) {
            chain.pass(100);
            continue;
        }
        report = chain.hub_report(faulty);
        for (since, motor) in open_since.iter_mut().zip(&report.motors) {
            *since = motor.regime.is_none().then(|| since.unwrap_or(chain.ms));
        }
        chain.pass(5);
    }
    chain.turns_as_commanded(other, name);
    if matches!(row.fault, Fault::HostSilent) {
        report = chain.hub_report(faulty);
        assert!(report.motors.iter().all(|motor| motor.regime.is_none() && !motor.enabled), "{report:?}");
        return;
    }
    for ((motor, becomes), (since, speeds)) in
        report.motors.iter().zip(row.motors).zip(open_since.into_iter().zip(&SPEEDS))
    {
        let as_expected = match becomes {
            Works => {
                since.is_none()
                    && !motor.faults.any()
                    && (faulty_encoder(row) || speeds.contains(&motor.velocity))
            }
            Turns => since.is_none() && !motor.faults.any(),
            Opens(within_ms) => since.is_some_and(|since| since - BEGINS_MS <= within_ms),
        };
        assert!(as_expected, "{name}, hub {faulty}: {becomes:?} expected, open since {since:?}: {motor:?}");
    }
}

/// True if the reported velocities are no measure of the motors' speeds.
const fn faulty_encoder(row: &Row) -> bool {
    matches!(row.fault, Fault::Encoder(_))
}

#[test]
fn each_hub_of_a_chain_ends_its_faults_as_in_the_matrix_and_leaves_the_other_alone() {
    for row in &ROWS {
        judge(row, true);
        judge(row, false);
    }
}
