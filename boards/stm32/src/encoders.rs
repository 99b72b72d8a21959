//! Quadrature encoders with the lines A and B. A timer for each encoder counts all edges of both lines.
//!
//! Resistors outside the chip pull the inputs up to 3.3 V. Open-collector encoders need these resistors. An unplugged
//! encoder counts no noise, because the resistors keep its inputs high. The chip's own pull-ups stay off, because a pin
//! tolerates the 5 V of an encoder only without them (DS9405 table 15, DS12110 and DS12288, I/O static
//! characteristics).
//!
//! The inputs are filtered (RM0090 18.4.7, IC1F and IC2F): a level counts when eight samples in a row agree. A sample is taken
//! every 128 clocks of the timer. Eight samples take 12.8 us on a timer at 80 MHz, 6.1 us at 168 MHz, and 5.1 us at 200 MHz. The
//! ringing of a bridge's edges on a neighbouring wire is shorter. At 10 000 counts/s a level lasts 200 us, 16 times as long as
//! eight samples at 80 MHz. An edge of A and the next edge of B are then 100 us apart, and the filters shorten this time by one
//! sample, 1.6 us, at most. A level must last as long as eight samples to be counted reliably: at 80 MHz this is so up to
//! 156 000 counts/s.

use embassy_stm32::Peri;
use embassy_stm32::gpio::Pull;
use embassy_stm32::pac::timer::vals::Ckd;
use embassy_stm32::timer::input_capture::CapturePin;
use embassy_stm32::timer::low_level::{FilterValue, InputTISelection, SlaveMode, Timer};
use embassy_stm32::timer::{Ch1, Ch2, Channel, GeneralInstance4Channel, TimerPin};
use motor_hub::board::Encoders;

/// A timer that counts edges, and wraps at 16 bits. Timers of 32 bits wrap at 16 bits too.
pub struct Counter<T: GeneralInstance4Channel> {
    timer: Timer<'static, T>,
    _a: CapturePin<'static, T, Ch1>,
    _b: CapturePin<'static, T, Ch2>,
}

impl<T: GeneralInstance4Channel> Counter<T> {
    /// Starts the counter at 0.
    pub fn new(
        timer: Peri<'static, T>,
        a: Peri<'static, impl TimerPin<T, Ch1>>,
        b: Peri<'static, impl TimerPin<T, Ch2>>,
    ) -> Self {
        let (a, b) = (CapturePin::new(a, Pull::None), CapturePin::new(b, Pull::None));
        let timer = Timer::new(timer);
        // The filter takes a sample every 4 * 32 clocks, and needs eight equal samples in a row.
        timer.set_clock_division(Ckd::DIV4);
        for channel in [Channel::Ch1, Channel::Ch2] {
            timer.set_input_ti_selection(channel, InputTISelection::Normal);
            timer.set_input_capture_filter(channel, FilterValue::FDTS_DIV32_N8);
        }
        timer.set_slave_mode(SlaveMode::ENCODER_MODE_3);
        timer.regs_gp16().arr().write(|w| w.set_arr(u16::MAX));
        timer.start();
        Self { timer, _a: a, _b: b }
    }

    fn count(&self) -> u16 {
        self.timer.regs_gp16().cnt().read().cnt()
    }
}

/// One to four counters in the order of the motors. They are a tuple, because each timer has a type of its own.
pub struct QuadratureCounters<Q>(pub Q);

macro_rules! encoders {
    ($n:literal: $($timer:ident $motor:tt),+) => {
        impl<$($timer: GeneralInstance4Channel),+> Encoders<$n> for QuadratureCounters<($(Counter<$timer>,)+)> {
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
