//! Motors that move in step, on simulated plants.

use crate::common::{self, Cable, NO_STOPS, configured, motor, stall_torque, unknown, velocity};
use crate::{BASE, WHEEL, by, on, to, usual};
use motor_hub::bridge::{BridgeFeedback, Drive};
use motor_hub::group::{Course, GroupCommand, Halt};
use motor_hub::model::catalogue::Motor;
use motor_hub::model::load::Load;
use motor_hub::model::si::{Drag, KgM2};
use motor_hub::motor::Setpoint;
use motor_hub::regulator::Coefficients;
use motor_hub::units::{Acceleration, Coefficient, Control};
use std::num::NonZeroU16;

type Bench<const N: usize> = common::Bench<N>;

/// Sets up motors with these loads, and runs them for 100 ms. If `known` is true, each motor is configured for the load
/// of a wheel.
fn set_up<const N: usize>(period_ms: u32, motors: [Motor; N], known: bool, loads: [Load; N]) -> Bench<N> {
    let settings = motors.map(|motor| if known { configured(&motor, &WHEEL) } else { unknown(&motor) });
    let plants = std::array::from_fn(|n| common::plant(motors[n], loads[n]));
    let mut bench = Bench::new(settings, plants, period_ms);
    bench.run_ms(100);
    bench
}

/// Runs until the group has arrived. Returns the time in ms.
fn arrive<const N: usize>(bench: &mut Bench<N>, mut each_ms: impl FnMut(&Bench<N>)) -> u64 {
    let start = bench.ms;
    // Reports of the course before do not count.
    bench.snapshot.motors.iter_mut().for_each(|motor| motor.settled = false);
    while !bench.snapshot.motors[0].settled {
        assert!(bench.ms - start < 20_000, "never arrived: {:?}", bench.snapshot);
        bench.run_ms(1);
        each_ms(bench);
    }
    bench.ms - start
}

/// Positions of all motors in counts.
fn places<const N: usize>(bench: &Bench<N>) -> [f64; N] {
    std::array::from_fn(|motor| bench.counts(motor))
}

/// Lets time pass. Returns the largest change of any motor's reported current from one tick to the next, in A.
fn largest_current_step<const N: usize>(bench: &mut Bench<N>, ms: u64) -> f64 {
    let mut largest = 0.0f64;
    for _ in 0..ms {
        let before = bench.snapshot.motors.map(|motor| motor.current);
        bench.run_ms(1);
        for (motor, before) in bench.snapshot.motors.iter().zip(before) {
            largest = largest.max(f64::from((motor.current.get() - before.get()).abs()) / 1e3);
        }
    }
    largest
}

fn together(course: Course, mm_s: f64, mm_s2: f64) -> GroupCommand {
    let [speed, _] = BASE.speeds(mm_s, 0.0).expect("in range");
    let [acceleration, _] = BASE.speeds(mm_s2, 0.0).expect("in range");
    GroupCommand {
        course,
        speed,
        acceleration: Acceleration::new(acceleration.round() as u32).expect("above 0"),
        lag: 120,
        tolerance: 5,
        halt: Halt::Stop,
    }
}

/// Returns the heading of the base in degrees, from positions in counts with their fractions.
fn heading(places: [f64; 2]) -> f64 {
    (places[1] - places[0]) * BASE.heading([0, 1_000_000]) / 1e6
}

const PERIODS: [u32; 4] = [1, 10, 20, 50];

/// Configured and unknown motors at each period.
fn cases() -> impl Iterator<Item = (bool, u32)> {
    [true, false].into_iter().flat_map(|known| PERIODS.map(|period| (known, period)))
}

fn two() -> [Motor; 2] {
    [motor("AM 60 A"), motor("AM 60 B")]
}

/// Returns the drag that takes this share of the right motor's stall torque at its free speed.
fn drag(share: f64) -> Drag {
    let [_, motor] = two();
    let free = 12.0 / motor.ke.0 / motor.gear_ratio;
    Drag(share * stall_torque(&motor) / free)
}

