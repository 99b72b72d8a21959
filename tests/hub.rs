//! One motor and several: run modes, zero power, faults, settings.

use motor_hub::braking::{Regime, Scheme, Winding};
use motor_hub::bridge::{Drive, Mode};
use motor_hub::hub::{Action, Command, Hub, Inputs, Snapshot};
use motor_hub::motion::{Pidf, Reading};
use motor_hub::motor::{Setpoint, Settings, ZeroPower};
use motor_hub::regulator::Coefficients;
use motor_hub::supply::Battery;
use motor_hub::units::{Coefficient, Control, CountsPerSecond, Duty, Micros, Millivolts, Period, RangeError};
use proptest::prelude::*;

const TICK: u64 = 50_000;
/// Of the control's range.
const ONE_PERCENT: i16 = 328;

fn settings() -> Settings {
    Settings::new(Winding::NEVEREST_60)
}

/// A hub whose encoders turn at constant speeds and whose battery holds a voltage.
struct Bench<const N: usize> {
    hub: Hub<N>,
    now: u64,
    cps: [i64; N],
    battery_mv: Option<u16>,
    encoder_age: u64,
    encoder_failed: [bool; N],
}

impl<const N: usize> Bench<N> {
    fn new() -> Self {
        let hub = Hub::new([settings(); N], Period::DEFAULT);
        Self {
            hub,
            now: 0,
            cps: [0; N],
            battery_mv: Some(12_000),
            encoder_age: 0,
            encoder_failed: [false; N],
        }
    }

    fn set(&mut self, motor: usize, setpoint: Setpoint) {
        self.hub.apply(Command { motor, action: Action::Set(setpoint) }).expect("motor");
    }

    fn configure(&mut self, motor: usize, settings: Settings) {
        self.hub.apply(Command { motor, action: Action::Configure(settings) }).expect("motor");
    }

    /// What the encoders say every millisecond until the next tick, and that tick.
    fn step(&mut self) -> Snapshot<N> {
        for now in (self.now..self.now + TICK).step_by(1_000).skip(1) {
            self.hub.sample(&self.readings(now));
        }
        self.now += TICK;
        let readings = self.readings(self.now);
        let battery = self.battery_mv.map(|mv| Battery::good(Millivolts::new(mv), Micros::new(self.now)));
        self.hub.step(&Inputs { now: Micros::new(self.now), readings, battery })
    }

    fn readings(&self, now: u64) -> [Option<Reading>; N] {
        let at = Micros::new(now.saturating_sub(self.encoder_age));
        std::array::from_fn(|motor| {
            let position = (self.cps[motor] * now as i64 / 1_000_000) as i32;
            (!self.encoder_failed[motor]).then_some(Reading { position, edge_at: at, at })
        })
    }

    /// Long enough for a speed to be known, too short for the encoder, which turns whatever the
    /// bridge does, to be mistrusted.
    fn two_steps(&mut self) -> Snapshot<N> {
        self.step();
        self.step()
    }

    fn settle(&mut self) -> Snapshot<N> {
        for _ in 0..20 {
            self.step();
        }
        self.step()
    }
}

fn velocity(cps: i32) -> Setpoint {
    Setpoint::Velocity(CountsPerSecond::new(cps))
}

fn position(target: i32, tolerance: u16, limit: i32) -> Setpoint {
    Setpoint::Position { target, tolerance, speed_limit: CountsPerSecond::new(limit) }
}

/// A velocity loop of a host's own.
fn with_velocity(velocity: Pidf) -> Settings {
    let guessed = Coefficients::guessed(settings().winding.emf, Scheme::A, Period::DEFAULT);
    Settings { coefficients: Some(Coefficients { velocity, ..guessed }), ..settings() }
}

#[test]
fn a_new_hub_coasts() {
    let snapshot = Bench::<4>::new().settle();
    assert_eq!(snapshot.drives(), [Drive::COAST; 4]);
    assert!(snapshot.motors.iter().all(|m| m.regime.is_none() && !m.faults.any()));
    assert_eq!((snapshot.tick, snapshot.at), (21, Micros::new(21 * TICK)));
    assert_eq!(Snapshot::<4>::INITIAL.drives(), [Drive::COAST; 4]);
}

