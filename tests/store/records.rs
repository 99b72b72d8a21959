//! Tests which bytes are accepted as a record.

use crate::flash::{read, reset, write};
use crate::torn_flash::{Code, Flash, Random};
use motor_hub::store::{CAPACITY, Found, Outcome, SettingsRecord, Stored, VERSION};
use proptest::prelude::*;

fn found(copies: &[Option<&[u8]>]) -> (Stored, u8, u32) {
    let mut found = Found::default();
    copies.iter().for_each(|copy| found.add(*copy));
    (found.stored, found.version, found.record.number())
}

#[test]
fn entries_are_read_in_their_order() {
    let mut record = SettingsRecord::new(0x0403_0201);
    record.push(0x4D00, &[1, 2, 3]).expect("room");
    record.push(0x7F06, &[]).expect("room");
    assert_eq!(record.bytes(), [1, 1, 2, 3, 4, 0x00, 0x4D, 3, 1, 2, 3, 0x06, 0x7F, 0]);
    let again = SettingsRecord::read(record.bytes()).expect("a record");
    assert_eq!((again.number(), again), (0x0403_0201, record.clone()));
    let entries: Vec<_> = record.entries().map(|entry| (entry.id, entry.payload.to_vec())).collect();
    assert_eq!(entries, [(0x4D00, vec![1, 2, 3]), (0x7F06, vec![])]);
}

#[test]
fn an_entry_without_room_is_left_out_whole() {
    let mut record = SettingsRecord::new(1);
    assert!(record.push(1, &[0; 256]).is_err());
    record.push(1, &[0; 255]).expect("room");
    record.push(1, &[0; 29]).expect("room");
    let rest = CAPACITY - record.bytes().len() - 3;
    let before = record.clone();
    assert!(record.push(2, &vec![0; rest + 1]).is_err());
    assert_eq!(record, before);
    record.push(2, &vec![0; rest]).expect("room");
    assert_eq!(record.bytes().len(), CAPACITY);
    assert!(record.push(3, &[]).is_err());
}

#[test]
fn a_later_version_is_not_taken_for_damage() {
    for version in VERSION + 1..=u8::MAX {
        assert_eq!(found(&[Some(&[version, 1, 2, 3])]), (Stored::Later, version, 0));
    }
    for nonsense in [
        &[][..],
        &[0; 10],
        &[VERSION, 0, 0, 0],
        &[VERSION, 0, 0, 0, 0, 1, 2],
        &[VERSION, 0, 0, 0, 0, 1, 2, 3, 4, 5],
    ] {
        assert_eq!(found(&[Some(nonsense)]), (Stored::Damaged, 0, 0), "{nonsense:?}");
    }
}

#[test]
fn the_newer_of_two_copies_counts_and_a_later_version_above_all() {
    let [old, new] = [SettingsRecord::new(7), SettingsRecord::new(8)];
    let (old, new) = (Some(old.bytes()), Some(new.bytes()));
    let later = Some(&[9, 0][..]);
    let nonsense = Some(&[0][..]);
    for (copies, what) in [
        ([None, None], (Stored::Nothing, 0, 0)),
        ([new, new], (Stored::Whole, 1, 8)),
        ([new, old], (Stored::OneCopy, 1, 8)),
        ([new, None], (Stored::OneCopy, 1, 8)),
        ([new, nonsense], (Stored::OneCopy, 1, 8)),
        ([nonsense, None], (Stored::Damaged, 0, 0)),
        ([later, None], (Stored::Later, 9, 0)),
        ([later, new], (Stored::Later, 9, 0)),
    ] {
        let [a, b] = copies;
        assert_eq!(found(&[a, b]), what, "{copies:?}");
        assert_eq!(found(&[b, a]), what, "{copies:?} the other way round");
    }
}

#[test]
fn any_contents_of_a_flash_are_read_in_finite_time() {
    let mut random = Random(1);
    let mut nothing = 0;
    for round in 0..300 {
        let mut flash = Flash::<4, 1024>::new(2, Code::None);
        let record = SettingsRecord::new(5);
        if round % 2 == 0 {
            write(&mut flash, &record, true);
        }
        // Between one byte and the whole flash is written.
        let bytes = 1 << random.below(12);
        for _ in 0..bytes {
            let at = random.below(2048);
            flash.bytes[at] = random.byte();
        }
        let found = read(&mut flash);
        nothing += u32::from(found.record.number() != 5);
        // Any contents can be erased and written.
        let done = reset(&mut flash, &record);
        assert_eq!((done.outcome, read(&mut flash).record), (Outcome::Done, record), "round {round}");
    }
    assert!(nothing > 100, "{nothing}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// No bytes cause a panic. A record that is accepted has the same contents when it is written and read again.
    #[test]
    fn any_bytes_are_read_or_refused(mut bytes in prop::collection::vec(any::<u8>(), 0..600), known in any::<bool>()) {
        if let Some(first) = bytes.first_mut().filter(|_| known) {
            *first = VERSION;
        }
        if let Some(record) = SettingsRecord::read(&bytes) {
            let mut again = SettingsRecord::new(record.number());
            for entry in record.entries() {
                again.push(entry.id, entry.payload).expect("it was there");
            }
            prop_assert_eq!(again, record);
        }
    }
}
