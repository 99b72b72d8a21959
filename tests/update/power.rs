//! Updates and rollbacks by the bootloader over a flash in memory. The power fails before, in and after every write and
//! erasure, and a second time afterwards. The firmware before or the new firmware must boot.

use crate::torn_flash::{Code, Cut, Flash, NoPower, Random, Tear};
use embassy_boot::{BootLoader, BootLoaderConfig};
use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use motor_hub::tasks::update::{BlockingFlash, Slots, StateFlash, discard_stale_swap};
use motor_hub::update::{Booted, CHUNK, CRC, Outcome};
use std::cell::RefCell;
use std::future::ready;
use std::ops::Range;

/// The word of an STM32H743 in bytes. Pages are smaller than on the chip: they have as many words as the state of the
/// slots needs, in whole buffers.
pub(crate) const WORD: usize = 32;
const PAGE: usize = 20 * WORD;

/// Pages of the booted slot, of the written slot, and of the state.
pub(crate) const ACTIVE: Range<usize> = 0..3 * PAGE;
pub(crate) const DOWNLOAD: Range<usize> = 3 * PAGE..7 * PAGE;
pub(crate) const STATE: Range<usize> = 7 * PAGE..8 * PAGE;

/// Length of both images in bytes. It is neither a multiple of a page nor of a word.
const LENGTH: usize = 2 * PAGE + 5 * WORD + 7;

/// States of a page after a cut.
const TEARS: [Tear; 4] = [Tear::Before, Tear::Bits, Tear::Half, Tear::First];

pub(crate) type Chip = Flash<WORD, PAGE>;

/// A chip with the first firmware.
pub(crate) fn new_chip(code: Code) -> RefCell<Chip> {
    let mut chip = Chip::new(STATE.end / PAGE, code);
    chip.put(ACTIVE.start, &image(1));
    RefCell::new(chip)
}

/// A part of the chip's flash, for blocking and for async access.
#[derive(Clone)]
pub(crate) struct Part<'a>(pub(crate) &'a RefCell<Chip>, pub(crate) Range<usize>);

impl ErrorType for Part<'_> {
    type Error = NoPower;
}

impl ReadNorFlash for Part<'_> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NoPower> {
        assert!(offset as usize + bytes.len() <= self.1.len());
        self.0.borrow().read(self.1.start + offset as usize, bytes)
    }

    fn capacity(&self) -> usize {
        self.1.len()
    }
}

impl NorFlash for Part<'_> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NoPower> {
        assert!(to as usize <= self.1.len());
        self.0.borrow_mut().erase(self.1.start + from as usize, self.1.start + to as usize)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NoPower> {
        assert!(offset as usize + bytes.len() <= self.1.len());
        self.0.borrow_mut().write(self.1.start + offset as usize, bytes)
    }
}

/// The firmware of this version.
fn image(version: u8) -> Vec<u8> {
    let mut random = Random(version.into());
    (0..LENGTH).map(|_| random.byte()).collect()
}

/// Version of the firmware that the bootloader starts after power-on or a reset.
fn boot(chip: &RefCell<Chip>) -> Result<u8, NoPower> {
    let idle = || unreachable!("this flash is never busy");
    let erasing = || ();
    let found = block_on(discard_stale_swap(&mut Part(chip, ACTIVE), &mut StateFlash(Part(chip, STATE))));
    chip.borrow().has_power()?;
    found.expect("only power fails");
    let config = BootLoaderConfig {
        active: BlockingFlash { flash: Part(chip, ACTIVE), idle, erasing },
        dfu: BlockingFlash { flash: Part(chip, DOWNLOAD), idle, erasing },
        state: BlockingFlash { flash: StateFlash(Part(chip, STATE)), idle, erasing },
    };
    let done = BootLoader::new(config).prepare_boot(&mut [0; 2 * WORD]);
    chip.borrow().has_power()?;
    done.expect("only power fails");
    let mut booted = vec![0; LENGTH];
    chip.borrow().read(ACTIVE.start, &mut booted)?;
    let version = (1..=3).find(|version| image(*version) == booted);
    Ok(version.expect("what boots is one whole firmware"))
}

pub(crate) fn slots(chip: &RefCell<Chip>) -> Slots<Part<'_>, Part<'_>, Part<'_>> {
    Slots::new(Part(chip, ACTIVE), Part(chip, DOWNLOAD), Part(chip, STATE)).expect("words that fit")
}

