//! Connects a regulated motor to the encoder check: keeps the last command, and latches the faults found.

use crate::motion::guard::{Evidence, Finding, Order};
use crate::motion::{EncoderFault, Guard, Reading};
use crate::units::Period;

/// The encoder check of one motor, with its last command and its result.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    guard: Guard,
    /// Command of the last tick; `None` if the motor was not regulated or coasted.
    last_command: Option<Order>,
    /// True if the motor was stalled at the last checked tick.
    stalled: bool,
    /// Fault of the encoder, latched; `None` if there is none.
    fault: Option<EncoderFault>,
}

impl Watch {
    /// Creates the check of a motor that is stepped every `period`.
    pub(super) fn new(period: Period) -> Self {
        Self { guard: Guard::new(period), last_command: None, stalled: false, fault: None }
    }

    /// Command of the last tick; `None` if the motor was not regulated or coasted.
    pub(super) const fn ordered(&self) -> Option<Order> {
        self.last_command
    }

    /// Takes a sample of the encoder. `load` computes the estimated disturbance, in counts/s².
    pub(super) fn sample(&mut self, reading: &Reading, load: impl FnOnce() -> f32) {
        self.guard.sample(reading, load);
    }

    /// Takes the evidence since the last tick's command, and decides about the encoder. A fault is latched.
    pub(super) fn step(&mut self, evidence: &Evidence) -> Finding {
        let finding = self.guard.step(evidence);
        self.stalled = finding == Finding::Stalled;
        if let Finding::Fault(fault) = finding {
            self.fault = Some(fault);
        }
        finding
    }

    /// Keeps this tick's command for the check at the next tick.
    pub(super) const fn note(&mut self, order: Order) {
        self.last_command = Some(order);
    }

    /// Notes a tick without a command. Ends a release or a probe; a stalled motor stays stalled.
    pub(super) fn interrupt(&mut self) {
        self.guard.retarget();
        self.last_command = None;
    }

    /// Resets the check until the next command. The motor is no longer stalled; a fault stays latched.
    pub(super) fn pause(&mut self) {
        self.guard.reset();
        self.last_command = None;
        self.stalled = false;
    }

    /// Notes a new set-point. Returns true if the motor is stalled, or was released or probed until now.
    pub(super) fn retarget(&mut self) -> bool {
        self.guard.retarget() || self.stalled
    }

    /// Clears the latched fault.
    pub(super) const fn clear(&mut self) {
        self.fault = None;
    }

    /// The latched fault; `None` if there is none.
    pub(super) const fn fault(&self) -> Option<EncoderFault> {
        self.fault
    }

    /// True if the motor is stalled.
    pub(super) const fn stalled(&self) -> bool {
        self.stalled
    }
}
