//! Motors that move in step.

#[path = "../common/mod.rs"]
mod common;
mod motors;
mod odometry;
mod references;
