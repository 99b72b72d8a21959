//! The firmware of a motor hub: it controls several brushed DC gear motors, each on an asynchronous sign-magnitude H
//! bridge. Motors slow down by *proportional braking* (R. Atkinson, "On Proportional Braking in H Bridges", 2018): the
//! bridge shorts the winding for a part of each PWM period.
//!
//! ```text
//!     link    --Command-->  +---------+ --Drive[N]--> output --> bridges --> motors
//!     capture --Reading-->  | control |                                        |
//!     supply  --Battery-->  +---------+ --Snapshot--> link, telemetry          |
//!         ^                                                                    |
//!         +------------------------ encoders, battery <------------------------+
//! ```
//!
//! ```
//! use motor_hub::braking::Winding;
//! use motor_hub::bridge::{Drive, Mode};
//! use motor_hub::motor::{Motor, Setpoint, Settings};
//! use motor_hub::supply::Battery;
//! use motor_hub::units::{Control, Micros, Millivolts, Period};
//!
//! // One motor, from its set-point to the command of its bridge.
//! let mut motor = Motor::new(Settings::new(Winding::NEVEREST_60), Period::DEFAULT);
//! motor.set(Setpoint::ConstantPower(Control::MAX));
//! let now = Micros::new(50_000);
//! let battery = Battery::unlimited(Millivolts::new(12_000), now);
//! let report = motor.step(now, None, Some(battery));
//! assert_eq!(report.drive.mode, Mode::Cw98);
//! // Without a battery voltage the motor coasts.
//! assert_eq!(motor.step(Micros::new(100_000), None, None).drive, Drive::COAST);
//! ```
//!
//! The *core* is all modules except `tasks` and `model`. Tasks wait for inputs, call the core, and pass its results on.
//! `docs/reference/glossary.md` explains the terms of this library.
//!
//! | module | purpose |
//! |---|---|
//! | [`units`] | quantities with their ranges and resolutions |
//! | [`bridge`] | the states, modes and commands of a bridge; its constants |
//! | [`braking`] | conversion of a control value to a bridge command: points S T Z G, schemes, regimes, duty |
//! | [`motion`] | positions from encoder counters, with the times of edges; PID |
//! | [`settings`] | the settings of a motor |
//! | [`regulator`] | regulation of velocity and position, with a model of the motor or with PID |
//! | [`group`] | motors that move synchronously: a reference for each motor |
//! | [`supply`] | the battery's voltage, and the limits that follow from it |
//! | [`motor`], [`hub`] | one motor, N motors: `step(inputs) -> outputs` |
//! | [`record`] | a record of faults and resets with the ticks before them, in memory that survives a reset |
//! | [`protocol`] | REV's protocol as bytes, for hosts and hubs: frames, requests, answers |
//! | [`extension`] | the hub's own protocol: requests that REV's protocol lacks; the table of all settings |
//! | [`chain`] | hubs behind this hub, on a line of their own |
//! | [`responder`] | the hub's side of both protocols: what hosts have set, the keep-alive timer, the LED |
//! | [`store`] | settings in non-volatile memory: the stored format, and the choice between two copies |
//! | [`update`] | new firmware: which chunks of an image are accepted, and when the image may start |
//! | [`devices`] | what a board may have besides motors: pins, servos, analog inputs, I2C buses |
//! | [`board`] | the traits that a board implements |
//! | `tasks` (feature `tasks`, on by default) | async tasks that run the modules above |
//! | `model` (feature `model`) | physics in `f64`, for simulators and tests; independent of the control |
//!
//! The core is `no_std`, without allocation, panics or `unsafe`. It has no clock and accesses no hardware. Its control
//! path computes in integers and in single precision, which the FPUs of the chips support. Constants and conversions
//! for users may be in `f64`.
//!
//! Positive control values, counts and speeds have the same direction, which is called CW.
//!
//! # Features
//! * `tasks` (on by default): the async tasks, on embassy. Without this feature the core has four small dependencies.
//! * `signed`: checks signatures of new firmware, see [`update::Slot::signer`].
//! * `model`: physics in `f64`, for simulators and tests; needs std.
//! * `serde`: reads modes, loops, kinds of regulator and zero behaviours from words, as in JSON files, and writes the
//!   states of the store and of a current-sense line as words.
//! * `defmt`: `defmt::Format` for most types of the core, for the log of firmware.
#![cfg_attr(not(feature = "model"), no_std)]
#![forbid(unsafe_code)]
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod board;
pub mod braking;
pub mod bridge;
pub mod chain;
pub mod devices;
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
pub mod settings;
pub mod store;
pub mod supply;
#[cfg(feature = "tasks")]
pub mod tasks;
pub mod units;
pub mod update;
