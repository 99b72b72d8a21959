//! Every command in its good and out-of-range forms. Short and long forms are in `tests/protocol/round_trip.rs`.

use crate::host::{Answer, HUB, N, TestHost, frame_to};
use motor_hub::board::{AnalogReading, AnalogReadings};
use motor_hub::extension;
use motor_hub::protocol::answers::I2cRead;
use motor_hub::protocol::requests::{FIRST_FUNCTION, MOTOR_FUNCTIONS};
use motor_hub::units::{CountsPerSecond, Milliamperes, Millivolts};

/// A command: type, a good payload, and bad payloads with the number of their refusal.
struct Form {
    id: u16,
    good: &'static [u8],
    /// Length of the data response; `None` for an ACK.
    data: Option<usize>,
    bad: &'static [(&'static [u8], u8)],
}

const fn write(id: u16, good: &'static [u8], bad: &'static [(&[u8], u8)]) -> Form {
    Form { id, good, data: None, bad }
}

const fn read(id: u16, good: &'static [u8], data: usize, bad: &'static [(&[u8], u8)]) -> Form {
    Form { id, good, data: Some(data), bad }
}

const NO_MOTOR: &[(&[u8], u8)] = &[(&[4], 0), (&[255], 0)];
const NO_LOOP: &[(&[u8], u8)] = &[(&[4, 1], 0), (&[0, 0], 1), (&[0, 3], 1)];

const VERSION: &str = concat!("HW: 20, Maj: 1, Min: 8, Eng: 2, mh", env!("CARGO_PKG_VERSION"));

const F: u16 = FIRST_FUNCTION;
const OWN: u16 = extension::FIRST_FUNCTION;

