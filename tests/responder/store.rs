//! Settings that a hub stores and restores.

use crate::host::{Answer, HUB, N, TestHost, bytes_of, largest, responder_with, settings};
use motor_hub::braking::{Blend, BlendFraction, DutyRule, Scheme, Winding};
use motor_hub::bridge::Timing;
use motor_hub::extension::settings::{Group, MotorSettings, Values};
use motor_hub::extension::state::StoreReport;
use motor_hub::extension::{FIRST_FUNCTION, HubFunction, Request};
use motor_hub::hub::Command;
use motor_hub::motion::Pidf;
use motor_hub::motor::{OnFault, Setpoint, Settings, ThermalLimit, ZeroPower};
use motor_hub::regulator::{Coefficients, Dynamics};
use motor_hub::store::{Found, Outcome, SettingsRecord, StoreRequest, Stored};
use motor_hub::units::{
    Acceleration, AccelerationPerVolt, Coefficient, Control, CountsPerSecond, DecayRate, EmfConstant,
    Millivolts,
};
use proptest::prelude::*;
use std::num::NonZeroU16;

const SAVE: u16 = FIRST_FUNCTION + 14;
const LOAD: u16 = FIRST_FUNCTION + 15;
const RESET: u16 = FIRST_FUNCTION + 16;
const STATE: u16 = FIRST_FUNCTION + 17;
const SET_BASE: u16 = FIRST_FUNCTION + 34;
const BASE_IN_FORCE: u16 = FIRST_FUNCTION + 36;

/// Motors 0 and 2 drive wheels of 90 mm at a distance of 300 mm, with 1680 counts per turn, by the gyro.
const BASE: [u8; 19] =
    [0, 2, 0x90, 0x5F, 1, 0, 0xE0, 0x93, 4, 0, 0x80, 0xA2, 0x19, 0, 0x80, 0xA2, 0x19, 0, 1];

fn found(record: &SettingsRecord) -> Found {
    Found { stored: Stored::Whole, version: 1, record: record.clone() }
}

/// Returns a host at a hub that has just been powered on with these stored settings.
fn powered_on(found: Found) -> TestHost {
    let mut host = TestHost::new();
    host.responder.restore(found);
    host.new_commands();
    host
}

/// Returns a host at a hub whose firmware was built with these settings, and which restores these stored settings.
fn built_with(settings: Settings, found: Found) -> TestHost {
    let mut host = TestHost { responder: responder_with(settings), ..TestHost::new() };
    host.responder.restore(found);
    host
}

fn empty() -> TestHost {
    powered_on(Found::without_record(Stored::Nothing, 0))
}

fn order(host: &mut TestHost) -> StoreRequest {
    host.responder.store_request(&host.snapshot).expect("an order")
}

/// Asserts that the hub requests no access to its store.
fn writes_nothing(host: &mut TestHost) {
    assert_eq!(host.responder.store_request(&host.snapshot), None);
}

/// Carries out the hub's request to its store. Returns the record that is stored.
fn carried_out(host: &mut TestHost) -> SettingsRecord {
    let record = order(host).record.expect("something to write");
    host.responder.store_done(Some(found(&record)), Outcome::Done);
    record
}

/// Saves the settings. Returns the record that is stored.
fn save(host: &mut TestHost) -> SettingsRecord {
    host.ask(SAVE, &[]).done();
    carried_out(host)
}

/// A record with these entries.
fn record(entries: &[(u16, &[u8])]) -> SettingsRecord {
    let mut record = SettingsRecord::new(1);
    for (id, payload) in entries {
        record.push(*id, payload).expect("room");
    }
    record
}

fn report(host: &mut TestHost) -> StoreReport {
    host.read(HubFunction::Stored)
}

/// Returns all settings of all motors, as a host reads them.
fn all(host: &mut TestHost) -> Vec<Answer> {
    let motors = (0..N as u8).flat_map(|motor| Group::ALL.map(|group| Request::Get(motor, group)));
    motors.map(|request| host.request(request)).collect()
}

