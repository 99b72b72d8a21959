//! The host as a board.
#![expect(clippy::expect_used, reason = "a failed expectation is a failed test")]

mod bus;
mod coefficients;
mod currents;
mod devices;
mod files;
mod runs;
mod scenarios;
mod scheme;
mod wires;
mod world;
