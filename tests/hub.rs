//! One motor and several: run modes, zero power, faults, settings.

mod common;

use common::{Bench, ScriptedMotor, position, velocity};
use motor_hub::braking::{Regime, Scheme, Winding};
use motor_hub::bridge::{Drive, Mode};
use motor_hub::group::{Course, GroupCommand};
use motor_hub::hub::{Command, Hub, Snapshot};
use motor_hub::motion::{Pidf, Reading};
use motor_hub::motor::{Motor, Setpoint, Settings, ZeroPower};
use motor_hub::regulator::Coefficients;
use motor_hub::supply::Battery;
use motor_hub::units::{
    Acceleration, Coefficient, Control, CountsPerSecond, Micros, Millivolts, Period, RangeError, Share,
};
use proptest::prelude::*;

/// 1 % of the range of control values.
const ONE_PERCENT: i16 = 328;
/// Coefficients with a feed-forward of 10 steps per count/s, so that the control value shows the requested speed.
const ONLY_F: Pidf = Pidf { p: Coefficient::ZERO, i: Coefficient::ZERO, d: Coefficient::ZERO, f: q16(10) };

const fn q16(whole: i32) -> Coefficient {
    Coefficient::from_bits(whole << 16)
}

fn settings() -> Settings {
    Settings::new(Winding::NEVEREST_60)
}

/// Settings with a host's own coefficients.
fn pid(velocity: Pidf, position: Pidf) -> Settings {
    Settings { coefficients: Some(Coefficients { velocity, position }), ..settings() }
}

/// Returns the coefficients that a motor has until a host sends some.
fn suggested() -> Coefficients {
    Coefficients::suggested(settings().winding.emf)
}

fn with_velocity(velocity: Pidf) -> Settings {
    pid(velocity, suggested().position)
}

fn power(control: i16) -> Setpoint {
    Setpoint::ConstantPower(Control::new(control))
}

/// Runs until every estimate has settled. Returns the last tick's snapshot.
fn settle<const N: usize>(bench: &mut Bench<N>) -> Snapshot<N> {
    bench.run_ms(1_000);
    bench.tick()
}

#[test]
fn constant_power_is_the_duty_of_9_8_or_6_2_at_any_speed() {
    for cps in [-2000.0, 0.0, 2000.0] {
        for (control, mode) in [(16_384, Mode::Cw98), (-16_384, Mode::Ccw62)] {
            let mut bench = Bench::turned(settings(), [cps]);
            bench.set(0, power(control));
            let [report] = settle(&mut bench).motors;
            assert_eq!(report.drive.mode, mode);
            assert!((report.drive.duty.to_f64() - 0.5).abs() < 1e-4);
            let against = (control > 0) != (cps >= 0.0);
            assert_eq!(report.regime, Some(if against { Regime::Reverse } else { Regime::Forward }));
        }
    }
}

#[test]
fn a_bridge_draws_its_duty_of_the_current_and_returns_it_while_it_is_open() {
    let mut bench = Bench::turned(settings(), [0.0, 0.0, 1_500.0, 1_500.0]);
    for (motor, control) in [(0, 16_384), (1, -16_384), (2, 0)] {
        bench.set(motor, power(control));
    }
    // The set-point is below the motor's speed, so mode 5/0 brakes. A feed-forward of 12 steps per count/s gives some
    // 5.7 V at 1300 counts/s, which is less than the back EMF.
    bench.configure(3, |at| *at = with_velocity(Pidf { f: q16(12), ..Pidf::default() }));
    bench.set(3, velocity(1_300));
    let motors = settle(&mut bench).motors.map(|motor| {
        let drawn = motor.bus_current(&settings(), Millivolts::new(12_000));
        (motor.current.get(), drawn.get(), motor.drive)
    });
    for (current, drawn, drive) in &motors[..2] {
        let share = drive.duty.to_f64() * f64::from(current.abs());
        assert!((f64::from(*drawn) / share - 1.0).abs() < 0.1, "{motors:?}");
    }
    assert!(motors[0].0 > 800 && motors[1].0 == -motors[0].0, "{motors:?}");
    // While the bridge shorts the motor, no current flows from the bus. In the rest of the period a braking bridge
    // returns current.
    assert!(motors[2].0 < -1_000 && motors[2].1.abs() < 10, "{motors:?}");
    let (current, drawn, drive) = motors[3];
    assert_eq!(drive.mode, Mode::Brake50);
    assert!(current < 0 && drawn < 0 && drawn > current, "{motors:?}");
}

