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
//! | [`record`] | memory that a reset leaves alone; what began a run |
//! | [`stack`] | a guard at its end |
//! | [`demo`] | motors that turn while a button is held |
//! | [`status`] | the log |
#![no_std]

pub mod demo;
pub mod diag;
pub mod encoders;
pub mod faults;
pub mod lamp;
pub mod pins;
pub mod record;
pub mod serial;
pub mod stack;
pub mod status;
pub mod vnh5019;
pub mod watchdog;

use motor_hub::units::Period;

/// The control period that an image is built for: 50 ms, or what a variable says, 1 to 100 ms.
///
/// # Panics
/// When the image is built, if it says something else.
#[must_use]
pub const fn period(milliseconds: Option<&str>) -> Period {
    let ms = match milliseconds {
        None => 50,
        Some(text) => match u32::from_str_radix(text, 10) {
            Ok(ms) => ms,
            Err(_) => panic!("CONTROL_PERIOD_MS must be a whole number of milliseconds"),
        },
    };
    match Period::from_millis(ms) {
        Ok(period) => period,
        Err(_) => panic!("CONTROL_PERIOD_MS must be 1 to 100"),
    }
}
