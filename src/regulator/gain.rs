//! Estimates what a volt accelerates an unknown motor by, from the corrections of the [observer](super::observer).
//!
//! The observer predicts the position of the shaft with a gain b. If the true gain is b exp(theta), its prediction is wrong
//! by s theta, where s is the *sensitivity* of the predicted position to ln b. The sensitivity follows the observer's own
//! equations: between corrections the voltage beside the back EMF drives it, and each correction of position,
//! speed and load diminishes it as it diminishes any other error of the prediction. So every correction e tells of theta:
//!
//! ```text
//! e = s theta + noise        k = P s / (s² P + r)        theta += k (e - s theta)        P -= k s P
//! ```
//!
//! This is a Kalman filter of one state, theta with the variance P, and the recursive prediction error method of
//! system identification (L. Ljung, T. Söderström, 1983). While a motor turns steadily the observer's load explains every
//! error and s is near 0: a load is not taken for inertia.

use super::observer::{Correction, Plant, SAMPLE};
use crate::units::single::{at_least, at_most};
use libm::{expf, sqrtf};

/// Mechanical time constant of a motor of which only the back EMF is known, in s: about that of a bare gear motor.
pub(super) const GUESSED_TIME_CONSTANT: f32 = 0.14;
/// Shortest and longest mechanical time constant of a motor with its load, in s.
const PLAUSIBLE_TIME_CONSTANT: (f32, f32) = (0.01, 30.0);
/// Variance of ln b for the guess: the true gain is a third to three times the guess, with two sigma a tenth to ten times.
const GUESS_VARIANCE: f32 = 1.0;
/// Growth of the variance in a second, because windings warm up and loads are exchanged. Measured by `survey`: 0.01 to
/// 0.1 regulate equally well, 0.0001 leaves twice as many random responses unsettled.
const VARIANCE_PER_SECOND: f32 = 0.03;
/// Sensitivity, in counts, from which on the variance grows: an estimate of which nothing is learned stays as it is.
const LEARNING_SENSITIVITY: f32 = 0.02;
/// Sensitivity below which a correction tells nothing of the gain, in counts.
const LEAST_SENSITIVITY: f32 = 0.01;
/// Sensitivity below which a correction that is too large for noise shows a wrong state of the observer, in counts.
const MATTERING_SENSITIVITY: f32 = 0.1;
/// Standard deviation of a correction that is due to whole counts, in counts.
const COUNTING_NOISE: f32 = 0.25;
/// Standard deviation of the voltage across the motor that is due to the bridge, and to load and friction that change between
/// two counts, in V.
const VOLTAGE_NOISE: f32 = 0.3;
/// Most standard deviations of ln b by which a wrong gain explains a correction. A larger correction comes from a blow, a
/// stop, or a motor that was already turning when the observer started.
const LARGEST_GAIN_ERROR: f32 = 3.0;
/// Most standard deviations of the noise that are added to these.
const LARGEST_NOISE: f32 = 4.0;
/// Time in which the observer forgets a wrong initial state, in s.
const SETTLING_S: f32 = 0.05;
/// Only while the accelerating voltage differs by this much from its mean, in V, is anything learned. At a steady speed
/// the errors that whole counts make have a sign, and in minutes they would carry the estimate away.
const EXCITATION_VOLTS: f32 = 0.05;
/// Time constant of that mean, in s.
const EXCITATION_S: f32 = 0.3;
/// Change of ln b from which on the regulator takes the new gain.
const NEWS: f32 = 0.05;
/// Variance of ln b below which the estimate is no guess any more: a standard deviation of some 40 %.
const SURE_VARIANCE: f32 = 0.15;
/// A motor whose time constant is this many times the guess counts as heavy.
const HEAVY: f32 = 1.25;
/// Counts in the direction of the voltage after which an encoder is trusted to count the right way.
const OBEDIENT_COUNTS: i32 = 30;

/// The estimate of one motor's gain.
#[derive(Clone, Copy, Debug)]
pub(super) struct GainEstimate {
    /// Volts per count/s.
    kappa: f32,
    /// The gain b that the observer uses, in counts/s² per V.
    gain: f32,
    /// Estimate of ln(true gain / `gain`).
    theta: f32,
    /// Variance of `theta`.
    variance: f32,
    sensitivity: Sensitivity,
    /// Counts in the direction of the voltage, less those against it; from 0 to [`OBEDIENT_COUNTS`] twice.
    obeyed: i32,
    /// Voltage across the motor, in V; `None` while the bridge is open.
    voltage: Option<f32>,
    /// Time until the observer has forgotten a wrong initial state, in s. Nothing is learned meanwhile.
    settling_s: f32,
    /// Accelerating voltage: that across the motor less the back EMF; 0 while the bridge is open.
    net_volts: f32,
    /// Mean of `net_volts` over [`EXCITATION_S`].
    mean_net_volts: f32,
}

