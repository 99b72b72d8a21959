//! Computes the voltage or control value of a motor at each tick: two regulators behind one interface.
//!
//! * **Model** is the default. An observer estimates position, speed and load at each sample of the encoder. The law
//!   computes in closed form the voltage that brings the motor to the demanded speed by the next tick. Nothing
//!   integrates, so nothing winds up. For an *unknown motor*, which has no configured [`Dynamics`], the regulator
//!   estimates the acceleration per volt while the motor works.
//! * **PID** runs for a motor with coefficients of a host: a velocity loop, and a position loop above it. Speeds come
//!   from the same observer.
//!
//! A change of mode, of coefficients or of the regulator makes no step of current.
//!
//! ```text
//! samples ─▶ observer ─▶ position, speed, load ─▶ law or PID ─▶ Output ─▶ modulator
//!             ▲    │                                                         │
//!             │    └─▶ corrections ─▶ gain estimate of an unknown motor      │
//!             └─────────────────────── applied voltage ◀─────────────────────┘
//! ```
//!
//! ```
//! use motor_hub::braking::Winding;
//! use motor_hub::bridge::BridgeConstants;
//! use motor_hub::regulator::{Dynamics, Mechanics};
//!
//! // A bare NeveRest 60: rotor alone, in SI units.
//! let rotor = Mechanics {
//!     torque_constant: 0.0178,
//!     counts_per_turn: 28.0,
//!     inertia: 1.0e-5,
//!     drag: 1.4e-6,
//!     friction: 0.0,
//! };
//! let dynamics =
//!     Dynamics::from_mechanics(&Winding::NEVEREST_60, &BridgeConstants::IDEAL, &rotor).expect("in range");
//! assert_eq!(dynamics.gain.to_f32().round(), 2_333.0); // counts/s² per volt
//! assert!((1.0 / dynamics.decay.to_f32() - 0.1).abs() < 0.01); // mechanical time constant, s
//! ```

mod dynamics;
mod gain;
pub mod identify;
mod interface;
mod loops;
mod model;
mod observer;

pub use dynamics::{Dynamics, Mechanics};
pub use interface::{Config, Demand, Effort, Kind, Output, Reference, Stage};
pub use loops::Coefficients;

use crate::braking::OperatingPoint;
use crate::motion::Reading;
use crate::units::single::{at_least, at_most};
use crate::units::{CountsPerSecond, Micros, Period, Voltage};
use gain::GainEstimate;
use loops::Loops;
use model::{Law, State};
use observer::{FASTEST_CPS, Observer, Plant};

/// Longest time between two samples of the encoder, in samples of 1 ms. After a longer gap the observer starts again
/// with the mean speed of the gap. A prediction without a sample ends there too.
const LONGEST_GAP_SAMPLES: u32 = 300;
/// Time in ms without a count after which a motor that should turn counts as stalled.
const STALLED_MS: u32 = 100;
/// Age of the last edge in us from which on a stop may hold a motor that should turn. Samples without a count then do
/// not update the gain.
const UNCERTAIN_EDGE_MICROS: u64 = 50_000;
/// Age of the last edge in us from which on a motor with an open bridge is at rest.
const REST_MICROS: u64 = 300_000;
/// Lowest demanded speed at which counts are due: four counts within [`STALLED_MS`].
const COUNTS_DUE_SPEED: CountsPerSecond = CountsPerSecond::from_bits(40 << 8);

/// Least acceleration per volt as a share of the configured or estimated one: the load may be heavier than configured.
const LEAST_GAIN_SHARE: f32 = 0.7;

/// Largest error of the speed, as its back EMF in V, at which a motor has reached its demanded speed.
const AT_SPEED_VOLTS: f32 = 1.0;

