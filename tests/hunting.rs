//! A motor that has become hot since it was configured keeps its speed. If the speed hunts, the regulator finds that
//! the configured back EMF is too high. The constants of a motor with a thermal limit follow its computed temperature.

mod common;

use common::{
    BATTERY, Bench, ScriptedMotor, configured, dynamics, free_cps, inertia, motor, plant, velocity,
};
use motor_hub::braking::Scheme;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::load::Load;
use motor_hub::model::plant::Temperatures;
use motor_hub::model::si::{EmfConstant, Ohms, TorqueConstant};
use motor_hub::motor::{Setpoint, Settings, ThermalLimit};
use motor_hub::units::{Control, Period};

/// The motor after minutes of work: copper 62 K warmer, magnets weaker by a tenth.
fn hot(motor: &Motor) -> Motor {
    Motor {
        r: Ohms(1.24 * motor.r.0),
        ke: EmfConstant(0.9 * motor.ke.0),
        kt: TorqueConstant(0.9 * motor.kt.0),
        ..*motor
    }
}

/// Rms error of the true speed over two seconds, in % of the set-point.
fn rms_percent(bench: &mut Bench<1>, cps: i32) -> f64 {
    let mut sum = 0.0;
    for _ in 0..2_000 {
        bench.run_ms(1);
        sum += (bench.speed(0) - f64::from(cps)).powi(2);
    }
    100.0 * (sum / 2_000.0).sqrt() / f64::from(cps.abs())
}

#[test]
fn a_hot_motor_keeps_its_speed_within_1_percent() {
    for (name, load) in [
        ("AM 60 A", inertia(0.05)),
        ("AM 60 A", Load::NONE),
        ("AM 20 A", Load::NONE),
        ("AM 40 C", Load::NONE),
        ("AM 3.7 B", Load::NONE),
    ] {
        let cold = motor(name);
        let settings = configured(&cold, &load);
        for period in [10, 50, 100] {
            for scheme in [Scheme::A, Scheme::ForwardReverse] {
                // At a period of 100 ms the speed of a slow motor varies, also if the motor is configured exactly.
                let shares: &[f64] = if period == 100 { &[0.5, -0.44] } else { &[0.5, 0.16, -0.44] };
                for share in shares {
                    let settings = Settings { scheme, ..settings };
                    let mut bench = Bench::one(settings, plant(hot(&cold), load), period);
                    let cps = (share * free_cps(&cold)) as i32;
                    bench.set(0, velocity(cps));
                    bench.run_ms(6_000);
                    let rms = rms_percent(&mut bench, cps);
                    assert!(rms <= 1.0, "{name} {load:?} {period} ms {scheme:?} {cps}: {rms:.1} %");
                }
            }
        }
    }
}

#[test]
fn the_back_emf_constant_in_force_is_reported() {
    let cold = motor("AM 60 A");
    let load = inertia(0.05);
    let settings = configured(&cold, &load);
    let after_6_s = |motor: Motor| {
        let mut bench = Bench::one(settings, plant(motor, load), 50);
        bench.set(0, velocity(free_cps(&cold) as i32 / 2));
        bench.run_ms(6_000);
        bench.snapshot.motors[0].emf_constant.expect("a tick").to_volts() / settings.winding.emf.to_volts()
    };
    assert_eq!(after_6_s(cold), 1.0);
    let share = after_6_s(hot(&cold));
    assert!((0.85..0.99).contains(&share), "{share} of the configured constant");
}

/// Temperatures of a real motor, which need not be those that the hub computes: a winding on a case, in steps of 1 ms.
struct Heat {
    /// Continuous current in A, at which the winding becomes `rise_k` warmer.
    continuous: f64,
    rise_k: f64,
    winding: f64,
    case: f64,
}

/// Time constants of winding and case in s. They are shorter than those of a real motor, so that the test is short.
const WINDING_S: f64 = 5.0;
const CASE_S: f64 = 10.0;