/// Gives each setting of a motor its largest value, except that the mode is velocity.
fn set_all(host: &mut TestHost, motor: u8) {
    for group in Group::ALL {
        let value = |field: &_| Ok::<_, ()>(Some(if group == Group::Mode { 1 } else { largest(field) }));
        host.request(Request::Set(motor, Values::collect(group, value).expect("values"))).done();
    }
}

/// Sets everything of motor 2 that can be set, and something of motor 0.
fn set_everything(host: &mut TestHost) {
    set_all(host, 2);
    let [p, i, d] = [10_i32, 3, -1].map(|value| (value << 16).to_le_bytes());
    host.do_all(&[(23, &[&[0, 2][..], &d, &i, &p].concat())]);
}

#[test]
fn a_board_without_a_memory_refuses_and_accesses_nothing() {
    let mut host = TestHost::new();
    for function in [SAVE, LOAD, RESET, STATE] {
        assert_eq!(host.ask(function, &[]), Answer::Nack(253));
    }
    writes_nothing(&mut host);
}

#[test]
fn only_saved_settings_are_restored() {
    let mut host = empty();
    set_everything(&mut host);
    // Targets are not stored.
    host.do_all(&[(17, &[2, 100, 0]), (10, &[2, 1])]);
    let (before, enabled) = (all(&mut host), host.responder.enabled());
    assert_eq!((enabled, report(&mut host).differs), ([false, false, true, false], true));
    host.ask(SAVE, &[]).done();
    assert!(report(&mut host).is_busy);
    let record = carried_out(&mut host);
    let status = report(&mut host);
    assert_eq!((status.stored, status.number, status.is_busy), (Stored::Whole, 1, false));
    assert_eq!(
        (status.outcome, status.differs, status.unknown, status.refused),
        (Outcome::Done, false, 0, 0)
    );

    let mut again = TestHost::new();
    again.responder.restore(found(&record));
    assert_eq!(all(&mut again), before);
    assert_eq!(again.responder.enabled(), [false; N]);
    assert_eq!(again.call(18, &[2]), Answer::Data(vec![0, 0]));
    assert!(!report(&mut again).differs);
    // All motors are configured, and no motor runs.
    let configured = |command: &Command| matches!(command, Command::Configure { .. });
    let commands = again.new_commands();
    assert!(commands.len() == N && commands.iter().all(configured), "{commands:?}");
    // A second save of the same settings differs in its number only.
    let second = save(&mut again);
    assert_eq!(second.number(), 2);
    assert!(second.entries().eq(record.entries()));
}

#[test]
fn with_an_empty_memory_the_firmwares_settings_apply() {
    let mut host = empty();
    assert_eq!(all(&mut host), all(&mut TestHost::new()));
    let StoreReport { stored, number, differs, .. } = report(&mut host);
    assert_eq!((stored, number, differs), (Stored::Nothing, 0, false));
    // Whatever a host does, nothing is written.
    set_everything(&mut host);
    host.do_all(&[(17, &[2, 100, 0]), (10, &[2, 1]), (10, &[2, 0])]);
    writes_nothing(&mut host);
}

#[test]
fn a_stored_set_up_that_changes_nothing_deletes_no_motion() {
    // The board configures the motion.
    let mut configuring = empty();
    set_all(&mut configuring, 2);
    let last = *configuring.new_settings().last().expect("configured");
    let known = Settings { coefficients: None, ..last };
    let mut host = TestHost { responder: responder_with(known), ..TestHost::new() };
    let setup = host.ask(FIRST_FUNCTION + 1, &[1]).data();
    let before = all(&mut host);
    host.responder.restore(found(&record(&[(FIRST_FUNCTION, &[&[1], &setup[..]].concat())])));
    assert_eq!(all(&mut host), before);
}

