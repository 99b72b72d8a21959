//! Updates and rollbacks by the bootloader over a flash in memory. The power fails before, in and after every write and
//! erasure, and a second time afterwards. The firmware before or the new firmware must boot.

use crate::torn_flash::{NoPower, Random};
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

/// Bytes of both images: not whole pages, nor whole words.
const LENGTH: usize = 2 * PAGE + 5 * WORD + 7;

/// State of the word or page at which the power fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tear {
    /// The step has not begun.
    Before,
    /// Each bit has changed, or has not.
    Bits,
    /// An erasure has got half way, from the front; a word is as with `Bits`.
    Half,
    /// An erasure has spared the first word alone, and made all else blank; a word is as with `Bits`.
    First,
}

const TEARS: [Tear; 4] = [Tear::Before, Tear::Bits, Tear::Half, Tear::First];

/// Codes that a flash has for its words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Code {
    None,
    /// The code of a word that was written twice fits the word, or no word at all: the board reads zeros.
    Detects,
    /// The code of a word that was written twice makes the flash turn a bit of the word.
    Corrects,
}

/// A chip's flash.
#[derive(Clone)]
pub(crate) struct Chip {
    bytes: Vec<u8>,
    /// Words with an error-correcting code that does not fit, which the board reads as zeros; none on a chip without.
    torn: Vec<bool>,
    code: Code,
    steps: usize,
    cut: Option<(usize, Tear)>,
}

impl Chip {
    pub(crate) fn new(code: Code) -> RefCell<Self> {
        let mut bytes = vec![0xFF; STATE.end];
        bytes[ACTIVE][..LENGTH].copy_from_slice(&image(1));
        RefCell::new(Self { bytes, torn: vec![false; STATE.end / WORD], code, steps: 0, cut: None })
    }

    /// Puts bytes into the flash, as a fault or a probe may.
    pub(crate) fn put(&mut self, at: usize, bytes: &[u8]) {
        self.bytes[at..at + bytes.len()].copy_from_slice(bytes);
    }

    /// Turns the lowest bit of a byte.
    pub(crate) fn turn_bit(&mut self, at: usize) {
        self.bytes[at] ^= 1;
    }

    fn alive(&self) -> Result<(), NoPower> {
        if self.cut.is_some_and(|(at, _)| self.steps > at) { Err(NoPower) } else { Ok(()) }
    }

    /// Begins the next step. Returns how the power fails in it, `None` if it does not.
    fn step(&mut self) -> Result<Option<(Tear, Random)>, NoPower> {
        self.alive()?;
        let step = self.steps;
        self.steps += 1;
        Ok(self.cut.filter(|(at, _)| *at == step).map(|(_, tear)| (tear, Random(step as u64))))
    }

    fn read(&self, at: usize, bytes: &mut [u8]) -> Result<(), NoPower> {
        self.alive()?;
        for (byte, at) in bytes.iter_mut().zip(at..) {
            *byte = if self.torn[at / WORD] { 0 } else { self.bytes[at] };
        }
        Ok(())
    }

    fn write(&mut self, at: usize, bytes: &[u8]) -> Result<(), NoPower> {
        assert_eq!([at % WORD, bytes.len() % WORD], [0; 2], "whole words");
        for (at, bytes) in (at..).step_by(WORD).zip(bytes.chunks(WORD)) {
            let cut = self.step()?;
            let word = &mut self.bytes[at..at + WORD];
            let blank = word.iter().all(|byte| *byte == 0xFF);
            assert!(blank || bytes.iter().all(|byte| *byte == 0), "written again at {at}");
            match cut {
                Some((Tear::Before, _)) => return Err(NoPower),
                Some((_, mut random)) => {
                    word.iter_mut().zip(bytes).for_each(|(old, new)| *old &= new | random.byte());
                    self.torn[at / WORD] = self.code != Code::None;
                    return Err(NoPower);
                }
                None => word.copy_from_slice(bytes),
            }
            if !blank && self.code == Code::Corrects {
                word[WORD / 2] ^= 1;
                // The driver reads the word back.
                return Err(NoPower);
            }
        }
        Ok(())
    }

    fn erase(&mut self, from: usize, to: usize) -> Result<(), NoPower> {
        assert_eq!([from % PAGE, to % PAGE], [0; 2], "whole pages");
        for at in (from..to).step_by(PAGE) {
            let cut = self.step()?;
            let page = &mut self.bytes[at..at + PAGE];
            let torn = &mut self.torn[at / WORD..(at + PAGE) / WORD];
            let Some((tear, mut random)) = cut else {
                page.fill(0xFF);
                torn.fill(false);
                continue;
            };
            match tear {
                Tear::Before => (),
                Tear::Bits => {
                    page.iter_mut().for_each(|byte| *byte |= random.byte());
                    torn.fill(self.code != Code::None);
                }
                Tear::Half => {
                    page[..PAGE / 2].fill(0xFF);
                    torn[..PAGE / 2 / WORD].fill(false);
                }
                Tear::First => {
                    page[WORD..].fill(0xFF);
                    torn[1..].fill(false);
                }
            }
            return Err(NoPower);
        }
        Ok(())
    }
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
    chip.borrow().alive()?;
    found.expect("only power fails");
    let config = BootLoaderConfig {
        active: BlockingFlash { flash: Part(chip, ACTIVE), idle, erasing },
        dfu: BlockingFlash { flash: Part(chip, DOWNLOAD), idle, erasing },
        state: BlockingFlash { flash: StateFlash(Part(chip, STATE)), idle, erasing },
    };
    let done = BootLoader::new(config).prepare_boot(&mut [0; 2 * WORD]);
    chip.borrow().alive()?;
    done.expect("only power fails");
    let mut booted = vec![0; LENGTH];
    chip.borrow().read(ACTIVE.start, &mut booted)?;
    let version = (1..=3).find(|version| image(*version) == booted);
    Ok(version.expect("what boots is one whole firmware"))
}

