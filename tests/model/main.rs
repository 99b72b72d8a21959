//! The physics, against what was computed elsewhere and otherwise.

mod bus;
mod friction;
mod golden;
mod physics;
mod train;