#[test]
fn missing_entries_and_fields_are_the_firmwares() {
    let mut host = empty();
    set_everything(&mut host);
    let whole = save(&mut host);
    // A record of older firmware, which had no inductance, scheme and duty, and no protection.
    let mut older = SettingsRecord::new(1);
    for entry in whole.entries().filter(|entry| entry.id != FIRST_FUNCTION + 8) {
        let length = if entry.id == FIRST_FUNCTION { 7 } else { entry.payload.len() };
        older.push(entry.id, &entry.payload[..length]).expect("room");
    }
    let mut again = powered_on(found(&older));
    let mut fresh = TestHost::new();
    let [setup, stored, factory] =
        [&mut again, &mut host, &mut fresh].map(|host| host.group(FIRST_FUNCTION + 1, 2));
    assert_eq!((&setup[..6], &setup[6..]), (&stored[..6], &factory[6..]));
    assert_eq!(again.group(FIRST_FUNCTION + 9, 2), fresh.group(FIRST_FUNCTION + 9, 2));
    assert_eq!(again.group(FIRST_FUNCTION + 12, 2), host.group(FIRST_FUNCTION + 12, 2));
    let StoreReport { unknown, refused, .. } = report(&mut again);
    assert_eq!((unknown, refused), (0, 0));
}

#[test]
fn unknown_entries_are_kept_and_refused_entries_change_nothing() {
    let unknown: [(u16, &[u8]); 4] =
        [(0x4D55, &[1, 2, 3]), (FIRST_FUNCTION + 8, &[9, 1]), (0x100A, &[0, 1]), (0x7F05, &[])];
    // The entry has fields of a later firmware after the fields of this firmware.
    let longer = [2, 1, 0, 0, 0, 0, 0, 0, 77, 78];
    // An unknown action at a fault, and a set-up that is out of range.
    let refused: [(u16, &[u8]); 2] =
        [(FIRST_FUNCTION + 8, &[0, 7, 0, 0, 0, 0, 0, 0]), (FIRST_FUNCTION, &[3, 0, 0, 0, 0])];
    let entries = [&unknown[..], &[(FIRST_FUNCTION + 8, &longer)], &refused].concat();
    let mut host = powered_on(found(&record(&entries)));
    let mut fresh = TestHost::new();
    fresh.ask(FIRST_FUNCTION + 8, &longer);
    assert_eq!(all(&mut host), all(&mut fresh));
    assert_eq!(host.responder.enabled(), [false; N]);
    let StoreReport { unknown: kept, refused, .. } = report(&mut host);
    assert_eq!((kept, refused), (4, 2));
    let saved = save(&mut host);
    assert_eq!(saved.number(), 2);
    for (id, payload) in unknown.into_iter().chain([(FIRST_FUNCTION + 8, &longer[..])]) {
        assert!(saved.entries().any(|entry| (entry.id, entry.payload) == (id, payload)), "{id:#x}");
    }
}

#[test]
fn unknown_entries_and_additional_bytes_of_an_entry_are_kept_or_the_save_is_refused() {
    let longer = |length| [&[2, 1, 0, 0, 0, 0, 0, 0][..], &[77; 255]].concat()[..length].to_vec();
    // A record has no room for the second and the third pair.
    for (unknown, id, payload, fits) in [
        (29, FIRST_FUNCTION + 8, longer(161), true),
        (29, FIRST_FUNCTION + 8, longer(255), false),
        (240, 0x4D56, vec![7; 29], false),
    ] {
        let record = record(&[(0x4D55, &vec![7; unknown]), (id, &payload)]);
        let mut host = powered_on(found(&record));
        let said = host.ask(SAVE, &[]);
        if fits {
            let saved = carried_out(&mut host);
            assert!(saved.entries().any(|entry| entry.payload == payload), "{saved:?}");
        } else {
            assert_eq!(said, Answer::Nack(64));
            writes_nothing(&mut host);
        }
    }
}

#[test]
fn all_motors_with_all_settings_fit() {
    let mut host = empty();
    (0..N as u8).for_each(|motor| set_all(&mut host, motor));
    host.ask(SET_BASE, &BASE).done();
    host.ask(SAVE, &[]);
    // The address, all settings, and the drive base.
    assert_eq!(carried_out(&mut host).entries().count(), 1 + N * Group::ALL.len() + 1);
}

