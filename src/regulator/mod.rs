//! Computes the voltage or control value of a motor at each tick: two regulators behind one interface.
//!
//! * **Model** is the default. An observer estimates position, speed and load at each sample of the encoder. A control
//!   law (`model`) computes in closed form the voltage that brings the motor to its planned speed by the next tick. The
//!   law has no integrator, so nothing winds up. For an *unknown motor*, which has no configured [`Dynamics`], the
//!   regulator estimates the acceleration per volt while the motor works.
//! * **PID** runs for a motor whose PID coefficients a host has configured: a velocity loop, and a position loop above
//!   the velocity loop. The speeds are estimated by the same observer.
//!
//! The current does not jump when the mode, the coefficients or the regulator changes. One exception: the current of
//! PID without I can jump. See [`Transition`] for the rules.
//!
//! ```text
//! samples ─▶ observer ─▶ position, speed, load ─▶ law or PID ─▶ Output ─▶ modulator
//!             ▲    │                                                         │
//!             │    └─▶ corrections ─▶ gain estimate of an unknown motor      │
//!             └─────────────────────── applied voltage ◀─────────────────────┘
//! ```

mod gain;
mod hunting;
pub mod identify;
mod interface;
mod loops;
mod model;
mod observer;
mod stream;
mod swings;

pub use crate::settings::{Coefficients, Dynamics, Mechanics};
pub use interface::{Context, Demand, Effort, Kind, Output, Reference};

use crate::braking::{Modulation, OperatingPoint};
use crate::motion::Reading;
use crate::settings::Settings;
use crate::units::single::{at_least, at_most};
use crate::units::{CountsPerSecond, Micros, Period, Voltage};
use gain::{GainEstimate, guessed_gain};
use hunting::Hunting;
use loops::{Loops, Start};
use model::Law;
use observer::{FASTEST_CPS, LoadLimit, Observer, Plant};
use stream::Stream;
use swings::{Swing, Swings};

/// Longest time between two samples of the encoder, in samples of 1 ms. After a longer gap the observer restarts with
/// the mean speed of the gap. After this time without a sample the estimated load counts as 0, because an old load
/// would let the predicted speed grow without end.
const LONGEST_GAP_SAMPLES: u32 = 300;
/// Time in ms without a count after which a motor that should turn counts as stalled.
const STALLED_MS: u32 = 100;
/// Least age of the last edge, in us, at which a stop may block a motor. Samples without a count then do not update the
/// gain, if counts are due at the requested speed or [`UNCERTAIN_COUNTS`] are missing.
const UNCERTAIN_EDGE_MICROS: u64 = 50_000;
/// Missing counts since the last edge from which on a stop may block a motor, at a requested speed below
/// [`COUNTS_DUE_SPEED`].
const UNCERTAIN_COUNTS: f32 = 8.0;
/// Age of the last edge, in us, from which on a motor with an open bridge is at rest.
const REST_MICROS: u64 = 300_000;
/// Lowest requested speed at which counts are due: 40 counts/s, which are four counts within [`STALLED_MS`].
const COUNTS_DUE_SPEED: CountsPerSecond = CountsPerSecond::new(40);

/// Least acceleration per volt, as a share of the configured or estimated acceleration per volt. The load may be
/// heavier than configured.
const LEAST_GAIN_SHARE: f32 = 0.7;

/// Factor by which the acceleration per volt in use is raised at each half swing that shows a swing, see `swings.rs`.
const GAIN_STEP: f32 = 1.4;
/// Largest ratio of the raised acceleration per volt to the value before. Five factors of [`GAIN_STEP`] reach this
/// ratio.
const LARGEST_GAIN_RATIO: f32 = 4.0;
/// Product of these five factors. The estimate of an unknown motor is divided by this product if raising the gain has
/// not ended the swings.
const LARGEST_RAISE: f32 = 5.4;

/// Error of the speed, as a back EMF in V, below which a motor has reached its requested speed.
const AT_SPEED_VOLTS: f32 = 1.0;

