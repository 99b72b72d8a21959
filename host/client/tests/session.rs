//! The client's session against the hub's own side of the protocol, in memory.
#![expect(clippy::unwrap_used, clippy::indexing_slicing, reason = "a failed access is a failed test")]

mod hub_support;

use hub_support::{ADDRESS, Hub, Memory, first, responder_at};
use motor_hub::braking::Winding;
use motor_hub::extension::report::MotorReport;
use motor_hub::extension::settings::{Group, MotorSettings, Values};
use motor_hub::extension::{FIRST_FUNCTION, HubFunction, INTERFACE, Request};
use motor_hub::motor::{self, Faults, ZeroPower};
use motor_hub::protocol::answers::{Bulk, Functions};
use motor_hub::protocol::motor::{Loop, LoopCoefficients, RunMode, Target, Terms, ToMotor};
use motor_hub::protocol::payload::{Field, Fields, Payload, Text};
use motor_hub::protocol::pins::{I2cAddress, I2cBus, ToPin};
use motor_hub::protocol::{Address, Colour, Nack, Packet, Reply, frame};
use motor_hub::record::Fault;
use motor_hub::regulator::Kind;
use motor_hub::store::{Found, Outcome};
use motor_hub::supply::BusState;
use motor_hub::units::{
    Acceleration, Coefficient, Control, CountsPerSecond, Micros, Milliamperes, Millivolts,
};
use motor_hub_client::kept_settings::ImportError;
use motor_hub_client::memory::MemoryHub;
use motor_hub_client::motor::{NO_SPEED_LIMIT_CPS, Setpoint};
use motor_hub_client::reasons::why_unsaved;
use motor_hub_client::session;
use motor_hub_client::{Error, Session};
use std::io::{self, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Time-out of requests, far longer than a hub in memory needs.
const TIMEOUT: Duration = Duration::from_secs(3);

fn session(line: Memory) -> Session {
    Session::new(line, Address::new(ADDRESS).unwrap(), TIMEOUT)
}

/// A session with a time-out of 60 ms, for tests in which the hub does not answer.
fn impatient(line: Memory) -> Session {
    Session::new(line, Address::new(ADDRESS).unwrap(), Duration::from_millis(60))
}

/// A frame with some bytes replaced, and a correct checksum.
fn with(frame: &[u8], bytes: &[(usize, u8)]) -> Vec<u8> {
    let mut frame = frame.to_vec();
    bytes.iter().for_each(|(at, byte)| frame[*at] = *byte);
    let sum = frame.pop().map(|_| frame.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)));
    frame.extend(sum);
    frame
}

#[test]
fn negative_targets_are_the_bytes_of_the_protocol() {
    let bytes = |hex: &str| -> Vec<u8> {
        hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
    };
    for (number, request, expected) in [
        (8, ToMotor::SetVelocity { cps: -300 }, "44 4b 0e 00 03 00 08 00 11 10 00 d4 fe 9b"),
        (
            9,
            ToMotor::SetPosition { target: Target { counts: -1000, tolerance: 25 } },
            "44 4b 12 00 03 00 09 00 13 10 00 18 fc ff ff 19 00 fb",
        ),
    ] {
        let request: Request = request.to(0);
        let frame = frame::encode(&request.packet(ADDRESS, number, request.id()));
        assert_eq!(frame.to_vec(), bytes(expected));
    }
}

const fn found(address: u8, parent: bool) -> session::Found {
    session::Found { address, parent, duplicate: false }
}

#[test]
fn discovery_finds_the_parent_among_all_hubs() {
    let mut hub = Hub::new();
    // A reply from address 9, as a child.
    hub.before = |reply| with(reply, &[(5, 9), (10, 0)]);
    let mut session = Session::with_parent(Memory::new(hub), TIMEOUT).unwrap();
    assert_eq!(session.address(), ADDRESS);
    let (child, parent) = (found(9, false), found(ADDRESS, true));
    assert_eq!(session.discover().unwrap(), [parent, child]);
}

#[test]
fn a_discovery_that_is_lost_is_sent_again() {
    let hub = Hub { deaf_for: 2, ..Hub::new() };
    let session = Session::with_parent(Memory::new(hub), Duration::from_millis(150)).unwrap();
    assert_eq!(session.address(), ADDRESS);
}

