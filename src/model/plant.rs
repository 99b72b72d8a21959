//! A geared motor with its load behind a switching bridge, for whole runs.
//!
//! Time advances in windows of at most one PWM period. Within a window the electrical side is
//! event-exact at a constant back EMF, the one of the window's own mean speed; the mechanical side
//! is the exact exponential under the window's mean torque. The two are iterated until they agree,
//! which makes the step second-order accurate and stable for every motor. The error is of the order
//! of `(w h)² / 24` of a change, `w` being the undamped frequency `sqrt(Ke Kt / (L Jt))` and `h` the
//! window; windows shorter than the period are taken so that `w h` stays below 0.15 and the mean
//! current of a few periods within 0.1 % of `Vbat/R`. Ripple of the speed within a window does not
//! feed back into the current.
//!
//! [Friction and cogging](super::friction) are exact for the mean torque of a window: a stop is an event
//! within it, from which the shaft turns back or rests, with a speed of exactly 0; cogging sets free
//! what it has stored. At rest the mean torque at standstill decides whether the shaft breaks away.
//! Ripple within a window does not: at 20 kHz it would turn a shaft by some 1e-7 rad, which contacts
//! are taken to give without slipping.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::load::Load;
//! use motor_hub::model::plant::{Influence, Plant};
//! use motor_hub::model::si::{Hertz, Seconds, Volts};
//! use motor_hub::model::switching::Bridge;
//!
//! // Driven clockwise at half of the duty for a tenth of a second.
//! let motor = characterised("AM 60 A")?.with_measured_rotor_inertia();
//! let mut plant = Plant::new(motor, Load::NONE, Bridge::IDEAL, Hertz(20_000.0));
//! let flow = plant.run(Seconds(0.1), Influence::pwm(Mode::Cw98, 0.5), Volts(12.0));
//! assert!(plant.counts() > 0 && flow.mean_current().0 > 0.0);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::catalogue::Motor;
use super::friction::{Cogging, Friction};
use super::load::{Load, Shaft};
use super::mechanics::{Mechanics, Turned};
use super::si::{Amps, Coulombs, Hertz, Joules, NewtonMetres, RadPerSec, Seconds, Volts};
use super::switching::{Bridge, Circuit, Conditions, Integrals, Part};
use crate::bridge::{Mode, State};

/// Largest product of undamped frequency and window.
const WINDOW_LIMIT: f64 = 0.15;

/// What acts on a plant: its bridge, and an external torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Influence {
    /// The state during the duty.
    pub on: State,
    /// The state during the rest of each PWM period.
    pub off: State,
    /// Share of each PWM period spent in `on`, 0 to 1.
    pub duty: f64,
    /// External torque on the output shaft beside the load's own, positive clockwise.
    pub torque_after: NewtonMetres,
}

impl Influence {
    /// All switches open, no external torque.
    pub const COAST: Self =
        Self { on: State::Coast, off: State::Coast, duty: 0.0, torque_after: NewtonMetres(0.0) };

    /// A mode at a duty from 0 to 1, without external torque.
    #[must_use]
    pub const fn pwm(mode: Mode, duty: f64) -> Self {
        Self { on: mode.on(), off: mode.off(), duty, torque_after: NewtonMetres(0.0) }
    }
}

/// What flowed during a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flow {
    /// Length of the run.
    pub time: Seconds,
    /// Charge through the motor, positive clockwise.
    pub charge: Coulombs,
    /// What of it a bridge shows that senses in its high-side switches: that through the one that is closed in 9/8 or 6/2,
    /// at least 0.
    pub charge_shown: Coulombs,
    /// Energy that left the battery, at least 0.
    pub energy_from_battery: Joules,
    /// Energy that went back into the battery, at least 0.
    pub energy_to_battery: Joules,
    /// Charge that left the battery, at least 0.
    pub charge_from_battery: Coulombs,
    /// Charge that went back into the battery, at least 0.
    pub charge_to_battery: Coulombs,
    /// Heat in winding, switches and diodes.
    pub heat: Joules,
    /// Energy that the motor turned into shaft work; negative while it brakes.
    pub shaft_work: Joules,
    /// Heat of dry friction, at least 0; viscous drag is not in it.
    pub friction_heat: Joules,
}