/// A change of a motor's set-point or bridge. The change determines the current with which PID begins or continues. The
/// model regulator needs no such current, because it computes each voltage from the estimate.
///
/// | transition | velocity loop of PID | position loop of PID |
/// |---|---|---|
/// | `Target` | continues | continues |
/// | `Mode` | continues | restarts |
/// | `OpenBridge`, `FromOpenLoop` | restarts with the current that balances the load | restarts |
/// | `FromBrake`, `FromStop` | restarts with a current of zero | restarts |
///
/// If the encoder of a motor that should turn has sent no count for 100 ms, every transition is treated as if the motor
/// left its stop: both regulators set the estimated load to 0, and PID restarts as after `FromStop`. Only `OpenBridge`
/// restarts PID as the table says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transition {
    /// The motor gets another target in the same mode.
    Target,
    /// A regulated motor gets another mode.
    Mode,
    /// The bridge opens.
    OpenBridge,
    /// The motor leaves a set-point without regulation: disabled, fail-safe, open loop, constant current or an
    /// identification.
    FromOpenLoop,
    /// The motor leaves constant power 0, or a fault at which it brakes. The current of its short circuit is not
    /// continued.
    FromBrake,
    /// The motor leaves a stop, or a release or a probe of the encoder check. Also a motor that was driven without
    /// regulation, and whose encoder has sent no count for 100 ms.
    FromStop,
}

/// The regulator of one motor.
#[derive(Clone, Debug)]
pub struct Regulator {
    /// Constants of the motor.
    plant: Plant,
    law: Law,
    /// Estimate of the motion.
    observer: Observer,
    /// Estimate of the acceleration per volt; `None` for a motor with configured dynamics.
    gain_estimate: Option<GainEstimate>,
    /// PID loops of a motor whose PID coefficients a host has configured.
    loops: Loops,
    hunting: Hunting,
    swings: Swings,
    /// Factor by which the acceleration per volt was raised because the speed swings, 1 to [`LARGEST_GAIN_RATIO`]. For
    /// a motor with configured dynamics the value in use was raised. For an unknown motor the estimate was raised.
    gain_ratio: f32,
    /// True if the search for swings begins again after the next step, see [`end_swings`](Self::end_swings).
    ends_swings: bool,
    stream: Stream,
    /// Last sample of the encoder; `None` before the first sample.
    last: Option<Reading>,
    /// Time to which the observer has predicted the motion.
    predicted_until: Micros,
    /// Target position at the last tick, in counts. With the demanded speed 0 this is the position at which the motor
    /// came to rest. `None` while the motor turns at a demanded speed or follows a reference.
    position_target: Option<i32>,
    /// Time in ms for which the encoder of a motor that should turn has sent no count.
    stalled_ms: u32,
    /// True if the estimated speed decides the request, see [`drive`](Self::drive). False while the bridge is open.
    uses_speed: bool,
    /// Speed that the last output should reach; 0 while the bridge is open, and without a demand.
    requested: CountsPerSecond,
    /// Voltage across the motor in V; `None` while the bridge is open.
    volts: Option<f32>,
    /// Limit of the load when the motor comes to rest at the demanded speed 0: the load at the last [`Transition`].
    load_limit: LoadLimit,
}

impl Regulator {
    /// Creates the regulator of a motor at rest that is stepped every `period`.
    pub fn new(settings: &Settings, period: Period) -> Self {
        let plant = plant(settings, initial_gain(settings), period);
        Self {
            plant,
            law: Law::new(&plant, period),
            observer: Observer::new(0.0),
            gain_estimate: settings.dynamics.is_none().then(GainEstimate::new),
            loops: Loops::default(),
            hunting: Hunting::default(),
            swings: Swings::default(),
            gain_ratio: 1.0,
            ends_swings: false,
            stream: Stream::default(),
            last: None,
            predicted_until: Micros::new(0),
            position_target: None,
            stalled_ms: 0,
            uses_speed: false,
            requested: CountsPerSecond::ZERO,
            volts: None,
            load_limit: LoadLimit::default(),
        }
    }

