//! The independent watchdog: resets the chip, which opens the bridges, unless it is fed.

use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG;
use motor_hub::board::Watchdog;

/// Five of the longest control periods (100 ms), in which every task must check in once.
///
/// Counted by the LSI oscillator, nominally 32 kHz but 17 to 47 kHz (STM32F429 data sheet): 0.34 to
/// 0.94 s.
const TIMEOUT_MICROS: u32 = 500_000;

/// The watchdog, running.
pub(crate) struct IndependentWatchdog(embassy_stm32::wdg::IndependentWatchdog<'static, IWDG>);

impl IndependentWatchdog {
    /// Starts it; only a reset stops it.
    pub(crate) fn start(iwdg: Peri<'static, IWDG>) -> Self {
        let mut watchdog = embassy_stm32::wdg::IndependentWatchdog::new(iwdg, TIMEOUT_MICROS);
        watchdog.unleash();
        Self(watchdog)
    }
}

impl Watchdog for IndependentWatchdog {
    fn feed(&mut self) {
        self.0.pet();
    }
}