#[test]
fn constant_power_is_the_duty_of_9_8_or_6_2_at_any_speed() {
    for cps in [-2000, 0, 2000] {
        let mut bench = Bench::<1>::new();
        bench.cps = [cps];
        for (power, mode) in [(16_384, Mode::Cw98), (-16_384, Mode::Ccw62)] {
            bench.set(0, Setpoint::ConstantPower(Control::new(power)));
            let report = bench.settle().motors[0];
            assert_eq!(report.drive.mode, mode);
            assert!((report.drive.duty.to_f64() - 0.5).abs() < 1e-4);
            let against = (power > 0) != (cps >= 0);
            assert_eq!(report.regime, Some(if against { Regime::Reverse } else { Regime::Forward }));
        }
    }
}

#[test]
fn a_bridge_draws_its_duty_of_the_current_and_returns_it_while_it_is_open() {
    let mut bench = Bench::<4>::new();
    bench.cps = [0, 0, 1_500, 1_500];
    for (motor, power) in [(0, 16_384), (1, -16_384), (2, 0), (3, 8_000)] {
        bench.set(motor, Setpoint::ConstantPower(Control::new(power)));
    }
    // A velocity below that of a turning motor, braked by 5/0.
    // 12 of 32 767 steps for a count/s are some 5.7 V, less than the back EMF.
    bench.configure(3, with_velocity(Pidf { f: Coefficient::from_bits(12 << 16), ..Pidf::default() }));
    bench.set(3, velocity(1_300));
    let motors = bench.settle().motors.map(|motor| {
        let drawn = motor.drawn(&settings(), Millivolts::new(12_000));
        (motor.current.get(), drawn.get(), motor.drive)
    });
    for (current, drawn, drive) in &motors[..2] {
        let share = drive.duty.to_f64() * f64::from(current.abs());
        assert!((f64::from(*drawn) / share - 1.0).abs() < 0.1, "{motors:?}");
    }
    assert!(motors[0].0 > 800 && motors[1].0 == -motors[0].0, "{motors:?}");
    // A full short takes nothing from the bus; the rest of a braking bridge's period gives back.
    assert!(motors[2].0 < -1_000 && motors[2].1.abs() < 10, "{motors:?}");
    let (current, drawn, drive) = motors[3];
    assert_eq!(drive.mode, Mode::Brake50);
    assert!(current < 0 && drawn < 0 && drawn > current, "{motors:?}");
}

#[test]
fn zero_power_brakes_or_floats() {
    let mut bench = Bench::<1>::new();
    bench.set(0, Setpoint::ConstantPower(Control::ZERO));
    assert_eq!(bench.step().drives(), [Drive::BRAKE]);
    bench.configure(0, Settings { zero_power: ZeroPower::Float, ..settings() });
    assert_eq!(bench.step().drives(), [Drive::COAST]);
}

#[test]
fn a_floating_motor_coasts_at_velocity_zero_and_a_braking_one_is_held() {
    for (zero_power, held) in [(ZeroPower::Brake, true), (ZeroPower::Float, false)] {
        let mut bench = Bench::<1>::new();
        bench.configure(0, Settings { zero_power, ..settings() });
        bench.cps = [500];
        bench.set(0, velocity(0));
        let report = bench.two_steps().motors[0];
        assert_eq!(report.regime.is_some(), held);
        assert_eq!(report.drive != Drive::COAST, held);
    }
}

