//! Orders of pages: JSON objects with one key, the order, whose value has its fields. Unknown, missing or out-of-range fields
//! are refused with a text.
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

/// An order of a page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Order {
    /// The page has shown this frame.
    Shown {
        /// Number of the frame.
        number: u64,
    },
    /// The page has been hidden, or is visible again.
    Hidden {
        /// True if the page is hidden.
        hidden: bool,
    },
    /// Disables all motors. Any page may stop.
    Stop,
    /// Takes control.
    Take,
    /// Releases control.
    Release,
    /// Set-point of a motor, applied once the motor is enabled.
    Drive {
        /// Motor, 0 to 3.
        motor: u8,
        /// Power, velocity or position.
        mode: Mode,
        /// Share of full power from -1 to 1, counts/s, or counts.
        value: f64,
        /// Speed limit towards a position, in counts/s.
        speed: Option<f64>,
        /// Behaviour at zero.
        #[serde(default)]
        zero: Zero,
    },
    /// Enables or disables a motor.
    Enable {
        /// Motor, 0 to 3.
        motor: u8,
        /// True to enable.
        on: bool,
    },
    /// Makes a motor's present position 0.
    ResetEncoder {
        /// Motor, 0 to 3.
        motor: u8,
    },
    /// Moves motors to positions in step.
    Together {
        /// Target by motor in counts; `None` for a motor that does not take part.
        to: [Option<i32>; 4],
        /// Speed of the motor with the longest distance, in counts/s.
        speed: u32,
        /// Largest acceleration of any motor, in counts/s².
        acceleration: u32,
    },
    /// Sets the coefficients of a loop; from then on the motor is regulated by PID.
    Coefficients {
        /// Motor, 0 to 3.
        motor: u8,
        /// Loop to set.
        of: Loop,
        /// Proportional, integral, derivative, feed-forward: -32768 to 32767 each.
        pidf: [f64; 4],
    },
    /// Chooses the regulator. For an unknown motor the model learns the acceleration per volt.
    Regulator {
        /// Motor, 0 to 3.
        motor: u8,
        /// Regulator to use.
        kind: Regulator,
    },
    /// Configures the connected motor, the scheme and the duty rule.
    SetUp {
        /// Motor, 0 to 3.
        motor: u8,
        /// Name in the catalogue; `None` keeps the configured motor.
        name: Option<String>,
        /// Scheme: `none`, `A` to `D`.
        scheme: String,
        /// Duty rule.
        duty: Duty,
    },
    /// Limits a motor's acceleration.
    Acceleration {
        /// Motor, 0 to 3.
        motor: u8,
        /// Limit in counts/s²; `None` for the acceleration that the battery gives.
        limit: Option<u32>,
    },
    /// Identifies a motor.
    Identify {
        /// Motor, 0 to 3.
        motor: u8,
        /// Longest travel either way, in counts.
        travel: Option<u32>,
    },
    /// Applies the result of the last identification.
    Apply {
        /// Motor, 0 to 3.
        motor: u8,
    },
    /// Undoes the last change of a motor's settings.
    Undo {
        /// Motor, 0 to 3.
        motor: u8,
    },
    /// Stores the settings in force permanently.
    Save,
    /// Plays the scenario of a simulated hub from its beginning.
    Play,
    /// Changes a simulated hub's world.
    World(WorldOrder),
}

impl Order {
    /// True for orders that only the page in control may give.
    #[must_use]
    pub const fn is_for_the_controller(&self) -> bool {
        !matches!(self, Self::Shown { .. } | Self::Hidden { .. } | Self::Stop | Self::Take | Self::Release)
    }
}

/// Mode of a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Constant power.
    Power,
    /// Regulated velocity.
    Velocity,
    /// Regulated position.
    Position,
}

/// Behaviour of a motor at zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Zero {
    /// Full dynamic braking, or regulated to stand.
    #[default]
    Brake,
    /// Open bridge.
    Float,
}

/// A loop of the PID regulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loop {
    /// Velocity loop.
    Velocity,
    /// Position loop, whose output is the velocity loop's set-point.
    Position,
}

/// A regulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Regulator {
    /// The motor model, with configured dynamics or with a learned acceleration per volt.
    Model,
    /// PID, by coefficients.
    Pid,
}

/// Duty rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Duty {
    /// Duty linear in the control value, as in the paper.
    LinearDuty,
    /// Mean current linear in the control value.
    LinearCurrent,
}
