//! Motors that move in step.

mod base;
#[path = "../common/mod.rs"]
mod common;
mod gyro;
mod motors;
mod odometry;
mod references;
