//! What the bootloader of the NUCLEO-H743ZI2 shares with the hub that it boots: the layout of the flash, the driver of the
//! flash, and the memory that nothing is executed from.
#![no_std]

mod bank;
pub mod layout;
mod memory;
// The same source, not the same package: the drivers of a hub have no place in a bootloader of 16 kB.
#[path = "../../stm32/src/mpu.rs"]
mod mpu;

pub use bank::{Bank, Error};
pub use memory::execute_first_bank_only;
