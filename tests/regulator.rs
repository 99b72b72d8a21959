//! The estimate of a motor's motion from samples at irregular times, and regulation with a wrong inertia.

mod common;

use common::{
    BATTERY, Bench, Cable, NO_STOPS, ScriptedMotor, configured, configured_and_unknown, free_cps, inertia,
    motor, neverest_60, plant, position, rotors, rough, stall_torque, unknown, velocity, winding,
};
use motor_hub::braking::{Scheme, Winding};
use motor_hub::model::catalogue::Motor;
use motor_hub::model::friction::Friction;
use motor_hub::model::load::Load;
use motor_hub::model::si::NewtonMetres;
use motor_hub::motor::{Report, Setpoint, Settings};
use motor_hub::regulator::{Coefficients, Dynamics, Kind};
use motor_hub::units::{
    AccelerationPerVolt, Control, CountsPerSecond, DecayRate, Micros, Milliamperes, Millivolts, Period,
};

/// A NeveRest 60 with about its own inertia.
fn known() -> Settings {
    let dynamics = Dynamics {
        gain: AccelerationPerVolt::from_f64(2_500.0).expect("in range"),
        decay: DecayRate::from_f64(10.0).expect("in range"),
        friction: Millivolts::new(0),
    };
    Settings { dynamics: Some(dynamics), ..Settings::new(Winding::NEVEREST_60) }
}

/// Last report of a motor that turns at a constant speed for two seconds. The times of its samples are off by `jitter`
/// microseconds. Samples of `left_out` milliseconds are missing.
fn turning(cps: f64, jitter: impl Fn(u64) -> i64, left_out: impl Fn(u64) -> bool) -> Report {
    let mut motor = ScriptedMotor::new(known(), Period::DEFAULT);
    motor.set(velocity(cps as i32));
    let mut report = Report::INITIAL;
    for ms in 0..2_000u64 {
        let at = (1_000_000u64 + 1_000 * ms).saturating_add_signed(jitter(ms));
        if !left_out(ms) {
            motor.sample_at(Micros::new(at), (0.5 + cps * (at as f64 * 1e-6 - 1.0)).floor() as i32);
        }
        if ms % 50 == 0 {
            report = motor.step(Some(12_000));
        }
    }
    assert_eq!(report.regulator, Kind::Model);
    report
}

#[test]
fn a_motor_that_is_faster_than_the_ticks_slows_down_without_passing_its_speed() {
    for motor in motor_hub::model::catalogue::motors() {
        let settings = configured(&motor, &Load::NONE);
        let Dynamics { gain, decay, .. } = settings.dynamics.expect("configured");
        if decay.to_f32() < 8.0 {
            continue;
        }
        let free = f64::from(gain.to_f32() / decay.to_f32()) * BATTERY;
        for phase_ms in [1, 25, 49] {
            let mut bench = Bench::one(settings, plant(motor, Load::NONE), 50);
            bench.set(0, velocity((0.8 * free) as i32));
            bench.run_ms(2_000 + phase_ms);
            let mut before = 0.8;
            for share in [0.3, 0.1] {
                let (cps, step) = (share * free, (before - share) * free);
                bench.set(0, velocity(cps as i32));
                let lowest = -bench.highest(500, |bench| -bench.speed(0));
                let (highest, end) = (bench.highest(1_000, |bench| bench.speed(0)), bench.speed(0));
                let what = format!("{} to {share} of its free speed {phase_ms} ms after a tick", motor.name);
                assert!(lowest > cps - 0.08 * step - 2.0, "{what}: down to {lowest:.1} of {cps:.1}");
                assert!(highest < cps + 0.05 * step + 2.0, "{what}: still {highest:.1} of {cps:.1}");
                assert!((end - cps).abs() < 0.03 * step + 2.0, "{what}: {end:.1} of {cps:.1} at the end");
                before = share;
            }
        }
    }
}

#[test]
fn samples_that_are_early_or_late_or_missing_tell_the_same_speed() {
    let never = |_| false;
    for cps in [60.0, -333.0, 1_000.0, 2_400.0] {
        for (what, report) in [
            ("on time", turning(cps, |_| 0, never)),
            ("some microseconds off", turning(cps, |ms| (ms * 7 % 31) as i64 - 15, never)),
            ("up to 0.2 ms off", turning(cps, |ms| (ms * 37 % 401) as i64 - 200, never)),
            ("one of five missing", turning(cps, |_| 0, |ms| ms % 5 == 3)),
        ] {
            let found = report.velocity.to_f64();
            assert!((found - cps).abs() < 4.0 + 0.005 * cps.abs(), "{what}: {found} for {cps}");
        }
    }
}

