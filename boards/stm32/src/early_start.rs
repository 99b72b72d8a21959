//! Starts a lamp and the watchdog before the clocks run.

use embassy_stm32::pac::gpio::{Gpio, vals::Moder};
use embassy_stm32::pac::iwdg::{Iwdg, vals::Key};

/// Lights the lamp on the pin with this number, and starts the watchdog. The clock of the port must run. This function must be
/// called before the HAL's initialisation.
///
/// The HAL waits without a limit for regulators and oscillators. If one never becomes ready, the watchdog resets the chip
/// every 0.5 s (its period after a reset, 4096 ticks of LSI / 4), and the lamp stays on. Otherwise the lamp goes off within
/// milliseconds, when the hub takes its pin.
pub fn before_clocks(watchdog: Iwdg, port: Gpio, lamp: usize) {
    // A port may ignore a write that follows the enabling of its clock within two cycles (ES0206, delay after an RCC peripheral
    // clock enabling). The barrier takes longer. A read can be too short (http://efton.sk/STM32/gotcha/g183.html).
    cortex_m::asm::dsb();
    port.bsrr().write(|w| w.set_bs(lamp, true));
    port.moder().modify(|w| w.set_moder(lamp, Moder::OUTPUT));
    watchdog.kr().write(|w| w.set_key(Key::START));
}
