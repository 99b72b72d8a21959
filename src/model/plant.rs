//! A plant: a geared motor with its load and its switching bridge, simulated over time.
//!
//! Time advances in *windows* of at most one PWM period. In each window:
//! 1. The electrical part is exact at a constant back EMF, which belongs to the mean speed of the window.
//! 2. The mechanical part is exact under a constant torque, which belongs to the mean current of the window.
//! 3. Both parts are iterated until they agree. The method is second-order accurate and stable for every motor.
//!
//! After a change of the command, current and speed approach their new values with a relative error of about `(w h)² /
//! 24`. Here `h` is the length of a window and `w = sqrt((Ke Kt / L + k) / J)`: the angular frequency at which motor
//! and load would swing without losses. `Ke` and `Kt` are the motor's back-EMF and torque constant, `L` is its
//! inductance, `J` the inertia of motor and load, and `k` the largest stiffness of cogging. Windows are so short that
//! `w h` is at most 0.15. The error of the mean current over a few PWM periods is then about 0.1 % of the current at
//! standstill. The ripple of the speed within a window is left out of the back EMF.
//!
//! [Friction and cogging](super::friction) are exact for the mean torque of a window. A shaft can stop within a window.
//! From this moment it turns back, or rests with a speed of exactly 0. Cogging releases exactly the energy that it
//! stored. A shaft at rest breaks away if the mean torque at standstill is larger than the breakaway torque. The ripple
//! of the torque does not start a motion. At 20 kHz the ripple would turn a shaft by some 1e-7 rad, and the model
//! assumes that the gear contacts yield by this angle without sliding.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::load::Load;
//! use motor_hub::model::plant::{PlantInput, Plant};
//! use motor_hub::model::si::{Hertz, Seconds, Volts};
//! use motor_hub::model::switching::Bridge;
//!
//! // The motor is driven clockwise at duty 0.5 for 0.1 s.
//! let motor = characterised("AM 60 A")?.with_measured_rotor_inertia();
//! let mut plant = Plant::new(motor, Load::NONE, Bridge::IDEAL, Hertz(20_000.0));
//! let flow = plant.run(Seconds(0.1), PlantInput::pwm(Mode::Cw98, 0.5), Volts(12.0));
//! assert!(plant.counts() > 0 && flow.mean_current().0 > 0.0);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::catalogue::Motor;
use super::friction::{Cogging, Friction};
use super::load::{Load, Shaft};
use super::mechanics::{Mechanics, ShaftMotion};
use super::si::{Amps, Coulombs, Hertz, Joules, NewtonMetres, RadPerSec, Seconds, Volts};
use super::switching::{Bridge, Circuit, Conditions, Integrals, Pwm};
use super::train::{Output, ShaftState, Train, WindowEnd};
use crate::bridge::{Mode, State};
use core::ops::Sub;

/// Largest product of window length (s) and frequency `w` (rad/s), which the module's documentation defines; without
/// unit. The relative error `(w h)² / 24` of the module's documentation is then 0.1 %.
const WINDOW_LIMIT: f64 = 0.15;

/// Inputs of a plant: the command to its bridge, and an external torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantInput {
    /// State of the bridge in the first part of each PWM period.
    pub on: State,
    /// State of the bridge in the rest of each PWM period.
    pub off: State,
    /// Share of each PWM period spent in `on`, 0 to 1. Other values are limited to this range.
    pub duty: f64,
    /// External torque on the output shaft in addition to the load's constant torque, positive clockwise.
    pub torque_after: NewtonMetres,
}

impl PlantInput {
    /// All switches are open, and there is no external torque.
    pub const COAST: Self =
        Self { on: State::Coast, off: State::Coast, duty: 0.0, torque_after: NewtonMetres(0.0) };

    /// Commands a mode at a duty from 0 to 1, without external torque.
    #[must_use]
    pub const fn pwm(mode: Mode, duty: f64) -> Self {
        Self { on: mode.on(), off: mode.off(), duty, torque_after: NewtonMetres(0.0) }
    }
}

