//! A motor hub: several brushed DC gear motors, each on an asynchronous sign-magnitude H bridge,
//! slowed down by *proportional braking* (R. Atkinson, "On Proportional Braking in H Bridges", 2018)
//! instead of being slammed into reverse.
//!
//! ```text
//!     anyone  --Command-->  +---------+ --Drive[N]--> output --> bridges --> motors
//!     capture --Reading-->  | control |                                        |
//!     supply  --Battery-->  +---------+ --Snapshot--> anyone                   |
//!         ^                                                                    |
//!         +------------------------ encoders, battery <------------------------+
//! ```
//!
//! A value enters at a task, goes through the core once, and leaves at a task.
//!
//! | room | what is decided there |
//! |---|---|
//! | [`units`] | ranges and resolutions of every quantity |
//! | [`bridge`] | the states, modes and drives that a bridge may be given; its constants |
//! | [`braking`] | control value to drive: points S T Z G, schemes, regimes, duty |
//! | [`motion`] | set-point to control value: velocity, PID, position |
//! | [`supply`] | ADC readings to battery voltage |
//! | [`motor`], [`hub`] | one motor, N motors: `step(inputs) -> outputs` |
//! | [`protocol`] | the host's protocol as bytes, both ends of it: frames, requests, answers |
//! | [`responder`] | the hub's end of it: what is remembered and decided; keep-alive, LED |
//! | [`board`] | the traits that a board implements |
//! | `tasks` (feature `tasks`, on by default) | async shells round the above |
//! | `model` (feature `model`) | physics in `f64`, for simulators and tests; knows nothing of the control |
//!
//! The core is `no_std`, without floats, allocation, panics or `unsafe`; it has no clock and touches
//! no hardware. Signs: positive control, counts and speed are one direction, called CW.
#![cfg_attr(not(feature = "model"), no_std)]
#![forbid(unsafe_code)]
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod board;
pub mod braking;
pub mod bridge;
pub mod hub;
#[cfg(feature = "model")]
pub mod model;
pub mod motion;
pub mod motor;
pub mod protocol;
pub mod responder;
pub mod supply;
#[cfg(feature = "tasks")]
pub mod tasks;
pub mod units;
