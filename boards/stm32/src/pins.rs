//! Digital pins that a host may use: inputs with their pull-ups, or push-pull outputs.

use embassy_stm32::gpio::{Flex, Level, Pull, Speed};
use motor_hub::board::DigitalPins;

/// The first P of a host's pins; there are no others.
pub struct DigitalLines<const P: usize> {
    lines: [Flex<'static>; P],
    /// Bit i: line i is an output.
    outputs: u8,
}

impl<const P: usize> DigitalLines<P> {
    /// Inputs.
    pub fn new(mut lines: [Flex<'static>; P]) -> Self {
        lines.iter_mut().for_each(|line| line.set_as_input(Pull::Up));
        Self { lines, outputs: 0 }
    }
}

impl<const P: usize> DigitalPins for DigitalLines<P> {
    fn exchange(&mut self, driven: u8, levels: u8) -> u8 {
        let mut sensed = u8::MAX;
        for (line, pin) in self.lines.iter_mut().zip(0..8) {
            let bit = 1 << pin;
            // The level first: it is there from the instant at which the pin is driven.
            line.set_level(if levels & bit != 0 { Level::High } else { Level::Low });
            match (self.outputs & bit != 0, driven & bit != 0) {
                (false, true) => line.set_as_output(Speed::Low),
                (true, false) => line.set_as_input(Pull::Up),
                _ => (),
            }
            if line.is_low() {
                sensed &= !bit;
            }
        }
        self.outputs = driven;
        sensed
    }
}