/// Charge and energy that flowed during a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flow {
    /// Length of the run.
    pub time: Seconds,
    /// Charge through the motor, positive clockwise.
    pub charge: Coulombs,
    /// Magnitude of the part of `charge` that a current sense in the high-side switches measures, at least 0.
    ///
    /// The sense measures the current that flows from the battery into the high-side switch that stays closed in mode
    /// 9/8 or 6/2. It measures nothing in mode 5/0, which closes no high-side switch.
    pub charge_shown: Coulombs,
    /// Energy that left the battery, at least 0.
    pub energy_from_battery: Joules,
    /// Energy that returned to the battery, at least 0.
    pub energy_to_battery: Joules,
    /// Charge that left the battery, at least 0.
    pub charge_from_battery: Coulombs,
    /// Charge that returned to the battery, at least 0.
    pub charge_to_battery: Coulombs,
    /// Heat in winding, switches and diodes.
    pub heat: Joules,
    /// Mechanical work of the motor on its shaft; negative while the motor brakes.
    pub shaft_work: Joules,
    /// Heat of dry friction, at least 0. The heat of viscous drag is not included.
    pub friction_heat: Joules,
    /// Heat of the damping of a gear [train](super::train) that is not rigid, at least 0.
    pub train_heat: Joules,
    /// Kinetic energy that [`Plant::set_load`] has added by a larger inertia, or removed by a smaller one.
    pub load_work: Joules,
}

impl Flow {
    /// Returns the mean motor current, or 0 if the run has no length.
    #[must_use]
    pub fn mean_current(&self) -> Amps {
        Amps(if self.time.0 > 0.0 { self.charge.0 / self.time.0 } else { 0.0 })
    }

    /// Returns the net charge that left the battery, C.
    #[must_use]
    pub fn battery_charge(&self) -> f64 {
        self.charge_from_battery.0 - self.charge_to_battery.0
    }

    /// Adds the result of a following run.
    pub fn append(&mut self, next: &Self) {
        self.time.0 += next.time.0;
        self.charge.0 += next.charge.0;
        self.charge_shown.0 += next.charge_shown.0;
        self.energy_from_battery.0 += next.energy_from_battery.0;
        self.energy_to_battery.0 += next.energy_to_battery.0;
        self.charge_from_battery.0 += next.charge_from_battery.0;
        self.charge_to_battery.0 += next.charge_to_battery.0;
        self.heat.0 += next.heat.0;
        self.shaft_work.0 += next.shaft_work.0;
        self.friction_heat.0 += next.friction_heat.0;
        self.train_heat.0 += next.train_heat.0;
        self.load_work.0 += next.load_work.0;
    }
}

impl Sub for Flow {
    type Output = Self;

    /// Returns the flow since an earlier total.
    fn sub(self, earlier: Self) -> Self {
        Self {
            time: Seconds(self.time.0 - earlier.time.0),
            charge: Coulombs(self.charge.0 - earlier.charge.0),
            charge_shown: Coulombs(self.charge_shown.0 - earlier.charge_shown.0),
            energy_from_battery: Joules(self.energy_from_battery.0 - earlier.energy_from_battery.0),
            energy_to_battery: Joules(self.energy_to_battery.0 - earlier.energy_to_battery.0),
            charge_from_battery: Coulombs(self.charge_from_battery.0 - earlier.charge_from_battery.0),
            charge_to_battery: Coulombs(self.charge_to_battery.0 - earlier.charge_to_battery.0),
            heat: Joules(self.heat.0 - earlier.heat.0),
            shaft_work: Joules(self.shaft_work.0 - earlier.shaft_work.0),
            friction_heat: Joules(self.friction_heat.0 - earlier.friction_heat.0),
            train_heat: Joules(self.train_heat.0 - earlier.train_heat.0),
            load_work: Joules(self.load_work.0 - earlier.load_work.0),
        }
    }
}

/// Temperature rises of a motor above the temperatures at which the constants of the catalogue were measured.
///
/// The resistance of copper rises by 0.39 % per kelvin. The field of ferrite magnets falls by 0.2 % per kelvin, and
/// with it back EMF and torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Temperatures {
    /// Temperature rise of the winding in K.
    pub winding_k: f64,
    /// Temperature rise of the magnets in K, below 500 K. At 500 K the magnets would have no field.
    pub magnets_k: f64,
}