#[test]
fn velocity_below_the_set_point_drives_and_above_it_brakes_before_it_reverses() {
    // Feeds the set-point's back EMF forward, and twice that of the error.
    let f = 32_767.0 * 3.98683 / 12_000.0 * 65_536.0;
    let gains = [2.0 * f, f].map(|bits| Coefficient::from_bits(bits as i32));
    let velocity = Pidf { p: gains[0], f: gains[1], ..Pidf::default() };
    let regime = |cps| {
        let mut bench = Bench::<1>::new();
        bench.configure(0, with_velocity(velocity));
        // Its speed is known before it is driven.
        bench.cps = [1000];
        bench.settle();
        bench.set(0, Setpoint::Velocity(CountsPerSecond::new(cps)));
        bench.step().motors[0].regime
    };
    assert_eq!(regime(1500), Some(Regime::Forward));
    assert_eq!(regime(900), Some(Regime::Braking));
    assert_eq!(regime(-500), Some(Regime::Reverse));
}

#[test]
fn position_is_approached_no_faster_than_the_limit_and_reported_within_tolerance() {
    let mut bench = Bench::<1>::new();
    // At rest at 0: the control value asked for is that of the speed limit.
    let only_f = Pidf { f: Coefficient::from_bits(10 << 16), ..Pidf::default() };
    bench.configure(0, with_velocity(only_f));
    bench.set(0, velocity(700));
    let at_700 = bench.step().motors[0].control;
    for (target, control) in [(1_000_000, at_700), (-1_000_000, -at_700)] {
        for limit in [700, -700] {
            bench.set(0, position(target, 5, limit));
            assert_eq!(bench.step().motors[0].control, control);
        }
    }
    for (target, tolerance, settled) in
        [(5, 5, true), (0, 5, true), (6, 5, false), (-5, 5, true), (-6, 5, false), (0, 0, true)]
    {
        bench.set(0, position(target, tolerance, 700));
        // It may only be passing, wherever it has been before.
        assert!(!bench.step().motors[0].settled, "{target} {tolerance}");
        assert_eq!(bench.settle().motors[0].settled, settled, "{target} {tolerance}");
    }
    bench.set(0, velocity(0));
    assert!(!bench.two_steps().motors[0].settled, "only regulated position has a target");
}

#[test]
fn a_target_across_the_end_of_the_position_range_is_approached_the_short_way() {
    let mut hub = Hub::new([settings()], Period::DEFAULT);
    let setpoint = position(i32::MIN + 10, 0, 500);
    hub.apply(Command { motor: 0, action: Action::Set(setpoint) }).expect("motor");
    let at = Micros::new(TICK);
    let reading = Reading { position: i32::MAX - 10, edge_at: at, at };
    let battery = Some(Battery::good(Millivolts::new(12_000), at));
    let snapshot = hub.step(&Inputs { now: at, readings: [Some(reading)], battery });
    assert!(snapshot.motors[0].control > Control::ZERO);
}

#[test]
fn without_a_battery_voltage_everything_coasts_and_says_why() {
    let setpoints =
        [Setpoint::Disabled, Setpoint::ConstantPower(Control::MAX), velocity(1000), position(1000, 5, 1000)];
    for unknown in [None, Some(0)] {
        let mut bench = Bench::<4>::new();
        for (motor, setpoint) in setpoints.into_iter().enumerate() {
            bench.set(motor, setpoint);
        }
        bench.step();
        bench.battery_mv = unknown;
        let snapshot = bench.step();
        assert_eq!(snapshot.drives(), [Drive::COAST; 4]);
        if unknown.is_none() {
            assert!(snapshot.motors.iter().all(|m| m.faults.battery_unknown));
        }
    }
}

#[test]
fn an_old_battery_voltage_is_none() {
    let mut hub = Hub::new([settings()], Period::DEFAULT);
    let setpoint = Setpoint::ConstantPower(Control::MAX);
    hub.apply(Command { motor: 0, action: Action::Set(setpoint) }).expect("motor");
    let battery = Some(Battery::good(Millivolts::new(12_000), Micros::new(0)));
    let mut drive_at =
        |now| hub.step(&Inputs { now: Micros::new(now), readings: [None], battery }).drives()[0];
    assert_eq!(drive_at(100_000).duty, Duty::ONE);
    assert_eq!(drive_at(150_000), Drive::COAST);
}

