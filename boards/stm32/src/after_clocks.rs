//! What an STM32F4 and an STM32G4 set up after the clocks.

use crate::stack;
use embassy_stm32::pac;

/// Enables the prefetch and the caches of the flash, sets the guard of the stack, and stops the PWM timer while a debugger
/// halts the core. Call this function right after the HAL's initialisation, before the core sleeps for the first time.
///
/// # Flash
/// Prefetch and both caches are on. They serve only the core's accesses to the flash, so they have no effect on DMA.
/// Without prefetch and caches each jump costs five cycles on an STM32F42x. On this chip prefetch also avoids erratum 2.2.3
/// (ES0206): without prefetch, and while a debugger keeps the core's clock on in sleep, the instruction after a WFE may be
/// executed wrongly at an address that ends in 4. While code of one bank writes the other bank, the data cache must be
/// off (erratum 2.2.15): the HAL does this.
///
/// # Debugger
/// While the core is halted, TIM1 is stopped and its outputs are off as after a break (RM0090 17.3.21, RM0440 28.3.31).
/// With OSSI set, the outputs are then low. The watchdog continues to run.
pub fn set_up() {
    pac::FLASH.acr().modify(|w| {
        w.set_prften(true);
        w.set_icen(true);
        w.set_dcen(true);
    });
    if let Some(mut core) = cortex_m::Peripherals::take() {
        stack::guard(&mut core.MPU);
    }
    pac::DBGMCU.apb2fzr().modify(|w| w.set_tim1(true));
}
