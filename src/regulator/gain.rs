//! Estimates the acceleration per volt of an unknown motor from the corrections of the [observer](super::observer).
//!
//! The observer predicts the position of the shaft with a gain b. theta is the relative error of b: the true gain is
//! b (1 + theta). The predicted position is linear in b, so the error of the prediction is s theta. s is the
//! *sensitivity* of the predicted position: its change per relative change of b. The sensitivity is predicted with the
//! motor's equation of motion, as the observer's state is. The only input of this equation is the accelerating voltage:
//! the voltage across the motor less its back EMF. Each correction of the observer removes a part of the error of the
//! prediction, and the same part of s. So the error e of a correction is a measurement of theta, with the Kalman gain k
//! and the variance r of the noise:
//!
//! ```text
//! e = s theta + noise        k = P s / (s² P + r)        theta += k (e - s theta)        P -= k s P
//! ```
//!
//! This is a Kalman filter with the state theta and its variance P. In system identification it is called the
//! recursive prediction error method (L. Ljung, T. Söderström, 1983). While a motor turns at a steady speed, s is
//! near 0: a constant load changes only the load that the observer estimates, and not theta. So a load is not taken for
//! inertia.

use super::observer::{Correction, Observer, Plant, SAMPLE_S, Sensitivity};
use crate::units::single::{at_least, at_most};
use libm::sqrtf;

/// Initial guess of the mechanical time constant of an unknown motor, in s: about the time constant of a bare gear
/// motor.
const GUESSED_TIME_CONSTANT_S: f32 = 0.14;
/// Shortest plausible mechanical time constant of a motor, in s.
const SHORTEST_TIME_CONSTANT_S: f32 = 0.01;
/// Longest plausible mechanical time constant of a motor with its load, in s.
const LONGEST_TIME_CONSTANT_S: f32 = 30.0;
/// Variance of theta for the initial guess. The standard deviation is as large as the guess.
const GUESS_VARIANCE: f32 = 1.0;
/// Growth of the variance per second while corrections show the gain, up to [`GUESS_VARIANCE`], because windings warm
/// up and loads change. Measured with the program `survey`, which simulates random motors: with 0.08 to 0.13 fewer
/// responses never settle than with 0.03. With 0.12 a broken wire of a motor with a heavy flywheel is known after
/// 268 ms, and 250 ms are allowed.
const VARIANCE_PER_SECOND: f32 = 0.11;
/// Sensitivity, in counts, up to which the variance does not grow. With so small a sensitivity a correction hardly
/// reduces the variance, so the variance would only grow.
const LEAST_GROWTH_SENSITIVITY: f32 = 0.02;
/// Least effect on the predicted position, in counts, of an error of b as large as the initial guess (`s guess / b`).
/// With a smaller effect, an unexplained correction shows a wrong state, not a wrong gain, and pauses the estimate. s
/// alone does not show this: if b is far too small, s is small, but the relative error of b is large.
const RELEVANT_SENSITIVITY: f32 = 0.1;
/// Standard deviation of a correction because of the resolution of whole counts, in counts.
const COUNTING_NOISE: f32 = 0.25;
/// Standard deviation, in V, of the voltage that accelerates the motor. The causes are errors of the bridge, and load
/// and friction that change between two counts.
const VOLTAGE_NOISE: f32 = 0.3;
/// Number of standard deviations of theta up to which a wrong gain may explain a correction. A correction beyond this
/// error and [`LARGEST_NOISE_SIGMAS`] together is unexplained. Causes are an impact, a mechanical stop, or a motor that
/// was already turning when the observer started.
const LARGEST_GAIN_ERROR_SIGMAS: f32 = 3.0;
/// Number of standard deviations of the noise up to which noise may explain a correction.
const LARGEST_NOISE_SIGMAS: f32 = 4.0;
/// Length of a pause of the estimate, in s. In this time the observer corrects most of a wrong state: it is two time
/// constants of the fastest observer.
const PAUSE_S: f32 = 0.05;
/// Longest sum of successive pauses of the estimate, in s. An explained correction outside of a pause ends the series
/// of pauses. The sum is six time constants of the slowest observer of a NeveRest 60, whose poles are 10 per second for
/// the heaviest plausible load. The observer corrects a wrong state in this time. If corrections are still unexplained,
/// the gain is wrong, and the estimate returns to the initial guess. Measured with `survey`: with 0.3, 0.6 and 1 s, 24
/// to 26 of 1010 responses never settle.
const LONGEST_PAUSE_S: f32 = 0.6;
/// Difference of the accelerating voltage from its mean, as a share of the voltage across the motor, up to which theta
/// is not updated. At a steady speed the errors of whole counts have a constant sign, and would shift the estimate
/// within minutes. Measured: with a limit of 0.3 %, the estimate drifts in two minutes.
const EXCITATION_SHARE: f32 = 0.01;
/// Time constant of the mean accelerating voltage, in s.
const EXCITATION_S: f32 = 0.3;
/// Least magnitude of theta with which the regulator takes the new gain: a change of 5 %.
const LEAST_CHANGE: f32 = 0.05;
/// Largest factor by which the gain changes in a control tick, and the reciprocal of the smallest factor.
const LARGEST_STEP: f32 = 2.7;
/// Samples without a count update theta only while the gain in use is above this share of the gain at the last count. A
/// shaft that friction or a stop holds looks like a motor with a very small gain.
const LEAST_SILENT_SHARE: f32 = 0.125;
/// Variance of theta below which the estimate can show a heavy motor: a standard deviation of some 40 %.
const SURE_VARIANCE: f32 = 0.15;
/// Ratio of the estimated time constant to the initial guess above which a motor is heavy.
const HEAVY_TIME_CONSTANT_RATIO: f32 = 1.25;
/// Balance of counts at which the encoder is trusted. The balance is the counts in the direction of the voltage less
/// the counts against the voltage.
const TRUSTED_COUNTS: i32 = 30;
/// Largest balance of counts. A heavy motor may brake in reverse at 3000 counts/s for a control period of 100 ms, which
/// are 300 counts against the voltage. The encoder then stays trusted, and [`GainEstimate::is_heavy`] true.
const MOST_TRUST_COUNTS: i32 = TRUSTED_COUNTS + 300;

