//! The trajectory of a group. Computes the progress of the group, and from the progress the reference of each member.
//!
//! Apart from drift, all members start and stop together, and the ratios of their speeds are constant. With all
//! quantities in counts, the reference of member i is:
//!
//! ```text
//!     reference[i] = base[i] + (share[i] - start_offset[i]) * progress / length - drift[i]
//! ```
//!
//! * The *base* is the position at progress 0 once the drift has ended. The *start offset* is the signed distance from
//!   the nearest whole count to the base.
//! * A *share* is the signed distance that a member moves along the whole trajectory. A motor that is not a member has
//!   the share 0. `length` is the magnitude of the largest share. In a trajectory without end the shares are the speeds
//!   in 1/256 counts/s: only their ratios matter.
//! * *Progress* is the distance that the member with the largest share has moved along the trajectory. The code stores
//!   progress, base, start offset and drift in steps of 2^-16 counts.
//! * *Drift* is the part of an earlier motion that a new trajectory cannot continue. A trajectory without end continues
//!   the part of the old speeds that is parallel to its direction, forwards or backwards. The rest of the old speeds
//!   drifts. A trajectory to positions continues the old speeds only if they are nearly parallel to its direction and
//!   the members can stop within its length. Otherwise all old speeds drift. Usually the drift is braked to 0 while the
//!   progress begins. If the new positions are close, the drift is braked first, and the progress begins after the
//!   drift. `drift[i]` is the distance that member i will still drift.
//!
//! Progress and positions are integers, and all members have the same progress, so no rounding error grows with the
//! distance. A trajectory without end consists of *rounds*: whenever the progress has covered `length`, the base moves
//! by the shares, and the progress starts again at 0.

use super::Reference;
use crate::units::single::at_least;
use crate::units::{Acceleration, CountsPerSecond};
use libm::{roundf, sqrtf};

/// Steps of position and progress in one count.
const STEPS_PER_COUNT: f32 = 65_536.0;
/// Distance from the end, in steps, below which a trajectory is finished: 1/1024 count.
const END_TOLERANCE_STEPS: i64 = 64;
/// Least speed, in counts/s, at which motors approach their references if their first trajectory only stops them: 24
/// counts in 0.1 s, the smallest [`default_lag`](super::default_lag) in its time.
const LEAST_FIRST_CPS: f32 = 240.0;

/// Share of the acceleration a that the members would need to stop from their speed v at the new positions. Above this
/// share a trajectory that cannot continue the old speeds brakes the drift first, because that takes less time. Braking
/// first takes v/a, and then 2 sqrt(rest/a) for the remaining distance. Drift and progress at the same time take 2 v/a.
/// At 2/3 both times are equal, because the remaining distance is then v²/(4 a).
const BRAKES_FIRST_SHARE: f32 = 2.0 / 3.0;

/// A trajectory of N motors. Arrays are by motor.
#[derive(Clone, Debug)]
pub(super) struct Trajectory<const N: usize> {
    /// Position of each motor at progress 0, in steps: after the drift, and at the start of the present round of a
    /// trajectory without end.
    base: [i64; N],
    /// Distance that a motor moves while the progress covers `length`, in counts.
    share: [i32; N],
    /// Distance from the nearest whole count to the base, in steps. The trajectory removes this distance gradually
    /// along its length, so that the trajectory ends at a whole count.
    start_offset: [i32; N],
    /// Magnitude of the largest share, at least 1.
    length: i64,
    /// True if the trajectory has no end.
    endless: bool,
    /// Progress of the member that moves farthest, in steps.
    progress: i64,
    /// Speed of the progress in counts/s.
    speed_cps: f32,
    /// Speed in counts/s that the progress accelerates to. A trajectory that only stops keeps the speed of the
    /// trajectory before, at which its motors approach their references.
    speed_limit_cps: f32,
    /// Largest acceleration of the member that moves farthest, in counts/s².
    acceleration_cps2: f32,
    /// Deceleration of the drift in counts/s².
    drift_deceleration_cps2: [f32; N],
    /// Time until the drift has come to rest, in seconds; 0 without drift.
    drift_s: f32,
    /// True if the whole acceleration brakes the drift, and the progress begins after the drift. Also true for a group
    /// that only stops.
    brakes_first: bool,
}

