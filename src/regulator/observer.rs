//! Estimates the position between counts, the speed and the load: a disturbance observer of third order. The observer
//! is stepped with every sample of the encoder.
//!
//! The state is x, the position within the present count (0 to 1); w, the speed in counts/s; and d, the load as an
//! acceleration in counts/s². A prediction integrates the motor's equation with the voltage u over a sample:
//!
//! ```text
//! w' = b u - q w + d        with the bridge open:  w' = d - drag w
//! ```
//!
//! Here b is the acceleration per volt, q the decay of the speed by back EMF and drag, and drag the decay by drag
//! alone. A prime marks a rate of change. The equation is for a continuous current. At a constant duty a discontinuous
//! current, as a voltage, changes only by a share of the change of the back EMF, see
//! [`emf_share`](crate::braking::Modulation::emf_share). Between two commands of the bridge the acceleration therefore
//! decays at the rate `drag + emf_share (q - drag)`.
//!
//! A sample shows between which two positions the shaft is, whether or not a count came. The error is the distance
//! from x to this interval, and x is corrected towards the nearer end. (A correction towards the middle would add
//! noise: at 1000 counts/s every sample has one count, so the interval is a whole count and does not show x.)
//!
//! A count is *late* while the predicted x is outside of the present count, but the encoder has not sent the next
//! count. When the late count comes, it shows how long the motor took for the whole count. With a correction at every
//! sample before the late count, the estimate would be a motor that creeps along the edge of its count. So the observer
//! corrects nothing before the late count comes. [`Observer::with_late_count`] returns the estimate as if the late
//! count came now. There are two exceptions. Once x is late by a whole count, the motor may stand, so x is
//! corrected at every further sample at which the count is late. While no speed is *demanded*, x is corrected at every
//! sample at which a count is late. A velocity set-point demands a speed; positions and references do not, and neither
//! does a motor that holds its position.
//!
//! These corrections put x at an edge of its count, but a standing shaft may be anywhere within the count. The next
//! count may then show that x is wrong by a whole count, although the shaft has hardly moved. So while the motor should
//! stand, a correction without a count has the small gains of one sample, and does not reset the time t of the next
//! paragraph.
//!
//! The gains follow from the time t since the last correction, so a motor at 5 counts/s is estimated as reliably as a
//! motor at 5000 counts/s. They are the gains of a filter with three equal poles at z, which is `exp(-wo t)` but not
//! less than the *least z*. The rate wo and the least z depend on the control period. A motor with a small gain b has a
//! smaller wo:
//!
//! ```text
//! z = max(least z, exp(-wo t))
//! gains: 1 - z^3 of the position, 1.5 (1 - z)^2 (1 + z) / t of the speed, (1 - z)^3 / t^2 of the load
//! ```

use super::within;
use crate::units::Period;
use crate::units::single::{at_least, at_most};
use libm::{cbrtf, expf, expm1f};

/// Time between two samples, in s.
pub(super) const SAMPLE_S: f32 = 1e-3;
/// Largest load, as the voltage that balances the load: 20 times a battery of 12 V. Only wrong constants lead to a
/// larger load.
const LARGEST_LOAD_VOLTS: f32 = 20.0 * 12.0;
/// Distance in counts by which x may leave its count while a count is late.
const LATE_COUNTS: f32 = 1.0;
/// Largest speed in counts/s. The limit is above the speed of any motor's encoder, and bounds the arithmetic in
/// single precision.
pub(super) const FASTEST_CPS: f32 = 1e6;

/// Longest control period, in ms, at which every current is treated as continuous. At a longer period light motors
/// swing unless discontinuous currents are distinguished. At a shorter period the distinction improves little. At 1 ms
/// the distinction would let the estimate of an unknown motor take an impact for a large inertia (decision 32).
const CONTINUOUS_PERIOD_MS: u32 = 20;