#[test]
fn a_host_can_remove_a_current_limit_that_the_firmware_was_built_with() {
    const SET_LIMIT: u16 = FIRST_FUNCTION + 28;
    let factory = Settings { current_limit: NonZeroU16::new(800), ..settings() };
    let mut host = built_with(factory, Found::without_record(Stored::Nothing, 0));
    assert_eq!(host.group(SET_LIMIT + 1, 1), [0x20, 3]);
    host.ask(SET_LIMIT, &[1, 0, 0]);
    let record = save(&mut host);
    assert!(!report(&mut host).differs);
    let mut again = built_with(factory, found(&record));
    assert_eq!(again.group(SET_LIMIT + 1, 1), [0, 0]);
    assert_eq!(again.group(SET_LIMIT + 1, 0), [0x20, 3]);
}

#[test]
fn a_host_can_remove_coefficients_that_the_firmware_was_built_with() {
    let velocity = Pidf { p: Coefficient::from_bits(10 << 16), ..Pidf::default() };
    let coefficients = Some(Coefficients { velocity, position: Pidf::default() });
    let started = |found| built_with(Settings { coefficients, ..settings() }, found);
    let mut host = started(Found::without_record(Stored::Nothing, 0));
    assert_eq!(report(&mut host).coefficients, 0b1111);
    // The set-up of motor 1 deletes the coefficients, although none of its values changes.
    let set_up = host.group(FIRST_FUNCTION + 1, 1);
    host.ask(FIRST_FUNCTION, &[&[1], &set_up[..]].concat()).done();
    assert_eq!((report(&mut host).coefficients, report(&mut host).differs), (0b1101, true));
    let record = save(&mut host);
    let StoreReport { differs, unknown, refused, .. } = report(&mut host);
    assert_eq!((differs, unknown, refused), (false, 0, 0));
    let mut again = started(found(&record));
    assert_eq!((report(&mut again).coefficients, all(&mut again)), (0b1101, all(&mut host)));
    // A second save writes the same entries.
    assert!(save(&mut again).entries().eq(record.entries()));
    // Coefficients of a host replace the entries.
    let values = Values::of(Group::VelocityLoop, &MotorSettings::new(settings()));
    again.request(Request::Set(1, values)).done();
    let record = save(&mut again);
    assert_eq!(report(&mut started(found(&record))).coefficients, 0b1111);
}

#[test]
fn a_drive_base_is_stored_and_restored_and_a_reset_removes_it() {
    let mut host = empty();
    host.ask(SET_BASE, &BASE).done();
    assert!(report(&mut host).differs);
    let record = save(&mut host);
    assert!(!report(&mut host).differs);

    let mut again = TestHost::new();
    again.responder.restore(found(&record));
    assert_eq!(again.ask(BASE_IN_FORCE, &[]), Answer::Data(BASE.to_vec()));
    let is_base =
        |command: &Command| matches!(command, Command::SetBase(Some(base)) if base.wheels == [0, 2]);
    assert!(again.new_commands().iter().any(is_base));
    again.tick();
    assert!(!report(&mut again).differs);
    // If the base does not change, its position is not reset.
    again.ask(LOAD, &[]);
    order(&mut again);
    again.responder.store_done(Some(found(&record)), Outcome::Done);
    let commands = again.new_commands();
    assert!(!commands.iter().any(|command| matches!(command, Command::SetBase(_))), "{commands:?}");

    again.tick();
    again.ask(RESET, &[]).done();
    let removed = |command: &Command| *command == Command::SetBase(None);
    assert!(again.new_commands().iter().any(removed));
    assert_eq!(again.ask(BASE_IN_FORCE, &[]), Answer::Nack(82));
}

#[test]
fn a_stored_base_that_the_hub_cannot_have_is_refused_and_reported() {
    let (mut wheel, mut track) = (BASE, BASE);
    wheel[1] = N as u8;
    track[6..10].fill(0);
    for base in [&wheel[..], &track, &BASE[..18]] {
        let mut host = powered_on(found(&record(&[(SET_BASE, base)])));
        assert_eq!(host.ask(BASE_IN_FORCE, &[]), Answer::Nack(82));
        let StoreReport { unknown, refused, .. } = report(&mut host);
        assert_eq!((unknown, refused), (0, 1), "{base:?}");
    }
    // Fields of a later firmware are kept.
    let longer = [&BASE[..], &[7, 8]].concat();
    let mut host = powered_on(found(&record(&[(SET_BASE, &longer)])));
    let saved = save(&mut host);
    assert!(saved.entries().any(|entry| (entry.id, entry.payload) == (SET_BASE, &longer[..])), "{saved:?}");
}

