//! A watch on the encoder of a regulated motor: what was ordered at the last tick, what came of it, and
//! what the guard makes of that.

use crate::braking::Regime;
use crate::motion::guard::{Evidence, Finding};
use crate::motion::{EncoderFault, Guard};
use crate::units::{AccelerationPerVolt, Control, CountsPerSecond, Period};

/// What the bridge was told, and for what speed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Order {
    pub(super) target: CountsPerSecond,
    pub(super) control: Control,
    pub(super) regime: Regime,
}

/// The watch on one motor.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    guard: Guard,
    /// At the last tick; `None` if the motor was not regulated or coasted.
    ordered: Option<Order>,
    stalled: bool,
    /// Latched.
    fault: Option<EncoderFault>,
}

impl Watch {
    /// `gain` is how fast the motor accelerates, if that is known.
    pub(super) fn new(period: Period, gain: Option<AccelerationPerVolt>) -> Self {
        let mut guard = Guard::new(period);
        guard.expect(gain);
        Self { guard, ordered: None, stalled: false, fault: None }
    }

    /// What the encoder's answer to the last tick's order says of the encoder. `gentle` is whether the
    /// end of the control range may be less than full reverse.
    pub(super) fn step(&mut self, moved: i32, velocity: CountsPerSecond, gentle: bool) -> Finding {
        let Some(Order { target, control, regime }) = self.ordered else { return Finding::Sound };
        let finding = self.guard.step(Evidence { control, regime, target, moved, velocity, gentle });
        self.stalled = finding == Finding::Stalled;
        if let Finding::Fault(fault) = finding {
            self.fault = Some(fault);
        }
        finding
    }

    /// Notes this tick's order, for the next one.
    pub(super) const fn note(&mut self, order: Order) {
        self.ordered = Some(order);
    }

    /// Nothing is expected of the encoder until the next order.
    pub(super) fn pause(&mut self) {
        self.guard.reset();
        self.ordered = None;
        self.stalled = false;
    }

    /// So fast the motor accelerates, if that is known.
    pub(super) fn expect(&mut self, gain: Option<AccelerationPerVolt>) {
        self.guard.expect(gain);
    }

    /// Ends a latched fault.
    pub(super) const fn clear(&mut self) {
        self.fault = None;
    }

    pub(super) const fn fault(&self) -> Option<EncoderFault> {
        self.fault
    }

    pub(super) const fn stalled(&self) -> bool {
        self.stalled
    }
}