    /// Replaces the motor's settings. The estimates of position and speed are kept, so the motor may run meanwhile. If
    /// the dynamics change while the motor is at its requested speed, the estimated load is set so that the present
    /// voltage keeps this speed.
    pub fn configure(&mut self, old: &Settings, new: &Settings, period: Period) {
        let emf_changed = old.winding.emf != new.winding.emf;
        let dynamics_changed = old.dynamics != new.dynamics;
        if emf_changed || dynamics_changed {
            // If dynamics are removed, the estimate begins with the gain that they had.
            let begins_with_old = new.dynamics.is_none() && !emf_changed;
            let gain = if begins_with_old { self.plant.b / self.gain_ratio } else { initial_gain(new) };
            (self.swings, self.gain_ratio) = (Swings::default(), 1.0);
            let (old_plant, was_at_speed) = (self.plant, self.is_at_speed());
            self.observer = self.present_state();
            self.set_constants(new, gain, period);
            if dynamics_changed {
                // The old load was estimated with other constants.
                if was_at_speed {
                    self.assume_steady();
                } else if old.dynamics.is_none() {
                    self.observer.keep_load_voltage(&old_plant, &self.plant);
                }
            }
            self.pass_voltage();
            self.gain_estimate = new.dynamics.is_none().then(GainEstimate::new);
            self.pause_gain_estimate();
        } else if old.coefficients != new.coefficients {
            // PID does not find swings.
            self.end_swings();
        }
        let pid_changed = emf_changed
            || dynamics_changed
            || old.coefficients != new.coefficients
            || old.scheme != new.scheme;
        let restarts = matches!(self.loops.start, Start::Running | Start::Resume);
        if pid_changed && restarts && self.volts.is_some() {
            self.loops.start = Start::Continue;
        }
    }

    /// Replaces the constants of the motor, with the acceleration per volt b in counts/s² per V. The estimate stays.
    fn set_constants(&mut self, settings: &Settings, b: f32, period: Period) {
        self.plant = plant(settings, b, period);
        self.law.set_plant(&self.plant, period);
    }

    /// Replaces the estimate by a motion at this speed in counts/s, without load. Pauses the gain estimate.
    fn restart(&mut self, speed: f32) {
        self.observer = Observer::new(speed);
        self.law.set_friction_speed(0.0);
        self.pause_gain_estimate();
    }

    /// Sets the load to 0, also the friction that it includes.
    fn forget_load(&mut self) {
        self.observer.forget_load();
        self.law.set_friction_speed(0.0);
    }

    /// Sets the load, with the friction, to the load that keeps the present speed at the present voltage.
    fn assume_steady(&mut self) {
        self.observer.assume_steady(&self.plant, self.volts);
        self.law.set_friction_speed(if self.volts.is_some() { self.observer.speed() } else { 0.0 });
    }

    /// Passes the present voltage across the motor to the observer. Must be called after the constants have changed.
    fn pass_voltage(&mut self) {
        self.observer.set_voltage(&self.plant, self.volts, self.observer.emf_share());
    }

    /// True if the error of the speed, as a back EMF, is below [`AT_SPEED_VOLTS`]. Also true while the bridge is open.
    fn is_at_speed(&self) -> bool {
        let error = self.requested.to_f32() - self.velocity().to_f32();
        self.volts.is_none() || (self.plant.kappa * error).abs() < AT_SPEED_VOLTS
    }

    /// Pauses the gain estimate of an unknown motor until the observer has corrected a wrong state.
    fn pause_gain_estimate(&mut self) {
        if let Some(estimate) = &mut self.gain_estimate {
            estimate.pause();
        }
    }

