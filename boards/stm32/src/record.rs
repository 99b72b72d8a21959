//! Memory for the record of faults, and the cause of a reset. The memory is at the end of RAM, where no start-up code clears it
//! (`sections.x`).

use defmt::warn;
use embassy_sync::blocking_mutex::raw::RawMutex;
use motor_hub::record::{Fault, SIZE};
use motor_hub::tasks::Wires;
use persistent_buff::PersistentBuff;

/// Returns the memory at the first call, and `None` at later calls.
pub fn memory() -> Option<&'static mut [u8; SIZE]> {
    PersistentBuff::take_raw()?.try_into().ok()
}

/// Returns the fault of the first reset flag that is set. A reset of one kind also sets the flags of other kinds, so the order
/// of the flags decides.
pub fn cause<const N: usize>(flags: [(bool, Fault); N]) -> Fault {
    flags.into_iter().find(|(set, _)| *set).map_or(Fault::OtherReset, |(_, fault)| fault)
}

/// Opens the record, and logs a reset by the watchdog.
pub fn open<M: RawMutex, const N: usize>(wires: &Wires<M, N>, memory: &'static mut [u8; SIZE], cause: Fault) {
    if cause == Fault::Watchdog {
        // The last run ended in a fault, or a task hung.
        warn!("started by the watchdog");
    }
    wires.open_record(memory, cause);
}
