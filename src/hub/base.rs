//! The drive base of a hub: its odometry, and how its wheels hold the heading of a gyro.
//!
//! With a gyro the wheels of the base have *corrected positions*: the counts that the encoders would have if the wheels had turned the
//! base exactly as the gyro says. The *correction* of a wheel is its encoder's position minus the corrected position. A group of both
//! wheels moves in corrected positions: so a straight course stays straight, and a turn ends at its angle. Without a gyro, and for all
//! other groups, the correction is 0.
//!
//! ```text
//!                  first reading           no reading for 100 ms
//! Unused  Waiting ---------------> Good <------------------------> Lost
//! ```
//!
//! While the gyro is lost the correction stays, and the base goes on by its encoders.

use crate::group::{BaseSettings, GyroState, Odometry};
use crate::units::Micros;

/// Longest age of a reading of the gyro, in microseconds: some transfers of hosts on the same bus may come first.
const GYRO_TIMEOUT_US: u64 = 100_000;

/// A reading of a gyro.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroReading {
    /// Angle by which the base has turned left since the start of the gyro, in degrees. It wraps at 360 degrees.
    pub left_degrees: f32,
    /// Time of the reading.
    pub at: Micros,
}

/// State of a drive base.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BaseState {
    /// Distance forward from the start in micrometres, limited to the range of the type.
    pub x_um: i32,
    /// Distance to the left of the start in micrometres, limited to the range of the type.
    pub y_um: i32,
    /// Angle by which the base has turned left, in 1/1000 degree. It counts whole turns, and is limited to the range of the type.
    pub heading_millidegrees: i32,
    /// Correction of the left and of the right wheel in counts.
    pub correction: [i32; 2],
    /// State of the gyro.
    pub gyro: GyroState,
    /// Number of times that the gyro was lost.
    pub losses: u16,
}

/// The drive base of a hub.
#[derive(Clone, Debug)]
pub(super) struct Base {
    settings: BaseSettings,
    /// `None` until both wheels have had a reading of their encoders.
    odometry: Option<Odometry>,
    gyro: GyroState,
    losses: u16,
    /// Time of the last reading of the gyro.
    read_at: Option<Micros>,
}

impl Base {
    pub(super) const fn new(settings: BaseSettings) -> Self {
        let gyro = if settings.use_gyro { GyroState::Waiting } else { GyroState::Unused };
        Self { settings, odometry: None, gyro, losses: 0, read_at: None }
    }

    pub(super) const fn uses_gyro(&self) -> bool {
        self.settings.use_gyro
    }

    /// Returns for each motor whether it drives a wheel of the base.
    pub(super) fn wheels<const N: usize>(&self) -> [bool; N] {
        core::array::from_fn(|motor| self.settings.wheels.iter().any(|wheel| usize::from(*wheel) == motor))
    }

    /// Updates the odometry. `positions` are the positions of all motors in counts, `None` before the first reading of an encoder.
    pub(super) fn step<const N: usize>(
        &mut self,
        now: Micros,
        positions: &[Option<i32>; N],
        gyro: Option<GyroReading>,
    ) {
        let [left, right] =
            self.settings.wheels.map(|wheel| positions.get(usize::from(wheel)).copied().flatten());
        let (Some(left), Some(right)) = (left, right) else { return };
        let geometry = self.settings.geometry();
        let odometry = self.odometry.get_or_insert_with(|| Odometry::new(geometry, [left, right]));
        let fresh = gyro.filter(|gyro| self.settings.use_gyro && now.since(gyro.at) <= GYRO_TIMEOUT_US);
        match (self.gyro, fresh) {
            (_, Some(_)) => self.gyro = GyroState::Good,
            (GyroState::Good, None) => {
                self.gyro = GyroState::Lost;
                self.losses = self.losses.saturating_add(1);
                odometry.lose_gyro();
            }
            (_, None) => (),
        }
        let new = fresh.filter(|gyro| self.read_at != Some(gyro.at));
        self.read_at = fresh.map(|gyro| gyro.at);
        odometry.step([left, right], new.map(|gyro| f64::from(gyro.left_degrees)));
    }

    /// Returns the corrections of the wheels in counts.
    fn wheel_corrections(&self) -> [i32; 2] {
        let slip_degrees = self.odometry.map_or(0.0, |odometry| odometry.slip_degrees());
        if self.settings.use_gyro {
            // A slip of more than 2^31 counts is not possible: a wheel has no more counts.
            self.settings.geometry().turn(slip_degrees).unwrap_or_default()
        } else {
            [0; 2]
        }
    }

    /// Returns the correction of each motor for a group with these members.
    pub(super) fn corrections<const N: usize>(&self, members: &[bool; N]) -> [i32; N] {
        let mut corrections = [0; N];
        if *members == self.wheels::<N>() {
            for (wheel, correction) in self.settings.wheels.into_iter().zip(self.wheel_corrections()) {
                if let Some(slot) = corrections.get_mut(usize::from(wheel)) {
                    *slot = correction;
                }
            }
        }
        corrections
    }

    pub(super) fn state(&self) -> BaseState {
        let pose = self.odometry.map(|odometry| odometry.pose()).unwrap_or_default();
        // The conversion saturates.
        let thousandths = |value: f64| libm::round(1e3 * value) as i32;
        BaseState {
            x_um: thousandths(pose.x_mm),
            y_um: thousandths(pose.y_mm),
            heading_millidegrees: thousandths(pose.heading_degrees),
            correction: self.wheel_corrections(),
            gyro: self.gyro,
            losses: self.losses,
        }
    }
}
