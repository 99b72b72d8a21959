//! Digital pins that a host may use: inputs with their pull-ups, or push-pull outputs.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Flex, Level, Output, Pin, Pull, Speed};
use motor_hub::board::{AnalogReadings, Devices, Equipment, SERVOS, ServoPulse};

/// An output, low from the first instant.
pub fn low(pin: Peri<'static, impl Pin>) -> Output<'static> {
    let pin: Peri<'static, AnyPin> = pin.into();
    Output::new(pin, Level::Low, Speed::Low)
}

/// The first P digital pins of the protocol. This board has no others.
pub struct DigitalLines<const P: usize> {
    lines: [Flex<'static>; P],
    /// Bit i: line i is an output.
    outputs: u8,
}

impl<const P: usize> DigitalLines<P> {
    /// All lines are inputs.
    pub fn new(mut lines: [Flex<'static>; P]) -> Self {
        lines.iter_mut().for_each(|line| line.set_as_input(Pull::Up));
        Self { lines, outputs: 0 }
    }
}

impl<const P: usize> Devices for DigitalLines<P> {
    fn equipment(&self) -> Equipment {
        let digital = 1u8.checked_shl(P as u32).map_or(u8::MAX, |above| above - 1);
        Equipment { digital, ..Equipment::default() }
    }

    fn set_servos(&mut self, _: &[Option<ServoPulse>; SERVOS]) {}

    fn analog(&mut self) -> AnalogReadings {
        AnalogReadings::default()
    }

    fn exchange(&mut self, driven: u8, levels: u8) -> u8 {
        let mut sensed = u8::MAX;
        for (line, pin) in self.lines.iter_mut().zip(0..8) {
            let bit = 1 << pin;
            // The level comes before the direction: an output has its level from the first instant.
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
