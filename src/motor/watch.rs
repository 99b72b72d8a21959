//! A watch on the encoder of a regulated motor: what was ordered at the last tick, what came of it, and
//! what the guard makes of that.

use crate::braking::Regime;
use crate::motion::guard::{Evidence, Finding};
use crate::motion::{EncoderFault, Guard};
use crate::units::{Control, CountsPerSecond, Period, Voltage};

/// What the bridge was told, and for what speed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Order {
    pub(super) target: CountsPerSecond,
    pub(super) control: Control,
    pub(super) regime: Regime,
    /// Across the motor.
    pub(super) push: Voltage,
    /// At that time.
    pub(super) velocity: CountsPerSecond,
}

/// What is judged by besides.
#[derive(Clone, Copy, Debug)]
pub(super) struct Circumstances {
    /// Counts since the last tick.
    pub(super) moved: i32,
    pub(super) velocity: CountsPerSecond,
    /// Volts.
    pub(super) battery: f32,
    /// What a volt accelerates the motor by at least, in counts/s², if that is known.
    pub(super) gain: Option<f32>,
    /// The end of the control range may be less than full reverse.
    pub(super) gentle: bool,
    /// The motor may be driven the other way to find out.
    pub(super) probing: bool,
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
    pub(super) fn new(period: Period) -> Self {
        Self { guard: Guard::new(period), ordered: None, stalled: false, fault: None }
    }

    /// What the encoder's answer to the last tick's order says of the encoder.
    pub(super) fn step(&mut self, circumstances: Circumstances) -> Finding {
        let Some(Order { target, control, regime, push, velocity: before }) = self.ordered else {
            return Finding::Sound;
        };
        let Circumstances { moved, velocity, battery, gain, gentle, probing } = circumstances;
        let push = push.to_volts();
        let finding = self.guard.step(Evidence {
            control,
            regime,
            push,
            battery,
            gain,
            target,
            moved,
            before,
            velocity,
            gentle,
            probing,
        });
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