/// The estimate of one motor's gain, relative to the gain b that the observer uses.
#[derive(Clone, Copy, Debug)]
pub(super) struct GainEstimate {
    /// Estimate of the relative error of b: true gain / b - 1.
    theta: f32,
    /// Variance of `theta`.
    variance: f32,
    /// Sensitivity of the observer's state to b.
    sensitivity: Sensitivity,
    /// Balance of counts, limited to 0 to [`MOST_TRUST_COUNTS`]. Counts without a voltage are not included.
    trust_counts: i32,
    /// Remaining time of a pause, in s. Theta is not updated before this time is over.
    pause_s: f32,
    /// Sum of the present series of pauses, in s: see [`LONGEST_PAUSE_S`].
    paused_s: f32,
    /// Accelerating voltage in V, see [`Observer::net_volts`]; 0 while the bridge is open.
    net_volts: f32,
    /// Mean of `net_volts` with the time constant [`EXCITATION_S`].
    mean_net_volts: f32,
    /// Gain in use, as a share of the gain at the last count.
    share_since_count: f32,
    /// True after [`multiply`](Self::multiply): theta is not updated, because a load that makes the speed swing would
    /// teach a wrong gain.
    is_fixed: bool,
}

impl GainEstimate {
    /// Creates an estimate that the gain of the observer is right, with the uncertainty of the
    /// [initial guess](guessed_gain).
    pub(super) const fn new() -> Self {
        Self {
            theta: 0.0,
            variance: GUESS_VARIANCE,
            sensitivity: Sensitivity { position: 0.0, speed: 0.0, load: 0.0 },
            trust_counts: 0,
            pause_s: 0.0,
            paused_s: 0.0,
            net_volts: 0.0,
            mean_net_volts: 0.0,
            share_since_count: 1.0,
            is_fixed: false,
        }
    }

    /// Resets the estimate to the initial guess, and trusts the encoder no longer. The observer still uses the gain of
    /// `plant`. The next calls of [`take_gain`](Self::take_gain) lead from this gain to the guess, each by a factor of
    /// [`LARGEST_STEP`] at most.
    pub(super) fn discard(&mut self, plant: &Plant) {
        *self = Self::new();
        self.return_to_guess(plant);
    }