impl<const N: usize> Trajectory<N> {
    /// Creates a trajectory that brakes from these positions and speeds (in counts/s) to a stop. The trajectory brakes
    /// with half of the acceleration. The caller must call [`turn_at`](Self::turn_at) or [`move_to`](Self::move_to)
    /// immediately.
    pub(super) fn new(positions: [i32; N], speeds_cps: [f32; N], acceleration: Acceleration) -> Self {
        let mut trajectory = Self {
            base: positions.map(|position| i64::from(position) << 16),
            share: [0; N],
            start_offset: [0; N],
            length: 1,
            endless: true,
            progress: 0,
            speed_cps: 0.0,
            speed_limit_cps: at_least(largest(&speeds_cps), LEAST_FIRST_CPS),
            acceleration_cps2: acceleration.get() as f32,
            drift_deceleration_cps2: [0.0; N],
            drift_s: 0.0,
            brakes_first: false,
        };
        trajectory.start_drift(speeds_cps);
        trajectory
    }

    /// Changes the largest acceleration of the member that moves farthest. Returns true if the acceleration stays.
    pub(super) const fn set_acceleration(&mut self, acceleration: Acceleration) -> bool {
        let new = acceleration.get() as f32;
        core::mem::replace(&mut self.acceleration_cps2, new).to_bits() == new.to_bits()
    }

    /// Makes the motors turn at these speeds without end, starting from the present references and speeds. If all
    /// speeds are 0, the group brakes to a stop.
    pub(super) fn turn_at(&mut self, speeds: [CountsPerSecond; N]) {
        let present_cps = self.restart();
        self.endless = true;
        self.share = speeds.map(CountsPerSecond::to_bits);
        self.update_length();
        self.brakes_first = self.is_still();
        if !self.brakes_first {
            // A share is the bits of a speed: steps of 1/256 counts/s.
            self.speed_limit_cps = self.length as f32 / 256.0;
        }
        let (along, sideways) = split(&present_cps, &self.direction());
        self.speed_cps = along;
        self.start_drift(sideways);
    }

    /// Makes the motors move to these positions in counts and stop there, starting from the present references and
    /// speeds. A motor that is no member has its present position as target. `speed_cps` is the speed of the member
    /// that moves farthest, in counts/s. `tick_s` is a tick in seconds.
    pub(super) fn move_to(&mut self, targets: [i32; N], speed_cps: f32, tick_s: f32) {
        let present_cps = self.restart();
        (self.endless, self.speed_limit_cps, self.brakes_first) = (false, speed_cps.abs(), false);
        self.head_for(&targets);
        let (along, sideways) = split(&present_cps, &self.direction());
        // The share of the acceleration with which the progress would stop at its end.
        let share = along * along / (2.0 * self.acceleration_cps2 * self.length as f32);
        // The sideways speeds are neglected if none of them is above a quarter of the largest speed change in a tick.
        if along == 0.0 || share > 1.0 || largest(&sideways) > self.acceleration_cps2 * tick_s / 4.0 {
            self.brakes_first = along > 0.0 && share > BRAKES_FIRST_SHARE;
            self.start_drift(present_cps);
            // The drift has moved the base.
            self.head_for(&targets);
        } else {
            self.start_drift([0.0; N]);
            self.speed_cps = along;
        }
    }

    /// True if the trajectory ends at these positions in counts, and has this largest speed in counts/s.
    pub(super) fn leads_to(&self, targets: &[i32; N], speed_cps: f32) -> bool {
        let mut ends = self.base.iter().zip(&self.start_offset).zip(&self.share).zip(targets);
        !self.endless
            && self.speed_limit_cps.to_bits() == speed_cps.abs().to_bits()
            && ends.all(|(((base, start_offset), share), target)| {
                let start = (base.wrapping_sub(i64::from(*start_offset)) >> 16) as i32;
                start.wrapping_add(*share) == *target
            })
    }