    /// Prepares the regulator for another target or mode, or for an open bridge.
    pub fn transition(&mut self, transition: Transition) {
        let leaves_stop = transition == Transition::FromStop || self.stalled_ms >= STALLED_MS;
        if matches!(transition, Transition::FromOpenLoop | Transition::FromBrake) {
            // Without regulation the estimated load includes the friction of the present motion.
            self.law.set_friction_speed(self.observer.speed());
        }
        self.position_target = None;
        self.stalled_ms = 0;
        if leaves_stop {
            self.forget_load();
            self.discard_untrusted();
        }
        self.load_limit = self.observer.load_limit();
        self.loops.begin(match transition {
            Transition::OpenBridge => Start::Resume,
            _ if leaves_stop => Start::ZeroCurrent,
            Transition::Target => return,
            Transition::Mode => self.loops.start,
            Transition::FromOpenLoop => Start::Resume,
            Transition::FromBrake | Transition::FromStop => Start::ZeroCurrent,
        });
    }

    /// Takes a sample of the encoder. The estimates are best with a sample every millisecond and a jitter below 0.5 ms.
    pub fn sample(&mut self, reading: Reading) {
        let Some(last) = self.last.replace(reading) else {
            self.predicted_until = reading.at;
            return;
        };
        let moved = reading.position.wrapping_sub(last.position);
        let before = last.at;
        if reading.at == before {
            return;
        }
        let should_stand = self.requested == CountsPerSecond::ZERO;
        let gap = samples(before, reading.at);
        let passed =
            if self.predicted_until == before { gap } else { samples(self.predicted_until, reading.at) };
        self.predict(passed, reading.at);
        if gap > LONGEST_GAP_SAMPLES {
            self.restart(within(1_000.0 * moved as f32 / gap as f32, FASTEST_CPS));
        } else if let Some(correction) = self.observer.update(&self.plant, moved, should_stand)
            && let Some(estimate) = &mut self.gain_estimate
        {
            // Samples without a count do not show the gain while a motor may be held at rest, or blocked by a stop.
            let silence_us = reading.since_edge_us();
            let missed_counts = self.requested.to_f32().abs() * silence_us as f32 * 1e-6;
            let uncertain = self.stalled_ms >= STALLED_MS
                || should_stand
                || silence_us >= UNCERTAIN_EDGE_MICROS
                    && (counts_due(self.requested) || missed_counts >= UNCERTAIN_COUNTS);
            // In open loop nothing depends on the gain. A brake and a load often begin together, and the load would
            // then be taken for inertia.
            let updates = self.uses_speed && (moved != 0 || !uncertain);
            estimate.correct(&self.plant, &correction, moved, self.volts, updates);
        }
    }

    /// Predicts the motion to a time without a sample, at most 300 ms ahead in one call. From 300 ms after the last
    /// sample on the estimated load is 0.
    pub fn predict_until(&mut self, now: Micros) {
        if self.last.is_some_and(|last| samples(last.at, now) > LONGEST_GAP_SAMPLES) {
            self.forget_load();
        }
        self.predict(samples(self.predicted_until, now), now);
    }

    /// Predicts the motion to `now`, which is `passed` samples after the last prediction.
    fn predict(&mut self, passed: u32, now: Micros) {
        if passed == 0 {
            return;
        }
        self.predicted_until = now;
        for _ in 0..passed.min(LONGEST_GAP_SAMPLES) {
            if let Some(estimate) = &mut self.gain_estimate {
                estimate.predict(&self.plant, &self.observer, self.volts);
            }
            self.observer.predict(&self.plant);
        }
    }

    /// Begins a control tick. Must be called after the newest sample of the tick was taken. An estimate that has
    /// overflowed is reset. The estimated speed of a motor at rest with an open bridge is set to 0.
    pub fn tick(&mut self) {
        // With implausible constants the estimate may grow until it overflows.
        if !(self.observer.speed() + self.observer.fraction()).is_finite() {
            self.restart(0.0);
        }
        let still = |last: &Reading| last.since_edge_us() >= REST_MICROS;
        if self.volts.is_none() && self.last.as_ref().is_some_and(still) {
            self.observer.rest();
            self.law.set_friction_speed(0.0);
            if let Some(estimate) = &mut self.gain_estimate {
                estimate.rest();
            }
        }
    }

