//! An STM32F427, F429, F437 or F439: its set-up in addition to the HAL's (clocks, the cause of a reset, the supply's limit),
//! and the drivers that only these chips need.

pub mod adc;
pub mod analog;
pub mod current;
pub mod i2c;
pub mod transmission;

pub use crate::after_clocks::set_up;

use crate::record;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::SampleTime;
use embassy_stm32::{pac, rcc};
use motor_hub::record::Fault;

/// Level of the programmable voltage detector (PVD) for a falling supply: typically 2.93 V, and at least 2.85 V (DS9405
/// table 22). At 168 MHz with 5 wait states the flash needs 2.7 V (RM0090 table 12).
pub const PVD_LEVEL: u8 = 0b110;

/// RAM can be read before the first write.
pub const RAM_HAS_ERROR_CODE: bool = false;

/// Returns the clocks: 168 MHz from the chip's internal 16 MHz oscillator (HSI), which nothing outside the chip can
/// stop. The 8 MHz clock of the ST-LINK on OSC_IN is not used, because it stops when the USB of the ST-LINK is
/// disconnected. The README has the oscillator's accuracy. Timers on APB2 run at 168 MHz too.
pub fn clocks() -> embassy_stm32::Config {
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
pub fn reset_cause() -> Fault {
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

/// Sets the sampling time of a converter's channel.
fn set_sampling_time(converter: Adc, channel: u8, time: SampleTime) {
    match channel.checked_sub(10) {
        Some(place) => converter.smpr1().modify(|w| w.set_smp(place.into(), time)),
        None => converter.smpr2().modify(|w| w.set_smp(channel.into(), time)),
    }
}

/// Makes up to four channels the injected group of a converter. Without SCAN only one channel of an injected group is
/// converted (RM0090 13.3.8).
fn inject<const N: usize>(converter: Adc, channels: [u8; N]) {
    const { assert!(N > 0 && N <= 4) };
    converter.jsqr().write(|w| {
        w.set_jl(N as u8 - 1);
        // A group uses the last of the four positions in JSQR (RM0090 13.13.12).
        for (position, channel) in (4 - N..).zip(channels) {
            w.set_jsq(position, channel);
        }
    });
    converter.cr1().modify(|w| w.set_scan(true));
}

/// True if the second bank of the flash can be read reliably. On chips before revision 3 a read may give wrong data,
/// depending on the level of PA12, a USB pin (ES0206 rev 24, erratum 2.2.14). The HAL panics when such a
/// chip accesses the second bank.
pub fn reads_second_bank() -> bool {
    const REVISION_3: u16 = 0x2001;
    pac::DBGMCU.idcode().read().rev_id() >= REVISION_3
}
