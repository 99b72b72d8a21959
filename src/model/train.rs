//! A gear train that is not rigid: backlash and a compliant shaft between the motor and its load. Motor and load are
//! then two masses with their own speeds.
//!
//! All angles are referred to the motor shaft. `x` is the part of the angle between motor and load that is beyond the
//! backlash, and `d` is the difference of their speeds. With the stiffness `K` and the damping `C` of the shaft the
//! train transmits the torque `K x + C d` while teeth touch. With a backlash, teeth can only push: where the formula
//! gives a pulling torque, the torque is 0, and the teeth separate. The implicit midpoint rule gives the torque for a
//! short step, in which the torque is constant. The motion of each mass under this torque is exact. A step ends where
//! teeth meet or separate.
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

/// Largest product of the train's natural frequency (rad/s) and the length of a step (s), without unit. It limits the
/// error of a step. Chosen: the test `a_train_agrees_with_integration_in_small_steps_within_a_thousandth` checks the
/// error.
const STEP_LIMIT: f64 = 0.05;

/// Largest distance of teeth, in rad, that counts as touching. Rounding errors of the angles are smaller: 1e-13 rad at
/// 1000 rad.
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
    /// Half of the backlash, rad. Teeth touch at this angle between motor and load, in either direction.
    half_backlash: f64,
    /// Stiffness of the shaft, N m/rad.
    stiffness: f64,
    /// Damping of the shaft, N m s/rad.
    damping: f64,
    /// Present speed and angle of the load.
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
    /// Motion of the motor.
    pub(super) motor: ShaftMotion,
    /// Speed and angle of the load at the end of the window.
    pub(super) load: ShaftState,
    /// Heat of the shaft's damping, J.
    pub(super) heat: f64,
}

impl Output {
    /// Converts load and train to the motor shaft. Returns `None` if the load has no inertia, because its motion would
    /// then be undefined while no teeth touch.
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
            half_backlash: 0.5 * n * train.backlash_after,
            stiffness: train.stiffness_after * reflection,
            damping: train.damping_after * reflection,
            state: ShaftState::default(),
        })
    }

    /// Returns the kinetic energy of the load and the energy of the twisted shaft together, for a motor at `angle` in
    /// rad.
    pub(super) fn energy(&self, angle: f64) -> Joules {
        let speed = self.state.speed;
        Joules(0.5 * self.body.inertia.0 * speed * speed + self.spring_energy(angle - self.state.angle))
    }

    /// Returns the energy in J of the twisted shaft, for the angle `theta` in rad from load to motor.
    fn spring_energy(&self, theta: f64) -> f64 {
        let twist = theta - theta.clamp(-self.half_backlash, self.half_backlash);
        0.5 * self.stiffness * twist * twist
    }

    /// Returns the end of a window in seconds, under torques in N m on the motor and on the load. The motor alone has
    /// `shaft` and `friction`, and begins the window in `state`.
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
            let x = theta - side * self.half_backlash;
            let acceleration = (torque - shaft.drag.0 * motor.speed) / shaft.inertia.0
                - (load_torque - self.body.drag.0 * load.speed) / self.body.inertia.0;
            let k = 0.5 * step * self.stiffness + self.damping;
            let coupling = (self.stiffness * x + k * (d + 0.5 * step * acceleration))
                / (1.0 + 0.5 * step * k * compliance);
            let pulls = self.half_backlash > 0.0 && coupling * side <= 0.0;
            let coupling = if pulls { 0.0 } else { coupling };
            let net = torque - coupling;
            let sticks = friction.sticks(net);
            let motor_moves =
                Mechanics::new(shaft, step).with_friction(shaft, friction, motor.speed, net, sticks);
            let load_moves =
                Mechanics::new(&self.body, step).without_friction(load.speed, load_torque + coupling);
            let difference = motor_moves.mean - load_moves.mean;
            heat += if pulls {
                // The teeth part, and the shaft untwists against its own damping.
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

    /// Returns 1 if teeth touch in the clockwise direction, -1 if they touch in the other direction, and 0 if none
    /// touch. The result is always 1 without backlash.
    fn side(&self, theta: f64) -> f64 {
        if self.half_backlash == 0.0 || theta >= self.half_backlash - TOUCH {
            1.0
        } else if theta <= TOUCH - self.half_backlash {
            -1.0
        } else {
            0.0
        }
    }

    /// Returns the seconds until teeth meet or part at the present difference `d` of the speeds (rad/s), or infinity if
    /// they do neither. `side` is the result of [`side`](Self::side).
    fn to_event(&self, theta: f64, d: f64, side: f64) -> f64 {
        let distance = if self.half_backlash == 0.0 || d == 0.0 {
            return f64::INFINITY;
        } else if side == 0.0 {
            self.half_backlash.copysign(d) - theta
        } else {
            side * self.half_backlash - theta
        };
        // Teeth that touch already, or that move away from this position, have no event.
        if distance.abs() <= TOUCH || distance * d <= 0.0 { f64::INFINITY } else { distance / d }
    }
}
