//! The status LED of the hub, as three LEDs.

use embassy_stm32::gpio::{Level, Output};
use motor_hub::protocol::Colour;

/// A red, a green and a blue LED, which together are a lamp of eight colours. A pin at high level lights its LED.
pub struct Lamp {
    /// Pin of the red LED.
    pub red: Output<'static>,
    /// Pin of the green LED.
    pub green: Output<'static>,
    /// Pin of the blue LED.
    pub blue: Output<'static>,
}

impl Lamp {
    /// Shows a colour. Each LED is lit if its part of the colour is 64 or more, of 255. Orange is red and green together.
    pub fn show(&mut self, colour: Colour) {
        let level = |share: u8| if share >= 64 { Level::High } else { Level::Low };
        self.red.set_level(level(colour.red));
        self.green.set_level(level(colour.green));
        self.blue.set_level(level(colour.blue));
    }
}
