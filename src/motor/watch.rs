//! A watch on the encoder of a regulated motor: what was ordered at the last tick, what came of it, and
//! what the guard makes of that.

use crate::motion::guard::{Evidence, Finding, Order};
use crate::motion::{EncoderFault, Guard, Reading};
use crate::units::Period;

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
    pub(super) fn new(period: Period) -> Self {
        Self { guard: Guard::new(period), ordered: None, stalled: false, fault: None }
    }

    /// Of the last tick, if there was one to be judged by.
    pub(super) const fn ordered(&self) -> Option<Order> {
        self.ordered
    }

    /// Takes a sample of the encoder, and the load that is thought of then, in counts/s².
    pub(super) fn sample(&mut self, reading: &Reading, load: impl FnOnce() -> f32) {
        self.guard.sample(reading, load);
    }

    /// What the encoder's answer to the last tick's order says of the encoder.
    pub(super) fn step(&mut self, evidence: &Evidence) -> Finding {
        let finding = self.guard.step(evidence);
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

    /// Nothing was ordered for this tick. A motor that is held stays so.
    pub(super) fn interrupt(&mut self) {
        self.guard.retarget();
        self.ordered = None;
    }

    /// Nothing is expected of the encoder until the next order.
    pub(super) fn pause(&mut self) {
        self.guard.reset();
        self.ordered = None;
        self.stalled = false;
    }

    /// Another thing is asked of the motor; returns whether it is held, as far as is known.
    pub(super) fn retarget(&mut self) -> bool {
        self.guard.retarget() || self.stalled
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