#[test]
fn zero_power_and_velocity_zero_brake_or_float_as_the_motor_is_set() {
    for (zero_power, drive) in [(ZeroPower::Brake, Drive::BRAKE), (ZeroPower::Float, Drive::COAST)] {
        let mut bench = Bench::turned(Settings { zero_power, ..settings() }, [500.0; 2]);
        bench.run_ms(50);
        bench.set(0, power(0));
        bench.set(1, velocity(0));
        let motors = bench.tick().motors;
        assert_eq!(motors[0].drive, drive);
        // A velocity of 0 is held by the regulator.
        assert_eq!(motors[1].drive == Drive::COAST, drive == Drive::COAST);
        assert_eq!(motors[1].regime.is_none(), drive == Drive::COAST);
    }
}

#[test]
fn velocity_below_the_set_point_drives_and_above_it_brakes_before_it_reverses() {
    // The feed-forward is the back EMF of the set-point; P gives twice the back EMF of the error.
    let f = 32_767.0 * 3.98683 / 12_000.0 * 65_536.0;
    let gains = [2.0 * f, f].map(|bits| Coefficient::from_bits(bits as i32));
    let loop_ = Pidf { p: gains[0], f: gains[1], ..Pidf::default() };
    for (cps, regime) in [(1500, Regime::Forward), (900, Regime::Braking), (-500, Regime::Reverse)] {
        let mut bench = Bench::turned(with_velocity(loop_), [1000.0]);
        settle(&mut bench);
        bench.set(0, velocity(cps));
        assert_eq!(bench.tick().motors[0].regime, Some(regime), "{cps}");
    }
}

#[test]
fn position_is_approached_at_the_speed_limit_however_far_it_is_and_the_short_way() {
    let control = |start: i32, setpoint| {
        let mut motor = ScriptedMotor::new(with_velocity(ONLY_F), Period::DEFAULT);
        motor.set(setpoint);
        motor.sample(50, start);
        motor.control(Some(12_000))
    };
    let limit = control(0, velocity(700));
    assert!(limit > Control::ZERO);
    // From 2^23 on a distance in steps of 1/256 count no longer fits 32 bits.
    let powers = (9..31).flat_map(|bits| [(1 << bits) - 1, 1 << bits, (1 << bits) + 1, 3 << (bits - 1)]);
    for distance in powers.chain([i32::MAX]) {
        // The sign of a speed limit has no effect.
        for cps in [700, -700] {
            assert_eq!(control(0, position(distance, 5, cps)), limit, "{distance}");
            assert_eq!(control(0, position(-distance, 5, cps)), limit.reversed(), "{distance}");
        }
    }
    assert_eq!(
        control(i32::MAX - 1_000, position(i32::MIN + 1_000, 0, 700)),
        limit,
        "across the end of the range"
    );
}

#[test]
fn a_motor_is_settled_when_it_has_stood_within_tolerance_under_its_position() {
    let mut bench = Bench::turned(settings(), [0.0]);
    for (target, tolerance, settled) in
        [(5, 5, true), (0, 5, true), (6, 5, false), (-5, 5, true), (-6, 5, false), (0, 0, true)]
    {
        bench.set(0, position(target, tolerance, 700));
        // A motor may only pass its target, so one tick does not settle it.
        assert!(!bench.tick().motors[0].settled, "{target} {tolerance}");
        assert_eq!(settle(&mut bench).motors[0].settled, settled, "{target} {tolerance}");
    }
    for other in [velocity(0), Setpoint::Disabled] {
        bench.set(0, other);
        assert!(!settle(&mut bench).motors[0].settled, "only regulated position has a target");
    }
    // The tolerance is so wide that the motor takes a second to pass.
    let mut bench = Bench::turned(settings(), [2_000.0]);
    bench.set(0, position(1_000, 1_000, 2_000));
    for _ in 0..19 {
        let [report] = bench.tick().motors;
        assert!((0..=2_000).contains(&report.position), "within tolerance");
        assert!(!report.settled, "{report:?}");
    }
}

