//! From what a motor should do to the control value for this tick: two regulators behind one interface.
//!
//! * **Model**, the default. An observer follows position, speed and load from sample to sample. The voltage that
//!   brings the motor to the speed it should have at the next tick follows in closed form. Nothing integrates, so
//!   nothing winds up. Of an unknown motor, for which no [`Dynamics`] are configured, the regulator estimates the
//!   acceleration per volt while the motor works.
//! * **PID**, for a motor with coefficients of a host: the velocity loop, and the position loop above it. Its speeds come
//!   from the same observer.
//!
//! Both end in a control value, which S, T, Z and G judge. A change of mode, of coefficients or of the regulator makes no
//! step of current.
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

mod cells;
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
use observer::{FASTEST, Observer, Plant};

/// An encoder that was silent for longer than this is started with afresh.
const SILENCE_SAMPLES: u32 = 300;
/// Time without a count after which a motor that should turn counts as held, in ms.
const HELD_MS: u32 = 100;
/// Time without a count, in us, from which on a motor that should turn teaches nothing: a stop may hold it.
const SILENT_MICROS: u64 = 50_000;
/// A motor whose bridge is open, and of which no count came for so long, rests.
const REST_MICROS: u64 = 300_000;
/// Speed asked for at which counts are due in that time.
const COUNTING_SPEED: CountsPerSecond = CountsPerSecond::from_bits(40 << 8);

/// A motor may be heavier than told: its acceleration per volt is at least this share of that.
const TOLD_SHARE: f32 = 0.7;

/// Back EMF of the error of a speed that is as it should be.
const STEADY_VOLTS: f32 = 1.0;

/// The regulator of one motor.
#[derive(Clone, Debug)]
pub struct Regulator {
    config: Config,
    period: Period,
    motion: Motion,
    /// Estimates the gain of an unknown motor.
    estimate: GainEstimate,
    loops: Loops,
    last: Option<Reading>,
    /// Until when the motion was followed.
    followed: Micros,
    /// Where a motor that should stand came to rest.
    anchor: Option<i32>,
    /// For how long it has not moved though it should.
    held_ms: u32,
    /// The motor should turn so fast that counts are due in [`HELD_MS`].
    due: bool,
    /// It turned as fast as it should.
    steady: bool,
    /// It should turn at some speed, wherever it is.
    turning: bool,
    /// What the bridge makes of the motor; `None` while it is open.
    voltage: Option<Voltage>,
}

/// What is known of a motor and what it does.
#[derive(Clone, Copy, Debug)]
struct Motion {
    plant: Plant,
    law: Law,
    observer: Observer,
    state: State,
}

impl Motion {
    /// Of a configured motor, or of an unknown one with the estimated gain.
    fn new(config: &Config, estimate: &GainEstimate, period: Period, observer: Observer) -> Self {
        let kappa = config.emf.to_volts();
        let (b, q, friction) = match config.dynamics {
            Some(known) => (known.gain.to_f32(), known.decay.to_f32(), known.friction.to_volts()),
            None => (estimate.gain(), estimate.gain() * kappa, 0.0),
        };
        let plant = Plant::new(b, kappa, q, Law::filter(period));
        let law = Law::new(&plant, friction, period, config.acceleration);
        Self { plant, law, observer, state: State::default() }
    }
}

impl Regulator {
    /// At rest, for a motor that is stepped every `period`.
    pub fn new(config: Config, period: Period) -> Self {
        let estimate = GainEstimate::new(config.emf.to_volts());
        let motion = Motion::new(&config, &estimate, period, Observer::new(0.0));
        Self {
            config,
            period,
            motion,
            estimate,
            loops: Loops::default(),
            last: None,
            followed: Micros::new(0),
            anchor: None,
            held_ms: 0,
            due: false,
            steady: true,
            turning: false,
            voltage: None,
        }
    }

