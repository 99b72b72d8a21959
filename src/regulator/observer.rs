//! Where a motor is between its counts, how fast it turns and what pulls on it: a filter of three states,
//! stepped with every sample of the encoder.
//!
//! Between counts the motor's own equation is integrated. A sample with a count says between which two places the
//! shaft is, and so does one without; only what lies outside is corrected, to the nearer end. (To correct towards
//! the middle makes noise: at 1000 counts/s every sample sees one count, wherever in it the shaft is.)
//!
//! What a count says when it comes at last is more than what every sample said that waited for it: not that the motor
//! crept along the count's edge, but how long it took for the way. So a late count corrects nothing until it comes;
//! who looks meanwhile [sees](Observer::seen) the state as if it came now. Once it is late by a whole one it may not come
//! at all: from then on every sample without a count says that the motor does not move, as it does of one that should stand.
//!
//! The gains grow with the time that such news took: they are those of a filter with three equal poles at
//! `exp(-wo t)`, t after the last news, so a motor at 5 counts/s is followed as surely as one at 5000.
//!
//! ```text
//! z = max(floor, exp(-wo t))
//! gains: 1 - z^3 of the position, 1.5 (1 - z)^2 (1 + z) / t of the speed, (1 - z)^3 / t^2 of the load
//! ```

use super::gain::Sensitivity;
use super::within;
use crate::units::single::{at_least, at_most};
use libm::{cbrtf, expf, expm1f};

/// Seconds between two samples.
pub(super) const SAMPLE: f32 = 1e-3;
/// No load accelerates a motor by more than so many times what the battery's 12 V do; a filter that believes so
/// was given nonsense.
const HEAVIEST_LOAD: f32 = 20.0 * 12.0;
/// By so many counts a state may be ahead of an encoder that says nothing.
const LATE: f32 = 1.0;
/// Counts/s: beyond what any encoder's timer could count, and far within what a single can add 1/1000 to.
pub(super) const FASTEST: f32 = 1e6;

/// The motor's constants as the filter needs them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plant {
    /// Counts/s² per volt.
    pub(super) b: f32,
    /// Volts per count/s.
    pub(super) kappa: f32,
    /// Of an acceleration, 1/s.
    pub(super) q: f32,
    /// What drag adds to q: q - b kappa. Constants by which drag would drive the motor are taken for none.
    pub(super) drag: f32,
    /// What an acceleration that decays with q makes of the speed and the position in a sample, per acceleration.
    driven: (f32, f32),
    /// The same two while the bridge is open, where only drag brakes.
    open: (f32, f32),
    /// What is left of z after a sample,
    fade: f32,
    /// and in the end.
    floor: f32,
}

impl Plant {
    /// The filter's wo is `poles` (1/s) where the motor is quick enough to be followed so fast; z is never less
    /// than `floor`: older news count for no more.
    pub(super) fn new(b: f32, kappa: f32, q: f32, (poles, floor): (f32, f32)) -> Self {
        let drag = at_least(q - b * kappa, 0.0);
        let poles = at_most(poles, cbrtf(11.0 * 12.0 * b));
        Self { b, kappa, q, drag, driven: gains(q), open: gains(drag), fade: expf(-poles * SAMPLE), floor }
    }

    /// What a voltage accelerates a motor at this speed by, an open bridge not at all.
    fn push(&self, voltage: Option<f32>, w: f32) -> f32 {
        voltage.map_or(0.0, |u| self.b * (u - self.kappa * w))
    }
}

/// What an acceleration that decays at this rate (1/s) makes of speed and position in a sample.
fn gains(rate: f32) -> (f32, f32) {
    let x = rate * SAMPLE;
    // Series where the quotients would cancel.
    if x > 1e-2 {
        let k1 = -expm1f(-x) / rate;
        (k1, (SAMPLE - k1) / rate)
    } else {
        (SAMPLE * (1.0 - x / 2.0), SAMPLE * SAMPLE * (0.5 - x / 6.0))
    }
}

/// How an error of the predicted position was shared out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Correction {
    /// The shaft was this much further than predicted, in counts.
    pub(super) error: f32,
    /// Time since the correction before, in s.
    pub(super) age: f32,
    /// What each count of the error changed the position by,
    pub(super) position: f32,
    /// the speed, in counts/s,
    pub(super) speed: f32,
    /// and the load, in counts/s².
    pub(super) load: f32,
}