/// Writes an image in chunks, until a write fails.
pub(crate) fn send(slots: &mut Slots<Part<'_>, Part<'_>, Part<'_>>, image: &[u8]) -> Outcome {
    let chunks = (0..).step_by(CHUNK).zip(image.chunks(CHUNK));
    let mut outcomes = chunks.map(|(at, bytes)| block_on(slots.write(at, bytes)));
    outcomes.find(|outcome| *outcome != Outcome::Done).unwrap_or(Outcome::Done)
}

/// Runs from power-on until the hub runs confirmed firmware. Good firmware confirms itself. Otherwise the firmware
/// before runs again.
fn live(chip: &RefCell<Chip>, good: bool) -> Result<(), NoPower> {
    let mut version = boot(chip)?;
    let mut tried = false;
    let mut slots = slots(chip);
    let done = |outcome| if outcome == Outcome::Done { Ok(()) } else { Err(NoPower) };
    for _ in 0..8 {
        let booted = block_on(slots.booted());
        chip.borrow().has_power()?;
        match (booted, version) {
            (Booted::OnTrial, 2) if good => done(block_on(slots.confirm()))?,
            // The firmware hangs, and the watchdog resets the chip.
            (Booted::OnTrial, 2) => version = boot(chip)?,
            (Booted::OnTrial, _) => panic!("the firmware before is not on trial"),
            (Booted::Reverted, 2) => panic!("the new firmware is not the firmware before"),
            (_, 2) => {
                assert!(good, "what hangs is confirmed");
                return Ok(());
            }
            (_, _) if tried && !good => return Ok(()),
            _ => {
                tried = true;
                let new = image(2);
                done(send(&mut slots, &new))?;
                let mut arm = |crc| block_on(slots.arm(LENGTH as u32, crc, None, ready(())));
                assert_eq!(arm(!CRC.checksum(&new)), Outcome::Mismatch);
                done(arm(CRC.checksum(&new)))?;
                version = boot(chip)?;
            }
        }
    }
    panic!("no confirmed firmware after all restarts");
}

/// Cuts the power at every step of an update, and again at some steps after the cut.
fn cut_everywhere(good: bool, code: Code) {
    for (cuts, (left, what)) in (1..).zip(cuts_of(good, code)) {
        let mended = RefCell::new(left.clone());
        live(&mended, good).unwrap_or_else(|_| panic!("no life after {what}"));
        // A second cut after the first one, with another state of the word.
        let steps = mended.borrow().steps;
        for again in (cuts % 41..steps).step_by(41) {
            let tear = TEARS[(again + cuts) % TEARS.len()];
            let chip = RefCell::new(left.clone());
            chip.borrow_mut().cut = Some(Cut { step: again, tear, seed: again as u64 });
            live(&chip, good).expect_err("power goes");
            let mended = RefCell::new(chip.into_inner().powered_on());
            live(&mended, good).unwrap_or_else(|_| panic!("no life after {what}, and {again}"));
        }
    }
}

/// The chip after a cut at every step of an update, with a description of the cut.
fn cuts_of(good: bool, code: Code) -> impl Iterator<Item = (Chip, String)> {
    let whole = new_chip(code);
    live(&whole, good).expect("power");
    let steps = whole.into_inner().steps;
    (0..steps).flat_map(|at| TEARS.map(|tear| (at, tear))).map(move |(at, tear)| {
        let chip = new_chip(code);
        chip.borrow_mut().cut = Some(Cut { step: at, tear, seed: at as u64 });
        live(&chip, good).expect_err("power goes");
        (chip.borrow().powered_on(), format!("{tear:?} at step {at}"))
    })
}

const CODES: [Code; 3] = [Code::None, Code::Detects, Code::Corrects];

#[test]
fn an_update_that_loses_power_anywhere_boots_the_firmware_before_or_the_new_one() {
    for code in CODES {
        cut_everywhere(true, code);
    }
}

#[test]
fn a_rollback_that_loses_power_anywhere_boots_one_of_both_and_ends_with_the_firmware_before() {
    for code in CODES {
        cut_everywhere(false, code);
    }
}

#[test]
fn what_a_probe_has_written_boots_whatever_swap_was_ordered_or_begun_before() {
    for good in [true, false] {
        for (left, what) in cuts_of(good, Code::Detects) {
            let mut left = left;
            left.put(ACTIVE.start, &[0xFF; ACTIVE.end - ACTIVE.start]);
            left.put(ACTIVE.start, &image(3));
            let chip = RefCell::new(left);
            for boots in 1..=2 {
                assert_eq!(boot(&chip).expect("power"), 3, "boot {boots} after {what}");
            }
            assert_ne!(block_on(slots(&chip).booted()), Booted::OnTrial, "{what}");
        }
    }
}