    /// Replaces the gain of an unknown motor by the estimated gain, if both differ enough.
    pub fn update_gain(&mut self, settings: &Settings, period: Period) {
        if let Some(estimate) = &mut self.gain_estimate
            && let Some((gain, shift)) = estimate.take_gain(&self.plant)
        {
            self.set_constants(settings, gain, period);
            self.observer.shift(&shift);
            self.pass_voltage();
        }
    }

    /// Replaces the back EMF constant and the dynamics by the values in `settings`. Must be called when these values
    /// were corrected for a warm motor or for a speed that hunts. The acceleration per volt in use is the value in
    /// `settings` times the ratio of a raised gain. The estimated gain of an unknown motor, the estimated position and
    /// speed, and the present acceleration are kept.
    pub fn correct_constants(&mut self, settings: &Settings, period: Period) {
        let old = self.plant;
        let gain = settings.dynamics.map_or(old.b, |dynamics| self.gain_ratio * dynamics.gain.to_f32());
        self.set_constants(settings, gain, period);
        if self.plant.kappa != old.kappa {
            // Another back EMF may end the swings.
            self.swings = Swings::default();
        }
        self.observer.keep_acceleration(&old, &self.plant, self.volts);
        self.pass_voltage();
    }

    /// After the next step the search for swings begins again, and the configured acceleration per volt is in use again
    /// if it was raised. The raised estimate of an unknown motor stays. Must be called for each new set-point.
    pub const fn end_swings(&mut self) {
        self.ends_swings = true;
    }

    /// Begins the search for swings again, see [`end_swings`](Self::end_swings).
    fn search_again(&mut self, settings: &Settings, period: Period) {
        (self.swings, self.ends_swings) = (Swings::default(), false);
        self.set_gain_ratio(1.0, settings, period);
        if let Some(estimate) = &mut self.gain_estimate {
            estimate.update_again();
        }
    }

    /// Discards the estimated gain of an unknown motor whose encoder is not trusted, because the encoder may be
    /// reversed. Must be called when a motor leaves a constant current: nothing checks the encoder during a constant
    /// current.
    pub fn discard_untrusted(&mut self) {
        if let Some(estimate) = self.gain_estimate.as_mut().filter(|estimate| !estimate.is_trusted()) {
            estimate.discard(&self.plant);
        }
    }

    /// Discards what the counts of an encoder at fault have taught about an unknown motor.
    pub fn distrust_encoder(&mut self) {
        if let Some(estimate) = &mut self.gain_estimate {
            estimate.discard(&self.plant);
        }
    }

    /// Sets the ratio of a raised gain.
    fn set_gain_ratio(&mut self, ratio: f32, settings: &Settings, period: Period) {
        if ratio != self.gain_ratio {
            self.gain_ratio = ratio;
            if settings.dynamics.is_some() {
                self.correct_constants(settings, period);
            }
        }
    }

    /// The estimate of the motion at this moment, corrected by a late count if there is one.
    fn present_state(&self) -> Observer {
        // Only at the time of a sample is it known whether a count is late.
        let sampled = self.last.is_some_and(|last| last.at == self.predicted_until);
        if sampled { self.observer.with_late_count(&self.plant) } else { self.observer }
    }

    /// The estimated speed.
    pub fn velocity(&self) -> CountsPerSecond {
        CountsPerSecond::from_f32(self.speed_cps())
    }

    /// The estimated speed in counts/s.
    pub fn speed_cps(&self) -> f32 {
        // This function is called after every sample, so the observer is copied only while a count is late.
        if self.observer.is_late() { self.present_state().speed() } else { self.observer.speed() }
    }

    /// Acceleration by load and drag at this moment, in counts/s².
    fn external_acceleration(&self) -> f32 {
        if self.observer.is_late() {
            self.present_state().external_acceleration(&self.plant)
        } else {
            self.observer.external_acceleration(&self.plant)
        }
    }

    /// The voltage beyond the back EMF that would keep the speed against load, drag and friction; `None` for an
    /// unknown motor, whose gain is uncertain.
    pub fn load(&self) -> Option<Voltage> {
        let known = self.gain_estimate.is_none();
        known.then(|| Voltage::from_volts(-self.external_acceleration() / self.plant.b))
    }

