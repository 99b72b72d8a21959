//! Random scenarios: any motor, any load, any battery, any period, any scheme. A random scenario can be written as a
//! scenario file.

use super::{friction_percent, time_constant};
use crate::velocity;
use motor_hub::braking::{Blend, DutyRule, Scheme};
use motor_hub::model::battery::Battery;
use motor_hub::model::catalogue::{self, motors};
use motor_hub::model::load::{Load, Shaft};
use motor_hub::model::si::{Drag, KgM2, Ohms, Volts};
use motor_hub::motor::Setpoint;
use motor_hub::units::{CountsPerSecond, Period};
use serde::Serialize;
use simulated::scenario::{Configuration, Motor, Scenario, Timed};
use simulated::scheme::SchemeWords;

/// Largest time constant of a motor with its load, in seconds.
const LONGEST_TIME_CONSTANT: f64 = 3.0;
/// Least time constant in seconds of a motor with the paper's inertia and a load. A motor whose measured inertia makes
/// it slower than [`LONGEST_TIME_CONSTANT`] has the paper's inertia.
const SHORTEST_LOADED: f64 = 0.05;
/// Least battery voltage with all motors stalled. The supply's limit is 5 V.
const LEAST_VOLTS: f64 = 5.5;

/// Share of the motors with dry friction.
const ROUGH: f64 = 0.5;
/// Largest dry friction in percent of the stall torque at 12 V.
const MOST_FRICTION: f64 = 10.0;

/// The scenario of this number in the survey of this seed. Each scenario has random numbers of its own.
pub fn scenario(seed: u64, index: u64) -> Scenario {
    // A hash of the seed, so that neighbouring seeds share no scenarios.
    let mut random = Random(fastrand::Rng::with_seed(fastrand::Rng::with_seed(seed).u64(..) ^ index));
    let period = Period::from_millis(random.logarithmic(1.0, 100.0).round() as u32).unwrap_or_default();
    let emf = random.rounded(6.5, 14.5, 10.0);
    let count = 1 + random.0.usize(..3);
    let chosen: Vec<_> = (0..count).map(|_| random.motor()).collect();
    let drawn: f64 = chosen.iter().map(|(motor, _)| emf / motor.r.0).sum();
    let resistance = random.rounded(0.0, 0.1, 1e3).min((emf - LEAST_VOLTS) / drawn);
    let volts = 0.95 * (emf - resistance * drawn);
    let mut motors: Vec<Motor> = chosen
        .into_iter()
        .enumerate()
        .map(|(number, (constants, load))| random.plan(format!("motor {number}"), constants, load, volts))
        .collect();
    let last = |motor: &Motor| {
        let times =
            motor.setpoints.iter().map(|timed| timed.at_s).chain(motor.torques.iter().map(|t| t.at_s));
        times.fold(0.0, f64::max)
    };
    roughen(&mut motors, seed, index);
    let duration_s = random.rounded(2.0, 4.0, 1e3) + motors.iter().map(last).fold(0.0, f64::max);
    let battery = Battery { emf: Volts(emf), resistance: Ohms(resistance) };
    let name = format!("survey {seed}, scenario {index}");
    // Only regulation is judged. Therefore the supply's limits never act, and the battery accepts returned energy.
    let scenario = Scenario::new(&name, duration_s, motors);
    Scenario { period, seed: index, battery, unlimited: true, ..scenario }
}

/// Gives some of the motors Coulomb friction. The random numbers are from a generator of their own, so that the rest of
/// a scenario does not depend on friction. No motor has cogging: the catalogue has no figures for it.
fn roughen(motors: &mut [Motor], seed: u64, index: u64) {
    let mut random = Random(fastrand::Rng::with_seed(fastrand::Rng::with_seed(!seed).u64(..) ^ index));
    for motor in motors {
        let (rough, percent) = (random.chance(ROUGH), random.rounded(0.0, MOST_FRICTION, 10.0));
        if rough {
            motor.set_friction(percent);
        }
    }
}

struct Random(fastrand::Rng);