#[test]
fn a_timeout_of_any_length_is_limited_to_an_hour() {
    let mut session = Session::with_parent(Memory::new(Hub::new()), Duration::MAX).unwrap();
    assert_eq!(session.battery().unwrap(), Millivolts::new(12_345));
    session.set_timeout(Duration::MAX);
    assert_eq!(session.battery().unwrap(), Millivolts::new(12_345));
    assert_eq!(session.discover().unwrap(), [found(ADDRESS, true)]);
}

#[test]
fn a_lost_hub_hardly_delays_the_requests_to_other_hubs() {
    let mut session = session(Memory::of(vec![Hub::new(), Hub { responder: responder_at(9), ..Hub::new() }]));
    let begun = Instant::now();
    session.select_hub(Address::new(8).unwrap());
    assert!(matches!(session.fail_safe_lost(), Err(Error::Silent { address: 8 })));
    session.select_hub(Address::new(9).unwrap());
    session.fail_safe_lost().unwrap();
    assert!(begun.elapsed() < TIMEOUT / 2, "{:?}", begun.elapsed());
}

#[test]
fn a_second_parent_that_answers_later_is_found() {
    let second = Hub { responder: responder_at(9), delay: Duration::from_millis(20), ..Hub::new() };
    let refused =
        Session::with_parent(Memory::of(vec![Hub::new(), second]), TIMEOUT).map(|_| ()).unwrap_err();
    assert!(matches!(refused, Error::Parents { found: 2, .. }), "{refused}");
}

#[test]
fn every_setting_can_be_read_back() {
    let mut session = session(Memory::new(Hub::new()));
    session.set_mode(2, RunMode::Position, ZeroPower::Float).unwrap();
    session.set_power(2, Control::MIN).unwrap();
    session.set_velocity(2, -300).unwrap();
    session.set_position(2, -100_000, 25).unwrap();
    session.enable(2, true).unwrap();
    let motor = session.motor(2).unwrap();
    assert_eq!((motor.mode, motor.zero_power, motor.enabled), (RunMode::Position, ZeroPower::Float, true));
    assert_eq!((motor.power.get(), motor.velocity), (-32_767, -300));
    assert_eq!(motor.position, Target { counts: -100_000, tolerance: 25 });
    let colour = Colour { red: 1, green: 2, blue: 255 };
    session.set_led(colour).unwrap();
    assert_eq!(session.led().unwrap(), colour);
    assert_eq!(session.battery().unwrap(), Millivolts::new(12_345));
    session.fail_safe().unwrap();
    assert!(!session.enabled(2).unwrap());
    session.set_address(Address::new(77).unwrap()).unwrap();
    assert_eq!(session.status(true).unwrap().words(), ["device reset", "fail-safe"]);
    assert_eq!(session.status(true).unwrap().status, 0);
}

/// Gives an enabled motor one set-point after the other, and returns the different set-points that the motor receives.
fn received(setpoints: &[Setpoint]) -> Vec<motor::Setpoint> {
    let hub = Hub::new();
    let received = hub.setpoints.clone();
    let mut session = session(Memory::new(hub));
    session.set_setpoint(0, Setpoint::Power(Control::ZERO), ZeroPower::Brake).unwrap();
    session.enable(0, true).unwrap();
    received.lock().unwrap().clear();
    for setpoint in setpoints {
        session.set_setpoint(0, *setpoint, ZeroPower::Brake).unwrap();
    }
    let mut received: Vec<_> = received.lock().unwrap().iter().map(|(_, setpoint)| *setpoint).collect();
    received.dedup();
    received
}

#[test]
fn a_speed_limit_never_becomes_a_target_velocity() {
    let position = Setpoint::Position { counts: -5_000, tolerance: 10, speed_limit: 800 };
    for setpoint in received(&[Setpoint::Velocity(0), position, Setpoint::Velocity(-300), position]) {
        let is_allowed = match setpoint {
            motor::Setpoint::Velocity(cps) => [0, -300].map(CountsPerSecond::new).contains(&cps),
            motor::Setpoint::Position { target, .. } => target == -5_000,
            other => other == motor::Setpoint::ConstantPower(Control::ZERO),
        };
        assert!(is_allowed, "{setpoint:?}");
    }
}