    /// Sets the estimated gain and its variance to the initial guess. The observer still uses the gain of `plant`, so
    /// theta becomes guess / b - 1.
    fn return_to_guess(&mut self, plant: &Plant) {
        (self.theta, self.variance, self.paused_s, self.is_fixed) = (0.0, GUESS_VARIANCE, 0.0, false);
        self.refer_to(plant.b / guessed_gain(plant.kappa));
    }

    /// True if the encoder is trusted: the balance of counts is at least [`TRUSTED_COUNTS`].
    pub(super) const fn is_trusted(&self) -> bool {
        self.trust_counts >= TRUSTED_COUNTS
    }

    /// True if the motor is surely heavier than a bare gear motor. False while the encoder is not trusted, because the
    /// encoder may be reversed.
    pub(super) fn is_heavy(&self, plant: &Plant) -> bool {
        self.is_trusted()
            && self.variance < SURE_VARIANCE
            && HEAVY_TIME_CONSTANT_RATIO * plant.b < guessed_gain(plant.kappa)
    }

    /// Refers theta and its variance to a new gain of the observer, which is `factor` times b.
    fn refer_to(&mut self, factor: f32) {
        self.theta = (1.0 + self.theta) / factor - 1.0;
        self.variance /= factor * factor;
    }

    /// Multiplies the estimated gain by a factor, because the speed swings with the present gain. The variance of
    /// theta stays. Corrections then do not update theta until [`update_again`](Self::update_again), or until the
    /// estimate returns to the initial guess.
    pub(super) fn multiply(&mut self, factor: f32) {
        self.theta = factor * (1.0 + self.theta) - 1.0;
        self.is_fixed = true;
    }

    /// True while corrections do not update theta, see [`multiply`](Self::multiply).
    pub(super) const fn is_fixed(&self) -> bool {
        self.is_fixed
    }

    /// Lets corrections update theta again after [`multiply`](Self::multiply).
    pub(super) const fn update_again(&mut self) {
        self.is_fixed = false;
    }

    /// Sets the sensitivity of a motor at rest to 0: with an open bridge and no motion the state of the observer does
    /// not depend on the gain. Ends a [pause](Self::pause).
    pub(super) fn rest(&mut self) {
        (self.sensitivity, self.pause_s, self.paused_s) = (Sensitivity::default(), 0.0, 0.0);
    }

    /// Pauses the estimate for [`PAUSE_S`], in which the observer corrects a state that is wrong for another reason
    /// than the gain.
    pub(super) fn pause(&mut self) {
        (self.sensitivity, self.pause_s) = (Sensitivity::default(), PAUSE_S);
    }

    /// Predicts the sensitivity one sample later. Must be called before the observer predicts the same sample.
    /// `voltage` is in V; `None` while the bridge is open.
    pub(super) fn predict(&mut self, plant: &Plant, observer: &Observer, voltage: Option<f32>) {
        self.net_volts = observer.net_volts(plant, voltage);
        let damping = observer.decay(plant);
        self.mean_net_volts += (self.net_volts - self.mean_net_volts) * SAMPLE_S / EXCITATION_S;
        if self.pause_s > 0.0 {
            self.pause_s -= SAMPLE_S;
            self.paused_s += SAMPLE_S;
            return;
        }
        let Sensitivity { position, speed: of_speed, load } = &mut self.sensitivity;
        *position += *of_speed * SAMPLE_S;
        *of_speed += (plant.b * self.net_volts - damping * *of_speed + *load) * SAMPLE_S;
    }