impl Random {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.f64()
    }

    fn logarithmic(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    /// A number in steps of 1 / `per_unit`.
    fn rounded(&mut self, low: f64, high: f64, per_unit: f64) -> f64 {
        (self.uniform(low, high) * per_unit).round() / per_unit
    }

    fn chance(&mut self, share: f64) -> bool {
        self.0.f64() < share
    }

    fn signed(&mut self, low: f64, high: f64) -> f64 {
        let size = self.uniform(low, high);
        if self.0.bool() { size } else { -size }
    }

    fn motor(&mut self) -> (catalogue::Motor, Load) {
        let all: Vec<_> = motors().collect();
        let paper = all.get(self.0.usize(..all.len())).copied().unwrap_or_else(|| unreachable!());
        let measured = paper.with_measured_rotor_inertia();
        let bare = time_constant(&measured, &Load::NONE);
        let (motor, shortest) =
            if bare < LONGEST_TIME_CONSTANT { (measured, bare) } else { (paper, SHORTEST_LOADED) };
        // Without a load, with a few rotor inertias, or with any load.
        let wanted = match self.0.u8(..10) {
            0..3 => shortest,
            3..7 => self.uniform(1.0, 5.0) * shortest,
            _ => self.logarithmic(shortest, LONGEST_TIME_CONSTANT),
        };
        let reflected = motor.eta * motor.gear_ratio * motor.gear_ratio;
        let share = wanted.min(LONGEST_TIME_CONSTANT) / time_constant(&motor, &Load::NONE) - 1.0;
        let inertia = (share * motor.j.0 * reflected).max(0.0);
        // Drag that takes up to a fifth of the free speed.
        let electrical = motor.ke.0 * motor.kt.0 / motor.r.0;
        let drag = if self.chance(0.3) { self.uniform(0.0, 0.25) * electrical * reflected } else { 0.0 };
        (motor, Load { inertia_after: KgM2(inertia), drag_after: Drag(drag), ..Load::NONE })
    }

    fn scheme(&mut self) -> Scheme {
        match self.0.u8(..20) {
            0..9 => Scheme::A,
            9..13 => Scheme::B,
            13..15 => Scheme::C,
            15..18 => Scheme::D(Blend::Automatic),
            _ => Scheme::ForwardReverse,
        }
    }

    fn plan(&mut self, label: String, constants: catalogue::Motor, load: Load, volts: f64) -> Motor {
        let shaft = Shaft::new(&constants, &load);
        let counts = constants.counts_per_rev_motor / core::f64::consts::TAU;
        let per_volt = constants.kt.0 / constants.r.0;
        let stall = per_volt * volts / shaft.torque_ratio;
        let free = counts * per_volt * volts / (per_volt * constants.ke.0 + shaft.drag.0);
        let first = if self.chance(0.5) { 0.0 } else { self.signed(0.0, 0.3) * stall };
        let mut torques = vec![Timed { at_s: 0.0, value: first }];
        let mut setpoints = Vec::new();
        // The first set-point is at 0 s: a load would turn a motor that is not regulated yet.
        let mut at_s = 0.0;
        // Speeds alone, positions alone, or both.
        let positions = match self.0.u8(..20) {
            0..11 => 0.0,
            11..16 => 1.0,
            _ => 0.5,
        };
        let mut position = 0.0;
        for number in 0..3 + self.0.u8(..3) {
            let length = self.rounded(1.5, 4.0, 1e3);
            if number > 0 && self.chance(0.25) {
                torques.push(Timed { at_s, value: self.signed(0.05, 0.35) * stall });
            } else if self.chance(positions) {
                let away = self.signed(0.02, 0.5) * free * length;
                position += away;
                let speed_limit = CountsPerSecond::new((self.uniform(0.3, 1.2) * free) as i32);
                setpoints.push(Timed { at_s, value: crate::position(position as i32, speed_limit) });
            } else {
                let speed = self.speed(free);
                position += speed * length;
                setpoints.push(Timed { at_s, value: velocity(speed as i32) });
            }
            at_s = (1e3 * (at_s + length)).round() / 1e3;
        }
        Motor {
            label,
            scheme: self.scheme(),
            duty: if self.chance(0.15) { DutyRule::LinearDuty } else { DutyRule::LinearCurrent },
            setpoints,
            torques,
            ..Motor::new(constants, load)
        }
    }

    /// A speed in whole counts/s.
    fn speed(&mut self, free: f64) -> f64 {
        let speed = match self.0.u8(..20) {
            0..4 => {
                let side = self.signed(1.0, 1.0);
                side * self.logarithmic(5.0, 50.0)
            }
            4..6 => 0.0,
            _ => self.signed(0.1, 0.85) * free,
        };
        speed.round()
    }
}

