//! The distance that a healthy motor covers at least while its encoder is silent.
//!
//! A motor from rest ([`Expected::accelerate`]) accelerates by its gain times the drive voltage that the heaviest
//! friction leaves. A motor that turned steadily ([`Expected::keep_turning`]) keeps its load, and its speed v follows
//!
//! ```text
//! dv/dt = gain (drive_volts - resisting_volts - k v)
//! ```
//!
//! * *gain*: acceleration per volt, in counts/s² per V; the drive voltage is positive in the requested direction;
//! * *resisting volts*: the torque of load and friction against the motion, as the drive voltage that balances it;
//! * *k*: back EMF constant, in volts per count/s.

use super::Evidence;
use super::last_motion::SteadyMotion;
use crate::braking::Regime;

/// Limits of friction and load of a motor for 12 V; torques are in volts.
pub(super) struct LoadLimits {
    /// Largest resisting torque of friction. 40 % of 12 V, and a third more to break away, are 6.4 V. The value is 0.2 V
    /// above that.
    pub(super) friction_volts: f32,
    /// Largest change of a load: the stall torque at 12 V, and some 6 V for the heaviest friction.
    change_volts: f32,
    /// Largest distance, in counts, in which a load stops a motor that turned steadily until its last motion.
    stopping_counts: f32,
    /// Ratio of the torque that breaks a motor away to the torque that keeps it turning: a third more.
    breakaway_ratio: f32,
    /// Uncertainty of an estimated resisting torque, in volts.
    pub(super) uncertainty_volts: f32,
}

pub(super) const LOAD: LoadLimits = LoadLimits {
    friction_volts: 6.6,
    change_volts: 18.0,
    stopping_counts: 4.0,
    breakaway_ratio: 4.0 / 3.0,
    uncertainty_volts: 1.0,
};

/// The distance expected since the beginning of a silence or of a state, and the counts that came.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected {
    /// Time since the expectation began, in ms.
    pub(super) ms: u32,
    /// Counts that came, positive clockwise. Toggling by one count cancels out.
    pub(super) moved: i64,
    /// Least expected speed now, in counts/s; `None` before the first step.
    speed_cps: Option<f32>,
    /// Least expected distance, in counts.
    pub(super) distance_counts: f32,
    /// Time for which the drive voltage has exceeded the heaviest friction, in ms.
    pub(super) driven_ms: u32,
}

impl Expected {
    /// The expectation before the first step.
    pub(super) const NONE: Self =
        Self { ms: 0, moved: 0, speed_cps: None, distance_counts: 0.0, driven_ms: 0 };

    /// Restarts the expectation, and keeps the counts that came.
    pub(super) fn restart(self) -> Self {
        Self { moved: self.moved, ..Self::NONE }
    }

    /// Adds a step of a motor that accelerates from rest, in counts/s².
    ///
    /// `speed` is the motor's estimated speed in the requested direction. A motor that turns in the other direction
    /// must stop first. Speed in the requested direction is not relied on.
    pub(super) fn accelerate(self, ms: u32, moved: i32, acceleration: f32, speed: f32) -> Self {
        let before = self.speed_cps.map_or(speed.min(0.0), |expected| expected.max(speed.min(0.0)));
        self.add(ms, moved, before, before + acceleration.max(0.0) * seconds(ms))
    }

    /// Adds a step of a motor that keeps turning under its load.
    ///
    /// Speed increases by the least gain, and decreases by the estimated gain.
    pub(super) fn keep_turning(
        self,
        ms: u32,
        moved: i32,
        steady: &SteadyMotion,
        drive_volts: f32,
        evidence: &Evidence,
    ) -> Self {
        let before = self.speed_cps.unwrap_or(steady.speed_cps);
        let (mut volts, mut kappa) =
            (drive_volts - steady.resisting_volts(evidence), evidence.emf.to_volts());
        if evidence.order.regime == Regime::Braking {
            // The drive voltage of a brake is proportional to the speed.
            let speed = evidence.order.velocity.to_f32().abs().max(1.0);
            (volts, kappa) = (volts - drive_volts, (kappa - drive_volts / speed).max(0.0));
        }
        let least_gain = evidence.gain.unwrap_or(0.0).max(steady.least_gain());
        // Backward Euler: a long step is stable.
        let step = seconds(ms) * if volts > kappa * before { least_gain } else { evidence.volt };
        let speed = (before + step * volts) / (1.0 + step * kappa);
        if speed > 0.0 {
            self.add(ms, moved, before, speed)
        } else {
            // A healthy motor may have come to rest here, so the distance starts at 0 again.
            Self { speed_cps: Some(0.0), ..Self::NONE }
        }
    }

    /// Adds a step from the speed `before` to `speed`, in counts/s.
    fn add(self, ms: u32, moved: i32, before: f32, speed: f32) -> Self {
        Self {
            ms: self.ms.saturating_add(ms),
            moved: self.moved + i64::from(moved),
            speed_cps: Some(speed),
            distance_counts: self.distance_counts + f32::midpoint(before, speed) * seconds(ms),
            ..self
        }
    }
}

impl SteadyMotion {
    /// Least gain, in counts/s² per V, of a motor that a load has stopped from this speed within some counts.
    pub(super) fn least_gain(&self) -> f32 {
        self.speed_cps * self.speed_cps / (2.0 * LOAD.stopping_counts * LOAD.change_volts)
    }

    /// Largest resisting torque of the load that the motor turned under, in volts; below 0 for a load that drives the
    /// motor.
    pub(super) fn resisting_volts(&self, evidence: &Evidence) -> f32 {
        // The disturbance estimate lags behind a new load. The drive voltage beyond the back EMF does not.
        let load = (-self.disturbance_cps2 / evidence.volt)
            .max(self.drive_volts - evidence.emf.to_volts() * self.speed_cps);
        let resisting = load * if load > 0.0 { LOAD.breakaway_ratio } else { 1.0 } + LOAD.uncertainty_volts;
        resisting.min(LOAD.friction_volts)
    }
}

/// Converts milliseconds to seconds.
fn seconds(ms: u32) -> f32 {
    1e-3 * ms as f32
}
