//! The chip's own set-up, in addition to the HAL's: clocks, caches, the debugger, the cause of a reset, and the supply's limit.

use embassy_stm32::{pac, rcc};
use motor_hub::record::Fault;
use motor_hub_stm32::{record, stack, start};

/// About 2.9 V falling (DS12288, embedded reset and power control block): the chip runs on to 1.71 V, but not what hangs
/// on its pins.
pub(crate) const PVD_LEVEL: u8 = 0b110;

/// RAM can be read before the first write.
pub(crate) const RAM_HAS_ERROR_CODE: bool = false;

/// Lights the red lamp, PC10, and starts the watchdog.
pub(crate) fn before_clocks() {
    pac::RCC.ahb2enr().modify(|w| w.set_gpiocen(true));
    start::before_clocks(pac::IWDG, pac::GPIOC, 10);
}

/// 170 MHz from the chip's own 16 MHz oscillator, so that nothing outside the chip can stop it. All timers run at that.
pub(crate) fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.pll = Some(rcc::Pll {
        source: rcc::PllSource::HSI,
        prediv: rcc::PllPreDiv::DIV4,
        mul: rcc::PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(rcc::PllRDiv::DIV2),
    });
    config.rcc.sys = rcc::Sysclk::PLL1_R;
    config.rcc.boost = true;
    config.rcc.hsi48 = None;
    config.rcc.ls = rcc::LsConfig::off();
    config
}

/// Fast flash, a guard under the stack, and bridges off while a debugger holds the core. To be called right
/// after the HAL's initialisation, before the core sleeps for the first time.
///
/// # Flash
/// Prefetch and both caches. They are between flash and core alone, so DMA does not know of them.
///
/// # Debugger
/// While the core is halted TIM1 stands still, and its outputs are off as after a break (RM0440 28.3.31): low, with
/// OSSI set. The watchdog runs on.
pub(crate) fn set_up() {
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

/// Why the chip was reset.
///
/// This chip has one flag, BORRSTF, for power-on and brown-out (RM0440 7.4.29). Power-on is the usual cause.
pub(crate) fn reset_cause() -> Fault {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    record::cause([
        (flags.borrstf(), Fault::PowerOn),
        (flags.iwdgrstf(), Fault::Watchdog),
        (flags.sftrstf(), Fault::SoftwareReset),
        (flags.wwdgrstf(), Fault::OtherReset),
        (flags.lpwrrstf(), Fault::OtherReset),
        (flags.pinrstf(), Fault::ResetPin),
    ])
}
