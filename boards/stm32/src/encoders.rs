//! Quadrature encoders, each on a timer that counts all four edges of A and B.
//!
//! Inputs are pulled up: open-collector encoders need it, and an unplugged one then stands still
//! instead of counting noise.

use embassy_stm32::Peri;
use embassy_stm32::gpio::Pull;
use embassy_stm32::timer::qei::{Config, Qei};
use embassy_stm32::timer::{Ch1, Ch2, GeneralInstance4Channel, TimerPin};
use motor_hub::board::Encoders;

/// Counts from here on, from 0.
pub fn counter<T: GeneralInstance4Channel>(
    timer: Peri<'static, T>,
    a: Peri<'static, impl TimerPin<T, Ch1>>,
    b: Peri<'static, impl TimerPin<T, Ch2>>,
) -> Qei<'static, T> {
    Qei::new(timer, a, b, Config { ch1_pull: Pull::Up, ch2_pull: Pull::Up, ..Config::default() })
}

/// One to four counters by motor, as a tuple: each timer is a type of its own.
pub struct QuadratureCounters<Q>(pub Q);

macro_rules! encoders {
    ($n:literal: $($timer:ident $motor:tt),+) => {
        impl<$($timer: GeneralInstance4Channel),+> Encoders<$n>
            for QuadratureCounters<($(Qei<'static, $timer>,)+)>
        {
            fn counts(&mut self) -> [Option<u16>; $n] {
                [$(Some(self.0.$motor.count())),+]
            }
        }
    };
}

encoders!(1: A 0);
encoders!(2: A 0, B 1);
encoders!(3: A 0, B 1, C 2);
encoders!(4: A 0, B 1, C 2, D 3);
