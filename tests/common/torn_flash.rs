//! A NOR flash in memory that loses power at a chosen step, for the tests of stored settings and of updates.

#![allow(dead_code, reason = "each test uses its own part")]

use embedded_storage_async::nor_flash::{NorFlashError, NorFlashErrorKind};

/// Random numbers (splitmix64), which are equal for equal seeds.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    /// A number below `end`.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    pub(crate) fn byte(&mut self) -> u8 {
        self.next() as u8
    }
}

/// The flash has no power.
#[derive(Debug)]
pub(crate) struct NoPower;

impl NorFlashError for NoPower {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// State of the word or page at which the power fails. A word is torn in one way only: each of its bits has changed, or has not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tear {
    /// The step has not begun.
    Before,
    /// Each bit of the page has changed, or has not.
    Bits,
    /// The first half of the page is erased.
    Half,
    /// The first and the last word of the page are as before. Each bit between them has changed, or has not.
    Ends,
    /// The first word of the page is as before. All other words are erased.
    First,
}

/// The error-correcting code that a flash has for each word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Code {
    /// The flash has no codes, like that of an F429.
    None,
    /// The code of a word that the power has cut does not fit the word. The board reads such a word as zeros (H743).
    Detects,
    /// As `Detects`. But half of the blank words that the power has cut still read as blank, and have a code that was written. The
    /// next write turns a bit of such a word.
    WritesBlank,
    /// As `Detects`. A write to a word that is not blank turns a bit of the word.
    Corrects,
}

/// What becomes of writes while the power is on.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Wear {
    None,
    /// Writes and erasures fail.
    Refuses,
    /// Writes of these bytes succeed, but nothing is stored.
    Drops(fn(&[u8]) -> bool),
}

/// Where and how the power fails.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cut {
    /// Number of the step, from 0.
    pub(crate) step: usize,
    pub(crate) tear: Tear,
    pub(crate) seed: u64,
}

/// A flash with words of `WORD` bytes and pages of `PAGE` bytes. A step is the write of a word or the erasure of a page.
#[derive(Clone)]
pub(crate) struct Flash<const WORD: usize, const PAGE: usize> {
    pub(crate) bytes: Vec<u8>,
    pub(crate) code: Code,
    pub(crate) wear: Wear,
    /// Words whose code does not fit.
    torn: Vec<bool>,
    /// Words that read as blank, but whose code has been written.
    coded: Vec<bool>,
    /// Number of words written and pages erased so far.
    pub(crate) steps: usize,
    /// Number of pages erased so far.
    pub(crate) erased: usize,
    /// `None` while the power does not fail.
    pub(crate) cut: Option<Cut>,
}

impl<const WORD: usize, const PAGE: usize> Flash<WORD, PAGE> {
    /// A blank flash with this number of pages.
    pub(crate) fn new(pages: usize, code: Code) -> Self {
        let words = vec![false; pages * PAGE / WORD];
        let bytes = vec![0xFF; pages * PAGE];
        let (wear, torn) = (Wear::None, words.clone());
        Self { bytes, code, wear, torn, coded: words, steps: 0, erased: 0, cut: None }
    }

    /// The same content after the next power-on.
    pub(crate) fn powered_on(&self) -> Self {
        Self { steps: 0, erased: 0, cut: None, ..self.clone() }
    }

    /// Puts bytes into the flash, as a probe does.
    pub(crate) fn put(&mut self, at: usize, bytes: &[u8]) {
        self.bytes[at..at + bytes.len()].copy_from_slice(bytes);
        let words = at / WORD..(at + bytes.len()).div_ceil(WORD);
        self.torn[words.clone()].fill(false);
        self.coded[words].fill(false);
    }

    /// Fails if the power has failed.
    pub(crate) fn has_power(&self) -> Result<(), NoPower> {
        if self.cut.is_some_and(|cut| self.steps > cut.step) { Err(NoPower) } else { Ok(()) }
    }

    /// Begins the next step. Returns how the power fails in the step; `None` if it does not.
    fn step(&mut self) -> Result<Option<(Tear, Random)>, NoPower> {
        self.has_power()?;
        let step = self.steps;
        self.steps += 1;
        if matches!(self.wear, Wear::Refuses) {
            assert!(step < 1_000, "a refused write is repeated without a pause");
            return Err(NoPower);
        }
        Ok(self.cut.filter(|cut| cut.step == step).map(|cut| (cut.tear, Random(cut.seed))))
    }

    pub(crate) fn read(&self, at: usize, bytes: &mut [u8]) -> Result<(), NoPower> {
        self.has_power()?;
        for (byte, at) in bytes.iter_mut().zip(at..) {
            *byte = if self.torn[at / WORD] { 0 } else { self.bytes[at] };
        }
        Ok(())
    }

    pub(crate) fn write(&mut self, at: usize, bytes: &[u8]) -> Result<(), NoPower> {
        assert_eq!([at % WORD, bytes.len() % WORD], [0; 2], "whole words");
        if matches!(self.wear, Wear::Drops(drops) if drops(bytes)) {
            return Ok(());
        }
        for (number, bytes) in (at / WORD..).zip(bytes.chunks(WORD)) {
            let cut = self.step()?;
            let word = &mut self.bytes[number * WORD..][..WORD];
            let blank = !self.torn[number] && word.iter().all(|byte| *byte == 0xFF);
            // Only a mark, a word of zeros, may be written to a word that is not blank.
            assert!(blank || bytes.iter().all(|byte| *byte == 0), "written again: word {number}");
            match cut {
                Some((Tear::Before, _)) => return Err(NoPower),
                Some((_, mut random)) => {
                    if self.code == Code::WritesBlank && blank && random.byte() < 128 {
                        self.coded[number] = true;
                        return Err(NoPower);
                    }
                    word.iter_mut().zip(bytes).for_each(|(old, new)| *old &= new | random.byte());
                    self.torn[number] = self.code != Code::None;
                    return Err(NoPower);
                }
                None => word.copy_from_slice(bytes),
            }
            if self.coded[number] || !blank && self.code == Code::Corrects {
                word[WORD / 2] ^= 1;
                // The driver reads the word back.
                return Err(NoPower);
            }
        }
        Ok(())
    }

    pub(crate) fn erase(&mut self, from: usize, to: usize) -> Result<(), NoPower> {
        assert_eq!([from % PAGE, to % PAGE], [0; 2], "whole pages");
        for at in (from..to).step_by(PAGE) {
            self.erased += 1;
            let cut = self.step()?;
            let page = &mut self.bytes[at..][..PAGE];
            let torn = &mut self.torn[at / WORD..][..PAGE / WORD];
            let Some((tear, mut random)) = cut else {
                page.fill(0xFF);
                torn.fill(false);
                self.coded[at / WORD..][..PAGE / WORD].fill(false);
                continue;
            };
            let mut tear_bits = |bytes: &mut [u8]| bytes.iter_mut().for_each(|byte| *byte |= random.byte());
            let has_codes = self.code != Code::None;
            match tear {
                Tear::Before => (),
                Tear::Bits => {
                    tear_bits(page);
                    torn.fill(has_codes);
                }
                Tear::Half => {
                    page[..PAGE / 2].fill(0xFF);
                    torn[..PAGE / 2 / WORD].fill(false);
                }
                Tear::Ends => {
                    tear_bits(&mut page[WORD..PAGE - WORD]);
                    torn[1..PAGE / WORD - 1].fill(has_codes);
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