/// What is known of the motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observer {
    /// Within the present count, 0 to 1; beyond it while the next is late.
    x: f32,
    /// Speed, counts/s.
    w: f32,
    /// Load, counts/s².
    d: f32,
    /// Acceleration, counts/s².
    acceleration: f32,
    /// The bridge is open: nothing but drag and load acts.
    coasting: bool,
    /// Seconds since the last news,
    age: f32,
    /// and exp(-wo age).
    z: f32,
    /// A count was late by a whole one, and none has come since.
    silent: bool,
}

impl Observer {
    /// In the middle of a count, at this speed, without acceleration under the voltage that acts.
    pub(super) fn new(w: f32) -> Self {
        Self { x: 0.5, w, d: 0.0, acceleration: 0.0, coasting: true, age: 0.0, z: 1.0, silent: false }
    }

    /// One sample later.
    pub(super) fn predict(&mut self, plant: &Plant) {
        let (k1, k2) = if self.coasting {
            self.acceleration = self.load(plant);
            plant.open
        } else {
            plant.driven
        };
        self.x += self.w * SAMPLE + self.acceleration * k2;
        let gained = self.acceleration * k1;
        self.w += gained;
        self.acceleration -= plant.q * gained;
        self.age += SAMPLE;
        self.z = at_least(self.z * plant.fade, plant.floor);
    }

    /// Since the last of these the encoder has moved by so many counts. Of a motor that should turn a late count is waited
    /// for.
    pub(super) fn see(&mut self, plant: &Plant, moved: i32, turning: bool) -> Option<Correction> {
        if moved == 0 {
            let late = if turning && !self.silent { LATE } else { 0.0 };
            if (-late..=1.0 + late).contains(&self.x) {
                return None;
            }
            self.silent = true;
            return self.confine(plant, 0.0, 1.0);
        }
        self.silent = false;
        self.x -= moved as f32;
        // A count came at some time since the last sample; how far the shaft went since then is not known.
        let since = at_most(self.w.abs() * SAMPLE, 1.0);
        let (least, most) = if moved > 0 { (0.0, since) } else { (1.0 - since, 1.0) };
        self.confine(plant, least, most)
    }

    /// The next count is late.
    pub(super) fn is_late(&self) -> bool {
        !(0.0..=1.0).contains(&self.x)
    }

    /// As if a count that is late came now: what is known of the motion at this moment.
    pub(super) fn seen(&self, plant: &Plant) -> Self {
        let mut seen = *self;
        let _ = seen.confine(plant, 0.0, 1.0);
        seen
    }

    /// The shaft is between these two places.
    fn confine(&mut self, plant: &Plant, least: f32, most: f32) -> Option<Correction> {
        if self.x < least {
            Some(self.correct(plant, least - self.x))
        } else if self.x > most {
            Some(self.correct(plant, most - self.x))
        } else {
            None
        }
    }

    /// The shaft is so much further than it was thought to be.
    fn correct(&mut self, plant: &Plant, error: f32) -> Correction {
        let (z, faded) = (self.z, 1.0 - self.z);
        let rate = 1.0 / at_least(self.age, SAMPLE);
        let square = faded * faded;
        let correction = Correction {
            error,
            age: self.age,
            position: 1.0 - z * z * z,
            speed: 1.5 * square * (1.0 + z) * rate,
            load: square * faded * rate * rate,
        };
        let (of_speed, of_load) = (correction.speed * error, correction.load * error);
        self.x += correction.position * error;
        self.w = within(self.w + of_speed, FASTEST);
        let heaviest = HEAVIEST_LOAD * plant.b;
        self.d = within(self.d + of_load, heaviest);
        let fastest = 2.0 * heaviest + plant.q * FASTEST;
        self.acceleration = within(self.acceleration + of_load - plant.q * of_speed, fastest);
        self.age = 0.0;
        self.z = 1.0;
        correction
    }

    /// It stands, and nothing pulls on it: by itself what is thought of it would wander to and fro within its count.
    pub(super) const fn rest(&mut self) {
        // A count that was late does not come any more.
        self.x = at_most(at_least(self.x, 0.0), 1.0);
        (self.w, self.d, self.acceleration) = (0.0, 0.0, 0.0);
    }

    /// From now on the bridge makes this voltage of the motor; `None` if it is open.
    pub(super) fn drive(&mut self, plant: &Plant, voltage: Option<f32>) {
        self.coasting = voltage.is_none();
        self.acceleration = plant.push(voltage, self.w) + self.load(plant);
    }

    /// What accelerates the motor while the bridge is open: load and drag, counts/s².
    pub(super) fn load(&self, plant: &Plant) -> f32 {
        self.d - plant.drag * self.w
    }

