//! New firmware: what is taken of it, and that a cut of the power at any step leaves firmware that runs.

mod power;
mod signature;
mod steps;
mod task;
