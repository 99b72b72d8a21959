//! Settings that are kept without power: records, power cuts at any step of a save, and damaged contents.

mod damage;
mod flash;
mod power;
mod records;
#[path = "../common/torn_flash.rs"]
mod torn_flash;