impl Flow {
    /// Mean motor current, 0 for a run of no length.
    #[must_use]
    pub fn mean_current(&self) -> Amps {
        Amps(if self.time.0 > 0.0 { self.charge.0 / self.time.0 } else { 0.0 })
    }

    /// Net charge out of the battery, C.
    #[must_use]
    pub fn battery_charge(&self) -> f64 {
        self.charge_from_battery.0 - self.charge_to_battery.0
    }

    /// Adds what flowed in a following run.
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
    }
}

/// A motor, its load and its bridge, in motion.
#[derive(Clone, Debug)]
pub struct Plant {
    motor: Motor,
    load: Load,
    shaft: Shaft,
    circuit: Circuit,
    period: f64,
    longest_window: f64,
    coefficients: Mechanics,
    /// Whether there is friction or cogging.
    rough: bool,
    /// Time since the present PWM period began.
    phase: f64,
    current: f64,
    speed: f64,
    angle: f64,
    /// Mean current of the window before, the first guess for the next one.
    last_mean: f64,
    /// The mode, by the state of the PWM line at rest, and how long the bridge is still open for its change.
    mode: State,
    open_s: f64,
}

/// What stays the same during a run.
#[derive(Clone, Copy)]
struct Run {
    influence: Influence,
    on_time: f64,
    battery: Volts,
    /// External torque, on the motor shaft.
    torque: f64,
}

/// In seconds.
fn longest_window(motor: &Motor, shaft: &Shaft, period: f64) -> f64 {
    let undamped = (motor.ke.0 * motor.kt.0 / (motor.l.0 * shaft.inertia.0)
        + motor.cogging.stiffness() / shaft.inertia.0)
        .sqrt();
    let windows = (period * undamped / WINDOW_LIMIT).ceil().max(1.0);
    period / windows
}

impl Plant {
    /// A plant at rest, without current, at angle 0 and the beginning of a PWM period.
    #[must_use]
    pub fn new(motor: Motor, load: Load, bridge: Bridge, pwm: Hertz) -> Self {
        let shaft = Shaft::new(&motor, &load);
        let circuit = Circuit::new(&motor, bridge);
        let period = 1.0 / pwm.0;
        let longest_window = longest_window(&motor, &shaft, period);
        Self {
            motor,
            load,
            shaft,
            circuit,
            period,
            longest_window,
            coefficients: Mechanics::new(&shaft, &circuit, longest_window),
            rough: motor.friction != Friction::NONE || motor.cogging != Cogging::NONE,
            phase: 0.0,
            current: 0.0,
            speed: 0.0,
            angle: 0.0,
            last_mean: 0.0,
            mode: State::Coast,
            open_s: 0.0,
        }
    }

    /// Connects another load, which has the shaft's speed at once.
    pub fn set_load(&mut self, load: Load) {
        self.load = load;
        self.shaft = Shaft::new(&self.motor, &load);
        self.longest_window = longest_window(&self.motor, &self.shaft, self.period);
        self.coefficients = Mechanics::new(&self.shaft, &self.circuit, self.longest_window);
    }

    /// Gives it another dry friction.
    pub fn set_friction(&mut self, friction: Friction) {
        self.motor.friction = friction;
        self.rough = friction != Friction::NONE || self.motor.cogging != Cogging::NONE;
    }

    /// The motor.
    #[must_use]
    pub const fn motor(&self) -> &Motor {
        &self.motor
    }

    /// The load.
    #[must_use]
    pub const fn load(&self) -> &Load {
        &self.load
    }

