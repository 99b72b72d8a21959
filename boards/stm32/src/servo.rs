//! Servo outputs, each a channel of a timer of its own, so each has its own period. The timers count microseconds.
//!
//! Period and width go through the preloads of auto-reload and compare register (RM0090 19.3, RM0433 40.3 and 41.3). Both take
//! effect together when a period ends, so no pulse is cut short and none has a mixture of old and new values. The timer alone
//! makes the edges of a pulse, so they do not depend on the load of the core.
//!
//! The chip's own oscillator keeps the time. A pulse is wrong by the oscillator's error, 1 % at most at room temperature: 15 us
//! of 1500 us.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{OutputType, Pull, Speed};
use embassy_stm32::pac::timer::TimGp16;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::{OutputCompareMode, Timer};
use embassy_stm32::timer::simple_pwm::{PwmPin, PwmPinConfig};
use embassy_stm32::timer::{GeneralInstance4Channel, TimerChannel, TimerPin};
use motor_hub::board::ServoPulse;

/// Counting frequency of the timers: one count per microsecond.
const TICK: Hertz = Hertz(1_000_000);

/// Period of the timer while there are no pulses, in microseconds. New values take effect at its end. It is a servo's usual period.
const IDLE_PERIOD_US: u16 = 20_000;

/// One servo output.
pub struct Servo {
    registers: TimGp16,
    channel: usize,
    pulse: Option<ServoPulse>,
}

impl Servo {
    /// Creates an output without pulses, whose pin is driven low.
    pub fn new<T: GeneralInstance4Channel, C: TimerChannel>(
        timer: Peri<'static, T>,
        pin: Peri<'static, impl TimerPin<T, C>>,
    ) -> Self {
        let mut timer = Timer::new(timer);
        let registers = timer.regs_gp16();
        timer.set_autoreload_preload(true);
        timer.set_output_compare_preload(C::CHANNEL, true);
        timer.set_output_compare_mode(C::CHANNEL, OutputCompareMode::PwmMode1);
        registers.arr().write(|w| w.set_arr(IDLE_PERIOD_US - 1));
        // This call makes an update event, which also puts the new period into use.
        timer.set_tick_freq(TICK);
        timer.enable_channel(C::CHANNEL, true);
        timer.enable_outputs();
        timer.start();
        let config = PwmPinConfig { output_type: OutputType::PushPull, speed: Speed::Low, pull: Pull::None };
        // Pin and timer are never dropped. A dropped pin becomes an analogue input, and a dropped timer loses its clock.
        core::mem::forget(PwmPin::<T, C>::new_with_config(pin, config));
        core::mem::forget(timer);
        Self { registers, channel: C::CHANNEL.index(), pulse: None }
    }

    /// Sets the pulses from the next period on. `None` stands for no pulses.
    pub fn set(&mut self, pulse: Option<ServoPulse>) {
        if pulse == self.pulse {
            return;
        }
        self.pulse = pulse;
        // A pulse ends at the latest before the next one begins.
        let (last, width) = pulse.map_or((IDLE_PERIOD_US - 1, 0), |ServoPulse { period_us, width_us }| {
            let last = period_us.saturating_sub(1).max(1);
            (last, width_us.min(last))
        });
        // If a period ends during these writes, the old values are used for one more period.
        self.registers.cr1().modify(|w| w.set_udis(true));
        self.registers.arr().write(|w| w.set_arr(last));
        self.registers.ccr(self.channel).write(|w| w.set_ccr(width));
        self.registers.cr1().modify(|w| w.set_udis(false));
    }
}
