//! The driver for a bank of the flash, which the hub and its bootloader use.
//!
//! Three properties of this flash shape the driver.
//!
//! * *Spurious error flags.* The core speculates into the system memory at 0x1FF0_0000, and then both banks show RDPERR
//!   and RDSERR. A corrected bit in code that runs shows SNECCERR. An error flag therefore says nothing about an operation.
//!   All error flags are cleared before each operation, and what the flash reads back decides whether it has succeeded.
//! * *Words that arrive late.* The core may read the status register before the last store of a word has arrived. The driver
//!   therefore executes a barrier first. The status register must then show an idle bank at several reads in a row.
//! * *Unreadable words.* Each word of 32 bytes has a code that corrects one bit of the word. After a power cut in a write, or
//!   after a second write of a word, the code may not fit. Each read is then a bus error (RM0433 4.3.9, 4.7.7). The driver
//!   reads zeros instead. No checksum accepts zeros as a setting, and the bootloader accepts them as no state.

use crate::layout::SECTOR;
use core::arch::asm;
use core::future::Future;
use core::ptr::{with_exposed_provenance, with_exposed_provenance_mut};
use cortex_m::asm::dsb;
use cortex_m::peripheral::SCB;
use embassy_futures::yield_now;
use embassy_stm32::peripherals::FLASH;
use embassy_stm32::{Peri, pac};
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// Bit of `SCB_CCR` with which a bus error does not stop a core that has masked its faults (PM0253, configuration and control
/// register).
const BFHFNMIGN: u32 = 1 << 8;

/// First addresses of the banks, and bytes of each (RM0433 table 15).
const BASES: [u32; 2] = [0x0800_0000, 0x0810_0000];
const SIZE: usize = 0x10_0000;

/// Keys that unlock a bank's registers, in this order (RM0433 4.5.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Value of PSIZE with which the bank programs and erases 32 bits at a time.
const PARALLELISM: u8 = 0b10;

/// Number of bytes in a word of the flash, which is written and read as a whole.
const WORD: usize = 32;

/// A word of the flash, as eight numbers of 32 bits.
type Word = [u32; WORD / 4];

/// A word of erased flash.
const BLANK: Word = [u32::MAX; WORD / 4];

/// Number of reads of the status register in a row that must show an idle bank.
const IDLE_READS: u32 = 16;

/// Number of attempts at an operation. An attempt is repeated if its result does not read back and a repetition does no harm.
const ATTEMPTS: u32 = 3;

/// Number of bytes that are checked after an erasure before other tasks may run.
const CHECKED_AT_ONCE: u32 = 1024;

/// A bank of the flash.
pub struct Bank<T> {
    /// Number of the bank, 0 or 1.
    number: usize,
    /// Pauses for a moment, in which other tasks run.
    pause: fn() -> T,
}

/// Why an operation of the flash has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The address or the length is not a multiple of the size that is written or erased as a whole.
    NotAligned,
    /// The addresses are not all in the bank.
    OutOfBounds,
    /// The flash does not read back what was written, or is not blank after an erasure.
    VerifyFailed,
}

impl NorFlashError for Error {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::VerifyFailed => NorFlashErrorKind::Other,
        }
    }
}

/// Checks that a range is in the bank and a multiple of `unit` bytes.
fn check(offset: u32, length: usize, unit: usize) -> Result<(), Error> {
    let offset = offset as usize;
    if length > SIZE || offset > SIZE - length {
        return Err(Error::OutOfBounds);
    }
    let aligned = offset.is_multiple_of(unit) && length.is_multiple_of(unit);
    if aligned { Ok(()) } else { Err(Error::NotAligned) }
}

impl<T: Future<Output = ()>> Bank<T> {
    /// Creates the drivers of both banks. The future that `pause` returns is awaited repeatedly while a bank is busy. An erasure takes
    /// seconds, and the write of a word some 0.1 ms.
    pub fn both(_: Peri<'static, FLASH>, pause: fn() -> T) -> [Self; 2] {
        [0, 1].map(|number| Self { number, pause })
    }

    fn registers(&self) -> pac::flash::Bank {
        pac::FLASH.bank(self.number)
    }

    fn address(&self, offset: u32) -> u32 {
        BASES[self.number] + offset
    }

    /// Reads the word at this offset.
    fn word(&self, offset: u32) -> Word {
        let registers = self.registers();
        registers.ccr().write(|w| w.set_clr_dbeccerr(true));
        let word = load(self.address(offset));
        if registers.sr().read().dbeccerr() { [0; WORD / 4] } else { word }
    }

    /// Waits until the bank is idle.
    async fn idle(&self) {
        dsb();
        let mut reads = 0;
        while reads < IDLE_READS {
            let status = self.registers().sr().read();
            if status.bsy() || status.qw() {
                reads = 0;
                (self.pause)().await;
            } else {
                reads += 1;
            }
        }
    }

