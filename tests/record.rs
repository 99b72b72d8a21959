//! The record of events survives a reset at any byte. Other contents of the memory are no record.
use motor_hub::bridge::{Drive, Mode};
use motor_hub::hub::Snapshot;
use motor_hub::motor::EncoderFault;
use motor_hub::motor::{Faults, Report, Setpoint};
use motor_hub::record::{Fault, HEADS, Head, PAGES, Record, SIZE, TICKS, Tick};
use motor_hub::units::{CountsPerSecond, Duty, Micros, Millivolts, Voltage};
use proptest::prelude::*;
use std::collections::BTreeSet;
use std::ops::Range;

type Memory = [u8; SIZE];

const DRIVE: Drive = Drive { mode: Mode::Cw98, duty: Duty::from_bits(0x3000) };

/// Tick `tick` of four motors that turn, every 50 ms.
fn turning(tick: u32) -> Snapshot<4> {
    let mut snapshot = Snapshot::INITIAL;
    snapshot.tick = tick;
    snapshot.at = Micros::new(50_000 * u64::from(tick));
    snapshot.battery = Some(Millivolts::new(12_000));
    for (motor, report) in (0..).zip(&mut snapshot.motors) {
        *report = Report {
            setpoint: Setpoint::Velocity(CountsPerSecond::new(1000)),
            position: 50 * tick as i32,
            velocity: CountsPerSecond::new(1000 + motor),
            voltage: Voltage::from_volts(3.0 + 0.125 * motor as f32),
            drive: DRIVE,
            ..Report::INITIAL
        };
    }
    snapshot
}

fn with_fault(mut snapshot: Snapshot<4>, motor: usize, faults: Faults) -> Snapshot<4> {
    snapshot.motors[motor].faults = faults;
    snapshot.motors[motor].drive = Drive::COAST;
    snapshot
}

const STUCK: Faults = Faults { encoder: Some(EncoderFault::Stuck), ..Report::INITIAL.faults };
const BRIDGE: Faults = Faults { bridge: true, ..Report::INITIAL.faults };
const NO_BATTERY: Faults = Faults { battery_unknown: true, ..Report::INITIAL.faults };

fn heads(memory: &Memory, cause: Fault) -> Vec<Head> {
    Record::open(&mut memory.clone(), cause).0.heads().collect()
}

/// Records this number of ticks.
fn run(record: &mut Record<'_>, ticks: u32) {
    (1..=ticks).for_each(|tick| record.tick(&turning(tick)));
}

#[test]
fn memory_as_it_is_after_power_on_is_an_empty_record() {
    for memory in [[0; SIZE], [0xFF; SIZE], core::array::from_fn(|at| ((at * 151) >> 3) as u8)] {
        assert_eq!(heads(&memory, Fault::PowerOn), []);
    }
}

#[test]
fn a_watchdog_reset_leaves_an_entry_with_the_ticks_of_the_driven_motor() {
    let mut memory = [0; SIZE];
    let (mut record, _) = Record::open(&mut memory, Fault::PowerOn);
    for tick in 1..=100 {
        let mut snapshot = turning(tick);
        for motor in [0, 1, 3] {
            snapshot.motors[motor].drive = Drive::COAST;
        }
        record.tick(&snapshot);
    }
    let (record, _) = Record::open(&mut memory, Fault::Watchdog);
    let all: Vec<_> = record.heads().collect();
    let expected = Head {
        number: 1,
        fault: Fault::Watchdog,
        times: 1,
        run: 1,
        // The last tick was at 5 s; time is kept in steps of 1.024 ms.
        uptime_ms: 4_999,
        battery: Some(Millivolts::new(12_000)),
        motor: Some(2),
        drive: DRIVE,
        detail: [0; 2],
        ticks: 64,
    };
    assert_eq!(all, [expected]);
    let ticks: Vec<Tick> = record.ticks(1).unwrap().collect();
    let positions: Vec<u16> = ticks.iter().map(|tick| tick.position).collect();
    assert_eq!(positions, (37..=100).map(|tick| 50 * tick).collect::<Vec<u16>>());
    let last = Tick { position: 5000, velocity: 1002, millivolts: 3_250, drive: DRIVE };
    assert_eq!(ticks[63], last);
    assert_eq!(record.run(), 2);
}

#[test]
fn a_crash_report_replaces_the_reset_cause_once() {
    let mut memory = [0; SIZE];
    let (mut record, mut crash_report) = Record::open(&mut memory, Fault::PowerOn);
    run(&mut record, 3);
    crash_report.store(Fault::HardFault, [0x0800_1234, 0x0800_5679]);
    let (mut record, _) = Record::open(&mut memory, Fault::Watchdog);
    run(&mut record, 3);
    let faults: Vec<_> = heads(&memory, Fault::ResetPin).iter().map(|h| (h.fault, h.detail, h.run)).collect();
    assert_eq!(faults, [(Fault::ResetPin, [0; 2], 2), (Fault::HardFault, [0x0800_1234, 0x0800_5679], 1)]);
}

