//! From a set-point to a control value: the velocity loop, and the position loop above it.

use crate::motion::pid::PidInput;
use crate::motion::{Pid, Pidf, Tick};
use crate::units::{Control, CountsPerSecond, Period};

/// Counts that still fit 32 bits in steps of 1/256.
const FAR: i32 = (1 << 23) - 1;

/// Both loops of one motor.
#[derive(Clone, Debug)]
pub(super) struct Loops {
    tick: Tick,
    velocity: Pid,
    position: Pid,
}

impl Loops {
    pub(super) fn new(period: Period) -> Self {
        Self { tick: Tick::new(period), velocity: Pid::default(), position: Pid::default() }
    }

    /// Starts both afresh.
    pub(super) const fn reset(&mut self) {
        self.velocity.reset();
        self.position.reset();
    }

    /// Starts the velocity loop afresh.
    pub(super) const fn reset_velocity(&mut self) {
        self.velocity.reset();
    }

    /// The control value for a velocity.
    ///
    /// `hold` is whether the last one had no effect, because the bridge was open.
    pub(super) fn velocity(
        &mut self,
        gains: &Pidf,
        target: CountsPerSecond,
        measured: CountsPerSecond,
        hold: bool,
    ) -> Control {
        let (target, measured) = (target.to_bits(), measured.to_bits());
        let output = self.velocity.step(
            gains,
            self.tick,
            PidInput {
                error: target.saturating_sub(measured),
                measured,
                feed_forward: target,
                limit: i32::from(Control::MAX.get()) << 8,
                hold,
            },
        );
        // Within the limit, which is the control range.
        Control::new(((output + (1 << 7)) >> 8) as i16)
    }

    /// The velocity at which to go to a position now.
    pub(super) fn position(
        &mut self,
        gains: &Pidf,
        target: i32,
        position: i32,
        speed_limit: CountsPerSecond,
        hold: bool,
    ) -> CountsPerSecond {
        // From 8 million counts on it is far enough.
        let distance = target.wrapping_sub(position).clamp(-FAR, FAR);
        let bits = self.position.step(
            gains,
            self.tick,
            PidInput {
                error: distance << 8,
                measured: position.wrapping_shl(8),
                feed_forward: 0,
                limit: speed_limit.to_bits().saturating_abs(),
                hold,
            },
        );
        CountsPerSecond::from_bits(bits)
    }
}
