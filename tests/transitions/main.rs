//! What becomes of a motor when something else is asked of it, or configured.

mod bench;
mod cells;
mod host;
mod properties;
mod table;
