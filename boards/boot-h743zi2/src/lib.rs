//! What the bootloader of the NUCLEO-H743ZI2 and the hub that it boots share: where what is in the flash, and how words of it
//! are read that power has cut.
#![no_std]

pub mod layout;
mod words;

pub use words::Words;
