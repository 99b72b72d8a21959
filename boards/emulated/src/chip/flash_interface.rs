//! The flash interface of the STM32H743 (RM0433 4), with faults of real chips that the emulator lacks. The interface can show
//! errors that no access has caused. The last store of a word can arrive after the core has read the status register. An
//! operation may never end.

use delegate::delegate;
use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::soc::Width;
use rigless::soc::stm32h743::generated::flash::{Register, sr1, sr2};
use rigless::soc::stm32h743::peripherals::flash::Flash;
use rigless::time::EventId;

/// Number of bytes in a word, which is programmed as a whole.
const WORD: u64 = 32;

/// Faults of a flash interface that are not in its manual. The default has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FlashFaults {
    /// Number of accesses to registers of the interface after which both banks show RDPERR, RDSERR and SNECCERR; 0 stands for
    /// never. On a real chip speculative reads of the system memory set the first two.
    pub errors_every: u32,
    /// Number of reads of the status register before the last store of a word arrives.
    pub late_reads: u32,
}

/// A store that has not arrived yet.
#[derive(Clone, Copy, Debug)]
struct Store {
    address: u64,
    width: Width,
    value: u64,
    reads: u32,
}

#[derive(Debug, Default)]
pub(crate) struct Interface {
    flash: Flash,
    pub(crate) faults: FlashFaults,
    accesses: u32,
    late: Option<Store>,
    /// True if the flash stays busy until the next reset of the chip.
    pub(crate) never_ends: bool,
}

impl Interface {
    /// Counts an access to a register, and shows errors if their number is reached.
    fn accessed(&mut self, registers: &mut RegisterFile) {
        self.accesses += 1;
        if self.faults.errors_every == 0 || !self.accesses.is_multiple_of(self.faults.errors_every) {
            return;
        }
        let banks = [
            (Register::Sr1, [sr1::RDPERR1, sr1::RDSERR1, sr1::SNECCERR]),
            (Register::Sr2, [sr2::RDPERR2, sr2::RDSERR2, sr2::SNECCERR2]),
        ];
        for (register, errors) in banks {
            let status = errors.iter().fold(registers.get(register), |status, error| error.set(status, 1));
            registers.set(register, status);
        }
    }

    /// Carries out the store that has not arrived yet.
    fn arrive(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if let Some(Store { address, width, value, .. }) = self.late.take() {
            self.flash.write_region(address, width, value, registers, context);
        }
    }
}

impl Device for Interface {
    type Register = Register;

    fn read(
        &mut self,
        register: Register,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        self.accessed(registers);
        if matches!(register, Register::Sr1 | Register::Sr2)
            && let Some(store) = &mut self.late
        {
            match store.reads.checked_sub(1) {
                Some(reads) => store.reads = reads,
                None => self.arrive(registers, context),
            }
        }
        let value = self.flash.read(register, registers, context);
        match register {
            Register::Sr1 if self.never_ends => Some(sr1::BSY1.set(registers.get(register), 1)),
            Register::Sr2 if self.never_ends => Some(sr2::BSY2.set(registers.get(register), 1)),
            _ => value,
        }
    }

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.flash.write(register, value, registers, context);
        self.accessed(registers);
    }

    fn write_region(
        &mut self,
        address: u64,
        width: Width,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> bool {
        self.arrive(registers, context);
        if self.faults.late_reads > 0 && (address + u64::from(width.bytes())).is_multiple_of(WORD) {
            self.late = Some(Store { address, width, value, reads: self.faults.late_reads });
            return true;
        }
        self.flash.write_region(address, width, value, registers, context)
    }

    delegate! {
        to self.flash {
            fn on_event(&mut self, event: EventId, registers: &mut RegisterFile, context: &mut DeviceContext<'_>);
            fn on_refused(&mut self, token: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>);
            fn on_access(
                &mut self,
                token: u64,
                value: u64,
                registers: &mut RegisterFile,
                context: &mut DeviceContext<'_>,
            );
        }
    }

    fn reset(&mut self) {
        Device::reset(&mut self.flash);
        (self.accesses, self.late, self.never_ends) = (0, None, false);
    }
}