#[test]
fn a_motor_that_has_rolled_out_is_known_to_rest() {
    for friction in [500.0, 2_000.0, 6_000.0] {
        let mut bench = Bench::turned(Settings::new(Winding::NEVEREST_60), [1_000.0]);
        bench.run_ms(500);
        for ms in 500..6_000 {
            bench.axes[0].turned = bench.axes[0].turned.map(|cps| (cps - friction * 1e-3).max(0.0));
            bench.run_ms(1);
            let speed = bench.report().velocity.to_f64();
            assert!(ms < 3_500 || speed.abs() < 0.5, "{speed} counts/s after {ms} ms of {friction}");
        }
    }
}

/// Returns the settings with `factor` times the inertia.
fn with_inertia(mut settings: Settings, factor: f64) -> Settings {
    let dynamics = settings.dynamics.as_mut().expect("configured");
    dynamics.gain =
        AccelerationPerVolt::from_f64(f64::from(dynamics.gain.to_f32()) / factor).expect("in range");
    dynamics.decay = DecayRate::from_f64(f64::from(dynamics.decay.to_f32()) / factor).expect("in range");
    settings
}

#[test]
fn a_held_position_rests_also_with_too_little_inertia_configured() {
    let motor = motor("AM 40 C");
    let settings = with_inertia(configured(&motor, &Load::NONE), 0.7);
    let mut within_one = 0;
    for period_ms in [1, 10, 20, 50, 100] {
        for torque in [0.2, 0.23, 0.26, 0.29, 0.31, 0.34, 0.37, 0.4] {
            let mut bench = Bench::one(settings, plant(motor, Load::NONE), period_ms);
            bench.axes[0].torque = -torque;
            bench.set(0, position(500, 5, 1_000));
            bench.run_ms(5_000);
            // In 5 s: the largest distance of the count from its target, the largest speed in counts/s, and the number
            // of changes of the count.
            let (mut farthest, mut fastest, mut changes) = (0.0f64, 0.0f64, 0);
            let mut last = bench.counts(0).floor();
            for _ in 0..5_000 {
                bench.run_ms(1);
                let count = bench.counts(0).floor();
                changes += u32::from(count != last);
                last = count;
                farthest = farthest.max((count - 500.0).abs());
                fastest = fastest.max(bench.speed(0).abs());
            }
            within_one += u32::from(farthest <= 1.0);
            // Before small corrections left the time of the last count alone, a motor was thrown to and fro by 3 counts.
            assert!(
                farthest <= 2.0 && fastest <= 15.0 && changes < 20,
                "{period_ms} ms, {torque} N m: {farthest} counts, {fastest} counts/s, {changes} changes"
            );
        }
    }
    assert!(within_one >= 32, "{within_one} of 40 within one count");
}

#[test]
fn a_motor_that_is_enabled_at_speed_0_while_it_comes_to_rest_is_not_thrown() {
    for name in ["AM 20 A", "AM 40 C", "AM 60 A"] {
        for settings in [unknown, |motor: &Motor| configured(motor, &Load::NONE)] {
            for wait_ms in (0..600).step_by(50) {
                let motor = motor(name);
                let mut bench = Bench::one(settings(&motor), plant(motor, Load::NONE), 50);
                bench.set(0, velocity(900));
                bench.run_ms(3_000 + wait_ms / 4);
                bench.set(0, Setpoint::Disabled);
                while bench.tick().motors[0].velocity.round() != 0 {}
                bench.run_ms(wait_ms);
                bench.set(0, velocity(0));
                let fastest = bench.highest(3_000, |bench| bench.speed(0).abs());
                assert!(fastest <= 15.0, "{name} after {wait_ms} ms: {fastest:.0} counts/s");
            }
        }
    }
}

/// A motor at rest whose friction takes this voltage, and is configured.
fn with_friction(motor: Motor, load: Load, friction_mv: u16, period_ms: u32) -> Bench<1> {
    let mut settings = configured(&motor, &load);
    if let Some(dynamics) = &mut settings.dynamics {
        dynamics.friction = Millivolts::new(friction_mv);
    }
    Bench::one(settings, plant(rough(motor, f64::from(friction_mv) / 1e3), load), period_ms)
}

