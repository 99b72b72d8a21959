//! A constant current as a set-point, and a limit of the current.

mod common;

use common::{BATTERY, BRIDGE, Bench, configured, free_cps, inertia, plant, position, unknown, velocity};
use motor_hub::braking::Scheme;
use motor_hub::bridge::BridgeConstants;
use motor_hub::model::catalogue::{self, Motor};
use motor_hub::model::si::Volts;
use motor_hub::motion::Pidf;
use motor_hub::motor::{Report, Setpoint, Settings};
use motor_hub::regulator::Coefficients;
use motor_hub::units::{Coefficient, Control, CountsPerSecond, Milliamperes, Share};
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
        let fastest = bench.highest(2_000, |bench| side * bench.speed(0));
        assert!(fastest < 1.1 * limit, "{fastest} of {limit}");
        assert!((side * bench.speed(0) / limit - 1.0).abs() < 0.02, "{} of {limit}", bench.speed(0));
    }
}

#[test]
fn an_unknown_light_motor_at_the_speed_limit_of_its_current_does_not_swing() {
    for (name, period_ms) in [("AM 20 A", 50), ("AM 20 B", 10), ("AM 20 B", 50)] {
        let motor = common::motor(name);
        let limit = 0.3 * free_cps(&motor);
        let mut bench = Bench::one(unknown(&motor), plant(motor, inertia(0.0)), period_ms);
        bench.set(0, current(0.1 * stall_current(&motor), limit));
        bench.run_ms(3_000);
        let farthest = bench.highest(2_000, |bench| (bench.speed(0) - limit).abs()) / limit;
        assert!(farthest < 0.02, "{name}, {period_ms} ms: {:.1} % off", 100.0 * farthest);
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
fn a_motor_that_must_brake_brakes_with_its_current_limit_in_every_scheme() {
    let motor = neverest_60();
    for scheme in [Scheme::A, Scheme::B, Scheme::C, Scheme::ForwardReverse] {
        let settings = Settings { scheme, current_limit: NonZeroU16::new(800), ..unknown(&motor) };
        let mut bench = Bench::one(settings, plant(motor, inertia(HEAVY)), 10);
        bench.place(0, 0.5, 0.4 * free_cps(&motor));
        bench.set(0, Setpoint::ConstantPower(Control::ZERO));
        bench.run_ms(200);
        let [amperes] = bench.run_ms(200);
        assert!((amperes + 0.8).abs() < 0.05, "{scheme:?}: {amperes} A {:?}", bench.report());
    }
}

/// A motor whose speed does not change, on a supply of 15 V that cannot take the energy of braking motors.
fn dissipating(emf_volts: f64, limit_ma: Option<u16>, period_ms: u32) -> Bench<1> {
    let mut bench = bench(neverest_60(), HEAVY, emf_volts / BATTERY, limit_ma, period_ms);
    bench.rig.battery.emf = Volts(15.0);
    bench.supply = (Share::ALL, Share::ALL);
    bench
}

#[test]
fn the_current_limit_holds_while_a_braking_motor_dissipates_its_energy() {
    for emf_volts in [4.0, 10.0] {
        let mut bench = dissipating(emf_volts, Some(800), 10);
        bench.set(0, current(-0.4, 2.0 * free_cps(&neverest_60())));
        bench.run_ms(1_000);
        let (mut pulses, mut charge) = (0, 0.0);
        for _ in 0..1_000 {
            let before = bench.report().drive;
            let [amperes] = bench.run_ms(1);
            assert!(amperes.abs() < 0.9, "{emf_volts} V: {amperes} A, {:?}", bench.report());
            pulses += u32::from(bench.report().drive != before);
            charge += 1e-3 * amperes;
        }
        assert!(pulses > 50 && (charge + 0.4).abs() < 0.05, "{emf_volts} V: {pulses} pulses, {charge} A");
    }
}

#[test]
fn a_motor_that_must_stay_in_its_short_circuit_reports_the_current_of_the_short_circuit() {
    for period_ms in [1, 10, 50] {
        let motor = neverest_60();
        let mut bench = dissipating(10.0, None, period_ms);
        bench.set(0, current(-0.6, 2.0 * free_cps(&motor)));
        // In the second second the supply permits no driving.
        for (draw, expected) in [(Share::ALL, -0.6), (Share::NONE, -10.0 / BATTERY * stall_current(&motor))] {
            bench.supply.0 = draw;
            bench.run_ms(500);
            let mut charge = 0.0;
            for _ in 0..500 {
                let [amperes] = bench.run_ms(1);
                charge += 1e-3 * amperes;
                let reported = f64::from(bench.report().current.to_amperes());
                assert!((reported - expected).abs() < 0.05, "{period_ms} ms: {reported} A reported");
            }
            let mean = charge / 0.5;
            assert!((mean - expected).abs() < 0.05, "{period_ms} ms: {mean} A");
        }
    }
}

#[test]
fn a_position_behind_a_current_limit_is_reached_without_overshoot() {
    let (motor, load) = (neverest_60(), inertia(0.03));
    // An unknown motor first has to learn how slowly it brakes.
    for (settings, most) in [(configured(&motor, &load), 3.0), (unknown(&motor), 100.0)] {
        for (period_ms, limit_ma) in
            [10, 50].into_iter().flat_map(|ms| [400, 600, 900, 1_500, 3_000].map(|limit| (ms, limit)))
        {
            let settings = Settings { current_limit: NonZeroU16::new(limit_ma), ..settings };
            let mut bench = Bench::one(settings, plant(motor, load), period_ms);
            bench.set(0, position(2_000, 5, 2_500));
            let beyond = bench.highest(6_000, |bench| bench.counts(0)) - 2_000.5;
            assert!(
                beyond < most && bench.report().settled,
                "{period_ms} ms, {limit_ma} mA: {beyond:.0} counts"
            );
        }
    }
}

#[test]
fn pid_behind_a_current_limit_overshoots_no_more_than_without_a_limit() {
    let motor = neverest_60();
    for feed_forward in [0, 11] {
        let [p, i, f] = [4, 1, feed_forward].map(|whole| Coefficient::from_bits(whole << 16));
        let fastest = |limit_ma| {
            let mut bench = bench(motor, 0.01, 0.0, limit_ma, 10);
            let velocity_loop = Pidf { p, i, f, ..Pidf::default() };
            let coefficients = Coefficients { velocity: velocity_loop, position: Pidf::default() };
            bench.configure(0, |settings| settings.coefficients = Some(coefficients));
            bench.set(0, velocity(2_000));
            bench.highest(3_000, |bench| bench.speed(0))
        };
        let free = fastest(None);
        for limit_ma in [500, 800, 1_200] {
            let limited = fastest(Some(limit_ma));
            assert!(
                limited > 1_950.0 && limited < free.max(2_000.0) + 20.0,
                "F {feed_forward}, {limit_ma} mA: {limited} counts/s, {free} without a limit"
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

/// A VNH5019 permits no duty between 0.88 and 1.
#[test]
fn the_current_limit_holds_with_a_bridge_that_does_not_permit_every_duty() {
    let (motor, load) = (neverest_60(), inertia(0.2));
    let bridge = BridgeConstants::VNH5019;
    let settings = Settings { bridge, current_limit: NonZeroU16::new(800), ..configured(&motor, &load) };
    for period_ms in [10, 50] {
        let mut bench = Bench::one(settings, plant(motor, load), period_ms);
        for setpoint in [Setpoint::ConstantPower(Control::MAX), velocity(0)] {
            bench.set(0, setpoint);
            bench.tick();
            let mut limited_ms = 0;
            for _ in 0..5_000 {
                let [amperes] = bench.run_ms(1);
                limited_ms += u32::from(bench.report().current_limited);
                assert!(amperes.abs() < 0.85, "{period_ms} ms: {amperes} A {:?}", bench.report());
            }
            assert!(limited_ms > 2_000, "{period_ms} ms: {limited_ms} ms");
        }
    }
}

#[test]
fn a_motor_at_its_current_limit_is_stalled_no_earlier_than_100_ms_after_its_start() {
    let (motor, load) = (neverest_60(), inertia(0.5));
    for period_ms in [1, 10, 50, 100] {
        let settings = Settings { current_limit: NonZeroU16::new(500), ..configured(&motor, &load) };
        let mut bench = Bench::one(settings, plant(motor, load), period_ms);
        bench.run_ms(1_000);
        bench.set(0, velocity(400));
        let stalled_ms = bench.wait_until(2_000, |bench| bench.report().stalled);
        assert!(stalled_ms.is_none_or(|ms| ms > 100), "{period_ms} ms: {stalled_ms:?}");
    }
}