    /// Updates the estimate from a correction of the observer, after a sample with `moved` counts. `voltage` is in V;
    /// `None` while the bridge is open. Theta is only updated if `updates` is true.
    pub(super) fn correct(
        &mut self,
        plant: &Plant,
        correction: &Correction,
        moved: i32,
        voltage: Option<f32>,
        updates: bool,
    ) {
        // A shaft that is turned without a voltage does not show in which direction the encoder sends counts.
        let counts_along_voltage = match voltage {
            Some(volts) if volts > 0.0 => moved,
            Some(volts) if volts < 0.0 => moved.saturating_neg(),
            _ => 0,
        };
        self.trust_counts =
            self.trust_counts.saturating_add(counts_along_voltage).clamp(0, MOST_TRUST_COUNTS);
        if moved != 0 {
            self.share_since_count = 1.0;
        }
        let Correction { error, age_s, .. } = *correction;
        let s = self.sensitivity.position;
        let innovation = error - s * self.theta;
        let drift = VOLTAGE_NOISE * plant.b * age_s * age_s / 2.0;
        let noise = COUNTING_NOISE * COUNTING_NOISE + drift * drift;
        // An open bridge does not accelerate the motor, so no correction shows the gain.
        let excited = voltage.is_some_and(|volts| {
            (self.net_volts - self.mean_net_volts).abs() > EXCITATION_SHARE * volts.abs()
        });
        // After a step to a smaller gain, the variance relative to this gain may be above the variance of the guess.
        if excited && s.abs() > LEAST_GROWTH_SENSITIVITY && self.variance < GUESS_VARIANCE {
            self.variance = at_most(self.variance + VARIANCE_PER_SECOND * age_s, GUESS_VARIANCE);
        }
        // A comparison of squares finds most noise without a square root.
        let is_noise = innovation * innovation <= LARGEST_NOISE_SIGMAS * LARGEST_NOISE_SIGMAS * noise;
        let is_explained = is_noise
            || innovation.abs()
                <= LARGEST_GAIN_ERROR_SIGMAS * s.abs() * sqrtf(self.variance)
                    + LARGEST_NOISE_SIGMAS * sqrtf(noise);
        if !is_explained {
            // With so small a sensitivity a wrong gain is not the cause: the state of the observer is wrong.
            if s.abs() * guessed_gain(plant.kappa) < RELEVANT_SENSITIVITY * plant.b {
                // Exception: a gain that is far too small makes the state wrong again after each pause. As the
                // sensitivity is 0 during a pause, such a gain would pause the estimate for ever.
                if self.paused_s > LONGEST_PAUSE_S {
                    self.return_to_guess(plant);
                }
                self.pause();
                return;
            }
        } else if self.pause_s <= 0.0 {
            self.paused_s = 0.0;
            if excited && updates && !self.is_fixed && self.share_since_count > LEAST_SILENT_SHARE {
                let k = self.variance * s / (s * s * self.variance + noise);
                self.theta += k * innovation;
                self.variance = at_least(self.variance - k * s * self.variance, 0.0);
            }
        }
        self.sensitivity.position -= correction.position * s;
        self.sensitivity.speed -= correction.speed * s;
        self.sensitivity.load -= correction.load * s;
    }

    /// Returns the new gain at a control tick, in counts/s² per V, and the change of the observer's state that
    /// follows from the new gain. The caller must use both, because the change of the state belongs to the new gain.
    /// The gain changes by a factor of [`LARGEST_STEP`] at most.
    /// `None` while the estimate differs from the gain in use by less than [`LEAST_CHANGE`].
    pub(super) fn take_gain(&mut self, plant: &Plant) -> Option<(f32, Sensitivity)> {
        if self.theta.abs() < LEAST_CHANGE {
            return None;
        }
        let least = 1.0 / (LONGEST_TIME_CONSTANT_S * plant.kappa);
        let most = 1.0 / (SHORTEST_TIME_CONSTANT_S * plant.kappa);
        let estimated = at_most(at_least(plant.b * (1.0 + self.theta), least), most);
        self.theta = estimated / plant.b - 1.0;
        let factor = at_most(at_least(1.0 + self.theta, 1.0 / LARGEST_STEP), LARGEST_STEP);
        self.refer_to(factor);
        self.share_since_count *= factor;
        let shift = self.sensitivity.scaled(factor - 1.0);
        self.sensitivity = self.sensitivity.scaled(factor);
        Some((plant.b * factor, shift))
    }
}

/// Initial guess of the gain of an unknown motor, in counts/s² per V. `kappa` is the back EMF constant in V per
/// count/s.
pub(super) fn guessed_gain(kappa: f32) -> f32 {
    1.0 / (GUESSED_TIME_CONSTANT_S * kappa)
}

#[cfg(test)]
mod tests {
    use super::super::observer::Observer;
    use super::*;
    use crate::units::Period;

    /// Back EMF per speed, in V per count/s.
    const KAPPA: f32 = 0.004;

    /// The constants of a motor with this gain and without drag.
    fn plant(gain: f32) -> Plant {
        Plant::new(gain, KAPPA, gain * KAPPA, Period::from_millis(20).unwrap_or_default())
    }

