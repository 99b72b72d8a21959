//! A watch on the encoder of a regulated motor: what was ordered at the last tick, what came of it, and
//! what the guard makes of that.

use crate::braking::Regime;
use crate::motion::guard::{Evidence, Finding};
use crate::motion::{EncoderFault, Guard};
use crate::units::{Control, CountsPerSecond, Period};

/// What the bridge was told, and for what speed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Order {
    pub(super) target: CountsPerSecond,
    pub(super) control: Control,
    pub(super) regime: Regime,
}

#[derive(Clone, Debug)]
pub(super) struct Watch {
    period: Period,
    guard: Guard,
    /// At the last tick; `None` if the motor was not regulated or coasted.
    ordered: Option<Order>,
    /// Latched.
    fault: Option<EncoderFault>,
    stalled: bool,
}

impl Watch {
    pub(super) fn new(period: Period) -> Self {
        Self { period, guard: Guard::default(), ordered: None, fault: None, stalled: false }
    }

    /// What the encoder's answer to the last tick's order says of the encoder. `gentle` is whether the
    /// end of the control range may be less than full reverse.
    pub(super) fn step(&mut self, moved: i32, velocity: CountsPerSecond, gentle: bool) -> Finding {
        let Some(Order { target, control, regime }) = self.ordered else { return Finding::Sound };
        if self.guard.trusts(control, regime, moved) {
            return Finding::Sound;
        }
        let finding =
            self.guard.examine(self.period, Evidence { control, regime, target, moved, velocity, gentle });
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
        *self = Self { fault: self.fault, ..Self::new(self.period) };
    }

    /// Ends a latched fault.
    pub(super) const fn clear(&mut self) {
        self.fault = None;
    }

    /// The control value at the last tick.
    pub(super) const fn last_control(&self) -> Control {
        match self.ordered {
            Some(order) => order.control,
            None => Control::ZERO,
        }
    }

    pub(super) const fn fault(&self) -> Option<EncoderFault> {
        self.fault
    }

    pub(super) const fn stalled(&self) -> bool {
        self.stalled
    }
}