/// The motor's constants as the observer uses them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plant {
    /// Acceleration per volt, in counts/s² per V.
    pub(super) b: f32,
    /// Back EMF per speed, in V per count/s.
    pub(super) kappa: f32,
    /// Decay of the speed by back EMF and drag, in 1/s.
    pub(super) q: f32,
    /// Decay of the speed by drag alone, q - b kappa, in 1/s. A negative value becomes 0.
    pub(super) drag: f32,
    /// True if a discontinuous current has its own equation. False if every current is treated as continuous.
    pub(super) distinguishes_currents: bool,
    /// Response to an acceleration that decays by back EMF and drag.
    by_emf: SampleResponse,
    /// Response to an acceleration that decays by drag alone.
    by_drag: SampleResponse,
    /// Factor by which z falls in one sample: exp(-wo times [`SAMPLE_S`]).
    z_per_sample: f32,
    /// Least z, however long ago the last correction was.
    least_z: f32,
    /// Least z while no speed is demanded.
    least_holding_z: f32,
}

impl Plant {
    /// Computes the constants of a motor from its gain b, its back EMF constant, its decay q and its control period.
    pub(super) fn new(b: f32, kappa: f32, q: f32, period: Period) -> Self {
        // Fastest poles in 1/s, least z, and least z while no speed is demanded. At a long period the least z is lower.
        // A load is then estimated sooner, but a slow motion becomes less smooth. While no speed is demanded, the
        // least z at a long period is higher. Otherwise each count would change the load so much that a held position
        // swings by two counts.
        let (fastest_poles, least_z, least_holding_z) = match period.as_millis() {
            0..=20 => (45.0, 0.35, 0.35),
            21..=50 => (42.0, 0.35, 0.35),
            _ => (42.0, 0.25, 0.45),
        };
        let drag = at_least(q - b * kappa, 0.0);
        let poles = at_most(fastest_poles, cbrtf(11.0 * 12.0 * b));
        let [by_emf, by_drag] = [q, drag].map(SampleResponse::new);
        let z_per_sample = expf(-poles * SAMPLE_S);
        let distinguishes_currents = period.as_millis() > CONTINUOUS_PERIOD_MS;
        Self {
            b,
            kappa,
            q,
            drag,
            distinguishes_currents,
            by_emf,
            by_drag,
            z_per_sample,
            least_z,
            least_holding_z,
        }
    }

    /// Acceleration by this voltage at the speed `w`, in counts/s²; 0 with the bridge open.
    fn acceleration(&self, voltage: Option<f32>, w: f32) -> f32 {
        voltage.map_or(0.0, |u| self.b * (u - self.kappa * w))
    }
}

/// Changes of speed and position in a sample, per unit of an acceleration that decays at a constant rate.
#[derive(Clone, Copy, Debug)]
struct SampleResponse {
    /// Change of speed per acceleration, in s.
    speed: f32,
    /// Change of position per acceleration, in s².
    position: f32,
}

impl SampleResponse {
    /// Integrates an acceleration that decays at this rate, in 1/s, over a sample.
    fn new(rate: f32) -> Self {
        let x = rate * SAMPLE_S;
        // The quotients lose their digits at a small rate, so a series replaces them.
        if x > 1e-2 {
            let speed = -expm1f(-x) / rate;
            Self { speed, position: (SAMPLE_S - speed) / rate }
        } else {
            Self { speed: SAMPLE_S * (1.0 - x / 2.0), position: SAMPLE_S * SAMPLE_S * (0.5 - x / 6.0) }
        }
    }

    /// Interpolates between this response (share 0) and another one (share 1).
    fn towards(&self, other: &Self, share: f32) -> Self {
        Self {
            speed: self.speed + share * (other.speed - self.speed),
            position: self.position + share * (other.position - self.position),
        }
    }
}

/// A correction of the state: an error of the predicted position, and the gains that correct the state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Correction {
    /// Nearest possible position less predicted position, in counts. The possible positions are the interval of the
    /// sample.
    pub(super) error: f32,
    /// Time in which the error arose, in s: since the last correction, or one sample.
    pub(super) age_s: f32,
    /// Change of the position per error.
    pub(super) position: f32,
    /// Change of the speed per error, in 1/s.
    pub(super) speed: f32,
    /// Change of the load per error, in 1/s².
    pub(super) load: f32,
}

