//! The table's margins: what a motor may be doing, what may happen to it, and what is asked of it from then on.

use crate::bench::{BATTERY, Bench, Constants, Knowledge};
use motor_hub::braking::{self, Blend, DutyRule, Scheme};
use motor_hub::motor::{Setpoint, ZeroPower};
use motor_hub::units::{Control, CountsPerSecond, Period};

/// How the motor moves, and under which load.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
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

    /// As a share of the stall torque.
    pub(crate) const fn load(self) -> f64 {
        match self {
            Self::Rest => 0.0,
            Self::Hanging => 0.2,
            Self::Turning => -0.1,
            Self::Lowering => 0.3,
            Self::Overrun => 0.15,
        }
    }

    /// As a share of the free speed.
    pub(crate) const fn speed(self) -> f64 {
        match self {
            Self::Rest | Self::Hanging => 0.0,
            Self::Turning | Self::Lowering => 0.4,
            Self::Overrun => 1.1,
        }
    }
}

/// What a motor is doing when the event comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum State {
    Disabled,
    Floating,
    Braked,
    Power,
    Velocity,
    /// Commanded to stand, and as far as it came within a tick.
    Zero,
    Moving,
    Holding,
    /// Driven against a stop by a velocity,
    Stalled,
    /// and by a position beyond it.
    Pressing,
    /// Its encoder was unplugged, and is plugged in again: disabled and enabled.
    Faulted,
    BatteryLost,
    EncoderLost,
}

impl State {
    pub(crate) const ALL: [Self; 13] = [
        Self::Disabled,
        Self::Floating,
        Self::Braked,
        Self::Power,
        Self::Velocity,
        Self::Zero,
        Self::Moving,
        Self::Holding,
        Self::Stalled,
        Self::Pressing,
        Self::Faulted,
        Self::BatteryLost,
        Self::EncoderLost,
    ];

    pub(crate) const fn against_a_stop(self) -> bool {
        matches!(self, Self::Stalled | Self::Pressing)
    }
}

/// What happens to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Event {
    Disable,
    Float,
    Brake,
    /// The power that it needs as it moves.
    Power,
    /// The velocity that it has; a brisk one at rest.
    Velocity,
    Zero,
    /// A velocity the other way.
    Back,
    /// The position where it is,
    Here,
    /// one far ahead,
    Far,
    /// and one behind it.
    Behind,
    SetCoefficients,
    ClearCoefficients,
    ConfigureDynamics,
    ForgetDynamics,
    Scheme(Scheme),
    LinearDuty,
    BatteryGap,
    /// Five samples do not come.
    EncoderBlink,
    /// For 60 ms no sample comes.
    EncoderGap,
}

impl Event {
    pub(crate) fn all() -> Vec<Self> {
        use Event::*;
        let mut all = vec![Disable, Float, Brake, Power, Velocity, Zero, Back, Here, Far, Behind];
        all.extend([SetCoefficients, ClearCoefficients, ConfigureDynamics, ForgetDynamics]);
        all.extend(braking::Scheme::EACH.map(Scheme));
        all.extend([LinearDuty, BatteryGap, EncoderBlink, EncoderGap]);
        all
    }

    /// True if the event is tried with a motor of this knowledge.
    pub(crate) const fn concerns(self, knowledge: Knowledge) -> bool {
        match self {
            Self::ClearCoefficients => matches!(knowledge, Knowledge::Coefficients),
            Self::ConfigureDynamics => matches!(knowledge, Knowledge::Unknown),
            Self::ForgetDynamics => matches!(knowledge, Knowledge::Configured),
            Self::SetCoefficients => !matches!(knowledge, Knowledge::Coefficients),
            _ => true,
        }
    }

    /// A short name.
    pub(crate) fn name(self) -> String {
        match self {
            Self::Scheme(scheme) => format!("Scheme {}", scheme_name(scheme)),
            other => format!("{other:?}"),
        }
    }
}

