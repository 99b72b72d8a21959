//! A bank of the flash, word by word.
//!
//! Each word of 32 bytes has a code that corrects one bit of it. A word at which power went while it was written has none
//! that fits: to read it is a bus error (RM0433 4.7.7), and would be one at each power-on from then on. Here it reads as zeros,
//! which no checksum takes for a setting, and the bootloader for no state.

use core::arch::asm;
use cortex_m::peripheral::SCB;
use embassy_futures::block_on;
use embassy_stm32::flash::Error;
use embassy_stm32::pac;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

/// Of `SCB_CCR`: loads of a core whose faults are masked may fail (PM0253, configuration and control register).
const BFHFNMIGN: u32 = 1 << 8;

/// Bytes that are written, and read, as one.
const WORD: usize = 32;

/// A bank.
pub struct Words<F> {
    flash: F,
    /// 0 or 1.
    bank: usize,
}

impl<F: NorFlash<Error = Error>> Words<F> {
    /// The bank with this number, 0 or 1.
    pub const fn new(flash: F, bank: usize) -> Self {
        Self { flash, bank }
    }

    /// Flags of reads would be taken for those of the next write.
    fn forget_errors(&self) {
        pac::FLASH.bank(self.bank).ccr().write(|w| {
            w.set_clr_dbeccerr(true);
            w.set_clr_sneccerr(true);
        });
    }
}

impl<F: NorFlash<Error = Error>> ErrorType for Words<F> {
    type Error = Error;
}

impl<F: NorFlash<Error = Error>> ReadNorFlash for Words<F> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, mut bytes: &mut [u8]) -> Result<(), Error> {
        let mut at = offset;
        while !bytes.is_empty() {
            let rest = WORD - at as usize % WORD;
            let length = rest.min(bytes.len());
            let (piece, after) = bytes.split_at_mut(length);
            self.forget_errors();
            // Who reads flash never waits.
            ignoring_bus_errors(|| block_on(self.flash.read(at, piece)))?;
            if pac::FLASH.bank(self.bank).sr().read().dbeccerr() {
                piece.fill(0);
            }
            at += length as u32;
            bytes = after;
        }
        self.forget_errors();
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl<F: NorFlash<Error = Error>> NorFlash for Words<F> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        self.forget_errors();
        self.flash.erase(from, to).await
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        self.forget_errors();
        self.flash.write(offset, bytes).await
    }
}

#[expect(unsafe_code, reason = "nothing else masks faults")]
fn ignoring_bus_errors<T>(read: impl FnOnce() -> T) -> T {
    // SAFETY: the register is the core's own, and nobody else writes it; interrupts are masked for a copy of 32 bytes,
    // and what is left unmasked at the end is what was unmasked before: no fault handler ever comes here.
    unsafe {
        let scb = &*SCB::PTR;
        scb.ccr.modify(|ccr| ccr | BFHFNMIGN);
        asm!("cpsid f", "dsb", "isb");
        let read = read();
        asm!("dsb", "cpsie f", "isb");
        scb.ccr.modify(|ccr| ccr & !BFHFNMIGN);
        read
    }
}