#[test]
fn while_a_motor_runs_settings_are_saved_without_erasing_and_not_read() {
    let mut host = empty();
    host.do_all(&[(15, &[1, 0, 0x10]), (10, &[1, 1])]);
    assert_eq!([LOAD, RESET].map(|function| host.ask(function, &[])), [Answer::Nack(60), Answer::Nack(60)]);
    host.ask(SAVE, &[]).done();
    assert!(!order(&mut host).may_erase);
    assert_eq!(host.ask(SAVE, &[]), Answer::Nack(61));
    host.responder.store_done(None, Outcome::NeedsErase);
    let StoreReport { outcome, stored, .. } = report(&mut host);
    assert_eq!((outcome, stored), (Outcome::NeedsErase, Stored::Nothing));
    // The hub does not try again.
    writes_nothing(&mut host);
    // The motor is disabled, but its report still has a set-point, or the button has set one.
    host.do_all(&[(10, &[1, 0])]);
    for setpoint in [Setpoint::ConstantPower(Control::MAX), Setpoint::Velocity(CountsPerSecond::ZERO)] {
        host.snapshot.motors[3].setpoint = setpoint;
        assert_eq!(host.ask(LOAD, &[]), Answer::Nack(60));
    }
    for setpoint in [Setpoint::Disabled, Setpoint::FailSafe] {
        host.snapshot.motors[3].setpoint = setpoint;
        host.ask(SAVE, &[]);
        assert!(order(&mut host).may_erase, "{setpoint:?}");
        host.responder.store_done(None, Outcome::NeedsErase);
        host.ask(LOAD, &[]).done();
        order(&mut host);
        host.responder.store_done(None, Outcome::Done);
    }
}

#[test]
fn load_restores_the_stored_settings_and_reset_the_firmwares() {
    let mut host = empty();
    set_everything(&mut host);
    let (record, saved) = (save(&mut host), all(&mut host));
    host.do_all(&[(8, &[2, 0, 0])]);
    assert!(report(&mut host).differs);
    host.new_commands();

    host.ask(LOAD, &[]).done();
    assert_eq!(order(&mut host).record, None);
    assert_ne!(all(&mut host), saved);
    host.responder.store_done(Some(found(&record)), Outcome::Done);
    assert_eq!((all(&mut host), report(&mut host).differs), (saved, false));
    assert!(host.new_commands().iter().any(|command| matches!(command, Command::Configure { motor: 2, .. })));

    host.ask(RESET, &[]).done();
    assert_eq!(all(&mut host), all(&mut TestHost::new()));
    let commands = host.new_commands();
    assert!(commands.contains(&Command::Configure { motor: 2, settings: settings() }), "{commands:?}");
    let stored = carried_out(&mut host);
    assert_eq!((stored.number(), stored.entries().count()), (2, 0));
    assert!(!report(&mut host).differs);
}

#[test]
fn settings_of_a_later_firmware_and_damaged_ones_are_kept_until_they_are_reset() {
    for (stored, version, refusal, erase_first) in
        [(Stored::Later, 3, 62, false), (Stored::Damaged, 0, 63, true)]
    {
        let unread = || powered_on(Found::without_record(stored, version));
        let mut host = unread();
        assert_eq!(all(&mut host), all(&mut TestHost::new()));
        let report = report(&mut host);
        assert_eq!((report.stored, report.version), (stored, version));
        assert_eq!(host.ask(SAVE, &[]), Answer::Nack(refusal));
        // The address is not stored either.
        host.ask(0x7F06, &[9]);
        writes_nothing(&mut host);
        let mut host = unread();
        host.ask(RESET, &[]).done();
        let record = Some(SettingsRecord::new(1));
        assert_eq!(order(&mut host), StoreRequest { record, erase_first, may_erase: true });
    }
}

