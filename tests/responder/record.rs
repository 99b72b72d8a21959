//! Answers with the record of faults.

use crate::host::{Answer, TestHost};
use motor_hub::bridge::Drive;
use motor_hub::extension::HubFunction;
use motor_hub::extension::record::{Entries, Ticks};
use motor_hub::hub::Snapshot;
use motor_hub::motor::{Report, Setpoint};
use motor_hub::record::{Fault, Head, Record, SIZE, Tick};
use motor_hub::units::{Control, Voltage};

#[test]
fn a_hub_without_a_record_reports_none() {
    let mut host = TestHost::settled();
    assert_eq!(host.ask(0x4D12, &[0, 0]), Answer::Data(vec![0; 5]));
    assert_eq!(host.ask(0x4D21, &[1, 0, 0]), Answer::Nack(0));
}

/// A host at a hub that has been reset this number of times, and then once more by its watchdog.
fn reset(times: i16) -> TestHost {
    let memory = Box::leak(Box::new([0; SIZE]));
    for run in 0..times {
        let (mut record, _) = Record::open(memory, Fault::ResetPin);
        for tick in 0..70 {
            let millivolts = 100 * run + tick;
            let voltage = Voltage::from_volts((f32::from(millivolts) + 0.5) / 1e3);
            let drive = Drive::BRAKE;
            let setpoint = Setpoint::ConstantPower(Control::MAX);
            let report = Report { setpoint, voltage, drive, ..Report::INITIAL };
            record.tick(&Snapshot { motors: [report; 4], ..Snapshot::INITIAL });
        }
    }
    let (record, _) = Record::open(memory, Fault::Watchdog);
    TestHost { record: Some(record), ..TestHost::settled() }
}

#[test]
fn entries_come_three_at_a_time_and_ticks_eight() {
    let mut host = reset(5);
    let mut heads: Vec<Head> = Vec::new();
    for (from, expected) in [(0, 3), (3, 2), (5, 0)] {
        let some: Entries = host.read(HubFunction::Entries { from, clear: false });
        assert_eq!((some.run, some.count, some.heads.len()), (6, 5, expected));
        heads.extend(some.heads);
    }
    let numbers: Vec<u16> = heads.iter().map(|head| head.number).collect();
    assert_eq!(numbers, [5, 4, 3, 2, 1]);
    assert_eq!(heads[0].fault, Fault::Watchdog);
    let mut ticks: Vec<Tick> = Vec::new();
    for from in (0..64).step_by(8) {
        let some: Ticks = host.read(HubFunction::Ticks { number: 5, from });
        assert_eq!((some.count, some.ticks.len()), (64, 8));
        ticks.extend(some.ticks);
    }
    let millivolts: Vec<i16> = ticks.iter().map(|tick| tick.millivolts).collect();
    assert_eq!(millivolts, (406..470).collect::<Vec<i16>>());
}

#[test]
fn a_cleared_record_is_reported_once_more_and_then_empty() {
    let mut host = reset(2);
    let entries: Entries = host.read(HubFunction::Entries { from: 0, clear: true });
    assert_eq!(entries.count, 2);
    let entries: Entries = host.read(HubFunction::Entries { from: 0, clear: false });
    assert_eq!((entries.run, entries.count), (3, 0));
}
