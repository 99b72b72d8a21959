//! A drive base whose wheels slip in turns, with and without a gyro, on simulated plants.

use crate::common::{self, configured, motor};
use crate::{BASE, WHEEL, by, usual};
use motor_hub::group::{BaseSettings, Course, DriveBase, GyroState};
use motor_hub::hub::{BaseState, Command, GyroReading, Hub};
use motor_hub::motion::Reading;
use motor_hub::units::{Micros, Period, RangeError};

/// Part of each turn that the wheels lose.
const SLIP: f64 = 0.05;
/// Angle in degrees by which the base turns when its wheels move by one count in opposite directions.
const COUNT_DEGREES: f64 = 0.065;

/// A base on the ground, its gyro, and a third motor.
struct Robot {
    bench: common::Bench<3>,
    gyro_works: bool,
    /// Degrees that the gyro measures while the base turns left by 1 degree: -1 for a gyro that is mounted upside down.
    gyro_gain: f64,
    /// Angle in degrees by which the floor has turned the base to the left, while its wheels slid.
    pushed_degrees: f64,
}

impl Robot {
    fn new(use_gyro: bool, period_ms: u32) -> Self {
        let motor = motor("NeveRest 60");
        let settings = [configured(&motor, &WHEEL); 3];
        let bench = common::Bench::new(settings, [0, 1, 2].map(|_| common::plant(motor, WHEEL)), period_ms);
        let mut robot = Self { bench, gyro_works: true, gyro_gain: 1.0, pushed_degrees: 0.0 };
        robot.configure(BaseSettings::new([0, 1], &BASE, use_gyro).expect("in range")).expect("both wheels");
        robot.run_ms(200);
        robot
    }

    fn configure(&mut self, base: BaseSettings) -> Result<(), RangeError> {
        self.bench.hub.apply(Command::SetBase(Some(base)))
    }

    /// True angle by which the base has turned left, in degrees.
    fn heading(&self) -> f64 {
        let [left, right] = [0, 1].map(|wheel| self.bench.counts(wheel) - 0.5);
        (1.0 - SLIP) * BASE.heading([left as i32, right as i32])
    }

    /// Lets time pass. The gyro is read every 10 ms.
    fn run_ms(&mut self, ms: u64) {
        for _ in 0..ms {
            if !self.gyro_works {
                self.bench.hub.set_gyro_reading(None);
            } else if self.bench.ms.is_multiple_of(10) {
                let left_degrees = self.gyro_gain * self.heading() + self.pushed_degrees + 123.0;
                let left_degrees = left_degrees.rem_euclid(360.0) as f32;
                let at = Micros::new(1_000 * self.bench.ms);
                self.bench.hub.set_gyro_reading(Some(GyroReading { left_degrees, at }));
            }
            self.bench.run_ms(1);
        }
    }

    /// Begins to turn by this angle from the present reference.
    fn begin_turn(&mut self, degrees: f64) {
        self.bench.move_group(usual(by(BASE.turn(degrees).expect("in range")), 1_500, 5_000));
    }

    /// Turns by this angle, and waits until the base has settled.
    fn turn(&mut self, degrees: f64) {
        self.begin_turn(degrees);
        self.run_ms(50);
        for _ in 0..50 {
            self.run_ms(100);
            if self.bench.snapshot.motors[0].settled {
                return;
            }
        }
        panic!("never settled: {:?}", self.bench.snapshot);
    }

    fn state(&self) -> BaseState {
        self.bench.snapshot.base.expect("configured")
    }
}

#[test]
fn a_base_turns_by_the_angle_of_its_gyro_although_its_wheels_slip() {
    for period_ms in [1, 10, 50, 100] {
        let mut robot = Robot::new(true, period_ms);
        assert_eq!(robot.state().gyro, GyroState::Good);
        for turns in 1..=4 {
            robot.turn(90.0);
            let heading = robot.heading();
            // The tolerance is five counts at each wheel.
            assert!((heading - 90.0 * f64::from(turns)).abs() < 5.0 * COUNT_DEGREES, "{period_ms} {heading}");
        }
        // The state is that of the last tick, so the two headings are compared at rest.
        robot.run_ms(1_000);
        let state = robot.state();
        assert!((f64::from(state.heading_millidegrees) - 1e3 * robot.heading()).abs() < 100.0, "{state:?}");
        // The wheels have turned by 1/0.95 of the angle.
        let slip = BASE.turn(360.0 / (1.0 - SLIP) - 360.0).expect("in range");
        assert!(state.correction[1].abs_diff(slip[1]) < 10, "{state:?} {slip:?}");
    }
}

#[test]
fn a_wheel_whose_other_wheel_leaves_the_group_stops_within_its_braking_distance() {
    let mut robot = Robot::new(true, 10);
    (0..4).for_each(|_| robot.turn(90.0));
    robot.begin_turn(90.0);
    robot.run_ms(400);
    let [position, velocity] = [robot.bench.counts(1), robot.bench.snapshot.motors[1].velocity.to_f64()];
    robot.bench.set(0, common::velocity(0));
    robot.run_ms(1_000);
    let (travel, expected) = (robot.bench.counts(1) - position, velocity * velocity / (2.0 * 5_000.0));
    assert!((travel - expected).abs() < 50.0, "{travel} counts, expected {expected}");
}

