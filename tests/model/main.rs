//! The physics, against what was computed elsewhere and otherwise.

mod friction;
mod golden;
mod physics;