    /// Present motor current.
    #[must_use]
    pub const fn current(&self) -> Amps {
        Amps(self.current)
    }

    /// Present speed of the motor shaft.
    #[must_use]
    pub const fn speed(&self) -> RadPerSec {
        RadPerSec(self.speed)
    }

    /// Present speed of the output shaft.
    #[must_use]
    pub fn speed_after(&self) -> RadPerSec {
        RadPerSec(self.speed / self.motor.gear_ratio)
    }

    /// Angle that the motor shaft has turned, rad, without bound.
    #[must_use]
    pub const fn angle(&self) -> f64 {
        self.angle
    }

    /// What an encoder on the motor shaft has counted since angle 0.
    #[must_use]
    pub fn counts(&self) -> i64 {
        counts(self.angle, self.motor.counts_per_rev_motor)
    }

    /// Puts the plant into a state of motion: motor current, motor speed, motor angle in rad.
    pub fn place(&mut self, current: Amps, speed: RadPerSec, angle: f64) {
        self.current = current.0;
        self.last_mean = current.0;
        self.speed = speed.0;
        self.angle = angle;
    }

    /// Advances by `dt` at a constant battery voltage. The PWM period goes on where the run before
    /// left it; a new duty counts at once, a new mode when the bridge has let go of the old one.
    pub fn run(&mut self, dt: Seconds, influence: Influence, battery: Volts) -> Flow {
        if influence.off != self.mode {
            self.mode = influence.off;
            self.open_s = self.circuit.bridge.edges.change.0;
        }
        let open_s = self.open_s.min(dt.0);
        if open_s <= 0.0 {
            return self.go_on(dt, influence, battery);
        }
        self.open_s -= open_s;
        let open = Influence { torque_after: influence.torque_after, ..Influence::COAST };
        let mut flow = self.go_on(Seconds(open_s), open, battery);
        flow.append(&self.go_on(Seconds(dt.0 - open_s), influence, battery));
        flow
    }

    fn go_on(&mut self, dt: Seconds, influence: Influence, battery: Volts) -> Flow {
        let torque = (self.load.torque_after.0 + influence.torque_after.0) * self.shaft.torque_ratio;
        let on_time = influence.duty.clamp(0.0, 1.0) * self.period;
        let run = Run { influence, on_time, battery, torque };
        let mut flow = Flow { time: Seconds(dt.0.max(0.0)), ..Flow::default() };
        let mut left = dt.0;
        // Below this a remainder is rounding, not time.
        let dust = 1e-9 * self.period;
        while left > dust {
            let to_end = self.period - self.phase;
            let window = self.longest_window.min(left);
            let (window, phase) =
                if to_end - window < dust { (to_end.min(left), 0.0) } else { (window, self.phase + window) };
            self.window(window, &run, &mut flow);
            self.phase = phase;
            left -= window;
        }
        flow
    }