    /// Takes effect at the next step. What is known of the motion is kept, so the motor may run meanwhile.
    pub fn configure(&mut self, config: Config) {
        if config == self.config {
            return;
        }
        if config.emf != self.config.emf {
            self.estimate = GainEstimate::new(config.emf.to_volts());
        }
        let mut new = Motion::new(&config, &self.estimate, self.period, self.seen());
        let voltage = self.voltage.map(Voltage::to_volts);
        if self.config.dynamics != config.dynamics {
            // What was load by other constants is not by these.
            if self.steady {
                new.observer.settle(&new.plant, voltage);
            } else if self.config.dynamics.is_none() {
                new.observer.keep_load_voltage(&self.motion.plant, &new.plant);
            }
        }
        new.observer.drive(&new.plant, voltage);
        self.motion = new;
        self.config = config;
        self.estimate.restart();
        self.loops.take_coefficients(self.voltage.is_some());
    }

    /// Control values mean other voltages at the next step; PID goes on from the present voltage.
    pub fn change_scheme(&mut self) {
        self.loops.take_coefficients(self.voltage.is_some());
    }

    /// Another thing is asked of the motor. One that was held lets go.
    pub fn retarget(&mut self) {
        self.anchor = None;
        if self.held_ms >= HELD_MS {
            self.let_go();
        }
        self.held_ms = 0;
    }

    /// Something of another kind is asked of the motor.
    pub fn change_mode(&mut self) {
        self.loops.restart_position();
    }

    /// The motor is regulated from now on: it goes on from what it does now.
    pub fn take_over(&mut self) {
        self.loops.resume();
    }

    /// The same, but what flows now is of no use for what comes.
    pub fn start_afresh(&mut self) {
        self.loops.start_afresh();
    }

    /// What pressed a motor against a stop is no load that the stop would take along.
    pub fn let_go(&mut self) {
        self.loops.start_afresh();
        self.held_ms = 0;
        self.motion.observer.forget_load();
        // An encoder in doubt has taught nothing.
        if self.config.dynamics.is_none() && !self.estimate.is_trusted() {
            self.estimate = GainEstimate::new(self.config.emf.to_volts());
            let new = Motion::new(&self.config, &self.estimate, self.period, self.motion.observer);
            self.motion = Motion { state: self.motion.state, ..new };
        }
    }

    /// Takes a sample of the encoder; best every millisecond, give or take less than half of that.
    pub fn sample(&mut self, reading: Reading) {
        let Some(last) = &mut self.last else {
            (self.last, self.followed) = (Some(reading), reading.at);
            return;
        };
        let moved = reading.position.wrapping_sub(last.position);
        let before = last.at;
        *last = reading;
        if reading.at == before {
            return;
        }
        let silence = samples(before, reading.at);
        let passed = if self.followed == before { silence } else { samples(self.followed, reading.at) };
        self.go_on(passed, reading.at);
        let Motion { plant, observer, .. } = &mut self.motion;
        if silence > SILENCE_SAMPLES {
            *observer = Observer::new(within(1_000.0 * moved as f32 / silence as f32, FASTEST));
            self.estimate.restart();
        } else if let Some(correction) = observer.see(plant, moved, self.turning)
            && self.config.dynamics.is_none()
        {
            let silent = self.due && reading.at.since(reading.edge_at) >= SILENT_MICROS;
            self.estimate.correct(&correction, moved, silent || self.held_ms >= HELD_MS);
        }
    }

    /// It is so late, and no sample came: what is known of the motion goes on by itself, for a while.
    pub fn wait(&mut self, now: Micros) {
        self.go_on(samples(self.followed, now), now);
    }

    /// So many samples have passed until now.
    fn go_on(&mut self, passed: u32, now: Micros) {
        if passed == 0 {
            return;
        }
        self.followed = now;
        let Motion { plant, observer, .. } = &mut self.motion;
        for _ in 0..passed.min(SILENCE_SAMPLES) {
            if self.config.dynamics.is_none() {
                self.estimate.predict(plant, observer.speed());
            }
            observer.predict(plant);
        }
    }