#[test]
fn a_drive_base_goes_straight_with_equal_loads_and_with_unequal_ones() {
    for (known, period) in cases() {
        for (dragged, limit) in [(0.0, 0.1), (0.18, 0.5)] {
            let loads = [WHEEL, Load { drag_after: drag(dragged), ..WHEEL }];
            let mut bench = set_up(period, two(), known, loads);
            bench.move_group(together(by(BASE.straight(1000.0).expect("short")), 350.0, 700.0));
            let mut worst = 0.0f64;
            arrive(&mut bench, |bench| worst = worst.max(heading(places(bench)).abs()));
            bench.run_ms(500);
            let end = heading(places(&bench)).abs();
            let what = format!("known {known}, drag {dragged}, {period} ms: {worst}, in the end {end}");
            // With unknown motors the heading may be wrong by 1 degree during the course.
            assert!(end <= limit && worst <= if known { limit } else { 1.0 }, "{what}");
        }
    }
}

#[test]
fn with_the_usual_lag_nobody_waits_for_a_member_that_follows_as_well_as_it_can() {
    for (known, periods) in [(true, &[1, 10, 20, 50, 100][..]), (false, &[1, 10, 20, 50])] {
        for &period in periods {
            for (mm_s, mm_s2) in [(20.0, 100.0), (150.0, 500.0), (350.0, 700.0)] {
                // Time in milliseconds until the references have reached their end. The references wait only if a member
                // lags too far.
                let [usual, endless] = [false, true].map(|endless| {
                    let loads = [WHEEL, Load { drag_after: drag(0.18), ..WHEEL }];
                    let mut bench = set_up(period, two(), known, loads);
                    let GroupCommand { course, speed, acceleration, .. } =
                        together(by([1_000; 2]), mm_s, mm_s2);
                    let usual = GroupCommand::new(course, speed, acceleration);
                    let lag = if endless { u16::MAX } else { usual.lag };
                    bench.move_group(GroupCommand { lag, ..usual });
                    let at_end = |setpoint| matches!(setpoint, Setpoint::Follow(to) if to.position == 1_000);
                    bench
                        .wait_until(60_000, |bench| at_end(bench.snapshot.motors[0].setpoint))
                        .expect("an end")
                });
                let what = format!("known {known}, {period} ms, {mm_s} mm/s");
                assert!(usual <= endless + u64::from(2 * period), "{what}: {usual} ms, not {endless} ms");
            }
        }
    }
}

#[test]
fn a_turn_by_90_degrees_takes_little_more_than_a_second() {
    for (known, period) in cases() {
        let mut bench = set_up(period, two(), known, [WHEEL; 2]);
        let targets = BASE.turn(90.0).expect("short");
        bench.move_group(together(by(targets), 380.0, 850.0));
        let ms = arrive(&mut bench, |_| ());
        bench.run_ms(1_000);
        let error = heading(places(&bench)) - 90.0;
        let off = [0, 1].map(|wheel| bench.snapshot.motors[wheel].position - targets[wheel]);
        let what = format!("known {known}, {period} ms: {ms} ms, off by {error}, wheels by {off:?} counts");
        // A count of one wheel is 0.032 degrees. A held unknown motor is up to 2 counts off.
        assert!(!known || error.abs() <= 0.1, "{what}");
        assert!(off.iter().all(|counts| counts.abs() <= if known { 1 } else { 2 }), "{what}");
        // The time includes the dwell of 50 ms at the end.
        assert!(!known || ms <= 1_150 + 50, "{what}");
    }
}

#[test]
fn a_wheel_that_is_blocked_stops_the_other_and_both_finish_when_it_is_free() {
    for (known, period) in cases() {
        let mut bench = set_up(period, two(), known, [WHEEL; 2]);
        bench.move_group(together(by([5_000; 2]), 300.0, 700.0));
        bench.axes[1].stops.1 = 2_000.0;
        bench.run_ms(2_000);
        let mut ahead = 0.0f64;
        let mut moved = (f64::INFINITY, f64::NEG_INFINITY);
        for ms in 0..2_000 {
            bench.run_ms(1);
            let [free, held] = places(&bench);
            ahead = ahead.max(free - held);
            if ms >= 1_000 {
                moved = (moved.0.min(free), moved.1.max(free));
            }
        }
        let [free, held] = bench.snapshot.motors;
        assert!(held.stalled && !held.faults.any(), "{held:?}");
        assert!(!free.faults.any() && !free.stalled, "{free:?}");
        // An unknown motor overshoots the position at which it should stop.
        let most = if known { 130.0 } else { 250.0 };
        assert!(ahead <= most, "known {known}, {period} ms: {ahead} counts ahead");
        // An unknown motor may swing by a few counts.
        let swing = moved.1 - moved.0;
        assert!(swing < if known { 3.0 } else { 10.0 }, "known {known}, {period} ms: {moved:?}");
        bench.axes[1].stops = NO_STOPS;
        arrive(&mut bench, |bench| {
            let [free, held] = places(bench);
            assert!((free - held).abs() <= most, "{free} {held}");
        });
        assert!(places(&bench).iter().all(|place| (place - 5_000.0).abs() < 6.0), "{:?}", places(&bench));
    }
}

