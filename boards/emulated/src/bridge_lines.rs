//! Bridges as their pins command them: states, every change of them at its virtual instant, and
//! whether a bridge may go that way.

use std::fmt;
use std::time::Duration;

use motor_hub::bridge::State;

use crate::pwm::{Grid, Output, level};

/// The three lines of one bridge: VNH5019A-E with both DIAG/EN pulled up. A line that the chip does
/// not drive is low, by the pull-downs on the carrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lines {
    /// Direction line A.
    pub ina: bool,
    /// Direction line B.
    pub inb: bool,
    /// PWM line.
    pub pwm: Output,
}

impl Lines {
    /// Nothing is driven.
    pub const FLOATING: Self = Self { ina: false, inb: false, pwm: Output::Level(false) };

    /// The bridge's state while the PWM line is `high` (data sheet of the VNH5019A-E, Doc ID 15701,
    /// truth table; PWM low opens both low sides).
    #[must_use]
    pub const fn state(self, high: bool) -> State {
        match (self.ina, self.inb, high) {
            (true, false, true) => State::DriveCw,
            (true, false, false) => State::HighLeft,
            (false, true, true) => State::DriveCcw,
            (false, true, false) => State::HighRight,
            (false, false, true) => State::BrakeLow,
            (false, false, false) => State::Coast,
            (true, true, _) => State::BrakeHigh,
        }
    }

    /// The share of a period of `ticks` in which the PWM line is high.
    #[must_use]
    pub fn duty(self, ticks: u32) -> f64 {
        match self.pwm {
            Output::Level(high) => f64::from(u8::from(high)),
            Output::Pulse(high) => f64::from(high) / f64::from(ticks.max(1)),
        }
    }

    /// True if the motor is shorted all the time: full dynamic braking.
    #[must_use]
    pub fn shorted(self) -> bool {
        self == Self { pwm: Output::Level(true), ..Self::FLOATING }
    }

    /// True if no current path through a closed switch is made or modulated.
    #[must_use]
    pub fn open(self) -> bool {
        self == Self::FLOATING
    }
}

/// One bridge's lines changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transition {
    /// Since power-on.
    pub at: Duration,
    /// Which bridge.
    pub motor: usize,
    /// The lines from here on.
    pub lines: Lines,
    /// The state just before.
    pub before: State,
    /// The state from here on, until the next edge of the PWM line.
    pub after: State,
    /// True if a reset released the lines.
    pub by_reset: bool,
    /// The lines before.
    pub old: Lines,
}

impl Transition {
    /// Whether a bridge may go that way.
    ///
    /// * Never a state that is not one of the three modes' (both direction lines high).
    /// * The PWM line may toggle within a mode: 9/8, 6/2, 5/0.
    /// * A direction line may change only while the PWM line is low and stays low. Then at most one high side closes or opens, and no leg goes from one switch to the other without a pause. From one
    ///   direction to the other it must pass state 0.
    /// * A reset opens all switches together.
    #[must_use]
    pub fn legal(&self) -> bool {
        let [before, after] = [self.before, self.after];
        if after == State::BrakeHigh {
            return false;
        }
        if self.by_reset {
            return after == State::Coast;
        }
        if (self.old.ina, self.old.inb) == (self.lines.ina, self.lines.inb) {
            return true;
        }
        let low = self.old.pwm == Output::Level(false) && self.lines.pwm == Output::Level(false);
        low && (before == State::Coast || after == State::Coast)
    }
}

impl fmt::Display for Transition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { at, motor, before, after, lines, .. } = self;
        write!(f, "{:.9} s: bridge {motor} from {before:?} to {after:?}, {lines:?}", at.as_secs_f64())
    }
}

/// Follows the lines of all bridges.
#[derive(Debug)]
pub(crate) struct Recorder {
    pub(crate) lines: Vec<Lines>,
    pub(crate) transitions: Vec<Transition>,
}

impl Recorder {
    pub(crate) fn new(bridges: usize) -> Self {
        Self { lines: vec![Lines::FLOATING; bridges], transitions: Vec::new() }
    }

    /// Bridge `motor` has these lines from `at` on; true if that is new. `grids`: the PWM periods
    /// before and after.
    pub(crate) fn set(
        &mut self,
        at: u64,
        motor: usize,
        lines: Lines,
        grids: (Option<Grid>, Option<Grid>),
        by_reset: bool,
    ) -> bool {
        let old = self.lines[motor];
        if old == lines {
            return false;
        }
        // Just before: an edge of the old waveform at this very instant is still to come.
        let before = old.state(level(old.pwm, grids.0, at.saturating_sub(1)));
        let after = lines.state(level(lines.pwm, grids.1, at));
        let at = Duration::from_nanos(at);
        self.transitions.push(Transition { at, motor, lines, before, after, by_reset, old });
        self.lines[motor] = lines;
        true
    }
}