    /// Acceleration by load and drag at this moment, without the correction by a late count, in counts/s².
    pub fn disturbance(&self) -> f32 {
        self.observer.external_acceleration(&self.plant)
    }

    /// True if the motor has to turn at 40 counts/s or more, but the encoder has sent no count for 100 ms of ticks.
    pub const fn is_stalled(&self, period: Period) -> bool {
        // The first tick adds a whole period, although the request begins only at the end of this tick.
        self.stalled_ms >= STALLED_MS + period.as_millis()
    }

    /// True if the bridge is closed, but the encoder has sent no count for 100 ms. Without regulation the estimated
    /// load is then the counterforce of a stop, or there are no counts.
    pub fn is_blocked(&self) -> bool {
        let silent = |last: Reading| last.since_edge_us() >= 1_000 * u64::from(STALLED_MS);
        self.volts.is_some() && self.last.is_some_and(silent)
    }

    /// Acceleration per volt in counts/s²: configured, estimated or the initial guess.
    pub const fn gain(&self) -> f32 {
        self.plant.b
    }

    /// Lower bound of the acceleration per volt in counts/s²; `None` for an unknown motor whose estimate does not yet
    /// show a heavy load.
    pub fn least_gain(&self) -> Option<f32> {
        let known = self.gain_estimate.as_ref().is_none_or(|estimate| estimate.is_heavy(&self.plant));
        known.then_some(self.likely_least_gain())
    }

    /// Likely lower bound of the acceleration per volt in counts/s², because a load may be heavier than configured. For
    /// an unknown motor the bound follows from the estimate, however uncertain.
    pub fn likely_least_gain(&self) -> f32 {
        // A gain is raised only to end swings, so the motor's true gain may be as small as the gain before the raise.
        LEAST_GAIN_SHARE * self.plant.b / self.gain_ratio
    }

    /// True for an unknown motor whose encoder is trusted, because the motor has turned in the direction of its
    /// voltage. False for a motor with configured dynamics.
    pub fn trusts_encoder(&self) -> bool {
        self.gain_estimate.as_ref().is_some_and(GainEstimate::is_trusted)
    }

    /// The speed that a demand requests far from its target. The braking before a target position is not included.
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

    /// Position of the last sample, in counts; 0 before the first sample.
    pub fn position(&self) -> i32 {
        self.last.map_or(0, |last| last.position)
    }

    /// Computes the output for this tick. `moved` is the counts since the last tick.
    // The emulated board's budget test finds this function by its symbol, and counts its instructions.
    #[inline(never)]
    pub fn step(&mut self, demand: Demand, moved: i32, context: &Context<'_>) -> Output {
        let demand = self.hold_at_standstill(demand, context);
        self.position_target = match demand {
            Demand::Position { target, .. } => Some(target),
            Demand::Velocity(_) | Demand::Follow(_) => None,
        };
        self.observer.set_speed_demanded(matches!(demand, Demand::Velocity(_)));
        let output = match &context.settings.coefficients {
            None => self.by_model(demand, context),
            Some(coefficients) => {
                let (position, velocity) = (self.position(), self.velocity());
                let (gain, start) = (self.plant.b, self.start_voltage(velocity));
                let inputs = loops::Inputs { coefficients, position, velocity, gain, start };
                self.loops.step(demand, &inputs, context)
            }
        };
        if self.ends_swings {
            self.search_again(context.settings, context.period);
        }
        self.requested = output.speed;
        self.stalled_ms = if counts_due(self.requested) && moved == 0 {
            self.stalled_ms.saturating_add(context.period.as_millis())
        } else {
            0
        };
        output
    }

    /// Limits a voltage so that the motor does not become faster than `limit` in the direction of its current. A
    /// motor that is already faster brakes. Its braking current is at most as large as the current of the voltage. From
    /// this call on no speed is demanded.
    pub fn limit_speed(&mut self, voltage: Voltage, limit: CountsPerSecond, at: OperatingPoint) -> Voltage {
        self.end_demand();
        let emf = at.emf_volts();
        let beyond_emf = voltage.to_volts() - emf;
        let side = 1.0f32.copysign(beyond_emf);
        let target = side * limit.to_f32().abs();
        let most = side * (self.law.voltage_for_speed(&self.present_state(), &self.plant, target) - emf);
        Voltage::from_volts(emf + side * within(most, beyond_emf.abs()))
    }

