//! What becomes of a motor when something else is asked of it, or configured.

mod cells;
#[path = "../common/mod.rs"]
mod common;
mod host;
mod properties;
#[path = "../common/schemes.rs"]
mod schemes;
mod subject;
mod table;
