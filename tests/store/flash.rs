//! Settings in two pages of a flash that loses power at a chosen step.

use crate::torn_flash::{Flash, NoPower};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use motor_hub::store::{Found, SettingsRecord, StoreRequest, StoreResult};
use motor_hub::tasks::store::Keeper;

pub(crate) use embassy_futures::block_on;

impl<const WORD: usize, const PAGE: usize> ErrorType for &mut Flash<WORD, PAGE> {
    type Error = NoPower;
}

impl<const WORD: usize, const PAGE: usize> ReadNorFlash for &mut Flash<WORD, PAGE> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NoPower> {
        Flash::read(self, offset as usize, bytes)
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const WORD: usize, const PAGE: usize> NorFlash for &mut Flash<WORD, PAGE> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NoPower> {
        Flash::erase(self, from as usize, to as usize)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NoPower> {
        assert!(self.cut.is_none() || bytes.len() == WORD, "one word at a time: other tasks run between two");
        Flash::write(self, offset as usize, bytes)
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

/// Erases the store, and writes a record.
pub(crate) fn reset<const WORD: usize, const PAGE: usize>(
    flash: &mut Flash<WORD, PAGE>,
    record: &SettingsRecord,
) -> StoreResult {
    let order = StoreRequest { record: Some(record.clone()), erase_first: true, may_erase: true };
    block_on(keeper(flash).carry_out(&order))
}

fn keeper<const WORD: usize, const PAGE: usize>(
    flash: &mut Flash<WORD, PAGE>,
) -> Keeper<&mut Flash<WORD, PAGE>> {
    Keeper::new(flash, 0..2 * PAGE as u32).expect("two pages")
}