/// The regulator of one motor.
#[derive(Clone, Debug)]
pub struct Regulator {
    config: Config,
    period: Period,
    motion: Motion,
    /// Estimate of the acceleration per volt, used for an unknown motor only.
    gain_estimate: GainEstimate,
    loops: Loops,
    /// Last sample of the encoder; `None` before the first one.
    last: Option<Reading>,
    /// Time to which the observer has predicted the motion.
    predicted_until: Micros,
    /// Position in counts at which a motor with the demanded speed 0 came to rest; `None` before that.
    rest_position: Option<i32>,
    /// Time in ms for which a motor that should turn has not moved.
    stalled_ms: u32,
    /// The demanded speed is at least [`COUNTS_DUE_SPEED`].
    counts_due: bool,
    /// The error of the speed was below [`AT_SPEED_VOLTS`] at the last tick.
    at_speed: bool,
    /// The demand is a speed, not a position.
    speed_demanded: bool,
    /// Voltage across the motor; `None` while the bridge is open.
    voltage: Option<Voltage>,
}

/// Constants of a motor, and the estimate of its motion.
#[derive(Clone, Copy, Debug)]
struct Motion {
    plant: Plant,
    law: Law,
    observer: Observer,
    /// State of the law.
    state: State,
}

impl Motion {
    /// Uses the configured dynamics, or the estimated gain of an unknown motor.
    fn new(config: &Config, gain_estimate: &GainEstimate, period: Period, observer: Observer) -> Self {
        let kappa = config.emf.to_volts();
        let (b, q, friction) = match config.dynamics {
            Some(dynamics) => (dynamics.gain.to_f32(), dynamics.decay.to_f32(), dynamics.friction.to_volts()),
            None => (gain_estimate.gain(), gain_estimate.gain() * kappa, 0.0),
        };
        let plant = Plant::new(b, kappa, q, Law::filter(period));
        let law = Law::new(&plant, friction, period, config.acceleration);
        Self { plant, law, observer, state: State::default() }
    }
}

impl Regulator {
    /// Creates the regulator of a motor at rest that is stepped every `period`.
    pub fn new(config: Config, period: Period) -> Self {
        let gain_estimate = GainEstimate::new(config.emf.to_volts());
        let motion = Motion::new(&config, &gain_estimate, period, Observer::new(0.0));
        Self {
            config,
            period,
            motion,
            gain_estimate,
            loops: Loops::default(),
            last: None,
            predicted_until: Micros::new(0),
            rest_position: None,
            stalled_ms: 0,
            counts_due: false,
            at_speed: true,
            speed_demanded: false,
            voltage: None,
        }
    }

    /// Replaces the configuration at the next step. The estimate of the motion is kept, so the motor may run meanwhile.
    pub fn configure(&mut self, config: Config) {
        if config == self.config {
            return;
        }
        if config.emf != self.config.emf {
            self.gain_estimate = GainEstimate::new(config.emf.to_volts());
        }
        let mut new = Motion::new(&config, &self.gain_estimate, self.period, self.present_state());
        let voltage = self.voltage.map(Voltage::to_volts);
        if self.config.dynamics != config.dynamics {
            // The old load was estimated with other constants.
            if self.at_speed {
                new.observer.assume_steady(&new.plant, voltage);
            } else if self.config.dynamics.is_none() {
                new.observer.keep_load_voltage(&self.motion.plant, &new.plant);
            }
        }
        new.observer.drive(&new.plant, voltage);
        self.motion = new;
        self.config = config;
        self.gain_estimate.restart();
        self.keep_current();
    }

    /// PID keeps the present current at the next step, although its coefficients or the meaning of control values have
    /// changed.
    pub fn keep_current(&mut self) {
        self.loops.keep_current(self.voltage.is_some());
    }

    /// Reacts to a changed set-point: a stalled motor [leaves its stop](Self::leave_stop).
    pub fn retarget(&mut self) {
        self.rest_position = None;
        if self.is_stalled() {
            self.leave_stop();
        }
        self.stalled_ms = 0;
    }

    /// Reacts to a set-point of another kind: the position loop forgets its past.
    pub fn change_mode(&mut self) {
        self.loops.restart_position();
    }

    /// Begins regulation at the next step with the present current.
    pub fn resume(&mut self) {
        self.loops.resume();
    }

    /// Begins regulation at the next step with a current of zero.
    pub fn start_at_zero_current(&mut self) {
        self.loops.start_at_zero_current();
    }

