//! The H bridge: the nine states that may be commanded, the modes that alternate between two states, and the bridge's
//! constants.
//!
//! ```
//! use motor_hub::bridge::{Drive, Mode, State};
//! use motor_hub::units::Duty;
//!
//! // The bridge drives clockwise for a quarter of the period, and freewheels for the rest.
//! let drive = Drive { mode: Mode::Cw98, duty: Duty::from_bits(1 << 13) };
//! assert_eq!((drive.mode.on(), drive.mode.off()), (State::DriveCw, State::HighLeft));
//! ```
//!
//! Switches are numbered as in section 1.2 of *the paper*: R. Atkinson, *On Proportional Braking in H Bridges* (2018).
//! The number of a state is the sum of its closed switches:
//!
//! | | left | right |
//! |---|---|---|
//! | high side | S1 = 8 | S3 = 2 |
//! | low side | S2 = 4 | S4 = 1 |
//!
//! Current from left to right turns the motor clockwise (CW). Each switch has a catch diode antiparallel to it.
//! `model::bridge_states` computes what each state does to a motor.

use crate::units::{Duty, Milliamperes, Millivolts, RangeError};

/// A state of the bridge: which switches are closed.
///
/// Nine of the sixteen patterns may be commanded. The other seven short the supply and have no variant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum State {
    /// State 0: all switches are open.
    Coast = 0,
    /// State 1: S4 is closed.
    LowRight = 1,
    /// State 2: S3 is closed.
    HighRight = 2,
    /// State 4: S2 is closed.
    LowLeft = 4,
    /// State 5: both low sides are closed, which is full dynamic braking.
    BrakeLow = 5,
    /// State 6: S2 and S3 are closed, which drives CCW.
    DriveCcw = 6,
    /// State 8: S1 is closed.
    HighLeft = 8,
    /// State 9: S1 and S4 are closed, which drives CW.
    DriveCw = 9,
    /// State 10: both high sides are closed, which is full dynamic braking too.
    BrakeHigh = 10,
}

impl State {
    /// All states that may be commanded, in ascending order.
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

/// A switching mode x/y: state x during the duty, state y during the rest of the period (paper, section 1.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// Mode 9/8 drives CW, then freewheels: S1 stays closed, and S4 opens.
    Cw98,
    /// Mode 6/2 drives counter-clockwise (CCW), then freewheels: S3 stays closed, and S2 opens.
    Ccw62,
    /// Mode 5/0 shorts the motor, then opens the bridge. This is proportional braking.
    #[default]
    Brake50,
}

impl Mode {
    /// Returns the state during the duty.
    pub const fn on(self) -> State {
        match self {
            Self::Cw98 => State::DriveCw,
            Self::Ccw62 => State::DriveCcw,
            Self::Brake50 => State::BrakeLow,
        }
    }

    /// Returns the state during the rest of the period.
    pub const fn off(self) -> State {
        match self {
            Self::Cw98 => State::HighLeft,
            Self::Ccw62 => State::HighRight,
            Self::Brake50 => State::Coast,
        }
    }

    /// Returns the mode that does the same to a motor that turns in the other direction.
    #[must_use]
    pub const fn mirrored(self) -> Self {
        match self {
            Self::Cw98 => Self::Ccw62,
            Self::Ccw62 => Self::Cw98,
            Self::Brake50 => Self::Brake50,
        }
    }

    /// Returns "9/8", "6/2" or "5/0".
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cw98 => "9/8",
            Self::Ccw62 => "6/2",
            Self::Brake50 => "5/0",
        }
    }
}

/// A command to one bridge. The bridge repeats the command every PWM period until the bridge gets another command. The
/// default is [`COAST`](Self::COAST).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Drive {
    /// The mode, which is a pair of states that alternate.
    pub mode: Mode,
    /// The share of the PWM period that is spent in the mode's first state.
    pub duty: Duty,
}

impl Drive {
    /// Opens all switches: state 0 all the time.
    pub const COAST: Self = Self { mode: Mode::Brake50, duty: Duty::ZERO };
    /// Brakes fully: state 5 all the time.
    pub const BRAKE: Self = Self { mode: Mode::Brake50, duty: Duty::ONE };
}

/// Feedback of a bridge: its measured current and its fault output, on boards that have these signals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BridgeFeedback {
    /// Mean current that the current-sense line shows, at least 0. `None` without a current-sense line, or if the
    /// converter did not answer.
    pub current: Option<Milliamperes>,
    /// True if the bridge has switched itself off.
    pub fault: bool,
}

/// Converts ADC readings of current-sense lines to currents. A resistor to ground turns the line's current into a
/// voltage.
///
/// ```
/// use motor_hub::bridge::SenseScale;
///
/// // A 12-bit converter reads half of 3.3 V. These 1.65 V at 0.14 V/A are 11.8 A.
/// assert_eq!(SenseScale::VNH5019_CARRIER.current(2_048, 12).get(), 11_788);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SenseScale {
    /// Current of a full-scale reading, in mA.
    full_scale_ma: u32,
}

impl SenseScale {
    /// Scale of the usual VNH5019A-E carrier boards with a 3.3 V converter: about 140 mV/A.
    ///
    /// The chip's sense output is the motor's current divided by about 7000, and flows through 1 kohm. The ratio of a
    /// chip is between 4670 and 10 110 at 3 A, and between 6060 and 8330 at 8 A (data sheet Doc ID 15701, table 9).
    /// This scale therefore shows a current of 3 A as 2.1 to 4.6 A, and a current of 8 A as 6.9 to 9.4 A.
    pub const VNH5019_CARRIER: Self = Self { full_scale_ma: 3_300 * 1_000 / 140 };

