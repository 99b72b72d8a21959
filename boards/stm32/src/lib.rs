//! What any board with an STM32 shares: drivers behind the traits of [`motor_hub::board`], generic over the
//! number of motors and over peripheral instances, and what ends and explains a run. No pin, no clock and
//! no chip is named here: a board does that, and gives each of these to a task.
//!
//! | room | what it drives |
//! |---|---|
//! | [`vnh5019`] | N bridges on one advanced timer |
//! | [`diag`] | what bridges say of themselves |
//! | [`encoders`] | quadrature counters, a timer each |
//! | [`serial`] | the host link: a buffered USART |
//! | [`pins`] | digital pins for a host |
//! | [`lamp`] | the host's status LEDs: red, green, blue |
//! | [`watchdog`] | the independent watchdog |
//! | [`faults`] | panic and faults: bridges open first |
//! | [`demo`] | motors that turn while a button is held |
//! | [`status`] | the log |
#![no_std]

pub mod demo;
pub mod diag;
pub mod encoders;
pub mod faults;
pub mod lamp;
pub mod pins;
pub mod serial;
pub mod status;
pub mod vnh5019;
pub mod watchdog;
