//! The independent watchdog: resets the chip, which opens the bridges, unless it is fed.

use embassy_stm32::Peri;
use embassy_stm32::wdg::{IndependentWatchdog, Instance};

/// Nominal time-out in microseconds: five of the longest control periods (100 ms). Every expected task must check in
/// once within the time-out.
///
/// The LSI oscillator counts the time-out, nominally at 32 kHz. It has 17 to 47 kHz in an STM32F4 (data sheet), so the time-out
/// is 0.34 to 0.94 s. It has 29.4 to 33.6 kHz in an STM32H7, so the time-out is 0.48 to 0.54 s.
const TIMEOUT_MICROS: u32 = 500_000;

/// Starts the watchdog. Only a reset stops it.
pub fn start<T: Instance + 'static>(iwdg: Peri<'static, T>) -> IndependentWatchdog<'static, T> {
    let mut watchdog = IndependentWatchdog::new(iwdg, TIMEOUT_MICROS);
    watchdog.unleash();
    watchdog
}
