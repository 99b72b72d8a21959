//! The second bank of the flash, for settings.
//!
//! Each word of 32 bytes has a code that corrects one bit of it. A word at which power went while it was written has none
//! that fits: to read it is a bus error (RM0433 4.7.7), and would be one at each power-on from then on. Here it reads as zeros,
//! which no checksum takes for a setting.

use core::arch::asm;
use cortex_m::peripheral::SCB;
use embassy_stm32::flash::{Async, Bank2Region, Error};
use embassy_stm32::pac;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

/// Of `SCB_CCR`: loads of a core whose faults are masked may fail (PM0253, configuration and control register).
const BFHFNMIGN: u32 = 1 << 8;

/// Bytes that are written, and read, as one.
const WORD: usize = 32;

/// The bank.
pub(crate) struct SecondBank(pub(crate) Bank2Region<'static, Async>);

impl ErrorType for SecondBank {
    type Error = Error;
}

impl ReadNorFlash for SecondBank {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, mut bytes: &mut [u8]) -> Result<(), Error> {
        let mut at = offset;
        while !bytes.is_empty() {
            let rest = WORD - at as usize % WORD;
            let length = rest.min(bytes.len());
            let (piece, after) = bytes.split_at_mut(length);
            forget_errors();
            ignoring_bus_errors(|| self.0.blocking_read(at, piece))?;
            if pac::FLASH.bank(1).sr().read().dbeccerr() {
                piece.fill(0);
            }
            at += length as u32;
            bytes = after;
        }
        forget_errors();
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl NorFlash for SecondBank {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = <Bank2Region<'static, Async> as NorFlash>::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        forget_errors();
        self.0.erase(from, to).await
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        forget_errors();
        self.0.write(offset, bytes).await
    }
}

/// Flags of reads would be taken for those of the next write.
fn forget_errors() {
    pac::FLASH.bank(1).ccr().write(|w| {
        w.set_clr_dbeccerr(true);
        w.set_clr_sneccerr(true);
    });
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
