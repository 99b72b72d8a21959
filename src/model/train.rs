//! A gear train that is not rigid: backlash and a compliant shaft between the motor and its load, which are two masses then.
//!
//! All angles are referred to the motor shaft. `x` is the part of the angle between motor and load that is beyond the
//! backlash, and `d` is the difference of their speeds. The train transmits the torque `K x + C d`, but it never pulls
//! teeth together across the backlash. The implicit midpoint rule gives this torque for a short step, in which it is
//! constant; each of the two masses then moves exactly. A step ends where teeth meet or part.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::load::Load;
//! use motor_hub::model::plant::{Plant, PlantInput};
//! use motor_hub::model::si::{Hertz, KgM2, Seconds, Volts};
//! use motor_hub::model::switching::Bridge;
//! use motor_hub::model::train::Train;
//!
//! // With a backlash of 10 degrees the motor turns for a while before its load does.
//! let train = Train { backlash_after: 10f64.to_radians(), stiffness_after: 500.0, damping_after: 0.1 };
//! let motor = characterised("AM 60 A")?.with_measured_rotor_inertia();
//! let plant = Plant::new(motor, Load::inertia(KgM2(0.01)), Bridge::IDEAL, Hertz(20_000.0));
//! let mut plant = plant.with_train(train);
//! plant.run(Seconds(0.01), PlantInput::pwm(Mode::Cw98, 1.0), Volts(12.0));
//! assert!(plant.speed().0 > 1.0 && plant.speed_after().0 == 0.0);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::catalogue::Motor;
use super::friction::Friction;
use super::load::{Load, Shaft};
use super::mechanics::{Mechanics, ShaftMotion};
use super::si::{Drag, Joules, KgM2};

/// Largest product of the train's natural frequency (rad/s) and a step (s). It limits the error of a step.
const STEP_LIMIT: f64 = 0.05;

/// Angle in rad up to which teeth at the end of the backlash touch. It is a rounding error.
const TOUCH: f64 = 1e-12;

/// A gear train between motor and load, as seen at the output shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Train {
    /// Backlash: the angle in rad by which the output shaft turns freely while the motor rests, at least 0.
    pub backlash_after: f64,
    /// Stiffness of the shaft, N m/rad, above 0.
    pub stiffness_after: f64,
    /// Damping of the shaft, N m s/rad, at least 0.
    pub damping_after: f64,
}

/// A load behind a train, referred to the motor shaft.
#[derive(Clone, Debug)]
pub(super) struct Output {
    /// Inertia and drag of the load alone.
    body: Shaft,
    /// Half of the backlash, rad.
    gap: f64,
    /// N m/rad.
    stiffness: f64,
    /// N m s/rad.
    damping: f64,
    /// State of the load.
    pub(super) state: ShaftState,
}

/// Speed (rad/s) and angle (rad) of a body, referred to the motor shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ShaftState {
    pub(super) speed: f64,
    pub(super) angle: f64,
}

/// The end of a window.
#[derive(Clone, Copy, Debug)]
pub(super) struct WindowEnd {
    /// ShaftState of the motor.
    pub(super) motor: ShaftMotion,
    /// State of the load.
    pub(super) load: ShaftState,
    /// Heat of the shaft's damping, J.
    pub(super) heat: f64,
}

impl Output {
    /// `None` if the load has no inertia: then there is nothing to turn behind the train.
    pub(super) fn new(motor: &Motor, load: &Load, train: &Train) -> Option<Self> {
        let n = motor.gear_ratio;
        let reflection = 1.0 / (motor.eta * n * n);
        let body = Shaft {
            inertia: KgM2(load.inertia_after.0 * reflection),
            drag: Drag(load.drag_after.0 * reflection),
            torque_ratio: 1.0 / (motor.eta * n),
        };
        (body.inertia.0 > 0.0).then_some(Self {
            body,
            gap: 0.5 * n * train.backlash_after,
            stiffness: train.stiffness_after * reflection,
            damping: train.damping_after * reflection,
            state: ShaftState::default(),
        })
    }