#[test]
fn without_a_battery_voltage_everything_coasts_and_says_why() {
    let setpoints = [Setpoint::Disabled, power(32_767), velocity(1000), position(1000, 5, 1000)];
    let lost: fn(&mut Bench<4>) = |bench| bench.battery_read = false;
    let empty: fn(&mut Bench<4>) = |bench| bench.rig.battery.emf.0 = 0.0;
    for (change, unknown) in [(lost, true), (empty, false)] {
        let mut bench = Bench::turned(settings(), [0.0; 4]);
        for (motor, setpoint) in setpoints.into_iter().enumerate() {
            bench.set(motor, setpoint);
        }
        assert!(bench.tick().drives()[1..].iter().all(|drive| *drive != Drive::COAST));
        change(&mut bench);
        let snapshot = bench.tick();
        assert_eq!(snapshot.drives(), [Drive::COAST; 4]);
        assert!(!unknown || snapshot.motors.iter().all(|m| m.faults.battery_unknown));
    }
}

#[test]
fn an_encoder_that_is_silent_for_more_than_20_ms_stops_the_regulation_of_its_own_motor_until_it_is_read_again()
 {
    for (silent_ms, is_stale) in [(20, false), (21, true)] {
        let mut bench = Bench::turned(settings(), [0.0; 4]);
        for (motor, setpoint) in
            [power(32_767), velocity(1000), position(1000, 5, 1000), velocity(1000)].into_iter().enumerate()
        {
            bench.set(motor, setpoint);
        }
        bench.run_ms(100 - silent_ms);
        assert!(bench.snapshot.motors.iter().all(|m| m.regime.is_some() && !m.faults.any()));
        bench.axes[..3].iter_mut().for_each(|axis| axis.unread_ms = silent_ms);
        bench.run_ms(silent_ms);
        let motors = bench.tick().motors;
        assert_eq!(motors.map(|m| m.faults.encoder_stale), [is_stale, is_stale, is_stale, false]);
        // Constant power needs no encoder.
        assert_eq!(motors.map(|m| m.drive == Drive::COAST), [false, is_stale, is_stale, false]);
        assert!(bench.tick().motors.iter().all(|m| m.regime.is_some() && !m.faults.any()), "it recovers");
    }
}

/// Takes a tick. Returns the control value of the motor.
fn tick_control(bench: &mut Bench<1>) -> Control {
    bench.tick();
    bench.control(0)
}

#[test]
fn the_integrator_holds_while_the_battery_is_not_read() {
    let [interrupted, steady] = [true, false].map(|interrupted| {
        let mut bench = Bench::turned(settings(), [0.0]);
        bench.set(0, velocity(1000));
        bench.tick();
        if interrupted {
            bench.battery_read = false;
            bench.run_ms(10_000);
            bench.battery_read = true;
            // In the first tick after the interruption the integrator keeps its value. After this tick both runs
            // continue alike.
            bench.tick();
        }
        tick_control(&mut bench).get()
    });
    // The estimated load differs slightly.
    assert!((interrupted - steady).abs() < ONE_PERCENT, "{interrupted} {steady}");
}

#[test]
fn a_change_of_run_mode_starts_from_what_the_motor_does_and_a_new_target_does_not() {
    // Coefficients of a host, which learning does not change.
    let mut bench = Bench::turned(with_velocity(suggested().velocity), [100.0]);
    settle(&mut bench);
    bench.set(0, velocity(300));
    let fresh = tick_control(&mut bench);
    settle(&mut bench);
    let wound = bench.control(0);
    assert!(wound > fresh);
    bench.set(0, velocity(300));
    assert!(tick_control(&mut bench) >= wound);
    bench.set(0, Setpoint::Disabled);
    // After a second without power, the hub no longer assumes the load that held the motor.
    settle(&mut bench);
    bench.set(0, velocity(300));
    let again = tick_control(&mut bench);
    assert!((again.get() - fresh.get()).abs() < 100, "{again:?} {fresh:?} {wound:?}");
}

