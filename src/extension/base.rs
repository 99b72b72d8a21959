//! Requests to a drive base: its dimensions, and its odometry.
//!
//! A host moves the base as a group of its two wheels. With a gyro the targets of the group are *corrected positions*,
//! see [`OdometryReport::counts`].
//!
//! ```
//! use motor_hub::extension::{HubFunction, Request};
//! use motor_hub::group::{BaseSettings, DriveBase};
//!
//! let base = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0, -1680.0] };
//! let base = BaseSettings::new([0, 1], &base, true)?;
//! let request = Request::from(HubFunction::SetBase { base });
//! assert_eq!((request.id(), request.payload().len()), (0x4D22, 19));
//! # Ok::<(), motor_hub::units::RangeError>(())
//! ```

use crate::group::{BaseSettings, GyroState};
use crate::protocol::Nack;
use crate::protocol::payload::{Field, Fields, Payload, codes, payload};

codes!(GyroState { 0 = Unused, 1 = Waiting, 2 = Good, 3 = Lost, 4 = Implausible });

impl Field for BaseSettings {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let left = u8::read(fields)?;
        let right = fields.checked(|right: u8| (right != left).then_some(right))?;
        let mut length = || fields.checked(|um: u32| Self::LENGTHS_UM.contains(&um).then_some(um));
        let (wheel_diameter_um, track_um) = (length()?, length()?);
        let least = Self::LEAST_COUNTS_THOUSANDTHS;
        let mut counts = || fields.checked(|counts: i32| (counts.unsigned_abs() >= least).then_some(counts));
        let counts_per_turn_thousandths = [counts()?, counts()?];
        let (wheels, use_gyro) = ([left, right], bool::read(fields)?);
        Ok(Self { wheels, wheel_diameter_um, track_um, counts_per_turn_thousandths, use_gyro })
    }

    fn write(&self, payload: &mut Payload) {
        self.wheels.write(payload);
        self.wheel_diameter_um.write(payload);
        self.track_um.write(payload);
        self.counts_per_turn_thousandths.write(payload);
        self.use_gyro.write(payload);
    }
}

payload! {
    /// Position and heading of a drive base, measured from its place and direction when the base was configured.
    #[derive(Copy, Default)]
    pub struct OdometryReport {
        /// Distance forward from the start in micrometres.
        pub x_um: i32,
        /// Distance to the left of the start in micrometres.
        pub y_um: i32,
        /// Angle by which the base has turned left, in 1/1000 degree. The angle includes whole turns, so it may exceed
        /// 360 degrees.
        pub heading_millidegrees: i32,
        /// Corrected positions of the left and the right wheel, in the host's counts. The targets of a group of both
        /// wheels are corrected positions. Without a gyro the corrected positions are the positions of the encoders.
        pub counts: [i32; 2],
        /// State of the gyro.
        pub gyro: GyroState,
        /// Number of times that the gyro was lost.
        pub losses: u16,
    }
}
