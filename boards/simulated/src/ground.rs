//! True position and heading of a drive base, computed from the angles of its wheels.
//!
//! ```
//! use simulated::ground::{Floor, Ground};
//!
//! // Both wheels turn once, each 90 mm in diameter.
//! let mut ground = Ground::new(Floor::default());
//! ground.turn([std::f64::consts::TAU; 2]);
//! assert!((ground.pose().x_mm - 282.743).abs() < 0.001);
//! ```

use crate::hardware::{TRACK_MM, WHEEL_DIAMETER_MM};
use crate::scenario::numbers::{Length, Slip, WithinMillion, within};
use motor_hub::group::Pose;
use serde::{Deserialize, Deserializer};

/// True dimensions of the drive base, and how the wheels slip.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Floor {
    /// Diameters of the left and the right wheel in mm. Negative for a wheel that drives backward when its motor turns
    /// CW.
    #[serde(deserialize_with = "wheel_diameters")]
    pub wheel_diameters_mm: [f64; 2],
    /// Distance between the centres of the wheels in mm.
    #[serde(deserialize_with = "within::<Length, _, _>")]
    pub track_mm: f64,
    /// Share of each turn of the base that is lost because the wheels slip, 0 to 0.9. The travelled distance is
    /// not reduced.
    #[serde(deserialize_with = "within::<Slip, _, _>")]
    pub slip_in_turns: f64,
}

impl Default for Floor {
    /// Equal wheels without slip, with the dimensions of the simulated board.
    fn default() -> Self {
        Self { wheel_diameters_mm: [WHEEL_DIAMETER_MM; 2], track_mm: TRACK_MM, slip_in_turns: 0.0 }
    }
}

/// Reads the diameters of both wheels.
fn wheel_diameters<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 2], D::Error> {
    <[WithinMillion; 2]>::deserialize(from).map(|diameters_mm| diameters_mm.map(f64::from))
}

/// A drive base on its floor.
#[derive(Clone, Debug)]
pub struct Ground {
    floor: Floor,
    /// Angles of the wheels in radians.
    wheels_rad: [f64; 2],
    pose: Pose,
}

impl Ground {
    /// A base at the origin.
    pub const fn new(floor: Floor) -> Self {
        let pose = Pose { x_mm: 0.0, y_mm: 0.0, heading_degrees: 0.0 };
        Self { floor, wheels_rad: [0.0; 2], pose }
    }

    /// Turns the left and the right wheel to these angles, in radians.
    pub fn turn(&mut self, wheels_rad: [f64; 2]) {
        let Floor { wheel_diameters_mm: [left_mm, right_mm], track_mm, slip_in_turns } = self.floor;
        let [last_left, last_right] = std::mem::replace(&mut self.wheels_rad, wheels_rad);
        let [left, right] = wheels_rad;
        let left_mm = 0.5 * left_mm * (left - last_left);
        let right_mm = 0.5 * right_mm * (right - last_right);
        let turned_rad = (right_mm - left_mm) / track_mm * (1.0 - slip_in_turns);
        let (sin, cos) = (self.pose.heading_degrees.to_radians() + 0.5 * turned_rad).sin_cos();
        self.pose.x_mm += 0.5 * (left_mm + right_mm) * cos;
        self.pose.y_mm += 0.5 * (left_mm + right_mm) * sin;
        self.pose.heading_degrees += turned_rad.to_degrees();
    }

    /// True position and heading of the base.
    pub const fn pose(&self) -> Pose {
        self.pose
    }
}
