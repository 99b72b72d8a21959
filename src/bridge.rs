//! The H bridge: the nine states that it may be commanded to, the three pulse-width-modulated modes 9/8,
//! 6/2 and 5/0, and its constants.
//!
//! ```
//! use motor_hub::bridge::{Drive, Mode, State};
//! use motor_hub::units::Duty;
//!
//! // A quarter of the period driven clockwise, the rest freewheeling.
//! let drive = Drive { mode: Mode::Cw98, duty: Duty::from_bits(1 << 13) };
//! assert_eq!((drive.mode.on(), drive.mode.off()), (State::DriveCw, State::HighLeft));
//! ```
//!
//! Switches are numbered as in the paper (section 1.2): S1 = 8 (high side, left), S2 = 4 (low side,
//! left), S3 = 2 (high side, right), S4 = 1 (low side, right). Clockwise (CW) is current from left to
//! right. Diode Dn lies antiparallel to Sn. What a state does to a motor is said, and compared with the
//! paper's table, in `model::bridge_states`.

use crate::units::{Duty, Milliamperes, Millivolts, RangeError};

/// The switches that are closed, of those sixteen patterns that a bridge may be commanded to: the seven
/// short circuits have no value here.
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

/// What a bridge says of itself, on a board that can hear it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sensed {
    /// Mean of what its current-sense line shows, positive; `None` where there is none.
    pub current: Option<Milliamperes>,
    /// It has switched itself off, for whatever reason of its own.
    pub fault: bool,
}

/// How a converter's words say what current-sense lines show: a resistor to ground makes a voltage of their current.
///
/// ```
/// use motor_hub::bridge::SenseScale;
///
/// // Half of 3.3 V by a converter of 12 bits: 1.65 V of 0.14 V/A.
/// assert_eq!(SenseScale::VNH5019_CARRIER.current(2_048, 12).get(), 11_788);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SenseScale {
    /// What the highest word stands for.
    full_scale_ma: u32,
}

impl SenseScale {
    /// The usual carriers of a VNH5019A-E: about 140 mV/A, their chip's ratio of 7000 into 1 kohm, for a converter of
    /// 3.3 V. The ratio is 4670 to 10 110 at 3 A, 6060 to 8330 at 8 A (Doc ID 15701, table 9), which is more than a rail's
    /// tolerance.
    pub const VNH5019_CARRIER: Self = Self { full_scale_ma: 3_300 * 1_000 / 140 };

    /// What the reference of the converter is, and what a line has per ampere, in millivolts.
    ///
    /// # Errors
    /// [`RangeError::Sense`] if either is 0.
    pub const fn new(reference: Millivolts, mv_per_a: u16) -> Result<Self, RangeError> {
        if reference.get() == 0 || mv_per_a == 0 {
            return Err(RangeError::Sense);
        }
        // 65 535 * 1000 is less than 2^32.
        Ok(Self { full_scale_ma: reference.get() as u32 * 1_000 / mv_per_a as u32 })
    }

    /// What a word of so many bits, 1 to 16, stands for; of more bits the highest 16 count.
    pub const fn current(self, word: u16, bits: u32) -> Milliamperes {
        let highest = if bits >= 16 { u16::MAX } else { (1 << bits) - 1 };
        let highest = if highest == 0 { 1 } else { highest };
        let ma = self.full_scale_ma as u64 * word as u64 / highest as u64;
        Milliamperes::new(if ma > i32::MAX as u64 { i32::MAX } else { ma as i32 })
    }
}

/// How fast a bridge switches, and what it must be spared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Timing {
    /// The shortest time, in nanoseconds, for which a period may hold the PWM line low; 0 for any.
    pub least_off_ns: u16,
    /// The same for high.
    pub least_on_ns: u16,
    /// How long an output takes, in nanoseconds, once the PWM line has risen.
    pub turn_on_ns: u16,
    /// The same when it has fallen.
    pub turn_off_ns: u16,
    /// How long a bridge is open, in microseconds, when its mode changes.
    pub change_us: u16,
}

impl Timing {
    /// An ideal bridge: at once, and anything.
    pub const IDEAL: Self =
        Self { least_off_ns: 0, least_on_ns: 0, turn_on_ns: 0, turn_off_ns: 0, change_us: 0 };

    /// What the data sheet of the VNH2SP30-E (DocID10832) says at 13 V, typically: outputs fall in 1.2 us and rise in 1 us
    /// (at most 2.4 and 1.6), 600 us (300 to 1800) pass when the mode changes, and a PWM line that is low for less than
    /// 6 us may be taken for a short circuit, which ends in a fault. The VNH5019A-E is assumed to be alike. Of a line that is
    /// high no such thing is said; 2.4 us let the slowest output arrive.
    pub const VNH5019: Self = Self {
        least_off_ns: 6_000,
        least_on_ns: 2_400,
        turn_on_ns: 1_200,
        turn_off_ns: 1_000,
        change_us: 600,
    };
}

/// What the switches and diodes of a bridge cost, and how fast it switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BridgeConstants {
    diode_mv: u16,
    switch_mohm: u16,
    pwm_hz: u32,
    timing: Timing,
}

impl BridgeConstants {
    /// A bridge that switches at once and takes any duty: diodes of 0.7 V, switches of 50 mohm, 20 kHz.
    pub const IDEAL: Self = match Self::new(700, 50, 20_000) {
        Ok(bridge) => bridge,
        Err(_) => panic!("in range"),
    };

    /// A VNH5019: the constants of [`IDEAL`](Self::IDEAL) with the [timing](Timing::VNH5019) of the real chip.
    pub const VNH5019: Self = Self::IDEAL.with_timing(Timing::VNH5019);

    /// The same with another timing.
    #[must_use]
    pub const fn with_timing(self, timing: Timing) -> Self {
        Self { timing, ..self }
    }

    /// Ideal switches. Drop of one catch diode in millivolts, up to 2000; on-resistance of one closed switch in milliohms,
    /// up to 4095; PWM frequency in hertz, 100 to 200 000.
    ///
    /// # Errors
    /// [`RangeError::Bridge`] outside these ranges.
    pub const fn new(diode_mv: u16, switch_mohm: u16, pwm_hz: u32) -> Result<Self, RangeError> {
        if diode_mv > 2_000 || switch_mohm > 4_095 || pwm_hz < 100 || pwm_hz > 200_000 {
            return Err(RangeError::Bridge);
        }
        Ok(Self { diode_mv, switch_mohm, pwm_hz, timing: Timing::IDEAL })
    }

    /// Drop of one conducting catch diode in millivolts, 0 to 2000.
    pub const fn diode_mv(&self) -> u16 {
        self.diode_mv
    }

    /// On-resistance of one closed switch in milliohms, 0 to 4095.
    pub const fn switch_mohm(&self) -> u16 {
        self.switch_mohm
    }

    /// How it switches.
    pub const fn timing(&self) -> Timing {
        self.timing
    }

    /// PWM frequency in hertz, 100 to 200 000.
    pub const fn pwm_hz(&self) -> u32 {
        self.pwm_hz
    }
}
