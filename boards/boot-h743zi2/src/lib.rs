//! Code that the bootloader of the NUCLEO-H743ZI2 shares with the hub that it boots: the layout and the driver of the
//! flash, the regions of memory that are not executable, and the key of signed firmware.
#![no_std]

mod bank;
pub mod layout;
mod memory;
// These two files belong to the package of the hub's drivers. The bootloader includes the files instead of the package,
// because it must not exceed 16 kB.
#[path = "../../stm32/src/early_start.rs"]
mod early_start;
#[path = "../../stm32/src/mpu.rs"]
mod mpu;

pub use bank::{Bank, Error};
pub use early_start::before_clocks;
pub use memory::execute_first_bank_only;

/// Public key (Ed25519) that must have signed new firmware. `None` if no signature is needed.
#[cfg(not(feature = "signed"))]
pub const SIGNER: Option<[u8; 32]> = None;
/// Public key (Ed25519) that must have signed new firmware.
#[cfg(feature = "signed")]
pub const SIGNER: Option<[u8; 32]> = match motor_hub::update::public_key(include_bytes!(env!("UPDATE_KEY"))) {
    None => panic!("UPDATE_KEY is no public key of Ed25519 in DER: openssl pkey -pubout -outform DER"),
    key => key,
};
