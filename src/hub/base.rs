//! The drive base of a hub: odometry of a left and a right wheel, and corrections of the wheels by the heading of a
//! gyro.
//!
//! With a gyro the wheels of the base have *corrected positions*: the counts that the encoders would have if the wheels
//! had turned the base exactly as the gyro says. The *correction* of a wheel is its encoder's position minus the
//! corrected position. The group of both wheels is controlled in corrected positions, so a straight course stays
//! straight, and a turn ends at its angle. Without a gyro, and for all other groups, the correction is 0.
//!
//! ```text
//!         first reading       no reading for 100 ms
//! Waiting -------------> Good <-------------------> Lost
//!                          | does not turn with the wheels
//!                          '----------------------------> Implausible
//! ```
//!
//! A gyro stays implausible until the base is configured again. A base without a gyro has the state `Unused`. While the
//! gyro is lost or implausible, the correction keeps its last value, and the heading is computed from the encoders. A
//! gyro that is mounted upside down would turn the base faster and faster. Therefore the speed of the correction is
//! limited, and the turns of gyro and wheels are compared.

use crate::group::{BaseSettings, GyroState, Odometry};
use crate::units::Micros;

/// Age in microseconds beyond which a reading of the gyro is not used. The limit leaves time for a host's transfers on
/// the gyro's bus.
const GYRO_TIMEOUT_US: u64 = 100_000;

/// Largest speed at which the correction changes, in degrees of the base's heading per second. A slip of 5 % in turns
/// of 360 degrees per second needs 18 degrees per second.
const CORRECTION_DEGREES_PER_S: f64 = 45.0;

/// A reading of a gyro.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyroReading {
    /// Angle by which the base has turned left since the start of the gyro, in degrees. The angle wraps at 360 degrees.
    pub left_degrees: f32,
    /// Time of the reading.
    pub at: Micros,
}

/// State of a drive base.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BaseState {
    /// Distance forward from the start in micrometres, limited to 32 bits: +-2147 m.
    pub x_um: i32,
    /// Distance to the left of the start in micrometres, limited to 32 bits: +-2147 m.
    pub y_um: i32,
    /// Angle by which the base has turned left, in 1/1000 degree. The angle does not wrap at 360 degrees, and is
    /// limited to 32 bits: +-5965 turns.
    pub heading_millidegrees: i32,
    /// Correction of the left and of the right wheel in counts.
    pub correction: [i32; 2],
    /// State of the gyro.
    pub gyro: GyroState,
    /// Number of times that the gyro was lost since the base was configured.
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
    /// Time of the reading of the gyro at the last step. `None` if this step had no fresh reading.
    read_at: Option<Micros>,
    /// Time of the last step.
    stepped_at: Micros,
    /// Slip that the correction makes up for, in degrees of the base's heading. The value follows the wheels' slip at a
    /// limited speed.
    corrected_degrees: f64,
    /// Correction of the left and of the right wheel in counts, computed from `corrected_degrees`.
    correction: [i32; 2],
    turns: Turns,
}

/// Comparison of the turn by the gyro with the turn by the wheels. The motion is divided into *parts* of 100 ms. A part
/// counts if the wheels have turned the base by at least 1.5 degrees. After 30 degrees in counted parts the sums of
/// both turns are compared.
#[derive(Clone, Copy, Debug)]
struct Turns {
    /// Time at the start of the present part of the motion.
    since: Micros,
    /// Heading by the gyro at the start of the present part, in degrees.
    heading: f64,
    /// Heading by the wheels at the start of the present part, in degrees.
    by_wheels: f64,
    /// Sum of the magnitudes of the turns by the wheels in the counted parts, in degrees.
    wheels_degrees: f64,
    /// Sum of the turns by the gyro in the counted parts, in degrees. A turn in the direction of the wheels is
    /// positive.
    gyro_degrees: f64,
}

impl Turns {
    /// Length of a part, in microseconds: ten readings of the gyro.
    const PART_US: u64 = 100_000;
    /// Smallest turn by the wheels, in degrees, in a part that counts. The limit excludes a straight course of wheels
    /// with unequal diameters. If the diameters differ by 5 % and the base moves by five track widths per second, the
    /// wheels seem to turn the base by 1.4 degrees in a part.
    const LEAST_DEGREES: f64 = 1.5;
    /// Sum of the counted turns by the wheels, in degrees, at which the turn by the gyro is compared with this sum.
    const JUDGED_DEGREES: f64 = 30.0;
    /// Smallest turn by a plausible gyro, as a share of the turn by the wheels. A working gyro also counts as
    /// implausible if the wheels slip by more than 70 % of their turn.
    const LEAST_SHARE: f64 = 0.3;

    /// The state before the first turn.
    const NONE: Self =
        Self { since: Micros::new(0), heading: 0.0, by_wheels: 0.0, wheels_degrees: 0.0, gyro_degrees: 0.0 };

