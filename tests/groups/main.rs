//! Motors that move in step.

mod motors;
mod references;