    /// A control tick has come, with the newest sample taken.
    pub fn tick(&mut self) {
        let observer = &mut self.motion.observer;
        // By constants that are no motor's, numbers grow until they are none.
        if !(observer.speed() + observer.fraction()).is_finite() {
            *observer = Observer::new(0.0);
            self.estimate.restart();
        }
        let still = |last: &Reading| last.at.since(last.edge_at) >= REST_MICROS;
        if self.voltage.is_none() && self.last.as_ref().is_some_and(still) {
            observer.rest();
            self.estimate.rest();
        }
    }

    /// Takes over what was learned of an unknown motor's gain since the last tick.
    pub fn update_gain(&mut self) {
        if self.config.dynamics.is_none()
            && let Some(shift) = self.estimate.tick()
        {
            let mut new = Motion::new(&self.config, &self.estimate, self.period, self.motion.observer);
            new.observer.shift(&shift);
            new.observer.drive(&new.plant, self.voltage.map(Voltage::to_volts));
            self.motion = Motion { state: self.motion.state, ..new };
        }
    }

    /// What is known of the motion at this moment: what the observer says, unless a count is late.
    fn seen(&self) -> Observer {
        let Motion { plant, observer, .. } = &self.motion;
        // Of what no sample was taken no count is late.
        let sampled = self.last.is_some_and(|last| last.at == self.followed);
        if sampled { observer.seen(plant) } else { *observer }
    }

    /// Estimated.
    pub fn velocity(&self) -> CountsPerSecond {
        let observer = &self.motion.observer;
        // After every sample somebody asks; a copy is made where it says something else.
        speed(if observer.is_late() { self.seen().speed() } else { observer.speed() })
    }

    /// The load that is known of at this moment.
    fn carried(&self) -> f32 {
        let Motion { plant, observer, .. } = &self.motion;
        if observer.is_late() { self.seen().load(plant) } else { observer.load(plant) }
    }

    /// The voltage that would keep the speed against what loads the motor, drag and friction among it, beyond
    /// its back EMF; `None` where that is not known.
    pub fn load(&self) -> Option<Voltage> {
        let plant = &self.motion.plant;
        self.config.dynamics.map(|_| Voltage::from_volts(-self.carried() / plant.b))
    }

    /// What besides the bridge accelerates the motor, drag among it, in counts/s²: as of the last count.
    pub fn disturbance(&self) -> f32 {
        let Motion { plant, observer, .. } = &self.motion;
        observer.load(plant)
    }

    /// True if the motor should turn, but has sent no count for a while.
    pub const fn is_held(&self) -> bool {
        self.held_ms >= HELD_MS
    }

    /// What a volt accelerates the motor by, as told, learned or guessed, in counts/s².
    pub const fn gain(&self) -> f32 {
        self.motion.plant.b
    }

    /// What a volt accelerates the motor by, in counts/s², if it is heavier than told, or than what has turned out to
    /// be a heavy one; `None` where that is not known.
    pub fn least_gain(&self) -> Option<f32> {
        let known = self.config.dynamics.is_some() || self.estimate.is_heavy();
        known.then_some(TOLD_SHARE * self.motion.plant.b)
    }

    /// Which of the two regulates.
    pub const fn kind(&self) -> Kind {
        match self.config.coefficients {
            None => Kind::Model,
            Some(_) => Kind::Pid,
        }
    }