#[test]
fn a_motor_with_friction_that_turned_without_regulation_keeps_its_speed_when_regulation_begins() {
    for period_ms in [5, 10, 50] {
        for power in [14_000, -14_000] {
            let mut bench = with_friction(neverest_60(), inertia(0.01), 1_440, period_ms);
            bench.set(0, velocity(-300));
            bench.run_ms(1_000);
            bench.set(0, Setpoint::ConstantPower(Control::new(power)));
            bench.run_ms(2_000);
            let speed = bench.speed(0);
            bench.set(0, velocity(speed.round() as i32));
            let farthest = bench.highest(1_000, |bench| (bench.speed(0) - speed).abs());
            assert!(farthest <= 0.03 * speed.abs(), "{period_ms} ms: {farthest:.0} of {speed:.0} counts/s");
        }
    }
}

#[test]
fn a_held_motor_that_breaks_away_from_its_friction_is_not_thrown() {
    let (mut farthest, mut fastest) = (0, 0.0f64);
    for name in ["AM 20 A", "AM 20 B", "AM 60 A"] {
        for (period_ms, friction_mv) in [(10, 360), (10, 960), (50, 360), (50, 960)] {
            for cps in [-500, 300, 1_000, 1_500] {
                let mut bench = with_friction(motor(name), inertia(0.005), friction_mv, period_ms);
                bench.set(0, velocity(cps));
                bench.run_ms(1_000);
                bench.set(0, velocity(0));
                bench.run_ms(3_000);
                let place = bench.report().position;
                for _ in 0..9_000 {
                    bench.run_ms(1);
                    farthest = farthest.max((bench.report().position - place).abs());
                    fastest = fastest.max(bench.speed(0).abs());
                }
            }
        }
    }
    assert!(farthest <= 6 && fastest < 60.0, "{farthest} counts away, {fastest:.0} counts/s");
}

#[test]
fn after_a_rest_a_motor_starts_with_the_voltage_of_its_first_start_in_both_directions() {
    let mut bench = with_friction(motor("AM 60 A"), Load::NONE, 2_000, 10);
    let mut start = |cps| {
        bench.set(0, Setpoint::Disabled);
        bench.run_ms(1_000);
        bench.set(0, velocity(cps));
        let volts = bench.tick().motors[0].voltage.to_volts();
        bench.run_ms(1_000);
        volts
    };
    let [first, again, back] = [300, 300, -300].map(&mut start);
    assert!((again - first).abs() < 0.2 && (back + first).abs() < 0.2, "{first} V, {again} V, {back} V");
}

#[test]
fn a_motor_that_held_a_load_before_it_was_disabled_starts_as_fast_in_both_directions() {
    for period_ms in [10, 50] {
        let after_a_load = |stall_share, cps| {
            let mut bench = with_friction(neverest_60(), inertia(0.01), 1_200, period_ms);
            bench.set(0, position(0, 5, 2_000));
            bench.run_ms(500);
            bench.axes[0].torque = stall_share * stall_torque(&neverest_60());
            bench.run_ms(3_000);
            bench.axes[0].torque = 0.0;
            bench.set(0, Setpoint::Disabled);
            bench.run_ms(1_500);
            bench.set(0, position(0, 5, 2_000));
            bench.run_ms(500);
            bench.set(0, velocity(cps));
            bench.run_ms(50);
            bench.speed(0).abs()
        };
        let speeds = [0.3, -0.3].map(|share| [300, -300].map(|cps| after_a_load(share, cps)));
        let [least, most] = [f64::min, f64::max].map(|of| speeds.as_flattened().iter().copied().reduce(of));
        assert!(least.zip(most).is_some_and(|(least, most)| least > 0.8 * most), "{speeds:.0?} counts/s");
    }
}

/// A NeveRest 60 with three rotors' inertia that gets the set-point of speed 0 while it turns at this speed.
fn braking(cps: i32, friction_mv: u16, period_ms: u32) -> Bench<1> {
    let mut bench = with_friction(neverest_60(), rotors(&neverest_60(), 3.0), friction_mv, period_ms);
    bench.set(0, velocity(cps));
    bench.run_ms(1_500);
    bench.set(0, velocity(0));
    bench
}

