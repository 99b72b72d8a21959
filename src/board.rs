//! The traits that a board implements for its peripherals.
//!
//! | trait | needed by |
//! |---|---|
//! | [`Encoders`], [`SupplyAdc`], [`Bridges`] | every board |
//! | [`BridgeSensors`] | boards that can read fault outputs or current-sense lines of their bridges |
//! | [`Devices`] | boards with digital pins, servo outputs or analog inputs for the host |
//! | `I2cBus` (feature `tasks`) | boards with I2C buses for the host |
//!
//! A board also spawns the tasks of `crate::tasks`. These traits exist because embedded-hal 1.0 has no traits for
//! quadrature counters, ADCs and H bridges.
//!
//! ```
//! use motor_hub::board::Encoders;
//!
//! /// Counters in memory. The second counter is defective.
//! struct Counters([u16; 1]);
//!
//! impl Encoders<2> for Counters {
//!     fn counts(&mut self) -> [Option<u16>; 2] {
//!         [Some(self.0[0]), None]
//!     }
//! }
//! assert_eq!(Counters([65_535]).counts(), [Some(65_535), None]);
//! ```

use crate::bridge::{BridgeFeedback, Drive};
pub use crate::devices::{
    ANALOG_INPUTS, AnalogReading, AnalogReadings, DIGITAL_PINS, Equipment, I2C_BUSES, SERVOS, ServoPulse,
};
use crate::units::Millivolts;
use core::ops::RangeInclusive;

/// The quadrature counters of N motors.
pub trait Encoders<const N: usize> {
    /// Returns all counters. `None` for a counter that cannot be read now. Must not block.
    ///
    /// Counters wrap at 16 bits, and count up when the motor turns CW. If a counter has not been read for 20 ms, its
    /// motor is treated as a motor without encoder. Between two reads a counter must change by less than 32 768.
    fn counts(&mut self) -> [Option<u16>; N];
}

/// The ADC that measures the battery.
#[allow(async_fn_in_trait, reason = "tasks of one thread: no bound on the future is needed")]
pub trait SupplyAdc {
    /// Measures the battery's voltage. `None` if the converter does not answer, if its reference is invalid, or if the
    /// voltage is above 65.535 V.
    ///
    /// The voltage is not checked for plausibility. [`crate::supply::VrefintScale`] can convert readings to millivolts.
    /// Must return within a few milliseconds.
    async fn sample(&mut self) -> Option<Millivolts>;

    /// Waits until the battery's voltage leaves the range `quiet`. Returns at most a millisecond after the voltage has
    /// left the range.
    ///
    /// May also return while the voltage is in the range, if it differs from a limit by less than the converter's
    /// resolution. The analog watchdog of an ADC can watch the range without the processor. The future may be dropped
    /// at any time.
    async fn wait_until_outside(&mut self, quiet: RangeInclusive<Millivolts>);
}

/// N H bridges.
pub trait Bridges<const N: usize> {
    /// Applies a command to each bridge. The command stays in force until the next call.
    ///
    /// While a bridge changes from one command to another, the bridge must never short the supply. The bridge must
    /// never drive in the new direction with the old duty.
    fn apply(&mut self, drives: &[Drive; N]);
}

/// Fault outputs of bridges that switch themselves off, such as the DIAG pins of a VNH5019, and current-sense lines.
#[allow(async_fn_in_trait, reason = "tasks of one thread: no bound on the future is needed")]
pub trait BridgeSensors<const N: usize> {
    /// Samples both signals of each bridge. Must return within a few milliseconds. Without measured currents the hub
    /// computes currents from its model.
    ///
    /// A current-sense line shows the magnitude of the motor's mean current in the modes 9/8 and 6/2. In mode 5/0 it
    /// shows 0, which is a valid measurement. Each line needs a filter with a time constant of some tenths of a
    /// millisecond.
    async fn sample(&mut self) -> [BridgeFeedback; N];
}

/// What a board has for hosts besides its motors: digital pins, servo outputs and analog inputs. No function may block.
pub trait Devices {
    /// Returns what the board has. The result is always the same.
    fn equipment(&self) -> Equipment;

    /// Sets the direction and the level of all digital pins, and returns their levels. Bit i stands for pin i, and 1 is
    /// high.
    ///
    /// A pin whose bit in `driven` is 1 is an output with its level in `levels`. All other pins are inputs with a
    /// pull-up. Bits of pins that the board does not have are ignored.
    fn update_digital_pins(&mut self, driven: u8, levels: u8) -> u8;

    /// Sets the pulses of all servo outputs. `None` for an output without pulses, which is low.
    ///
    /// The function is called when the pulses have changed. Before the first call no output has pulses. New pulses
    /// begin with the next period, so no period has a wrong pulse. Outputs of one timer may share the period that was
    /// set last.
    fn set_servos(&mut self, servos: &[Option<ServoPulse>; SERVOS]);

    /// Returns the newest readings.
    fn analog(&mut self) -> AnalogReadings;
}

/// A board without devices for hosts.
impl Devices for () {
    fn equipment(&self) -> Equipment {
        Equipment::default()
    }

    fn update_digital_pins(&mut self, _: u8, _: u8) -> u8 {
        0
    }

    fn set_servos(&mut self, _: &[Option<ServoPulse>; SERVOS]) {}

    fn analog(&mut self) -> AnalogReadings {
        AnalogReadings::default()
    }
}

/// One I2C bus for hosts. The transfers are the transfers of embedded-hal: a write, a read, and a write with a read
/// after a repeated start.
///
/// A transfer's future may be dropped at any time, after which the bus must be [recovered](Self::recover). A device may
/// stretch the clock for 30 ms. `NoAcknowledgeSource` says which byte had no acknowledgement.
#[cfg(feature = "tasks")]
#[allow(async_fn_in_trait, reason = "tasks of one thread: no bound on the future is needed")]
pub trait I2cBus: embedded_hal_async::i2c::I2c {
    /// Sets the speed of the next transfers: 400 kbit/s if `fast`, otherwise 100 kbit/s. Before the first call the
    /// speed is 100 kbit/s.
    fn set_speed(&mut self, fast: bool);

    /// Ends what a transfer has left on the lines: nine clock pulses with SDA released, then a stop. The controller of
    /// the bus is then ready for the next transfer.
    ///
    /// Must return within 2 ms, also if a device holds SCL or SDA.
    async fn recover(&mut self);
}
