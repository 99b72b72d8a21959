//! The DIAG pins of VNH5019A-E bridges: a bridge that has switched itself off pulls its line low (open drain).

use crate::Calibrate;
use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Input, Pin, Pull};
use motor_hub::board::BridgeSensors;
use motor_hub::bridge::BridgeFeedback;

/// A line for each bridge, connected to both of its DIAG/EN pins. The chip pulls each line up, so a line without a bridge shows no
/// fault. The resistor between the chip's pin and the bridge must have at most 1 kohm. With 10 kohm and the strongest pull-up,
/// 30 kohm, the pin would not read as low.
pub struct DiagLines<const N: usize>(pub [Input<'static>; N]);

/// Makes a pin the input for the line of a bridge, with the chip's pull-up.
pub fn line(pin: Peri<'static, impl Pin>) -> Input<'static> {
    let pin: Peri<'static, AnyPin> = pin.into();
    Input::new(pin, Pull::Up)
}

impl<const N: usize> DiagLines<N> {
    /// Returns true if the bridge with this index reports a fault now.
    pub(crate) fn has_fault(&self, bridge: usize) -> bool {
        self.0.get(bridge).is_some_and(Input::is_low)
    }
}

impl<const N: usize> Calibrate for DiagLines<N> {}

/// A board without current-sense lines.
impl<const N: usize> BridgeSensors<N> for DiagLines<N> {
    async fn sample(&mut self) -> [BridgeFeedback; N] {
        core::array::from_fn(|bridge| BridgeFeedback { current: None, fault: self.has_fault(bridge) })
    }
}