impl Correction {
    /// The correction of an error that arose within `age_s` seconds, in which z fell from 1 to `z`.
    fn new(error: f32, age_s: f32, z: f32) -> Self {
        let faded = 1.0 - z;
        let rate = 1.0 / age_s;
        let square = faded * faded;
        Self {
            error,
            age_s,
            position: 1.0 - z * z * z,
            speed: 1.5 * square * (1.0 + z) * rate,
            load: square * faded * rate * rate,
        }
    }
}

/// Sensitivity of the observer's state to b: the change of the state per relative change of b.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sensitivity {
    /// Sensitivity of the position, in counts.
    pub(super) position: f32,
    /// Sensitivity of the speed, in counts/s.
    pub(super) speed: f32,
    /// Sensitivity of the load, in counts/s².
    pub(super) load: f32,
}

impl Sensitivity {
    /// The sensitivity times a factor.
    pub(super) fn scaled(self, by: f32) -> Self {
        Self { position: by * self.position, speed: by * self.speed, load: by * self.load }
    }
}

/// Limit of loads against a motion: `load` if it acts against the motion, otherwise 0.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LoadLimit {
    /// Speed of the motion, in counts/s.
    speed: f32,
    /// Load during the motion, in counts/s².
    load: f32,
}

/// The estimate of a motor's motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observer {
    /// Position within the present count, 0 to 1; outside of this range while a count is late.
    x: f32,
    /// Speed, in counts/s.
    w: f32,
    /// Load, in counts/s².
    d: f32,
    /// Acceleration at the time of the state, in counts/s².
    acceleration: f32,
    /// True while the bridge is open, so that only drag and load act.
    coasting: bool,
    /// Speed when the voltage was last set, in counts/s.
    w_at_command: f32,
    /// [`Modulation::emf_share`](crate::braking::Modulation::emf_share) of the present command, 0 to 1. The share is 1
    /// if the plant does not distinguish currents, and 0 while the bridge is open.
    emf_share: f32,
    /// True while a speed is demanded.
    speed_demanded: bool,
    /// Time since the last correction, in s.
    age_s: f32,
    /// Memory of the filter: exp(-wo age), at least the least z.
    z: f32,
    /// True if a sample without a count has corrected x, and no count has come since.
    overdue: bool,
}

impl Observer {
    /// Creates an observer in the middle of a count, at this speed in counts/s, without acceleration and with the
    /// bridge open.
    pub(super) fn new(w: f32) -> Self {
        Self {
            x: 0.5,
            w,
            d: 0.0,
            acceleration: 0.0,
            coasting: true,
            w_at_command: w,
            emf_share: 0.0,
            speed_demanded: false,
            age_s: 0.0,
            z: 1.0,
            overdue: false,
        }
    }

    /// Predicts the state one sample later.
    pub(super) fn predict(&mut self, plant: &Plant) {
        if self.coasting {
            self.acceleration = self.external_acceleration(plant);
        }
        let response = plant.by_drag.towards(&plant.by_emf, self.emf_share);
        let decay = self.decay(plant);
        self.x += self.w * SAMPLE_S + self.acceleration * response.position;
        let gained = self.acceleration * response.speed;
        self.w += gained;
        self.acceleration -= decay * gained;
        self.age_s += SAMPLE_S;
        self.z = at_least(self.z * plant.z_per_sample, plant.least_z);
    }