pub(crate) fn scheme_name(scheme: Scheme) -> &'static str {
    match scheme {
        Scheme::A => "A",
        Scheme::B => "B",
        Scheme::C => "C",
        Scheme::D(Blend::Automatic) => "D",
        Scheme::D(Blend::Fixed(_)) => "D.5",
        Scheme::ForwardReverse => "FR",
    }
}

/// What the motor is asked for, in physical terms.
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

/// A motor in a state, and what is asked of it.
pub(crate) type Placed = (Bench, Demand);

pub(crate) const BRISK: f64 = 0.4;
pub(crate) const STOP: i64 = 300;

pub(crate) fn cps(speed: f64) -> CountsPerSecond {
    CountsPerSecond::saturating_from_bits((256.0 * speed) as i64)
}

/// Sets what stands for the demand.
pub(crate) fn ask(bench: &mut Bench, demand: Demand) -> Demand {
    bench.configure(|settings| settings.zero_power = ZeroPower::Brake);
    bench.motor.set(match demand {
        Demand::Coast => Setpoint::Disabled,
        Demand::Brake => Setpoint::ConstantPower(Control::ZERO),
        Demand::Power(share) => Setpoint::ConstantPower(Control::saturating((32_767.0 * share) as i64)),
        Demand::Speed(speed) => Setpoint::Velocity(cps(speed)),
        Demand::Position { target, limit } => {
            Setpoint::Position { target, tolerance: 10, speed_limit: cps(limit) }
        }
    });
    demand
}

pub(crate) fn float(bench: &mut Bench) -> Demand {
    bench.configure(|settings| settings.zero_power = ZeroPower::Float);
    bench.motor.set(Setpoint::Velocity(CountsPerSecond::ZERO));
    Demand::Coast
}

/// The power that keeps the speed, as far as powers can.
pub(crate) fn power_of(bench: &Bench) -> f64 {
    let speed = bench.speed();
    let steady = (bench.constants.kappa * speed + bench.constants.ohms * bench.need(speed)) / BATTERY;
    if speed.abs() < 20.0 { 0.3 } else { steady.clamp(0.1, 1.0) }
}

pub(crate) fn far(bench: &Bench) -> Demand {
    let limit = bench.speed().abs().max(BRISK * bench.constants.free_speed);
    Demand::Position { target: bench.position() + 20_000, limit }
}

/// A motor that is moved by its regulator as this says, for long.
pub(crate) fn under_way(motion: Motion, knowledge: Knowledge, scheme: Scheme, period: Period) -> Placed {
    let speed = motion.speed() * Constants::new().free_speed;
    let mut bench = Bench::new(knowledge, scheme, period, speed);
    bench.load = motion.load();
    let demand = if motion == Motion::Rest { Demand::Coast } else { Demand::Speed(speed) };
    ask(&mut bench, demand);
    bench.run(if motion == Motion::Rest { 100 } else { 1_000 });
    (bench, demand)
}