#[test]
fn a_change_of_run_mode_starts_the_position_loop_afresh() {
    // Only the I term of the position loop requests a speed. The control value shows the speed.
    let only_i = Pidf { i: Coefficient::from_bits((1 << 16) / 20), ..Pidf::default() };
    let target = position(1_000, 0, 2_000);
    let mut bench = Bench::turned(pid(ONLY_F, only_i), [0.0]);
    bench.set(0, target);
    let fresh = tick_control(&mut bench);
    assert!(fresh > Control::ZERO);
    for between in [velocity(0), power(0), Setpoint::Disabled] {
        bench.set(0, target);
        bench.run_ms(100);
        assert!(tick_control(&mut bench) > fresh, "wound up");
        bench.set(0, between);
        // No tick comes between both commands.
        bench.set(0, target);
        // The voltage of the loop's request is rounded to a control value at the estimated speed.
        let control = tick_control(&mut bench);
        assert!((control.get() - fresh.get()).abs() <= 1, "{control:?}, not {fresh:?}, after {between:?}");
    }
}

#[test]
fn a_motor_that_floated_at_zero_starts_its_velocity_loop_afresh() {
    let only_i = Pidf { i: Coefficient::from_bits((10 << 16) / 20), ..Pidf::default() };
    let mut bench = Bench::turned(Settings { zero_power: ZeroPower::Float, ..with_velocity(only_i) }, [0.0]);
    bench.set(0, velocity(1_000));
    let fresh = tick_control(&mut bench);
    assert!(fresh > Control::ZERO);
    bench.run_ms(100);
    assert!(tick_control(&mut bench) > fresh, "wound up");
    // The new set-point has the same run mode.
    bench.set(0, velocity(0));
    assert_eq!(bench.tick().drives(), [Drive::COAST]);
    // After a second without power, the hub no longer assumes the load that held the motor.
    settle(&mut bench);
    bench.set(0, velocity(1_000));
    let again = tick_control(&mut bench);
    assert!((again.get() - fresh.get()).abs() < ONE_PERCENT, "{again:?} {fresh:?}");
}

#[test]
fn a_limit_of_a_command_before_does_not_hold_the_integral() {
    let only_i = Pidf { i: q16(1), ..Pidf::default() };
    let controls = |before: Setpoint| {
        let mut bench = Bench::turned(with_velocity(only_i), [0.0]);
        bench.supply.0 = Share::NONE;
        bench.set(0, before);
        bench.tick();
        bench.supply.0 = Share::ALL;
        bench.set(0, Setpoint::Disabled);
        settle(&mut bench);
        bench.set(0, velocity(1_000));
        [(); 3].map(|()| tick_control(&mut bench))
    };
    assert_eq!(controls(velocity(2_000)), controls(Setpoint::Disabled));
}

#[test]
fn settings_change_as_a_whole_at_the_next_step_while_running() {
    let mut bench = Bench::turned(with_velocity(Pidf::default()), [1505.0; 2]);
    bench.set(0, velocity(1505));
    bench.set(1, velocity(1505));
    // Control 0: full braking in Scheme A, coasting in B.
    assert_eq!(settle(&mut bench).drives(), [Drive::BRAKE; 2]);
    bench.configure(1, |settings| settings.scheme = Scheme::B);
    assert_eq!(bench.tick().drives(), [Drive::BRAKE, Drive::COAST]);
}

#[test]
fn missed_ticks_are_counted() {
    let mut bench = Bench::turned(settings(), [0.0]);
    bench.hub.add_missed_ticks(3);
    assert_eq!(bench.tick().missed_ticks, 3);
    bench.hub.add_missed_ticks(u32::MAX);
    assert_eq!(bench.tick().missed_ticks, u32::MAX);
}