    /// Takes what the motor does under this voltage for steady: the rest must be load.
    pub(super) fn settle(&mut self, plant: &Plant, voltage: Option<f32>) {
        self.d = plant.drag * self.w - plant.push(voltage, self.w);
    }

    /// The constants have changed: the load in volts is taken to be the same as before.
    pub(super) fn keep_load_voltage(&mut self, old: &Plant, new: &Plant) {
        self.d *= new.b / old.b;
    }

    /// The gain that this state was found with has become another.
    pub(super) fn shift(&mut self, by: &Sensitivity) {
        self.w = within(self.w + by.speed, FASTEST);
        self.d += by.load;
    }

    /// The load was a stop's: it is gone when nothing presses against it.
    pub(super) fn forget_load(&mut self) {
        self.d = 0.0;
    }

    /// The load has changed by this much, as friction does when the motion turns.
    pub(super) fn add_load(&mut self, by: f32) {
        self.d += by;
    }

    /// Counts/s.
    pub(super) fn speed(&self) -> f32 {
        self.w
    }

    /// Load, counts/s².
    pub(super) fn disturbance(&self) -> f32 {
        self.d
    }

    /// Within the present count.
    pub(super) fn fraction(&self) -> f32 {
        self.x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLANT: (f32, f32, f32) = (1_500.0, 0.004, 7.0);

    fn plant() -> Plant {
        let (b, kappa, q) = PLANT;
        Plant::new(b, kappa, q, (40.0, 0.25))
    }

    /// Follows a motor whose position is a function of the time in seconds; counts are whole.
    fn follow(seconds: f32, voltage: f32, position: impl Fn(f64) -> f64) -> Observer {
        let plant = plant();
        let mut observer = Observer::new(0.0);
        let mut last = position(0.0).floor() as i32;
        for sample in 1..=(seconds / SAMPLE) as u32 {
            if sample % 50 == 1 {
                observer.drive(&plant, Some(voltage));
            }
            let now = position(f64::from(sample) * 1e-3).floor() as i32;
            observer.predict(&plant);
            let _ = observer.see(&plant, now - last, true);
            last = now;
        }
        observer
    }

    #[test]
    fn a_steady_speed_is_found_with_the_load_that_belongs_to_it() {
        for speed in [40.0f64, -80.0, 700.0, -2_500.0] {
            // What the speed takes, and half a volt against a load.
            let (b, _, q) = PLANT;
            let load = 0.5 * b;
            let voltage = q * speed as f32 / b + 0.5;
            let observer = follow(4.0, voltage, |t| 0.5 + speed * t);
            let found = f64::from(observer.speed());
            assert!((found - speed).abs() < 0.02 * speed.abs() + 0.1, "{found} for {speed}");
            // b u - q w + d = 0
            let found = observer.disturbance();
            assert!((found + load).abs() < 0.1 * load, "{found} for {load} at {speed}");
        }
    }

    /// 20 counts/s for 4 s and 0.3 counts, then not a count more.
    fn held(seconds: f32) -> (Observer, Plant) {
        let (b, _, q) = PLANT;
        let voltage = q * 20.0 / b;
        (follow(4.0 + seconds, voltage, |t| 20.0 * t.min(4.0) + 0.3), plant())
    }

    #[test]
    fn a_count_that_is_late_slows_the_motor_in_the_eyes_of_who_looks_and_nothing_else_before_it_comes() {
        let (observer, plant) = held(0.075);
        assert!((observer.speed() - 20.0).abs() < 1.0, "{}", observer.speed());
        // A count was due after 35 ms.
        let seen = observer.seen(&plant).speed();
        assert!(seen < observer.speed() - 0.5, "{seen} of {}", observer.speed());
    }

    #[test]
    fn a_motor_that_is_held_is_known_to_stand_and_by_which_load() {
        let (observer, plant) = held(1.0);
        let seen = observer.seen(&plant);
        // Within its count it may still wander.
        assert!(seen.speed().abs() < 3.0, "{}", seen.speed());
        // q w kept it turning; the same holds it now.
        let (_, _, q) = PLANT;
        let load = seen.disturbance();
        assert!((load + 20.0 * q).abs() < 30.0, "{load} for {}", -20.0 * q);
    }

    #[test]
    fn a_motor_at_rest_is_known_to_rest() {
        let observer = follow(2.0, 0.0, |_| 0.3);
        assert!(observer.speed().abs() < 0.5, "{}", observer.speed());
    }
}