#[test]
fn a_motor_that_meets_a_stop_while_it_brakes_to_speed_0_does_not_press_against_the_stop() {
    for (period_ms, cps) in [1, 10, 50, 100].into_iter().flat_map(|ms| [500, -2_300].map(|cps| (ms, cps))) {
        for counts in (2..200).step_by(12) {
            let mut bench = braking(cps, 300, period_ms);
            let (stop, counts) = (bench.counts(0), f64::from(counts));
            bench.axes[0].stops =
                if cps > 0 { (f64::NEG_INFINITY, stop + counts) } else { (stop - counts, f64::INFINITY) };
            bench.run_ms(2_000);
            let volts = bench.report().voltage.to_volts();
            assert!(
                volts.abs() < 2.0,
                "{volts} V at a stop {counts} counts ahead, {period_ms} ms, {cps} counts/s"
            );
        }
    }
}

#[test]
fn a_motor_whose_encoder_is_lost_while_it_brakes_to_speed_0_turns_on_slowly_at_most() {
    for period_ms in [1, 10, 50] {
        for unplugged_ms in (0..=150).step_by(10) {
            let mut bench = braking(2_300, 300, period_ms);
            bench.run_ms(unplugged_ms);
            bench.axes[0].cable = Cable::Unplugged;
            bench.run_ms(3_000);
            let speed = bench.speed(0);
            assert!(
                speed.abs() < 500.0,
                "{speed:.0} counts/s, unplugged after {unplugged_ms} ms, {period_ms} ms"
            );
        }
    }
}

#[test]
fn a_load_that_begins_while_a_motor_brakes_to_speed_0_turns_it_back_by_little() {
    // 3 % of a turn of the output shaft.
    let most_counts = 0.03 * neverest_60().counts_per_rev_output();
    for period_ms in [1, 10, 50, 100] {
        for begins_ms in (0..=240).step_by(20) {
            let mut bench = braking(1_200, 0, period_ms);
            bench.run_ms(begins_ms);
            bench.axes[0].torque = -0.2 * stall_torque(&neverest_60());
            let (mut farthest, mut back) = (f64::NEG_INFINITY, 0.0f64);
            for _ in 0..2_000 {
                bench.run_ms(1);
                farthest = farthest.max(bench.counts(0));
                back = back.max(farthest - bench.counts(0));
            }
            assert!(back < most_counts, "{back:.1} counts back, a load after {begins_ms} ms, {period_ms} ms");
        }
    }
}

#[test]
fn dynamics_with_friction_that_are_configured_while_the_motor_turns_change_the_voltage_by_little() {
    let mut bench = with_friction(motor("AM 60 A"), Load::NONE, 2_000, 10);
    let dynamics = bench.settings[0].dynamics;
    bench.configure(0, |settings| settings.dynamics = None);
    bench.set(0, velocity(1_000));
    bench.run_ms(3_000);
    let before = bench.report().voltage.to_volts();
    bench.configure(0, |settings| settings.dynamics = dynamics);
    let after = bench.tick().motors[0].voltage.to_volts();
    assert!((after - before).abs() < 0.5, "{after} V, before {before} V");
}

#[test]
fn a_motor_with_three_times_its_inertia_configured_does_not_swing_about_its_speed_without_end() {
    for name in ["AM 3.7 A", "AM 20 B", "AM 60 A"] {
        let motor = motor(name);
        let settings = with_inertia(configured(&motor, &Load::NONE), 3.0);
        for period_ms in [2, 10, 50, 100] {
            for share in [0.5, -0.3] {
                let cps = (share * free_cps(&motor)) as i32;
                let mut bench = Bench::one(settings, plant(motor, Load::NONE), period_ms);
                bench.set(0, velocity(cps));
                bench.run_ms(3_000);
                let worst = bench.highest(1_000, |bench| (bench.speed(0) - f64::from(cps)).abs());
                let percent = 100.0 * worst / f64::from(cps.abs());
                assert!(percent <= 2.0, "{name}, {period_ms} ms, {cps} counts/s: {percent:.1} %");
            }
        }
    }
}