    /// Computes the output by the motor's model.
    fn by_model(&mut self, demand: Demand, context: &Context<'_>) -> Output {
        let position = self.position();
        let mut present = self.present_state();
        let load = present.load();
        let period_ms = context.period.as_millis();
        let output = match demand {
            Demand::Velocity(target) => {
                let target = self.stream.step(target.to_f32(), self.predicted_until, period_ms);
                let mut output = self.law.velocity(&mut present, &self.plant, target, context);
                if let Effort::Voltage(voltage) = output.effort {
                    let correction_volts = self.law.correction_volts(&present, target.demanded);
                    let emf_volts = self.plant.kappa * present.speed();
                    output.hunts = self.hunting.step(&target, voltage, correction_volts, emf_volts, context);
                }
                output
            }
            Demand::Follow(reference) => {
                self.law.follow(&mut present, &self.plant, reference.from(position), &reference, context)
            }
            Demand::Position { target, speed_limit } => {
                let distance = target.wrapping_sub(position);
                self.law.position(&mut present, &self.plant, distance, speed_limit, context)
            }
        };
        // `present` is a copy of the observer. If the law has reversed the friction in the copy, the load of the
        // observer is changed by the same amount.
        self.observer.add_load(present.load() - load);
        if let Demand::Follow(_) = demand {
            self.end_swings();
        } else if !self.ends_swings {
            match self.swings.step(demand, present.speed(), output.speed.to_f32(), period_ms as u16) {
                Some(Swing::Fast) => self.raise_gain(demand, context),
                // The estimate may have been raised by mistake, so it is updated again.
                Some(Swing::Slow) => {
                    if let Some(estimate) = &mut self.gain_estimate {
                        estimate.update_again();
                    }
                }
                None => (),
            }
        }
        output
    }

    /// Raises the acceleration per volt in use, because the speed swings. If the speed on the way to a position still
    /// swings with the largest value, the swings have another cause, for example a load that swings. The value before
    /// the first raise is then in use again.
    fn raise_gain(&mut self, demand: Demand, context: &Context<'_>) {
        if self.gain_estimate.as_ref().is_some_and(|estimate| !estimate.is_fixed()) {
            // The estimate no longer contains the earlier raises, because it has been updated or discarded since.
            self.gain_ratio = 1.0;
        }
        let (factor, ratio) = if self.gain_ratio < LARGEST_GAIN_RATIO {
            (GAIN_STEP, at_most(GAIN_STEP * self.gain_ratio, LARGEST_GAIN_RATIO))
        } else if let Demand::Position { .. } = demand {
            (1.0 / LARGEST_RAISE, 1.0)
        } else {
            return;
        };
        if ratio == LARGEST_GAIN_RATIO {
            self.swings = Swings::default();
        } else if ratio == 1.0 {
            self.swings = Swings::OFF;
        }
        if let Some(estimate) = &mut self.gain_estimate {
            estimate.multiply(factor);
            if ratio == 1.0 {
                estimate.update_again();
            }
        }
        self.set_gain_ratio(ratio, context.settings, context.period);
    }

    /// The voltage with which the velocity loop of PID begins; `None` if the loop already runs.
    fn start_voltage(&self, velocity: CountsPerSecond) -> Option<Voltage> {
        let emf = self.plant.kappa * velocity.to_f32();
        match (self.loops.start, self.volts) {
            (Start::Running, _) => None,
            (Start::ZeroCurrent, _) => Some(Voltage::from_volts(emf)),
            (Start::Continue, Some(volts)) => Some(Voltage::from_volts(volts)),
            // The current of this voltage balances the estimated load. Without a present voltage, PID cannot keep it.
            (Start::Continue | Start::Resume, _) => {
                Some(Voltage::from_volts(emf - self.external_acceleration() / self.plant.b))
            }
        }
    }