impl Heat {
    fn step(&mut self, amperes: f64) -> Temperatures {
        let square = (amperes / self.continuous).powi(2);
        self.winding += (square - self.winding) * 1e-3 / WINDING_S;
        self.case += (square - self.case) * 1e-3 / CASE_S;
        let magnets_k = 0.75 * self.rise_k * self.case;
        Temperatures { winding_k: magnets_k + 0.25 * self.rise_k * self.winding, magnets_k }
    }
}

/// Drives a motor with a torque until it is hot, takes the torque away, and demands three speeds one after the other.
/// Returns the largest error of each speed in %, from 0.6 s on. With `limited` the hub has a thermal limit.
fn worked(name: &str, load: Load, limited: bool, rise_k: f64) -> [f64; 3] {
    let cold = motor(name);
    let continuous = BATTERY / cold.r.0 / 3.0;
    let mut settings = configured(&cold, &load);
    if limited {
        let ma = (1e3 * continuous) as u16;
        settings.thermal = ThermalLimit::new(ma, WINDING_S as u16, CASE_S as u16).ok();
    }
    let mut bench = Bench::one(settings, plant(cold, load), 50);
    let mut heat = Heat { continuous, rise_k, winding: 0.0, case: 0.0 };
    let mut step = |bench: &mut Bench<1>| {
        let [amperes] = bench.run_ms(1);
        bench.rig.plants[0].set_temperatures(heat.step(amperes));
    };
    let free = free_cps(&cold);
    bench.set(0, velocity((0.4 * free) as i32));
    (0..2_000).for_each(|_| step(&mut bench));
    // This torque takes 0.6 times the continuous current.
    bench.axes[0].torque = -0.6 * continuous * cold.kt.0 * cold.gear_ratio * cold.eta;
    (0..20_000).for_each(|_| step(&mut bench));
    bench.axes[0].torque = 0.0;
    [0.4, 0.5, 0.25].map(|share| {
        let cps = (share * free) as i32;
        bench.set(0, velocity(cps));
        (0..600).for_each(|_| step(&mut bench));
        let mut worst: f64 = 0.0;
        for _ in 0..1_000 {
            step(&mut bench);
            worst = worst.max((bench.speed(0) - f64::from(cps)).abs());
        }
        100.0 * worst / f64::from(cps)
    })
}

#[test]
fn a_motor_with_a_thermal_limit_keeps_its_speed_better_when_it_has_become_hot() {
    let (mut with, mut without) = (0.0, 0.0);
    for (name, load) in [("AM 60 A", inertia(0.05)), ("AM 20 A", Load::NONE), ("AM 40 C", Load::NONE)] {
        // The hub assumes that the winding becomes 100 K warmer at the continuous current. Real motors differ.
        for rise_k in [60.0, 100.0, 130.0] {
            let [limited, not_limited] = [true, false].map(|limited| worked(name, load, limited, rise_k));
            with += limited.iter().sum::<f64>();
            without += not_limited.iter().sum::<f64>();
            assert!(
                limited.iter().all(|percent| *percent <= 1.5),
                "{name}, {rise_k} K: {limited:.1?} %, without a limit {not_limited:.1?} %"
            );
        }
    }
    assert!(with < 0.6 * without, "errors of {with:.1} % in all, without thermal limits {without:.1} %");
}

#[test]
fn dynamics_that_replace_those_of_a_hot_motor_together_with_its_thermal_limit_are_used_as_configured() {
    let cold = motor("AM 60 A");
    let limited = Settings { thermal: ThermalLimit::new(1_000, 1, 1).ok(), ..configured(&cold, &Load::NONE) };
    let mut hot = ScriptedMotor::new(limited, Period::DEFAULT);
    hot.set(Setpoint::ConstantPower(Control::MAX));
    let step = |motor: &mut ScriptedMotor| {
        motor.sample(50, 0);
        motor.step(Some(12_000));
    };
    (0..20).for_each(|_| step(&mut hot));
    assert_ne!(hot.settings().dynamics, limited.dynamics);
    let unlimited = Settings { thermal: None, dynamics: Some(dynamics(&cold, &inertia(0.05))), ..limited };
    hot.configure(unlimited);
    step(&mut hot);
    assert_eq!(*hot.settings(), unlimited);
}