#[test]
fn a_stale_encoder_stops_regulation_but_not_constant_power() {
    let mut bench = Bench::<3>::new();
    bench.set(0, Setpoint::ConstantPower(Control::MAX));
    bench.set(1, velocity(1000));
    bench.set(2, position(1000, 5, 1000));
    let running = bench.step();
    assert!(running.motors.iter().all(|m| m.regime.is_some()));
    bench.encoder_age = 20_001;
    let snapshot = bench.step();
    assert_eq!(snapshot.drives()[0].duty, Duty::ONE);
    assert_eq!(snapshot.drives()[1..], [Drive::COAST; 2]);
    assert!(snapshot.motors.iter().all(|m| m.faults.encoder_stale));
}

#[test]
fn an_encoder_that_fails_stops_the_regulation_of_its_own_motor_alone() {
    let mut bench = Bench::<4>::new();
    for motor in 0..3 {
        bench.set(motor, velocity(1000));
    }
    bench.set(3, Setpoint::ConstantPower(Control::MAX));
    assert!(bench.step().motors.iter().all(|m| m.regime.is_some() && !m.faults.any()));
    bench.encoder_failed = [false, true, false, true];
    let snapshot = bench.step();
    assert_eq!(snapshot.motors.map(|m| m.faults.encoder_stale), bench.encoder_failed);
    assert_eq!(snapshot.motors.map(|m| m.regime.is_some()), [true, false, true, true]);
    assert_eq!(snapshot.drives()[1], Drive::COAST);
    bench.encoder_failed = [false; 4];
    assert!(bench.step().motors.iter().all(|m| m.regime.is_some() && !m.faults.any()), "and it recovers");
}

#[test]
fn nothing_winds_up_while_the_bridge_cannot_obey() {
    let mut steady = Bench::<1>::new();
    let mut interrupted = Bench::<1>::new();
    for bench in [&mut steady, &mut interrupted] {
        bench.set(0, velocity(1000));
        bench.step();
    }
    interrupted.battery_mv = None;
    for _ in 0..200 {
        interrupted.step();
    }
    interrupted.battery_mv = Some(12_000);
    // One tick in which the integrator still holds, and then both go on alike.
    interrupted.step();
    let [interrupted, steady] =
        [&mut interrupted, &mut steady].map(|bench| bench.step().motors[0].control.get());
    // What the observer thinks of the load is not quite the same.
    assert!((interrupted - steady).abs() < ONE_PERCENT, "{interrupted} {steady}");
}

#[test]
fn a_change_of_run_mode_starts_from_what_the_motor_does_and_a_new_target_does_not() {
    // A host's own, which nothing that is learned changes.
    let guessed = Coefficients::guessed(settings().winding.emf, Scheme::A, Period::DEFAULT);
    let coasting = || {
        let mut bench = Bench::<1>::new();
        bench.configure(0, with_velocity(guessed.velocity));
        bench.cps = [100];
        bench.settle();
        bench
    };
    let mut bench = coasting();
    bench.set(0, velocity(300));
    let fresh = bench.step().motors[0].control;
    let wound = bench.settle().motors[0].control;
    assert!(wound > fresh);
    bench.set(0, velocity(300));
    assert!(bench.step().motors[0].control >= wound);
    bench.set(0, Setpoint::Disabled);
    // What held it under power is known to be gone.
    bench.settle();
    bench.set(0, velocity(300));
    let again = bench.step().motors[0].control;
    assert!((again.get() - fresh.get()).abs() < 100, "{again:?} {fresh:?} {wound:?}");
}