/// The tested commands. [`host`] sets the hub up for them: motor 0 is in position mode with a target, digital pin 6
/// is an output, and servo 5 is configured. I2C bus 1 has read a byte, and bus 2 has written a byte.
const FORMS: &[Form] = &[
    read(0x7F03, &[0], 2, &[(&[2], 0), (&[255], 0)]),
    write(0x7F04, &[], &[]),
    write(0x7F05, &[], &[]),
    write(0x7F06, &[HUB], &[(&[0], 0), (&[255], 0)]),
    read(0x7F07, b"DEKA\0", 4, &[(b"SERVO_HUB\0", 255), (b"\0", 255), (b"DEK\0", 255), (b"deka\0", 255)]),
    write(0x7F0A, &[1, 2, 3], &[]),
    read(0x7F0B, &[], 3, &[]),
    write(0x7F0C, &[10, 1, 2, 3], &[(&[1, 2, 3], 3), (&[1, 2, 3, 4, 5, 6], 6)]),
    read(0x7F0D, &[], 64, &[]),
    write(0x7F0E, &[6, 3], &[(&[0, 0], 0), (&[13, 0], 0), (&[1, 4], 1)]),
    read(0x7F0F, &[], 1, &[]),
    read(F, &[], 35, &[]),
    write(F + 1, &[6, 1], &[(&[8, 1], 0), (&[0, 2], 1), (&[7, 1], 17)]),
    write(F + 2, &[255], &[]),
    write(F + 3, &[7, 1], &[(&[8, 1], 0), (&[0, 2], 1)]),
    read(F + 4, &[7], 1, &[(&[8], 0)]),
    read(F + 5, &[7], 1, &[(&[8], 0), (&[6], 26)]),
    read(F + 6, &[], 1, &[]),
    read(F + 7, &[13, 0], 2, &[(&[15, 0], 0), (&[13, 2], 1), (&[255, 255], 0)]),
    write(F + 8, &[3, 2, 1], &[(&[4, 0, 0], 0), (&[0, 3, 0], 1), (&[0, 10, 0], 1)]),
    read(F + 9, &[0], 2, NO_MOTOR),
    write(F + 10, &[0, 1], &[(&[4, 1], 0), (&[0, 2], 1)]),
    read(F + 11, &[0], 1, NO_MOTOR),
    write(F + 12, &[0, 255, 255], &[(&[4, 0, 0], 0)]),
    read(F + 13, &[0], 2, NO_MOTOR),
    write(F + 14, &[0], NO_MOTOR),
    write(F + 15, &[0, 0, 128], &[(&[4, 0, 0], 0)]),
    read(F + 16, &[0], 2, NO_MOTOR),
    write(F + 17, &[0, 0, 128], &[(&[4, 0, 0], 0)]),
    read(F + 18, &[0], 2, NO_MOTOR),
    write(F + 19, &[0, 0, 0, 0, 128, 255, 255], &[(&[4, 0, 0, 0, 0, 0, 0], 0)]),
    read(F + 20, &[0], 6, NO_MOTOR),
    read(F + 21, &[0], 1, &[(&[4], 0), (&[1], 51)]),
    read(F + 22, &[0], 4, NO_MOTOR),
    write(
        F + 23,
        &[0, 2, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0],
        &[(&[4, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], 0), (&[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], 1)],
    ),
    // Velocity has a feed-forward.
    read(F + 24, &[0, 2], 12, &[(&[4, 1], 0), (&[0, 0], 1), (&[0, 3], 1)]),
    write(F + 31, &[5, 2, 0], &[(&[6, 2, 0], 0), (&[5, 1, 0], 1), (&[5, 0, 0], 1)]),
    read(F + 32, &[5], 2, &[(&[6], 0)]),
    write(F + 33, &[5, 1, 0], &[(&[6, 1, 0], 0), (&[5, 0, 0], 1)]),
    read(F + 34, &[5], 2, &[(&[6], 0)]),
    write(F + 35, &[5, 1], &[(&[6, 1], 0), (&[5, 2], 1)]),
    read(F + 36, &[5], 1, &[(&[6], 0)]),
    write(F + 37, &[3, 127, 1], &[(&[4, 40, 1], 0), (&[3, 128, 1], 1)]),
    write(
        F + 38,
        &[3, 40, 2, 8, 9],
        &[(&[4, 40, 1, 1], 0), (&[3, 128, 1, 1], 1), (&[3, 40, 0], 2), (&[3, 40, 101], 2)],
    ),
    write(F + 39, &[3, 0], &[(&[4, 40], 0), (&[3, 128], 1)]),
    write(
        F + 40,
        &[3, 40, 100],
        &[(&[4, 40, 1], 0), (&[3, 128, 1], 1), (&[3, 40, 0], 2), (&[3, 40, 101], 2)],
    ),
    read(F + 41, &[1], 3, &[(&[4], 0), (&[0], 42), (&[2], 43)]),
    read(F + 42, &[2], 2, &[(&[4], 0), (&[0], 42), (&[1], 43)]),
    write(F + 43, &[3, 1], &[(&[4, 1], 0), (&[3, 2], 1)]),
    write(F + 44, &[1], &[(&[2], 0)]),
    read(F + 45, &[], 1, &[]),
    write(F + 46, b"\x03abc", &[(&[101], 0), (&[5, 1, 2], 1)]),
    read(F + 47, &[3], 1, NO_MOTOR),
    read(F + 48, &[], 1 + VERSION.len(), &[]),
    write(F + 49, &[1], &[(&[2], 0)]),
    read(F + 50, &[], 1, &[]),
    write(
        F + 51,
        &[0, 1, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0, 1],
        &[
            (&[4, 1, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0, 1], 0),
            (&[0, 3, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0, 1], 1),
            (&[0, 1, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0, 2], 6),
        ],
    ),
    write(
        F + 52,
        &[3, 40, 100, 255],
        &[(&[4, 40, 1, 0], 0), (&[3, 128, 1, 0], 1), (&[3, 40, 0, 0], 2), (&[3, 40, 101, 0], 2)],
    ),
    read(F + 53, &[0, 1], 17, NO_LOOP),
    read(F + 57, &[], 9, &[]),
    read(0x7F07, b"MOTOR_HUB\0", 4, &[]),
    write(
        OWN,
        &[3, 1, 0, 0, 0, 1, 0, 0, 0, 5, 255, 255, 1],
        &[
            (&[4, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1], 0),
            (&[0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1], 1),
            (&[0, 0, 0, 0, 2, 1, 0, 0, 0, 1, 0, 0, 1], 1),
            (&[0, 255, 255, 255, 255, 1, 0, 0, 0, 1, 0, 0, 1], 1),
            // Current cannot be linear in an unknown resistance.
            (&[0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1], 2),
            (&[0, 1, 0, 0, 0, 1, 0, 0, 0, 6, 0, 0, 1], 4),
            (&[0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 2], 6),
        ],
    ),
    read(OWN + 1, &[3], 12, NO_MOTOR),
];

