//! Computes the least distance that a healthy motor covers in a silence of its encoder, or in a probe.
//!
//! The acceleration of a motor from rest ([`Expected::accelerate`]) is its gain times the drive voltage beyond the
//! resisting volts. In a silence the resisting volts of a motor from rest are [`Expected::FRICTION_VOLTS`]. A motor
//! that had a steady run ([`Expected::keep_turning`]) keeps the load of the run, and the speed v follows from
//!
//! ```text
//! dv/dt = gain (drive_volts - resisting_volts - kappa v)
//! ```
//!
//! * *gain*: acceleration per volt, in counts/s² per V;
//! * *drive volts*: mean voltage across the motor, positive in the requested direction;
//! * *resisting volts*: the torque of load and friction against the motion, as the drive voltage that balances it;
//! * *kappa*: back EMF constant, in volts per count/s.

use super::Command;
use super::last_motion::Run;
use crate::bridge::Mode;
use crate::regulator::{Context, Regulator};
use crate::units::CountsPerSecond;

/// Inputs of the encoder check at a tick.
#[derive(Clone, Copy)]
pub(super) struct Tick<'a> {
    /// Settings, control period, and battery voltage now.
    pub(super) context: &'a Context<'a>,
    /// Estimates now.
    pub(super) regulator: &'a Regulator,
    /// Command of the bridge since the last tick.
    pub(super) command: &'a Command,
    /// Speed that the last command should reach.
    pub(super) target: CountsPerSecond,
    /// Counts since the last tick.
    pub(super) moved: i32,
}

impl Tick<'_> {
    /// Control period in ms.
    pub(super) fn period_ms(&self) -> u32 {
        self.context.period.as_millis()
    }

    /// Back EMF constant, in V per count/s.
    pub(super) fn emf_volts_per_cps(&self) -> f32 {
        self.context.settings.winding.emf.to_volts()
    }

    /// Estimated speed at the time of the last command, in counts/s.
    pub(super) fn speed_at_command(&self) -> f32 {
        self.command.request.at.emf_volts() / self.emf_volts_per_cps()
    }
}

/// The expected distance since the beginning of a silence or of a probe, and the expected speed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expected {
    /// Time in ms for which the distance has been computed.
    pub(super) ms: u32,
    /// Least expected speed now, in counts/s; `None` before the first step.
    speed_cps: Option<f32>,
    /// Least expected distance, in counts.
    pub(super) distance_counts: f32,
    /// Duration in ms of the last ticks in a row at which the drive voltage exceeded the heaviest friction. Ticks with
    /// an open bridge are left out.
    pub(super) driven_ms: u32,
}

/// Limits of friction and load of a 12 V motor. A torque is given as the voltage that balances the torque.
impl Expected {
    /// Largest resisting torque of friction, in volts. The largest friction of a turning motor is assumed to be 40 % of
    /// 12 V. To break away the motor needs a third more, which is 6.4 V. The limit is 0.2 V higher.
    pub(super) const FRICTION_VOLTS: f32 = 6.6;
    /// Largest torque of a load that drives a motor at a steady speed, in volts: the stall torque at 12 V. If the load of
    /// a run seems to be larger, less the uncertainty, the estimate is wrong and the motor is braking.
    pub(super) const LARGEST_DRIVING_VOLTS: f32 = 12.0;
    /// Ratio of the torque that breaks a motor away to the torque that keeps the motor turning.
    const BREAKAWAY_RATIO: f32 = 4.0 / 3.0;
    /// Uncertainty of an estimated resisting torque, in volts.
    pub(super) const UNCERTAINTY_VOLTS: f32 = 1.0;
}

impl Expected {
    /// The state before the first step.
    pub(super) const NONE: Self = Self { ms: 0, speed_cps: None, distance_counts: 0.0, driven_ms: 0 };

    /// Adds a step of a motor that accelerates from rest. `acceleration` is in counts/s².
    ///
    /// `speed` is the motor's estimated speed in counts/s, positive in the requested direction. A motor that turns in
    /// the other direction must stop first. A motor that turns in the requested direction is treated like a motor at
    /// rest.
    pub(super) fn accelerate(self, ms: u32, acceleration: f32, speed: f32) -> Self {
        let before = self.speed_cps.map_or(speed.min(0.0), |expected| expected.max(speed.min(0.0)));
        self.add(ms, before, before + acceleration.max(0.0) * seconds(ms))
    }

    /// Adds a step of a motor that keeps turning under its load.
    ///
    /// A rising speed is computed with the likely least gain, and a falling speed with the configured or estimated
    /// gain. Both choices give the lowest speed of a healthy motor: a heavier motor speeds up later, and also slows
    /// down later.
    pub(super) fn keep_turning(self, ms: u32, run: &Run, drive_volts: f32, tick: &Tick<'_>) -> Self {
        let before = self.speed_cps.unwrap_or(run.speed_cps);
        let (mut volts, mut kappa) = (drive_volts - run.resisting_volts(tick), tick.emf_volts_per_cps());
        if tick.command.limited.drive.mode == Mode::Brake50 {
            // The drive voltage of a braking bridge is proportional to the speed. So this voltage per speed is
            // subtracted from the back EMF constant, and the voltage is not part of `volts`.
            let speed = tick.speed_at_command().abs().max(1.0);
            (volts, kappa) = (volts - drive_volts, (kappa - drive_volts / speed).max(0.0));
        }
        let speeds_up = volts > kappa * before;
        let gain = if speeds_up { tick.regulator.likely_least_gain() } else { tick.regulator.gain() };
        // Backward Euler: a long step is stable.
        let step = seconds(ms) * gain;
        let speed = (before + step * volts) / (1.0 + step * kappa);
        if speed > 0.0 {
            self.add(ms, before, speed)
        } else {
            // A healthy motor may have come to rest here, so time and distance start at 0 again.
            Self { speed_cps: Some(0.0), ..Self::NONE }
        }
    }

    /// Adds a step from the speed `before` to `speed`, in counts/s.
    fn add(self, ms: u32, before: f32, speed: f32) -> Self {
        Self {
            ms: self.ms.saturating_add(ms),
            speed_cps: Some(speed),
            distance_counts: self.distance_counts + f32::midpoint(before, speed) * seconds(ms),
            ..self
        }
    }
}

impl Run {
    /// Largest resisting torque of the load of the run, in volts, at most [`Expected::FRICTION_VOLTS`]. The value is
    /// below 0 if the load drives the motor by more than the uncertainty.
    pub(super) fn resisting_volts(&self, tick: &Tick<'_>) -> f32 {
        // The estimated disturbance lags behind a new load. The drive voltage beyond the back EMF does not lag.
        let load = (-self.disturbance_cps2 / tick.regulator.gain())
            .max(self.drive_volts - tick.emf_volts_per_cps() * self.speed_cps);
        let resisting =
            load * if load > 0.0 { Expected::BREAKAWAY_RATIO } else { 1.0 } + Expected::UNCERTAINTY_VOLTS;
        resisting.min(Expected::FRICTION_VOLTS)
    }
}

/// Converts milliseconds to seconds.
fn seconds(ms: u32) -> f32 {
    1e-3 * ms as f32
}