#[test]
fn a_run_that_ended_before_its_first_tick_has_no_motor_and_no_ticks() {
    let mut memory = [0; SIZE];
    run(&mut Record::open(&mut memory, Fault::PowerOn).0, 100);
    let _ = Record::open(&mut memory, Fault::SoftwareReset);
    let (record, _) = Record::open(&mut memory, Fault::Watchdog);
    let newest = record.heads().next().unwrap();
    assert_eq!((newest.fault, newest.motor, newest.ticks, newest.uptime_ms), (Fault::Watchdog, None, 0, 0));
    assert!(record.ticks(newest.number).is_none());
}

#[test]
fn a_hub_that_fails_again_and_again_as_it_starts_keeps_what_came_before() {
    let mut memory = [0; SIZE];
    run(&mut Record::open(&mut memory, Fault::PowerOn).0, 20);
    let _ = Record::open(&mut memory, Fault::BrownOut);
    for _ in 0..300 {
        Record::open(&mut memory, Fault::Watchdog).1.store(Fault::Panic, [12, 3]);
    }
    let seen: Vec<_> =
        heads(&memory, Fault::Watchdog).iter().map(|head| (head.fault, head.times, head.ticks)).collect();
    assert_eq!(seen, [(Fault::Panic, 255, 0), (Fault::Watchdog, 1, 0), (Fault::BrownOut, 1, 20)]);
}

#[test]
fn a_motors_fault_leaves_its_ticks_and_the_last_bridge_command() {
    let mut memory = [0; SIZE];
    let (mut record, _) = Record::open(&mut memory, Fault::PowerOn);
    run(&mut record, 10);
    record.tick(&with_fault(turning(11), 3, STUCK));
    run(&mut record, 100);
    let head = record.heads().next().unwrap();
    assert_eq!((head.fault, head.motor, head.drive), (Fault::EncoderStuck, Some(3), DRIVE));
    assert_eq!((head.uptime_ms, head.ticks, head.run), (549, 11, 1));
    let ticks: Vec<Tick> = record.ticks(head.number).unwrap().collect();
    assert_eq!((ticks[0].position, ticks[10].position), (50, 550));
    assert_eq!(ticks[10].drive, Drive::COAST);
    assert!(ticks.iter().all(|tick| tick.velocity == 1003));
}

#[test]
fn a_lasting_fault_is_one_entry_and_a_repeated_fault_is_counted() {
    let mut memory = [0; SIZE];
    let (mut record, _) = Record::open(&mut memory, Fault::PowerOn);
    run(&mut record, 5);
    for _ in 0..3 {
        (6..=20).for_each(|tick| record.tick(&with_fault(turning(tick), 1, BRIDGE)));
        record.tick(&turning(21));
    }
    record.tick(&with_fault(turning(22), 2, BRIDGE));
    let seen: Vec<_> = record.heads().map(|head| (head.fault, head.motor, head.times)).collect();
    assert_eq!(seen, [(Fault::BridgeOff, Some(2), 1), (Fault::BridgeOff, Some(1), 3)]);
}

#[test]
fn a_battery_that_fails_is_one_fault_of_all_motors() {
    let mut memory = [0; SIZE];
    let (mut record, _) = Record::open(&mut memory, Fault::PowerOn);
    run(&mut record, 5);
    let mut snapshot = turning(6);
    snapshot.battery = None;
    (0..4).for_each(|motor| snapshot = with_fault(snapshot, motor, NO_BATTERY));
    record.tick(&snapshot);
    let seen: Vec<_> = record.heads().map(|head| (head.fault, head.motor, head.battery)).collect();
    assert_eq!(seen, [(Fault::BatteryUnknown, Some(0), None)]);
}

#[test]
fn a_disabled_motor_has_no_faults_in_the_record() {
    let mut memory = [0; SIZE];
    let (mut record, _) = Record::open(&mut memory, Fault::PowerOn);
    for setpoint in [Setpoint::Disabled, Setpoint::FailSafe] {
        let mut snapshot = with_fault(turning(1), 0, NO_BATTERY);
        snapshot.motors[0].setpoint = setpoint;
        record.tick(&snapshot);
    }
    assert_eq!(record.heads().count(), 0);
}

