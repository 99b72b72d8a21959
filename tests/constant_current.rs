//! A constant current as a set-point, and a limit of the current.

mod common;

use common::{BATTERY, BRIDGE, Bench, free_cps, inertia, plant, unknown, velocity};
use motor_hub::model::catalogue::{self, Motor};
use motor_hub::motor::{Report, Setpoint, Settings};
use motor_hub::units::{CountsPerSecond, Milliamperes};
use std::num::NonZeroU16;

/// A motor with a flywheel of this inertia in kg m², which turns at a share of the free speed.
fn bench(motor: Motor, kg_m2: f64, share: f64, limit_ma: Option<u16>, period_ms: u32) -> Bench<1> {
    let settings = Settings { current_limit: limit_ma.and_then(NonZeroU16::new), ..unknown(&motor) };
    let mut bench = Bench::one(settings, plant(motor, inertia(kg_m2)), period_ms);
    bench.place(0, 0.5, share * free_cps(&motor));
    bench
}

fn stall_current(motor: &Motor) -> f64 {
    BATTERY / (motor.r.0 + 2e-3 * f64::from(BRIDGE.switch_mohm()))
}

fn current(amperes: f64, speed_limit: f64) -> Setpoint {
    Setpoint::Current {
        current: Milliamperes::new((1e3 * amperes) as i32),
        speed_limit: CountsPerSecond::new(speed_limit as i32),
    }
}

/// Inertia in kg m² of a flywheel that is so heavy that the speed does not change.
const HEAVY: f64 = 1e3;

/// Every motor of the catalogue that is characterised, with the inertia of the paper.
fn motors() -> impl Iterator<Item = (&'static str, Motor)> {
    catalogue::catalogue().iter().filter_map(|entry| Some((entry.name, entry.motor?)))
}

fn neverest_60() -> Motor {
    motors().find(|(name, _)| *name == "NeveRest 60").expect("in the catalogue").1
}

#[test]
fn every_motor_has_the_current_of_its_set_point_in_all_regimes_and_at_every_speed() {
    let mut worst = (0.0f64, String::new());
    for (name, motor) in motors() {
        let (stall, free) = (stall_current(&motor), free_cps(&motor));
        for speed in [-0.8, -0.5, -0.2, 0.0, 0.2, 0.5, 0.8] {
            for share in [-0.6, -0.3, -0.1, 0.05, 0.1, 0.3, 0.6] {
                // The battery cannot drive more current than this at this speed.
                let most = 1.0 - speed * f64::signum(share);
                if f64::abs(share) > 0.95 * most {
                    continue;
                }
                let mut bench = bench(motor, HEAVY, speed, None, 10);
                bench.run_ms(200);
                bench.set(0, current(share * stall, 3.0 * free));
                bench.run_ms(500);
                let [amperes] = bench.run_ms(100);
                let error = (amperes - share * stall) / stall;
                if error.abs() > worst.0 {
                    worst = (error.abs(), format!("{name} at {speed} of its speed, {share}: {error:.4}"));
                }
            }
        }
    }
    println!("largest error {:.2} % of the stall current: {}", 100.0 * worst.0, worst.1);
    assert!(worst.0 < 0.025, "{}", worst.1);
}

#[test]
fn a_motor_with_a_constant_current_becomes_no_faster_than_its_limit() {
    let motor = neverest_60();
    let limit = 0.4 * free_cps(&motor);
    for side in [1.0, -1.0] {
        let mut bench = bench(motor, 0.02, 0.0, None, 10);
        bench.run_ms(50);
        bench.set(0, current(side * 0.5 * stall_current(&motor), limit));
        let mut fastest = 0.0f64;
        for _ in 0..2_000 {
            bench.run_ms(1);
            fastest = fastest.max(side * bench.speed(0));
        }
        assert!(fastest < 1.1 * limit, "{fastest} of {limit}");
        assert!((side * bench.speed(0) / limit - 1.0).abs() < 0.02, "{} of {limit}", bench.speed(0));
    }
}

#[test]
fn a_stalled_motor_keeps_its_current_limit_and_says_so() {
    for (name, motor) in motors().filter(|(_, motor)| BATTERY / motor.r.0 > 1.2) {
        for period in [1, 10, 50] {
            let mut bench = bench(motor, HEAVY, 0.0, Some(800), period);
            bench.run_ms(50);
            bench.set(0, velocity((0.5 * free_cps(&motor)) as i32));
            bench.run_ms(500);
            let [amperes] = bench.run_ms(200);
            assert!((amperes - 0.8).abs() < 0.05, "{name}, {period} ms: {amperes} A {:?}", bench.report());
            let Report { current_limited, stalled, faults, .. } = bench.report();
            assert!(
                *current_limited && *stalled && !faults.any(),
                "{name}, {period} ms: {:?}",
                bench.report()
            );
        }
    }
}

#[test]
fn the_current_limit_holds_while_a_motor_reverses() {
    let motor = neverest_60();
    let mut bench = bench(motor, 0.03, 0.0, Some(900), 10);
    bench.run_ms(50);
    for speed in [0.6, -0.6, 0.6, 0.0] {
        let target = (speed * free_cps(&motor)) as i32;
        bench.set(0, velocity(target));
        for _ in 0..150 {
            let [amperes] = bench.run_ms(10);
            assert!(amperes.abs() < 1.0, "{amperes} A at {} counts/s", bench.speed(0));
        }
        assert!((bench.speed(0) - f64::from(target)).abs() < 20.0, "{}", bench.speed(0));
    }
}
