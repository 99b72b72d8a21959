//! Four quadrature encoders on TIM2, TIM3, TIM4 and TIM8, each counting all four edges of A and B.
//!
//! Inputs are pulled up: open-collector encoders need it, and an unplugged one then stands still
//! instead of counting noise.

use embassy_stm32::Peri;
use embassy_stm32::gpio::Pull;
use embassy_stm32::peripherals::{PA15, PB3, PB4, PB5, PC6, PC7, PD12, PD13, TIM2, TIM3, TIM4, TIM8};
use embassy_stm32::timer::qei::{Config, Qei};
use motor_hub::board::Encoders;

use crate::MOTORS;

/// A timer with the pins of channels A and B.
type Wired<T, A, B> = (Peri<'static, T>, Peri<'static, A>, Peri<'static, B>);

/// The counters, by motor.
pub(crate) struct QuadratureCounters {
    motor_0: Qei<'static, TIM2>,
    motor_1: Qei<'static, TIM3>,
    motor_2: Qei<'static, TIM4>,
    motor_3: Qei<'static, TIM8>,
}

impl QuadratureCounters {
    /// Counts from here on, from 0.
    pub(crate) fn new(
        motor_0: Wired<TIM2, PA15, PB3>,
        motor_1: Wired<TIM3, PB4, PB5>,
        motor_2: Wired<TIM4, PD12, PD13>,
        motor_3: Wired<TIM8, PC6, PC7>,
    ) -> Self {
        let config = Config { ch1_pull: Pull::Up, ch2_pull: Pull::Up, ..Config::default() };
        Self {
            motor_0: Qei::new(motor_0.0, motor_0.1, motor_0.2, config),
            motor_1: Qei::new(motor_1.0, motor_1.1, motor_1.2, config),
            motor_2: Qei::new(motor_2.0, motor_2.1, motor_2.2, config),
            motor_3: Qei::new(motor_3.0, motor_3.1, motor_3.2, config),
        }
    }
}

impl Encoders<MOTORS> for QuadratureCounters {
    fn counts(&mut self) -> [Option<u16>; MOTORS] {
        [self.motor_0.count(), self.motor_1.count(), self.motor_2.count(), self.motor_3.count()].map(Some)
    }
}