#[test]
fn a_fault_of_one_member_stops_or_coasts_the_group() {
    for (halt, period) in [Halt::Stop, Halt::Coast].into_iter().flat_map(|halt| PERIODS.map(|p| (halt, p))) {
        let mut bench = set_up(period, two(), true, [WHEEL; 2]);
        bench.move_group(GroupCommand { halt, ..together(by([20_000; 2]), 300.0, 700.0) });
        bench.run_ms(1_500);
        bench.axes[1].cable = Cable::Unplugged;
        bench.run_ms(1_500);
        let [other, faulty] = bench.snapshot.motors;
        assert!(faulty.faults.encoder.is_some(), "{faulty:?}");
        assert_eq!(faulty.drive, Drive::COAST);
        let place = bench.counts(0);
        match halt {
            Halt::Stop => {
                assert!(matches!(other.setpoint, Setpoint::Follow(_)), "{other:?}");
                bench.axes[0].torque = 0.4;
                bench.run_ms(1_000);
                let moved = bench.counts(0) - place;
                assert!(moved.abs() < 4.0, "{period} ms: {moved}");
            }
            Halt::Coast => {
                assert_eq!((other.setpoint, other.drive), (Setpoint::Disabled, Drive::COAST));
            }
        }
    }
}

#[test]
fn a_member_with_a_new_set_point_leaves_and_the_others_halt() {
    let alone = velocity(300);
    for period in PERIODS {
        for (halt, setpoint) in [(Halt::Stop, alone), (Halt::Coast, alone), (Halt::Stop, Setpoint::Disabled)]
        {
            let mut bench = set_up(period, two(), true, [WHEEL; 2]);
            bench.move_group(GroupCommand { halt, ..together(by([20_000; 2]), 300.0, 700.0) });
            bench.run_ms(1_500);
            bench.set(1, setpoint);
            bench.run_ms(1_500);
            let [other, left] = bench.snapshot.motors;
            assert_eq!(left.setpoint, setpoint);
            if halt == Halt::Coast || setpoint == Setpoint::Disabled {
                assert_eq!(other.setpoint, Setpoint::Disabled);
            } else {
                assert!(matches!(other.setpoint, Setpoint::Follow(_)), "{other:?}");
                let place = bench.counts(0);
                bench.run_ms(200);
                let moved = bench.counts(0) - place;
                // The limit of one count is the resolution of the encoder.
                assert!(moved.abs() < 1.0, "{period} ms: {moved} {other:?}");
                // The other members still form a group.
                bench.move_group(together(by([500]), 300.0, 700.0));
                let place = bench.counts(0);
                arrive(&mut bench, |_| ());
                assert!((bench.counts(0) - place - 500.0).abs() < 8.0);
            }
        }
    }
}

#[test]
fn a_new_group_of_some_members_lets_only_the_other_members_coast() {
    let three = [motor("AM 60 A"); 3];
    let mut bench = set_up(50, three, true, [WHEEL; 3]);
    bench.move_group(GroupCommand { halt: Halt::Coast, ..together(by([20_000; 3]), 300.0, 700.0) });
    bench.run_ms(1_000);
    // An encoder that is not read keeps the new group from starting.
    bench.axes[1].unread_ms = 100;
    bench.run_ms(30);
    bench.move_group(together(by([1_000; 2]), 300.0, 700.0));
    let setpoints = bench.tick().motors.map(|motor| motor.setpoint);
    assert_eq!(setpoints, [velocity(0), velocity(0), Setpoint::Disabled]);
}