#[test]
fn the_farthest_target_is_approached_the_right_way_at_the_speed_limit() {
    // With the velocity loop's F alone the control value asked for is that of the speed to go at.
    let only_f = Pidf { f: Coefficient::from_bits(10 << 16), ..Pidf::default() };
    let control = |setpoint| {
        let mut bench = Bench::<1>::new();
        bench.configure(0, with_velocity(only_f));
        bench.set(0, setpoint);
        bench.step().motors[0].control
    };
    let limit = control(velocity(700));
    assert!(limit > Control::ZERO);
    // From 2^23 on a distance in steps of 1/256 count no longer fits 32 bits.
    for distance in (9..31).flat_map(|bits| [(1 << bits) - 1, 1 << bits, (1 << bits) + 1, 3 << (bits - 1)]) {
        assert_eq!(control(position(distance, 0, 700)), limit, "{distance}");
        assert_eq!(control(position(-distance, 0, 700)), -limit, "{distance}");
    }
    assert_eq!(control(position(i32::MAX, 0, 700)), limit);
    assert_eq!(control(position(-i32::MAX, 0, 700)), -limit);
}

#[test]
fn a_change_of_run_mode_starts_the_position_loop_afresh() {
    // Nothing but the position loop's I asks for a speed, and the control value is that of the speed.
    let coefficients = Coefficients {
        velocity: Pidf { f: Coefficient::from_bits(10 << 16), ..Pidf::default() },
        position: Pidf { i: Coefficient::from_bits((1 << 16) / 20), ..Pidf::default() },
    };
    let settings = Settings { coefficients: Some(coefficients), ..settings() };
    let target = position(1_000, 0, 2_000);
    let mut bench = Bench::<1>::new();
    bench.configure(0, settings);
    bench.set(0, target);
    let fresh = bench.step().motors[0].control;
    assert!(fresh > Control::ZERO);
    for between in [velocity(0), Setpoint::ConstantPower(Control::ZERO), Setpoint::Disabled] {
        bench.set(0, target);
        bench.two_steps();
        assert!(bench.step().motors[0].control > fresh, "wound up");
        bench.set(0, between);
        // Before a tick has come.
        bench.set(0, target);
        // The voltage of the loop's request is rounded to a control value at the estimated speed.
        let control = bench.step().motors[0].control;
        assert!((control.get() - fresh.get()).abs() <= 1, "{control:?}, not {fresh:?}, after {between:?}");
    }
}

#[test]
fn a_motor_that_floated_at_zero_starts_its_velocity_loop_afresh() {
    let mut bench = Bench::<1>::new();
    let only_i = Pidf { i: Coefficient::from_bits((10 << 16) / 20), ..Pidf::default() };
    bench.configure(0, Settings { zero_power: ZeroPower::Float, ..with_velocity(only_i) });
    bench.set(0, velocity(1_000));
    let fresh = bench.step().motors[0].control;
    assert!(fresh > Control::ZERO);
    bench.two_steps();
    assert!(bench.step().motors[0].control > fresh, "wound up");
    // The run mode stays.
    bench.set(0, velocity(0));
    assert_eq!(bench.step().drives(), [Drive::COAST]);
    // What held it under power is known to be gone.
    bench.settle();
    bench.set(0, velocity(1_000));
    let again = bench.step().motors[0].control;
    assert!((again.get() - fresh.get()).abs() < ONE_PERCENT, "{again:?} {fresh:?}");
}

#[test]
fn settings_change_as_a_whole_at_the_next_step_while_running() {
    let mut bench = Bench::<2>::new();
    bench.cps = [1505, 1505];
    for motor in 0..2 {
        bench.configure(motor, with_velocity(Pidf::default()));
        bench.set(motor, velocity(1505));
    }
    // Control 0: full braking in Scheme A, coasting in B.
    assert_eq!(bench.settle().drives(), [Drive::BRAKE; 2]);
    bench.configure(1, Settings { scheme: Scheme::B, ..with_velocity(Pidf::default()) });
    assert_eq!(bench.step().drives(), [Drive::BRAKE, Drive::COAST]);
}

#[test]
fn a_command_for_a_motor_that_is_not_there_changes_nothing() {
    let mut bench = Bench::<2>::new();
    let command = Command { motor: 2, action: Action::Set(Setpoint::ConstantPower(Control::MAX)) };
    assert_eq!(bench.hub.apply(command), Err(RangeError::Motor));
    assert_eq!(bench.step().drives(), [Drive::COAST; 2]);
}