/// Loads that alternate for a minute teach a gain that is now too low and now too high. A gain that was raised by mistake
/// must not stay.
#[test]
fn an_unknown_motor_under_alternating_loads_keeps_its_mean_speed_but_for_some_seconds() {
    let motor = motor("AM 60 A");
    for kg_m2 in [0.0, 0.01] {
        for phase in 0..20 {
            let mut bench = Bench::one(unknown(&motor), plant(motor, inertia(kg_m2)), 50);
            bench.place(0, phase as f64 / 20.0, 0.0);
            bench.run_ms(300 + phase);
            bench.set(0, velocity(1_000));
            bench.run_ms(1_500);
            let is_off = |second: &u32| {
                bench.axes[0].torque = if second.is_multiple_of(2) { 0.1 } else { -0.1 };
                bench.run_ms(300);
                let from = bench.counts(0);
                bench.run_ms(700);
                (bench.counts(0) - from - 700.0).abs() > 21.0
            };
            let off = (0..60).filter(is_off).count();
            assert!(off <= 6, "{kg_m2} kg m², phase {phase}: {off} of 60 s");
        }
    }
}

#[test]
fn a_motor_with_too_much_inertia_configured_rests_at_its_position_and_at_speed_0() {
    let mut bad = Vec::new();
    for name in ["AM 3.7 A", "AM 20 A", "AM 60 A"] {
        let motor = motor(name);
        for (factor, period_ms) in [(2.0, 5), (2.0, 50), (3.0, 5), (3.0, 50), (3.0, 100)] {
            let settings = with_inertia(configured(&motor, &Load::NONE), factor);
            let mut bench = Bench::one(settings, plant(motor, Load::NONE), period_ms);
            let cps = (0.3 * free_cps(&motor)) as i32;
            for (what, setpoint) in [("position", position(cps, 5, 2 * cps)), ("speed 0", velocity(0))] {
                bench.set(0, velocity(cps));
                bench.run_ms(1_000);
                bench.set(0, setpoint);
                bench.run_ms(4_000);
                let speed = bench.highest(1_000, |bench| bench.speed(0).abs());
                if speed > 40.0 {
                    bad.push(format!(
                        "{name}, inertia x{factor}, {period_ms} ms, {what}: {speed:.0} counts/s"
                    ));
                }
            }
        }
    }
    assert!(bad.is_empty(), "{} bad:\n{}", bad.len(), bad.join("\n"));
}

#[test]
fn a_held_motor_with_too_much_inertia_configured_rests_with_a_bridge_that_never_brakes() {
    for (name, period_ms) in [("AM 40 C", 20), ("AM 20 A", 50), ("AM 3.7 A", 5)] {
        let motor = motor(name);
        let Settings { dynamics, .. } = with_inertia(configured(&motor, &Load::NONE), 3.0);
        let settings = Settings { dynamics, ..Settings::for_scheme(winding(&motor), Scheme::ForwardReverse) };
        let mut bench = Bench::one(settings, plant(motor, Load::NONE), period_ms);
        let cps = (0.3 * free_cps(&motor)) as i32;
        bench.set(0, position(cps, 5, 2 * cps));
        bench.run_ms(4_000);
        let speed = bench.highest(1_000, |bench| bench.speed(0).abs());
        assert!(speed <= 40.0, "{name}, {period_ms} ms: {speed:.0} counts/s");
    }
}

/// Something that is done with a motor.
type Act = fn(&mut Bench<1>);

#[test]
fn a_motor_that_was_shaken_in_its_position_is_softer_until_its_next_set_point_or_other_coefficients() {
    let motor = neverest_60();
    let stall = stall_torque(&motor);
    // Largest change of the speed at a sudden load, which begins this long after the new set-point.
    let moved_after = |rest_ms: u64, shaken: bool, and_then: Act| {
        let settings = configured(&motor, &Load::NONE);
        let mut bench = Bench::one(settings, plant(motor, Load::NONE), Period::DEFAULT.as_millis());
        bench.set(0, velocity(1_000));
        bench.run_ms(1_000);
        bench.set(0, position(2_000, 5, 2_000));
        bench.run_ms(3_000);
        for ms in 0..1_200 {
            let swing = (std::f64::consts::TAU * 5e-3 * f64::from(ms)).sin();
            bench.axes[0].torque = if shaken { 0.1 * stall * swing } else { 0.0 };
            bench.run_ms(1);
        }
        bench.axes[0].torque = 0.0;
        bench.run_ms(1_000);
        and_then(&mut bench);
        bench.run_ms(rest_ms);
        let before = bench.speed(0);
        bench.axes[0].torque = -0.2 * stall;
        bench.highest(500, |bench| (bench.speed(0) - before).abs())
    };
    // The change depends on when the load begins within a tick, so it is a sum over a tick.
    let moved = |shaken: bool, and_then: Act| {
        (0..10).map(|tenth| moved_after(3_000 + 5 * tenth, shaken, and_then)).sum::<f64>()
    };
    let softer = |and_then| moved(true, and_then) / moved(false, and_then);
    assert!(softer(|_| ()) > 1.2, "{}", softer(|_| ()));
    let next: [(&str, Act); 4] = [
        ("velocity 1000", |bench| bench.set(0, velocity(1_000))),
        ("velocity 0", |bench| bench.set(0, velocity(0))),
        ("position 0", |bench| bench.set(0, position(0, 5, 2_000))),
        ("coefficients", |bench| {
            let coefficients = Coefficients::suggested(bench.settings[0].winding.emf);
            bench.configure(0, |settings| settings.coefficients = Some(coefficients));
            bench.configure(0, |settings| settings.coefficients = None);
        }),
    ];
    for (what, next) in next {
        let times = softer(next);
        assert!(times < 1.1, "{what}: {times:.2} times as far");
    }
}