#[test]
fn after_a_constant_current_no_earlier_target_comes_into_force() {
    let velocity = |cps| motor::Setpoint::Velocity(CountsPerSecond::new(cps));
    let current = |ma| motor::Setpoint::Current {
        current: Milliamperes::new(ma),
        speed_limit: CountsPerSecond::new(NO_SPEED_LIMIT_CPS.into()),
    };
    let power = |share| motor::Setpoint::ConstantPower(Control::new(share));
    let by_host = |ma| Setpoint::Current { ma, speed_limit: NO_SPEED_LIMIT_CPS };
    let after_velocity = received(&[
        Setpoint::Velocity(1_000),
        by_host(100),
        by_host(200),
        Setpoint::Power(Control::new(50)),
        by_host(300),
        Setpoint::Velocity(-7),
    ]);
    assert_eq!(
        after_velocity,
        [
            velocity(1_000),
            power(0),
            current(100),
            current(200),
            power(50),
            power(0),
            current(300),
            velocity(-7)
        ]
    );
}

#[test]
fn settings_that_an_older_hub_lacks_keep_their_defaults() {
    let mut hub = Hub::new();
    let expected = session(Memory::new(Hub::new())).settings(1).unwrap();
    // This hub reports a protection without its last field, which has two bytes.
    hub.before = |reply| {
        let id = Group::Protection.get_id() | 0x8000;
        if reply[8..10] != id.to_le_bytes() {
            return Vec::new();
        }
        let length = reply.len() - 2;
        with(&reply[..length], &[(2, length as u8)])
    };
    assert_eq!(session(Memory::new(hub)).settings(1).unwrap(), expected);
}

#[test]
fn bulk_input_may_lack_its_last_byte() {
    let mut older = [0; 34];
    older[17] = 0x80;
    let bulk = Bulk::read(&mut Fields::new(&older)).unwrap();
    assert_eq!((bulk.within_tolerance[3], bulk.attention), (true, None));
}

#[test]
fn other_replies_and_stray_bytes_before_a_reply_are_ignored() {
    type Before = fn(&[u8]) -> Vec<u8>;
    let before: [Before; 5] = [
        // Replies of another hub, and to another request.
        |reply| with(reply, &[(5, 9), (10, 0)]),
        |reply| with(reply, &[(7, 99), (10, 0)]),
        |_| vec![0x44],
        |_| vec![0, 0xFF, 0x44, 0x4B, 0x20, 0],
        // The first bytes of a reply that is never completed.
        |reply| reply[..8].to_vec(),
    ];
    for before in before {
        let mut session = session(Memory::new(Hub { before, ..Hub::new() }));
        assert_eq!(session.battery().unwrap(), Millivolts::new(12_345));
    }
}

#[test]
fn a_lost_packet_is_sent_again_unchanged_and_a_silent_hub_is_given_up() {
    impatient(Memory::new(Hub { deaf_for: 1, loses_reply: first(1, |_| true), ..Hub::new() }))
        .fail_safe()
        .unwrap();
    let mut session = impatient(Memory::new(Hub { deaf_for: 3, ..Hub::new() }));
    assert!(matches!(session.fail_safe(), Err(Error::Silent { address: ADDRESS })));
    session.fail_safe().unwrap();
}

#[test]
fn an_i2c_write_whose_acknowledgement_is_lost_is_sent_once() {
    let bus = I2cBus::new(0).unwrap();
    let address = I2cAddress::new(0x28).unwrap();
    let bytes = Text::from_slice(&[1, 2]).unwrap();
    let id = ToPin::WriteI2c { bus, address, bytes: bytes.clone() }.id();
    let writes = Arc::new(AtomicU32::new(0));
    let counted = Arc::clone(&writes);
    let loses_reply = Box::new(move |packet: &Packet| {
        packet.id == id && {
            counted.fetch_add(1, Ordering::Relaxed);
            true
        }
    });
    let mut session = impatient(Memory::new(Hub { loses_reply, ..Hub::new() }));
    let lost = session.write_i2c(bus, address, bytes).unwrap_err();
    assert_eq!(writes.load(Ordering::Relaxed), 1);
    let says = "hub 3 does not answer, but may have executed the request to write to device 0x28 on I2C bus 0: check the device before you repeat the request";
    assert_eq!(lost.to_string(), says);
    assert_eq!(session.battery().unwrap(), Millivolts::new(12_345), "the session goes on");
}

#[test]
fn a_new_address_holds_even_if_its_answer_is_lost() {
    let mut session = impatient(Memory::new(Hub { loses_reply: first(1, |_| true), ..Hub::new() }));
    session.set_address(Address::new(77).unwrap()).unwrap();
    assert_eq!(session.address(), 77);
    assert_eq!(session.battery().unwrap(), Millivolts::new(12_345));
}

