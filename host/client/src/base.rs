//! Commands to a drive base: two wheels whose motors move as a group, with odometry and a gyro.
//!
//! ```
//! use motor_hub_client::motor_hub::group::{BaseSettings, DriveBase, GyroState};
//! use motor_hub_client::motor_hub::hub::BaseState;
//! use motor_hub_client::motor_hub::protocol::Address;
//! use motor_hub_client::{Session, memory::MemoryHub};
//! use std::time::Duration;
//!
//! // The hub in memory does not drive. It reports that the base stands at its start.
//! let mut hub = MemoryHub::default();
//! hub.snapshot.base = Some(BaseState::default());
//! let mut session = Session::new(hub, Address::DEFAULT, Duration::from_secs(1));
//! let refused = session.odometry().unwrap_err().to_string();
//! assert_eq!(refused, "the hub refuses to report where its drive base is: no drive base is configured (NACK 82)");
//!
//! let base = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0, -1680.0] };
//! assert_eq!(session.base_if_reported()?, None);
//! let settings = BaseSettings::new([0, 1], &base, false)?;
//! session.set_base(settings)?;
//! assert_eq!(session.base_if_reported()?, Some(settings));
//! let report = session.odometry()?;
//! assert_eq!((report.x_um, report.gyro), (0, GyroState::Unused));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::error::none_if_unsupported;
use crate::{Error, Session};
use motor_hub::extension::HubFunction;
use motor_hub::extension::base::OdometryReport;
use motor_hub::extension::group::GroupCourse;
use motor_hub::group::{BaseSettings, DriveBase, GroupCommand, GyroState};
use motor_hub::protocol::CHANNELS;
use motor_hub::units::{Acceleration, CountsPerSecond, RangeError};
use serde::Serialize;

/// A part of a base's course.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part {
    /// A distance in mm, negative backward.
    Straight(f64),
    /// An angle in degrees, positive to the left.
    Turn(f64),
}

impl Part {
    /// Returns the positions of the wheels at the end of the part, and the command that moves the wheels there. `from`
    /// are the positions at the start of the part. Positions are corrected positions in counts: see
    /// [`OdometryReport::counts`]. They are not rounded, so a host that passes the end of a part as the start of the next
    /// part adds up no rounding errors. Speed and acceleration apply to the wheels, in mm/s and mm/s².
    ///
    /// # Errors
    /// A distance, a speed or an acceleration is out of range.
    pub fn command(
        self,
        base: &BaseSettings,
        from: [f64; 2],
        speed_mm_per_s: f64,
        acceleration_mm_per_s2: f64,
    ) -> Result<([f64; 2], GroupCommand<GroupCourse>), RangeError> {
        let geometry = base.geometry();
        let (mm, degrees) = match self {
            Self::Straight(mm) => (mm, 0.0),
            Self::Turn(degrees) => (0.0, degrees),
        };
        // Only the length is checked here: positions wrap.
        geometry.arc(mm, degrees)?;
        let [from_left, from_right] = from;
        let [left, right] = geometry.counts(mm, degrees);
        let to = [from_left + left, from_right + right];
        let mut course = [None; CHANNELS];
        for (wheel, counts) in base.wheels.into_iter().zip(to) {
            if let Some(slot) = course.get_mut(usize::from(wheel)) {
                *slot = Some(whole(counts));
            }
        }
        // The group applies both limits to the wheel that moves most.
        let speed = CountsPerSecond::from_rpm(60.0 * most_counts(&geometry, speed_mm_per_s), 1.0)?;
        let acceleration = most_counts(&geometry, acceleration_mm_per_s2).round().max(1.0);
        if acceleration > f64::from(u32::MAX) {
            return Err(RangeError::Acceleration);
        }
        let acceleration = Acceleration::new(acceleration as u32)?;
        Ok((to, GroupCommand::new(GroupCourse::Position(course), speed, acceleration)))
    }
}

/// Returns the counts of the wheel with more counts on a straight distance in mm, not negative and not rounded.
pub fn most_counts(base: &DriveBase, mm: f64) -> f64 {
    base.counts(mm, 0.0).into_iter().map(f64::abs).fold(0.0, f64::max)
}