    /// Removes a motor. Its speed then neither slows nor prolongs a later change of the motion.
    pub(super) fn remove(&mut self, motor: usize) {
        if let Some(share) = self.share.get_mut(motor) {
            *share = 0;
        }
        if let Some(deceleration) = self.drift_deceleration_cps2.get_mut(motor) {
            *deceleration = 0.0;
        }
    }

    /// Moves the base to the present references, at progress 0. Returns the present speeds in counts/s.
    fn restart(&mut self) -> [f32; N] {
        let speeds_cps = self.speeds_cps();
        self.base = self.references();
        (self.progress, self.speed_cps, self.start_offset) = (0, 0.0, [0; N]);
        speeds_cps
    }

    /// Sets shares and start offsets for a movement from the base to these positions. Positions wrap, and each motor
    /// takes the shorter direction.
    fn head_for(&mut self, targets: &[i32; N]) {
        let starts = self.base.iter().zip(&mut self.share).zip(&mut self.start_offset);
        for (((base, share), start_offset), target) in starts.zip(targets) {
            let whole = base.wrapping_add(1 << 15) >> 16;
            *start_offset = base.wrapping_sub(whole << 16) as i32;
            *share = target.wrapping_sub(whole as i32);
        }
        self.update_length();
    }

    fn update_length(&mut self) {
        let longest = self.share.iter().map(|share| share.unsigned_abs()).max();
        self.length = i64::from(longest.unwrap_or_default().max(1));
    }

    /// Returns how far each motor moves while the progress is one count: -1 to 1.
    fn direction(&self) -> [f32; N] {
        self.share.map(|share| share as f32 / self.length as f32)
    }

    /// True if no motor moves.
    fn is_still(&self) -> bool {
        self.share == [0; N]
    }

    /// Starts a drift from the base at these speeds, and moves the base to where the drift comes to rest.
    fn start_drift(&mut self, speeds_cps: [f32; N]) {
        self.drift_s = largest(&speeds_cps) / self.drift_acceleration_cps2();
        let per_second = if self.drift_s > 0.0 { 1.0 / self.drift_s } else { 0.0 };
        self.drift_deceleration_cps2 = speeds_cps.map(|speed| speed * per_second);
        let drifts = self.drifts();
        for (base, drift) in self.base.iter_mut().zip(drifts) {
            *base = base.wrapping_add(drift);
        }
    }

    /// Returns the part of the acceleration that brakes the drift. The rest is available to the progress.
    fn drift_acceleration_cps2(&self) -> f32 {
        if self.brakes_first { self.acceleration_cps2 } else { self.acceleration_cps2 / 2.0 }
    }

    /// Returns how far each motor will still drift, in steps.
    fn drifts(&self) -> [i64; N] {
        let steps_per_deceleration = STEPS_PER_COUNT * self.drift_s * self.drift_s / 2.0;
        self.drift_deceleration_cps2.map(|deceleration| roundf(deceleration * steps_per_deceleration) as i64)
    }

    /// True if the references have come to rest at the end. A trajectory that only stops the group is at its end when
    /// the drift has ended.
    pub(super) fn is_at_end(&self) -> bool {
        let at_end = if self.endless { self.is_still() } else { self.progress == self.length << 16 };
        at_end && self.drift_s <= 0.0
    }

    /// Returns the position at which each motor should be, in steps.
    pub(super) fn references(&self) -> [i64; N] {
        let (whole, part) = (self.progress >> 16, self.progress & 0xFFFF);
        let mut references = self.base;
        let moves = self.share.iter().zip(&self.start_offset).zip(self.drifts());
        for (reference, ((share, start_offset), drift)) in references.iter_mut().zip(moves) {
            let share = i64::from(*share);
            // The products have at most 62 and 48 bits. The divisions never fail, because the length is at least 1.
            let moved = share * whole;
            let counts = moved.checked_div(self.length).unwrap_or_default();
            let rest =
                ((moved - counts * self.length) << 16) + share * part - i64::from(*start_offset) * whole;
            let rest = rest.checked_div(self.length).unwrap_or_default();
            *reference = reference.wrapping_add((counts << 16) + rest - drift);
        }
        references
    }