#[test]
fn a_new_address_that_another_hub_has_is_no_success() {
    // The hub does not receive the request for the new address. Another hub answers at the new address.
    let change = |packet: &mut Packet| match (packet.id, packet.destination) {
        (0x7F06, _) => packet.destination = 99,
        (_, 77) => packet.destination = ADDRESS,
        _ => (),
    };
    let before = |reply: &[u8]| with(reply, &[(5, 77)]);
    let mut session = impatient(Memory::new(Hub { change, before, ..Hub::new() }));
    let failed = session.set_address(Address::new(77).unwrap());
    assert!(matches!(failed, Err(Error::Silent { address: ADDRESS })), "{failed:?}");
    assert_eq!(session.address(), ADDRESS);
}

#[test]
fn a_save_whose_acknowledgement_is_lost_is_accepted() {
    for what in [HubFunction::Save, HubFunction::Reset] {
        let id = what.id();
        let mut hub = Hub { loses_reply: first(1, move |packet| packet.id == id), ..Hub::new() };
        hub.responder.restore(Found::default());
        let report = impatient(Memory::new(hub)).store(what).unwrap();
        assert_eq!((report.outcome, report.number, report.is_busy), (Outcome::Done, 1, false));
    }
}

#[test]
fn a_load_puts_the_stored_settings_in_force() {
    let mut hub = Hub::new();
    hub.responder.restore(Found::default());
    let mut session = session(Memory::new(hub));
    let stored = session.settings(1).unwrap();
    session.store(HubFunction::Save).unwrap();
    let mut changed = stored;
    changed.motor.acceleration = Some(Acceleration::new(2_000).unwrap());
    session.set(1, Group::Motion, &changed).unwrap();
    assert_eq!(session.settings(1).unwrap(), changed);
    let report = session.store(HubFunction::Load).unwrap();
    assert_eq!((report.outcome, report.is_busy), (Outcome::Done, false));
    assert_eq!(session.settings(1).unwrap(), stored);
}

#[cfg(feature = "serial")]
#[test]
fn coefficients_that_were_set_since_the_last_control_tick_are_kept_too() {
    let server = hub_support::Server::start(Hub::new());
    let mut session = Session::open(&server.address).unwrap();
    let [p, i, d, f] = [1, 2, 3, 4].map(Coefficient::from_bits);
    let pidf = LoopCoefficients { p, i, d, f, terms: Terms::Pidf };
    session.set_coefficients(0, Loop::Velocity, pidf).unwrap();
    server.hub().snapshot.newest_command -= 1;
    let kept = std::thread::scope(|scope| {
        scope.spawn(|| {
            // The next control tick.
            std::thread::sleep(Duration::from_millis(100));
            let snapshot = &mut server.hub().snapshot;
            snapshot.newest_command += 1;
            snapshot.motors[0].regulator = Kind::Pid;
        });
        session.keep_settings(0).unwrap()
    });
    session.set_up(0, &kept.settings).unwrap();
    session.restore_settings(0, &kept).unwrap();
    assert_eq!(session.coefficients(0, Loop::Velocity).unwrap(), pidf);
}

#[test]
fn a_save_while_another_one_runs_is_refused() {
    let mut hub = Hub::new();
    hub.responder.restore(Found::default());
    let mut session = session(Memory::new(Hub { ends_accesses: false, ..hub }));
    session.command(HubFunction::Save).unwrap();
    let refused = session.begin_store(HubFunction::Save);
    assert!(matches!(refused, Err(Error::Refused { reason: Nack::STORE_BUSY, .. })), "{refused:?}");
    let report = session.stored().unwrap();
    assert_eq!(why_unsaved(&report), Some("the hub has not finished: ask again for its stored settings"));
}

#[cfg(feature = "serial")]
#[test]
fn a_save_of_a_hub_that_is_reset_meanwhile_has_failed() {
    let restarted = || {
        let mut hub = Hub { ends_accesses: false, ..Hub::new() };
        hub.responder.restore(Found::default());
        hub
    };
    let server = hub_support::Server::start(restarted());
    let mut session = Session::open(&server.address).unwrap();
    let save = session.begin_store(HubFunction::Save).unwrap();
    assert_eq!(save.result(&mut session).unwrap(), None, "the hub is saving");
    *server.hub() = restarted();
    let report = save.result(&mut session).unwrap().unwrap();
    let why = "the hub was reset before it had finished: look at its stored settings, and try again";
    assert_eq!(why_unsaved(&report), Some(why));
}