#[test]
fn an_unknown_motor_that_friction_holds_is_not_thrown_by_a_slow_speed_or_a_small_move() {
    let mut bad = Vec::new();
    for name in ["AM 20 A", "AM 20 B", "AM 60 A"] {
        let motor = motor(name);
        let stall = motor.kt.0 * BATTERY / motor.r.0;
        let friction = Friction::with_coulomb(NewtonMetres(0.08 * stall));
        for period_ms in [10, 50, 100] {
            let mut bench =
                Bench::one(unknown(&motor), plant(Motor { friction, ..motor }, Load::NONE), period_ms);
            bench.set(0, velocity(10));
            let crawl = bench.highest(6_000, |bench| bench.speed(0).abs());
            let mut moves: f64 = 0.0;
            for target in [15, -8, 40] {
                bench.set(0, position(target, 3, 1_000));
                bench.run_ms(3_000);
                bench.set(0, position(target - 2, 3, 1_000));
                moves = moves.max(bench.highest(3_000, |bench| bench.speed(0).abs()));
            }
            // The motor jerks when it breaks away.
            if crawl > 600.0 || moves > 150.0 {
                bad.push(format!("{name}, {period_ms} ms: {crawl:.0} and {moves:.0} counts/s"));
            }
        }
    }
    assert!(bad.is_empty(), "{} bad:\n{}", bad.len(), bad.join("\n"));
}

#[test]
fn the_first_move_of_an_unknown_heavy_motor_goes_at_most_a_tenth_too_far() {
    let motor = neverest_60();
    for period_ms in [10, 50] {
        let mut bench = Bench::one(unknown(&motor), plant(motor, inertia(1.5)), period_ms);
        bench.set(0, position(3_000, 5, 100_000));
        let farthest = bench.highest(15_000, |bench| bench.counts(0));
        assert!(farthest < 3_300.0, "{period_ms} ms: {farthest} counts");
    }
}

#[test]
fn an_unknown_motor_comes_to_rest_after_a_move_that_ended_soon_after_its_start() {
    for (name, times, start, first, run_ms, then) in [
        ("Matrix A", 1.0, 0.1, position(2_491, 20, 2_906), 15, (664, 1_494)),
        ("AM 20 A", 10.0, 0.9, position(914, 20, 1_066), 35, (1_218, 548)),
    ] {
        let motor = motor(name);
        let mut bench = Bench::one(unknown(&motor), plant(motor, rotors(&motor, times)), 10);
        bench.place(0, start, 0.0);
        bench.sample();
        bench.set(0, first);
        bench.run_ms(run_ms);
        bench.set(0, Setpoint::Disabled);
        bench.run_ms(60);
        let target = bench.counts(0).floor() as i32 + then.0;
        bench.set(0, position(target, 5, then.1));
        bench.run_ms(10_000);
        let farthest = bench.highest(3_000, |bench| (bench.counts(0) - f64::from(target)).abs());
        assert!(farthest < 20.0, "{name}: {farthest:.0} counts off");
    }
}

#[test]
fn a_motor_whose_dynamics_are_removed_while_it_starts_comes_to_rest() {
    let motor = motor("Matrix A");
    for period_ms in [10, 50, 100] {
        for run_ms in [60, 150, 250] {
            let mut bench = Bench::one(configured(&motor, &Load::NONE), plant(motor, Load::NONE), period_ms);
            bench.set(0, position(2_600, 20, 3_000));
            bench.run_ms(run_ms);
            bench.configure(0, |settings| settings.dynamics = None);
            let target = bench.counts(0).floor() as i32 - 800;
            bench.set(0, position(target, 5, 1_500));
            bench.run_ms(6_000);
            let farthest = bench.highest(3_000, |bench| (bench.counts(0) - f64::from(target)).abs());
            assert!(farthest < 20.0, "{period_ms} ms, after {run_ms} ms: {farthest:.0} counts off");
        }
    }
}