    /// Returns the speed that each motor should have, in counts/s.
    pub(super) fn speeds_cps(&self) -> [f32; N] {
        let speed_per_share = self.speed_cps / self.length as f32;
        let mut speeds = self.drift_deceleration_cps2.map(|deceleration| deceleration * self.drift_s);
        for (speed, share) in speeds.iter_mut().zip(&self.share) {
            *speed += *share as f32 * speed_per_share;
        }
        speeds
    }

    /// Returns the largest speed at which a motor approaches its reference.
    pub(super) fn speed_limit(&self) -> CountsPerSecond {
        CountsPerSecond::from_f32(self.speed_limit_cps)
    }

    /// Advances the trajectory by a time in seconds.
    pub(super) fn step(&mut self, seconds: f32) {
        let of_drift = if self.drift_s > 0.0 { self.drift_acceleration_cps2() } else { 0.0 };
        let acceleration = self.acceleration_cps2 - of_drift;
        self.drift_s = (self.drift_s - seconds).max(0.0);
        let before = self.speed_cps;
        let speed_change = acceleration * seconds;
        let end = self.length << 16;
        let mut target_cps = self.speed_limit_cps;
        if !self.endless {
            // `rest` is the distance to the end, minus the distance that the old speed contributes to this step. The
            // new speed v contributes v * seconds / 2 to this step, and then needs v^2 / (2 a) to brake. `stoppable` is
            // the largest v whose two distances fit into `rest`.
            let rest = (end - self.progress) as f32 / STEPS_PER_COUNT - before * seconds / 2.0;
            let half_change = speed_change / 2.0;
            let stoppable =
                sqrtf(half_change * half_change + 2.0 * acceleration * rest.max(0.0)) - half_change;
            target_cps = target_cps.min(stoppable);
        }
        self.speed_cps = target_cps.min(before + speed_change).max(before - speed_change);
        self.progress += roundf(STEPS_PER_COUNT * seconds * (before + self.speed_cps) / 2.0) as i64;
        if self.endless {
            self.start_next_round();
        } else if end - self.progress < END_TOLERANCE_STEPS {
            (self.progress, self.speed_cps) = (end, 0.0);
        }
    }

    /// Moves the base of a trajectory without end by the shares of all rounds that the progress has covered.
    fn start_next_round(&mut self) {
        let rounds = self.progress.checked_div_euclid(self.length << 16).unwrap_or_default();
        if rounds != 0 {
            for (base, share) in self.base.iter_mut().zip(&self.share) {
                *base = base.wrapping_add((i64::from(*share) * rounds) << 16);
            }
            self.progress -= rounds * (self.length << 16);
        }
    }
}

/// Builds a reference from a position in steps, the speeds in counts/s now and at the next tick, and the largest speed
/// at which a motor approaches the reference.
pub(super) fn reference(
    position_steps: i64,
    now_cps: f32,
    next_cps: f32,
    speed_limit: CountsPerSecond,
) -> Reference {
    Reference {
        // The conversion wraps, as positions do.
        position: (position_steps >> 16) as i32,
        fraction: position_steps as u16,
        speed: CountsPerSecond::from_f32(now_cps),
        next: CountsPerSecond::from_f32(next_cps),
        speed_limit,
    }
}

/// Returns the largest magnitude.
fn largest<const N: usize>(values: &[f32; N]) -> f32 {
    values.iter().fold(0.0, |most, value| value.abs().max(most))
}

/// Splits speeds into a part along a direction, and the remaining speeds. Returns the speed along the direction first.
fn split<const N: usize>(speeds: &[f32; N], direction: &[f32; N]) -> (f32, [f32; N]) {
    let product = |a: &[f32; N]| a.iter().zip(direction).map(|(a, b)| a * b).sum::<f32>();
    let square = product(direction);
    let along = if square > 0.0 { product(speeds) / square } else { 0.0 };
    let mut sideways = *speeds;
    for (speed, direction) in sideways.iter_mut().zip(direction) {
        *speed -= along * direction;
    }
    (along, sideways)
}
