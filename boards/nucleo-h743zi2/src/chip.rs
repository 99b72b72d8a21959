//! What the hub wants of the chip beyond what the HAL sets up: clocks that nothing outside can stop, code from the
//! instruction cache, bridges off while a debugger holds the core, and an end before the supply is too low for the
//! bridges' inputs.

use boot_h743zi2::execute_first_bank_only;
use defmt::warn;
use embassy_stm32::{pac, rcc};
use motor_hub::record::Fault;
use motor_hub_stm32::{record, stack};

/// EXTI line of the programmable voltage detector (RM0433 table 150).
const PVD_LINE: usize = 16;

/// 2.86 V rising, 2.76 V falling (DS12110 table 116): the chip itself runs on to 1.62 V, but not what
/// hangs on its pins.
const PVD_LEVEL: u8 = 0b110;

/// HSI over this is what all PLLs multiply: 8 MHz.
const PREDIV: rcc::PllPreDiv = rcc::PllPreDiv::DIV8;

/// 400 MHz from the chip's own 64 MHz oscillator, so that nothing outside the chip can stop it: the ST-LINK's 8 MHz on
/// OSC_IN stop with its USB. How exact that is stands in the README. Buses run at 200 and 100 MHz, all timers at 200.
pub(crate) fn clocks() -> embassy_stm32::Config {
    let pll = |mul, divp| rcc::Pll {
        source: rcc::PllSource::HSI,
        prediv: PREDIV,
        mul,
        fracn: None,
        divp,
        divq: None,
        divr: None,
    };
    let mut config = embassy_stm32::Config::default();
    config.rcc.voltage_scale = rcc::VoltageScale::Scale1;
    config.rcc.pll1 = Some(pll(rcc::PllMul::MUL100, Some(rcc::PllDiv::DIV2)));
    // 32 MHz for the converters, which halve it (of revision Y they do not, and take 36 MHz).
    config.rcc.pll2 = Some(pll(rcc::PllMul::MUL48, Some(rcc::PllDiv::DIV12)));
    config.rcc.mux.adcsel = rcc::mux::Adcsel::PLL2_P;
    // Nobody's: the HAL switches an unused one off by writing what PLL1, which runs, does not let be written.
    config.rcc.pll3 = Some(pll(rcc::PllMul::MUL20, None));
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV2;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb3_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb4_pre = rcc::APBPrescaler::DIV2;
    // No USB, and no clock of day: the backup domain is left alone.
    config.rcc.hsi48 = None;
    config.rcc.ls = rcc::LsConfig::off();
    config
}

/// Code from the cache and from the first bank alone, a guard under the stack, and bridges off while a debugger holds the
/// core. To be called right after the HAL's initialisation, before the core sleeps for the first time.
///
/// # Caches
/// Instructions only: see docs/decisions/0014-caches-of-the-h743.md. What is in the flash does not change while this
/// runs, and data are in the DTCM, beside all caches: nothing can be stale.
///
/// # Debugger
/// While the core is halted TIM1 stands still, and its outputs are off as after a break (RM0433 38.3.29): low, with
/// OSSI set. The watchdog runs on.
pub(crate) fn set_up() {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.SCB.enable_icache();
        stack::guard(&mut core.MPU);
        execute_first_bank_only(&mut core.MPU);
    }
    pac::RCC.cr().modify(|w| w.set_pllon(2, false));
    pac::DBGMCU.apb2fzr1().modify(|w| w.set_tim1(true));
}

/// Why the chip began anew. Says so if it was the watchdog: the last run ended in a fault or a hang.
pub(crate) fn reset_cause() -> Fault {
    let flags = pac::RCC.rsr().read();
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
    if flags.iwdg1rstf() {
        warn!("started by the watchdog");
    }
    record::cause([
        (flags.porrstf(), Fault::PowerOn),
        (flags.borrstf(), Fault::BrownOut),
        (flags.iwdg1rstf(), Fault::Watchdog),
        (flags.sftrstf(), Fault::SoftwareReset),
        (flags.wwdg1rstf(), Fault::OtherReset),
        (flags.lpwrrstf(), Fault::OtherReset),
        (flags.pinrstf(), Fault::ResetPin),
    ])
}

/// From here on the interrupt PVD comes when the supply falls below 2.76 V, or at once if it is there already. It ends
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
    unsafe { cortex_m::peripheral::NVIC::unmask(pac::Interrupt::PVD_AVD) }
}
