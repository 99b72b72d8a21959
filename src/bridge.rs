//! The H bridge: its sixteen switch patterns, the nine that may be commanded, and the three
//! pulse-width-modulated modes 9/8, 6/2 and 5/0.
//!
//! Switches are numbered as in the paper (section 1.2): S1 = 8 (high side, left), S2 = 4 (low side,
//! left), S3 = 2 (high side, right), S4 = 1 (low side, right). Clockwise (CW) is current from left to
//! right. Diode Dn lies antiparallel to Sn. Nothing here is a table from the paper: what a pattern
//! does follows from where its current can flow, and the tests compare that with the printed table.

use crate::units::{Duty, RangeError};

/// Which switches are closed: any of the sixteen patterns, the short circuits included.
///
/// This type describes; it cannot be sent to a bridge. [`State`] can.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pattern(u8);

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
pub struct Terminal {
    /// Coefficient of the battery voltage, -1 to 1.
    pub battery: i8,
    /// Coefficient of the diode drop, -2 to 2.
    pub diode: i8,
    /// Closed switches in the current's path, 0 to 2.
    pub switches: u8,
}

/// What a pattern does to a motor that turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
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

impl Action {
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

impl Pattern {
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
    pub const fn terminal(self, sign: CurrentSign) -> Option<Terminal> {
        if self.is_short_circuit() {
            return None;
        }
        let [s1, s2, s3, s4] = self.switches();
        let positive = matches!(sign, CurrentSign::Positive);
        // Positive current leaves the left node and enters the right one; negative the other way.
        let (left_battery, left_diode, left_switch) = node(path(s1, s2), !positive);
        let (right_battery, right_diode, right_switch) = node(path(s3, s4), positive);
        Some(Terminal {
            battery: left_battery - right_battery,
            diode: left_diode - right_diode,
            switches: left_switch + right_switch,
        })
    }

    /// What the pattern does to a motor with this back EMF (positive when turning CW), all in
    /// millivolts: `battery_mv` at least 0, `diode_mv` the drop of one catch diode, at least 0.
    ///
    /// The paper's table is the case `diode < |emf| < battery + diode`.
    pub const fn action(self, emf_mv: i32, battery_mv: i32, diode_mv: i32) -> Action {
        let (Some(pos), Some(neg)) =
            (self.terminal(CurrentSign::Positive), self.terminal(CurrentSign::Negative))
        else {
            return Action::ShortCircuit;
        };
        match (pos.battery, pos.diode) {
            (1, 0) => return Action::DriveCw,
            (-1, 0) => return Action::DriveCcw,
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
            return if path.diode == 0 { self.brake_rail() } else { Action::Coast };
        }
        if path.battery == 0 { self.brake_rail() } else { Action::Regenerate }
    }

    const fn brake_rail(self) -> Action {
        if self.0 & 0b1010 != 0 { Action::BrakeToVcc } else { Action::BrakeToGnd }
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

/// A pattern that a bridge may be commanded to: the seven short circuits have no value here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum State {
    /// 0: all open.
    Coast = 0,
    /// 1: S4 closed.
    LowRight = 1,
    /// 2: S3 closed.
    HighRight = 2,
    /// 4: S2 closed.
    LowLeft = 4,
    /// 5: both low sides closed: full dynamic braking.
    BrakeLow = 5,
    /// 6: S2 and S3 closed: drives CCW.
    DriveCcw = 6,
    /// 8: S1 closed.
    HighLeft = 8,
    /// 9: S1 and S4 closed: drives CW.
    DriveCw = 9,
    /// 10: both high sides closed.
    BrakeHigh = 10,
}

impl State {
    /// Every state that may be commanded, by number.
    pub const ALL: [Self; 9] = [
        Self::Coast,
        Self::LowRight,
        Self::HighRight,
        Self::LowLeft,
        Self::BrakeLow,
        Self::DriveCcw,
        Self::HighLeft,
        Self::DriveCw,
        Self::BrakeHigh,
    ];