/// A host at a hub on which all commands of [`FORMS`] can be tried.
fn host() -> TestHost {
    let mut host = TestHost::settled();
    host.do_all(&[(8, &[0, 2, 0]), (19, &[0, 1, 0, 0, 0, 5, 0]), (8, &[1, 1, 0]), (3, &[6, 1])]);
    host.do_all(&[(33, &[5, 220, 5]), (39, &[1, 40]), (37, &[2, 40, 9])]);
    for (bus, bytes) in [(1, &[7][..]), (2, &[])] {
        host.responder.i2c[bus].take_request().expect("a transfer");
        let bytes = bytes.iter().copied().collect();
        host.responder.i2c[bus].done(I2cRead { bytes, ..I2cRead::default() });
    }
    host.new_commands();
    host
}

/// All values that can be read back.
fn everything(host: &mut TestHost) -> Vec<Answer> {
    let mut all: Vec<_> = [0x7F0B, 0x7F0D, F, F + 45, F + 50].map(|id| host.ask(id, &[])).into();
    all.push(host.ask(0x7F03, &[0]));
    for index in 0..8 {
        all.extend([4, 5].map(|function| host.call(function, &[index])));
        for function in [9, 11, 13, 16, 18, 20, 21, 22, 32, 34, 36, 41, 42, 47] {
            all.push(host.call(function, &[index]));
        }
        all.extend([1, 2].map(|of| host.call(53, &[index, of])));
        all.push(host.ask(OWN + 1, &[index]));
    }
    all
}

#[test]
fn good_forms_are_answered() {
    for form in FORMS {
        let said = host().ask(form.id, form.good);
        match form.data {
            Some(length) => {
                assert!(matches!(&said, Answer::Data(d) if d.len() == length), "{:#06x} {said:?}", form.id)
            }
            None => assert_eq!(said, Answer::Ack(u8::from(form.id == 0x7F05)), "{:#06x}", form.id),
        }
    }
}

#[test]
fn values_out_of_range_are_refused_with_their_field_and_change_nothing() {
    for form in FORMS {
        let mut host = host();
        let before = everything(&mut host);
        for (payload, code) in form.bad {
            assert_eq!(host.ask(form.id, payload), Answer::Nack(*code), "{:#06x} {payload:?}", form.id);
        }
        assert_eq!(everything(&mut host), before, "{:#06x}", form.id);
        assert!(host.new_commands().is_empty());
    }
}

