//! What a board has for hosts besides its motors: digital pins, servo outputs and analog inputs.

use crate::pins::DigitalLines;
use crate::servo::Servo;
use motor_hub::board::{ANALOG_INPUTS, AnalogReadings, Devices, Equipment, SERVOS, ServoPulse};

/// P digital pins and S servo outputs, with the converter of the analog inputs, the 5 V rail and the chip's temperature.
pub struct Connectors<const P: usize, const S: usize> {
    /// Digital pins.
    pub digital: DigitalLines<P>,
    /// Servo outputs.
    pub servos: [Servo; S],
    /// Function that returns the newest readings of the converter; `None` on a board that has no converter for them.
    pub analog: Option<fn() -> AnalogReadings>,
    /// Number of I2C buses.
    pub i2c: u8,
}

impl<const P: usize, const S: usize> Devices for Connectors<P, S> {
    fn equipment(&self) -> Equipment {
        let measures = self.analog.is_some();
        Equipment {
            digital: (0..8).zip(0..P).fold(0, |pins, (pin, _)| pins | 1 << pin),
            servos: S.min(SERVOS) as u8,
            analog: if measures { ANALOG_INPUTS as u8 } else { 0 },
            i2c: self.i2c,
            rail: measures,
            temperature: measures,
        }
    }

    fn update_digital_pins(&mut self, driven: u8, levels: u8) -> u8 {
        self.digital.update_digital_pins(driven, levels)
    }

    fn set_servos(&mut self, pulses: &[Option<ServoPulse>; SERVOS]) {
        for (servo, pulse) in self.servos.iter_mut().zip(pulses) {
            servo.set(*pulse);
        }
    }

    fn analog(&mut self) -> AnalogReadings {
        self.analog.map_or_else(AnalogReadings::default, |read| read())
    }
}
