//! Code that boards with an STM32 share: drivers behind the traits of [`motor_hub::board`], handlers of panics and
//! faults, and the program of a hub. The drivers are generic over the number of motors and over peripherals. The crate
//! of a board adds its pins, its memory map, and one feature that names its chip: `f42x`, `g47x` or `h74x`.
//!
//! | module | what is in it |
//! |---|---|
//! | [`hub!`] | the program: statics, tasks, their start |
//! | [`chip`] | what only one chip has: clocks, cause of a reset, converters, I2C controllers |
//! | [`vnh5019`] | N bridges on one advanced timer |
//! | [`bridge_faults`] | the fault lines of bridges |
//! | [`encoders`] | quadrature counters, a timer each |
//! | [`supply`] | the voltage detector, readings that the factory has stored, a task's wait for an interrupt |
//! | `two_converters` | battery and VREFINT on a converter each, as in the G47x and the H74x |
//! | [`serial`] | serial lines, a buffered USART each: the host link and the chain line |
//! | [`pins`] | digital pins for a host |
//! | [`servo`] | servo outputs for a host |
//! | `analog` | readings of analog inputs, 5 V rail and temperature |
//! | [`connectors`] | digital pins, servo outputs and analog inputs together |
//! | [`i2c_bus`] | an I2C bus for a host |
//! | [`lamp`] | the host's status LEDs: red, green, blue |
//! | `system_break` | the break of the PWM timer by a lock-up or by a falling supply, in the G47x and the H74x |
//! | [`watchdog`] | the independent watchdog |
//! | [`faults`] | handlers of panics and faults, which first open the bridges |
//! | [`record`] | memory that a reset does not clear, and the cause of the reset |
//! | [`stack`] | a guard at the stack's end |
//! | [`button`] | motors that turn while a button is held |
//! | [`early_start`] | what is started before the clocks: a lamp and the watchdog |
//! | [`status`] | the log |
#![no_std]

#[cfg(any(feature = "f42x", feature = "g47x"))]
mod after_clocks;
#[cfg(any(feature = "f42x", feature = "h74x"))]
mod analog;
pub mod bridge_faults;
pub mod button;
#[cfg_attr(feature = "f42x", path = "f42x/mod.rs")]
#[cfg_attr(feature = "g47x", path = "g47x/mod.rs")]
#[cfg_attr(feature = "h74x", path = "h74x/mod.rs")]
pub mod chip;
pub mod connectors;
pub mod early_start;
pub mod encoders;
pub mod faults;
mod hub;
pub mod i2c_bus;
pub mod lamp;
mod mpu;
pub mod pins;
pub mod record;
pub mod serial;
pub mod servo;
pub mod stack;
pub mod status;
pub mod supply;
#[cfg(any(feature = "g47x", feature = "h74x"))]
mod system_break;
#[cfg(any(feature = "g47x", feature = "h74x"))]
pub mod two_converters;
pub mod vnh5019;
pub mod watchdog;

use defmt_rtt as _;
use motor_hub::units::Period;

/// An analogue-to-digital converter that may need a calibration before its first conversion.
#[expect(async_fn_in_trait, reason = "one executor, one core: no future has to be Send")]
pub trait Calibrate {
    /// Calibrates the converter. This default does nothing, for a converter that needs no calibration.
    async fn calibrate(&self) {}
}

/// Returns the control period of an image: the number of milliseconds in the text, 1 to 100, or 50 ms without a text.
///
/// # Panics
/// Panics if the text is anything else. Images call this function at compile time, so the build fails.
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
