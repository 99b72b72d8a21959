//! Four ST VNH5019A-E bridges: a PWM line each from TIM1 and two direction lines each on port D.
//!
//! # What the bridge does
//!
//! VNH5019A-E data sheet (Doc ID 15701), truth table in normal operating conditions, with both
//! DIAG/EN pins pulled high, PWM high:
//!
//! | INA | INB | OUTA | OUTB | operating mode |
//! |---|---|---|---|---|
//! | 1 | 1 | H | H | brake to VCC |
//! | 1 | 0 | H | L | clockwise |
//! | 0 | 1 | L | H | counter-clockwise |
//! | 0 | 0 | L | L | brake to GND |
//!
//! "In all cases" a low PWM pin turns off both low-side switches. Half-bridge A is the paper's left
//! leg, so INA/INB with PWM high/low are these states, and the modes of `motor_hub::bridge`:
//!
//! | INA/INB | PWM high | PWM low | mode |
//! |---|---|---|---|
//! | 1/0 | 9 | 8 | 9/8 |
//! | 0/1 | 6 | 2 | 6/2 |
//! | 0/0 | 5 | 0 | 5/0 |
//! | 1/1 | 10 | 10 | never |
//!
//! The DIAG/EN pins are not connected to the microcontroller here: they must be pulled up (most
//! carriers do), and a bridge that has shut itself down stays off until its lines change.
//!
//! # From one drive to another
//!
//! A new duty in the same mode goes through the compare register's preload and takes effect at the
//! end of the 50 us PWM period, without a glitch. A change of mode cannot wait for that, or the old
//! duty would run on in the new direction. It goes so:
//!
//! 1. The PWM output is forced low (OCxM = "force inactive level", RM0090 17.3.8: at once, whatever
//!    counter and compare say). Old mode, low: state 8, 2 or 0. The read that switches the preload off
//!    cannot finish before that write has reached the timer, so the next step, on another bus, cannot
//!    overtake it.
//! 2. INA/INB to 0/0 in one write: state 0, coasting.
//! 3. INA/INB to the new mode in one write: state 8, 2 or 0. At most one line rises, so no skew
//!    between two lines can show 1/1.
//! 4. The new duty straight into the compare register.
//! 5. "Frozen" (still low), then PWM mode 1 with preload: from here on the new mode at the new duty.
//!    The detour is for a duty of 1, where the comparison never changes: RM0090 17.4.7 promises that
//!    the output follows it then only on coming from "frozen".
//!
//! So the bridge sees nothing but commanded states on the way; were a step's effect late at the bridge
//! by a whole step, it would see 5 for 0 or the old mode a moment longer, which may be commanded too.
//! Four bridges take a few microseconds.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Output, OutputType, Pull, Speed};
use embassy_stm32::pac;
use embassy_stm32::peripherals::{PE9, PE11, PE13, PE14, TIM1};
use embassy_stm32::timer::low_level::{CountingMode, OutputCompareMode, Timer};
use embassy_stm32::timer::simple_pwm::{PwmPin, PwmPinConfig};
use embassy_stm32::timer::{Ch1, Ch2, Ch3, Ch4, Channel};
use motor_hub::board::Bridges;
use motor_hub::bridge::{Drive, Mode};

use crate::MOTORS;

/// The highest that the VNH5019A-E is specified for.
const PWM_HZ: u32 = 20_000;

/// By motor; the direction lines of motor m are PD(2m), INA, and PD(2m + 1), INB.
const CHANNELS: [Channel; MOTORS] = [Channel::Ch1, Channel::Ch2, Channel::Ch3, Channel::Ch4];

/// Four bridges and the mode that each is in.
pub(crate) struct Vnh5019 {
    timer: Timer<'static, TIM1>,
    period_ticks: u16,
    modes: [Mode; MOTORS],
    _pins: Pins,
}

/// Held for as long as the bridges: a pin falls back to an analogue input when it is dropped.
type Pins = (
    PwmPin<'static, TIM1, Ch1>,
    PwmPin<'static, TIM1, Ch2>,
    PwmPin<'static, TIM1, Ch3>,
    PwmPin<'static, TIM1, Ch4>,
    Lines,
);