#[test]
fn settings_that_a_reset_of_the_hub_has_interrupted_are_not_in_force() {
    /// A hub whose clock begins again at 0 with the request of this number.
    #[derive(Debug)]
    struct ResetHub(MemoryHub, u32);

    impl Write for ResetHub {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.1 = self.1.saturating_sub(1);
            if self.1 == 0 {
                self.0.snapshot.at = Micros::default();
            }
            self.0.write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Read for ResetHub {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            self.0.read(bytes)
        }
    }

    // A clock that has wrapped from its largest value to 0 is no reset.
    let wraps_ms = u64::from(u32::MAX);
    for (ms, reset_at, is_lost) in [(60_000, 8, true), (60_000, u32::MAX, false), (wraps_ms, 8, false)] {
        let mut hub = MemoryHub::default();
        hub.snapshot.at = Micros::new(1_000 * ms);
        let mut session = Session::new(ResetHub(hub, reset_at), Address::DEFAULT, TIMEOUT);
        let settings = MotorSettings::new(motor::Settings::new(Winding::NEVEREST_60));
        let values = Values::of(Group::CurrentLimit, &settings);
        let applied = session.apply_settings(vec![(0, vec![values])], None);
        assert_eq!(matches!(applied, Err(ImportError::Reset)), is_lost, "{applied:?}");
    }
}

#[cfg(feature = "serial")]
#[test]
fn after_a_reset_a_session_uses_the_functions_of_the_new_firmware() {
    let mut former = Hub::running_for(60_000);
    // The former firmware lacks the newest functions.
    former.answer = |packet| {
        let is_query = packet.id == 0x7F07 && packet.payload.starts_with(INTERFACE);
        let mut older = Payload::new();
        let count = HubFunction::Report.id() - FIRST_FUNCTION + 1;
        Functions { first: FIRST_FUNCTION, count }.write(&mut older);
        is_query.then_some(Reply::Data(older))
    };
    let server = hub_support::Server::start(former);
    let mut session = Session::open(&server.address).unwrap();
    session.report().unwrap().unwrap();
    assert_eq!((session.equipment().unwrap(), session.resets()), (None, 0));
    *server.hub() = Hub::running_for(20);
    session.report().unwrap().unwrap();
    assert!(session.equipment().unwrap().is_some(), "the new firmware has this function");
    assert_eq!(session.resets(), 1);
}

#[test]
fn settings_for_more_motors_than_the_hub_has_change_none_of_them() {
    // The hub has two motors.
    let answer = |packet: &Packet| {
        let is_of_a_motor = [Group::SetUp.get_id(), Group::CurrentLimit.set_id()].contains(&packet.id);
        let is_refused = is_of_a_motor && packet.payload.first().is_some_and(|motor| *motor >= 2);
        is_refused.then_some(Reply::Nack(Nack(0)))
    };
    let mut session = session(Memory::new(Hub { answer, ..Hub::new() }));
    let before = session.settings(0).unwrap();
    let mut settings = MotorSettings::new(motor::Settings::new(Winding::NEVEREST_60));
    settings.motor.current_limit = std::num::NonZeroU16::new(2_000);
    let values = Values::of(Group::CurrentLimit, &settings);
    let refused = session.apply_settings(vec![(0, vec![values]), (2, vec![values])], None).unwrap_err();
    assert!(matches!(&refused, ImportError::Refused { part, .. } if part == "motor 2"), "{refused}");
    assert_eq!(session.settings(0).unwrap(), before, "{refused}");
}

#[test]
fn a_refusal_names_its_reason() {
    let mut session = session(Memory::new(Hub::new()));
    let refusal = |done: Result<(), Error>| match done {
        Err(Error::Refused { reason: Nack(code), .. }) => code,
        other => panic!("{other:?}"),
    };
    assert_eq!(refusal(session.enable(0, true)), 50);
    assert_eq!(refusal(session.reset_encoder(4)), 0);
    let text = session.enable(0, true).unwrap_err().to_string();
    assert_eq!(text, "the hub refuses to enable motor 0: no target set for this mode (NACK 50)");
    assert_eq!(Nack(3).to_string(), "parameter 3 (counted from 0) is out of range (NACK 3)");
    for code in 0..=255 {
        assert!(Nack(code).to_string().ends_with(&format!("(NACK {code})")));
    }
}

#[test]
fn each_motor_has_its_own_current_channel() {
    let mut hub = Hub::new();
    hub.snapshot.motors[2].measured = Some(Milliamperes::new(-1_500));
    let mut session = session(Memory::new(hub));
    assert_eq!(session.current(2).unwrap(), Milliamperes::new(1_500), "its magnitude");
    assert_eq!(session.battery().unwrap(), Millivolts::new(12_345));
}