/// The same in a state; `None` where there is no such thing.
pub(crate) fn enter(state: State, motion: Motion, (bench, demand): &Placed) -> Option<Placed> {
    let (mut bench, mut demand) = (bench.clone(), *demand);
    let brisk = BRISK * bench.constants.free_speed;
    let standing = matches!(motion, Motion::Rest | Motion::Hanging);
    match state {
        State::Disabled | State::Floating | State::Braked | State::Power if motion == Motion::Hanging => {
            return None;
        }
        State::Velocity | State::Moving if standing => return None,
        State::Holding if !standing => return None,
        State::Power if standing || motion == Motion::Lowering => return None,
        State::Stalled | State::Pressing if motion != Motion::Rest => return None,
        State::Faulted if !matches!(motion, Motion::Rest | Motion::Turning) => return None,
        State::Disabled => demand = ask(&mut bench, Demand::Coast),
        State::Floating => demand = float(&mut bench),
        State::Braked => demand = ask(&mut bench, Demand::Brake),
        State::Power => {
            let power = Demand::Power(power_of(&bench));
            demand = ask(&mut bench, power);
        }
        State::Velocity => {}
        State::Zero => demand = ask(&mut bench, Demand::Speed(0.0)),
        State::Moving => {
            let far = far(&bench);
            demand = ask(&mut bench, far);
        }
        State::Holding => {
            let here = Demand::Position { target: bench.position(), limit: brisk };
            demand = ask(&mut bench, here);
        }
        State::Stalled | State::Pressing => {
            bench.stop = Some(i64::from(bench.position()) + STOP);
            let far = far(&bench);
            demand = ask(&mut bench, if state == State::Stalled { Demand::Speed(brisk) } else { far });
            bench.run(1_000);
            let held = (0..30).any(|_| {
                let tick = bench.run(100);
                tick.speeds == (0.0, 0.0) && tick.report.stalled
            });
            assert!(held, "a motor is not held by its stop");
        }
        State::Faulted => {
            bench.plugged = false;
            ask(&mut bench, Demand::Speed(brisk));
            let latched = (0..40).any(|_| bench.run(100).report.faults.encoder.is_some());
            assert!(latched, "an encoder's fault goes unnoticed in 4 s");
            bench.plugged = true;
            bench.run(300);
            demand = Demand::Coast;
        }
        State::BatteryLost => {
            bench.battery = false;
            bench.run(60);
            bench.battery = true;
        }
        State::EncoderLost => {
            bench.read = false;
            bench.run(60);
            bench.read = true;
            bench.sample();
        }
    }
    match state {
        State::Disabled | State::Floating | State::Braked | State::Zero if !standing => {
            bench.tick();
        }
        State::BatteryLost | State::EncoderLost | State::Faulted => {}
        State::Stalled | State::Pressing | State::Velocity => {}
        _ => {
            bench.run(300);
        }
    }
    Some((bench, demand))
}

/// The event; what is asked of the motor from then on.
pub(crate) fn happen(event: Event, state: State, (bench, before): &mut Placed) -> Demand {
    let (speed, brisk) = (bench.speed(), BRISK * bench.constants.free_speed);
    let brisk = if speed.abs() < 20.0 { brisk } else { speed };
    let (constants, period) = (bench.constants, bench.period);
    if state == State::Faulted {
        bench.motor.set(Setpoint::Disabled);
    }
    match event {
        Event::Disable => return ask(bench, Demand::Coast),
        Event::Float => return float(bench),
        Event::Brake => return ask(bench, Demand::Brake),
        Event::Power => {
            let power = Demand::Power(power_of(bench));
            return ask(bench, power);
        }
        Event::Velocity => return ask(bench, Demand::Speed(brisk)),
        Event::Zero => return ask(bench, Demand::Speed(0.0)),
        Event::Back => {
            // Slowly, away from a stop.
            let back = if state.against_a_stop() { -0.1 * brisk } else { -brisk };
            return ask(bench, Demand::Speed(back));
        }
        Event::Here | Event::Behind => {
            let target = bench.position() - if event == Event::Here { 0 } else { 1_000 };
            return ask(bench, Demand::Position { target, limit: brisk.abs() });
        }
        Event::Far => {
            let far = far(bench);
            return ask(bench, far);
        }
        Event::SetCoefficients => bench.configure(|settings| {
            settings.coefficients = Some(constants.coefficients(settings.scheme, period));
        }),
        Event::ClearCoefficients => bench.configure(|settings| settings.coefficients = None),
        Event::ConfigureDynamics => {
            bench.configure(|settings| settings.dynamics = Some(constants.dynamics()))
        }
        Event::ForgetDynamics => bench.configure(|settings| settings.dynamics = None),
        Event::Scheme(scheme) => bench.configure(|settings| settings.scheme = scheme),
        Event::LinearDuty => bench.configure(|settings| settings.duty = DutyRule::LinearDuty),
        Event::BatteryGap => {
            bench.battery = false;
            bench.tick();
            bench.tick();
            bench.battery = true;
        }
        Event::EncoderBlink => bench.blind_ms = 5,
        Event::EncoderGap => {
            bench.read = false;
            bench.run(60);
            bench.read = true;
            bench.sample();
        }
    }
    *before
}
