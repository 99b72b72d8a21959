//! What the sixteen switch patterns of an H bridge do to a motor.
//!
//! Nothing here is a table from the paper: what a pattern does follows from where its current can flow,
//! and the tests compare that with the printed table (section 1.2).
//!
//! ```
//! use motor_hub::model::bridge_states::{Effect, SwitchPattern};
//!
//! // State 8, S1 alone, with a back EMF of 5 V on a battery of 12 V: it lets a motor coast that turns CW,
//! // and brakes one that turns CCW.
//! let pattern = SwitchPattern::new(8).expect("one of the sixteen");
//! assert_eq!(pattern.effect(5_000, 12_000, 700), Effect::Coast);
//! assert_eq!(pattern.effect(-5_000, 12_000, 700), Effect::BrakeToVcc);
//! ```

use crate::bridge::State;

/// Which switches are closed: any of the sixteen patterns, the short circuits included.
///
/// This type describes; it cannot be sent to a bridge. [`State`] can.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SwitchPattern(u8);

/// What connects one motor terminal while current flows through it.
#[derive(Clone, Copy)]
enum Path {
    /// A closed switch to the battery.
    HighSwitch,
    /// A closed switch to ground.
    LowSwitch,
    /// The catch diode that carries the current where both switches are open.
    Diode,
}

/// Sign of the motor current; positive flows from left to right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurrentSign {
    /// From the left terminal to the right one: clockwise torque.
    Positive,
    /// From right to left: counter-clockwise torque.
    Negative,
}

/// The voltage across the motor (left minus right) while a current of a given sign flows:
/// `battery * Vbat + diode * Vd - sign(i) * switches * Ron * |i|`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TerminalVoltage {
    /// Coefficient of the battery voltage, -1 to 1.
    pub battery: i8,
    /// Coefficient of the diode drop, -2 to 2.
    pub diode: i8,
    /// Closed switches in the current's path, 0 to 2.
    pub switches: u8,
}

/// What a pattern does to a motor that turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Drives clockwise.
    DriveCw,
    /// Drives counter-clockwise.
    DriveCcw,
    /// No path for current: an open circuit.
    Coast,
    /// Back EMF drives a braking current round the low side.
    BrakeToGnd,
    /// Back EMF drives a braking current round the high side.
    BrakeToVcc,
    /// Back EMF exceeds the battery and charges it through the diodes.
    Regenerate,
    /// A leg connects the battery to ground.
    ShortCircuit,
}

impl Effect {
    /// The name as the paper's table prints it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::DriveCw => "Drive CW",
            Self::DriveCcw => "Drive CCW",
            Self::Coast => "Coast",
            Self::BrakeToGnd => "Brake to GND",
            Self::BrakeToVcc => "Brake to VCC",
            Self::Regenerate => "Regenerate",
            Self::ShortCircuit => "Short Circuit",
        }
    }
}

impl SwitchPattern {
    /// The pattern with this number, or `None` above 15.
    pub const fn new(number: u8) -> Option<Self> {
        if number < 16 { Some(Self(number)) } else { None }
    }

    /// The paper's number of the pattern, 0 to 15.
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Whether S1, S2, S3 and S4 are closed.
    pub const fn switches(self) -> [bool; 4] {
        let n = self.0;
        [n & 8 != 0, n & 4 != 0, n & 2 != 0, n & 1 != 0]
    }

    /// True if both switches of a leg are closed.
    pub const fn is_short_circuit(self) -> bool {
        let n = self.0;
        n & 0b1100 == 0b1100 || n & 0b0011 == 0b0011
    }

    /// Terminal voltage while a current of `sign` flows, or `None` for a short circuit.
    pub const fn terminal(self, sign: CurrentSign) -> Option<TerminalVoltage> {
        if self.is_short_circuit() {
            return None;
        }
        let [s1, s2, s3, s4] = self.switches();
        let positive = matches!(sign, CurrentSign::Positive);
        // Positive current leaves the left node and enters the right one; negative the other way.
        let (left_battery, left_diode, left_switch) = node(path(s1, s2), !positive);
        let (right_battery, right_diode, right_switch) = node(path(s3, s4), positive);
        Some(TerminalVoltage {
            battery: left_battery - right_battery,
            diode: left_diode - right_diode,
            switches: left_switch + right_switch,
        })
    }

    /// What the pattern does to a motor with this back EMF (positive when turning CW), all in
    /// millivolts: `battery_mv` at least 0, `diode_mv` the drop of one catch diode, at least 0.
    ///
    /// The paper's table is the case `diode < |emf| < battery + diode`.
    pub const fn effect(self, emf_mv: i32, battery_mv: i32, diode_mv: i32) -> Effect {
        let (Some(pos), Some(neg)) =
            (self.terminal(CurrentSign::Positive), self.terminal(CurrentSign::Negative))
        else {
            return Effect::ShortCircuit;
        };
        match (pos.battery, pos.diode) {
            (1, 0) => return Effect::DriveCw,
            (-1, 0) => return Effect::DriveCcw,
            _ => {}
        }
        // An EMF drives current against itself: CW rotation a negative current, CCW a positive one.
        let (path, threshold_mv, emf_abs) = if emf_mv >= 0 {
            (neg, neg.battery as i32 * battery_mv + neg.diode as i32 * diode_mv, emf_mv)
        } else {
            (pos, -(pos.battery as i32 * battery_mv + pos.diode as i32 * diode_mv), -emf_mv)
        };
        if emf_abs <= threshold_mv {
            // States 5 and 10 have no threshold: at standstill they still are a short across the motor.
            return if path.diode == 0 { self.brake_rail() } else { Effect::Coast };
        }
        if path.battery == 0 { self.brake_rail() } else { Effect::Regenerate }
    }

    const fn brake_rail(self) -> Effect {
        if self.0 & 0b1010 != 0 { Effect::BrakeToVcc } else { Effect::BrakeToGnd }
    }
}

const fn path(high: bool, low: bool) -> Path {
    match (high, low) {
        (true, _) => Path::HighSwitch,
        (_, true) => Path::LowSwitch,
        _ => Path::Diode,
    }
}

/// Potential of a node as coefficients of (battery, diode) and the closed switches in the path.
const fn node(path: Path, current_enters: bool) -> (i8, i8, u8) {
    match path {
        Path::HighSwitch => (1, 0, 1),
        Path::LowSwitch => (0, 0, 1),
        // Into the node: up through the high diode. Out of it: up from ground through the low one.
        Path::Diode if current_enters => (1, 1, 0),
        Path::Diode => (0, -1, 0),
    }
}

impl State {
    /// The switches of this state.
    #[must_use]
    pub const fn pattern(self) -> SwitchPattern {
        SwitchPattern(self as u8)
    }

    /// Terminal voltage while a current of `sign` flows.
    #[must_use]
    pub const fn terminal(self, sign: CurrentSign) -> TerminalVoltage {
        match self.pattern().terminal(sign) {
            Some(terminal) => terminal,
            // No state is a short circuit (tested); an open bridge is the harmless answer.
            None => TerminalVoltage { battery: 0, diode: 0, switches: 0 },
        }
    }
}