/// Rounds a position to whole counts. Positions wrap.
fn whole(counts: f64) -> i32 {
    counts.round() as i64 as i32
}

/// Odometry of a drive base in mm and degrees, with names for display and JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OdometryValues {
    /// Distance forward from the start in mm.
    pub x_mm: f64,
    /// Distance to the left of the start in mm.
    pub y_mm: f64,
    /// Angle by which the base has turned left, in degrees. The angle includes whole turns, so it may exceed 360
    /// degrees.
    pub heading_degrees: f64,
    /// Corrected positions of the left and the right wheel in counts: see [`OdometryReport::counts`].
    pub counts: [i32; 2],
    /// State of the gyro: `unused`, `waiting`, `good`, `lost` or `implausible`.
    pub gyro: &'static str,
    /// Number of times that the gyro was lost.
    pub gyro_losses: u32,
}

impl OdometryValues {
    /// Returns the values of a report.
    pub fn of(report: &OdometryReport) -> Self {
        let gyro = match report.gyro {
            GyroState::Unused => "unused",
            GyroState::Waiting => "waiting",
            GyroState::Good => "good",
            GyroState::Lost => "lost",
            GyroState::Implausible => "implausible",
        };
        Self {
            x_mm: f64::from(report.x_um) / 1e3,
            y_mm: f64::from(report.y_um) / 1e3,
            heading_degrees: f64::from(report.heading_millidegrees) / 1e3,
            counts: report.counts,
            gyro,
            gyro_losses: report.losses.into(),
        }
    }
}

/// Text that says what measures the heading of a drive base.
#[must_use]
pub const fn heading_text(gyro: GyroState) -> &'static str {
    match gyro {
        GyroState::Unused => "by the encoders",
        GyroState::Waiting => "by the encoders: the gyro has given no reading yet",
        GyroState::Good => "by the gyro",
        GyroState::Lost => "by the encoders: the gyro is lost",
        GyroState::Implausible => "by the encoders: the gyro did not turn with the wheels",
    }
}

impl Session {
    /// Configures the drive base, and waits until the hub has applied the settings. The odometry of the base then
    /// starts at the origin. Both motors must be disabled. Needs this project's firmware.
    ///
    /// # Errors
    /// [`Error::Refused`] if the hub lacks a motor, or an I2C bus for the gyro. See also [`Session::request`].
    pub fn set_base(&mut self, base: BaseSettings) -> Result<(), Error> {
        self.command(HubFunction::SetBase { base })?;
        self.catch_up()
    }

    /// Settings of the drive base in force. `None` if no base is configured, or if the firmware does not report the
    /// base.
    pub fn base_if_reported(&mut self) -> Result<Option<BaseSettings>, Error> {
        none_if_unsupported(self.request(HubFunction::Base))
    }

    /// Position and heading of the drive base, and state of its gyro. Needs this project's firmware.
    ///
    /// # Errors
    /// [`Error::Refused`] if no base is configured. See also [`Session::request`].
    pub fn odometry(&mut self) -> Result<OdometryReport, Error> {
        self.request(HubFunction::Odometry)
    }

    /// Positions of all motors in counts, to which a host adds the distances that a group of these members shall move.
    /// For exactly the two wheels of a drive base with a gyro they are corrected positions, because the hub takes the
    /// targets of this group as corrected positions: see [`OdometryReport::counts`]. For all other motors they are the
    /// positions of the encoders.
    pub fn group_positions(&mut self, members: [bool; CHANNELS]) -> Result<[i32; CHANNELS], Error> {
        let mut positions = self.bulk()?.encoders;
        let Some(base) = self.base_if_reported()?.filter(|base| base.use_gyro) else { return Ok(positions) };
        let is_wheel = |motor: usize| base.wheels.iter().any(|wheel| usize::from(*wheel) == motor);
        if members == std::array::from_fn(is_wheel) {
            for (wheel, counts) in base.wheels.into_iter().zip(self.odometry()?.counts) {
                if let Some(position) = positions.get_mut(usize::from(wheel)) {
                    *position = counts;
                }
            }
        }
        Ok(positions)
    }
}
