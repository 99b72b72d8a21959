//! The host as a board.

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
