//! Damaged bits, memories that fail, and saves while motors run.

use crate::flash::{block_on, read, reset, write};
use crate::torn_flash::{Code, Flash, Wear};
use motor_hub::store::{Found, Outcome, SettingsRecord, Stored};
use motor_hub::tasks::store::Keeper;
use sequential_storage::cache::Cache;
use sequential_storage::map::{MapConfig, MapStorage};

fn record(number: u32) -> SettingsRecord {
    let mut record = SettingsRecord::new(number);
    record.push(0x4D00, &[number as u8; 40]).expect("room");
    record
}

/// Makes two saves with the numbers 1 and 2. Returns the flash, and the offsets at which each save ends.
fn two_saves<const WORD: usize, const PAGE: usize>() -> (Flash<WORD, PAGE>, [usize; 2]) {
    let mut flash = Flash::new(2, Code::None);
    let end = |flash: &Flash<WORD, PAGE>| {
        flash.bytes[..PAGE].iter().rposition(|byte| *byte != 0xFF).expect("written").next_multiple_of(WORD)
    };
    write(&mut flash, &record(1), true);
    let first = end(&flash);
    write(&mut flash, &record(2), true);
    let second = end(&flash);
    (flash, [first, second])
}

fn each_bit_turned<const WORD: usize, const PAGE: usize>() {
    let (whole, [first, second]) = two_saves::<WORD, PAGE>();
    assert_eq!(read(&mut whole.clone()).stored, Stored::Whole);
    let mut reported = 0;
    for bit in 8 * first..8 * second {
        let mut flash = whole.clone();
        flash.bytes[bit / 8] ^= 1 << (bit % 8);
        let Found { stored, record: found, .. } = read(&mut flash);
        // Each record has two copies. The other copy is intact, so the latest record is found.
        assert_eq!(found, record(2), "bit {bit}");
        assert!(matches!(stored, Stored::Whole | Stored::OneCopy), "bit {bit}: {stored:?}");
        reported += usize::from(stored == Stored::OneCopy);
        // The next save repairs the damage.
        let done = write(&mut flash, &record(3), true);
        assert_eq!((done.outcome, read(&mut flash).stored), (Outcome::Done, Stored::Whole), "bit {bit}");
    }
    // The reported bits are in the item: its head of 8 bytes, its key, and the record. The rest is padding.
    let item = 8 + 1 + record(2).bytes().len();
    assert_eq!(reported, 2 * 8 * item);
}

#[test]
fn each_flipped_bit_is_reported_and_loses_nothing() {
    each_bit_turned::<4, { 16 * 1024 }>();
    each_bit_turned::<32, { 16 * 1024 }>();
}

#[test]
fn a_record_whose_both_copies_are_damaged_falls_back_on_the_one_before() {
    let (mut flash, [first, second]) = two_saves::<4, 1024>();
    let half = (first + second) / 2;
    flash.bytes[first + 20] ^= 4;
    flash.bytes[half + 20] ^= 4;
    let found = read(&mut flash);
    assert_eq!((found.stored, found.record), (Stored::Whole, record(1)));
}

/// Turns one bit in each copy of the only save.
fn both_copies_of_the_only_save_damaged<const WORD: usize, const PAGE: usize>() {
    let mut whole = Flash::<WORD, PAGE>::new(2, Code::None);
    write(&mut whole, &record(1), true);
    let item = 8usize.next_multiple_of(WORD) + (1 + record(1).bytes().len()).next_multiple_of(WORD);
    // The head of an item has 8 bytes. The other bytes of the item begin in its next word.
    let bits = |copy: usize| {
        let start = WORD + copy * item;
        let content = start + 8usize.next_multiple_of(WORD);
        (8 * start..8 * (start + 8)).chain(8 * content..8 * (content + 1 + record(1).bytes().len()))
    };
    for (first, second) in
        bits(0).flat_map(|first| bits(1).skip(first % 11).step_by(11).map(move |second| (first, second)))
    {
        let mut flash = whole.clone();
        for bit in [first, second] {
            flash.bytes[bit / 8] ^= 1 << (bit % 8);
        }
        let found = read(&mut flash);
        assert_eq!(found, Found::without_record(Stored::Damaged, 0), "bits {first} and {second}");
        // A reset of the settings erases the damaged copies.
        let done = reset(&mut flash, &SettingsRecord::new(1));
        assert_eq!(done.found.map(|found| found.stored), Some(Stored::Whole), "bits {first} and {second}");
    }
}

#[test]
fn a_store_whose_both_copies_are_damaged_is_reported_as_damaged() {
    both_copies_of_the_only_save_damaged::<4, 1024>();
    both_copies_of_the_only_save_damaged::<32, 4096>();
}

/// Stores a value that this firmware would not store, under the key of a copy of the record.
fn store_as_is(flash: &mut Flash<4, 1024>, key: u8, value: &[u8]) {
    let mut map = MapStorage::<u8, _, _>::new(flash, MapConfig::new(0..2048), Cache::new_uncached());
    assert!(block_on(map.store_item(&mut [0; 1024], &key, &value)).is_ok());
}

#[test]
fn a_later_version_is_reported_and_kept() {
    let later = [2, 1, 0, 0, 0, 42];
    let longer = [1; 600];
    for (value, version) in [(&later[..], 2), (&longer, 0)] {
        let mut flash = Flash::<4, 1024>::new(2, Code::None);
        write(&mut flash, &record(1), true);
        store_as_is(&mut flash, 1, value);
        let before = flash.bytes.clone();
        let found = read(&mut flash);
        assert_eq!((found.stored, found.version, found.record.number()), (Stored::Later, version, 0));
        assert_eq!(flash.bytes, before);
    }
}

#[test]
fn a_memory_that_loses_writes_is_reported() {
    // The second memory stores only the marks of pages, which are words of zeros.
    let no_mark: fn(&[u8]) -> bool = |word| word != [0; 4];
    for (wear, outcome) in [(Wear::Refuses, Outcome::Refused), (Wear::Drops(no_mark), Outcome::Lost)] {
        let mut flash = Flash::<4, 1024>::new(2, Code::None);
        flash.wear = wear;
        let done = write(&mut flash, &record(1), true);
        assert_eq!(done.outcome, outcome);
        assert_eq!(done.found.map(|found| found.stored), Some(Stored::Nothing));
    }
}

#[test]
fn a_range_that_is_not_two_pages_is_refused() {
    for range in [0..1024, 0..3072, 512..2560, 0..0] {
        let mut flash = Flash::<4, 1024>::new(2, Code::None);
        assert!(Keeper::new(&mut flash, range.clone()).is_none(), "{range:?}");
    }
}

#[test]
fn nothing_is_erased_while_motors_run() {
    let mut flash = Flash::<4, 1024>::new(2, Code::None);
    let mut refused = 0;
    let mut last = SettingsRecord::new(0);
    for number in 1..=60 {
        let before = flash.erased;
        let done = write(&mut flash, &record(number), false);
        assert_eq!(flash.erased, before, "save {number}");
        if done.outcome == Outcome::Done {
            last = record(number);
            continue;
        }
        assert_eq!(done.outcome, Outcome::NeedsErase, "save {number}");
        assert!(done.found.is_none_or(|found| found.record == last), "save {number}");
        assert_eq!(read(&mut flash.clone()).record, last, "save {number}");
        refused += 1;
        let done = write(&mut flash, &record(number), true);
        assert_eq!(done.outcome, Outcome::Done, "save {number}");
        last = record(number);
    }
    assert!(refused >= 5, "{refused}");
}