#[test]
fn what_a_broken_encoder_taught_is_forgotten_at_its_fault() {
    for (name, cable, period_ms) in [
        ("AM 60 A", Cable::OneWire, 50),
        ("AM 60 A", Cable::OneWire, 10),
        ("AM 40 C", Cable::OneWire, 10),
        ("AM 20 A", Cable::Reversed, 10),
        ("AM 40 C", Cable::Reversed, 50),
    ] {
        let motor = motor(name);
        let free = free_cps(&motor);
        let mut bench = Bench::one(unknown(&motor), plant(motor, Load::NONE), period_ms);
        bench.axes[0].cable = cable;
        bench.set(0, velocity((0.16 * free) as i32));
        bench.wait_until(5_000, |bench| bench.report().faults.encoder.is_some()).expect("a fault");
        bench.run_ms(300);
        bench.axes[0].cable = Cable::Plugged;
        bench.set(0, Setpoint::Disabled);
        bench.run_ms(1_500);
        let (target, before) = (0.12 * free, bench.speed(0));
        bench.set(0, velocity(target as i32));
        let peak = bench.highest(3_000, |bench| bench.speed(0));
        let allowed = 1.3 * target.max(before);
        assert!(peak < allowed, "{name}, {cable:?}, {period_ms} ms: {peak:.0} of {allowed:.0} counts/s");
    }
}

#[test]
fn a_broken_encoder_teaches_an_unknown_motor_nothing_lasting_without_regulation() {
    for name in ["AM 60 A", "AM 20 A"] {
        for (cable, period_ms) in
            [(Cable::OneWire, 10), (Cable::OneWire, 100), (Cable::Reversed, 10), (Cable::Reversed, 50)]
        {
            let current = Setpoint::Current {
                current: Milliamperes::new(700),
                speed_limit: CountsPerSecond::new(1_000),
            };
            let identify = Setpoint::Identify { travel_limit: 2_000 };
            for unregulated in [Setpoint::ConstantPower(Control::new(16_000)), current, identify] {
                let motor = motor(name);
                let mut bench = Bench::one(unknown(&motor), plant(motor, Load::NONE), period_ms);
                bench.axes[0].cable = cable;
                bench.set(0, unregulated);
                bench.run_ms(2_000);
                bench.set(0, Setpoint::Disabled);
                bench.run_ms(200);
                bench.axes[0].cable = Cable::Plugged;
                bench.run_ms(1_500);
                bench.set(0, velocity(400));
                let peak = bench.highest(3_000, |bench| bench.speed(0));
                let context = format!("{name}, {cable:?}, {period_ms} ms, {unregulated:?}");
                assert!(peak < 500.0, "{context}: {peak:.0} of 400 counts/s");
            }
        }
    }
}

#[test]
fn a_stop_at_constant_power_or_current_teaches_an_unknown_motor_nothing() {
    let current =
        Setpoint::Current { current: Milliamperes::new(2_000), speed_limit: CountsPerSecond::new(1_000) };
    for name in ["AM 60 A", "AM 20 A"] {
        for period_ms in [1, 10, 50] {
            for (cps, blocked) in [5, 39, 1_000].into_iter().flat_map(|cps| {
                [Setpoint::ConstantPower(Control::MAX), current].map(|blocked| (cps, blocked))
            }) {
                let motor = motor(name);
                let mut bench = Bench::one(unknown(&motor), plant(motor, Load::NONE), period_ms);
                bench.set(0, velocity(cps));
                bench.run_ms(2_000);
                let at = bench.counts(0);
                bench.axes[0].stops = (at - 2.0, at + 2.0);
                bench.set(0, blocked);
                bench.run_ms(600);
                bench.axes[0].stops = NO_STOPS;
                bench.set(0, Setpoint::Disabled);
                bench.run_ms(1_500);
                bench.set(0, velocity(500));
                let peak = bench.highest(1_500, |bench| bench.speed(0));
                let context = format!("{name}, {period_ms} ms, after {cps} counts/s, {blocked:?}");
                assert!(peak < 600.0, "{context}: {peak:.0} of 500 counts/s");
            }
        }
    }
}