    /// The switches of this state.
    pub const fn pattern(self) -> Pattern {
        Pattern(self as u8)
    }

    /// Terminal voltage while a current of `sign` flows.
    pub const fn terminal(self, sign: CurrentSign) -> Terminal {
        match self.pattern().terminal(sign) {
            Some(terminal) => terminal,
            // No state is a short circuit (tested); an open bridge is the harmless answer.
            None => Terminal { battery: 0, diode: 0, switches: 0 },
        }
    }
}

/// A switching mode x/y: state x for the duty, state y for the rest of the period (paper, 1.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// 9/8: drive CW, then freewheel.
    Cw98,
    /// 6/2: drive CCW, then freewheel.
    Ccw62,
    /// 5/0: short the motor, then open it: proportional braking.
    Brake50,
}

impl Mode {
    /// The state during the duty.
    pub const fn on(self) -> State {
        match self {
            Self::Cw98 => State::DriveCw,
            Self::Ccw62 => State::DriveCcw,
            Self::Brake50 => State::BrakeLow,
        }
    }

    /// The state during the rest of the period.
    pub const fn off(self) -> State {
        match self {
            Self::Cw98 => State::HighLeft,
            Self::Ccw62 => State::HighRight,
            Self::Brake50 => State::Coast,
        }
    }

    /// The same for a motor that turns the other way.
    #[must_use]
    pub const fn mirrored(self) -> Self {
        match self {
            Self::Cw98 => Self::Ccw62,
            Self::Ccw62 => Self::Cw98,
            Self::Brake50 => Self::Brake50,
        }
    }

    /// "9/8", "6/2" or "5/0".
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cw98 => "9/8",
            Self::Ccw62 => "6/2",
            Self::Brake50 => "5/0",
        }
    }
}

/// What one bridge is told to do until it is told otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Drive {
    /// The pair of states that alternate.
    pub mode: Mode,
    /// The share of the period spent in the mode's first state.
    pub duty: Duty,
}

impl Drive {
    /// All switches open: state 0 all the time.
    pub const COAST: Self = Self { mode: Mode::Brake50, duty: Duty::ZERO };
    /// Full dynamic braking: state 5 all the time.
    pub const BRAKE: Self = Self { mode: Mode::Brake50, duty: Duty::ONE };
}

/// What the switches and diodes of a bridge cost, and how fast it switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BridgeConstants {
    diode_mv: u16,
    switch_mohm: u16,
    pwm_hz: u32,
}

impl BridgeConstants {
    /// A bridge of the VNH5019 kind: 0.7 V, 50 mohm, 20 kHz.
    pub const VNH5019: Self = match Self::new(700, 50, 20_000) {
        Ok(bridge) => bridge,
        Err(_) => panic!("in range"),
    };

    /// Drop of one catch diode in millivolts, up to 2000; on-resistance of one closed switch in milliohms,
    /// up to 4095; PWM frequency in hertz, 100 to 200 000.
    ///
    /// # Errors
    /// [`RangeError::Electrical`] outside these ranges.
    pub const fn new(diode_mv: u16, switch_mohm: u16, pwm_hz: u32) -> Result<Self, RangeError> {
        if diode_mv > 2_000 || switch_mohm > 4_095 || pwm_hz < 100 || pwm_hz > 200_000 {
            return Err(RangeError::Electrical);
        }
        Ok(Self { diode_mv, switch_mohm, pwm_hz })
    }

    /// Drop of one conducting catch diode in millivolts, 0 to 2000.
    pub const fn diode_mv(&self) -> u16 {
        self.diode_mv
    }

    /// On-resistance of one closed switch in milliohms, 0 to 4095.
    pub const fn switch_mohm(&self) -> u16 {
        self.switch_mohm
    }

    /// PWM frequency in hertz, 100 to 200 000.
    pub const fn pwm_hz(&self) -> u32 {
        self.pwm_hz
    }
}