    /// Drives a motor of this time constant (s) and load (V) with each voltage for half a second, at a control period
    /// in ms. Returns the estimated gain.
    fn learned(period: u32, tau: f32, load: f32, volts: &[f32]) -> f32 {
        learned_from(GainEstimate::new(), guessed_gain(KAPPA), period, tau, load, volts)
    }

    /// Like [`learned`], but begins with this estimate and this gain.
    fn learned_from(
        mut estimate: GainEstimate,
        gain: f32,
        period: u32,
        tau: f32,
        load: f32,
        volts: &[f32],
    ) -> f32 {
        let mut estimated = plant(gain);
        let mut observer = Observer::new(0.0);
        observer.set_speed_demanded(true);
        let b = 1.0 / (tau * KAPPA);
        let (mut x, mut w, mut count) = (0.5f64, 0.0f32, 0i32);
        for ms in 0..500 * volts.len() as u32 {
            let u = volts.get((ms / 500) as usize).copied().unwrap_or(0.0);
            if ms % period == 0 {
                if let Some((gain, shift)) = estimate.take_gain(&estimated) {
                    estimated = plant(gain);
                    observer.shift(&shift);
                }
                observer.set_voltage(&estimated, Some(u), 1.0);
            }
            for _ in 0..10 {
                w += b * (u - KAPPA * w - load) * 1e-4;
                x += f64::from(w) * 1e-4;
            }
            let moved = x.floor() as i32 - count;
            count += moved;
            estimate.predict(&estimated, &observer, Some(u));
            observer.predict(&estimated);
            if let Some(correction) = observer.update(&estimated, moved, false) {
                estimate.correct(&estimated, &correction, moved, Some(u), true);
            }
        }
        estimated.b
    }

    #[test]
    fn an_estimate_that_is_sure_of_a_far_too_small_gain_finds_the_true_one() {
        for period in [1, 10, 50, 100] {
            for share in [0.005, 0.02, 0.07] {
                let estimate = GainEstimate { variance: 0.2, ..GainEstimate::new() };
                let gain = share * guessed_gain(KAPPA);
                let volts = [12.0, -12.0, 12.0, -12.0, 12.0, -12.0, 12.0, -12.0];
                let found = 1.0 / (learned_from(estimate, gain, period, 0.1, 0.0, &volts) * KAPPA);
                assert!((0.07..=0.14).contains(&found), "{period} ms, {share}: {found} s");
            }
        }
    }

    #[test]
    fn three_steps_of_voltage_identify_light_and_heavy_motors_at_every_period() {
        for tau in [0.05, 0.2, 1.0, 3.0] {
            for period in [1, 5, 20, 50, 100] {
                let found = 1.0 / (learned(period, tau, 0.0, &[9.0, -6.0, 9.0]) * KAPPA);
                assert!((0.6 * tau..1.25 * tau).contains(&found), "{found}, not {tau} s at {period} ms");
            }
        }
    }

    #[test]
    fn a_load_is_not_taken_for_inertia() {
        for load in [-2.0, 2.0] {
            let found = learned(20, 0.4, load, &[9.0, 3.0, 9.0]) * KAPPA;
            assert!((found * 0.4 - 1.0).abs() < 0.35, "{found} with {load} V");
        }
    }

    #[test]
    fn a_steady_speed_teaches_nothing_more() {
        let [short, long] = [20, 240].map(|halves| learned(10, 0.5, 1.0, &vec![9.0; halves]));
        assert!((long / short - 1.0).abs() < 0.06, "{short} after 10 s, {long} after 2 min");
    }

    #[test]
    fn a_stalled_motor_that_may_not_teach_leaves_the_guess() {
        let mut estimate = GainEstimate::new();
        let plant = plant(guessed_gain(KAPPA));
        let mut observer = Observer::new(0.0);
        observer.set_speed_demanded(true);
        observer.set_voltage(&plant, Some(12.0), 1.0);
        for _ in 0..2_000 {
            estimate.predict(&plant, &observer, Some(12.0));
            observer.predict(&plant);
            if let Some(correction) = observer.update(&plant, 0, false) {
                estimate.correct(&plant, &correction, 0, Some(12.0), false);
            }
            assert!(estimate.take_gain(&plant).is_none());
        }
        assert!(estimate.theta == 0.0);
    }
}
