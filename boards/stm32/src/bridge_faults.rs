//! The DIAG pins of VNH5019A-E bridges: a bridge that has switched itself off pulls its line low (open drain).

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Input, Pin, Pull};
use motor_hub::board::BridgeFaults;

/// A line for each bridge, connected to both of its DIAG/EN pins. The chip pulls each line up, so a line without a bridge shows no
/// fault. The resistor between the chip's pin and the bridge must have at most 1 kohm. With 10 kohm and the strongest pull-up,
/// 30 kohm, the pin would not read as low.
pub struct DiagLines<const N: usize>(pub [Input<'static>; N]);

/// Makes a pin the input for the line of a bridge, with the chip's pull-up.
pub fn line(pin: Peri<'static, impl Pin>) -> Input<'static> {
    let pin: Peri<'static, AnyPin> = pin.into();
    Input::new(pin, Pull::Up)
}

impl<const N: usize> BridgeFaults<N> for DiagLines<N> {
    fn faults(&mut self) -> [bool; N] {
        self.0.each_ref().map(Input::is_low)
    }
}
