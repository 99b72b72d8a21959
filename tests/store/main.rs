//! Settings that outlast power: records, a flash that loses power anywhere, and what comes of it.

mod damage;
mod flash;
mod power;
mod records;
#[path = "../common/torn_flash.rs"]
mod torn_flash;
