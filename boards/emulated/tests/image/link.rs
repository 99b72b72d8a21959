//! The serial line of the host: run modes, answers, a saturated line, garbled words, a silent host.

use std::time::Duration;

use crate::common::{am60, board, booted, four_loads, ms, set_speeds, with_host};
use emulated::host_link::HostLink;
use emulated::{Bench, Hit};
use motor_hub::extension::{HubFunction, Request};
use motor_hub::protocol::Nack;
use motor_hub::protocol::answers::{Bulk, Reply};
use motor_hub::protocol::frame::OVERHEAD;
use motor_hub::protocol::requests::{BATTERY, ToHub};

/// Runs while the host sends a keep-alive every second.
fn run(bench: &mut Bench, host: &mut HostLink, time: Duration) {
    let end = bench.now() + time;
    while bench.now() < end {
        host.keep_alive(bench);
        bench.run_until(end.min(bench.now() + ms(1000)));
    }
}

#[test]
fn all_three_run_modes_at_once_with_different_loads() {
    let (mut bench, mut host) = with_host(four_loads());
    host.power(&mut bench, 0, 16_384);
    host.velocity(&mut bench, 1, 1500);
    host.velocity(&mut bench, 2, -700);
    host.position(&mut bench, 3, 2500, 10, 1500);
    run(&mut bench, &mut host, ms(4000));
    let speeds: Vec<f64> = (0..4).map(|motor| bench.look(motor).counts_per_second).collect();
    // Motor 0 gets half of the battery voltage, less the losses of the bridge.
    assert!((1200.0..1500.0).contains(&speeds[0]), "{speeds:?}");
    assert!((speeds[1] - 1500.0).abs() < 40.0, "{speeds:?}");
    assert!((speeds[2] + 700.0).abs() < 30.0, "{speeds:?}");
    assert!((bench.look(3).counts - 2500).abs() <= 10, "{:?}", bench.look(3));
    let bulk = host.bulk(&mut bench);
    assert_eq!(bulk.within_tolerance, [false, false, false, true]);
    bench.assert_sound();
}

#[test]
fn a_reversal_goes_over_braking_and_never_an_illegal_way() {
    let (mut bench, mut host) = with_host(four_loads());
    for round in 0..8usize {
        for motor in 0..4 {
            // Each motor slows down, reverses, and slows down again.
            let speed = [1800, 600, -1800, -600][(round + usize::from(motor)) % 4];
            host.velocity(&mut bench, motor, speed);
        }
        run(&mut bench, &mut host, ms(900));
    }
    let transitions = bench.transitions();
    for motor in 0..4 {
        let of = |ina: bool, inb: bool| {
            transitions
                .iter()
                .any(|t| t.motor == motor && (t.lines.ina, t.lines.inb) == (ina, inb) && !t.lines.open())
        };
        assert!(of(true, false) && of(false, true) && of(false, false), "motor {motor}: all three modes");
    }
    assert!(transitions.len() > 300, "{}", transitions.len());
    bench.assert_sound();
}

/// Longest time in s from the hub's reading of a value to the bench's reading of the answer. The answer of a bulk read
/// has 46 bytes, which take 1 ms, and the bench reads the answer within another millisecond.
const REPLY_S: f64 = 0.002;

#[test]
pub(crate) fn power_and_coast_reach_the_bridge_within_2_ms() {
    let (mut bench, mut host) = with_host(vec![am60(); 4]);
    let mut slowest = Duration::ZERO;
    host.power(&mut bench, 0, 8_000);
    // The commands come at different phases of the control tick: more power, braking, the other direction, disabled,
    // enabled.
    let words: [(u16, &[u8]); 5] = [
        (0x100F, &[0, 0, 0x40]),
        (0x100F, &[0, 0, 0]),
        (0x100F, &[0, 0, 0xC0]),
        (0x100A, &[0, 0]),
        (0x100A, &[0, 1]),
    ];
    for round in 0..60_u64 {
        let (id, payload) = words[round as usize % words.len()];
        bench.run(Duration::from_micros(20_000 + round * 7_919 % 50_000));
        let before = bench.transitions().len();
        let last = host.send_raw(&mut bench, id, payload);
        bench.run(ms(10));
        let changed = bench.transitions()[before..].iter().find(|t| t.motor == 0).map(|t| t.at - last);
        slowest = slowest.max(changed.expect("within 10 ms"));
        host.arrivals(&mut bench);
    }
    println!("slowest of 60: the bridge is switched {slowest:?} after the last byte");
    assert!(slowest <= ms(2), "{slowest:?}");
    bench.assert_sound();
}