#[test]
fn every_channel_of_the_converter_is_answered_in_its_unit_and_raw() {
    let mut host = host();
    let current = |ma| Milliamperes::new(ma);
    for (motor, ma) in [3_000, -2_000, 90_000, -90_000].into_iter().enumerate() {
        host.snapshot.motors[motor].current = current(ma);
    }
    host.snapshot.motors[3].measured = Some(current(1_234));
    let input = |mv, counts| Some(AnalogReading { voltage: Millivolts::new(mv), counts });
    host.responder.readings = AnalogReadings {
        inputs: [input(0, 0), input(1_650, 2_048), input(3_300, 4_095), input(40_000, 5)],
        rail: Some(Millivolts::new(5_016)),
        temperature_decidegrees: Some(-123),
        supply_currents: Some([0, 12, 40_000].map(|ma| Some(Milliamperes::new(ma)))),
    };
    // Channels in their order: the analog inputs, the currents of the supplies and of the battery, the currents of the
    // motors, the 5 V rail, the battery, and the temperature. Values above 32 767 saturate.
    let of_8 = |value: i16| (value, value / 8);
    let inputs = [(0, 0), (1_650, 2_048), (3_300, 4_095), (i16::MAX, 5)];
    let others = [0, 12, i16::MAX, i16::MAX, 3_000, 2_000, i16::MAX, 1_234, 5_016, 12_345, -123].map(of_8);
    for (channel, (value, counts)) in (0..15).zip(inputs.into_iter().chain(others)) {
        for (raw, expected) in [(0, value), (1, counts)] {
            let said = host.call(7, &[channel, raw]);
            assert_eq!(said, Answer::Data(expected.to_le_bytes().to_vec()), "{channel} {raw}");
        }
    }
    // At standstill winding and bridge draw I²R / V from the battery. A turning motor that is shorted all the time
    // returns nothing. A motor that is shorted half of the time returns half of its current.
    let resistance = 3.3 + 0.002 * f64::from(crate::host::settings().bridge.switch_mohm());
    let drawn = |host: &mut TestHost, ma: i32, cps: i32| {
        for motor in &mut host.snapshot.motors {
            (motor.current, motor.measured, motor.velocity) = (current(0), None, CountsPerSecond::ZERO);
        }
        let motor = &mut host.snapshot.motors[2];
        (motor.current, motor.velocity) = (current(ma), CountsPerSecond::new(cps));
        let said = host.call(7, &[7, 0]).data();
        f64::from(i16::from_le_bytes([said[0], said[1]]))
    };
    let at_rest = 1e3 * 4.0 * resistance / 12.345;
    assert!(
        (drawn(&mut host, 2_000, 0) - at_rest).abs() < 2.0
            && (drawn(&mut host, -2_000, 0) - at_rest).abs() < 2.0
    );
    // 3.987 mV s/count.
    let emf = 3.986_8e-3 * 1_500.0;
    let short = emf / resistance;
    assert!(drawn(&mut host, (-1e3 * short) as i32, 1_500).abs() < 2.0);
    let half = -1e3 * 0.5 * short * (emf - 0.5 * short * resistance) / 12.345;
    assert!((drawn(&mut host, (-500.0 * short) as i32, 1_500) - half).abs() < 2.0);
}

#[test]
fn a_supply_current_without_a_reading_differs_from_one_that_the_board_does_not_measure() {
    let mut host = host();
    host.responder.readings.supply_currents = Some([None, Some(Milliamperes::new(12)), None]);
    for (channel, answer) in [(4, Answer::Nack(81)), (5, Answer::Data(vec![12, 0])), (6, Answer::Nack(81))] {
        assert_eq!(host.call(7, &[channel, 0]), answer, "{channel}");
    }
    host.responder.readings.supply_currents = None;
    assert_eq!(host.call(7, &[4, 0]), Answer::Nack(253));
}

#[test]
fn an_input_without_a_connection_is_high() {
    let mut host = TestHost::settled();
    let bulk = |host: &mut TestHost| host.call(0, &[]).data()[0];
    assert_eq!(host.call(6, &[]), Answer::Data(vec![0xFF]));
    assert_eq!(bulk(&mut host), 0xFF);
    // A touch sensor pulls pin 2 low. Pin 7 is an output.
    host.responder.outputs.sensed = 0b1111_1011;
    host.do_all(&[(3, &[7, 1])]);
    for pin in 0..7 {
        assert_eq!(host.call(5, &[pin]), Answer::Data(vec![u8::from(pin != 2)]), "{pin}");
    }
    assert_eq!(host.call(6, &[]), Answer::Data(vec![0b0111_1011]));
    assert_eq!(bulk(&mut host), 0b0111_1011);
}