    /// Creates a scale from the converter's reference voltage and the sensitivity of the line in mV/A.
    ///
    /// # Errors
    /// [`RangeError::Sense`] if either is 0.
    pub const fn new(reference: Millivolts, mv_per_a: u16) -> Result<Self, RangeError> {
        if reference.get() == 0 || mv_per_a == 0 {
            return Err(RangeError::Sense);
        }
        // The product is at most 65 535 * 1000, less than 2^32.
        Ok(Self { full_scale_ma: reference.get() as u32 * 1_000 / mv_per_a as u32 })
    }

    /// Returns the current of a reading. `bits` is the converter's resolution, 1 to 16. The value 0 counts as 1, and a
    /// larger value as 16.
    pub const fn current(self, reading: u16, bits: u32) -> Milliamperes {
        let full_scale = if bits >= 16 { u16::MAX } else { (1 << bits) - 1 };
        let full_scale = if full_scale == 0 { 1 } else { full_scale };
        let ma = self.full_scale_ma as u64 * reading as u64 / full_scale as u64;
        Milliamperes::new(if ma > i32::MAX as u64 { i32::MAX } else { ma as i32 })
    }
}

/// Switching times of a bridge, and the shortest pulses that it permits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Timing {
    /// Shortest permitted low time of the PWM line in a period, in nanoseconds; 0 without a limit.
    pub least_off_ns: u16,
    /// Shortest permitted high time of the PWM line in a period, in nanoseconds; 0 without a limit.
    pub least_on_ns: u16,
    /// Delay from the rising edge of the PWM line until the output has switched, in nanoseconds.
    pub turn_on_ns: u16,
    /// Delay from the falling edge of the PWM line until the output has switched, in nanoseconds.
    pub turn_off_ns: u16,
    /// Time for which the bridge is open when its mode changes, in microseconds.
    pub change_us: u16,
}

impl Timing {
    /// Timing of an ideal bridge, which switches without delay and permits any pulse.
    pub const IDEAL: Self =
        Self { least_off_ns: 0, least_on_ns: 0, turn_on_ns: 0, turn_off_ns: 0, change_us: 0 };

    /// Timing of a VNH5019A-E, which is assumed to switch like a VNH2SP30-E.
    ///
    /// The data sheet of the VNH2SP30-E (DocID10832) gives these typical values at 13 V, with their limits in
    /// parentheses:
    ///
    /// * An output falls 1.2 us (at most 2.4 us) after a rising edge of the PWM line, and rises 1 us (at most 1.6 us)
    ///   after a falling edge.
    /// * A change of mode takes 600 us (300 to 1800 us).
    /// * The bridge may mistake a low time of less than 6 us for a short circuit, and then reports a fault.
    ///
    /// The data sheet gives no shortest high time. The value of 2.4 us is the longest time that an output takes to
    /// switch.
    pub const VNH5019: Self = Self {
        least_off_ns: 6_000,
        least_on_ns: 2_400,
        turn_on_ns: 1_200,
        turn_off_ns: 1_000,
        change_us: 600,
    };
}

/// Electrical constants of a bridge: voltage drops, PWM frequency and timing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BridgeConstants {
    diode_mv: u16,
    switch_mohm: u16,
    pwm_hz: u32,
    /// The timing.
    pub timing: Timing,
}

impl BridgeConstants {
    /// A bridge with ideal timing: diodes of 0.7 V, switches of 50 mohm, 20 kHz.
    pub const IDEAL: Self = match Self::new(700, 50, 20_000) {
        Ok(bridge) => bridge,
        Err(_) => panic!("in range"),
    };

    /// A VNH5019: the constants of [`IDEAL`](Self::IDEAL) with the [timing of the real chip](Timing::VNH5019).
    pub const VNH5019: Self = Self::IDEAL.with_timing(Timing::VNH5019);

    /// Returns these constants with another timing.
    #[must_use]
    pub const fn with_timing(self, timing: Timing) -> Self {
        Self { timing, ..self }
    }

    /// Creates the constants of a bridge with ideal timing.
    ///
    /// | argument | meaning | range |
    /// |---|---|---|
    /// | `diode_mv` | voltage drop of one catch diode in mV | 0 to 2000 |
    /// | `switch_mohm` | on-resistance of one closed switch in milliohms | 0 to 4095 |
    /// | `pwm_hz` | PWM frequency in Hz | 100 to 200 000 |
    ///
    /// # Errors
    /// [`RangeError::Bridge`] if a value is out of range.
    pub const fn new(diode_mv: u16, switch_mohm: u16, pwm_hz: u32) -> Result<Self, RangeError> {
        if diode_mv > 2_000 || switch_mohm > 4_095 || pwm_hz < 100 || pwm_hz > 200_000 {
            return Err(RangeError::Bridge);
        }
        Ok(Self { diode_mv, switch_mohm, pwm_hz, timing: Timing::IDEAL })
    }

    /// Returns the voltage drop of one conducting catch diode in millivolts, 0 to 2000.
    pub const fn diode_mv(&self) -> u16 {
        self.diode_mv
    }

    /// Returns the on-resistance of one closed switch in milliohms, 0 to 4095.
    pub const fn switch_mohm(&self) -> u16 {
        self.switch_mohm
    }

    /// Returns the PWM frequency in hertz, 100 to 200 000.
    pub const fn pwm_hz(&self) -> u32 {
        self.pwm_hz
    }
}
