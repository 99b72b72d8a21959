//! What the bootloader of the NUCLEO-H743ZI2 and the hub that it boots share: where what is in the flash, the driver of the
//! flash, and what of the memory nothing is executed from.
#![no_std]

mod bank;
pub mod layout;
mod memory;

pub use bank::{Bank, Error};
pub use memory::execute_first_bank_only;