    /// The speed that a demand comes to, far from its end.
    pub fn wanted(&self, demand: Demand) -> CountsPerSecond {
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

    fn position(&self) -> i32 {
        self.last.map_or(0, |last| last.position)
    }

    /// The effort for this tick. `moved` is the counts since the last one.
    pub fn step(&mut self, demand: Demand, moved: i32, stage: &Stage<'_>) -> Output {
        let demand = self.anchored(demand);
        self.turning = matches!(demand, Demand::Velocity(_));
        let position = self.position();
        let velocity = self.velocity();
        // What keeps the current of the last tick, where a loop begins with it.
        let steady = match self.voltage {
            Some(voltage) if self.loops.continues() => voltage,
            _ if self.loops.is_running() => Voltage::from_volts(0.0),
            _ => self.steady_voltage(velocity),
        };
        let request = match &self.config.coefficients {
            None => self.by_model(demand, position, stage),
            Some(coefficients) => {
                let gain = self.motion.plant.b;
                let context = loops::Context { coefficients, period: self.period, gain, steady, stage };
                self.loops.step(demand, position, velocity, &context)
            }
        };
        let astray = request.speed.to_f32() - velocity.to_f32();
        self.steady = self.config.emf.emf(speed(astray)).to_volts().abs() < STEADY_VOLTS;
        self.due = request.speed.to_bits().unsigned_abs() >= COUNTING_SPEED.to_bits().unsigned_abs();
        self.held_ms =
            if self.due && moved == 0 { self.held_ms.saturating_add(self.period.as_millis()) } else { 0 };
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
        let most = side * (law.voltage_for_speed(&self.seen(), plant, target) - emf);
        Voltage::from_volts(emf + side * within(most, beyond_emf.abs()))
    }

    fn by_model(&mut self, demand: Demand, position: i32, stage: &Stage<'_>) -> Output {
        let mut seen = self.seen();
        let load = seen.disturbance();
        let Motion { plant, law, observer, state } = &mut self.motion;
        let request = match demand {
            Demand::Velocity(target) => law.velocity(state, &mut seen, plant, target.to_f32(), stage),
            Demand::Follow(reference) => {
                let speeds = (reference.speed.to_f32(), reference.next.to_f32());
                law.follow(state, &mut seen, plant, reference.from(position), speeds, stage)
            }
            Demand::Position { target, speed_limit } => {
                let distance = target.wrapping_sub(position);
                let limit = speed_limit.to_f32().abs();
                law.position(state, &mut seen, plant, distance, limit, stage)
            }
        };
        // Friction that has turned round stays so.
        observer.add_load(seen.disturbance() - load);
        request
    }

    /// The voltage that lets flow what the load takes, as far as that is known.
    fn steady_voltage(&self, velocity: CountsPerSecond) -> Voltage {
        let plant = &self.motion.plant;
        let carried = if self.loops.starts_afresh() { 0.0 } else { -self.carried() / plant.b };
        Voltage::from_volts(self.config.emf.emf(velocity).to_volts() + carried)
    }

    /// A motor that should stand and does is held where it is.
    fn anchored(&mut self, demand: Demand) -> Demand {
        let target = match demand {
            Demand::Velocity(target) => target,
            Demand::Follow(reference) if reference.stands() => {
                return Demand::Position { target: reference.position, speed_limit: CountsPerSecond::MAX };
            }
            Demand::Follow(_) | Demand::Position { .. } => return demand,
        };
        if target != CountsPerSecond::ZERO {
            self.anchor = None;
            return demand;
        }
        let counts = self.velocity().to_f32().abs() * self.period.as_millis().max(20) as f32 / 1000.0;
        if self.anchor.is_none() && counts < 1.0 {
            self.anchor = Some(self.position());
        }
        match self.anchor {
            Some(target) => Demand::Position { target, speed_limit: CountsPerSecond::MAX },
            None => demand,
        }
    }

    /// What the bridge does from now on: this voltage across the motor, or nothing.
    pub fn drive(&mut self, voltage: Option<Voltage>) {
        if voltage.is_none() {
            self.retarget();
            self.loops.restart_position();
            self.loops.resume();
            self.steady = true;
            self.turning = false;
        }
        self.voltage = voltage;
        let volts = voltage.map(Voltage::to_volts);
        self.estimate.drive(volts);
        let Motion { plant, observer, .. } = &mut self.motion;
        observer.drive(plant, volts);
    }
}

/// Whole samples from one time to another. (In 32 bits, whose division is the shorter one.)
fn samples(from: Micros, to: Micros) -> u32 {
    u32::try_from(to.since(from)).unwrap_or(u32::MAX).saturating_add(500) / 1000
}

/// A speed in the unit of everybody else.
fn speed(counts_per_second: f32) -> CountsPerSecond {
    CountsPerSecond::from_f32(within(counts_per_second, FASTEST))
}

/// The value, or the nearest within this of 0; of what is no number, an end.
const fn within(value: f32, limit: f32) -> f32 {
    at_most(at_least(value, -limit), limit)
}