#[test]
fn pins_are_refused_by_their_direction() {
    let mut host = TestHost::settled();
    let driven_and_levels = |host: &TestHost| [host.responder.outputs.driven, host.responder.outputs.levels];
    assert_eq!(host.call(2, &[0xFF]), Answer::Nack(18), "no output");
    for pin in 0..8 {
        assert_eq!(host.call(1, &[pin, 1]), Answer::Nack(10 + pin));
    }
    assert_eq!(driven_and_levels(&host), [0, 0]);
    for pin in 0..8 {
        host.do_all(&[(3, &[pin, 1]), (1, &[pin, 1])]);
        assert_eq!(host.call(5, &[pin]), Answer::Nack(20 + pin));
        assert_eq!(
            host.call(6, &[]),
            if pin < 7 { Answer::Data(vec![0xFE << pin]) } else { Answer::Nack(28) }
        );
    }
    host.do_all(&[(2, &[0b1010_0101])]);
    assert_eq!(driven_and_levels(&host), [0xFF, 0b1010_0101]);
    // An input is released, and the pin is low when it becomes an output again.
    host.do_all(&[(3, &[0, 0]), (2, &[0xFF]), (3, &[0, 1])]);
    assert_eq!(driven_and_levels(&host), [0xFF, 0xFE]);
}

#[test]
fn fail_safe_releases_outputs_until_they_are_set_again() {
    let mut host = TestHost::settled();
    host.do_all(&[(3, &[0, 1]), (3, &[1, 1]), (1, &[1, 1])]);
    host.ask(0x7F05, &[]);
    assert_eq!(host.responder.outputs.driven, 0);
    assert_eq!([host.call(4, &[1]), host.call(4, &[2])], [Answer::Data(vec![1]), Answer::Data(vec![0])]);
    host.do_all(&[(1, &[0, 1])]);
    assert_eq!((host.responder.outputs.driven, host.responder.outputs.levels), (1, 1));
    // A pin that becomes an output again is low.
    host.do_all(&[(3, &[1, 1])]);
    assert_eq!((host.responder.outputs.driven, host.responder.outputs.levels), (3, 1));
}

#[test]
fn every_value_but_0_selects_floating_at_zero() {
    let mut host = host();
    for (word, floats) in [(0, 0), (1, 1), (2, 1), (255, 1)] {
        host.do_all(&[(8, &[1, 0, word])]);
        assert_eq!(host.call(9, &[1]), Answer::Data(vec![0, floats]), "{word}");
    }
}

#[test]
fn an_unknown_command_is_refused_as_unknown() {
    let behind = [F + MOTOR_FUNCTIONS.count, OWN - 1, OWN + extension::FUNCTIONS.count];
    // Only firmware 0.1.0 has function 19 of the extension.
    let others = [0, 0x0FFF, OWN + 19, 0x7F00, 0x7F01, 0x7F02, 0x7F08, 0x7F09, 0x7F10, 0x8000, 0xFFFF];
    for id in others.into_iter().chain(behind) {
        assert_eq!(host().ask(id, &[0; 20]), Answer::Nack(255), "{id:#06x}");
    }
}

#[test]
fn each_motors_values_read_back_as_they_were_set() {
    // Request that sets a value, request that reads the value, the first bytes of both, and the value. Coefficients are
    // kept by motor and by mode.
    let values = |motor: u8| {
        let coefficients =
            |of: u8| [&[1, 2, 3, 4].map(|n| [n, motor, of, 0x7F]).concat()[..], &[of % 2]].concat();
        [
            (8, 9, vec![motor], vec![motor % 3, motor % 2]),
            (12, 13, vec![motor], vec![1, motor]),
            (15, 16, vec![motor], vec![2, motor]),
            (17, 18, vec![motor], vec![3, 0x80 + motor]),
            (19, 20, vec![motor], vec![4, 0, 0, 0xF0 + motor, 5, motor]),
            (51, 53, vec![motor, 1], coefficients(1)),
            (51, 53, vec![motor, 2], coefficients(2)),
        ]
    };
    let mut host = TestHost::settled();
    for (set, _, of, value) in (0..N as u8).flat_map(values) {
        host.do_all(&[(set, &[of, value].concat())]);
    }
    for (_, get, of, value) in (0..N as u8).flat_map(values) {
        assert_eq!(host.call(get, &of), Answer::Data(value), "{get} {of:?}");
    }
}

