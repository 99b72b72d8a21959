//! What a page may ask for: JSON objects of one key, the order, with its fields. Whatever is unknown, missing or out of range is refused in words.
//!
//! ```
//! use dashboard::order::Order;
//!
//! let order: Order = serde_json::from_str(r#"{"drive":{"motor":0,"mode":"velocity","value":0.5}}"#).unwrap();
//! assert!(order.is_for_the_controller());
//! assert!(!serde_json::from_str::<Order>(r#"{"stop":null}"#).unwrap().is_for_the_controller());
//! assert!(serde_json::from_str::<Order>(r#"{"explode":null}"#).is_err());
//! ```

use crate::world::WorldOrder;
use serde::Deserialize;

/// What a page asks for.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Order {
    /// It has shown this frame.
    Shown {
        /// The frame's.
        number: u64,
    },
    /// It cannot be seen, or can again.
    Hidden {
        /// It cannot.
        hidden: bool,
    },
    /// All motors off; anybody may.
    Stop,
    /// To be in control.
    Take,
    /// To be in control no more.
    Release,
    /// What a motor is to do once it is enabled.
    Drive {
        /// 0 to 3.
        motor: u8,
        /// How it is regulated.
        mode: Mode,
        /// Share of full power from -1 to 1, counts/s, or counts.
        value: f64,
        /// On the way to a position, in counts/s.
        speed: Option<f64>,
        /// What zero means.
        #[serde(default)]
        zero: Zero,
    },
    /// Lets a motor run, or float.
    Enable {
        /// 0 to 3.
        motor: u8,
        /// Run.
        on: bool,
    },
    /// Makes a motor's present position 0.
    ResetEncoder {
        /// 0 to 3.
        motor: u8,
    },
    /// Sends motors to positions in step.
    Together {
        /// By motor: counts, or nothing for who stays.
        to: [Option<i32>; 4],
        /// Of the motor that moves most, in counts/s.
        speed: u32,
        /// Largest of any motor, in counts/s².
        acceleration: u32,
    },
    /// Gives a loop coefficients; from then on the motor is regulated by PID.
    Coefficients {
        /// 0 to 3.
        motor: u8,
        /// Which loop.
        of: Loop,
        /// Proportional, integral, derivative, feed forward: -32768 to 32767 each.
        pidf: [f64; 4],
    },
    /// Chooses the regulator; by the model only of a motor that is known.
    Regulator {
        /// 0 to 3.
        motor: u8,
        /// Which.
        kind: Regulator,
    },
    /// Says which motor is connected, and how control values are given their meaning.
    SetUp {
        /// 0 to 3.
        motor: u8,
        /// A motor of the catalogue; nothing leaves it.
        name: Option<String>,
        /// `none`, `A` to `D`.
        scheme: String,
        /// How duties are found.
        duty: Duty,
    },
    /// Limits a motor's acceleration.
    Acceleration {
        /// 0 to 3.
        motor: u8,
        /// In counts/s²; nothing is what the battery gives.
        limit: Option<u32>,
    },
    /// Makes the hub learn how a motor moves.
    Identify {
        /// 0 to 3.
        motor: u8,
        /// Counts that it may turn at most, either way.
        travel: Option<u32>,
    },
    /// Puts in force what was learned.
    Apply {
        /// 0 to 3.
        motor: u8,
    },
    /// Takes back the last change of a motor's settings.
    Undo {
        /// 0 to 3.
        motor: u8,
    },
    /// Stores the settings that are in force, so that they outlast the hub's power.
    Save,
    /// Plays the scenario of a simulated hub from its beginning.
    Play,
    /// Does something to a simulated hub's world.
    World(WorldOrder),
}

impl Order {
    /// True of what only the page in control may.
    #[must_use]
    pub const fn is_for_the_controller(&self) -> bool {
        !matches!(self, Self::Shown { .. } | Self::Hidden { .. } | Self::Stop | Self::Take | Self::Release)
    }
}

/// How a motor is regulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Not at all.
    Power,
    /// To a speed.
    Velocity,
    /// To a place.
    Position,
}

/// What zero means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Zero {
    /// Full dynamic braking, or held.
    #[default]
    Brake,
    /// The bridge is open.
    Float,
}

/// Which loop of two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loop {
    /// Of the velocity.
    Velocity,
    /// Of the position, above it.
    Position,
}

/// Which regulator of two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Regulator {
    /// By the motor's own equation.
    Model,
    /// By coefficients.
    Pid,
}

/// How duties are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Duty {
    /// As in the paper.
    LinearDuty,
    /// Such that current is linear.
    LinearCurrent,
}