/// A random scenario as a scenario file. Parts that random scenarios do not have are left out.
#[derive(Serialize)]
struct File<'a> {
    name: &'a str,
    duration_s: f64,
    control_period_ms: u32,
    seed: u64,
    battery: BatteryTable,
    motors: Vec<MotorTable<'a>>,
}

#[derive(Serialize)]
struct BatteryTable {
    emf_v: f64,
    resistance_ohm: f64,
    unlimited: bool,
}

#[derive(Serialize)]
struct MotorTable<'a> {
    label: &'a str,
    motor: &'a str,
    inertia: &'static str,
    #[serde(flatten)]
    scheme: SchemeWords,
    friction: Option<FrictionTable>,
    duty: Option<&'static str>,
    configured: Configuration,
    load: LoadTable,
    setpoints: Vec<SetpointTable>,
    torques: Vec<TorqueTable>,
}

#[derive(Serialize)]
struct FrictionTable {
    coulomb_percent: f64,
}

#[derive(Serialize)]
struct LoadTable {
    inertia_kg_m2: f64,
    drag_nms_per_rad: f64,
    torque_nm: f64,
}

#[derive(Serialize)]
struct TorqueTable {
    at_s: f64,
    torque_nm: f64,
}

#[derive(Serialize)]
#[serde(untagged)]
enum SetpointTable {
    Velocity { at_s: f64, velocity_cps: i32 },
    Position { at_s: f64, position_counts: i32, tolerance_counts: u16, speed_limit_cps: i32 },
    Disabled { at_s: f64, disable: bool },
}

/// A random scenario in TOML.
pub fn toml(scenario: &Scenario) -> String {
    let Scenario { name, duration_s, period, seed, battery, motors, unlimited, .. } = scenario;
    let file = File {
        name,
        duration_s: *duration_s,
        control_period_ms: period.as_millis(),
        seed: *seed,
        battery: BatteryTable {
            emf_v: battery.emf.0,
            resistance_ohm: battery.resistance.0,
            unlimited: *unlimited,
        },
        motors: motors.iter().map(table).collect(),
    };
    // TOML has a form for every value of the file.
    toml::to_string(&file).unwrap_or_default()
}

fn table(motor: &Motor) -> MotorTable<'_> {
    let Motor { label, constants, load, .. } = motor;
    let coulomb_percent = friction_percent(motor);
    let torques = motor.torques.iter().filter(|timed| timed.at_s > 0.0);
    MotorTable {
        label,
        motor: constants.name,
        inertia: if constants.j == constants.j_rotor_measured { "rotor" } else { "paper" },
        scheme: SchemeWords(motor.scheme),
        friction: (coulomb_percent > 0.0).then_some(FrictionTable { coulomb_percent }),
        duty: (motor.duty == DutyRule::LinearDuty).then_some("linear-duty"),
        configured: motor.configuration,
        load: LoadTable {
            inertia_kg_m2: load.inertia_after.0,
            drag_nms_per_rad: load.drag_after.0,
            torque_nm: motor.torque_at(0.0),
        },
        setpoints: motor.setpoints.iter().map(setpoint).collect(),
        torques: torques.map(|timed| TorqueTable { at_s: timed.at_s, torque_nm: timed.value }).collect(),
    }
}

fn setpoint(&Timed { at_s, value }: &Timed<Setpoint>) -> SetpointTable {
    match value {
        Setpoint::Velocity(speed) => SetpointTable::Velocity { at_s, velocity_cps: speed.round() },
        Setpoint::Position { target, tolerance, speed_limit } => SetpointTable::Position {
            at_s,
            position_counts: target,
            tolerance_counts: tolerance,
            speed_limit_cps: speed_limit.round(),
        },
        _ => SetpointTable::Disabled { at_s, disable: true },
    }
}