    /// Compares the heading by the gyro with the heading by the wheels, both in degrees. Returns false if the gyro does
    /// not turn with the wheels.
    fn step(&mut self, now: Micros, heading: f64, by_wheels: f64) -> bool {
        if now.since(self.since) < Self::PART_US {
            return true;
        }
        let (turned_by_gyro, turned) = (heading - self.heading, by_wheels - self.by_wheels);
        (self.since, self.heading, self.by_wheels) = (now, heading, by_wheels);
        if turned.abs() >= Self::LEAST_DEGREES {
            self.wheels_degrees += turned.abs();
            self.gyro_degrees += turned_by_gyro * turned.signum();
        }
        if self.wheels_degrees < Self::JUDGED_DEGREES {
            return true;
        }
        let is_plausible = self.gyro_degrees >= Self::LEAST_SHARE * self.wheels_degrees;
        (self.wheels_degrees, self.gyro_degrees) = (0.0, 0.0);
        is_plausible
    }
}

impl Base {
    pub(super) const fn new(settings: BaseSettings) -> Self {
        let gyro = if settings.use_gyro { GyroState::Waiting } else { GyroState::Unused };
        Self {
            settings,
            odometry: None,
            gyro,
            losses: 0,
            read_at: None,
            stepped_at: Micros::new(0),
            corrected_degrees: 0.0,
            correction: [0; 2],
            turns: Turns::NONE,
        }
    }

    pub(super) const fn uses_gyro(&self) -> bool {
        self.settings.use_gyro
    }

    /// Returns for each motor whether it drives a wheel of the base.
    pub(super) fn wheels<const N: usize>(&self) -> [bool; N] {
        core::array::from_fn(|motor| self.settings.wheels.iter().any(|wheel| usize::from(*wheel) == motor))
    }

    /// Updates the odometry. `positions` are the positions of all motors in counts, `None` before the first reading of
    /// an encoder.
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
        let is_used = self.settings.use_gyro && self.gyro != GyroState::Implausible;
        let fresh = gyro.filter(|gyro| is_used && now.since(gyro.at) <= GYRO_TIMEOUT_US);
        match (self.gyro, fresh) {
            (GyroState::Good, Some(_)) => (),
            (_, Some(_)) => {
                self.gyro = GyroState::Good;
                let pose = odometry.pose();
                let by_wheels = pose.heading_degrees + odometry.slip_degrees();
                let heading = pose.heading_degrees;
                self.turns = Turns { since: now, heading, by_wheels, ..Turns::NONE };
            }
            (GyroState::Good, None) => {
                self.gyro = GyroState::Lost;
                self.losses = self.losses.saturating_add(1);
                odometry.lose_gyro();
            }
            (_, None) => (),
        }
        let new = fresh.filter(|gyro| self.read_at != Some(gyro.at));
        self.read_at = fresh.map(|gyro| gyro.at);
        let heading =
            odometry.step([left, right], new.map(|gyro| f64::from(gyro.left_degrees))).heading_degrees;
        let slip = odometry.slip_degrees();
        if self.gyro == GyroState::Good && !self.turns.step(now, heading, heading + slip) {
            self.gyro = GyroState::Implausible;
            odometry.lose_gyro();
        }
        let step_s = now.since(self.stepped_at) as f64 / 1e6;
        self.stepped_at = now;
        if self.gyro == GyroState::Good {
            let most = CORRECTION_DEGREES_PER_S * step_s;
            self.corrected_degrees += (slip - self.corrected_degrees).clamp(-most, most);
            // `turn` fails only if a correction does not fit in 32 bits. The last correction then stays. No base with
            // plausible dimensions slips by so many counts.
            self.correction = geometry.turn(self.corrected_degrees).unwrap_or(self.correction);
        }
    }

    /// Returns the correction of each motor for a group that has started with these members.
    pub(super) fn corrections<const N: usize>(&self, members: &[bool; N]) -> [i32; N] {
        let mut corrections = [0; N];
        if *members == self.wheels::<N>() {
            for (wheel, correction) in self.settings.wheels.into_iter().zip(self.correction) {
                if let Some(slot) = corrections.get_mut(usize::from(wheel)) {
                    *slot = correction;
                }
            }
        }
        corrections
    }

    pub(super) fn state(&self) -> BaseState {
        let pose = self.odometry.map(|odometry| odometry.pose()).unwrap_or_default();
        // The conversion of a float to an integer saturates.
        let thousandths = |value: f64| libm::round(1e3 * value) as i32;
        BaseState {
            x_um: thousandths(pose.x_mm),
            y_um: thousandths(pose.y_mm),
            heading_millidegrees: thousandths(pose.heading_degrees),
            correction: self.correction,
            gyro: self.gyro,
            losses: self.losses,
        }
    }
}
