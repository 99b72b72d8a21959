//! What the hub wants of the chip beyond what the HAL sets up: clocks that nothing outside can stop, fast flash,
//! bridges off while a debugger holds the core, and an end before the supply is too low to compute with.

use defmt::warn;
use embassy_stm32::{pac, rcc};
use motor_hub::record::Fault;
use motor_hub_stm32::{record, stack};

/// EXTI line of the programmable voltage detector (RM0090 12.2.5).
const PVD_LINE: usize = 16;

/// 2.93 V falling, 2.85 V at the least (DS9405 table 22): at 168 MHz with 5 wait states the flash needs 2.7 V
/// (RM0090 table 12).
const PVD_LEVEL: u8 = 0b110;

/// 168 MHz from the chip's own 16 MHz oscillator, so that nothing outside the chip can stop it: the ST-LINK's 8 MHz
/// on OSC_IN stop with its USB. How exact that is stands in the README. Timers on APB2 run at 168 MHz too.
pub(crate) fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.pll_src = rcc::PllSource::HSI;
    config.rcc.pll = Some(rcc::Pll {
        prediv: rcc::PllPreDiv::DIV8,
        mul: rcc::PllMul::MUL168,
        divp: Some(rcc::PllPDiv::DIV2),
        // Nothing runs on these 48 MHz, but left out it is 0, which is forbidden (RM0090 6.3.2).
        divq: Some(rcc::PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV1;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV4;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config
}

/// Fast flash, a guard under the stack, and bridges off while a debugger holds the core. To be called right
/// after the HAL's initialisation, before the core sleeps for the first time.
///
/// # Flash
/// Prefetch and both caches, without which each jump costs five cycles. Prefetch is also the cure of erratum 2.2.3
/// (ES0206): with it off, and a debugger that keeps the core's clock on in sleep, what follows a WFE at an address
/// that ends in 4 may be executed wrongly. (Who writes to one bank of the flash and goes on in the other must switch
/// the data cache off meanwhile, erratum 2.2.15, which the HAL does.)
///
/// # Debugger
/// While the core is halted TIM1 stands still, and its outputs are off as after a break (RM0090 17.3.21): low, with
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

/// Why the chip began anew. Says so if it was the watchdog: the last run ended in a fault or a hang.
pub(crate) fn reset_cause() -> Fault {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    if flags.wdgrstf() {
        warn!("started by the watchdog");
    }
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

/// From here on the interrupt PVD comes when the supply falls below 2.9 V, or at once if it is there already. It ends
/// the run, so the watchdog must run.
///
/// Not the brown-out reset: its level is an option byte, and writing those from the firmware could leave a chip
/// without any if the supply fails in between. The detector needs nothing but this.
pub(crate) fn watch_supply() {
    // The line first, so that a supply that is low already makes an edge when the detector is switched on.
    pac::EXTI.rtsr(0).modify(|w| w.set_line(PVD_LINE, true));
    pac::EXTI.imr(0).modify(|w| w.set_line(PVD_LINE, true));
    unmask_pvd();
    pac::PWR.cr1().modify(|w| {
        w.set_pls(PVD_LEVEL);
        w.set_pvde(true);
    });
}

#[expect(
    unsafe_code,
    reason = "unmasking could break a critical section that masks a single interrupt; none does"
)]
fn unmask_pvd() {
    // SAFETY: the handler touches nothing but registers and atomics.
    unsafe { cortex_m::peripheral::NVIC::unmask(pac::Interrupt::PVD) }
}

/// False on chips whose second bank may be read wrongly, depending on the level of PA12, which is USB's here: those before
/// revision 3 (ES0206, erratum 2.2.11). The HAL panics there.
pub(crate) fn reads_second_bank() -> bool {
    const REVISION_3: u16 = 0x2001;
    pac::DBGMCU.idcode().read().rev_id() >= REVISION_3
}
