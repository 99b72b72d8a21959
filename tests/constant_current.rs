//! A constant current as a set-point, and a limit of the current.

use motor_hub::braking::Winding;
use motor_hub::bridge::BridgeConstants;
use motor_hub::model::catalogue::{self, Motor as Constants};
use motor_hub::model::load::Load;
use motor_hub::model::plant::{Plant, PlantInput};
use motor_hub::model::si::{Hertz, KgM2, RadPerSec, Seconds, Volts};
use motor_hub::model::switching::Bridge;
use motor_hub::motion::Tracker;
use motor_hub::motor::{Motor, Report, Setpoint, Settings};
use motor_hub::units::{
    CountsPerSecond, EmfConstant, Inductance, Micros, Milliamperes, Millivolts, Period, Resistance,
};
use std::f64::consts::TAU;
use std::num::NonZeroU16;

const BATTERY: f64 = 12.0;
const BRIDGE: BridgeConstants = BridgeConstants::IDEAL;

/// A motor of the catalogue on a hub of its own, with a flywheel.
struct Bench {
    motor: Motor,
    plant: Plant,
    constants: Constants,
    tracker: Tracker,
    period: Period,
    ms: u64,
    report: Report,
}

impl Bench {
    /// With this inertia behind the gear in kg m², at this share of the free speed.
    fn new(constants: Constants, inertia: f64, share: f64, limit_ma: Option<u16>, period_ms: u32) -> Self {
        let winding = Winding {
            emf: EmfConstant::from_ke(constants.ke.0, constants.counts_per_rev_motor).expect("in range"),
            resistance: Resistance::from_ohms(constants.r.0).expect("in range"),
            inductance: Some(Inductance::from_millihenries(1e3 * constants.l.0).expect("in range")),
        };
        let settings =
            Settings { current_limit: limit_ma.and_then(NonZeroU16::new), ..Settings::new(winding) };
        let load = Load { inertia_after: KgM2(inertia), ..Load::NONE };
        let mut plant = Plant::new(constants, load, Bridge::new(BRIDGE), Hertz(20_000.0));
        plant.place(plant.current(), RadPerSec(share * BATTERY / constants.ke.0), 0.0);
        let period = Period::from_millis(period_ms).expect("in range");
        let motor = Motor::new(settings, period);
        let tracker = Tracker::default();
        Self { motor, plant, constants, tracker, period, ms: 0, report: Report::INITIAL }
    }

    /// The mean current of the winding in the next milliseconds, in A.
    fn run_ms(&mut self, ms: u64) -> f64 {
        let mut charge = 0.0;
        for _ in 0..ms {
            let now = Micros::new(1_000 * self.ms);
            let reading = self.tracker.step(self.plant.counts() as u16, now);
            self.motor.sample(reading);
            if self.ms.is_multiple_of(self.period.as_millis().into()) {
                let battery = Some(Millivolts::new((1e3 * BATTERY) as u16));
                self.report = self.motor.step(now, Some(reading), battery);
            }
            let drive = self.report.drive;
            let flow = self.plant.run(
                Seconds(1e-3),
                PlantInput::pwm(drive.mode, drive.duty.to_f64()),
                Volts(BATTERY),
            );
            charge += flow.charge.0;
            self.ms += 1;
        }
        1e3 * charge / ms as f64
    }

    fn stall_current(&self) -> f64 {
        BATTERY / (self.constants.r.0 + 2e-3 * f64::from(BRIDGE.switch_mohm()))
    }

    fn free_speed_cps(&self) -> f64 {
        BATTERY / self.constants.ke.0 * self.constants.counts_per_rev_motor / TAU
    }

    fn speed_cps(&self) -> f64 {
        self.plant.speed().0 * self.constants.counts_per_rev_motor / TAU
    }

    fn hold_stopped(&mut self, ms: u64) -> f64 {
        let mut sum = 0.0;
        for _ in 0..ms {
            self.plant.place(self.plant.current(), RadPerSec(0.0), 0.0);
            sum += self.run_ms(1);
        }
        sum / ms as f64
    }
}

fn current(amperes: f64, speed_limit: f64) -> Setpoint {
    Setpoint::Current {
        current: Milliamperes::new((1e3 * amperes) as i32),
        speed_limit: CountsPerSecond::new(speed_limit as i32),
    }
}