/// What the observer's state would be more, per unit of ln b.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sensitivity {
    position: f32,
    /// Counts/s.
    pub(super) speed: f32,
    /// Counts/s².
    pub(super) load: f32,
}

impl Sensitivity {
    fn scaled(self, by: f32) -> Self {
        Self { position: by * self.position, speed: by * self.speed, load: by * self.load }
    }
}

impl GainEstimate {
    /// Begins with the guess for a motor with this back EMF, in volts per count/s.
    pub(super) fn new(kappa: f32) -> Self {
        Self {
            kappa,
            gain: 1.0 / (GUESSED_TIME_CONSTANT * kappa),
            theta: 0.0,
            variance: GUESS_VARIANCE,
            sensitivity: Sensitivity::default(),
            obeyed: 0,
            voltage: None,
            settling_s: 0.0,
            net_volts: 0.0,
            mean_net_volts: 0.0,
        }
    }

    /// The gain in use, in counts/s² per V.
    pub(super) const fn gain(&self) -> f32 {
        self.gain
    }

    /// True if the motor has turned in the direction of its voltage, so that its encoder can be trusted.
    pub(super) const fn is_trusted(&self) -> bool {
        self.obeyed >= OBEDIENT_COUNTS
    }

    /// True if the motor has turned out to be heavier than a bare gear motor. One that turns against its voltage may have a
    /// reversed encoder, so its estimate says nothing.
    pub(super) fn is_heavy(&self) -> bool {
        self.is_trusted()
            && self.variance < SURE_VARIANCE
            && HEAVY * self.gain * GUESSED_TIME_CONSTANT * self.kappa < 1.0
    }

    /// The motor rests: the observer's state is known, and owes nothing to the gain.
    pub(super) fn rest(&mut self) {
        (self.sensitivity, self.settling_s) = (Sensitivity::default(), 0.0);
    }

    /// The observer's state is wrong for another reason than the gain.
    pub(super) fn restart(&mut self) {
        (self.sensitivity, self.settling_s) = (Sensitivity::default(), SETTLING_S);
    }

    /// From now on this voltage is across the motor; `None` while the bridge is open.
    pub(super) const fn drive(&mut self, voltage: Option<f32>) {
        self.voltage = voltage;
    }

    /// One sample later; `speed` is the observer's, in counts/s.
    pub(super) fn predict(&mut self, plant: &Plant, speed: f32) {
        self.net_volts = self.voltage.map_or(0.0, |u| u - plant.kappa * speed);
        self.mean_net_volts += (self.net_volts - self.mean_net_volts) * SAMPLE / EXCITATION_S;
        if self.settling_s > 0.0 {
            self.settling_s -= SAMPLE;
            return;
        }
        let Sensitivity { position, speed: of_speed, load } = &mut self.sensitivity;
        *position += *of_speed * SAMPLE;
        let damped = if self.voltage.is_some() { plant.q * *of_speed } else { 0.0 };
        *of_speed += (self.gain * self.net_volts - damped + *load) * SAMPLE;
    }

    /// Takes what the observer has corrected after a sample with `moved` counts. A motor that is held by a stop teaches
    /// nothing.
    pub(super) fn correct(&mut self, correction: &Correction, moved: i32, held: bool) {
        let along = if self.voltage.unwrap_or(0.0) < 0.0 { moved.saturating_neg() } else { moved };
        self.obeyed = self.obeyed.saturating_add(along).clamp(0, 2 * OBEDIENT_COUNTS);
        let Correction { error, age, position, speed, load } = *correction;
        let s = self.sensitivity.position;
        let innovation = error - s * self.theta;
        let drift = VOLTAGE_NOISE * self.gain * age * age / 2.0;
        let noise = COUNTING_NOISE * COUNTING_NOISE + drift * drift;
        let excited = (self.net_volts - self.mean_net_volts).abs() > EXCITATION_VOLTS;
        if excited && s.abs() > LEARNING_SENSITIVITY {
            self.variance = at_most(self.variance + VARIANCE_PER_SECOND * age, GUESS_VARIANCE);
        }
        let largest = LARGEST_GAIN_ERROR * s.abs() * sqrtf(self.variance) + LARGEST_NOISE * sqrtf(noise);
        if innovation.abs() > largest {
            // A gain that hardly matters yet cannot be the reason.
            if s.abs() < MATTERING_SENSITIVITY {
                self.restart();
                return;
            }
        } else if excited && (moved != 0 || !held) && s.abs() > LEAST_SENSITIVITY {
            let k = self.variance * s / (s * s * self.variance + noise);
            self.theta += k * innovation;
            self.variance = at_least(self.variance - k * s * self.variance, 0.0);
        }
        self.sensitivity.position -= position * s;
        self.sensitivity.speed -= speed * s;
        self.sensitivity.load -= load * s;
    }