#[cfg(feature = "serial")]
#[test]
fn a_hub_is_opened_by_where_it_is() {
    let server = hub_support::Server::start(Hub::new());
    let mut hub = Session::open(&server.address).unwrap();
    assert_eq!((hub.address(), hub.battery().unwrap()), (ADDRESS, Millivolts::new(12_345)));
    let nowhere = Session::open("/no/such/port").unwrap_err();
    assert!(nowhere.to_string().contains("No such file"), "{nowhere}");
}

#[test]
fn a_session_goes_on_with_another_hub_on_its_line() {
    let mut session = Session::new(Memory::new(Hub::new()), Address::DEFAULT, Duration::from_millis(60));
    assert!(session.battery().is_err(), "nobody is there");
    session.select_hub(Address::new(ADDRESS).unwrap());
    assert_eq!(session.battery().unwrap(), Millivolts::new(12_345));
}

#[test]
fn function_numbers_start_at_the_reported_packet_type() {
    let mut session = session(Memory::new(Hub { first: 0x1800, ..Hub::new() }));
    session.set_velocity(0, 5).unwrap();
    assert_eq!(session.motor(0).unwrap().velocity, 5);
}

#[test]
fn stale_input_is_read_only_after_a_lost_answer() {
    let line = Memory::new(Hub::new());
    let waits = line.empty_reads.clone();
    let mut session = session(line);
    session.bulk().unwrap();
    waits.store(0, Ordering::Relaxed);
    for _ in 0..50 {
        session.bulk().unwrap();
        session.battery().unwrap();
    }
    assert_eq!(waits.load(Ordering::Relaxed), 0);

    let line = Memory::new(Hub { loses_reply: first(1, |_| true), ..Hub::new() });
    let waits = line.empty_reads.clone();
    let mut session = impatient(line);
    session.keep_alive().unwrap();
    waits.store(0, Ordering::Relaxed);
    session.keep_alive().unwrap();
    assert_eq!(waits.load(Ordering::Relaxed), 1);
    session.keep_alive().unwrap();
    assert_eq!(waits.load(Ordering::Relaxed), 1);
}

#[test]
fn a_hub_that_does_not_report_its_bus_is_no_error() {
    let ours = session(Memory::new(Hub::new())).bus().unwrap();
    assert_eq!(ours.map(|bus| bus.state), Some(BusState::NoReading), "nothing is measured");
    let mut session = session(Memory::new(Hub { foreign: true, ..Hub::new() }));
    assert_eq!(session.bus().unwrap(), None);
    assert_eq!(session.battery().unwrap().get(), 12_345, "it goes on");
}

#[test]
fn a_hub_that_keeps_no_record_says_so() {
    let mut session = session(Memory::new(Hub::new()));
    assert!(session.recorded().unwrap().is_none());
    let refused = session.recorded_ticks(1).unwrap_err().to_string();
    assert!(refused.contains("refuses to report the ticks of entry 1"), "{refused}");
}

#[test]
fn what_all_motors_do_takes_one_exchange_and_a_foreign_hub_is_asked_once() {
    let hub = Hub::new();
    let requests = hub.requests.clone();
    let mut ours = session(Memory::new(hub));
    let report = ours.report().unwrap().unwrap();
    assert_eq!((report.battery.map(Millivolts::get), report.motors.len()), (Some(12_345), 4));
    let asked = requests.load(Ordering::Relaxed);
    for _ in 0..10 {
        ours.report().unwrap();
    }
    assert_eq!(requests.load(Ordering::Relaxed) - asked, 10, "one request each");

    let foreign = Hub { foreign: true, ..Hub::new() };
    let requests = foreign.requests.clone();
    let mut foreign = session(Memory::new(foreign));
    for _ in 0..10 {
        assert_eq!(foreign.report().unwrap(), None);
    }
    assert_eq!(requests.load(Ordering::Relaxed), 1);
}

#[test]
fn a_report_has_every_fault_of_a_motor() {
    for fault in Fault::ALL.iter().filter(|fault| fault.word().is_some()) {
        let mut faults = Faults::NONE;
        fault.add_to(&mut faults);
        let mut payload = Payload::new();
        MotorReport { faults, ..MotorReport::default() }.write(&mut payload);
        let read = MotorReport::read(&mut Fields::new(&payload)).unwrap();
        assert!(fault.is_in(read.faults), "FAULTS in src/extension/report.rs lacks {fault:?}");
    }
}