impl Temperatures {
    /// Returns the resistance divided by the resistance in the catalogue.
    #[must_use]
    pub fn resistance_share(&self) -> f64 {
        1.0 + 0.0039 * self.winding_k
    }

    /// Returns the back-EMF constant divided by the constant in the catalogue. The torque constant has the same ratio.
    #[must_use]
    pub fn field_share(&self) -> f64 {
        1.0 - 0.002 * self.magnets_k
    }
}

/// A motor with its load and its bridge, and their present state.
#[derive(Clone, Debug)]
pub struct Plant {
    /// Constants of the motor at `temperatures`.
    motor: Motor,
    temperatures: Temperatures,
    load: Load,
    shaft: Shaft,
    circuit: Circuit,
    /// Frequency of the PWM.
    frequency: Hertz,
    /// Longest window of this plant, s.
    longest_window: f64,
    /// Coefficients of the mechanical part for the length of the last window.
    mechanics: Mechanics,
    /// Admittance of the circuit in the last window, 1/ohm.
    admittance: f64,
    /// Time since the beginning of the present PWM period, s.
    phase: f64,
    /// Motor current, A.
    current: f64,
    /// Speed and angle of the motor shaft.
    state: ShaftState,
    /// Mean current of the last window, A. This current is the first estimate of the next window's mean current.
    last_mean: f64,
    /// Off state of the present mode. The modes 9/8, 6/2 and 5/0 have different off states, so a change of this state
    /// is a change of the mode. An open bridge has the off state of mode 5/0, so no pause comes between the two.
    off_state: State,
    /// Time for which the bridge still stays open because of the last change of the mode, s.
    open_s: f64,
    /// The load behind a gear train that is not rigid; `None` if the load is fixed to the motor, or has no inertia.
    output: Option<Output>,
    train: Option<Train>,
    /// Kinetic energy that changes of the inertia have added since the last run, J.
    load_work: f64,
}

/// Returns the longest window in seconds: the PWM period divided by a whole number, so that [`WINDOW_LIMIT`] is kept.
fn longest_window(motor: &Motor, shaft: &Shaft, frequency: Hertz) -> f64 {
    let period = 1.0 / frequency.0;
    let undamped = (motor.ke.0 * motor.kt.0 / (motor.l.0 * shaft.inertia.0)
        + motor.cogging.stiffness() / shaft.inertia.0)
        .sqrt();
    let windows = (period * undamped / WINDOW_LIMIT).ceil().max(1.0);
    period / windows
}

impl Plant {
    /// Creates a plant at rest, without current, at angle 0 and at the beginning of a PWM period.
    #[must_use]
    pub fn new(motor: Motor, load: Load, bridge: Bridge, pwm: Hertz) -> Self {
        let shaft = Shaft::new(&motor, &load);
        let circuit = Circuit::new(&motor, bridge);
        let longest_window = longest_window(&motor, &shaft, pwm);
        Self {
            motor,
            temperatures: Temperatures::default(),
            load,
            shaft,
            circuit,
            frequency: pwm,
            longest_window,
            mechanics: Mechanics::new(&shaft, longest_window),
            admittance: circuit.admittance(longest_window),
            phase: 0.0,
            current: 0.0,
            state: ShaftState::default(),
            last_mean: 0.0,
            off_state: State::Coast,
            open_s: 0.0,
            output: None,
            train: None,
            load_work: 0.0,
        }
    }

    /// Puts a gear train that is not rigid between motor and load. A load without inertia stays rigidly connected.
    #[must_use]
    pub fn with_train(mut self, train: Train) -> Self {
        self.train = Some(train);
        self.set_load(self.load);
        self.load_work = 0.0;
        self
    }

