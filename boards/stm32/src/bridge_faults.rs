//! The DIAG pins of VNH5019A-E bridges: a bridge that has switched itself off pulls its line low (open drain).

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Input, Pin, Pull};
use motor_hub::board::BridgeFaults;

/// A line for each bridge, tied to both of its DIAG/EN pins. The chip pulls each line up, so a line without a bridge shows no
/// fault. At most 1 kohm may lie between pin and bridge: behind 10 kohm the pull-up keeps the pin above low.
pub struct DiagLines<const N: usize>(pub [Input<'static>; N]);

/// The line of a bridge.
pub fn line(pin: Peri<'static, impl Pin>) -> Input<'static> {
    let pin: Peri<'static, AnyPin> = pin.into();
    Input::new(pin, Pull::Up)
}

impl<const N: usize> BridgeFaults<N> for DiagLines<N> {
    fn faults(&mut self) -> [bool; N] {
        self.0.each_ref().map(Input::is_low)
    }
}