#[test]
fn a_new_address_is_stored_alone() {
    let mut host = empty();
    set_everything(&mut host);
    let before = save(&mut host);
    host.do_all(&[(8, &[1, 2, 1])]);
    host.ask(0x7F06, &[9]);
    let record = carried_out(&mut host);
    assert_eq!(record.number(), 2);
    let others = |record: &SettingsRecord| -> Vec<(u16, Vec<u8>)> {
        let others = record.entries().filter(|entry| entry.id != 0x7F06);
        others.map(|entry| (entry.id, entry.payload.to_vec())).collect()
    };
    assert_eq!(others(&record), others(&before));
    assert_eq!(powered_on(found(&record)).responder.address().get(), 9);
    // The address is stored only once, also if a host sets the address in force.
    writes_nothing(&mut host);
    host.ask(0x7F06, &[9]);
    writes_nothing(&mut host);
}

#[test]
fn an_address_that_is_set_back_while_it_is_written_is_the_address_after_a_restart() {
    let mut host = empty();
    host.ask(0x7F06, &[9]);
    let written = order(&mut host).record.expect("a record with the new address");
    host.ask(0x7F06, &[HUB]);
    host.responder.store_done(Some(found(&written)), Outcome::Done);
    assert_eq!(powered_on(found(&carried_out(&mut host))).responder.address().get(), HUB);
    writes_nothing(&mut host);
}

#[test]
fn a_save_without_room_does_not_drop_an_address_that_waits() {
    // Entries of other firmware leave just enough room for a save, and then a host sets coefficients.
    let mut record = SettingsRecord::new(1);
    let mut host = loop {
        record.push(0x4D55, &[7; 4]).expect("room");
        let mut next = record.clone();
        next.push(0x4D55, &[7; 4]).expect("room");
        if powered_on(found(&next)).ask(SAVE, &[]) == Answer::Nack(64) {
            break powered_on(found(&record));
        }
    };
    host.ask(0x7F06, &[8]);
    host.ask(SAVE, &[]).done();
    let coefficients: Vec<u8> =
        [0x13_5F, 0x1A, 0x01].iter().flat_map(|one: &i32| one.to_le_bytes()).collect();
    host.do_all(&[(23, &[&[0, 2][..], &coefficients].concat())]);
    writes_nothing(&mut host);
    assert_eq!(powered_on(found(&carried_out(&mut host))).responder.address().get(), 8);
}

#[test]
fn no_motor_is_enabled_until_a_load_has_ended_and_a_load_that_fails_changes_no_settings() {
    let mut host = empty();
    set_everything(&mut host);
    host.do_all(&[(15, &[1, 0, 0x10])]);
    let before = all(&mut host);
    host.ask(LOAD, &[]);
    assert_eq!(host.call(10, &[1, 1]), Answer::Nack(61));
    order(&mut host);
    assert_eq!(host.call(10, &[1, 1]), Answer::Nack(61));
    host.responder.store_done(Some(Found::without_record(Stored::Nothing, 0)), Outcome::Refused);
    host.call(10, &[1, 1]).done();
    assert_eq!(all(&mut host), before);
}

#[test]
fn an_address_that_was_set_before_the_memory_was_read_is_stored() {
    let stored = record(&[(0x7F06, &[3])]);
    let mut host = TestHost { responder: responder_with(settings()).expecting_store(), ..TestHost::new() };
    host.ask(0x7F06, &[9]);
    host.responder.store_done(Some(found(&stored)), Outcome::None);
    assert_eq!(powered_on(found(&carried_out(&mut host))).responder.address().get(), 9);
    writes_nothing(&mut host);
    // A packet alone does not replace the stored address by the address that the firmware was built with.
    let mut host = TestHost { responder: responder_with(settings()).expecting_store(), ..TestHost::new() };
    host.ask(STATE, &[]);
    host.responder.store_done(Some(found(&stored)), Outcome::None);
    writes_nothing(&mut host);
}