#[test]
fn missed_ticks_are_counted() {
    let mut bench = Bench::<1>::new();
    bench.hub.note_missed(3);
    bench.hub.note_missed(u32::MAX);
    assert_eq!(bench.step().missed, u32::MAX);
}

fn any_setpoint() -> impl Strategy<Value = Setpoint> {
    prop_oneof![
        Just(Setpoint::Disabled),
        any::<i16>().prop_map(|p| Setpoint::ConstantPower(Control::new(p))),
        any::<i32>().prop_map(velocity),
        (any::<i32>(), any::<u16>(), any::<i32>()).prop_map(|(t, tol, limit)| position(t, tol, limit)),
    ]
}

/// Whatever a neighbour's encoder does: position if it has not failed, age of its edge, age of the sample.
type Neighbour = (Option<i32>, u64, u64, Setpoint);

proptest! {
    #[test]
    fn one_motors_troubles_never_show_in_another(
        own in any_setpoint(),
        own_positions in prop::collection::vec(any::<i16>(), 12),
        neighbours in prop::collection::vec(
            (any::<Option<i32>>(), 0u64..100_000, 0u64..100_000, any_setpoint()), 12),
    ) {
        let run = |neighbours: &[Neighbour]| {
            let mut hub = Hub::new([settings(); 2], Period::DEFAULT);
            hub.apply(Command { motor: 0, action: Action::Set(own) }).expect("motor");
            own_positions.iter().zip(neighbours).enumerate().map(|(n, (&position, neighbour))| {
                let now = (n as u64 + 10) * TICK;
                let (other, edge_age, age, setpoint) = *neighbour;
                hub.apply(Command { motor: 1, action: Action::Set(setpoint) }).expect("motor");
                let battery = Some(Battery::good(Millivolts::new(12_000), Micros::new(now)));
                let readings = [
                    Some(Reading { position: position.into(), edge_at: Micros::new(now), at: Micros::new(now) }),
                    other.map(|position| Reading {
                        position,
                        edge_at: Micros::new(now - edge_age),
                        at: Micros::new(now - age),
                    }),
                ];
                hub.step(&Inputs { now: Micros::new(now), readings, battery }).motors[0]
            }).collect::<Vec<_>>()
        };
        let quiet = vec![(Some(0), 0, 0, Setpoint::Disabled); 12];
        prop_assert_eq!(run(&neighbours), run(&quiet));
    }
}

#[test]
fn a_motor_in_full_flight_that_passes_its_target_is_not_settled() {
    let mut bench = Bench::<1>::new();
    bench.cps = [2_000];
    // The tolerance is so wide that the motor takes a second to pass.
    bench.set(0, position(1_000, 1_000, 2_000));
    for _ in 0..19 {
        let report = bench.step().motors[0];
        assert!((0..=2_000).contains(&report.position), "within tolerance");
        assert!(!report.settled, "{report:?}");
    }
}

#[test]
fn a_disabled_motor_that_stands_on_its_target_is_not_settled() {
    let mut bench = Bench::<1>::new();
    bench.set(0, position(0, 5, 700));
    assert!(bench.settle().motors[0].settled);
    bench.set(0, Setpoint::Disabled);
    assert!(!bench.settle().motors[0].settled);
}

#[test]
fn a_snapshot_says_the_number_of_the_newest_command_that_it_includes() {
    let mut bench = Bench::<2>::new();
    assert_eq!(bench.step().commands, 0);
    bench.set(0, velocity(100));
    bench.set(1, velocity(100));
    assert_eq!(bench.step().commands, 2);
    let no_such_motor = Command { motor: 2, action: Action::Set(Setpoint::Disabled) };
    assert!(bench.hub.apply(no_such_motor).is_err());
    let snapshot = bench.step();
    assert_eq!(snapshot.commands, 3, "a refused command is counted, or its sender would wait for ever");
    assert!(snapshot.includes(3) && snapshot.includes(1) && !snapshot.includes(4));
    let wrapped = Snapshot { commands: 1, ..snapshot };
    assert!(wrapped.includes(u32::MAX) && !wrapped.includes(2));
}