    /// Corrects the state by a sample with `moved` counts since the previous sample. Returns the correction; `None` if
    /// nothing is corrected. A sample without a count corrects nothing while no count is late. While a speed is
    /// demanded, it corrects nothing until the next count is late by a whole count. `should_stand` is true if the
    /// requested speed is 0.
    pub(super) fn update(&mut self, plant: &Plant, moved: i32, should_stand: bool) -> Option<Correction> {
        if moved == 0 {
            let late = if self.speed_demanded && !self.overdue { LATE_COUNTS } else { 0.0 };
            if (-late..=1.0 + late).contains(&self.x) {
                return None;
            }
            self.overdue = true;
            let error = self.nearest() - self.x;
            let correction = if should_stand {
                Correction::new(error, SAMPLE_S, plant.z_per_sample)
            } else {
                self.correction(plant, error)
            };
            return Some(self.correct(plant, correction));
        }
        self.overdue = false;
        self.x -= moved as f32;
        // The shaft passed the edge at an unknown time since the last sample, and may be this far beyond the edge.
        let beyond = at_most(self.w.abs() * SAMPLE_S, 1.0);
        let (least, most) = if moved > 0 { (0.0, beyond) } else { (1.0 - beyond, 1.0) };
        self.confine(plant, least, most)
    }

    /// True if the next count is late.
    pub(super) fn is_late(&self) -> bool {
        !(0.0..=1.0).contains(&self.x)
    }

    /// Accelerating voltage at the time of the state, in V: the mean current as a voltage, 0 with the bridge open.
    /// `voltage` is the voltage across the motor at the last command. The accelerating voltage was then `voltage` less
    /// the back EMF. Since then it has changed by [`emf_share`](crate::braking::Modulation::emf_share) of the change of
    /// the back EMF.
    pub(super) fn net_volts(&self, plant: &Plant, voltage: Option<f32>) -> f32 {
        let speed = self.w_at_command + self.emf_share * (self.w - self.w_at_command);
        voltage.map_or(0.0, |volts| volts - plant.kappa * speed)
    }

    /// Rate in 1/s at which the acceleration decays.
    pub(super) fn decay(&self, plant: &Plant) -> f32 {
        plant.drag + self.emf_share * (plant.q - plant.drag)
    }

    /// A copy of the estimate, corrected as if a late count came now.
    pub(super) fn with_late_count(&self, plant: &Plant) -> Self {
        let mut corrected = *self;
        let _ = corrected.confine(plant, 0.0, 1.0);
        corrected
    }

    /// The position in the present count that is nearest to x.
    const fn nearest(&self) -> f32 {
        at_most(at_least(self.x, 0.0), 1.0)
    }

    /// Corrects the state if x is outside of the interval from `least` to `most`.
    fn confine(&mut self, plant: &Plant, least: f32, most: f32) -> Option<Correction> {
        let error = if self.x < least {
            least - self.x
        } else if self.x > most {
            most - self.x
        } else {
            return None;
        };
        let correction = self.correction(plant, error);
        Some(self.correct(plant, correction))
    }

    /// The correction of an error that arose since the last correction. The time since then starts again at 0.
    fn correction(&mut self, plant: &Plant, error: f32) -> Correction {
        let z = if self.speed_demanded { self.z } else { at_least(self.z, plant.least_holding_z) };
        let correction = Correction::new(error, at_least(self.age_s, SAMPLE_S), z);
        (self.age_s, self.z) = (0.0, 1.0);
        correction
    }

    /// Corrects the state. Returns the correction.
    fn correct(&mut self, plant: &Plant, correction: Correction) -> Correction {
        let (speed, load, error) = (self.w, self.d, correction.error);
        self.x += correction.position * error;
        self.w = within(self.w + correction.speed * error, FASTEST_CPS);
        let largest_load = LARGEST_LOAD_VOLTS * plant.b;
        self.d = within(self.d + correction.load * error, largest_load);
        let largest_acceleration = 2.0 * largest_load + plant.q * FASTEST_CPS;
        let change = self.d - load - self.decay(plant) * (self.w - speed);
        self.acceleration = within(self.acceleration + change, largest_acceleration);
        correction
    }

    /// Sets speed and load of a motor at rest to 0. Otherwise the estimate would wander within its count.
    pub(super) const fn rest(&mut self) {
        // The shaft rests within its count, so no count is late.
        self.x = self.nearest();
        (self.w, self.d, self.acceleration) = (0.0, 0.0, 0.0);
    }