#[test]
fn a_motor_that_has_left_a_group_does_not_slow_the_next_course() {
    let arrival_ms = [true, false].map(|from_three| {
        let mut bench = set_up(50, [motor("AM 60 A"); 3], true, [WHEEL; 3]);
        if from_three {
            bench.move_group(together(on([0, 0, 2_000]), 300.0, 330.0));
            bench.run_ms(2_000);
        }
        bench.set(2, velocity(2_000));
        bench.run_ms(50);
        bench.move_group(together(by([500, 250]), 85.0, 170.0));
        arrive(&mut bench, |_| ())
    });
    assert!(arrival_ms[0].abs_diff(arrival_ms[1]) <= 50, "{arrival_ms:?} ms");
}

/// Pushes the second motor with a torque in N m for 1 s, against which the motor's current limit leaves it no chance.
fn push_away(bench: &mut Bench<2>, torque: f64) {
    bench.configure(1, |settings| settings.current_limit = NonZeroU16::new(1_000));
    bench.axes[1].torque = torque;
    bench.run_ms(1_000);
    bench.axes[1].torque = 0.0;
}

#[test]
fn a_member_that_was_pushed_away_returns_at_the_speed_of_the_course() {
    const COURSE_CPS: i32 = 200;
    for (known, period) in cases() {
        for is_pid in [false, true] {
            let mut bench = set_up(period, two(), known, [WHEEL; 2]);
            if is_pid {
                bench.configure(1, |settings| {
                    let mut own = Coefficients::suggested(settings.winding.emf);
                    // A wheel of the robot is not as light as the suggested P allows for.
                    own.velocity.p = Coefficient::from_bits(2 * own.velocity.p.to_bits());
                    settings.coefficients = Some(own);
                });
            }
            bench.move_group(usual(by([200; 2]), COURSE_CPS, 400));
            bench.run_ms(3_000);
            push_away(&mut bench, -1.5);
            bench.run_ms(200);
            let highest = bench.highest(16_000, |bench| bench.speed(1));
            let what = format!("known {known}, PID {is_pid}, {period} ms");
            // PID overshoots its target speed.
            let most = if is_pid { 1.8 } else { 1.3 } * f64::from(COURSE_CPS);
            assert!(highest < most, "{what}: {highest} counts/s to the end position");
            let error = bench.counts(1) - 200.0;
            assert!(error.abs() < 6.0, "{what}: {error} counts");
            // On its way, the member waits for its reference.
            bench.move_group(usual(on([COURSE_CPS; 2]), COURSE_CPS, 400));
            bench.run_ms(1_000);
            push_away(&mut bench, 1.5);
            bench.run_ms(200);
            let lowest = -bench.highest(4_000, |bench| -bench.speed(1));
            assert!(lowest > f64::from(COURSE_CPS) - most, "{what}: {lowest} counts/s on the way");
        }
    }
}

#[test]
fn a_heavy_member_that_is_ahead_brakes_to_its_reference() {
    const HEAVY: Load = Load { inertia_after: KgM2(0.3), ..Load::NONE };
    let motors = two();
    let plants = motors.map(|motor| common::plant(motor, HEAVY));
    for period in PERIODS {
        let mut bench = Bench::new(motors.map(|motor| configured(&motor, &HEAVY)), plants.clone(), period);
        bench.run_ms(100);
        bench.move_group(together(on([1_500, 50]), 0.0, 700.0));
        bench.run_ms(3_000);
        push_away(&mut bench, 2.0);
        bench.configure(1, |settings| settings.current_limit = None);
        let mut behind = (f64::INFINITY, f64::NEG_INFINITY);
        for _ in 0..8_000 {
            bench.run_ms(1);
            let Setpoint::Follow(reference) = bench.snapshot.motors[1].setpoint else {
                panic!("{:?}", bench.snapshot)
            };
            let error = f64::from(reference.position) - bench.counts(1);
            behind = (behind.0.min(error), behind.1.max(error));
        }
        assert!(behind.0 < -500.0 && behind.1 < 10.0, "{period} ms: {behind:?} counts behind the reference");
    }
}

