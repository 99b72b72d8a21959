//! Transitions of a motor: new set-points, new settings and faults while it runs.

#[path = "../common/mod.rs"]
mod common;
mod currents;
mod events;
mod flywheel;
mod host;
mod properties;
#[path = "../common/random.rs"]
mod random;
