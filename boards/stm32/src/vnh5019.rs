//! ST VNH5019A-E bridges. Each bridge has a PWM line from one advanced timer, and two direction lines, INA and INB.
//!
//! # What the bridge does
//!
//! This is the truth table of the data sheet (VNH5019A-E, Doc ID 15701) for normal operating conditions. Both DIAG/EN
//! pins are pulled high, and PWM is high.
//!
//! | INA | INB | OUTA | OUTB | operating mode |
//! |---|---|---|---|---|
//! | 1 | 1 | H | H | brake to VCC |
//! | 1 | 0 | H | L | clockwise |
//! | 0 | 1 | L | H | counter-clockwise |
//! | 0 | 0 | L | L | brake to GND |
//!
//! "In all cases" a low PWM pin turns off both low-side switches. Half-bridge A is the left leg of
//! `motor_hub::bridge`. So INA/INB with PWM high or low give the following states and modes of that module. Mode 9/8 drives
//! clockwise, 6/2 drives counter-clockwise, and 5/0 brakes.
//!
//! | INA/INB | PWM high | PWM low | mode |
//! |---|---|---|---|
//! | 1/0 | 9 | 8 | 9/8 |
//! | 0/1 | 6 | 2 | 6/2 |
//! | 0/0 | 5 | 0 | 5/0 |
//! | 1/1 | 10 | 10 | never |
//!
//! The DIAG/EN pins must be pulled up; most carriers do. A bridge that has shut itself down pulls them low, and stays off until
//! its lines change. [`bridge_faults`](crate::bridge_faults) reads them.
//!
//! # From one bridge command to another
//!
//! A new duty in the same mode goes through the compare register's preload, and takes effect at the end of the PWM
//! period, without a glitch. A change of the mode must not wait for the end of the period, because the old duty would
//! then act in the new direction. A change of the mode has these steps:
//!
//! 1. The PWM output is forced low, independently of counter and compare (OCxM = "force inactive level", RM0090
//!    17.3.8). The old mode at low is state 8, 2 or 0. The preload is switched off by a read and a write. The read
//!    cannot finish before the write of OCxM has reached the timer. So the next step, which uses another bus, cannot
//!    overtake the write.
//! 2. INA and INB become low: state 0, coasting. No mode has both lines high, so at most one line falls.
//! 3. INA or INB becomes high as the new mode requires: state 8, 2 or 0. At most one line rises, so both lines are
//!    never high together.
//! 4. The new duty is written to the compare register without preload.
//! 5. The output is set to "frozen" (still low), then to PWM mode 1 with preload. Now the new mode runs at the new duty.
//!    "Frozen" is needed for a duty of 1, where the comparison never changes. RM0090 17.4.7 promises that
//!    the output then follows the comparison only after "frozen".
//!
//! So the bridge gets only states that may be commanded. If a step took effect one step too late, the bridge would get state 5
//! instead of 0, or the old mode for longer. These states may be commanded too. Changes of four bridges take a few microseconds.

use core::marker::PhantomData;
use embassy_stm32::Peri;
use embassy_stm32::gpio::{Output, OutputType, Pull, Speed};
use embassy_stm32::pac::timer::vals::Ossi;
use embassy_stm32::timer::low_level::{CountingMode, OutputCompareMode, Timer};
use embassy_stm32::timer::simple_pwm::{PwmPin, PwmPinConfig};
use embassy_stm32::timer::{AdvancedInstance4Channel, Channel, TimerChannel, TimerPin};
use motor_hub::board::Bridges;
use motor_hub::bridge::{BridgeConstants, Drive, Mode};

/// Highest PWM frequency that the VNH5019A-E is specified for.
pub const PWM_HZ: u32 = BridgeConstants::IDEAL.pwm_hz();

/// The timer that makes the PWM of all bridges, running.
pub struct Pwm<T: AdvancedInstance4Channel> {
    timer: Timer<'static, T>,
    period_ticks: u16,
}

