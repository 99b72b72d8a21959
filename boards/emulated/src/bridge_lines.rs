//! The lines of bridges: the states that they command, each change with its virtual time, and whether a bridge may make the
//! change.

use std::fmt;
use std::time::Duration;

use motor_hub::bridge::State;

use crate::pwm::Output;

/// The three lines of one bridge, a VNH5019A-E with both DIAG/EN pins pulled up. Pull-down resistors on its board keep a
/// line low that the chip does not drive.
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
    /// The chip drives no line.
    pub const FLOATING: Self = Self { ina: false, inb: false, pwm: Output::Level(false) };

    /// Returns the bridge's state while the PWM line is high or low, by the truth table in the data sheet (VNH5019A-E, Doc ID
    /// 15701). A low PWM line opens both low-side switches.
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

    /// True if the motor is shorted all the time: full dynamic braking.
    #[must_use]
    pub fn shorted(self) -> bool {
        self == Self { pwm: Output::Level(true), ..Self::FLOATING }
    }

    /// True if all switches are open all the time.
    #[must_use]
    pub fn open(self) -> bool {
        self == Self::FLOATING
    }
}

/// One bridge's lines changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transition {
    /// Time of the change since power-on.
    pub at: Duration,
    /// Number of the bridge.
    pub motor: usize,
    /// The lines before the change.
    pub old: Lines,
    /// The lines after the change.
    pub lines: Lines,
    /// True if a reset released the lines.
    pub by_reset: bool,
}

impl Transition {
    /// True if a bridge may make this change. In a mode x/y state x and state y alternate with the PWM line.
    ///
    /// * Both direction lines may never be high, because no mode has this state.
    /// * The PWM line may change within a mode: 9/8 (drive CW), 6/2 (drive CCW) or 5/0 (brake).
    /// * A direction line may change only while the PWM line is low and stays low. At most one high-side switch then changes,
    ///   and no leg closes one switch when it opens the other. A change of the direction must pass state 0, the open bridge.
    /// * A reset may open all switches together.
    #[must_use]
    pub fn legal(&self) -> bool {
        let Self { old, lines, by_reset, .. } = self;
        if lines.ina && lines.inb {
            return false;
        }
        if *by_reset {
            return lines.open();
        }
        if (old.ina, old.inb) == (lines.ina, lines.inb) {
            return true;
        }
        let low = old.pwm == Output::Level(false) && lines.pwm == Output::Level(false);
        low && (old.open() || lines.open())
    }
}

impl fmt::Display for Transition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { at, motor, old, lines, .. } = self;
        write!(f, "{:.9} s: bridge {motor} from {old:?} to {lines:?}", at.as_secs_f64())
    }
}
