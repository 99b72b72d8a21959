//! Files in which a served hub stores its settings.

use embassy_futures::block_on;
use motor_hub::store::{Outcome, SettingsRecord, StoreRequest, Stored};
use motor_hub::tasks::store::Keeper;
use simulated::serve::{Memory, MemoryError};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Size of a page, and of the store, in bytes.
const PAGE: usize = 16 * 1024;
const SIZE: usize = 2 * PAGE;

/// Writes a file with this content, and returns its path.
fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, bytes).expect("a file");
    path
}

fn keeper(path: &Path) -> Keeper<Memory> {
    Keeper::new(Memory::open(path).expect("a store"), 0..SIZE as u32).expect("two pages")
}

/// A file with letters in a range, and erased bytes elsewhere.
fn letters(range: Range<usize>) -> Vec<u8> {
    let mut bytes = vec![0xFF; SIZE];
    bytes[range].fill(b'A');
    bytes
}

#[test]
fn a_foreign_file_with_the_size_of_a_store_is_refused_and_left_alone() {
    // A picture of a disk begins with zeros.
    let mut disk = vec![0; SIZE];
    disk[1024..].fill(0xEF);
    let mut marked = letters(PAGE..SIZE);
    marked[..8].copy_from_slice(&[0, 0, 0, 0, 1, 2, 3, 4]);
    let foreign = [
        letters(0..SIZE),
        letters(0..PAGE),
        letters(PAGE..SIZE),
        letters(100..PAGE),
        marked,
        vec![0; SIZE],
        disk,
    ];
    for (index, bytes) in foreign.iter().enumerate() {
        let path = file(&format!("foreign-{index}"), bytes);
        let refused = Memory::open(&path).expect_err("a foreign file");
        assert!(matches!(refused, MemoryError::NotAStore { size: 32_768, .. }), "{index}: {refused}");
        assert!(std::fs::read(&path).expect("a file") == *bytes, "{index} is changed");
    }
}

#[test]
fn a_store_is_opened_after_saves_and_after_an_erasure_that_was_interrupted() {
    let path = file("store", &[]);
    let mut full = Vec::new();
    // Saves until the settings have moved to the second page.
    for save in 1.. {
        let mut keeper = keeper(&path);
        block_on(keeper.read());
        let request =
            StoreRequest { record: Some(SettingsRecord::new(save)), erase_first: false, may_erase: true };
        assert_eq!(block_on(keeper.carry_out(&request)).outcome, Outcome::Done, "save {save}");
        let moved = std::fs::read(&path).expect("a file");
        if moved[0] != 0xFF {
            full = moved;
            continue;
        }
        for erased in [0, 512, 4096, PAGE - 512, PAGE] {
            let mut bytes = full.clone();
            bytes[..erased].fill(0xFF);
            let path = file("store-erased", &bytes);
            let stored = if erased == 0 { Stored::Whole } else { Stored::Nothing };
            assert_eq!(
                block_on(self::keeper(&path).read()).stored,
                stored,
                "{erased} bytes of the only page"
            );
            bytes[PAGE..].copy_from_slice(&moved[PAGE..]);
            let path = file("store-erased", &bytes);
            let found = block_on(self::keeper(&path).read());
            assert_eq!((found.stored, found.record.number()), (Stored::Whole, save), "{erased} bytes");
        }
        return;
    }
}