#[test]
fn a_host_reads_the_positions_speeds_and_voltage_of_the_physics() {
    let (mut bench, mut host) = with_host(four_loads());
    for (motor, speed) in (0..).zip([500, 1000, -1500, 2000]) {
        host.velocity(&mut bench, motor, speed);
    }
    run(&mut bench, &mut host, ms(2000));
    let Bulk { encoders, velocities, .. } = host.bulk(&mut bench);
    for motor in 0..4 {
        let look = bench.look(motor);
        // A position is at most two milliseconds old when the hub puts it into the reply. The time of the reply is
        // added.
        let late = (look.counts_per_second * (0.002 + REPLY_S)).abs() as i64 + 1;
        assert!((look.counts - i64::from(encoders[motor])).abs() <= late, "{look:?}, {encoders:?}");
        let error = (look.counts_per_second - f64::from(velocities[motor])).abs();
        assert!(error <= 0.03 * look.counts_per_second.abs() + 5.0, "{look:?}, {velocities:?}");
    }
    let millivolts = f64::from(host.analog(&mut bench, BATTERY));
    assert!((millivolts - 1000.0 * bench.battery().0).abs() < 30.0, "{millivolts} mV");
    bench.assert_sound();
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn a_saturated_line_does_not_move_the_control_ticks() {
    let (mut bench, mut host) = with_host(vec![am60(); 4]);
    set_speeds(&mut bench, &mut host);
    let from = bench.now() + ms(300);
    let mut answers = 0;
    for _ in 0..300 {
        // Bulk reads follow each other without pauses: 11 bytes to the hub, 46 bytes from the hub.
        let requests: Vec<u8> = (0..10).flat_map(|_| host.packet(0x1000, &[])).collect();
        bench.send(&requests);
        bench.run(ms(10));
        answers += host.arrivals(&mut bench).len();
    }
    let transitions = bench.transitions();
    let of_bridge = transitions.iter().filter(|t| t.at > from && t.motor == 0);
    // Times after the last multiple of the control period of 50 ms.
    let offsets: Vec<u128> = of_bridge.map(|t| t.at.as_nanos() % 50_000_000).collect();
    let (least, most) = (offsets.iter().min().expect("ticks"), offsets.iter().max().expect("ticks"));
    println!("{answers} answers in 3 s; outputs change {least} to {most} ns after the grid's instant");
    assert!(answers > 2500, "{answers}");
    // A change of duty waits for the end of its PWM period of 50 us. A change of mode does not wait.
    assert!(most - least < 500_000, "{least} to {most} ns");
    let log = crate::common::log(&mut bench);
    assert!(log.contains("missed 0") && !log.contains("missed 1"), "{log}");
    bench.assert_sound();
}

/// Requests for every kind of answer: packet type and payload.
const COMMANDS: [(u16, &[u8]); 13] = [
    (0x1000, &[]),
    (0x7F04, &[]),
    (0x7F03, &[0]),
    (0x7F07, b"DEKA\0"),
    (0x7F0D, &[]),
    (0x1007, &[13, 0]),
    (0x1008, &[0, 1, 0]),
    (0x1011, &[1, 0xE8, 3]),
    (0x1035, &[2, 1]),
    (0x1025, &[0, 0x28, 0]),
    (0x102E, &[9; 101]),
    (0x1030, &[]),
    // The longest answer: the report of all motors.
    (0x4D14, &[]),
];

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn every_command_is_answered_within_5_ms_while_four_motors_are_regulated() {
    let (mut bench, mut host) = with_host(four_loads());
    set_speeds(&mut bench, &mut host);
    let (mut slowest, mut unanswered) = (Duration::ZERO, Vec::new());
    for round in 0..6000_u64 {
        let (kind, payload) = COMMANDS[round as usize % COMMANDS.len()];
        // The requests come at different phases of the control tick and of the log.
        bench.run(Duration::from_micros(round * 7919 % 1500));
        let last_byte = host.send_raw(&mut bench, kind, payload);
        let mut reply = None;
        bench.run_while(Duration::from_micros(500), ms(20), |bench| {
            reply = host.arrivals(bench).pop();
            reply.is_some()
        });
        match reply {
            Some(reply) => slowest = slowest.max(reply.at - last_byte),
            None => unanswered.push((round, last_byte)),
        }
    }
    println!("slowest of 6000 replies: its last byte {slowest:?} after the request's last");
    assert_eq!(unanswered, []);
    assert!(slowest <= ms(5), "{slowest:?}");
    bench.assert_sound();
}

/// The image's instructions that mask interrupts, `CPSID i`, or restore the mask, `MSR PRIMASK, Rn` (ARMv7-M ARM B5.2.1
/// and B5.2.3). Constants may look like them, but the core never runs them.
fn masking(bench: &mut Bench) -> [Vec<u64>; 2] {
    const FLASH: u64 = 0x0800_0000;
    let code = bench.symbols().iter().filter(|s| (FLASH..FLASH + 0x10_0000).contains(&s.address));
    let end = code.map(|s| s.address + s.size).max().expect("code");
    let words = bench.read_words(FLASH, usize::try_from((end - FLASH) / 4).expect("fits"));
    let halves: Vec<u16> = words.into_iter().flat_map(|word| [word as u16, (word >> 16) as u16]).collect();
    let pairs = (FLASH..).step_by(2).zip(halves.windows(2));
    let (mut masks, mut restores) = (Vec::new(), Vec::new());
    for (at, pair) in pairs {
        match pair {
            [0xB672, _] => masks.push(at),
            [0xF380..=0xF38F, 0x8810] => restores.push(at),
            _ => {}
        }
    }
    [masks, restores]
}

#[test]
fn interrupts_are_masked_for_less_than_a_byte_of_the_line_whatever_is_logged() {
    let mut bench = booted(four_loads());
    let [masks, restores] = masking(&mut bench);
    let log = ["_defmt_acquire", "_defmt_release"].map(|name| bench.address(name));
    bench.watch([masks.clone(), restores.clone(), log.to_vec()].concat());
    // A fault adds lines to the log.
    bench.set_encoder(1, emulated::Encoder::Unplugged);
    bench.press(true);
    bench.run(ms(2500));
    let (mut masked, mut longest, mut begun, mut lines, mut slowest) = (Vec::new(), 0, 0, 0, 0);
    for Hit { address: at, instruction_count: count, .. } in bench.take_hits() {
        if masks.contains(&at) {
            masked.push(count);
        } else if restores.contains(&at) {
            longest = longest.max(count - masked.pop().expect("a restored mask was set before"));
        } else {
            assert!(masked.is_empty(), "a line of the log is written with interrupts masked");
            if at == log[0] {
                begun = count;
            } else {
                slowest = slowest.max(count - begun);
                lines += 1;
            }
        }
    }
    println!("{lines} log lines of up to {slowest} instructions; interrupts masked for {longest} at most");
    assert!(lines >= 10 && longest > 0, "{lines}, {longest}");
    // A byte takes 21.7 us, which are 3645 cycles at 168 MHz. An instruction that misses the caches takes 6 cycles from
    // flash with 5 wait states. The test assumes that every instruction misses the caches.
    assert!(6 * longest < board().core_hz() / 46_080, "{longest}");
    assert!(crate::common::log(&mut bench).contains("encoder: Some(Stuck)"));
}

#[test]
pub(crate) fn digital_pins_are_read_and_driven() {
    let (mut bench, mut host) = with_host(vec![am60()]);
    // Nothing is connected to the pins, so all are pulled up.
    assert_eq!(host.bulk(&mut bench).digital, 0xFF);
    for pin in 0..8 {
        bench.connect_pin(pin, Some(false));
        assert_eq!(host.bulk(&mut bench).digital, !(1 << pin));
        bench.connect_pin(pin, None);
    }
    let ack = |reply| assert!(matches!(reply, Reply::Ack { .. }), "{reply:?}");
    ack(host.request_raw(&mut bench, 0x1003, &[1, 1]));
    assert_eq!((bench.pin_level(0), bench.pin_level(1)), (true, false), "an output is low");
    ack(host.request_raw(&mut bench, 0x1001, &[1, 1]));
    assert!(bench.pin_level(1));
    assert_eq!(host.request_raw(&mut bench, 0x1001, &[0, 1]), Reply::Nack(Nack(10)));
    assert_eq!(host.request_raw(&mut bench, 0x1005, &[1]), Reply::Nack(Nack(21)));
    ack(host.request_raw(&mut bench, 0x1001, &[1, 0]));
    assert!(!bench.pin_level(1));
    // When the host is silent, the hub makes the pin an input again.
    bench.run(ms(2_700));
    assert!(bench.pin_level(1));
    bench.assert_sound();
}

#[test]
fn replies_of_every_length_go_out_whole_and_leave_the_hub_listening() {
    let (mut bench, mut host) = with_host(vec![am60()]);
    let mut lengths = Vec::new();
    for _ in 0..3 {
        // The second answer is longer than the line's buffer of 128 bytes.
        for request in [Request::from(ToHub::Bulk), HubFunction::Report.into(), ToHub::VersionText.into()] {
            let reply = host.request(&mut bench, request);
            let Reply::Data(payload) = reply else { panic!("{reply:?}") };
            lengths.push(OVERHEAD + payload.len());
        }
        host.keep_alive(&mut bench);
    }
    println!("{lengths:?} bytes");
    assert!(lengths.iter().any(|length| *length > 128), "{lengths:?}");
    bench.assert_sound();
}

#[test]
fn a_wire_carries_the_level_of_one_digital_pin_to_the_other() {
    let (mut bench, mut host) = with_host(vec![am60()]);
    bench.wire_pins();
    assert_eq!(host.bulk(&mut bench).digital, 0xFF, "both are pulled up");
    for (from, to, is_bus_held) in [(0, 1, false), (1, 0, false), (0, 1, true)] {
        if is_bus_held {
            // The I2C bus 1 is on the port of both pins. No transfer gives the device the clocks that it waits for.
            bench.hold_sda(1, 200);
        }
        let mut order = |function: u16, payload: [u8; 2]| {
            let reply = host.request_raw(&mut bench, 0x1000 + function, &payload);
            assert!(matches!(reply, Reply::Ack { .. }), "{reply:?}");
            host.bulk(&mut bench).digital >> to & 1
        };
        assert_eq!(order(3, [from, 1]), 0, "an output is low");
        assert_eq!(order(1, [from, 1]), 1);
        assert_eq!(order(1, [from, 0]), 0);
        assert_eq!(order(3, [from, 0]), 1);
    }
    bench.assert_sound();
}