#[test]
fn another_course_in_mid_move_makes_no_step_of_current() {
    let courses = [
        ("further", by([6_000, 6_000])),
        ("a turn", by([2_000, -2_000])),
        ("an arc", by([3_000, 1_000])),
        ("back", to([0, 0])),
        ("less", to([1_300, 1_300])),
        ("on", on([1_000, 1_000])),
        ("on the spot", on([-800, 800])),
        ("on backwards", on([-1_500, -1_500])),
        ("stop", on([0, 0])),
    ];
    for (known, period) in cases() {
        let mut bench = set_up(period, two(), known, [WHEEL; 2]);
        let first = together(by([4_000; 2]), 300.0, 700.0);
        bench.move_group(first);
        let ordinary = largest_current_step(&mut bench, 800);
        for (name, course) in courses {
            let mut bench = set_up(period, two(), known, [WHEEL; 2]);
            bench.move_group(first);
            bench.run_ms(1_000);
            bench.move_group(together(course, 300.0, 700.0));
            let step = largest_current_step(&mut bench, 800);
            let what = format!("{name}, known {known}, {period} ms");
            assert!(step <= 1.2 * ordinary, "{what}: {step} A, at the start {ordinary} A");
        }
    }
}

#[test]
fn a_gantry_of_four_different_motors_comes_level_and_goes_up() {
    let names = ["AM 60 A", "AM 60 B", "AM 40 A", "AM 40 C"];
    let motors = names.map(motor);
    for (known, period) in cases() {
        let mut bench = set_up(period, motors, known, [WHEEL; 4]);
        for (axis, torque) in bench.axes.iter_mut().zip([-0.1, -0.3, -0.2, -0.1]) {
            axis.torque = torque;
        }
        bench.move_group(together(to([100; 4]), 100.0, 700.0));
        arrive(&mut bench, |_| ());
        bench.move_group(together(to([6_000; 4]), 150.0, 700.0));
        arrive(&mut bench, |_| ());
        let places = places(&bench);
        let level = places.iter().all(|place| (place - 6_000.0).abs() < 6.0);
        assert!(level, "known {known}, {period} ms: {places:?}");
    }
}

#[test]
fn the_slowest_sets_the_pace() {
    for (known, period) in cases() {
        // The second of these motors reaches a third of the requested speed.
        let motors = ["AM 60 A", "AM 40 B"].map(motor);
        let mut bench = set_up(period, motors, known, [WHEEL; 2]);
        bench.axes[1].torque = -0.1;
        bench.move_group(together(by([2_000; 2]), 250.0, 700.0));
        let mut apart = 0.0f64;
        arrive(&mut bench, |bench| {
            let [quick, slow] = places(bench);
            apart = apart.max((quick - slow).abs());
        });
        assert!(apart <= 130.0, "known {known}, {period} ms: {apart} counts apart");
    }
}

#[test]
fn a_course_that_waits_for_an_encoder_stops_its_members() {
    let mut bench = set_up(50, [motor("NeveRest 60"); 2], true, [WHEEL; 2]);
    bench.set(0, velocity(1_000));
    bench.set(1, velocity(1_000));
    bench.run_ms(1_000);
    bench.axes[1].unread_ms = u64::MAX;
    bench.run_ms(200);
    bench.move_group(usual(on([0, 0]), 1_000, 4_000));
    bench.run_ms(1_000);
    let stopped = bench.counts(0);
    bench.run_ms(1_000);
    let moved = bench.counts(0) - stopped;
    assert!(moved.abs() < 4.0, "{moved:.1} counts");
}

#[test]
fn a_group_moves_once_the_battery_voltage_is_known() {
    let mut bench = set_up(50, two(), true, [WHEEL; 2]);
    bench.battery_read = false;
    bench.move_group(usual(by([500; 2]), 1_000, 4_000));
    bench.run_ms(1_000);
    bench.battery_read = true;
    bench.run_ms(3_000);
    for index in 0..2 {
        assert!((bench.counts(index) - 500.0).abs() < 4.0, "{} counts", bench.counts(index));
    }
}

#[test]
fn a_group_that_has_lost_a_member_does_not_settle_where_the_others_have_stopped() {
    for period in PERIODS {
        let mut bench = set_up(period, two(), true, [WHEEL; 2]);
        bench.move_group(together(by([20_000; 2]), 300.0, 700.0));
        bench.run_ms(1_000);
        // The fault is over when the other member has stopped.
        bench.axes[1].unread_ms = 2 * u64::from(period) + 25;
        bench.run_ms(2_000);
        let [other, lost] = bench.snapshot.motors;
        assert!(!lost.faults.any() && lost.setpoint == velocity(0), "{period} ms: {lost:?}");
        assert!(matches!(other.setpoint, Setpoint::Follow(_)) && other.position < 10_000, "{other:?}");
        assert!(!other.settled, "{period} ms: {other:?}");
    }
}