#[test]
fn wheels_that_a_larger_group_has_left_over_turn_by_the_gyro() {
    let mut robot = Robot::new(true, 10);
    robot.bench.move_group(usual(by([100; 3]), 1_500, 5_000));
    robot.run_ms(1_000);
    robot.bench.set(2, common::velocity(0));
    robot.run_ms(100);
    robot.turn(90.0);
    assert!((robot.heading() - 90.0).abs() < 5.0 * COUNT_DEGREES, "{}", robot.heading());
}

#[test]
fn a_wheel_that_is_left_over_goes_to_positions_of_its_encoder() {
    const TARGET: i32 = 2_000;
    let mut robot = Robot::new(true, 10);
    (0..2).for_each(|_| robot.turn(90.0));
    robot.bench.set(0, common::velocity(0));
    robot.run_ms(100);
    let alone = Course::positions(&[(1, TARGET)]).expect("a motor of the hub");
    robot.bench.move_group(usual(alone, 1_500, 5_000));
    robot.run_ms(3_000);
    assert!(robot.state().correction[1].abs() > 50, "{:?}", robot.state());
    let position = robot.bench.snapshot.motors[1].position;
    assert!(position.abs_diff(TARGET) < 6, "{position} counts");
}

#[test]
fn a_correction_that_does_not_fit_in_32_bits_stays_at_its_last_value() {
    // With these dimensions one degree of slip is a correction of some 60 million counts.
    const CORRECTION_PER_DEGREE: f64 = 10_000.0 / 360.0 * 2_147_483.647;
    let geometry =
        DriveBase { wheel_diameter_mm: 1.0, track_mm: 10_000.0, counts_per_turn: [2_147_483.647; 2] };
    let mut hub = Hub::new([common::unknown(&motor("NeveRest 60")); 2], Period::DEFAULT);
    let base = BaseSettings::new([0, 1], &geometry, true).expect("in range");
    hub.apply(Command::SetBase(Some(base))).expect("both wheels");
    let mut last = 0;
    for tick in 1..=40 {
        let now = Micros::new(50_000 * tick);
        // The wheels stand still while the base turns by 2 degrees a tick.
        let still = Some(Reading { position: 0, edge_at: Micros::new(0), at: now });
        hub.set_gyro_reading(Some(GyroReading { left_degrees: 2.0 * tick as f32, at: now }));
        let state = hub.step(now, &[still; 2], None).base.expect("configured");
        assert_eq!(state.gyro, GyroState::Good);
        let step = f64::from(state.correction[1]) - f64::from(last);
        assert!(step.abs() < 2.01 * CORRECTION_PER_DEGREE, "tick {tick}: from {last} to {state:?}");
        last = state.correction[1];
    }
    assert_ne!(last, 0);
}

#[test]
fn without_a_gyro_the_slip_stays_unknown() {
    let mut robot = Robot::new(false, 50);
    robot.turn(90.0);
    let state = robot.state();
    assert!((robot.heading() - 90.0 * (1.0 - SLIP)).abs() < 5.0 * COUNT_DEGREES, "{}", robot.heading());
    assert!((f64::from(state.heading_millidegrees) - 90e3).abs() < 1e3 * 5.0 * COUNT_DEGREES, "{state:?}");
    assert_eq!((state.correction, state.gyro, state.losses), ([0, 0], GyroState::Unused, 0));
}

#[test]
fn a_base_whose_gyro_fails_goes_on_by_its_encoders_and_says_so() {
    let mut robot = Robot::new(true, 10);
    robot.turn(90.0);
    robot.gyro_works = false;
    robot.run_ms(20);
    let lost = robot.state();
    assert_eq!((lost.gyro, lost.losses), (GyroState::Lost, 1));
    robot.turn(90.0);
    let turned = robot.heading();
    assert!((turned - 90.0 - 90.0 * (1.0 - SLIP)).abs() < 10.0 * COUNT_DEGREES, "{turned}");
    assert_eq!(robot.state().correction, lost.correction, "the correction stays");
    // The gyro comes back. The heading of the base does not jump, and turns are exact again.
    robot.gyro_works = true;
    robot.run_ms(500);
    assert!((robot.heading() - turned).abs() < 2.0 * COUNT_DEGREES);
    assert_eq!((robot.state().gyro, robot.state().losses), (GyroState::Good, 1));
    robot.turn(90.0);
    let heading = robot.heading() - turned;
    assert!((heading - 90.0).abs() < 10.0 * COUNT_DEGREES, "{heading}");
}