    /// Forgets the load of a stop, against which the motor was pressed. Regulation begins with a current of zero.
    pub fn leave_stop(&mut self) {
        self.loops.start_at_zero_current();
        self.stalled_ms = 0;
        self.motion.observer.forget_load();
        // An estimate from an encoder that may be reversed is discarded.
        if self.config.dynamics.is_none() && !self.gain_estimate.is_trusted() {
            self.gain_estimate = GainEstimate::new(self.config.emf.to_volts());
            self.use_estimated_gain();
        }
    }

    /// Prepares the constants of an unknown motor by its gain estimate. Estimate and state of the motion are kept.
    fn use_estimated_gain(&mut self) {
        let new = Motion::new(&self.config, &self.gain_estimate, self.period, self.motion.observer);
        self.motion = Motion { state: self.motion.state, ..new };
    }

    /// Takes a sample of the encoder, best every millisecond with a jitter below 0.5 ms.
    pub fn sample(&mut self, reading: Reading) {
        let Some(last) = &mut self.last else {
            (self.last, self.predicted_until) = (Some(reading), reading.at);
            return;
        };
        let moved = reading.position.wrapping_sub(last.position);
        let before = last.at;
        *last = reading;
        if reading.at == before {
            return;
        }
        let gap = samples(before, reading.at);
        let passed =
            if self.predicted_until == before { gap } else { samples(self.predicted_until, reading.at) };
        self.predict(passed, reading.at);
        let stalled = self.is_stalled();
        let Motion { plant, observer, .. } = &mut self.motion;
        if gap > LONGEST_GAP_SAMPLES {
            *observer = Observer::new(within(1_000.0 * moved as f32 / gap as f32, FASTEST_CPS));
            self.gain_estimate.restart();
        } else if let Some(correction) = observer.update(plant, moved, self.speed_demanded)
            && self.config.dynamics.is_none()
        {
            let uncertain = self.counts_due && reading.at.since(reading.edge_at) >= UNCERTAIN_EDGE_MICROS;
            self.gain_estimate.correct(&correction, moved, uncertain || stalled);
        }
    }

    /// Predicts the motion to a time without a sample, at most 300 ms ahead.
    pub fn predict_until(&mut self, now: Micros) {
        self.predict(samples(self.predicted_until, now), now);
    }

    /// Predicts the motion to `now`, which is `passed` samples after the last prediction.
    fn predict(&mut self, passed: u32, now: Micros) {
        if passed == 0 {
            return;
        }
        self.predicted_until = now;
        let Motion { plant, observer, .. } = &mut self.motion;
        for _ in 0..passed.min(LONGEST_GAP_SAMPLES) {
            if self.config.dynamics.is_none() {
                self.gain_estimate.predict(plant, observer.speed());
            }
            observer.predict(plant);
        }
    }

    /// Begins a control tick, after its newest sample. An estimate that has overflowed is reset, and a motor at rest
    /// gets the speed 0.
    pub fn tick(&mut self) {
        let observer = &mut self.motion.observer;
        // With implausible constants the estimate may grow until it overflows.
        if !(observer.speed() + observer.fraction()).is_finite() {
            *observer = Observer::new(0.0);
            self.gain_estimate.restart();
        }
        let still = |last: &Reading| last.at.since(last.edge_at) >= REST_MICROS;
        if self.voltage.is_none() && self.last.as_ref().is_some_and(still) {
            observer.rest();
            self.gain_estimate.rest();
        }
    }

    /// Puts the estimated gain of an unknown motor in force, if the gain has changed since the last tick.
    pub fn update_gain(&mut self) {
        if self.config.dynamics.is_none()
            && let Some(shift) = self.gain_estimate.tick()
        {
            self.use_estimated_gain();
            let Motion { plant, observer, .. } = &mut self.motion;
            observer.shift(&shift);
            observer.drive(plant, self.voltage.map(Voltage::to_volts));
        }
    }

    /// The estimate of the motion at this moment, corrected by a late count if there is one.
    fn present_state(&self) -> Observer {
        let Motion { plant, observer, .. } = &self.motion;
        // Whether a count is late is known only at a sample.
        let sampled = self.last.is_some_and(|last| last.at == self.predicted_until);
        if sampled { observer.with_late_count(plant) } else { *observer }
    }