/// PD0 to PD7.
type Lines = [Output<'static>; 2 * MOTORS];

impl Vnh5019 {
    /// All bridges open: `lines` are PD0 to PD7, low; the PWM pins are driven low before this returns.
    pub(crate) fn new(
        timer: Peri<'static, TIM1>,
        (pe9, pe11, pe13, pe14): (
            Peri<'static, PE9>,
            Peri<'static, PE11>,
            Peri<'static, PE13>,
            Peri<'static, PE14>,
        ),
        lines: Lines,
    ) -> Self {
        let timer = Timer::new(timer);
        timer.set_counting_mode(CountingMode::EdgeAlignedUp);
        // 168 MHz / 20 kHz = 8400 ticks: 13 bits of duty.
        let period_ticks = u16::try_from(timer.get_clock_frequency().0 / PWM_HZ).unwrap_or(u16::MAX);
        timer.set_max_compare_value(period_ticks - 1);
        timer.set_autoreload_preload(true);
        for channel in CHANNELS {
            // Low until told otherwise: the compare register is 0 out of reset.
            timer.set_output_compare_preload(channel, true);
            timer.set_output_compare_mode(channel, OutputCompareMode::PwmMode1);
            timer.enable_channel(channel, true);
        }
        // With MOE off, as after `open_all`, the timer goes on driving its pins: to their idle level, low.
        timer.set_ossi(pac::timer::vals::Ossi::IDLE_LEVEL);
        timer.set_moe(true);
        timer.start();
        let config = PwmPinConfig { output_type: OutputType::PushPull, speed: Speed::Low, pull: Pull::Down };
        let pins = (
            PwmPin::new_with_config(pe9, config),
            PwmPin::new_with_config(pe11, config),
            PwmPin::new_with_config(pe13, config),
            PwmPin::new_with_config(pe14, config),
            lines,
        );
        Self { timer, period_ticks, modes: [Drive::COAST.mode; MOTORS], _pins: pins }
    }
}

impl Bridges<MOTORS> for Vnh5019 {
    fn apply(&mut self, drives: &[Drive; MOTORS]) {
        let timer = &self.timer;
        for (motor, ((drive, mode), channel)) in drives.iter().zip(&mut self.modes).zip(CHANNELS).enumerate()
        {
            let compare = drive.duty.of_period(self.period_ticks);
            if drive.mode == *mode {
                timer.set_compare_value(channel, compare);
                continue;
            }
            timer.set_output_compare_mode(channel, OutputCompareMode::ForceInactive);
            timer.set_output_compare_preload(channel, false);
            set_lines(motor, Mode::Brake50);
            set_lines(motor, drive.mode);
            timer.set_compare_value(channel, compare);
            timer.set_output_compare_preload(channel, true);
            timer.set_output_compare_mode(channel, OutputCompareMode::Frozen);
            timer.set_output_compare_mode(channel, OutputCompareMode::PwmMode1);
            *mode = drive.mode;
        }
    }
}

/// Both direction lines of a motor in one write.
fn set_lines(motor: usize, mode: Mode) {
    let (ina, inb) = match mode {
        Mode::Cw98 => (true, false),
        Mode::Ccw62 => (false, true),
        Mode::Brake50 => (false, false),
    };
    pac::GPIOD.bsrr().write(|w| {
        for (pin, high) in [(2 * motor, ina), (2 * motor + 1, inb)] {
            w.set_bs(pin, high);
            w.set_br(pin, !high);
        }
    });
}

/// Opens all bridges for good, from any context: PWM low first, then all direction lines.
///
/// PWM stays off until a reset, whatever is applied afterwards.
pub(crate) fn open_all() {
    pac::TIM1.bdtr().modify(|w| w.set_moe(false));
    pac::GPIOD.bsrr().write(|w| (0..2 * MOTORS).for_each(|pin| w.set_br(pin, true)));
}
