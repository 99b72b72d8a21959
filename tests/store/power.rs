//! The power fails before, in and after each write.

use crate::flash::{read, write};
use crate::torn_flash::{Code, Cut, Flash, Random, Tear};
use motor_hub::store::{Found, Outcome, SettingsRecord, Stored};

/// Random entries with this number of bytes in total at most.
fn record(number: u32, random: &mut Random, most: usize) -> SettingsRecord {
    let mut record = SettingsRecord::new(number);
    let length = random.below(most);
    while record.bytes().len() < length {
        let payload: Vec<u8> = (0..random.below(20)).map(|_| random.byte()).collect();
        if record.push(random.next() as u16, &payload).is_err() {
            break;
        }
    }
    record
}

/// How many cuts were tried.
#[derive(Debug, Default)]
struct Tally {
    saves: usize,
    erasures: usize,
    cuts: usize,
    second_cuts: usize,
    /// Saves that failed because a word did not read back as written.
    failed: usize,
}

/// Checks the flash after power comes back: it has the old or the new settings.
fn survives<const WORD: usize, const PAGE: usize>(
    flash: &Flash<WORD, PAGE>,
    (old, new): (&SettingsRecord, &SettingsRecord),
    what: &dyn Fn() -> String,
) -> (Flash<WORD, PAGE>, SettingsRecord) {
    let mut flash = flash.powered_on();
    let found = read(&mut flash);
    assert!(found.record == *old || found.record == *new, "{}: {found:?}", what());
    // A cut in the first save is no damage.
    assert!(found.record.number() > 0 || found == Found::default(), "{}: {found:?}", what());
    (flash, found.record)
}

/// Makes a history of saves. `which` selects the steps of a save at which the power is cut. `which` gets the number of
/// steps, and true if the save erases a page. At each selected step the power is cut in every way.
fn history<const WORD: usize, const PAGE: usize>(
    saves: u32,
    longest: usize,
    code: Code,
    which: impl Fn(&mut Random, usize, bool) -> Vec<usize>,
) -> Tally {
    let mut random = Random(20_261_122);
    let mut tally = Tally::default();
    let mut flash = Flash::<WORD, PAGE>::new(2, code);
    let mut old = SettingsRecord::new(0);
    for number in 1..=saves {
        let new = record(number, &mut random, longest);
        let before = flash.clone();
        (flash.steps, flash.erased) = (0, 0);
        let done = write(&mut flash, &new, true);
        assert_eq!(done.outcome, Outcome::Done, "save {number}");
        let found = done.found.expect("motors are off");
        assert_eq!((found.stored, &found.record), (Stored::Whole, &new), "save {number}");
        tally.saves += 1;
        tally.erasures += flash.erased;

        for at in which(&mut random, flash.steps, flash.erased > 0) {
            for tear in [Tear::Before, Tear::Bits, Tear::Half, Tear::Ends] {
                // A word can be torn in one way only.
                if flash.erased == 0 && matches!(tear, Tear::Half | Tear::Ends) {
                    continue;
                }
                let seed = random.next();
                let what = || format!("save {number}, step {at} {tear:?} {seed:#x}");
                let mut cut = before.powered_on();
                cut.cut = Some(Cut { step: at, tear, seed });
                write(&mut cut, &new, true);
                let (mut again, held) = survives(&cut, (&old, &new), &what);
                tally.cuts += 1;
                if flash.erased == 0 && tally.cuts % 16 != 0 {
                    continue;
                }
                // The next save runs, and its power may fail too.
                let after = again.powered_on();
                let next = record(number + 1, &mut random, longest);
                again.steps = 0;
                let mut done = write(&mut again, &next, true);
                if code == Code::WritesBlank && done.outcome != Outcome::Done {
                    // A word does not read back, and the driver reports an error. The settings are still there, and the
                    // next save succeeds.
                    survives(&again, (&held, &next), &what);
                    tally.failed += 1;
                    done = write(&mut again, &next, true);
                }
                assert_eq!(
                    (done.outcome, done.found.map(|found| found.record)),
                    (Outcome::Done, Some(next.clone())),
                    "{}",
                    what()
                );
                if flash.erased > 0 {
                    let second = random.below(again.steps);
                    let tear = [Tear::Before, Tear::Bits, Tear::Half, Tear::Ends][random.below(4)];
                    let mut twice = after;
                    twice.cut = Some(Cut { step: second, tear, seed });
                    write(&mut twice, &next, true);
                    let what = || format!("{}, then step {second} {tear:?}", what());
                    survives(&twice, (&held, &next), &what);
                    tally.second_cuts += 1;
                }
            }
        }
        old = new;
    }
    tally
}

/// Returns random steps at which power is cut, and the last step: 30 steps of a save that erases, and one step of any
/// other save.
fn some(random: &mut Random, steps: usize, erases: bool) -> Vec<usize> {
    (0..if erases { 30 } else { 1 }).map(|_| random.below(steps)).chain([steps - 1]).collect()
}

fn every(_: &mut Random, steps: usize, _: bool) -> Vec<usize> {
    (0..steps).collect()
}

// Words and pages of the boards.
const F429: (usize, usize) = (4, 16 * 1024);
const H743: (usize, usize) = (32, 128 * 1024);

#[test]
fn a_hundred_saves_on_either_board_leave_the_old_value_or_the_new() {
    let tally = history::<{ F429.0 }, { F429.1 }>(100, 300, Code::None, some);
    assert!(tally.erasures >= 2 && tally.cuts > 300 && tally.second_cuts > 100, "{tally:?}");
    let tally = history::<{ H743.0 }, { H743.1 }>(100, 500, Code::Detects, some);
    assert!(tally.cuts > 150, "{tally:?}");
}

#[test]
#[ignore = "long: cargo xtask long"]
fn a_thousand_saves_on_either_board_leave_the_old_value_or_the_new() {
    let tally = history::<{ F429.0 }, { F429.1 }>(1_000, 300, Code::None, some);
    assert!(tally.erasures >= 20 && tally.cuts > 5_000 && tally.second_cuts > 2_000, "{tally:?}");
    let tally = history::<{ H743.0 }, { H743.1 }>(1_000, 500, Code::Detects, some);
    assert!(tally.erasures >= 3 && tally.cuts > 2_000 && tally.second_cuts > 100, "{tally:?}");
}

#[test]
fn every_word_of_many_small_saves_may_be_the_last() {
    // Pages of 1 KB and 4 KB are erased every few saves.
    let tally = history::<4, 1024>(500, 70, Code::None, every);
    assert!(tally.erasures >= 50 && tally.cuts > 20_000 && tally.second_cuts > 5_000, "{tally:?}");
    for code in [Code::Detects, Code::WritesBlank] {
        let tally = history::<32, 4096>(500, 200, code, every);
        assert!(tally.erasures >= 30 && tally.cuts > 8_000 && tally.second_cuts > 2_000, "{tally:?}");
        assert_eq!(tally.failed > 0, code == Code::WritesBlank, "{tally:?}");
    }
}
