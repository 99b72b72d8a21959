//! States of a motor, events, and the demands that follow from them.

use crate::common::{BATTERY, Cable, free_cps, neverest_60};
use crate::flywheel::{Knowledge, Subject};
use motor_hub::braking::{self, DutyRule, Scheme};
use motor_hub::motor::{Setpoint, ZeroPower};
use motor_hub::units::{Control, CountsPerSecond, Period};

/// Motion and load of the motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    Rest,
    /// At rest under a load.
    Hanging,
    /// At 40 % of the free speed against 10 % of the stall torque.
    Turning,
    /// At 40 % of the free speed, driven by 30 % of the stall torque.
    Lowering,
    /// Faster than the battery could drive it, driven by 15 % of the stall torque.
    Overrun,
}

impl Motion {
    pub(crate) const ALL: [Self; 5] =
        [Self::Rest, Self::Hanging, Self::Turning, Self::Lowering, Self::Overrun];

    /// Load as a share of the stall torque.
    pub(crate) const fn load(self) -> f64 {
        match self {
            Self::Rest => 0.0,
            Self::Hanging => 0.2,
            Self::Turning => -0.1,
            Self::Lowering => 0.3,
            Self::Overrun => 0.15,
        }
    }

    /// Speed as a share of the free speed.
    pub(crate) const fn speed(self) -> f64 {
        match self {
            Self::Rest | Self::Hanging => 0.0,
            Self::Turning | Self::Lowering => 0.4,
            Self::Overrun => 1.1,
        }
    }
}

/// State of the motor at the event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum State {
    Disabled,
    Floating,
    Braked,
    Power,
    Velocity,
    /// Commanded to stand: for one tick if the motor turns, for 300 ms if it stands already.
    Zero,
    Moving,
    Holding,
    /// Driven against a stop by a velocity.
    Stalled,
    /// Driven against a stop by a position beyond the stop.
    Pressing,
    /// Driven against a stop by constant power.
    Blocked,
    /// The encoder was at fault and is plugged in again. The fault is latched until [`happen`] disables the motor.
    Faulted,
    BatteryLost,
    EncoderLost,
}

/// Each state, with the motions in which a motor can be in this state.
pub(crate) const STATES: [(State, &[Motion]); 14] = {
    use Motion::{Hanging, Lowering, Overrun, Rest, Turning};
    [
        (State::Disabled, &[Rest, Turning, Lowering, Overrun]),
        (State::Floating, &[Rest, Turning, Lowering, Overrun]),
        (State::Braked, &[Rest, Turning, Lowering, Overrun]),
        (State::Power, &[Turning, Overrun]),
        (State::Velocity, &[Turning, Lowering, Overrun]),
        (State::Zero, &Motion::ALL),
        (State::Moving, &[Turning, Lowering, Overrun]),
        (State::Holding, &[Rest, Hanging]),
        (State::Stalled, &[Rest]),
        (State::Pressing, &[Rest]),
        (State::Blocked, &[Rest]),
        (State::Faulted, &[Rest, Turning]),
        (State::BatteryLost, &Motion::ALL),
        (State::EncoderLost, &Motion::ALL),
    ]
};

/// Event that happens to the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Event {
    Disable,
    Float,
    Brake,
    /// The power that keeps the present speed.
    Power,
    /// The present velocity; at rest a high velocity.
    Velocity,
    Zero,
    /// A velocity in the other direction.
    Back,
    /// The present position.
    Here,
    /// A position far ahead.
    Far,
    /// A position behind the motor.
    Behind,
    SetCoefficients,
    ClearCoefficients,
    ConfigureDynamics,
    ForgetDynamics,
    Scheme(Scheme),
    LinearDuty,
    BatteryGap,
    /// Five samples of the encoder are missing.
    EncoderBlink,
    /// The samples of the encoder are missing for at least 60 ms.
    EncoderGap,
}

impl Event {
    /// The events that are tried with a motor of this knowledge.
    pub(crate) fn all(knowledge: Knowledge) -> Vec<Self> {
        use Event::*;
        let mut all = vec![Disable, Float, Brake, Power, Velocity, Zero, Back, Here, Far, Behind];
        all.extend(match knowledge {
            Knowledge::Configured => vec![SetCoefficients, ForgetDynamics],
            Knowledge::Unknown => vec![SetCoefficients, ConfigureDynamics],
            Knowledge::Coefficients => vec![ClearCoefficients],
        });
        all.extend(braking::Scheme::ALL.map(Scheme));
        all.extend([LinearDuty, BatteryGap, EncoderBlink, EncoderGap]);
        all
    }
}

/// Demand of the motor in physical terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Demand {
    Coast,
    Brake,
    /// Share of the battery voltage.
    Power(f64),
    Speed(f64),
    Position {
        target: i32,
        limit: f64,
    },
}

pub(crate) const BRISK: f64 = 0.4;
const STOP: f64 = 300.5;

fn cps(speed: f64) -> CountsPerSecond {
    CountsPerSecond::saturating_from_bits((256.0 * speed) as i64)
}

impl Subject {
    /// Sends the set-point of a demand.
    pub(crate) fn ask(&mut self, demand: Demand) {
        self.demand = demand;
        self.configure(|settings| settings.zero_power = ZeroPower::Brake);
        let setpoint = match demand {
            Demand::Coast => Setpoint::Disabled,
            Demand::Brake => Setpoint::ConstantPower(Control::ZERO),
            Demand::Power(share) => Setpoint::ConstantPower(Control::saturating((32_767.0 * share) as i64)),
            Demand::Speed(speed) => Setpoint::Velocity(cps(speed)),
            Demand::Position { target, limit } => {
                Setpoint::Position { target, tolerance: 10, speed_limit: cps(limit) }
            }
        };
        self.bench.set(0, setpoint);
    }