    /// Connects another load, which has the speed of the old load immediately. The change of the kinetic energy is
    /// added to [`Flow::load_work`] of the next run.
    pub fn set_load(&mut self, load: Load) {
        let before = self.motion_energy().0;
        self.load = load;
        self.shaft = Shaft::new(&self.motor, &load);
        let state = self.state_after();
        self.output = self.train.and_then(|train| Output::new(&self.motor, &load, &train));
        if let Some(output) = &mut self.output {
            output.state = state;
            // The train moves the load, so inertia and drag of `shaft` are the motor's alone.
            self.shaft =
                Shaft { torque_ratio: self.shaft.torque_ratio, ..Shaft::new(&self.motor, &Load::NONE) };
        }
        self.load_work += self.motion_energy().0 - before;
        self.prepare_windows();
    }

    /// Changes the temperatures of the motor, and so its resistance, back EMF and torque. The present current stays.
    pub fn set_temperatures(&mut self, temperatures: Temperatures) {
        if temperatures == self.temperatures {
            return;
        }
        self.motor.r.0 *= temperatures.resistance_share() / self.temperatures.resistance_share();
        let field = temperatures.field_share() / self.temperatures.field_share();
        self.motor.ke.0 *= field;
        self.motor.kt.0 *= field;
        self.temperatures = temperatures;
        self.circuit = Circuit::new(&self.motor, self.circuit.bridge);
        self.prepare_windows();
    }

    /// Changes the dry friction of the motor.
    pub fn set_friction(&mut self, friction: Friction) {
        self.motor.friction = friction;
    }

    /// Returns true if the motor has dry friction or cogging.
    fn has_friction(&self) -> bool {
        self.motor.friction != Friction::NONE || self.motor.cogging != Cogging::NONE
    }

    /// Returns speed and angle of the load, referred to the motor shaft.
    fn state_after(&self) -> ShaftState {
        self.output.as_ref().map_or(self.state, |output| output.state)
    }

    /// Returns the constants of the motor at its present temperatures.
    #[must_use]
    pub const fn motor(&self) -> &Motor {
        &self.motor
    }

    /// Returns the load.
    #[must_use]
    pub const fn load(&self) -> &Load {
        &self.load
    }

    /// Returns the present motor current.
    #[must_use]
    pub const fn current(&self) -> Amps {
        Amps(self.current)
    }

    /// Returns the present speed of the motor shaft.
    #[must_use]
    pub const fn speed(&self) -> RadPerSec {
        RadPerSec(self.state.speed)
    }

    /// Returns the present speed of the output shaft.
    #[must_use]
    pub fn speed_after(&self) -> RadPerSec {
        RadPerSec(self.state_after().speed / self.motor.gear_ratio)
    }

    /// Returns the angle of the output shaft in rad.
    #[must_use]
    pub fn angle_after(&self) -> f64 {
        self.state_after().angle / self.motor.gear_ratio
    }

    /// Returns the kinetic energy of motor and load, and the energy of a twisted train.
    #[must_use]
    pub fn motion_energy(&self) -> Joules {
        let ShaftState { speed, angle } = self.state;
        let own = 0.5 * self.shaft.inertia.0 * speed * speed;
        Joules(own + self.output.as_ref().map_or(0.0, |output| output.energy(angle).0))
    }

    /// Returns the angle of the motor shaft in rad. The angle is not limited to one turn.
    #[must_use]
    pub const fn angle(&self) -> f64 {
        self.state.angle
    }

    /// Returns the counts of an encoder on the motor shaft since angle 0.
    #[must_use]
    pub fn counts(&self) -> i64 {
        counts(self.state.angle, self.motor.counts_per_rev_motor)
    }

    /// Sets the state of the plant: motor current, speed of the motor shaft, and angle of the motor shaft in rad.
    pub fn set_state(&mut self, current: Amps, speed: RadPerSec, angle: f64) {
        self.current = current.0;
        self.last_mean = current.0;
        self.state = ShaftState { speed: speed.0, angle };
        if let Some(output) = &mut self.output {
            output.state = self.state;
        }
    }

