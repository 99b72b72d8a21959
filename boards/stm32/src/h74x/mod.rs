//! An STM32H743 or H753: its set-up in addition to the HAL's (clocks, caches, the debugger, the cause of a reset, the
//! supply's limit), and the drivers that only these chips need.

pub mod adc;
pub mod analog;
pub mod current;
pub mod i2c;

use crate::{record, stack, system_break};
use core::ptr::with_exposed_provenance_mut;
use cortex_m::peripheral::MPU;
use embassy_stm32::pac::common::{RW, Reg};
use embassy_stm32::{pac, rcc};
use motor_hub::record::Fault;

/// Level of the programmable voltage detector (PVD): 2.86 V for a rising supply, and 2.76 V for a falling one (DS12110
/// table 116). The chip itself works down to 1.62 V, but the devices on its pins do not.
pub const PVD_LEVEL: u8 = 0b110;

/// SYSCFG_CFGR, with its bits CM7L and PVDL (RM0433 12.3.6). The peripheral access crate does not have the register.
const SYSCFG_CFGR: usize = 0x5800_0418;
const LOCK_UP_BREAKS: u32 = 1 << 6;
const SUPPLY_BREAKS: u32 = 1 << 2;

/// Divisor of HSI before all PLLs. The PLLs therefore multiply 8 MHz.
const PREDIV: rcc::PllPreDiv = rcc::PllPreDiv::DIV8;

/// RAM has an error-correcting code, which is not valid before the first write. A read of RAM before the first write
/// may be a bus error.
pub const RAM_HAS_ERROR_CODE: bool = true;

/// Returns the clocks: 400 MHz from the chip's internal 64 MHz oscillator (HSI), which nothing outside the chip can
/// stop. The 8 MHz clock of the ST-LINK on OSC_IN is not used, because it stops when the USB of the ST-LINK is
/// disconnected. The README has the oscillator's accuracy. Buses run at 200 and 100 MHz, all timers at 200 MHz.
pub fn clocks() -> embassy_stm32::Config {
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
    // The oscillators of all PLLs run at more than 420 MHz: from 420 MHz down the HAL chooses their medium range, which is
    // specified for a reference of up to 2 MHz only, and the reference has 8 MHz (DS12110, PLL characteristics).
    // The converters get 32 MHz, and halve this clock. In revision Y they do not halve it, and work with up to 36 MHz.
    config.rcc.pll2 = Some(pll(rcc::PllMul::MUL60, Some(rcc::PllDiv::DIV15)));
    config.rcc.mux.adcsel = rcc::mux::Adcsel::PLL2_P;
    // PLL3 is configured, although nothing uses it. To switch an unused PLL off, the HAL writes a register that the
    // running PLL1 locks. `set_up` switches PLL3 off.
    config.rcc.pll3 = Some(pll(rcc::PllMul::MUL60, None));
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV2;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb3_pre = rcc::APBPrescaler::DIV2;
    config.rcc.apb4_pre = rcc::APBPrescaler::DIV2;
    // The hub uses neither USB nor a real-time clock, so the backup domain is not configured.
    config.rcc.hsi48 = None;
    config.rcc.ls = rcc::LsConfig::off();
    config
}

/// Enables the instruction cache, sets the guard of the stack, forbids the execution of code in the DTCM and in what
/// `forbid_execution` names, switches PLL3 off, and stops the PWM timer while a debugger halts the core. Call this function right after the HAL's initialisation, before
/// the core sleeps for the first time.
///
/// # Caches
/// Only the instruction cache is on: docs/decisions/0014-caches-of-the-h743.md. The image's flash does not change while
/// the image runs, and data are in the DTCM, which no cache serves. So no cache line can be stale.
///
/// # Debugger
/// While the core is halted, TIM1 is stopped and its outputs are off as after a break (RM0433 38.3.29). With OSSI set,
/// the outputs are then low. The watchdog continues to run.
pub fn set_up(forbid_execution: fn(&mut MPU)) {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.SCB.enable_icache();
        stack::guard(&mut core.MPU);
        forbid_execution(&mut core.MPU);
    }
    pac::RCC.cr().modify(|w| w.set_pllon(2, false));
    pac::DBGMCU.apb2fzr1().modify(|w| w.set_tim1(true));
}

/// Makes the chip switch all PWM off without any code when the core locks up or the supply falls. Call this function
/// after the set-up of TIM1. Before revision V the timer ignores both (ES0392 2.2.2).
///
/// Double ECC errors are not connected to the timer's break input. The core takes such an error as a bus fault, whose
/// handler opens the bridges. If the handler fails too, the core locks up. If errors of the flash were connected, a
/// read of a word that a power cut has damaged would also cause a break. The store reads such words as empty. If errors
/// of the DTCM were connected, a read of stack memory that has not been written since power-on would also cause a
/// break.
pub fn break_pwm() {
    const REVISION_V: u16 = 0x2003;
    if pac::DBGMCU.idc().read().rev_id() < REVISION_V {
        return;
    }
    #[expect(unsafe_code, reason = "the peripheral access crate has no name for this register")]
    // SAFETY: the address is that of a register of SYSCFG. The HAL has enabled the clock of SYSCFG, and no other code
    // accesses the register.
    let connections = unsafe { Reg::<u32, RW>::from_ptr(with_exposed_provenance_mut(SYSCFG_CFGR)) };
    connections.write_value(LOCK_UP_BREAKS | SUPPLY_BREAKS);
    system_break::enable();
}

/// Returns the cause of the last reset, and clears the reset flags.
pub fn reset_cause() -> Fault {
    let flags = pac::RCC.rsr().read();
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
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