    /// Sets the voltage in V that the bridge applies from now on, `None` if the bridge is open, and its
    /// [`emf_share`](crate::braking::Modulation::emf_share).
    pub(super) fn set_voltage(&mut self, plant: &Plant, voltage: Option<f32>, emf_share: f32) {
        (self.coasting, self.w_at_command) = (voltage.is_none(), self.w);
        self.emf_share = match voltage {
            None => 0.0,
            Some(_) if plant.distinguishes_currents => emf_share,
            Some(_) => 1.0,
        };
        self.acceleration = plant.acceleration(voltage, self.w) + self.external_acceleration(plant);
    }

    /// Share of the decay by back EMF, 0 to 1: see [`Modulation::emf_share`](crate::braking::Modulation::emf_share).
    pub(super) const fn emf_share(&self) -> f32 {
        self.emf_share
    }

    /// Notes whether a speed is demanded from now on. False for a position or a reference, for a motor that holds its
    /// position at the demanded speed 0, without regulation, and while the bridge is open.
    pub(super) const fn set_speed_demanded(&mut self, speed_demanded: bool) {
        self.speed_demanded = speed_demanded;
    }

    /// Acceleration by load and drag, in counts/s².
    pub(super) fn external_acceleration(&self, plant: &Plant) -> f32 {
        self.d - plant.drag * self.w
    }

    /// Sets the load to the load that keeps the present speed at this voltage.
    pub(super) fn assume_steady(&mut self, plant: &Plant, voltage: Option<f32>) {
        self.d = plant.drag * self.w - plant.acceleration(voltage, self.w);
    }

    /// Converts the load to new constants, so that the voltage that balances the load stays.
    pub(super) fn keep_load_voltage(&mut self, old: &Plant, new: &Plant) {
        self.d *= new.b / old.b;
    }

    /// Changes the load so that new constants give the same acceleration at this voltage.
    pub(super) fn keep_acceleration(&mut self, old: &Plant, new: &Plant, voltage: Option<f32>) {
        let of = |plant: &Plant| plant.acceleration(voltage, self.w) - plant.drag * self.w;
        self.d += of(old) - of(new);
    }

    /// Adds a change to speed and load, because they were estimated with another gain.
    pub(super) fn shift(&mut self, by: &Sensitivity) {
        self.w = within(self.w + by.speed, FASTEST_CPS);
        self.d += by.load;
    }

    /// Sets the load to 0: the motor has left its stop, or there has been no sample for some time.
    pub(super) fn forget_load(&mut self) {
        self.d = 0.0;
    }

    /// The present load as a limit of later loads against the present motion.
    pub(super) const fn load_limit(&self) -> LoadLimit {
        LoadLimit { speed: self.w, load: self.d }
    }

    /// Limits a load against the motion of `limit`. A load in the direction of this motion stays.
    pub(super) const fn limit_load(&mut self, limit: LoadLimit) {
        let LoadLimit { speed, load } = limit;
        self.d = if speed > 0.0 {
            at_least(self.d, at_most(load, 0.0))
        } else {
            at_most(self.d, at_least(load, 0.0))
        };
    }

    /// Changes the load by this much, in counts/s², as friction does when the motion reverses.
    pub(super) fn add_load(&mut self, by: f32) {
        self.d += by;
    }

    /// Estimated speed, in counts/s.
    pub(super) fn speed(&self) -> f32 {
        self.w
    }

    /// Estimated load without drag, in counts/s².
    pub(super) fn load(&self) -> f32 {
        self.d
    }

