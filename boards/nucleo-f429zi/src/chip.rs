//! The chip's own set-up, in addition to the HAL's: clocks, the cause of a reset, and the supply's limit.

use embassy_stm32::{pac, rcc};
use motor_hub::record::Fault;
use motor_hub_stm32::{record, start};

/// Level of the programmable voltage detector (PVD): 2.93 V for a falling supply, and at least 2.85 V (DS9405 table
/// 22). At 168 MHz with 5 wait states the flash needs 2.7 V (RM0090 table 12).
pub(crate) const PVD_LEVEL: u8 = 0b110;

/// RAM can be read before the first write.
pub(crate) const RAM_HAS_ERROR_CODE: bool = false;

/// Lights the red lamp, PB14, and starts the watchdog.
pub(crate) fn before_clocks() {
    pac::RCC.ahb1enr().modify(|w| w.set_gpioben(true));
    start::before_clocks(pac::IWDG, pac::GPIOB, 14);
}

/// Returns the clocks: 168 MHz from the chip's internal 16 MHz oscillator (HSI), which nothing outside the chip can
/// stop. The 8 MHz clock of the ST-LINK on OSC_IN is not used, because it stops when the USB of the ST-LINK is
/// disconnected. The README has the oscillator's accuracy. Timers on APB2 run at 168 MHz too.
pub(crate) fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.pll_src = rcc::PllSource::HSI;
    config.rcc.pll = Some(rcc::Pll {
        prediv: rcc::PllPreDiv::DIV8,
        mul: rcc::PllMul::MUL168,
        divp: Some(rcc::PllPDiv::DIV2),
        // No peripheral uses this clock of 48 MHz. Without this setting PLLQ would be 0, which is forbidden (RM0090
        // 6.3.2).
        divq: Some(rcc::PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV1;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV4;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config
}

/// Returns the cause of the last reset, and clears the reset flags.
pub(crate) fn reset_cause() -> Fault {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    record::cause([
        (flags.porrstf(), Fault::PowerOn),
        (flags.borrstf(), Fault::BrownOut),
        (flags.wdgrstf(), Fault::Watchdog),
        (flags.sftrstf(), Fault::SoftwareReset),
        (flags.wwdgrstf(), Fault::OtherReset),
        (flags.lpwrrstf(), Fault::OtherReset),
        (flags.padrstf(), Fault::ResetPin),
    ])
}

/// True if the second bank of the flash can be read reliably. On chips before revision 3 a read may give wrong data,
/// depending on the level of PA12, a USB pin of this board (ES0206 rev 24, erratum 2.2.14). The HAL panics when such a
/// chip accesses the second bank.
pub(crate) fn reads_second_bank() -> bool {
    const REVISION_3: u16 = 0x2001;
    pac::DBGMCU.idcode().read().rev_id() >= REVISION_3
}