    /// Advances by `dt` at a constant battery voltage.
    ///
    /// The PWM period continues from the last run. A new duty is applied immediately. Before a new mode is applied, the
    /// bridge is open for [`Bridge::change`].
    pub fn run(&mut self, dt: Seconds, input: PlantInput, battery: Volts) -> Flow {
        if input.off != self.off_state {
            self.off_state = input.off;
            self.open_s = self.circuit.bridge.change.0;
        }
        let open_s = self.open_s.min(dt.0);
        if open_s <= 0.0 {
            return self.advance(dt, input, battery);
        }
        self.open_s -= open_s;
        let open = PlantInput { torque_after: input.torque_after, ..PlantInput::COAST };
        let mut flow = self.advance(Seconds(open_s), open, battery);
        flow.append(&self.advance(Seconds(dt.0 - open_s), input, battery));
        flow
    }

    /// Advances by `dt` without a change of the mode.
    fn advance(&mut self, dt: Seconds, input: PlantInput, battery: Volts) -> Flow {
        let load_work = Joules(core::mem::take(&mut self.load_work));
        let mut flow = Flow { time: Seconds(dt.0.max(0.0)), load_work, ..Flow::default() };
        let mut left = dt.0;
        let period = 1.0 / self.frequency.0;
        // A remainder of the run below this time, in s, is a rounding error.
        let rounding = 1e-9 * period;
        while left > rounding {
            let to_end = period - self.phase;
            let window = self.longest_window.min(left);
            let (window, phase) = if to_end - window < rounding {
                (to_end.min(left), 0.0)
            } else {
                (window, self.phase + window)
            };
            self.window(window, input, battery, &mut flow);
            self.phase = phase;
            left -= window;
        }
        flow
    }

    /// Computes the longest window and the constants for a window of this length, after a change of motor or shaft.
    fn prepare_windows(&mut self) {
        self.longest_window = longest_window(&self.motor, &self.shaft, self.frequency);
        self.set_window(self.longest_window);
    }

    /// Computes the constants for windows of this length, in s.
    fn set_window(&mut self, window: f64) {
        self.mechanics = Mechanics::new(&self.shaft, window);
        self.admittance = self.circuit.admittance(window);
    }

    /// Advances by one window and adds its result to `flow`.
    fn window(&mut self, window: f64, input: PlantInput, battery: Volts, flow: &mut Flow) {
        if (window - self.mechanics.window).abs() > 1e-9 * window {
            self.set_window(window);
        }
        let m = self.mechanics;
        let (ke, kt) = (self.motor.ke.0, self.motor.kt.0);
        let load_torque = (self.load.torque_after.0 + input.torque_after.0) * self.shaft.torque_ratio;
        // With a train the external torque acts on the load, not on the motor: see `motion_at`.
        let external = if self.output.is_some() { 0.0 } else { load_torque };
        let torque = |mean_current: f64| kt * mean_current + external;
        let motion_at = |mean_current: f64, sticks: bool| match &self.output {
            Some(output) => self.train_motion(output, window, kt * mean_current, load_torque),
            None => {
                let motor = self.shaft_motion(torque(mean_current), sticks);
                WindowEnd { motor, load: ShaftState::default(), heat: 0.0 }
            }
        };
        let tolerance = 1e-6 * (battery.0 + 1.0);
        // How much the error below falls for each volt that is added to `emf`.
        let slope = 1.0 + ke * kt * m.mean_gain * self.admittance;
        // A shaft at rest is assumed to stay at rest first, because the current at standstill decides whether it breaks
        // away.
        let mut emf = ke * motion_at(self.last_mean, true).motor.mean;
        let (mut end, mut sums, mut mean) = self.electrical(window, emf, input, battery);
        // `sticks` is decided once in a window. Otherwise the back EMF of a shaft that broke away could make the shaft
        // stick again.
        let sticks = self.has_friction() && self.sticks(torque(mean));
        let mut end_of_window = motion_at(mean, sticks);
        // Smooth running takes one iteration, and a change of the command two. More iterations are needed only near a
        // stop or a change of direction.
        for _ in 0..6 {
            let error = ke * end_of_window.motor.mean - emf;
            if error.abs() <= tolerance {
                break;
            }
            emf += error / slope;
            (end, sums, mean) = self.electrical(window, emf, input, battery);
            end_of_window = motion_at(mean, sticks);
        }
        let WindowEnd { motor: motion, load, heat: train_heat } = end_of_window;
        // The current of a shaft at rest decays towards 0. It is set to 0 early, because subnormal numbers are slow.
        self.current = if self.has_friction() && end.abs() < 1e-30 { 0.0 } else { end };
        self.last_mean = mean;
        self.state.angle += window * motion.mean;
        self.state.speed = motion.end;
        if let Some(output) = &mut self.output {
            output.state = load;
        }

        flow.charge.0 += sums.current;
        flow.charge_shown.0 += sensed_charge(input.off, sums.current);
        flow.charge_from_battery.0 += sums.from_battery;
        flow.charge_to_battery.0 += sums.to_battery;
        flow.energy_from_battery.0 += battery.0 * sums.from_battery;
        flow.energy_to_battery.0 += battery.0 * sums.to_battery;
        flow.heat.0 += sums.heat;
        flow.shaft_work.0 += emf * sums.current;
        flow.friction_heat.0 += self.motor.friction.coulomb.0 * motion.sliding_angle;
        flow.train_heat.0 += train_heat;
    }