#[test]
fn a_load_that_comes_together_with_a_brake_teaches_an_unknown_motor_nothing() {
    for name in ["AM 60 A", "AM 20 A"] {
        for period_ms in [1, 10, 50] {
            let motor = motor(name);
            let (free, stall_current) = (free_cps(&motor), BATTERY / motor.r.0);
            let mut bench = Bench::one(unknown(&motor), plant(motor, Load::NONE), period_ms);
            bench.set(0, velocity((0.3 * free) as i32));
            bench.run_ms(1_000);
            bench.set(0, velocity((-0.1 * free) as i32));
            bench.run_ms(500);
            bench.axes[0].torque = -0.3 * stall_current * motor.kt.0 * motor.gear_ratio * motor.eta;
            bench.set(0, Setpoint::ConstantPower(Control::ZERO));
            bench.run_ms(1_000);
            bench.axes[0].torque = 0.0;
            bench.run_ms(1_000);
            bench.set(0, velocity((0.12 * free) as i32));
            let peak = bench.highest(2_000, |bench| bench.speed(0)) / (0.12 * free);
            assert!(peak < 1.2, "{name}, {period_ms} ms: {peak:.2} of the requested speed");
        }
    }
}

/// Rms of a motor's true speed about its mean.
fn swing(speeds: &[f64]) -> f64 {
    let mean = speeds.iter().sum::<f64>() / speeds.len() as f64;
    (speeds.iter().map(|cps| (cps - mean).powi(2)).sum::<f64>() / speeds.len() as f64).sqrt()
}

#[test]
fn a_load_that_swings_moves_a_regulated_motor_soon_at_most_1_2_times_as_far_as_one_at_constant_power() {
    let (motor, load) = (neverest_60(), inertia(0.05));
    let settings = configured_and_unknown(&motor, &load);
    for (period, settings) in [10, 50].into_iter().flat_map(|period| settings.map(|one| (period, one))) {
        for hz in [0.2, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 10.0, 14.0, 20.0] {
            let mut bench = Bench::new([settings; 2], [0, 1].map(|_| plant(motor, load)), period);
            bench.set(0, velocity(1_360));
            bench.set(1, Setpoint::ConstantPower(Control::new(14_828)));
            let mut speeds = [const { Vec::new() }; 2];
            for ms in 0..20_000 {
                let torque = 0.4 * (std::f64::consts::TAU * hz * f64::from(ms) / 1e3).sin();
                bench.axes.iter_mut().for_each(|axis| axis.torque = torque);
                bench.run_ms(1);
                if ms >= 10_000 {
                    speeds.iter_mut().enumerate().for_each(|(i, speeds)| speeds.push(bench.speed(i)));
                }
            }
            let [regulated, free] = speeds.map(|speeds| swing(&speeds));
            let known = settings.dynamics.is_some();
            let times = regulated / free;
            assert!(times <= 1.2, "{hz} Hz, {period} ms, configured {known}: {times:.2} times as far");
        }
    }
}

#[test]
fn most_motors_settle_with_suggested_coefficients() {
    let (mut swinging, mut all) = (vec![], 0);
    for bare in motor_hub::model::catalogue::motors() {
        for (load, friction) in [(Load::NONE, 0.0), (Load::NONE, 0.5), (rotors(&bare, 20.0), 0.5)] {
            let settings = unknown(&bare);
            let coefficients = Some(Coefficients::suggested(settings.winding.emf));
            let motor = rough(bare, friction);
            let mut bench = Bench::one(Settings { coefficients, ..settings }, plant(motor, load), 50);
            for share in [0.6, 0.2, -0.5] {
                let target = share * free_cps(&bare);
                bench.set(0, velocity(target as i32));
                bench.run_ms(3_000);
                // How often within a second the speed passes from 2 % above its target to 2 % below, or back.
                let (mut side, mut changes) = (0.0, 0);
                for _ in 0..1_000 {
                    bench.run_ms(1);
                    let error = bench.speed(0) - target;
                    if error.abs() > 0.02 * target.abs() && error.signum() != side {
                        (side, changes) = (error.signum(), changes + 1);
                    }
                }
                all += 1;
                if changes > 2 {
                    swinging.push(format!("{} {friction} V {target:.0} counts/s", bare.name));
                }
            }
        }
    }
    assert!(2 * swinging.len() < all, "{} of {all}:\n{}", swinging.len(), swinging.join("\n"));
}
