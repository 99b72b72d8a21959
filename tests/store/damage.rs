//! Bits that turn, memories that fail, motors that run.

use crate::flash::{Flash, NoPower, block_on, keeper, read, write};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use motor_hub::store::{Found, Order, Outcome, Record, Stored};
use motor_hub::tasks::store::Keeper;

fn record(number: u32) -> Record {
    let mut record = Record::new(number);
    record.push(0x4D00, &[number as u8; 40]).expect("room");
    record
}

/// Saves 1 and 2, and how far each has filled the first page.
fn two_saves<const WORD: usize, const PAGE: usize>() -> (Flash<WORD, PAGE>, [usize; 3]) {
    let mut flash = Flash::new();
    let end = |flash: &Flash<WORD, PAGE>| {
        flash.bytes[..PAGE].iter().rposition(|byte| *byte != 0xFF).expect("written").next_multiple_of(WORD)
    };
    write(&mut flash, &record(1), true);
    let first = end(&flash);
    write(&mut flash, &record(2), true);
    let second = end(&flash);
    (flash, [WORD, first, second])
}

fn each_bit_turned<const WORD: usize, const PAGE: usize>() {
    let (whole, [_, first, second]) = two_saves::<WORD, PAGE>();
    assert_eq!(read(&mut whole.clone()).stored, Stored::Whole);
    let mut told = 0;
    for bit in 8 * first..8 * second {
        let mut flash = whole.clone();
        flash.bytes[bit / 8] ^= 1 << (bit % 8);
        let Found { stored, record: found, .. } = read(&mut flash);
        // With a copy of it whole not even the latest is lost.
        assert_eq!(found, record(2), "bit {bit}");
        assert!(matches!(stored, Stored::Whole | Stored::OneCopy), "bit {bit}: {stored:?}");
        told += usize::from(stored == Stored::OneCopy);
        // The next save makes it good.
        let done = write(&mut flash, &record(3), true);
        assert_eq!((done.outcome, read(&mut flash).stored), (Outcome::Done, Stored::Whole), "bit {bit}");
    }
    // Those that are told are those of the item: its head of 8 bytes, its key, and the record; the rest is padding.
    let item = 8 + 1 + record(2).bytes().len();
    assert_eq!(told, 2 * 8 * item);
}

#[test]
fn each_bit_that_turns_is_told_and_costs_nothing() {
    each_bit_turned::<4, { 16 * 1024 }>();
    each_bit_turned::<32, { 16 * 1024 }>();
}

#[test]
fn a_record_whose_both_copies_are_damaged_falls_back_on_the_one_before() {
    let (mut flash, [_, first, second]) = two_saves::<4, 1024>();
    let half = (first + second) / 2;
    flash.bytes[first + 20] ^= 4;
    flash.bytes[half + 20] ^= 4;
    let found = read(&mut flash);
    assert_eq!((found.stored, found.record), (Stored::Whole, record(1)));
}

#[test]
fn a_later_version_is_kept_until_it_is_written_over() {
    // As a firmware to come may have written it, with the same keys.
    let mut flash = Flash::<4, 1024>::new();
    write(&mut flash, &record(1), true);
    let bytes = flash.bytes.clone();
    let later = bytes.windows(6).position(|it| it[..6] == [1, 1, 1, 0, 0, 0]).expect("key 1, version 1, save 1");
    let mut map = later_map(&mut flash);
    let value: &[u8] = &[2, 1, 0, 0, 0, 42];
    block_on(map.store_item(&mut [0; 64], &1, &value)).expect("room");
    drop(map);
    assert_eq!(flash.bytes[later], 1, "the old one is still there");
    let found = read(&mut flash);
    assert_eq!((found.stored, found.version, found.record.number()), (Stored::Later, 2, 0));
    assert_eq!(block_on(later_map(&mut flash).fetch_item::<&[u8]>(&mut [0; 64], &1)), Ok(Some(value)).map_err(|()| unreachable()));
}

#[test]
fn nothing_is_erased_while_motors_run() {
    let mut flash = Flash::<4, 1024>::new();
    let mut refused = 0;
    let mut last = Record::new(0);
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