    /// The estimated speed.
    pub fn velocity(&self) -> CountsPerSecond {
        let observer = &self.motion.observer;
        // This runs after every sample, so the observer is copied only while a count is late.
        speed(if observer.is_late() { self.present_state().speed() } else { observer.speed() })
    }

    /// Acceleration by load and drag at this moment, in counts/s².
    fn external_acceleration(&self) -> f32 {
        let Motion { plant, observer, .. } = &self.motion;
        if observer.is_late() {
            self.present_state().external_acceleration(plant)
        } else {
            observer.external_acceleration(plant)
        }
    }

    /// The voltage beyond the back EMF that would keep the speed against load, drag and friction; `None` for an unknown
    /// motor.
    pub fn load(&self) -> Option<Voltage> {
        let plant = &self.motion.plant;
        self.config.dynamics.map(|_| Voltage::from_volts(-self.external_acceleration() / plant.b))
    }

    /// Acceleration by load and drag as of the last count, in counts/s².
    pub fn disturbance(&self) -> f32 {
        let Motion { plant, observer, .. } = &self.motion;
        observer.external_acceleration(plant)
    }

    /// True if the motor should turn, but has sent no count for a while.
    pub const fn is_stalled(&self) -> bool {
        self.stalled_ms >= STALLED_MS
    }

    /// Acceleration per volt in counts/s²: configured, estimated or the initial guess.
    pub const fn gain(&self) -> f32 {
        self.motion.plant.b
    }

    /// Lower bound of the acceleration per volt in counts/s²; `None` for an unknown motor whose estimate does not yet
    /// show a heavy load.
    pub fn least_gain(&self) -> Option<f32> {
        let known = self.config.dynamics.is_some() || self.gain_estimate.is_heavy();
        known.then_some(LEAST_GAIN_SHARE * self.motion.plant.b)
    }

    /// The kind of regulator that the configuration selects.
    pub const fn kind(&self) -> Kind {
        match self.config.coefficients {
            None => Kind::Model,
            Some(_) => Kind::Pid,
        }
    }

    /// The speed that a demand requests far from its target.
    pub fn demanded_speed(&self, demand: Demand) -> CountsPerSecond {
        match demand {
            Demand::Velocity(target) => target,
            Demand::Follow(reference) => reference.next,
            Demand::Position { target, speed_limit } => {
                let limit = speed_limit.to_f32().abs();
                let distance = target.wrapping_sub(self.position());
                speed(limit * distance.signum() as f32)
            }
        }
    }

    /// Position of the last sample, in counts; 0 before the first one.
    fn position(&self) -> i32 {
        self.last.map_or(0, |last| last.position)
    }

    /// Computes the output for this tick. `moved` is the counts since the last tick.
    // The budget of the regulator is counted by this symbol.
    #[inline(never)]
    pub fn step(&mut self, demand: Demand, moved: i32, stage: &Stage<'_>) -> Output {
        let demand = self.hold_at_standstill(demand);
        self.speed_demanded = matches!(demand, Demand::Velocity(_));
        let position = self.position();
        let velocity = self.velocity();
        let request = match &self.config.coefficients {
            None => self.by_model(demand, position, stage),
            Some(coefficients) => {
                let gain = self.motion.plant.b;
                // The voltage with which a PID loop starts, so that the current makes no step.
                let steady = match self.voltage {
                    Some(voltage) if self.loops.continues() => voltage,
                    _ if self.loops.is_running() => Voltage::from_volts(0.0),
                    _ => self.steady_voltage(velocity),
                };
                let context = loops::Context { coefficients, period: self.period, gain, steady, stage };
                self.loops.step(demand, position, velocity, &context)
            }
        };
        let error = request.speed.to_f32() - velocity.to_f32();
        self.at_speed = self.config.emf.emf(speed(error)).to_volts().abs() < AT_SPEED_VOLTS;
        self.counts_due = request.speed.to_bits().unsigned_abs() >= COUNTS_DUE_SPEED.to_bits().unsigned_abs();
        self.stalled_ms = if self.counts_due && moved == 0 {
            self.stalled_ms.saturating_add(self.period.as_millis())
        } else {
            0
        };
        request
    }