impl<T: AdvancedInstance4Channel> Pwm<T> {
    /// Starts the timer, which drives no pin yet.
    pub fn new(timer: Peri<'static, T>) -> Self {
        let timer = Timer::new(timer);
        timer.set_counting_mode(CountingMode::EdgeAlignedUp);
        // A period has 8400 ticks at 168 MHz and 10 000 ticks at 200 MHz, so a duty has a resolution of 13 bits. At 80 MHz
        // it has 4000 ticks, which are 12 bits.
        let period_ticks = u16::try_from(timer.get_clock_frequency().0 / PWM_HZ).unwrap_or(u16::MAX);
        timer.set_max_compare_value((period_ticks - 1).into());
        timer.set_autoreload_preload(true);
        // While MOE is off, as after a fault, the timer still drives its pins to their idle level, which is low.
        timer.set_ossi(Ossi::IDLE_LEVEL);
        timer.set_moe(true);
        timer.start();
        Self { timer, period_ticks }
    }

    /// Creates a bridge that is open. `ina` and `inb` must be low. The PWM pin is low when this function returns.
    pub fn bridge<C: TimerChannel>(
        &self,
        pwm: Peri<'static, impl TimerPin<T, C>>,
        ina: Output<'static>,
        inb: Output<'static>,
    ) -> Bridge<T> {
        let channel = C::CHANNEL;
        // The output is low: the compare register is 0 after a reset.
        self.timer.set_output_compare_preload(channel, true);
        self.timer.set_output_compare_mode(channel, OutputCompareMode::PwmMode1);
        self.timer.enable_channel(channel, true);
        let config = PwmPinConfig { output_type: OutputType::PushPull, speed: Speed::Low, pull: Pull::Down };
        // The pin is never dropped, because a dropped pin becomes an analogue input.
        core::mem::forget(PwmPin::<T, C>::new_with_config(pwm, config));
        Bridge { channel, ina, inb, mode: Drive::COAST.mode, _timer: PhantomData }
    }
}

/// One bridge on a channel of timer `T`, and the mode that it is in.
pub struct Bridge<T> {
    channel: Channel,
    ina: Output<'static>,
    inb: Output<'static>,
    mode: Mode,
    _timer: PhantomData<T>,
}

impl<T: AdvancedInstance4Channel> Bridge<T> {
    fn apply(&mut self, pwm: &Pwm<T>, drive: Drive) {
        let (timer, channel) = (&pwm.timer, self.channel);
        let compare = drive.duty.of_period(pwm.period_ticks).into();
        if drive.mode == self.mode {
            timer.set_compare_value(channel, compare);
            return;
        }
        timer.set_output_compare_mode(channel, OutputCompareMode::ForceInactive);
        timer.set_output_compare_preload(channel, false);
        self.ina.set_low();
        self.inb.set_low();
        match drive.mode {
            Mode::Cw98 => self.ina.set_high(),
            Mode::Ccw62 => self.inb.set_high(),
            Mode::Brake50 => {}
        }
        timer.set_compare_value(channel, compare);
        timer.set_output_compare_preload(channel, true);
        timer.set_output_compare_mode(channel, OutputCompareMode::Frozen);
        timer.set_output_compare_mode(channel, OutputCompareMode::PwmMode1);
        self.mode = drive.mode;
    }
}

/// N bridges, by motor.
pub struct Vnh5019<T: AdvancedInstance4Channel, const N: usize> {
    pwm: Pwm<T>,
    bridges: [Bridge<T>; N],
}

impl<T: AdvancedInstance4Channel, const N: usize> Vnh5019<T, N> {
    /// Combines the bridges of all motors.
    pub fn new(pwm: Pwm<T>, bridges: [Bridge<T>; N]) -> Self {
        Self { pwm, bridges }
    }
}

impl<T: AdvancedInstance4Channel, const N: usize> Bridges<N> for Vnh5019<T, N> {
    fn apply(&mut self, drives: &[Drive; N]) {
        for (bridge, drive) in self.bridges.iter_mut().zip(drives) {
            bridge.apply(&self.pwm, *drive);
        }
    }
}