pub(crate) fn slots(chip: &RefCell<Chip>) -> Slots<Part<'_>, Part<'_>, Part<'_>> {
    Slots::new(Part(chip, ACTIVE), Part(chip, DOWNLOAD), Part(chip, STATE)).expect("words that fit")
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
        chip.borrow().alive()?;
        match (booted, version) {
            (Booted::OnTrial, 2) if good => done(block_on(slots.confirm()))?,
            // The firmware hangs, and the watchdog resets the chip.
            (Booted::OnTrial, 2) => version = boot(chip)?,
            (Booted::OnTrial, _) => panic!("the firmware before is not on trial"),
            (_, 2) => {
                assert!(good, "what hangs is confirmed");
                return Ok(());
            }
            (_, _) if tried && !good => return Ok(()),
            _ => {
                tried = true;
                let new = image(2);
                for (at, bytes) in (0..).step_by(CHUNK).zip(new.chunks(CHUNK)) {
                    done(block_on(slots.write(at, bytes)))?;
                }
                let mut arm = |crc| block_on(slots.arm(LENGTH as u32, crc, None, ready(())));
                assert_eq!(arm(!CRC.checksum(&new)), Outcome::Mismatch);
                done(arm(CRC.checksum(&new)))?;
                version = boot(chip)?;
            }
        }
    }
    panic!("it comes to no end");
}

/// Cuts the power at every step of an update, and again at every step after the cut.
fn cut_everywhere(good: bool, code: Code) -> (usize, usize) {
    let (mut cuts, mut second_cuts) = (0, 0);
    for (left, what) in cuts_of(good, code) {
        cuts += 1;
        let mended = RefCell::new(left.clone());
        live(&mended, good).unwrap_or_else(|_| panic!("no life after {what}"));
        // A second cut after the first one, with another state of the word.
        let steps = mended.borrow().steps;
        for again in (cuts % 41..steps).step_by(41) {
            let tear = TEARS[(again + cuts) % TEARS.len()];
            let chip = RefCell::new(Chip { cut: Some((again, tear)), ..left.clone() });
            live(&chip, good).expect_err("power goes");
            second_cuts += 1;
            let mended = RefCell::new(Chip { steps: 0, cut: None, ..chip.into_inner() });
            live(&mended, good).unwrap_or_else(|_| panic!("no life after {what}, and {again}"));
        }
    }
    (cuts, second_cuts)
}

/// The chip after a cut at every step of an update, with a description of the cut.
fn cuts_of(good: bool, code: Code) -> impl Iterator<Item = (Chip, String)> {
    let whole = Chip::new(code);
    live(&whole, good).expect("power");
    let steps = whole.into_inner().steps;
    (0..steps).flat_map(|at| TEARS.map(|tear| (at, tear))).map(move |(at, tear)| {
        let chip = Chip::new(code);
        chip.borrow_mut().cut = Some((at, tear));
        live(&chip, good).expect_err("power goes");
        (Chip { steps: 0, cut: None, ..chip.into_inner() }, format!("{tear:?} at step {at}"))
    })
}

const CODES: [Code; 3] = [Code::None, Code::Detects, Code::Corrects];

#[test]
fn an_update_that_loses_power_anywhere_boots_the_firmware_before_or_the_new_one() {
    for code in CODES {
        println!("{code:?}: (cuts, second cuts) {:?}", cut_everywhere(true, code));
    }
}

#[test]
fn a_rollback_that_loses_power_anywhere_boots_one_of_both_and_ends_with_the_firmware_before() {
    for code in CODES {
        println!("{code:?}: (cuts, second cuts) {:?}", cut_everywhere(false, code));
    }
}

#[test]
fn what_a_probe_has_written_boots_whatever_swap_was_ordered_or_begun_before() {
    for good in [true, false] {
        for (left, what) in cuts_of(good, Code::Detects) {
            let mut left = left;
            left.bytes[ACTIVE].fill(0xFF);
            left.bytes[ACTIVE][..LENGTH].copy_from_slice(&image(3));
            left.torn[ACTIVE.start / WORD..ACTIVE.end / WORD].fill(false);
            let chip = RefCell::new(left);
            for boots in 1..=2 {
                assert_eq!(boot(&chip).expect("power"), 3, "boot {boots} after {what}");
            }
            assert_ne!(block_on(slots(&chip).booted()), Booted::OnTrial, "{what}");
        }
    }
}
