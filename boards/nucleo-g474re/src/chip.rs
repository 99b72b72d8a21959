//! What the hub wants of the chip beyond what the HAL sets up: clocks that nothing outside can stop, fast flash,
//! bridges off while a debugger holds the core, and an end before the supply is too low to compute with.

use defmt::warn;
use embassy_stm32::{pac, rcc};
use motor_hub::record::Fault;
use motor_hub_stm32::{record, stack};

/// EXTI line of the programmable voltage detector (RM0440 table 103).
const PVD_LINE: usize = 16;

/// About 2.9 V falling (DS12288, embedded reset and power control block): the chip runs on to 1.71 V, but not what hangs
/// on its pins.
const PVD_LEVEL: u8 = 0b110;

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

/// Why the chip began anew. Says so if it was the watchdog: the last run ended in a fault or a hang.
///
/// This chip has one flag, BORRSTF, for power-on and brown-out (RM0440 7.4.29). What it is mostly is power-on.
pub(crate) fn reset_cause() -> Fault {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    if flags.iwdgrstf() {
        warn!("started by the watchdog");
    }
    record::cause([
        (flags.borrstf(), Fault::PowerOn),
        (flags.iwdgrstf(), Fault::Watchdog),
        (flags.sftrstf(), Fault::SoftwareReset),
        (flags.wwdgrstf(), Fault::OtherReset),
        (flags.lpwrrstf(), Fault::OtherReset),
        (flags.pinrstf(), Fault::ResetPin),
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
    pac::PWR.cr2().modify(|w| {
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
    unsafe { cortex_m::peripheral::NVIC::unmask(pac::Interrupt::PVD_PVM) }
}
