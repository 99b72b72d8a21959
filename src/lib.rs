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
//! ```
//! use motor_hub::braking::Winding;
//! use motor_hub::bridge::{Drive, Mode};
//! use motor_hub::motor::{Motor, Setpoint, Settings};
//! use motor_hub::units::{Control, Micros, Millivolts, Period};
//!
//! // One motor, all the way from a set-point to what its bridge is told.
//! let mut motor = Motor::new(Settings::new(Winding::NEVEREST_60), Period::DEFAULT);
//! motor.set(Setpoint::ConstantPower(Control::MAX));
//! let report = motor.step(Micros::new(50_000), None, Some(Millivolts::new(12_000)));
//! assert_eq!(report.drive.mode, Mode::Cw98);
//! // Without a battery it coasts.
//! assert_eq!(motor.step(Micros::new(100_000), None, None).drive, Drive::COAST);
//! ```
//!
//! A value enters at a task, goes through the core once, and leaves at a task.
//!
//! | room | what is decided there |
//! |---|---|
//! | [`units`] | ranges and resolutions of every quantity |
//! | [`bridge`] | the states, modes and drives that a bridge may be given; its constants |
//! | [`braking`] | control value to drive: points S T Z G, schemes, regimes, duty |
//! | [`motion`] | what encoders say: positions, speeds, and whether to believe them; PID |
//! | [`regulator`] | from what a motor should do to a control value: by its model, or by PID |
//! | [`group`] | motors that move in step: where each of them should be now |
//! | [`supply`] | ADC readings to battery voltage |
//! | [`motor`], [`hub`] | one motor, N motors: `step(inputs) -> outputs` |
//! | [`record`] | what happened: faults and resets with the ticks before them, in memory that a reset leaves alone |
//! | [`protocol`] | REV's protocol as bytes, for both ends: frames, requests, answers |
//! | [`extension`] | the hub's own requests beside REV's; the table of all settings |
//! | [`responder`] | the hub's end of both: what the hub stores and decides for a host; keep-alive, LED |
//! | [`store`] | settings that outlast power: what is stored, and which of two copies counts |
//! | [`update`] | new firmware: what of an image is taken, and when it may be started |
//! | [`board`] | the traits that a board implements |
//! | `tasks` (feature `tasks`, on by default) | async shells round the above |
//! | `model` (feature `model`) | physics in `f64`, for simulators and tests; knows nothing of the control |
//!
//! The core is `no_std`, without allocation, panics or `unsafe`; currents and motion are computed in single
//! precision, everything else in integers (constants may be made from physical ones in `f64`). It has no clock and
//! touches no hardware. Signs:
//! positive control, counts and speed are one direction, called CW.
//!
//! # Features
//! * `tasks` (on by default): the async tasks, on embassy. Without it the core has four small dependencies.
//! * `signed`: new firmware may have to be signed: [`update::Slot::signer`].
//! * `model`: physics in `f64`, for simulators and tests; needs std.
//! * `defmt`: `defmt::Format` for the types of the control path, for firmware.
#![cfg_attr(not(feature = "model"), no_std)]
#![forbid(unsafe_code)]
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod board;
pub mod braking;
pub mod bridge;
pub mod extension;
pub mod group;
pub mod hub;
#[cfg(feature = "model")]
pub mod model;
pub mod motion;
pub mod motor;
pub mod protocol;
pub mod record;
pub mod regulator;
pub mod responder;
pub mod store;
pub mod supply;
#[cfg(feature = "tasks")]
pub mod tasks;
pub mod units;
pub mod update;