    /// Kinetic energy of the load, and energy of the twisted shaft, while the motor is at `angle` in rad.
    pub(super) fn energy(&self, angle: f64) -> Joules {
        let speed = self.state.speed;
        Joules(0.5 * self.body.inertia.0 * speed * speed + self.spring_energy(angle - self.state.angle))
    }

    /// Energy in J of the shaft at an angle in rad between motor and load.
    fn spring_energy(&self, theta: f64) -> f64 {
        let twist = theta - theta.clamp(-self.gap, self.gap);
        0.5 * self.stiffness * twist * twist
    }

    /// Returns the end of a window in seconds, under torques in N m on the motor and on the load. The motor alone has `shaft` and
    /// `friction`, and begins the window in `state`.
    pub(super) fn motion(
        &self,
        shaft: &Shaft,
        friction: &Friction,
        state: ShaftState,
        window: f64,
        torque: f64,
        load_torque: f64,
    ) -> WindowEnd {
        let compliance = 1.0 / shaft.inertia.0 + 1.0 / self.body.inertia.0;
        let steps = (window * (self.stiffness * compliance).sqrt() / STEP_LIMIT).ceil().max(1.0);
        let (mut motor, mut load) = (state, self.state);
        let (mut heat, mut sliding_angle, mut left) = (0.0, 0.0, window);
        while left > 1e-9 * window / steps {
            let (theta, d) = (motor.angle - load.angle, motor.speed - load.speed);
            let side = self.side(theta);
            let step = (window / steps).min(left).min(self.to_event(theta, d, side));
            let x = theta - side * self.gap;
            let acceleration = (torque - shaft.drag.0 * motor.speed) / shaft.inertia.0
                - (load_torque - self.body.drag.0 * load.speed) / self.body.inertia.0;
            let k = 0.5 * step * self.stiffness + self.damping;
            let coupling = (self.stiffness * x + k * (d + 0.5 * step * acceleration))
                / (1.0 + 0.5 * step * k * compliance);
            let pulls = self.gap > 0.0 && coupling * side <= 0.0;
            let coupling = if pulls { 0.0 } else { coupling };
            let net = torque - coupling;
            let sticks = friction.sticks(net);
            let motor_moves =
                Mechanics::new(shaft, step).with_friction(shaft, friction, motor.speed, net, sticks);
            let load_moves =
                Mechanics::new(&self.body, step).without_friction(load.speed, load_torque + coupling);
            let difference = motor_moves.mean - load_moves.mean;
            heat += if pulls {
                // The teeth have parted, and the shaft relaxes by itself against its damping.
                self.spring_energy(theta) - self.spring_energy(theta + step * difference)
            } else {
                self.damping * difference * difference * step
            };
            sliding_angle += motor_moves.sliding_angle;
            motor = ShaftState { speed: motor_moves.end, angle: motor.angle + step * motor_moves.mean };
            load = ShaftState { speed: load_moves.end, angle: load.angle + step * load_moves.mean };
            left -= step;
        }
        let mean = (motor.angle - state.angle) / window;
        WindowEnd { motor: ShaftMotion { mean, end: motor.speed, sliding_angle }, load, heat }
    }

    /// 1 if teeth touch in the clockwise direction, -1 in the other, 0 within the backlash. Without backlash always 1.
    fn side(&self, theta: f64) -> f64 {
        if self.gap == 0.0 || theta >= self.gap - TOUCH {
            1.0
        } else if theta <= TOUCH - self.gap {
            -1.0
        } else {
            0.0
        }
    }

    /// Seconds until teeth meet or part at the present difference `d` of the speeds; infinite if they do neither.
    fn to_event(&self, theta: f64, d: f64, side: f64) -> f64 {
        let way = if self.gap == 0.0 || d == 0.0 {
            return f64::INFINITY;
        } else if side == 0.0 {
            self.gap.copysign(d) - theta
        } else {
            side * self.gap - theta
        };
        // Teeth that touch already, or that move into one another, have no event.
        if way.abs() <= TOUCH || way * d <= 0.0 { f64::INFINITY } else { way / d }
    }
}