#[test]
fn the_newest_entries_are_kept_and_the_ticks_of_the_newest_of_them() {
    let mut memory = [0; SIZE];
    let _ = Record::open(&mut memory, Fault::PowerOn);
    for ticks in 1..=20 {
        let mut record = Record::open(&mut memory, Fault::ResetPin).0;
        (1..=ticks).for_each(|tick| record.tick(&turning(tick + 100 * ticks)));
    }
    let (record, _) = Record::open(&mut memory, Fault::Watchdog);
    let all: Vec<_> = record.heads().collect();
    assert_eq!(all.len(), HEADS);
    let numbers: Vec<u16> = all.iter().map(|head| head.number).collect();
    assert_eq!(numbers, [21, 20, 19, 18, 17, 16, 15, 14]);
    assert!(all[..PAGES].iter().map(|head| head.ticks).eq([20, 19, 18]));
    assert!(all[PAGES..].iter().all(|head| head.ticks == 0 && record.ticks(head.number).is_none()));
    assert!(record.ticks(13).is_none());
}

#[test]
fn the_newest_entries_are_listed_also_where_their_numbers_wrap() {
    let mut memory = [0; SIZE];
    let (mut record, _) = Record::open(&mut memory, Fault::PowerOn);
    for tick in 1..=65_538 {
        // Each entry has another motor than the entry before, so it is no repetition.
        record.tick(&with_fault(turning(tick), tick as usize % 2, STUCK));
    }
    let numbers = |heads: &[Head]| heads.iter().map(|head| head.number).collect::<Vec<u16>>();
    let listed: Vec<Head> = record.heads().collect();
    assert_eq!(numbers(&listed), [2, 1, 0, 65_535, 65_534, 65_533, 65_532, 65_531]);
    let after_reset = heads(&memory, Fault::Watchdog);
    assert_eq!(numbers(&after_reset), [3, 2, 1, 0, 65_535, 65_534, 65_533, 65_532]);
}

#[test]
fn a_record_that_is_cleared_is_empty_and_goes_on() {
    let mut memory = [0; SIZE];
    run(&mut Record::open(&mut memory, Fault::PowerOn).0, 70);
    let (mut record, _) = Record::open(&mut memory, Fault::ResetPin);
    record.clear();
    assert_eq!(record.heads().count(), 0);
    run(&mut record, 70);
    let all = heads(&memory, Fault::Watchdog);
    assert_eq!(all.iter().map(|head| (head.fault, head.run)).collect::<Vec<_>>(), [(Fault::Watchdog, 2)]);
}

/// Bytes of the ring. A slot has 32 bytes, and a head has 32 bytes.
const RING: Range<usize> = 40..40 + 32 * (TICKS + 1);

/// A record with two entries, the record after the tick that writes a third entry, and the contents of both.
fn before_and_after() -> (Memory, Memory, Vec<(Head, Vec<Tick>)>) {
    let written = |third_entry: bool| {
        let mut memory = [0; SIZE];
        run(&mut Record::open(&mut memory, Fault::PowerOn).0, 90);
        run(&mut Record::open(&mut memory, Fault::ResetPin).0, 70);
        let (mut record, _) = Record::open(&mut memory, Fault::Watchdog);
        run(&mut record, 80);
        if third_entry {
            record.tick(&with_fault(turning(81), 2, STUCK));
        }
        let all = record.heads().map(|head| (head, record.ticks(head.number).unwrap().collect())).collect();
        (memory, all)
    };
    let ((before, _), (after, all)) = (written(false), written(true));
    (before, after, all)
}

/// Asserts that each entry of an earlier run is one of these, with all of its ticks or without ticks.
fn assert_known(record: &Record<'_>, known: &[(Head, Vec<Tick>)], what: &str) {
    for head in record.heads().filter(|head| head.fault != Fault::BrownOut) {
        let (_, ticks) = known
            .iter()
            .find(|(other, _)| Head { ticks: head.ticks, ..*other } == head)
            .unwrap_or_else(|| panic!("{what}: {head:?}"));
        let kept: Option<Vec<Tick>> = record.ticks(head.number).map(Iterator::collect);
        assert!(kept.is_none_or(|kept| kept == *ticks), "{what}: {head:?}");
    }
}

#[test]
fn an_entry_whose_writing_a_reset_interrupted_is_ignored() {
    let (before, after, all) = before_and_after();
    // A tick writes the ring, the state of the run, the page of an entry and its head, in this order.
    let order = [RING, 0..RING.start, RING.end + 32 * HEADS..SIZE, RING.end..RING.end + 32 * HEADS];
    let places: Vec<usize> = order.into_iter().flatten().collect();
    // A word is written as a whole.
    for cut in (0..=SIZE).step_by(4) {
        let mut memory = before;
        for &place in &places[..cut] {
            memory[place] = after[place];
        }
        let (record, _) = Record::open(&mut memory, Fault::BrownOut);
        assert_known(&record, &all, &format!("cut at {cut}"));
        for head in record.heads().filter(|head| head.fault == Fault::BrownOut) {
            let positions: Vec<u16> =
                record.ticks(head.number).into_iter().flatten().map(|tick| tick.position).collect();
            let even = positions.windows(2).all(|pair| pair[1].wrapping_sub(pair[0]) == 50);
            assert!(even, "cut at {cut}: {positions:?}");
        }
    }
}

