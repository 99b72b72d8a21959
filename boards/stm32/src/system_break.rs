//! The break of the PWM timer by the chip itself, without any code.

use embassy_stm32::pac;
use embassy_stm32::pac::timer::vals::Bkp;

/// Makes TIM1 switch its outputs off when a source that the chip has connected to its break input becomes active.
pub(crate) fn enable() {
    // The pin BKIN is not a break source, because no driver sets it up. Its disabled input is low, and the break input
    // is active high.
    pac::TIM1.af1().modify(|w| w.set_bkine(false));
    pac::TIM1.bdtr().modify(|w| {
        w.set_bkp(0, Bkp::ACTIVE_HIGH);
        w.set_bke(0, true);
    });
    // The timer may have taken the change of polarity for a break, which clears MOE. MOE is therefore set again.
    pac::TIM1.bdtr().modify(|w| w.set_moe(true));
}
