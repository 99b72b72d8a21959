//! The physics, compared with values that were computed by other programs and methods.

mod bus;
mod friction;
mod physics;
mod train;
