//! Digital pins that a host may use: inputs with their pull-ups, or push-pull outputs.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Flex, Level, Output, Pin, Pull, Speed};

/// Makes a pin an output that is low from the beginning.
pub fn low(pin: Peri<'static, impl Pin>) -> Output<'static> {
    let pin: Peri<'static, AnyPin> = pin.into();
    Output::new(pin, Level::Low, Speed::Low)
}

/// Makes an array of [`Flex`] of these pins, which have different types.
#[macro_export]
macro_rules! pins {
    ($($pin:expr),+) => { [$(::embassy_stm32::gpio::Flex::new($pin)),+] };
}

/// Makes an array of channels of one converter from these pins, which have different types. The pins become analog inputs.
#[macro_export]
macro_rules! channels {
    ($($pin:expr),+) => { [$(::embassy_stm32::adc::AdcChannel::degrade_adc($pin)),+] };
}

/// The digital pins of a board: the first P pins of the protocol.
pub struct DigitalLines<const P: usize> {
    lines: [Flex<'static>; P],
    /// Bit i is 1 if line i is an output.
    outputs: u8,
    /// Bit i is the level of line i as an output.
    levels: u8,
}

impl<const P: usize> DigitalLines<P> {
    /// Makes all lines inputs.
    pub fn new(mut lines: [Flex<'static>; P]) -> Self {
        for line in &mut lines {
            line.set_low();
            line.set_as_input(Pull::Up);
        }
        Self { lines, outputs: 0, levels: 0 }
    }

    /// Sets directions and levels, and returns the levels of all lines. Bit i stands for line i. A line whose bit in `driven` is 1
    /// is an output with its level in `levels`. Only lines that change are written.
    pub fn update_digital_pins(&mut self, driven: u8, levels: u8) -> u8 {
        let mut sensed = u8::MAX;
        for (line, pin) in self.lines.iter_mut().zip(0..8) {
            let bit = 1 << pin;
            // The level is set before the direction, so an output never has a wrong level.
            if (self.levels ^ levels) & bit != 0 {
                line.set_level(if levels & bit != 0 { Level::High } else { Level::Low });
            }
            match (self.outputs & bit != 0, driven & bit != 0) {
                (false, true) => line.set_as_output(Speed::Low),
                (true, false) => line.set_as_input(Pull::Up),
                _ => (),
            }
            if line.is_low() {
                sensed &= !bit;
            }
        }
        (self.outputs, self.levels) = (driven, levels);
        sensed
    }
}