    /// Returns the demand of this tick. The position at which the motor came to rest replaces a demanded speed of 0.
    /// The position of a reference that stands still replaces the reference. Any other demand is unchanged.
    ///
    /// Limits the load of a motor that comes to rest at the demanded speed 0. While the motor brakes, a hard stop and a lost
    /// encoder look like a load against the motion, and the motor would press against this load until its next set-point.
    /// A running PID loop does not use the load.
    fn hold_at_standstill(&mut self, demand: Demand, context: &Context<'_>) -> Demand {
        let target = match demand {
            Demand::Velocity(target) => target,
            Demand::Follow(reference) if reference.is_still() => {
                let Reference { position: target, speed_limit, .. } = reference;
                return Demand::Position { target, speed_limit };
            }
            Demand::Follow(_) | Demand::Position { .. } => return demand,
        };
        if target != CountsPerSecond::ZERO {
            return demand;
        }
        let counts = self.velocity().to_f32().abs() * context.period.as_millis().max(20) as f32 / 1000.0;
        match self.position_target {
            Some(target) => Demand::Position { target, speed_limit: CountsPerSecond::MAX },
            None if counts < 1.0 => {
                if context.settings.coefficients.is_none() {
                    self.observer.limit_load(self.load_limit);
                }
                Demand::Position { target: self.position(), speed_limit: CountsPerSecond::MAX }
            }
            None => demand,
        }
    }

    /// Notes that no speed is demanded: the requested speed is then 0.
    const fn end_demand(&mut self) {
        self.requested = CountsPerSecond::ZERO;
        self.observer.set_speed_demanded(false);
    }

    /// Sets the requested voltage less the voltage within the motor's limits, in V. While the request exceeds the
    /// limits, the integral of PID does not grow.
    pub const fn set_excess(&mut self, volts: f32) {
        self.loops.excess_volts = volts;
    }

    /// Sets the command that the bridge executes from now on, with its voltage; `None` if the bridge is open.
    ///
    /// `uses_speed` is true if the estimated speed decides the request: for a regulated motor, and for a constant
    /// current. It is false in open loop, for a brake and in an identification. No speed is then demanded, and the gain
    /// of an unknown motor is not updated.
    pub fn drive(&mut self, command: Option<Modulation>, uses_speed: bool) {
        if command.is_none() {
            self.transition(Transition::OpenBridge);
        }
        self.uses_speed = uses_speed && command.is_some();
        if !self.uses_speed {
            self.end_demand();
        }
        self.volts = command.map(|command| command.voltage.to_volts());
        let emf_share = command.map_or(0.0, |command| command.emf_share);
        self.observer.set_voltage(&self.plant, self.volts, emf_share);
    }
}

/// The constants of a motor with the acceleration per volt b, in counts/s² per V. If b differs from the configured
/// acceleration per volt, the configured decay of the speed is scaled by the same factor.
fn plant(settings: &Settings, b: f32, period: Period) -> Plant {
    let kappa = settings.winding.emf.to_volts();
    let q = match settings.dynamics {
        Some(dynamics) => dynamics.decay.to_f32() * (b / dynamics.gain.to_f32()),
        None => b * kappa,
    };
    Plant::new(b, kappa, q, period)
}

/// Initial acceleration per volt of a motor, in counts/s² per V: the configured one, or the guess for an unknown motor.
fn initial_gain(settings: &Settings) -> f32 {
    match settings.dynamics {
        Some(dynamics) => dynamics.gain.to_f32(),
        None => guessed_gain(settings.winding.emf.to_volts()),
    }
}

/// True if counts are due at this speed, so that a motor without counts may be stalled.
pub(crate) const fn counts_due(requested: CountsPerSecond) -> bool {
    requested.to_bits().unsigned_abs() >= COUNTS_DUE_SPEED.to_bits().unsigned_abs()
}

/// Number of samples of 1 ms between two times, rounded.
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
