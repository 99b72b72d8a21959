//! From a set-point to a control value: the velocity loop, and the position loop above it.

use crate::motion::pid::{PidInput, Value};
use crate::motion::{Pid, Pidf};
use crate::units::{Control, CountsPerSecond, Period};

/// Both loops of one motor.
#[derive(Clone, Debug)]
pub(super) struct Loops {
    period: Period,
    velocity: Pid,
    position: Pid,
}

impl Loops {
    pub(super) fn new(period: Period) -> Self {
        Self { period, velocity: Pid::default(), position: Pid::default() }
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

    /// The control value for a velocity. `hold`: the last one had no effect.
    pub(super) fn velocity(
        &mut self,
        gains: &Pidf,
        target: CountsPerSecond,
        measured: CountsPerSecond,
        hold: bool,
    ) -> Control {
        let [target, measured] = [target, measured].map(|speed| Value::from_bits(speed.to_bits()));
        let input = PidInput {
            error: target.saturating_sub(measured),
            measured,
            feed_forward: target,
            limit: Value::from_num(Control::MAX.get()),
            hold,
        };
        let output = self.velocity.step(gains, self.period, input);
        Control::saturating(output.round().to_num())
    }

    /// The velocity at which to go to a position now. `hold`: the last one had no effect.
    pub(super) fn position(
        &mut self,
        gains: &Pidf,
        target: i32,
        position: i32,
        speed_limit: CountsPerSecond,
        hold: bool,
    ) -> CountsPerSecond {
        let input = PidInput {
            // The short way round; 8 million counts are as good as more.
            error: Value::saturating_from_num(target.wrapping_sub(position)),
            measured: Value::wrapping_from_num(position),
            feed_forward: Value::ZERO,
            limit: Value::from_bits(speed_limit.to_bits()),
            hold,
        };
        CountsPerSecond::from_bits(self.position.step(gains, self.period, input).to_bits())
    }
}