    fn window(&mut self, window: f64, run: &Run, flow: &mut Flow) {
        if (window - self.coefficients.window).abs() > 1e-9 * window {
            self.coefficients = Mechanics::new(&self.shaft, &self.circuit, window);
        }
        let m = self.coefficients;
        let (ke, kt) = (self.motor.ke.0, self.motor.kt.0);
        let torque = |mean_current: f64| kt * mean_current + run.torque;
        let tolerance = 1e-6 * (run.battery.0 + 1.0);
        let slope = 1.0 + ke * kt * m.mean_gain * m.admittance;
        // First as if what rests stays at rest: breaking away is judged by the current at standstill.
        let mut emf = ke * self.turned(torque(self.last_mean), true).mean;
        let (mut end, mut sums, mut mean) = self.electrical(window, emf, run);
        // Once for the window: a shaft that broke away is slower for its back EMF, and not held again.
        let holds = self.rough && self.holds(torque(mean));
        let mut turned = self.turned(torque(mean), holds);
        // One pass in smooth running, two after a change, more only around a kink.
        for _ in 0..6 {
            let miss = ke * turned.mean - emf;
            if miss.abs() <= tolerance {
                break;
            }
            emf += miss / slope;
            (end, sums, mean) = self.electrical(window, emf, run);
            turned = self.turned(torque(mean), holds);
        }
        // At rest nothing keeps up a current that dies away; numbers too small for full digits are slow.
        self.current = if self.rough && end.abs() < 1e-30 { 0.0 } else { end };
        self.last_mean = mean;
        self.angle += window * turned.mean;
        self.speed = turned.end;

        flow.charge.0 += sums.current;
        flow.charge_shown.0 += shown(run.influence.off, sums.current);
        flow.charge_from_battery.0 += sums.from_battery;
        flow.charge_to_battery.0 += sums.to_battery;
        flow.energy_from_battery.0 += run.battery.0 * sums.from_battery;
        flow.energy_to_battery.0 += run.battery.0 * sums.to_battery;
        flow.heat.0 += sums.heat;
        flow.shaft_work.0 += emf * sums.current;
        flow.friction_heat.0 += self.motor.friction.coulomb.0 * turned.rubbed;
    }

    /// Whether friction keeps the shaft at rest where it is, under `torque` and cogging.
    fn holds(&self, torque: f64) -> bool {
        self.motor.friction.holds(torque + self.motor.cogging.torque(self.angle).0)
    }

    /// How the shaft turns from the present speed through the window that the coefficients are for.
    fn turned(&self, torque: f64, holds: bool) -> Turned {
        if self.rough {
            self.turned_roughly(torque, holds)
        } else {
            self.coefficients.free(self.speed, torque)
        }
    }

    /// The same with friction and cogging; apart, to keep the smooth case short.
    #[inline(never)]
    fn turned_roughly(&self, torque: f64, holds: bool) -> Turned {
        let m = &self.coefficients;
        let turned = |torque| m.rubbing(&self.shaft, &self.motor.friction, self.speed, torque, holds);
        let cogging = &self.motor.cogging;
        // The mean torque of cogging follows from the way, the way from the torque. The window is so
        // short that each pass leaves less than a hundredth of the error.
        let mut by = m.window * self.speed;
        let mut last = turned(torque + cogging.mean_torque(self.angle, by));
        for _ in 0..4 {
            let way = m.window * last.mean;
            if f64::from(cogging.per_turn) * (way - by).abs() < 1e-8 {
                break;
            }
            by = way;
            last = turned(torque + cogging.mean_torque(self.angle, by));
        }
        last
    }

    /// Final current, integrals and mean current of a window from the present current and phase.
    fn electrical(&self, window: f64, emf: f64, run: &Run) -> (f64, Integrals, f64) {
        let at = Conditions { battery: run.battery, emf: Volts(emf) };
        let Influence { on, off, .. } = run.influence;
        let part =
            Part { on, off, on_s: run.on_time, period_s: self.period, from_s: self.phase, window_s: window };
        let mut sums = Integrals::default();
        let end = self.circuit.part_of_period(part, Amps(self.current), at, &mut sums);
        (end.0, sums, sums.current / window)
    }
}

/// What of a charge goes forward through the high-side switch that a mode keeps closed.
const fn shown(state: State, charge: f64) -> f64 {
    match state {
        State::HighLeft | State::DriveCw => charge.max(0.0),
        State::HighRight | State::DriveCcw => (-charge).max(0.0),
        _ => 0.0,
    }
}

/// Whole encoder counts in an angle in rad: the encoder steps when the angle passes a multiple of
/// a turn divided by `counts_per_rev`.
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "a run is far shorter than 2^63 counts")]
pub fn counts(angle: f64, counts_per_rev: f64) -> i64 {
    (angle * counts_per_rev / core::f64::consts::TAU).floor() as i64
}