fn motors() -> impl Iterator<Item = (&'static str, Constants)> {
    catalogue::catalogue().iter().filter_map(|entry| Some((entry.name, entry.motor?)))
}

#[test]
fn every_motor_has_the_current_of_its_set_point_in_all_regimes_and_at_every_speed() {
    let mut worst = (0.0f64, String::new());
    let mut measured = 0;
    for (name, constants) in motors() {
        for speed in [-0.8, -0.5, -0.2, 0.0, 0.2, 0.5, 0.8] {
            for share in [-0.6, -0.3, -0.1, 0.05, 0.1, 0.3, 0.6] {
                // The flywheel is so heavy that the speed stays.
                let mut bench = Bench::new(constants, 1e3, speed, None, 10);
                let (stall, free) = (bench.stall_current(), bench.free_speed_cps());
                // The battery cannot drive more current than this at this speed.
                let most = 1.0 - speed * f64::signum(share);
                if f64::abs(share) > 0.95 * most {
                    continue;
                }
                bench.run_ms(200);
                bench.motor.set(current(share * stall, 3.0 * free));
                bench.run_ms(500);
                let error = (bench.run_ms(100) - share * stall) / stall;
                measured += 1;
                if error.abs() > worst.0 {
                    worst = (error.abs(), format!("{name} at {speed} of its speed, {share}: {error:.4}"));
                }
            }
        }
    }
    println!("{measured} currents, largest error {:.2} % of the stall current: {}", 100.0 * worst.0, worst.1);
    assert!(worst.0 < 0.025, "{}", worst.1);
}

#[test]
fn a_motor_with_a_constant_current_becomes_no_faster_than_its_limit() {
    let (_, constants) = motors().find(|(name, _)| *name == "NeveRest 60").expect("in the catalogue");
    for side in [1.0, -1.0] {
        let mut bench = Bench::new(constants, 0.02, 0.0, None, 10);
        bench.run_ms(50);
        let limit = 0.4 * bench.free_speed_cps();
        bench.motor.set(current(side * 0.5 * bench.stall_current(), limit));
        let mut fastest = 0.0f64;
        for _ in 0..2_000 {
            bench.run_ms(1);
            fastest = fastest.max(side * bench.speed_cps());
        }
        assert!(fastest < 1.1 * limit, "{fastest} of {limit}");
        assert!((side * bench.speed_cps() / limit - 1.0).abs() < 0.02, "{} of {limit}", bench.speed_cps());
    }
}

#[test]
fn a_stalled_motor_keeps_its_current_limit_and_says_so() {
    let strong = |constants: &Constants| BATTERY / constants.r.0 > 1.2;
    for (name, constants) in motors().filter(|(_, constants)| strong(constants)) {
        for period in [1, 10, 50] {
            let mut bench = Bench::new(constants, 0.01, 0.0, Some(800), period);
            bench.run_ms(50);
            let speed = CountsPerSecond::new((0.5 * bench.free_speed_cps()) as i32);
            bench.motor.set(Setpoint::Velocity(speed));
            bench.hold_stopped(500);
            let amperes = bench.hold_stopped(200);
            assert!((amperes - 0.8).abs() < 0.05, "{name}, {period} ms: {amperes} A {:?}", bench.report);
            let Report { current_limited, stalled, faults, .. } = bench.report;
            assert!(current_limited && stalled && !faults.any(), "{name}, {period} ms: {:?}", bench.report);
        }
    }
}

#[test]
fn the_current_limit_holds_while_a_motor_reverses() {
    let (_, constants) = motors().find(|(name, _)| *name == "NeveRest 60").expect("in the catalogue");
    let mut bench = Bench::new(constants, 0.03, 0.0, Some(900), 10);
    bench.run_ms(50);
    for speed in [0.6, -0.6, 0.6, 0.0] {
        let target = (speed * bench.free_speed_cps()) as i32;
        bench.motor.set(Setpoint::Velocity(CountsPerSecond::new(target)));
        for _ in 0..150 {
            let amperes = bench.run_ms(10);
            assert!(amperes.abs() < 1.0, "{amperes} A at {} counts/s", bench.speed_cps());
        }
        assert!((bench.speed_cps() - f64::from(target)).abs() < 20.0, "{}", bench.speed_cps());
    }
}