    /// Clears all error flags and unlocks the bank. A flag that stays set may block the next operation (RM0433 4.7.3).
    fn unlock(&self) -> pac::flash::Bank {
        let registers = self.registers();
        registers.ccr().write(|w| {
            w.set_clr_wrperr(true);
            w.set_clr_pgserr(true);
            w.set_clr_strberr(true);
            w.set_clr_incerr(true);
            w.set_clr_operr(true);
            w.set_clr_rdperr(true);
            w.set_clr_rdserr(true);
            w.set_clr_sneccerr(true);
            w.set_clr_dbeccerr(true);
        });
        if registers.cr().read().lock() {
            KEYS.iter().for_each(|key| registers.keyr().write_value(*key));
        }
        registers
    }

    /// Locks the bank again. The flash drops a word that was stored in part.
    fn lock(&self) {
        self.registers().cr().write(|w| {
            w.set_psize(PARALLELISM);
            w.set_lock(true);
        });
    }

    async fn write_word(&mut self, offset: u32, new: Word) -> Result<(), Error> {
        for _ in 0..ATTEMPTS {
            self.idle().await;
            self.unlock().cr().write(|w| {
                w.set_psize(PARALLELISM);
                w.set_pg(true);
            });
            dsb();
            store(self.address(offset), new);
            self.idle().await;
            self.lock();
            let word = self.word(offset);
            if word == new {
                return Ok(());
            }
            if word != BLANK {
                // A second write to a word could make its error-correcting code invalid.
                break;
            }
        }
        Err(Error::VerifyFailed)
    }

    async fn erase_sector(&mut self, offset: u32) -> Result<(), Error> {
        for _ in 0..ATTEMPTS {
            self.idle().await;
            let registers = self.unlock();
            let sector = (offset / SECTOR) as u8;
            let erase = |w: &mut pac::flash::regs::Cr| {
                w.set_psize(PARALLELISM);
                w.set_ser(true);
                w.set_snb(sector);
            };
            registers.cr().write(erase);
            registers.cr().modify(|w| w.set_start(true));
            self.idle().await;
            self.lock();
            if self.is_blank(offset).await {
                return Ok(());
            }
        }
        Err(Error::VerifyFailed)
    }

    /// True if the sector that begins at this offset is blank.
    async fn is_blank(&mut self, offset: u32) -> bool {
        for at in (offset..offset + SECTOR).step_by(WORD) {
            if at.is_multiple_of(CHECKED_AT_ONCE) {
                yield_now().await;
            }
            if self.word(at) != BLANK {
                return false;
            }
        }
        true
    }
}

impl<T> ErrorType for Bank<T> {
    type Error = Error;
}

impl<T: Future<Output = ()>> ReadNorFlash for Bank<T> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, mut bytes: &mut [u8]) -> Result<(), Error> {
        check(offset, bytes.len(), 1)?;
        let mut at = offset as usize;
        while !bytes.is_empty() {
            let skipped = at % WORD;
            let length = (WORD - skipped).min(bytes.len());
            let (piece, rest) = bytes.split_at_mut(length);
            let word = self.word((at - skipped) as u32).map(u32::to_le_bytes);
            piece.copy_from_slice(&word.as_flattened()[skipped..skipped + length]);
            at += length;
            bytes = rest;
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        SIZE
    }
}

impl<T: Future<Output = ()>> NorFlash for Bank<T> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR as usize;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        check(from, to.saturating_sub(from) as usize, SECTOR as usize)?;
        for sector in (from..to).step_by(SECTOR as usize) {
            self.erase_sector(sector).await?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        check(offset, bytes.len(), WORD)?;
        for (at, word) in (offset..).step_by(WORD).zip(bytes.as_chunks::<4>().0.chunks(WORD / 4)) {
            let mut new = BLANK;
            new.iter_mut().zip(word).for_each(|(to, bytes)| *to = u32::from_le_bytes(*bytes));
            self.write_word(at, new).await?;
        }
        Ok(())
    }
}

/// Stores a word into the flash, which programs it.
#[expect(unsafe_code, reason = "a store to an address of the flash programs the flash")]
fn store(address: u32, word: Word) {
    let place = with_exposed_provenance_mut::<u32>(address as usize);
    for (index, part) in word.into_iter().enumerate() {
        // SAFETY: the word is in a bank, whose bounds have been checked. The linker puts no variable there.
        unsafe { place.add(index).write_volatile(part) }
    }
}

/// Loads a word of the flash. After a bus error the result has no meaning, and the bank shows DBECCERR.
#[expect(unsafe_code, reason = "no safe code can mask faults")]
fn load(address: u32) -> Word {
    // SAFETY: the word is in a bank, whose bounds have been checked. The register belongs to the core, and no other
    // code writes the register. Faults are masked only for the copy of 32 bytes. No fault handler calls this function,
    // so faults were unmasked before.
    unsafe {
        let scb = &*SCB::PTR;
        scb.ccr.modify(|ccr| ccr | BFHFNMIGN);
        asm!("cpsid f", "dsb", "isb");
        let word = with_exposed_provenance::<Word>(address as usize).read_volatile();
        asm!("dsb", "cpsie f", "isb");
        scb.ccr.modify(|ccr| ccr & !BFHFNMIGN);
        word
    }
}