    /// Returns the motion of motor and load through a window, under `torque` on the motor and `load_torque` on the
    /// load, both in N m on the motor shaft.
    fn train_motion(&self, output: &Output, window: f64, torque: f64, load_torque: f64) -> WindowEnd {
        let cogging = self.motor.cogging.mean_torque(self.state.angle, window * self.state.speed);
        output.motion(&self.shaft, &self.motor.friction, self.state, window, torque + cogging, load_torque)
    }

    /// Returns true if friction keeps the shaft at rest at its present angle, under `torque` (N m) and cogging.
    fn sticks(&self, torque: f64) -> bool {
        self.motor.friction.sticks(torque + self.motor.cogging.torque(self.state.angle).0)
    }

    /// Returns the motion of the shaft from its present speed, under `torque` (N m), through the window of
    /// `mechanics`.
    fn shaft_motion(&self, torque: f64, sticks: bool) -> ShaftMotion {
        let m = &self.mechanics;
        if !self.has_friction() {
            return m.without_friction(self.state.speed, torque);
        }
        let motion =
            |torque| m.with_friction(&self.shaft, &self.motor.friction, self.state.speed, torque, sticks);
        let cogging = &self.motor.cogging;
        // The mean torque of cogging depends on the angle turned, and the angle on the torque. The window is so short
        // that each iteration leaves less than a hundredth of the error.
        let mut angle = m.window * self.state.speed;
        let mut last = motion(torque + cogging.mean_torque(self.state.angle, angle));
        for _ in 0..4 {
            let next = m.window * last.mean;
            if f64::from(cogging.per_turn) * (next - angle).abs() < 1e-8 {
                break;
            }
            angle = next;
            last = motion(torque + cogging.mean_torque(self.state.angle, angle));
        }
        last
    }

    /// Returns final current (A), integrals and mean current (A) of a window from the present current and phase.
    fn electrical(&self, window: f64, emf: f64, input: PlantInput, battery: Volts) -> (f64, Integrals, f64) {
        let at = Conditions { battery, emf: Volts(emf) };
        let PlantInput { on, off, duty, .. } = input;
        let pwm = Pwm { on, off, duty, frequency: self.frequency };
        let mut sums = Integrals::default();
        let end = self.circuit.part_of_period(pwm, self.phase, window, Amps(self.current), at, &mut sums);
        (end.0, sums, sums.current / window)
    }
}

/// Returns the charge that flows from the battery into the high-side switch that stays closed, at least 0. `state` is
/// the off state of the command: the bridge freewheels, or drives all the time.
const fn sensed_charge(state: State, charge: f64) -> f64 {
    match state {
        State::HighLeft | State::DriveCw => charge.max(0.0),
        State::HighRight | State::DriveCcw => (-charge).max(0.0),
        _ => 0.0,
    }
}

/// Returns the whole encoder counts in an angle in rad.
///
/// The encoder counts each time the angle passes a multiple of one turn divided by `counts_per_rev`.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "no run reaches 2^63 counts")]
pub fn counts(angle: f64, counts_per_rev: f64) -> i64 {
    (angle * counts_per_rev / core::f64::consts::TAU).floor() as i64
}