    /// Makes the motor coast, by a velocity of 0 with zero power set to float.
    fn float(&mut self) {
        self.demand = Demand::Coast;
        self.configure(|settings| settings.zero_power = ZeroPower::Float);
        self.bench.set(0, Setpoint::Velocity(CountsPerSecond::ZERO));
    }

    /// The power that keeps the speed, limited to the range of powers.
    fn steady_power(&self) -> Demand {
        let speed = self.speed();
        let share = speed / self.free_speed + self.ohms * self.need() / BATTERY;
        Demand::Power(if speed.abs() < 20.0 { 0.3 } else { share.clamp(0.1, 1.0) })
    }

    fn far(&self) -> Demand {
        let limit = self.speed().abs().max(BRISK * self.free_speed);
        Demand::Position { target: self.position() + 20_000, limit }
    }
}

/// Returns a motor that its regulator has moved like this for a long time.
pub(crate) fn under_way(motion: Motion, knowledge: Knowledge, scheme: Scheme, period: Period) -> Subject {
    let speed = motion.speed() * free_cps(&neverest_60());
    let mut subject = Subject::new(knowledge, scheme, period, speed, motion.load());
    subject.ask(if motion == Motion::Rest { Demand::Coast } else { Demand::Speed(speed) });
    subject.run(match motion {
        Motion::Rest => 100,
        // PID takes some seconds to stop the sinking load.
        Motion::Hanging => 3_000,
        Motion::Turning | Motion::Lowering | Motion::Overrun => 1_000,
    });
    subject
}

/// Brings the motor into a state.
pub(crate) fn enter(state: State, motion: Motion, under_way: &Subject) -> Subject {
    let mut subject = under_way.clone();
    let brisk = BRISK * subject.free_speed;
    let standing = matches!(motion, Motion::Rest | Motion::Hanging);
    match state {
        State::Velocity => {}
        State::Disabled | State::Floating | State::Braked | State::Zero => {
            match state {
                State::Disabled => subject.ask(Demand::Coast),
                State::Floating => subject.float(),
                State::Braked => subject.ask(Demand::Brake),
                _ => subject.ask(Demand::Speed(0.0)),
            }
            subject.run(if standing { 300 } else { 1 });
        }
        State::Power | State::Moving | State::Holding => {
            subject.ask(match state {
                State::Power => subject.steady_power(),
                State::Moving => subject.far(),
                _ => Demand::Position { target: subject.position(), limit: brisk },
            });
            subject.run(300);
        }
        State::Stalled | State::Pressing | State::Blocked => {
            subject.bench.axes[0].stops.1 = f64::from(subject.position()) + STOP;
            subject.ask(match state {
                State::Stalled => Demand::Speed(brisk),
                State::Pressing => subject.far(),
                _ => Demand::Power(BRISK),
            });
            subject.run(1_000);
            let held = (0..30).any(|_| {
                let before = subject.speed();
                let stalled = subject.run(100).stalled;
                (before, subject.speed()) == (0.0, 0.0) && (stalled || state == State::Blocked)
            });
            assert!(held, "a motor is not held by its stop");
        }
        State::Faulted => {
            subject.bench.axes[0].cable = Cable::Unplugged;
            subject.ask(Demand::Speed(brisk));
            let latched = (0..40).any(|_| subject.run(100).faults.encoder.is_some());
            assert!(latched, "an encoder's fault goes unnoticed in 4 s");
            subject.bench.axes[0].cable = Cable::Plugged;
            subject.run(300);
            subject.demand = Demand::Coast;
        }
        State::BatteryLost => subject.lose_battery(60),
        State::EncoderLost => subject.lose_encoder(),
    }
    subject
}

/// Lets the event happen. A set-point that it brings is the new demand.
pub(crate) fn happen(event: Event, state: State, subject: &mut Subject) {
    let (speed, brisk) = (subject.speed(), BRISK * subject.free_speed);
    let brisk = if speed.abs() < 20.0 { brisk } else { speed };
    if state == State::Faulted {
        subject.bench.set(0, Setpoint::Disabled);
    }
    match event {
        Event::Disable => subject.ask(Demand::Coast),
        Event::Float => subject.float(),
        Event::Brake => subject.ask(Demand::Brake),
        Event::Power => subject.ask(subject.steady_power()),
        Event::Velocity => subject.ask(Demand::Speed(brisk)),
        Event::Zero => subject.ask(Demand::Speed(0.0)),
        // The motor leaves a stop slowly.
        Event::Back => subject.ask(Demand::Speed(
            if matches!(state, State::Stalled | State::Pressing | State::Blocked) { -0.1 } else { -1.0 }
                * brisk,
        )),
        Event::Here => subject.ask(Demand::Position { target: subject.position(), limit: brisk.abs() }),
        Event::Behind => {
            subject.ask(Demand::Position { target: subject.position() - 1_000, limit: brisk.abs() });
        }
        Event::Far => subject.ask(subject.far()),
        Event::SetCoefficients => subject.set_coefficients(),
        Event::ClearCoefficients => subject.configure(|settings| settings.coefficients = None),
        Event::ConfigureDynamics => subject.configure_dynamics(),
        Event::ForgetDynamics => subject.configure(|settings| settings.dynamics = None),
        Event::Scheme(scheme) => subject.configure(|settings| settings.scheme = scheme),
        Event::LinearDuty => subject.configure(|settings| settings.duty = DutyRule::LinearDuty),
        Event::BatteryGap => subject.lose_battery(2 * subject.period_ms()),
        Event::EncoderBlink => subject.bench.axes[0].unread_ms = 5,
        Event::EncoderGap => subject.lose_encoder(),
    }
}