    /// Estimated position within the present count, 0 to 1; outside of this range while a count is late.
    pub(super) fn fraction(&self) -> f32 {
        self.x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The motor's constants b, kappa and q.
    const PLANT: (f32, f32, f32) = (1_500.0, 0.004, 7.0);

    fn plant() -> Plant {
        let (b, kappa, q) = PLANT;
        Plant::new(b, kappa, q, Period::from_millis(100).unwrap_or_default())
    }

    /// Estimates the motion of a motor whose position in counts is a function of the time in seconds.
    fn estimate(seconds: f32, voltage: f32, position: impl Fn(f64) -> f64) -> Observer {
        let plant = plant();
        let mut observer = Observer::new(0.0);
        observer.set_speed_demanded(true);
        let mut last = position(0.0).floor() as i32;
        for sample in 1..=(seconds / SAMPLE_S) as u32 {
            if sample % 50 == 1 {
                observer.set_voltage(&plant, Some(voltage), 1.0);
            }
            let now = position(f64::from(sample) * 1e-3).floor() as i32;
            observer.predict(&plant);
            let _ = observer.update(&plant, now - last, false);
            last = now;
        }
        observer
    }

    #[test]
    fn a_steady_speed_and_its_load_are_estimated() {
        for speed in [40.0f64, -80.0, 700.0, -2_500.0] {
            // The voltage that keeps the speed without a load, and half a volt against a load.
            let (b, _, q) = PLANT;
            let load = 0.5 * b;
            let voltage = q * speed as f32 / b + 0.5;
            let observer = estimate(4.0, voltage, |t| 0.5 + speed * t);
            let found = f64::from(observer.speed());
            assert!((found - speed).abs() < 0.02 * speed.abs() + 0.1, "{found} for {speed}");
            // At a steady speed b u - q w + d = 0.
            let found = observer.load();
            assert!((found + load).abs() < 0.1 * load, "{found} for {load} at {speed}");
        }
    }

    /// Estimates the motion of a motor that turns at 20 counts/s for 4 s and then stands for this time.
    fn stopped(seconds: f32) -> (Observer, Plant) {
        let (b, _, q) = PLANT;
        let voltage = q * 20.0 / b;
        (estimate(4.0 + seconds, voltage, |t| 20.0 * t.min(4.0) + 0.3), plant())
    }

    #[test]
    fn a_late_count_lowers_the_reported_speed_but_not_the_state() {
        let (observer, plant) = stopped(0.075);
        assert!((observer.speed() - 20.0).abs() < 1.0, "{}", observer.speed());
        // A count was due after 35 ms.
        let reported = observer.with_late_count(&plant).speed();
        assert!(reported < observer.speed() - 0.5, "{reported} of {}", observer.speed());
    }

    #[test]
    fn the_speed_and_the_load_of_a_stopped_motor_are_estimated() {
        let (observer, plant) = stopped(1.0);
        let estimate = observer.with_late_count(&plant);
        // The estimate may wander within its count.
        assert!(estimate.speed().abs() < 3.0, "{}", estimate.speed());
        // The voltage that drove the motor at 20 counts/s now presses it against the stop.
        let (_, _, q) = PLANT;
        let load = estimate.load();
        assert!((load + 20.0 * q).abs() < 30.0, "{load} for {}", -20.0 * q);
    }

    /// Returns the largest speed of the estimate within a second in which the motor should stand, in counts/s.
    fn fastest(observer: &mut Observer, plant: &Plant, position: impl Fn(u32) -> f64) -> f32 {
        let mut fastest = 0.0f32;
        for sample in 1..=1_000 {
            observer.predict(plant);
            let moved = position(sample).floor() - position(sample - 1).floor();
            let _ = observer.update(plant, moved as i32, true);
            fastest = fastest.max(observer.speed().abs());
        }
        fastest
    }

    #[test]
    fn a_count_after_x_has_crept_along_the_other_edge_is_no_sudden_motion() {
        let plant = plant();
        // The estimate goes slowly to one edge of its count. The shaft goes slowly to the other edge.
        let mut observer = Observer::new(1.0);
        let fastest = fastest(&mut observer, &plant, |sample| 0.7 - 1e-3 * f64::from(sample));
        assert!(fastest < 12.0, "{fastest} of 1 count/s");
    }

    #[test]
    fn a_motor_at_rest_has_no_speed() {
        let observer = estimate(2.0, 0.0, |_| 0.3);
        assert!(observer.speed().abs() < 0.5, "{}", observer.speed());
    }
}
