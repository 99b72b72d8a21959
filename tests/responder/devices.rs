//! Servos, digital pins, analog inputs and I2C buses: what a board has, and what is refused.

use crate::host::{Answer, FULL, TestHost};
use motor_hub::board::{AnalogReading, AnalogReadings, Equipment, ServoPulse};
use motor_hub::devices::I2cTransfer;
use motor_hub::extension::HubFunction;
use motor_hub::protocol::answers::{I2cRead, I2cStatus, Status};
use motor_hub::protocol::payload::Text;
use motor_hub::supply::DrawStage;
use motor_hub::units::Millivolts;

const UNSUPPORTED: Answer = Answer::Nack(253);
const ACK: Answer = Answer::Ack(0);

fn text(bytes: &[u8]) -> Text {
    Text::from_slice(bytes).expect("short")
}

/// Requests that start a transfer on bus 2, and the transfer.
fn starts() -> [(u16, &'static [u8], I2cTransfer); 5] {
    let transfer = |write, read| I2cTransfer { address: 0x28, fast: false, write: text(write), read };
    [
        (37, &[2, 0x28, 9], transfer(&[9], 0)),
        (38, &[2, 0x28, 3, 7, 8, 9], transfer(&[7, 8, 9], 0)),
        (39, &[2, 0x28], transfer(&[], 1)),
        (40, &[2, 0x28, 100], transfer(&[], 100)),
        (52, &[2, 0x28, 2, 0x3D], transfer(&[0x3D], 2)),
    ]
}

#[test]
fn an_i2c_bus_answers_each_request_by_its_state() {
    for (function, payload, transfer) in starts() {
        let reads = transfer.read > 0;
        let (own, other) = if reads { (41, 42) } else { (42, 41) };
        let mut host = TestHost::settled();
        assert_eq!([host.call(41, &[2]), host.call(42, &[2])], [Answer::Nack(42), Answer::Nack(42)], "idle");
        assert_eq!(host.call(function, payload), ACK);
        // Before and after the task of the bus has taken the transfer.
        for taken in [false, true] {
            if taken {
                assert_eq!(host.responder.i2c[2].take_request().as_ref(), Some(&transfer), "{function}");
                assert_eq!(host.responder.i2c[2].take_request(), None);
            }
            for (start, payload, _) in starts() {
                assert_eq!(host.call(start, payload), Answer::Nack(40), "{function} {start} {taken}");
            }
            assert_eq!([host.call(41, &[2]), host.call(42, &[2])], [Answer::Nack(41), Answer::Nack(41)]);
            // The other buses are not concerned.
            assert_eq!(host.call(41, &[1]), Answer::Nack(42));
        }
        let bytes: Vec<u8> = (0..transfer.read).collect();
        let result = I2cRead { status: I2cStatus::default(), bytes: text(&bytes) };
        host.responder.i2c[2].done(result);
        let count = if reads { transfer.read } else { transfer.write.len() as u8 };
        // The result is kept, because an answer may be lost on the way.
        for _ in 0..2 {
            assert_eq!(host.call(other, &[2]), Answer::Nack(43), "{function}");
            let expected = [&[0, count][..], if reads { &bytes } else { &[] }].concat();
            assert_eq!(host.call(own, &[2]), Answer::Data(expected), "{function}");
        }
        // The next transfer drops the result, fetched or not.
        for (start, payload, transfer) in starts() {
            assert_eq!(host.call(start, payload), ACK);
            assert_eq!(host.responder.i2c[2].take_request(), Some(transfer));
            host.responder.i2c[2].done(I2cRead::default());
        }
    }
}

#[test]
fn a_transfer_with_an_error_has_a_status_and_no_bytes() {
    for status in [1, 2, 4, 8] {
        let mut host = TestHost::settled();
        for (start, poll) in [(&[2, 0x28, 1][..], 42), (&[2, 0x28, 4, 0][..], 41)] {
            host.do_all(&[(if poll == 42 { 37 } else { 52 }, start)]);
            host.responder.i2c[2].take_request().expect("a transfer");
            let status = I2cStatus { bits: status };
            host.responder.i2c[2].done(I2cRead { status, ..I2cRead::default() });
            assert_eq!(host.call(poll, &[2]), Answer::Data(vec![status.bits, 0]));
        }
    }
}

#[test]
fn the_speed_of_a_bus_is_read_back_and_counts_for_the_next_transfer_also_while_one_runs() {
    let mut host = TestHost::settled();
    let speeds = |host: &mut TestHost| [0, 1, 2, 3].map(|bus| host.call(47, &[bus]).data()[0]);
    assert_eq!(speeds(&mut host), [0; 4]);
    host.do_all(&[(39, &[2, 1]), (43, &[2, 1])]);
    assert_eq!(speeds(&mut host), [0, 0, 1, 0]);
    assert_eq!(host.responder.i2c[2].take_request().map(|transfer| transfer.fast), Some(false));
    host.responder.i2c[2].done(I2cRead::default());
    host.do_all(&[(39, &[2, 1])]);
    assert_eq!(host.responder.i2c[2].take_request().map(|transfer| transfer.fast), Some(true));
    host.do_all(&[(43, &[2, 0])]);
    assert_eq!(speeds(&mut host), [0; 4]);
}

#[test]
fn what_a_board_lacks_is_refused() {
    // The first request of each pair is to what the smaller board has, the second to what the board lacks.
    let small = Equipment { digital: 0b101, servos: 2, analog: 1, i2c: 1, ..Equipment::default() };
    let of_pins = [(3, 2, 1, &[0][..]), (4, 2, 1, &[]), (5, 2, 1, &[])];
    let of_servos =
        [(31, 1, 2, &[0, 9][..]), (32, 1, 2, &[]), (33, 1, 2, &[1, 1]), (34, 1, 2, &[]), (36, 1, 2, &[])];
    let of_i2c = [(43, 0, 1, &[1][..]), (47, 0, 1, &[]), (39, 0, 1, &[40])];
    let mut host = TestHost::settled();
    host.responder.outputs.equipment = small;
    for (function, has, lacks, rest) in of_pins.into_iter().chain(of_servos).chain(of_i2c) {
        let mut call = |number: u8| host.call(function, &[&[number], rest].concat());
        assert!(!matches!(call(has), Answer::Nack(_)), "{function}");
        assert_eq!(call(lacks), UNSUPPORTED, "{function}");
    }
    host.responder.outputs.equipment = Equipment::default();
    for channel in [0, 1, 2, 3, 4, 5, 6, 12, 14] {
        assert_eq!(host.call(7, &[channel, 0]), UNSUPPORTED, "{channel}");
    }
    host.responder.outputs.equipment = small;
    assert_eq!(host.call(6, &[]), Answer::Data(vec![0b101]));
    host.do_all(&[(3, &[0, 1]), (3, &[2, 1])]);
    assert_eq!(host.call(6, &[]), Answer::Nack(28));
}

#[test]
fn the_hub_says_what_its_board_has() {
    let mut host = TestHost::settled();
    assert_eq!(host.request(HubFunction::Equipment), Answer::Data(vec![0xFF, 6, 4, 4, 1, 1]));
    host.responder.outputs.equipment = Equipment { servos: 0, rail: false, ..FULL };
    assert_eq!(host.request(HubFunction::Equipment), Answer::Data(vec![0xFF, 0, 4, 4, 0, 1]));
}

#[test]
fn a_servo_needs_a_width_and_a_good_battery_and_has_a_period_of_20_ms() {
    let mut host = TestHost::settled();
    assert_eq!(host.call(32, &[5]), Answer::Data(vec![0x20, 0x4E]));
    assert_eq!(host.call(34, &[5]), Answer::Data(vec![0, 0]));
    assert_eq!(host.call(35, &[5, 1]), Answer::Nack(30));
    // A width alone enables nothing.
    host.do_all(&[(33, &[5, 0xDC, 5])]);
    assert_eq!(host.responder.outputs.new_servo_pulses(), None);
    for (millivolts, stage) in [(Some(6_900), DrawStage::Derated), (None, DrawStage::Full)] {
        host.set_battery(millivolts, stage);
        assert_eq!(host.call(35, &[5, 1]), Answer::Nack(31));
        host.do_all(&[(35, &[5, 0])]);
    }
    host.set_battery(Some(12_000), DrawStage::Full);
    host.do_all(&[(35, &[5, 1])]);
    let mut expected = [None; 6];
    expected[5] = Some(ServoPulse { period_us: 20_000, width_us: 1_500 });
    assert_eq!(host.responder.outputs.new_servo_pulses(), Some(expected));
    assert_eq!(host.responder.outputs.new_servo_pulses(), None, "nothing has changed");
}

#[test]
fn a_width_longer_than_its_period_is_stored_and_the_pulse_lasts_the_period() {
    let mut host = TestHost::settled();
    host.do_all(&[(33, &[0, 0xFF, 0xFF]), (31, &[0, 2, 0]), (35, &[0, 1])]);
    let width_us = |host: &mut TestHost| host.responder.outputs.new_servo_pulses().and_then(|all| all[0]);
    assert_eq!(width_us(&mut host), Some(ServoPulse { period_us: 2, width_us: 2 }));
    assert_eq!(host.call(34, &[0]), Answer::Data(vec![0xFF, 0xFF]));
    host.do_all(&[(31, &[0, 0xFF, 0xFF])]);
    assert_eq!(width_us(&mut host), Some(ServoPulse { period_us: 65_535, width_us: 65_535 }));
}

#[test]
fn fail_safe_silence_and_a_low_battery_end_the_pulses_and_keep_the_values() {
    let events: [fn(&mut TestHost); 3] = [
        |host| drop(host.ask(0x7F05, &[])),
        |host| host.wait_ms(2_500),
        |host| host.set_battery(Some(6_900), DrawStage::Derated),
    ];
    for event in events {
        let mut host = TestHost::settled();
        host.do_all(&[(31, &[3, 0x10, 0x27]), (33, &[3, 0xDC, 5]), (35, &[3, 1])]);
        assert!(host.responder.outputs.new_servo_pulses().is_some());
        event(&mut host);
        host.responder.tick(host.now, &host.snapshot);
        assert_eq!(host.responder.outputs.new_servo_pulses(), Some([None; 6]));
        let values = [31 + 1, 33 + 1, 35 + 1].map(|function| host.call(function, &[3]));
        assert_eq!(values, [vec![0x10, 0x27], vec![0xDC, 5], vec![0]].map(Answer::Data));
        // No event enables a servo again.
        host.set_battery(Some(12_000), DrawStage::Full);
        host.call(33, &[3, 1, 1]);
        assert_eq!(host.responder.outputs.new_servo_pulses(), None);
    }
}

#[test]
fn a_bus_voltage_above_the_largest_operating_voltage_is_no_low_battery_and_ends_no_pulses() {
    let mut host = TestHost::settled();
    host.do_all(&[(33, &[3, 0xDC, 5]), (35, &[3, 1])]);
    assert!(host.responder.outputs.new_servo_pulses().is_some());
    host.set_battery(Some(24_000), DrawStage::Overvoltage);
    host.responder.tick(host.now, &host.snapshot);
    assert_eq!(host.responder.outputs.new_servo_pulses(), None, "the pulses continue");
    let status = host.ask(0x7F03, &[0]).data();
    assert_eq!(status[0] & Status::BATTERY_LOW, 0, "{status:?}");
    // No further servo can be enabled.
    host.do_all(&[(33, &[4, 0xDC, 5])]);
    assert_eq!(host.call(35, &[4, 1]), Answer::Nack(31));
}

#[test]
fn a_low_battery_stays_low_while_its_voltage_is_unknown_and_one_that_was_good_does_not_become_low() {
    let mut host = TestHost::settled();
    let is_low = |host: &mut TestHost, millivolts, stage| {
        host.set_battery(millivolts, stage);
        host.responder.tick(host.now, &host.snapshot);
        host.ask(0x7F03, &[1]);
        host.ask(0x7F03, &[0]).data()[0] & Status::BATTERY_LOW != 0
    };
    for (millivolts, stage, expected) in [
        (None, DrawStage::Cutoff, false),
        (Some(12_000), DrawStage::Full, false),
        (None, DrawStage::Cutoff, false),
        (Some(5_900), DrawStage::Cutoff, true),
        // Below 5 V the voltage is unknown.
        (None, DrawStage::Cutoff, true),
        (Some(6_900), DrawStage::Derated, true),
        (None, DrawStage::Cutoff, true),
        (Some(12_000), DrawStage::Full, false),
    ] {
        assert_eq!(is_low(&mut host, millivolts, stage), expected, "{millivolts:?} mV");
    }
}

#[test]
fn an_analog_input_without_a_reading_is_refused_and_reads_0_in_bulk() {
    let mut host = TestHost::settled();
    let input = Some(AnalogReading { voltage: Millivolts::new(1_234), counts: 1_531 });
    let readings = AnalogReadings { inputs: [None, input, None, None], ..AnalogReadings::default() };
    host.responder.readings = readings;
    for channel in [0, 2, 3, 12, 14] {
        assert_eq!(host.call(7, &[channel, 0]), Answer::Nack(81), "{channel}");
    }
    assert_eq!(host.call(7, &[1, 0]), Answer::Data(vec![0xD2, 4]));
    assert_eq!(host.call(0, &[]).data()[26..34], [0, 0, 0xD2, 4, 0, 0, 0, 0]);
}

/// Numbers of requests and their answer, in each row of the table of all requests in `docs/reference/rev-protocol.md`.
fn rows_of_the_page() -> Vec<(Vec<u16>, &'static str)> {
    let page = include_str!("../../docs/reference/rev-protocol.md");
    let table = page.split("| tested in |\n|---|---|---|---|\n").nth(1).expect("the table of all requests");
    let row = |line: &'static str| {
        let [numbers, _, answer, _] =
            line.trim_matches('|').split('|').map(str::trim).collect::<Vec<_>>()[..]
        else {
            panic!("four columns: {line}")
        };
        let number = |text: &str| text.trim().parse::<u16>().expect("a number");
        let numbers = numbers.split(',').flat_map(|part| match part.split_once(" to ") {
            Some((first, last)) => (number(first)..=number(last)).collect::<Vec<_>>(),
            None => vec![number(part)],
        });
        (numbers.collect(), answer)
    };
    table.lines().take_while(|line| line.starts_with('|')).map(row).collect()
}

#[test]
fn the_table_of_all_requests_says_which_are_refused() {
    let rows = rows_of_the_page();
    let mut numbers: Vec<u16> = rows.iter().flat_map(|(numbers, _)| numbers.clone()).collect();
    numbers.sort_unstable();
    assert_eq!(numbers, (0..58).collect::<Vec<u16>>(), "each request is in one row");
    for (number, answer) in
        rows.iter().flat_map(|(numbers, answer)| numbers.iter().map(move |n| (*n, answer)))
    {
        // These bytes are in the range of each field.
        let refused_by = |equipment| {
            let mut host = TestHost::settled();
            host.responder.outputs.equipment = equipment;
            host.call(number, &[1; 20]) == UNSUPPORTED
        };
        assert_eq!(refused_by(FULL), answer.starts_with("253"), "{number} on a board with everything");
        assert_eq!(refused_by(Equipment::default()), answer.contains("253"), "{number} on a bare board");
    }
}