    /// The voltage, or less of it where the motor would become faster than the limit in the direction of its current. A motor
    /// that is faster brakes with at most the current that the voltage means.
    pub fn limit_speed(&self, voltage: Voltage, limit: CountsPerSecond, at: OperatingPoint) -> Voltage {
        let Motion { plant, law, .. } = &self.motion;
        let emf = at.emf_volts();
        let beyond_emf = voltage.to_volts() - emf;
        let side = 1.0f32.copysign(beyond_emf);
        let target = side * limit.to_f32().abs();
        let most = side * (law.voltage_for_speed(&self.present_state(), plant, target) - emf);
        Voltage::from_volts(emf + side * within(most, beyond_emf.abs()))
    }

    /// Computes the output by the motor's model, at this position in counts.
    fn by_model(&mut self, demand: Demand, position: i32, stage: &Stage<'_>) -> Output {
        let mut present = self.present_state();
        let load = present.load();
        let Motion { plant, law, observer, state } = &mut self.motion;
        let request = match demand {
            Demand::Velocity(target) => law.velocity(state, &mut present, plant, target.to_f32(), stage),
            Demand::Follow(reference) => {
                let speeds = (reference.speed.to_f32(), reference.next.to_f32());
                law.follow(state, &mut present, plant, reference.from(position), speeds, stage)
            }
            Demand::Position { target, speed_limit } => {
                let distance = target.wrapping_sub(position);
                let limit = speed_limit.to_f32().abs();
                law.position(state, &mut present, plant, distance, limit, stage)
            }
        };
        // `present` is a copy: a friction that the law has reversed is reversed in the observer too.
        observer.add_load(present.load() - load);
        request
    }

    /// The voltage whose current balances the estimated load, or no current at all after a start at zero current.
    fn steady_voltage(&self, velocity: CountsPerSecond) -> Voltage {
        let plant = &self.motion.plant;
        let load_volts =
            if self.loops.starts_at_zero_current() { 0.0 } else { -self.external_acceleration() / plant.b };
        Voltage::from_volts(self.config.emf.emf(velocity).to_volts() + load_volts)
    }

    /// Replaces the demanded speed 0 by the position at which the motor came to rest, and a reference that stands
    /// still by its position.
    fn hold_at_standstill(&mut self, demand: Demand) -> Demand {
        let target = match demand {
            Demand::Velocity(target) => target,
            Demand::Follow(reference) if reference.is_still() => {
                return Demand::Position { target: reference.position, speed_limit: CountsPerSecond::MAX };
            }
            Demand::Follow(_) | Demand::Position { .. } => return demand,
        };
        if target != CountsPerSecond::ZERO {
            self.rest_position = None;
            return demand;
        }
        let counts = self.velocity().to_f32().abs() * self.period.as_millis().max(20) as f32 / 1000.0;
        if self.rest_position.is_none() && counts < 1.0 {
            self.rest_position = Some(self.position());
        }
        match self.rest_position {
            Some(target) => Demand::Position { target, speed_limit: CountsPerSecond::MAX },
            None => demand,
        }
    }

    /// Sets the voltage that the bridge applies from now on; `None` if the bridge is open.
    pub fn drive(&mut self, voltage: Option<Voltage>) {
        if voltage.is_none() {
            self.retarget();
            self.loops.restart_position();
            self.loops.resume();
            self.at_speed = true;
            self.speed_demanded = false;
        }
        self.voltage = voltage;
        let volts = voltage.map(Voltage::to_volts);
        self.gain_estimate.drive(volts);
        let Motion { plant, observer, .. } = &mut self.motion;
        observer.drive(plant, volts);
    }
}

/// Samples of 1 ms from one time to another, rounded. A division of 32 bits is shorter than one of 64 bits.
fn samples(from: Micros, to: Micros) -> u32 {
    u32::try_from(to.since(from)).unwrap_or(u32::MAX).saturating_add(500) / 1000
}

/// Converts a speed from counts/s; saturates at [`FASTEST_CPS`].
fn speed(counts_per_second: f32) -> CountsPerSecond {
    CountsPerSecond::from_f32(within(counts_per_second, FASTEST_CPS))
}

/// Limits a value to -`limit` to `limit`. NaN becomes `-limit`.
const fn within(value: f32, limit: f32) -> f32 {
    at_most(at_least(value, -limit), limit)
}