    /// One control tick later. Returns what the observer's state is to change by if the gain has become another.
    pub(super) fn tick(&mut self) -> Option<Sensitivity> {
        if self.theta.abs() < NEWS {
            return None;
        }
        let (shortest, longest) = PLAUSIBLE_TIME_CONSTANT;
        let theta = at_most(at_least(self.theta, -1.0), 1.0);
        self.theta -= theta;
        let change = expf(theta);
        self.gain = at_most(
            at_least(self.gain * change, 1.0 / (longest * self.kappa)),
            1.0 / (shortest * self.kappa),
        );
        let shift = self.sensitivity.scaled(theta);
        // Sensitivities are in proportion to the gain that they were found with.
        self.sensitivity = self.sensitivity.scaled(change);
        Some(shift)
    }
}

#[cfg(test)]
mod tests {
    use super::super::observer::Observer;
    use super::*;

    const KAPPA: f32 = 0.004;
    /// Poles of the observer in 1/s, and the floor of its z.
    const FILTER: (f32, f32) = (45.0, 0.35);

    /// Drives a motor of this time constant (s) and load (V) with voltages that last for half a second each, ticked every
    /// `period` ms, and returns what was learned.
    fn learned(period: u32, tau: f32, load: f32, volts: &[f32]) -> GainEstimate {
        let mut estimate = GainEstimate::new(KAPPA);
        let plant = |gain: f32| Plant::new(gain, KAPPA, gain * KAPPA, FILTER);
        let mut known = plant(estimate.gain());
        let mut observer = Observer::new(0.0);
        let b = 1.0 / (tau * KAPPA);
        let (mut x, mut w, mut count) = (0.5f64, 0.0f32, 0i32);
        for ms in 0..500 * volts.len() as u32 {
            let u = volts.get((ms / 500) as usize).copied().unwrap_or(0.0);
            if ms % period == 0 {
                if let Some(shift) = estimate.tick() {
                    known = plant(estimate.gain());
                    observer.shift(&shift);
                }
                estimate.drive(Some(u));
                observer.drive(&known, Some(u));
            }
            for _ in 0..10 {
                w += b * (u - KAPPA * w - load) * 1e-4;
                x += f64::from(w) * 1e-4;
            }
            let moved = x.floor() as i32 - count;
            count += moved;
            estimate.predict(&known, observer.speed());
            observer.predict(&known);
            if let Some(correction) = observer.see(&known, moved, true) {
                estimate.correct(&correction, moved, false);
            }
        }
        estimate
    }

    #[test]
    fn light_and_heavy_motors_are_known_after_three_steps_of_voltage_at_every_period() {
        for tau in [0.05, 0.2, 1.0, 3.0] {
            for period in [1, 5, 20, 50, 100] {
                let found = 1.0 / (learned(period, tau, 0.0, &[9.0, -6.0, 9.0]).gain() * KAPPA);
                assert!((0.6 * tau..1.25 * tau).contains(&found), "{found}, not {tau} s at {period} ms");
            }
        }
    }

    #[test]
    fn a_load_is_not_taken_for_inertia() {
        for load in [-2.0, 2.0] {
            let found = learned(20, 0.4, load, &[9.0, 3.0, 9.0]).gain() * KAPPA;
            assert!((found * 0.4 - 1.0).abs() < 0.35, "{found} with {load} V");
        }
    }

    #[test]
    fn a_steady_speed_teaches_nothing_more() {
        let [short, long] = [20, 240].map(|halves| learned(10, 0.5, 1.0, &vec![9.0; halves]).gain());
        assert!((long / short - 1.0).abs() < 0.06, "{short} after 10 s, {long} after 2 min");
    }

    #[test]
    fn a_held_motor_teaches_nothing() {
        let mut estimate = GainEstimate::new(KAPPA);
        let guess = estimate.gain();
        let plant = Plant::new(guess, KAPPA, guess * KAPPA, FILTER);
        let mut observer = Observer::new(0.0);
        estimate.drive(Some(12.0));
        observer.drive(&plant, Some(12.0));
        for _ in 0..2_000 {
            estimate.predict(&plant, observer.speed());
            observer.predict(&plant);
            if let Some(correction) = observer.see(&plant, 0, true) {
                estimate.correct(&correction, 0, true);
            }
            assert!(estimate.tick().is_none());
        }
        assert_eq!(estimate.gain().to_bits(), guess.to_bits());
    }
}