#[test]
fn a_gyro_that_does_not_turn_with_the_wheels_is_not_used() {
    // The gyro is mounted upside down, or it measures nothing or a fifth of the turns of the base.
    for gyro_gain in [-1.0, 0.0, 0.2] {
        for period_ms in [1, 100] {
            let mut robot = Robot::new(true, period_ms);
            robot.gyro_gain = gyro_gain;
            robot.turn(180.0);
            assert_eq!(robot.state().gyro, GyroState::Implausible, "{gyro_gain} {period_ms}");
            let turned = robot.heading();
            robot.run_ms(2_000);
            assert!((robot.heading() - turned).abs() < 1.0, "{gyro_gain} {period_ms}: the base stands");
            // Until the hub rejects the gyro, the base turns too far, by less than 60 degrees.
            assert!(turned < 180.0 + 60.0, "{gyro_gain} {period_ms} {turned}");
        }
    }
    // A gyro whose scale is wrong by a fifth is used.
    let mut robot = Robot::new(true, 50);
    robot.gyro_gain = 0.8;
    robot.turn(180.0);
    assert_eq!(robot.state().gyro, GyroState::Good);
}

#[test]
fn a_base_that_is_turned_by_hand_turns_back_slowly() {
    for (pushed_degrees, ms) in [(3.0, 1_000), (60.0, 3_000)] {
        let mut robot = Robot::new(true, 10);
        robot.turn(90.0);
        robot.pushed_degrees = pushed_degrees;
        let mut fastest = 0.0_f64;
        for _ in 0..ms / 10 {
            let last = robot.heading();
            robot.run_ms(10);
            fastest = fastest.max((robot.heading() - last).abs() / 0.01);
        }
        let error = robot.heading() - (90.0 - pushed_degrees);
        assert!(error.abs() < 5.0 * COUNT_DEGREES, "{pushed_degrees}: off by {error}");
        assert!(fastest < 90.0, "{pushed_degrees}: {fastest} degrees per second");
    }
}

#[test]
fn a_base_needs_two_motors_of_the_hub() {
    let mut robot = Robot::new(false, 50);
    let good = BaseSettings::new([1, 0], &BASE, true).expect("in range");
    assert_eq!(robot.configure(good), Ok(()));
    for wheels in [[0, 3], [1, 1]] {
        assert_eq!(robot.configure(BaseSettings { wheels, ..good }), Err(RangeError::Motor));
    }
    assert_eq!(BaseSettings::new([1, 1], &BASE, true), Err(RangeError::DriveBase));
    for wrong in [
        DriveBase { wheel_diameter_mm: 0.999, ..BASE },
        DriveBase { track_mm: 10_000.1, ..BASE },
        DriveBase { track_mm: f64::NAN, ..BASE },
        DriveBase { counts_per_turn: [0.9, 1_680.0], ..BASE },
        DriveBase { counts_per_turn: [1_680.0, 3e6], ..BASE },
    ] {
        assert_eq!(BaseSettings::new([0, 1], &wrong, true), Err(RangeError::DriveBase), "{wrong:?}");
    }
}

#[test]
fn wheels_of_a_new_base_leave_their_group() {
    let mut robot = Robot::new(true, 50);
    robot.turn(90.0);
    robot.configure(BaseSettings::new([0, 1], &BASE, true).expect("in range")).expect("both wheels");
    robot.run_ms(100);
    let state = robot.state();
    // A wheel may move by some counts until it is held.
    assert!(state.heading_millidegrees.abs() < 500 && state.x_um.abs() < 1_000, "{state:?}");
    assert!(state.correction[0].abs() < 3, "{state:?}");
    assert_eq!(robot.bench.snapshot.motors[0].setpoint, common::velocity(0));
}

#[test]
fn wheels_of_a_new_base_that_leave_a_waiting_group_stop() {
    let mut robot = Robot::new(false, 50);
    (0..2).for_each(|wheel| robot.bench.set(wheel, common::velocity(300)));
    robot.run_ms(1_000);
    // Both commands arrive between two ticks.
    robot.begin_turn(360.0);
    robot.configure(BaseSettings::new([0, 1], &BASE, false).expect("in range")).expect("both wheels");
    robot.run_ms(50);
    assert_eq!([0, 1].map(|wheel| robot.bench.snapshot.motors[wheel].setpoint), [common::velocity(0); 2]);
}

#[test]
fn wheels_of_a_base_that_is_deleted_while_it_drives_stop_without_a_jump() {
    let mut robot = Robot::new(true, 50);
    robot.turn(90.0);
    robot.begin_turn(360.0);
    robot.run_ms(1_000);
    robot.bench.hub.apply(Command::SetBase(None)).expect("no base");
    let before = robot.bench.speed(1);
    let fastest = robot.bench.highest(500, |bench| bench.speed(0).abs().max(bench.speed(1).abs()));
    assert!(fastest < 1.05 * before, "{fastest:.0} counts/s, {before:.0} before");
    assert_eq!([0, 1].map(|wheel| robot.bench.snapshot.motors[wheel].setpoint), [common::velocity(0); 2]);
}