#[test]
fn coefficients_without_feed_forward_read_back_as_legacy() {
    let mut host = TestHost::settled();
    let pid = [1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0];
    let with_f = [&[0, 1][..], &[0; 12], &[4, 0, 0, 0], &[1]].concat();
    assert_eq!(host.call(51, &with_f), Answer::Ack(0));
    assert_eq!(host.call(24, &[0, 1]), Answer::Nack(2), "there is a feed-forward to lose");
    assert_eq!(host.call(23, &[&[0, 1][..], &pid, &[9; 5]].concat()), Answer::Ack(0));
    assert_eq!(host.call(24, &[0, 1]), Answer::Data(pid.to_vec()));
    assert_eq!(host.call(53, &[0, 1]), Answer::Data([&pid[..], &[0; 5]].concat()));
    assert_eq!(host.call(53, &[0, 2]).data()[16], 1, "the other mode keeps its terms");
}

#[test]
fn the_version_is_in_the_form_that_hosts_parse() {
    let mut host = TestHost::settled();
    let text = host.call(48, &[]).data();
    // Hosts have room for 39 bytes. The text after the numbers is specific to this firmware.
    assert!(text[1..].starts_with(b"HW: 20, Maj: 1, Min: 8, Eng: 2, mh0.") && text.len() <= 40);
    assert_eq!(text[1..], *VERSION.as_bytes());
    assert_eq!(usize::from(text[0]), text.len() - 1);
    assert_eq!(host.call(57, &[]), Answer::Data(vec![2, 8, 1, 0, 2, 0x53, 0x11, 0x31, 0]));
}

#[test]
fn a_new_address_is_in_force_from_the_next_packet_on() {
    let mut host = TestHost::settled();
    let reply = host.send(&frame_to(HUB, 9, 0x7F06, &[77]));
    assert_eq!(reply[0][5], HUB, "acknowledged from the old address");
    assert!(host.send(&frame_to(HUB, 10, 0x7F04, &[])).is_empty());
    assert_eq!(host.send(&frame_to(77, 10, 0x7F04, &[]))[0][5], 77);
    assert_eq!(host.send(&frame_to(255, 11, 0x7F0F, &[]))[0][5], 77, "discovery");
    assert_eq!(host.responder.address().get(), 77);
}

#[test]
fn packets_to_other_hubs_and_broadcasts_but_discovery_and_fail_safe_are_ignored() {
    let mut host = TestHost::settled();
    let others = (0..=255).filter(|address| *address != HUB);
    for address in others {
        assert!(host.send(&frame_to(address, 1, 0x7F04, &[])).is_empty());
        if address != 255 {
            assert!(host.send(&frame_to(address, 1, 0x7F05, &[])).is_empty());
        }
        let heard = host.send(&frame_to(address, 1, 0x7F0F, &[])).len();
        assert_eq!(heard, usize::from(address == 255));
    }
    assert!(host.new_commands().is_empty());
}

#[test]
fn two_requests_with_one_number_are_both_executed() {
    let mut host = TestHost::settled();
    for power in [1, 2] {
        host.number = 255;
        assert_eq!(host.call(15, &[0, power, 0]), Answer::Ack(0));
    }
    host.number = 255;
    assert_eq!(host.call(16, &[0]), Answer::Data(vec![2, 0]));
}