#[test]
fn a_settled_group_is_no_longer_settled_at_the_tick_of_a_fault() {
    let mut bench = set_up(20, two(), true, [WHEEL; 2]);
    bench.move_group(together(by([200, 200]), 200.0, 500.0));
    arrive(&mut bench, |_| ());
    let fault = BridgeFeedback { current: None, fault: true };
    bench.hub.set_bridge_feedback(&[fault, BridgeFeedback::default()]);
    bench.wait_until(100, |bench| bench.snapshot.motors[0].faults.bridge).expect("a fault");
    assert_eq!(bench.snapshot.motors.map(|motor| motor.settled), [false; 2]);
}

#[test]
fn repeated_commands_to_a_group_whose_member_has_a_fault_move_no_motor() {
    for (halt, period) in [Halt::Stop, Halt::Coast].into_iter().flat_map(|halt| PERIODS.map(|p| (halt, p))) {
        let mut bench = set_up(period, two(), true, [WHEEL; 2]);
        let command = GroupCommand { halt, ..together(on([1_000; 2]), 300.0, 700.0) };
        bench.move_group(command);
        bench.run_ms(1_000);
        bench.axes[1].cable = Cable::Unplugged;
        bench.run_ms(3_000);
        assert!(bench.snapshot.motors[1].faults.encoder.is_some(), "{:?}", bench.snapshot);
        let place = bench.counts(0);
        // A host that streams speeds repeats the command.
        for _ in 0..40 {
            bench.move_group(command);
            bench.run_ms(50);
        }
        let moved = bench.counts(0) - place;
        assert!(moved.abs() < 4.0, "{halt:?}, {period} ms: {moved}");
        // The group moves again after the fault is repaired and cleared.
        bench.axes[1].cable = Cable::Plugged;
        bench.set(1, Setpoint::Disabled);
        bench.run_ms(100);
        bench.move_group(command);
        bench.run_ms(1_000);
        assert!(
            bench.snapshot.motors.iter().all(|motor| motor.velocity.round() > 900),
            "{:?}",
            bench.snapshot
        );
    }
}

#[test]
fn a_repeated_command_neither_delays_the_group_nor_keeps_it_from_settling() {
    for (known, period) in cases() {
        let command = together(to([2_000, 1_237]), 300.0, 700.0);
        // The time of arrival without a repetition, and with repetitions at these intervals in ms.
        let [once, others @ ..] = [u64::MAX, 20, 50, 100, 250].map(|interval| {
            let mut bench = set_up(period, two(), known, [WHEEL; 2]);
            bench.move_group(command);
            let start = bench.ms;
            while !bench.snapshot.motors[0].settled {
                bench.run_ms(1);
                let ms = bench.ms - start;
                assert!(ms < 20_000, "known {known}, {period} ms, every {interval} ms: {:?}", bench.snapshot);
                if ms.is_multiple_of(interval) {
                    bench.move_group(command);
                }
            }
            bench.ms - start
        });
        assert_eq!(others, [once; 4], "known {known}, {period} ms");
    }
}

#[test]
fn a_repeated_distance_is_another_distance() {
    let mut bench = set_up(50, two(), true, [WHEEL; 2]);
    let command = together(by([300; 2]), 300.0, 700.0);
    for end in [300.0, 600.0] {
        bench.move_group(command);
        arrive(&mut bench, |_| ());
        assert!(places(&bench).iter().all(|place| (place - end).abs() < 6.0), "{:?}", places(&bench));
    }
}

#[test]
fn the_others_halt_if_a_member_leaves_before_the_group_has_started() {
    let power = Setpoint::ConstantPower(Control::new(16_000));
    for (halt, setpoint, expected) in [
        (Halt::Stop, velocity(300), velocity(0)),
        (Halt::Coast, velocity(300), Setpoint::Disabled),
        (Halt::Stop, Setpoint::Disabled, Setpoint::Disabled),
    ] {
        let mut bench = set_up(50, two(), true, [WHEEL; 2]);
        (0..2).for_each(|motor| bench.set(motor, power));
        bench.run_ms(1_000);
        // Both commands arrive between two ticks.
        bench.move_group(GroupCommand { halt, ..together(on([0; 2]), 300.0, 700.0) });
        bench.set(1, setpoint);
        bench.run_ms(50);
        assert_eq!(bench.snapshot.motors.map(|motor| motor.setpoint), [expected, setpoint], "{halt:?}");
    }
}
