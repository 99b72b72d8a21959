//! Updates of the firmware: checks of an image, and cuts of the power at any step.

mod power;
mod signature;
mod steps;
mod task;
#[path = "../common/torn_flash.rs"]
mod torn_flash;