#[test]
fn a_flipped_bit_removes_an_entry_or_its_ticks_and_adds_none() {
    let (_, memory, sound) = before_and_after();
    for bit in 0..8 * SIZE {
        let mut flipped = memory;
        flipped[bit / 8] ^= 1 << (bit % 8);
        let (record, _) = Record::open(&mut flipped, Fault::BrownOut);
        assert_known(&record, &sound, &format!("bit {bit}"));
    }
}

/// The state of the run is in the first 24 bytes of the memory: the number of the run, and its last tick.
#[test]
fn a_flipped_bit_in_the_state_of_the_run_removes_that_state_or_the_record() {
    let (_, memory, _) = before_and_after();
    let sound = heads(&memory, Fault::BrownOut)[0];
    assert_eq!((sound.fault, sound.ticks), (Fault::BrownOut, 64));
    for bit in 0..8 * 24 {
        let mut flipped = memory;
        flipped[bit / 8] ^= 1 << (bit % 8);
        let nothing =
            Head { uptime_ms: 0, battery: None, motor: None, drive: Drive::COAST, ticks: 0, ..sound };
        let newest = heads(&flipped, Fault::BrownOut).first().copied();
        assert!([None, Some(nothing), Some(sound)].contains(&newest), "bit {bit}: {newest:?}");
    }
}

#[test]
fn a_tick_whose_writing_a_reset_interrupted_is_in_no_entry() {
    let positions = |memory: Memory| -> Vec<u16> {
        let mut memory = memory;
        let (record, _) = Record::open(&mut memory, Fault::Watchdog);
        record.ticks(1).unwrap().map(|tick| tick.position).collect()
    };
    let mut memory = [0; SIZE];
    let (mut record, _) = Record::open(&mut memory, Fault::PowerOn);
    run(&mut record, 100);
    let before = memory;
    // The state of the run is written last. Only then the new tick counts.
    for garbled in 0..=32 {
        let mut memory = before;
        let begun = &mut memory[RING][32 * 35..][..32];
        begun.iter_mut().take(garbled).for_each(|byte| *byte = !*byte);
        assert_eq!(positions(memory), positions(before));
        assert_eq!(positions(memory).len(), TICKS);
    }
}

#[test]
fn a_record_of_firmware_0_1_0_whose_ticks_have_control_values_is_cleared() {
    let mut memory = [0; SIZE];
    run(&mut Record::open(&mut memory, Fault::PowerOn).0, 20);
    assert_eq!(heads(&memory, Fault::Watchdog).len(), 1);
    // Memory of this firmware begins with "MHR2", memory of firmware 0.1.0 with "MHR1".
    memory[3] = b'1';
    assert_eq!(heads(&memory, Fault::Watchdog), []);
}

proptest! {
    #[test]
    fn any_bytes_are_opened_read_and_written_without_a_panic(
        bytes in prop::collection::vec(any::<u8>(), SIZE),
        magic in any::<bool>(),
        number in any::<u16>(),
    ) {
        let mut memory: Memory = bytes.try_into().expect("as many");
        if magic {
            // A valid beginning, so that the rest is read: "MHR2", run 7.
            memory[..12].copy_from_slice(&[0x4D, 0x48, 0x52, 0x32, 7, 0, 0, 0, 0xF8, 0xFF, 0xFF, 0xFF]);
        }
        let (mut record, mut crash_report) = Record::open(&mut memory, Fault::Watchdog);
        for head in record.heads() {
            record.ticks(head.number).map(Iterator::count);
        }
        record.ticks(number).map(Iterator::count);
        record.tick(&with_fault(turning(u32::from(number)), 1, STUCK));
        crash_report.store(Fault::Panic, [1, 2]);
        prop_assert_eq!(record.heads().next().map(|head| head.fault), Some(Fault::EncoderStuck));
    }
}

#[test]
fn a_fault_of_a_motor_has_a_word_of_its_own_and_a_fault_of_the_hub_has_none() {
    let of_motors = || Fault::ALL.iter().filter(|fault| fault.number() < 16);
    let words: BTreeSet<&str> = of_motors().filter_map(|fault| fault.word()).collect();
    assert_eq!(words.len(), of_motors().count(), "{words:?}");
    assert!(Fault::ALL.iter().all(|fault| fault.number() < 16 || fault.word().is_none()));
    assert_eq!(Fault::EncoderStuck.word(), Some("stuck"));
}
