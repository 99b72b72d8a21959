//! The status LED of the hub, as three LEDs.

use embassy_stm32::gpio::{Level, Output};
use motor_hub::protocol::Colour;

/// A red, a green and a blue LED: together one lamp of eight colours.
pub struct Lamp {
    /// High lights it, as the others.
    pub red: Output<'static>,
    /// Green.
    pub green: Output<'static>,
    /// Blue.
    pub blue: Output<'static>,
}

impl Lamp {
    /// Each of the three is lit if its share of the colour is a quarter or more: orange is red and green.
    pub fn show(&mut self, colour: Colour) {
        let level = |share: u8| if share >= 64 { Level::High } else { Level::Low };
        self.red.set_level(level(colour.red));
        self.green.set_level(level(colour.green));
        self.blue.set_level(level(colour.blue));
    }
}
