//! Effect of the sixteen switch patterns of an H bridge on a motor.
//!
//! The effect of a pattern is computed from the paths of its current. Tests compare the effects with the table in
//! section 1.2 of *the paper*: R. Atkinson, *On Proportional Braking in H Bridges* (2018).
//!
//! The number of a pattern is the sum of its closed switches:
//!
//! | | left | right |
//! |---|---|---|
//! | high side | S1 = 8 | S3 = 2 |
//! | low side | S2 = 4 | S4 = 1 |
//!
//! ```
//! use motor_hub::model::bridge_states::{Effect, SwitchPattern};
//!
//! // In state 8 only S1 is closed. The back EMF is 5 V, and the battery has 12 V. A motor that turns CW coasts. A
//! // motor that turns CCW brakes.
//! let pattern = SwitchPattern::new(8).expect("one of the sixteen");
//! assert_eq!(pattern.effect(5_000, 12_000, 700), Effect::Coast);
//! assert_eq!(pattern.effect(-5_000, 12_000, 700), Effect::BrakeToVcc);
//! ```

use crate::bridge::State;

/// Set of closed switches: one of the sixteen patterns, including the short circuits.
///
/// A `SwitchPattern` is a description only. A bridge accepts a [`State`], which is never a short circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SwitchPattern(u8);

/// Sign of the motor current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurrentSign {
    /// Current flows from the left terminal to the right terminal and makes clockwise torque.
    Positive,
    /// Current flows from the right terminal to the left terminal and makes counter-clockwise torque.
    Negative,
}

/// Voltage across the motor, left minus right, while a current of a given sign flows.
///
/// The voltage is `battery * Vbat + diode * Vd - switches * Ron * i`. Here `Vbat` is the battery voltage, `Vd` the drop
/// of a catch diode, `Ron` the resistance of a closed switch, and `i` the current, positive from left to right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TerminalVoltage {
    /// Coefficient of the battery voltage, -1 to 1.
    pub battery: i8,
    /// Coefficient of the diode drop, -2 to 2.
    pub diode: i8,
    /// Closed switches in the current's path, 0 to 2.
    pub switches: u8,
}

/// Effect of a pattern on a motor that turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// The battery drives the motor clockwise.
    DriveCw,
    /// The battery drives the motor counter-clockwise.
    DriveCcw,
    /// No current flows: the circuit is open, or the back EMF does not exceed the voltages against it.
    Coast,
    /// The back EMF drives a braking current through the low side of the bridge.
    BrakeToGnd,
    /// The back EMF drives a braking current through the high side of the bridge.
    BrakeToVcc,
    /// The back EMF exceeds the battery voltage and the diode drops, and charges the battery.
    Regenerate,
    /// One leg of the bridge connects the battery to ground.
    ShortCircuit,
}

impl Effect {
    /// Returns the name in the table of the paper.
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
    /// Creates the pattern with this number. `None` if the number is above 15.
    pub const fn new(number: u8) -> Option<Self> {
        if number < 16 { Some(Self(number)) } else { None }
    }

    /// Returns the number of the pattern in the paper, 0 to 15.
    pub const fn number(self) -> u8 {
        self.0
    }

    /// Returns for each of S1, S2, S3 and S4 whether the switch is closed.
    pub const fn switches(self) -> [bool; 4] {
        let n = self.0;
        [n & 8 != 0, n & 4 != 0, n & 2 != 0, n & 1 != 0]
    }

    /// Returns true if both switches of a leg are closed.
    pub const fn is_short_circuit(self) -> bool {
        let n = self.0;
        n & 0b1100 == 0b1100 || n & 0b0011 == 0b0011
    }

    /// Returns the terminal voltage while a current of `sign` flows. `None` for a short circuit.
    pub const fn terminal(self, sign: CurrentSign) -> Option<TerminalVoltage> {
        if self.is_short_circuit() {
            return None;
        }
        let [s1, s2, s3, s4] = self.switches();
        let positive = matches!(sign, CurrentSign::Positive);
        // Positive current flows from the left node into the motor and from the motor into the right node.
        let (left_battery, left_diode, left_switch) = node(s1, s2, !positive);
        let (right_battery, right_diode, right_switch) = node(s3, s4, positive);
        Some(TerminalVoltage {
            battery: left_battery - right_battery,
            diode: left_diode - right_diode,
            switches: left_switch + right_switch,
        })
    }

    /// Returns the effect of the pattern on a motor with the back EMF `emf_mv`, positive when the motor turns CW.
    ///
    /// `battery_mv` is the battery voltage and `diode_mv` the drop of one catch diode, both at least 0. The table of
    /// the paper is the case `diode < |emf| < battery + diode`.
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
        // The back EMF drives a negative current during CW rotation and a positive current during CCW rotation.
        let (path, threshold_mv, emf_abs) = if emf_mv >= 0 {
            (neg, neg.battery as i32 * battery_mv + neg.diode as i32 * diode_mv, emf_mv)
        } else {
            (pos, -(pos.battery as i32 * battery_mv + pos.diode as i32 * diode_mv), -emf_mv)
        };
        if emf_abs <= threshold_mv {
            // States 5 and 10 need no minimum EMF: their switches short the motor at standstill too.
            return if path.diode == 0 { self.brake_rail() } else { Effect::Coast };
        }
        if path.battery == 0 { self.brake_rail() } else { Effect::Regenerate }
    }

    /// Returns the braking effect of a pattern, through the side on which a switch is closed.
    const fn brake_rail(self) -> Effect {
        if self.0 & 0b1010 != 0 { Effect::BrakeToVcc } else { Effect::BrakeToGnd }
    }
}

/// Returns the potential of a terminal while current flows through it, as coefficients of battery voltage and diode
/// drop, and the number of closed switches in the current's path. The leg of the terminal has these switches closed. A
/// catch diode carries the current if both switches are open.
const fn node(high: bool, low: bool, current_enters: bool) -> (i8, i8, u8) {
    match (high, low) {
        (true, _) => (1, 0, 1),
        (_, true) => (0, 0, 1),
        // A current into the node flows through the high diode to the battery.
        _ if current_enters => (1, 1, 0),
        // A current out of the node comes from ground through the low diode.
        _ => (0, -1, 0),
    }
}

impl State {
    /// Returns the switch pattern of this state.
    #[must_use]
    pub const fn pattern(self) -> SwitchPattern {
        SwitchPattern(self as u8)
    }

    /// Returns the terminal voltage while a current of `sign` flows.
    #[must_use]
    pub const fn terminal(self, sign: CurrentSign) -> TerminalVoltage {
        match self.pattern().terminal(sign) {
            Some(terminal) => terminal,
            // No state is a short circuit, which a test checks. If a state were a short circuit, this terminal voltage
            // would be 0.
            None => TerminalVoltage { battery: 0, diode: 0, switches: 0 },
        }
    }
}
