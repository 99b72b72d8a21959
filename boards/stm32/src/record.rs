//! Where the record of what happened lies: the end of RAM, which no start-up clears (`sections.x`), and what began a run.

use motor_hub::record::{Fault, SIZE};
use persistent_buff::PersistentBuff;

/// The memory, once; `None` after that.
pub fn memory() -> Option<&'static mut [u8; SIZE]> {
    PersistentBuff::take_raw()?.try_into().ok()
}

/// The first of these reset flags that is set: a reset of one kind sets the flags of others too.
pub fn cause<const N: usize>(flags: [(bool, Fault); N]) -> Fault {
    flags.into_iter().find(|(set, _)| *set).map_or(Fault::OtherReset, |(_, fault)| fault)
}
