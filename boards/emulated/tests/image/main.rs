//! The image that is flashed, on an emulated chip with modelled motors. All tests are in one program, which makes the best use of
//! two cores.

mod boot;
mod budget;
mod chain;
mod common;
mod currents;
mod daemon;
mod devices;
mod flash;
mod h743;
mod link;
mod matrix;
mod pwm;
mod record;
mod recording;
mod running;
mod scenario_parts;
mod store;
mod supply;
mod update;
