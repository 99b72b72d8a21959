//! An STM32G473, G474, G483 or G484: its set-up in addition to the HAL's (clocks, the cause of a reset, the supply's limit),
//! and the driver of its converters.

pub mod adc;

pub use crate::after_clocks::set_up;

use crate::{record, system_break};
use embassy_stm32::{pac, rcc};
use motor_hub::record::Fault;

/// Level of the programmable voltage detector (PVD): about 2.9 V for a falling supply (DS12288, embedded reset and
/// power control block). The chip itself works down to 1.71 V, but the devices on its pins do not.
pub const PVD_LEVEL: u8 = 0b110;

/// RAM can be read before the first write.
pub const RAM_HAS_ERROR_CODE: bool = false;

/// Returns the clocks: 80 MHz from the chip's internal 16 MHz oscillator (HSI), which nothing outside the chip can
/// stop. All timers run at 80 MHz.
///
/// The chip can run at 170 MHz. Above 80 MHz the bus has to run at half its clock for 1 us after the clock has been
/// switched (RM0440 7.2.7, system clock switch), and the HAL switches both at once.
pub fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.pll = Some(rcc::Pll {
        source: rcc::PllSource::HSI,
        prediv: rcc::PllPreDiv::DIV4,
        mul: rcc::PllMul::MUL40,
        divp: None,
        divq: None,
        divr: Some(rcc::PllRDiv::DIV2),
    });
    config.rcc.sys = rcc::Sysclk::PLL1_R;
    config.rcc.hsi48 = None;
    config.rcc.ls = rcc::LsConfig::off();
    config
}

/// Makes the chip switch all PWM off without any code when the core locks up or the supply falls (RM0440, SYSCFG_CFGR2 and the
/// break function of TIM1). Call this function after the set-up of TIM1. The connection of the supply also locks the setting of the
/// voltage detector.
///
/// Double ECC errors of the flash are not connected: they raise the NMI, whose handler opens the bridges.
pub fn break_pwm() {
    pac::SYSCFG.cfgr2().modify(|w| {
        w.set_cll(true);
        w.set_pvdl(true);
    });
    system_break::enable();
}

/// Returns the cause of the last reset, and clears the reset flags.
///
/// This chip has one flag, BORRSTF, for power-on and brown-out (RM0440 7.4.29). Power-on is the usual cause.
pub fn reset_cause() -> Fault {
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