#[test]
fn a_snapshot_says_the_number_of_the_newest_command_that_it_includes() {
    let mut bench = Bench::turned(settings(), [0.0; 2]);
    assert_eq!(bench.tick().newest_command, 0);
    bench.set(0, velocity(100));
    bench.set(1, velocity(100));
    assert_eq!(bench.tick().newest_command, 2);
    let no_such_motor = Command::Set { motor: 2, setpoint: Setpoint::Disabled };
    assert_eq!(bench.hub.apply(no_such_motor), Err(RangeError::Motor));
    let snapshot = bench.tick();
    assert_eq!(snapshot.motors.map(|m| m.setpoint), [velocity(100); 2]);
    assert_eq!(snapshot.newest_command, 3, "a refused command is counted, or its sender would wait for ever");
    assert!(snapshot.includes(3) && snapshot.includes(1) && !snapshot.includes(4));
    let wrapped = Snapshot { newest_command: 1, ..snapshot };
    assert!(wrapped.includes(u32::MAX) && !wrapped.includes(2));
}

#[test]
fn a_group_without_members_or_with_a_motor_that_the_hub_lacks_is_refused() {
    let mut bench = Bench::turned(settings(), [0.0; 2]);
    let acceleration = Acceleration::new(5_000).expect("above 0");
    for members in [&[][..], &[(0, 1), (2, 1)]] {
        let course = Course::distances(members).expect("motors that groups may have");
        let group = GroupCommand::new(course, CountsPerSecond::new(1_000), acceleration);
        assert_eq!(bench.hub.apply(Command::MoveGroup(group)), Err(RangeError::Motor), "{members:?}");
    }
}

fn any_setpoint() -> impl Strategy<Value = Setpoint> {
    prop_oneof![
        Just(Setpoint::Disabled),
        any::<i16>().prop_map(|p| Setpoint::ConstantPower(Control::new(p))),
        any::<i32>().prop_map(velocity),
        (any::<i32>(), any::<u16>(), any::<i32>()).prop_map(|(t, tol, limit)| position(t, tol, limit)),
    ]
}

/// State of the other motor: position (`None` without a reading), age of the edge in us, age of the sample in us, and
/// set-point.
type Neighbour = (Option<i32>, u64, u64, Setpoint);

proptest! {
    #[test]
    fn readings_and_setpoints_of_one_motor_do_not_change_another(
        own in any_setpoint(),
        own_positions in prop::collection::vec(any::<i16>(), 12),
        neighbours in prop::collection::vec(
            (any::<Option<i32>>(), 0u64..100_000, 0u64..100_000, any_setpoint()), 12),
    ) {
        let run = |neighbours: &[Neighbour]| {
            let mut hub = Hub::new([settings(); 2], Period::DEFAULT);
            hub.apply(Command::Set { motor: 0, setpoint: own }).expect("motor");
            own_positions.iter().zip(neighbours).enumerate().map(|(n, (&position, neighbour))| {
                let now = (n as u64 + 10) * 50_000;
                let (other, edge_age, age, setpoint) = *neighbour;
                hub.apply(Command::Set { motor: 1, setpoint }).expect("motor");
                let battery = Some(Battery::unlimited(Millivolts::new(12_000), Micros::new(now)));
                let readings = [
                    Some(Reading { position: position.into(), edge_at: Micros::new(now), at: Micros::new(now) }),
                    other.map(|position| Reading {
                        position,
                        edge_at: Micros::new(now - edge_age),
                        at: Micros::new(now - age),
                    }),
                ];
                hub.step(Micros::new(now), &readings, battery).motors[0]
            }).collect::<Vec<_>>()
        };
        let quiet = vec![(Some(0), 0, 0, Setpoint::Disabled); 12];
        prop_assert_eq!(run(&neighbours), run(&quiet));
    }
}

#[test]
fn a_motor_takes_no_more_memory_than_it_has_been_given() {
    // This is the size on a 64-bit computer. Pointers are shorter on the chip, but a motor contains no pointers. Raise
    // the limit only for a good reason.
    let bytes = size_of::<Motor>();
    assert!(bytes <= 1_032, "{bytes} bytes");
}
