//! The DIAG pins of VNH5019A-E bridges: open drains that pull their line low while a bridge has switched itself off.

use embassy_stm32::gpio::Input;
use motor_hub::board::BridgeFaults;

/// A line for each bridge, to which both of its DIAG/EN pins are tied; pulled up, so that one that is not connected
/// is no fault. At most 1 kohm may lie between pin and bridge: behind 10 kohm the pull-up keeps the pin above low.
pub struct DiagLines<const N: usize>(pub [Input<'static>; N]);

impl<const N: usize> BridgeFaults<N> for DiagLines<N> {
    fn faults(&mut self) -> [bool; N] {
        self.0.each_ref().map(Input::is_low)
    }
}