#[test]
fn an_address_that_has_no_room_waits_for_motors_to_be_off() {
    let mut host = empty();
    host.do_all(&[(15, &[1, 0, 0x10]), (10, &[1, 1])]);
    host.ask(0x7F06, &[HUB + 1]);
    assert!(!order(&mut host).may_erase);
    host.responder.store_done(None, Outcome::NeedsErase);
    writes_nothing(&mut host);
    host.responder.tick(motor_hub::units::Micros::new(60_000_000), &host.snapshot);
    assert!(order(&mut host).may_erase);
    // After an error of the memory the hub does not try again.
    host.responder.store_done(None, Outcome::Refused);
    writes_nothing(&mut host);
}

#[test]
fn an_address_that_has_no_room_beside_entries_of_other_firmware_is_given_up_once() {
    let mut record = SettingsRecord::new(1);
    while record.push(0x4D55, &[7; 20]).is_ok() {}
    while record.push(0x4D55, &[]).is_ok() {}
    let mut host = powered_on(found(&record));
    host.ask(0x7F06, &[HUB + 1]);
    writes_nothing(&mut host);
    assert_eq!(host.responder.address().get(), HUB + 1);
    writes_nothing(&mut host);
}

fn entry() -> impl Strategy<Value = (u16, Vec<u8>)> {
    let id = prop_oneof![
        0x4D00u16..0x4D12,
        prop::sample::select(Group::ALL.map(Group::set_id).to_vec()),
        prop::sample::select(vec![0x100A_u16, 0x100F, 0x7F06]),
        any::<u16>(),
    ];
    // Now and then longer than any message.
    let length = prop_oneof![9 => 0usize..24, 1 => 0usize..=255];
    (id, length.prop_flat_map(|length| prop::collection::vec(prop_oneof![0u8..4, any::<u8>()], length)))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// For any stored bytes no motor is enabled, and the settings in force can be saved and found again.
    #[test]
    fn any_record_is_survived(entries in prop::collection::vec(entry(), 0..12)) {
        let mut record = SettingsRecord::new(3);
        for (id, payload) in &entries {
            let _ = record.push(*id, payload);
        }
        let mut host = TestHost::new();
        host.responder.restore(found(&record));
        let before = host.new_settings();
        prop_assert_eq!(host.responder.enabled(), [false; N]);
        prop_assert_eq!(before.len(), N);
        let address = host.responder.address();
        host.ask(SAVE, &[]);
        if let Some(StoreRequest { record: Some(saved), .. }) = host.responder.store_request(&host.snapshot) {
            let mut again = TestHost::new();
            again.responder.restore(found(&saved));
            prop_assert_eq!(again.new_settings(), before);
            prop_assert_eq!(again.responder.address(), address);
        }
    }
}

