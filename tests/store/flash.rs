//! A NOR flash in memory that loses power at a chosen word.

use crate::torn_flash::{NoPower, Random};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use motor_hub::store::{Found, SettingsRecord, StoreRequest, StoreResult};
use motor_hub::tasks::store::Keeper;

pub(crate) use embassy_futures::block_on;

/// State of the word or page at which the power fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tear {
    /// The step has not begun.
    Before,
    /// Each bit has changed, or has not; for an erasure, each bit of the page.
    Bits,
    /// An erasure has got half way, from the front; a word is as with `Bits`.
    Half,
    /// An erasure has spared the words at both ends, which hold the page's state. A word is cut as with `Bits`.
    Ends,
}

/// The error-correcting code of each word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Code {
    /// The chip has no codes, as an F429.
    None,
    /// The code of a word that power has cut, or that was written twice, fits no word. The board reads zeros (H743).
    Detects,
    /// As `Detects`, but half of the words that power has cut still read as blank. Their codes have been programmed: after
    /// another write the code turns a bit of the word.
    Corrects,
}

/// Two pages.
#[derive(Clone)]
pub(crate) struct Flash<const WORD: usize, const PAGE: usize> {
    pub(crate) bytes: Vec<u8>,
    pub(crate) code: Code,
    /// Words whose code does not fit.
    torn: Vec<bool>,
    /// Words that read as blank, but whose code has been programmed.
    programmed: Vec<bool>,
    /// Words written and pages erased so far.
    pub(crate) steps: usize,
    pub(crate) erased: usize,
    /// The step at which power goes, and how.
    pub(crate) cut: Option<(usize, Tear, u64)>,
}

impl<const WORD: usize, const PAGE: usize> Flash<WORD, PAGE> {
    pub(crate) fn new() -> Self {
        Self::with(vec![0xFF; 2 * PAGE])
    }

    pub(crate) fn with(bytes: Vec<u8>) -> Self {
        let torn = vec![false; bytes.len() / WORD];
        Self { bytes, code: Code::None, programmed: torn.clone(), torn, steps: 0, erased: 0, cut: None }
    }

    /// The same content after the next power-on.
    pub(crate) fn powered_on(&self) -> Self {
        Self { steps: 0, erased: 0, cut: None, ..self.clone() }
    }

    /// True if power goes now.
    fn step(&mut self) -> Result<Option<(Tear, Random)>, NoPower> {
        let step = self.steps;
        self.steps += 1;
        match self.cut {
            Some((at, ..)) if step > at => Err(NoPower),
            Some((at, tear, seed)) if step == at => Ok(Some((tear, Random(seed)))),
            _ => Ok(None),
        }
    }
}

impl<const WORD: usize, const PAGE: usize> ErrorType for &mut Flash<WORD, PAGE> {
    type Error = NoPower;
}

impl<const WORD: usize, const PAGE: usize> ReadNorFlash for &mut Flash<WORD, PAGE> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NoPower> {
        if self.cut.is_some_and(|(at, ..)| self.steps > at) {
            return Err(NoPower);
        }
        for (byte, at) in bytes.iter_mut().zip(offset as usize..) {
            *byte = if self.torn[at / WORD] { 0 } else { self.bytes[at] };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const WORD: usize, const PAGE: usize> NorFlash for &mut Flash<WORD, PAGE> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NoPower> {
        assert_eq!([from % PAGE as u32, to % PAGE as u32], [0; 2], "whole pages");
        self.erased += 1;
        let cut = self.step()?;
        let page = &mut self.bytes[from as usize..to as usize];
        let torn = &mut self.torn[from as usize / WORD..to as usize / WORD];
        let Some((tear, mut random)) = cut else {
            page.fill(0xFF);
            torn.fill(false);
            self.programmed[from as usize / WORD..to as usize / WORD].fill(false);
            return Ok(());
        };
        let half = page.len() / 2;
        let codes = self.code != Code::None;
        match tear {
            Tear::Before => (),
            Tear::Bits => torn.fill(codes),
            Tear::Half => torn[..half / WORD].fill(false),
            Tear::Ends => torn[1..PAGE / WORD - 1].fill(codes),
        }
        match tear {
            Tear::Before => (),
            Tear::Bits => page.iter_mut().for_each(|byte| *byte |= random.byte()),
            Tear::Half => page[..half].fill(0xFF),
            Tear::Ends => page[WORD..PAGE - WORD].iter_mut().for_each(|byte| *byte |= random.byte()),
        }
        Err(NoPower)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NoPower> {
        assert_eq!([offset as usize % WORD, bytes.len() % WORD], [0; 2], "whole words");
        assert!(self.cut.is_none() || bytes.len() == WORD, "one at a time, with other tasks between two");
        let cut = self.step()?;
        let word = &mut self.bytes[offset as usize..][..bytes.len()];
        // A word of a flash with error correction is written once. A page's mark is always the same word: where power has
        // cut it, writing it again is what completes it.
        let mark = bytes.iter().all(|byte| *byte == 0);
        let torn = &mut self.torn[offset as usize / WORD..][..bytes.len() / WORD];
        let blank = word.iter().all(|byte| *byte == 0xFF) && !torn.contains(&true);
        assert!(mark || blank, "written again at {offset}");
        match cut {
            None => word.copy_from_slice(bytes),
            Some((Tear::Before, _)) => return Err(NoPower),
            Some((_, mut random)) => {
                if self.code == Code::Corrects && blank && random.byte() < 128 {
                    self.programmed[offset as usize / WORD] = true;
                    return Err(NoPower);
                }
                word.iter_mut().zip(bytes).for_each(|(old, new)| *old &= new | random.byte());
                torn.fill(self.code != Code::None);
                return Err(NoPower);
            }
        }
        if let Some(at) = (0..torn.len()).find(|word| self.programmed[offset as usize / WORD + word]) {
            word[at * WORD + WORD / 2] ^= 1;
            // The driver reads the word back.
            return Err(NoPower);
        }
        Ok(())
    }
}

/// Reads the store as the hub does at power-on.
pub(crate) fn read<const WORD: usize, const PAGE: usize>(flash: &mut Flash<WORD, PAGE>) -> Found {
    block_on(keeper(flash).read())
}

pub(crate) fn write<const WORD: usize, const PAGE: usize>(
    flash: &mut Flash<WORD, PAGE>,
    record: &SettingsRecord,
    may_erase: bool,
) -> StoreResult {
    let order = StoreRequest { record: Some(record.clone()), erase_first: false, may_erase };
    block_on(keeper(flash).carry_out(&order))
}

pub(crate) fn keeper<const WORD: usize, const PAGE: usize>(
    flash: &mut Flash<WORD, PAGE>,
) -> Keeper<&mut Flash<WORD, PAGE>> {
    Keeper::new(flash, 0..2 * PAGE as u32).expect("two pages")
}
