//! What a page may do to a simulated hub's motors and battery, while it runs.
//!
//! ```
//! use dashboard::world::{World, WorldOrder};
//!
//! let world = World::default();
//! let order: WorldOrder = serde_json::from_str(r#"{"hold":{"motor":1,"held":true}}"#).unwrap();
//! world.change(&order).unwrap();
//! assert!(world.hands().motors[1].held);
//! ```

use serde::{Deserialize, Serialize};
use simulated::encoder::{Encoder, Wire};
use simulated::serve::hands::{Hands, OnMotor};
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex, PoisonError};

/// Battery voltages that may be asked for, in volts.
pub const BATTERY_V: RangeInclusive<f64> = 0.0..=16.0;
/// Torques, in newton metres.
pub const TORQUE_NM: RangeInclusive<f64> = -5.0..=5.0;
/// Moments of inertia, in kg m².
pub const INERTIA_KG_M2: RangeInclusive<f64> = 0.0..=0.05;

/// Shared by the page's server and whoever runs the simulated hub.
#[derive(Clone, Debug, Default)]
pub struct World(Arc<Mutex<Hands>>);

/// What is to be done to it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum WorldOrder {
    /// The battery's voltage without load; nothing is the scenario's.
    Battery {
        /// In volts.
        volts: Option<f64>,
    },
    /// An external torque on a motor's output shaft; nothing is the scenario's.
    Torque {
        /// 0 to 3.
        motor: u8,
        /// In newton metres, positive clockwise.
        nm: Option<f64>,
    },
    /// What a motor's output shaft turns; nothing is the scenario's.
    Inertia {
        /// 0 to 3.
        motor: u8,
        /// In kg m².
        kg_m2: Option<f64>,
    },
    /// Holds a shaft, or lets it go.
    Hold {
        /// 0 to 3.
        motor: u8,
        /// So that it cannot turn.
        held: bool,
    },
    /// How a motor's encoder is.
    Encoder {
        /// 0 to 3.
        motor: u8,
        /// Which way.
        is: EncoderIs,
    },
    /// All as the scenario has it.
    Reset,
}

/// How an encoder is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EncoderIs {
    /// As it should be.
    Sound,
    /// No wire is connected.
    Unplugged,
    /// Its wires have changed places.
    Reversed,
    /// A wire makes contact now and then.
    Loose,
}

impl From<EncoderIs> for Encoder {
    fn from(is: EncoderIs) -> Self {
        match is {
            EncoderIs::Sound => Self::Sound,
            EncoderIs::Unplugged => Self::Unplugged,
            EncoderIs::Reversed => Self::Reversed,
            EncoderIs::Loose => Self::Loose { wire: Wire::A },
        }
    }
}

/// As pages are told it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorldIs {
    volts: Option<f64>,
    motors: Vec<MotorIs>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct MotorIs {
    nm: Option<f64>,
    kg_m2: Option<f64>,
    held: bool,
    encoder: EncoderIs,
}

impl World {
    /// As it is now.
    #[must_use]
    pub fn hands(&self) -> Hands {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// For pages.
    #[must_use]
    pub fn is(&self) -> WorldIs {
        let Hands { emf_v, motors, .. } = self.hands();
        let encoder = |encoder| match encoder {
            Some(Encoder::Unplugged) => EncoderIs::Unplugged,
            Some(Encoder::Reversed) => EncoderIs::Reversed,
            Some(Encoder::Loose { .. }) => EncoderIs::Loose,
            _ => EncoderIs::Sound,
        };
        let motor = |OnMotor { torque_nm, inertia_kg_m2, encoder: of, held }: &OnMotor| MotorIs {
            nm: *torque_nm,
            kg_m2: *inertia_kg_m2,
            held: *held,
            encoder: encoder(*of),
        };
        WorldIs { volts: emf_v, motors: motors.iter().map(motor).collect() }
    }

    /// The scenario begins anew, and nobody meddles with it.
    pub(crate) fn restart(&self) {
        let mut hands = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *hands = Hands { restarts: hands.restarts.wrapping_add(1), ..Hands::default() };
    }

    /// Does what is asked for.
    ///
    /// # Errors
    /// What is out of range, and what is allowed.
    pub fn change(&self, order: &WorldOrder) -> Result<(), String> {
        let mut hands = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut wanted = *hands;
        match *order {
            WorldOrder::Battery { volts } => wanted.emf_v = within("a battery", volts, BATTERY_V, "V")?,
            WorldOrder::Torque { motor, nm } => {
                on(&mut wanted, motor)?.torque_nm = within("a torque", nm, TORQUE_NM, "N m")?;
            }
            WorldOrder::Inertia { motor, kg_m2 } => {
                let inertia = within("a moment of inertia", kg_m2, INERTIA_KG_M2, "kg m²")?;
                on(&mut wanted, motor)?.inertia_kg_m2 = inertia;
            }
            WorldOrder::Hold { motor, held } => on(&mut wanted, motor)?.held = held,
            WorldOrder::Encoder { motor, is } => on(&mut wanted, motor)?.encoder = Some(is.into()),
            WorldOrder::Reset => wanted = Hands { restarts: wanted.restarts, ..Hands::default() },
        }
        *hands = wanted;
        Ok(())
    }
}

fn on(hands: &mut Hands, motor: u8) -> Result<&mut OnMotor, String> {
    hands
        .motors
        .get_mut(usize::from(motor))
        .ok_or_else(|| format!("there is no motor {motor}; there are 0 to 3"))
}

fn within(
    what: &str,
    value: Option<f64>,
    allowed: RangeInclusive<f64>,
    unit: &str,
) -> Result<Option<f64>, String> {
    match value {
        Some(value) if !allowed.contains(&value) => Err(format!(
            "{what} of {value} {unit} is out of range; allowed is {} to {} {unit}",
            allowed.start(),
            allowed.end()
        )),
        value => Ok(value),
    }
}