/// A record that firmware 0.1.0 has written: type and payload of each entry. Motor 0 has a fault action and one loop from
/// a host, motor 1 another winding and an acceleration limit, motor 2 everything, motor 3 a mode.
const BY_FIRMWARE_0_1_0: [(u16, &str); 29] = [
    (0x7F06, "09"),
    (0x4D00, "00 0f ca 3f 00 e4 0c b6 02 01 00 00 01"),
    (0x4D0B, "00 00 00 00 00 00 00 00 00 00 00"),
    (0x4D08, "00 01 00 00 00 00 00 00"),
    (0x4D02, "00 00 00 00 00 00 00 00 00 00 00 00 00 00 00"),
    (0x1008, "00 00 00"),
    (0x100C, "00 00 00"),
    (0x1033, "00 01 04 50 0c 00 bb cc 05 00 00 00 00 00 00 00 00 00 01"),
    (0x1033, "00 02 00 00 ff ff 00 00 03 00 00 00 0a 00 00 00 00 00 00"),
    (0x4D00, "01 5f ca 3f 00 e4 0c 00 00 04 00 00 00"),
    (0x4D0B, "01 00 00 00 00 00 00 00 00 00 00"),
    (0x4D08, "01 00 00 00 00 00 00 00"),
    (0x4D02, "01 00 00 00 00 00 00 00 00 00 00 10 27 01 00"),
    (0x1008, "01 00 00"),
    (0x100C, "01 00 00"),
    (0x4D00, "02 5f ca 3f 00 e4 0c b6 02 05 00 80 01"),
    (0x4D0B, "02 01 00 02 00 03 00 04 00 05 00"),
    (0x4D08, "02 01 d0 07 05 00 c8 00"),
    (0x4D02, "02 00 04 00 00 00 00 03 00 64 00 10 27 00 00"),
    (0x1008, "02 01 01"),
    (0x100C, "02 88 13"),
    (0x1033, "02 01 00 00 0a 00 00 00 03 00 00 00 ff ff 00 00 07 00 01"),
    (0x1033, "02 02 00 00 0a 00 00 00 03 00 00 00 ff ff 00 00 07 00 01"),
    (0x4D00, "03 0f ca 3f 00 e4 0c b6 02 01 00 00 01"),
    (0x4D0B, "03 00 00 00 00 00 00 00 00 00 00"),
    (0x4D08, "03 00 00 00 00 00 00 00"),
    (0x4D02, "03 00 00 00 00 00 00 00 00 00 00 00 00 00 00"),
    (0x1008, "03 02 00"),
    (0x100C, "03 00 00"),
];

#[test]
fn settings_stored_by_firmware_0_1_0_are_restored_and_stored_again_as_the_same_bytes() {
    // Fields that a later version has added to a group follow the bytes of 0.1.0.
    let entries = BY_FIRMWARE_0_1_0.map(|(id, payload)| (id, bytes_of(payload)));
    let stored = record(&entries.each_ref().map(|(id, payload)| (*id, &payload[..])));
    let mut host = built_with(settings(), found(&stored));
    assert_eq!(host.responder.address().get(), 9);
    let configured = host.new_settings();
    let pid = |[p, i, d, f]: [i32; 4]| {
        let [p, i, d, f] = [p, i, d, f].map(Coefficient::from_bits);
        Pidf { p, i, d, f }
    };
    let winding = Winding { emf: EmfConstant::from_bits(4_180_575).expect("in range"), ..settings().winding };
    let both = pid([10 << 16, 3 << 16, -1 << 16, 7 << 16]);
    let expected = [
        Settings {
            on_fault: OnFault::Brake,
            coefficients: Some(Coefficients {
                velocity: pid([806_916, 380_091, 0, 0]),
                position: pid([-1 << 16, 3 << 16, 10 << 16, 0]),
            }),
            ..settings()
        },
        Settings {
            winding: Winding { inductance: None, ..winding },
            scheme: Scheme::D(Blend::Automatic),
            duty: DutyRule::LinearDuty,
            acceleration: Acceleration::new(75_536).ok(),
            ..settings()
        },
        Settings {
            winding,
            bridge: settings().bridge.with_timing(Timing {
                least_off_ns: 1,
                least_on_ns: 2,
                turn_on_ns: 3,
                turn_off_ns: 4,
                change_us: 5,
            }),
            scheme: Scheme::D(Blend::Fixed(BlendFraction::HALF)),
            zero_power: ZeroPower::Float,
            on_fault: OnFault::Brake,
            thermal: ThermalLimit::new(2_000, 5, 200).ok(),
            dynamics: Some(Dynamics {
                gain: AccelerationPerVolt::from_bits(4 << 8).expect("above 0"),
                decay: DecayRate::from_bits(3 << 16),
                friction: Millivolts::new(100),
            }),
            coefficients: Some(Coefficients { velocity: both, position: both }),
            acceleration: Acceleration::new(10_000).ok(),
            ..settings()
        },
        settings(),
    ];
    assert_eq!(configured, expected);

    let again = save(&mut host);
    assert_eq!(again.entries().count(), stored.entries().count());
    for (again, stored) in again.entries().zip(stored.entries()) {
        let known = again.payload.get(..stored.payload.len());
        assert_eq!((again.id, known), (stored.id, Some(stored.payload)));
    }
}
