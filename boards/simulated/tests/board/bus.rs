//! A bus that cannot take the energy of braking motors.

use motor_hub::bridge::{Drive, Mode};
use motor_hub::model::battery::Battery;
use motor_hub::model::si::{Ohms, Volts};
use motor_hub::supply::DrawStage;
use simulated::hardware::MOTORS;
use simulated::scenario::Scenario;
use simulated::without_tasks;

/// A scenario of some motors of one kind on 12 V behind 1000 uF.
struct Run<'a> {
    motors: usize,
    bus: &'a str,
    motor: &'a str,
    seconds: f64,
}

/// The README's winch, which its load begins to drive with 0.8 N m at 2 s.
const WINCH: &str = r#"
motor = "AM 60 A"
load = { inertia_kg_m2 = 0.05 }
setpoints = [{ at_s = 0.5, velocity_cps = 1360 }]
torques = [{ at_s = 2.0, torque_nm = 0.8 }]
"#;

/// The load in [`WINCH`].
const LOAD: &str = "torques = [{ at_s = 2.0, torque_nm = 0.8 }]";

/// A motor with a flywheel that slows down from 80 to 30 % of its free speed.
const FLYWHEEL: &str = r#"
motor = "AM 20 A"
load = { inertia_kg_m2 = 0.006 }
setpoints = [{ at_s = 0.5, velocity_cps = 2330 }, { at_s = 3.0, velocity_cps = 875 }]
"#;

const SINKS: &str = "capacitance_f = 0.001";
const ONE_WAY: &str = "capacitance_f = 0.001\none_way = true\nburn_between_v = [14.0, 15.5]";
const UNLIMITED: &str = "capacitance_f = 0.001\none_way = true\nburn_between_v = [23.8, 24.0]";

/// Measurements of a run.
#[derive(Debug, Default)]
struct Measured {
    /// Voltage of the bus at every millisecond.
    bus: Vec<f64>,
    speeds: Vec<Vec<f64>>,
    highest_v: f64,
    coasted: bool,
    /// Largest number of motors that changed from a short to driving in the same millisecond between two ticks.
    most_at_once: usize,
    shut_down: bool,
    returned_j: f64,
    dissipated_j: f64,
}

impl Run<'_> {
    fn scenario(&self, period_ms: u32) -> Scenario {
        let motors: String =
            (0..self.motors).map(|n| format!("[[motors]]\nlabel = \"{n}\"{}", self.motor)).collect();
        let text = format!(
            "name = \"bus\"\nduration_s = {}\ncontrol_period_ms = {period_ms}\n\
             [battery]\nemf_v = 12\nresistance_ohm = 0.05\n[bus]\n{}\n{motors}",
            self.seconds, self.bus
        );
        Scenario::parse("bus.toml", &text).expect("valid")
    }

    fn measure(&self, from_ms: u64) -> Measured {
        self.measure_at(50, from_ms)
    }

    fn measure_at(&self, period_ms: u32, from_ms: u64) -> Measured {
        let mut measured = Measured { speeds: vec![Vec::new(); self.motors], ..Measured::default() };
        let mut before = [Drive::COAST; MOTORS];
        without_tasks::run(&self.scenario(period_ms), |moment| {
            measured.bus.push(moment.view.battery_v);
            for (speeds, (speed, _)) in measured.speeds.iter_mut().zip(&moment.view.motors) {
                speeds.push(*speed);
            }
            if moment.ms > from_ms {
                measured.coasted |=
                    moment.drives.iter().take(self.motors).any(|&drive| drive == Drive::COAST);
            }
            let pairs = before.iter().zip(moment.drives);
            let ended = |(was, is): &(&Drive, &Drive)| **was == Drive::BRAKE && is.mode == Mode::Cw98;
            if !moment.ms.is_multiple_of(period_ms.into()) {
                measured.most_at_once = measured.most_at_once.max(pairs.filter(ended).count());
            }
            before = *moment.drives;
            measured.highest_v = moment.view.highest_v;
            measured.shut_down |= moment.view.shut_down > 0;
            measured.returned_j = moment.snapshot.returned.get() as f64 / 1e6;
            measured.dissipated_j = moment.snapshot.dissipated.get() as f64 / 1e6;
        })
        .expect("it runs");
        measured
    }
}

/// Lowest and highest value from a time in milliseconds on.
fn extremes(values: &[f64], from_ms: usize) -> (f64, f64) {
    values[from_ms..].iter().fold((f64::MAX, f64::MIN), |(low, high), &v| (low.min(v), high.max(v)))
}

/// Milliseconds after the step at 3 s until the speed stays within 2 % of the larger of both speeds.
fn settled_ms(speeds: &[f64]) -> usize {
    let outside = |speed: &f64| (speed - 875.0).abs() > 0.02 * 2330.0;
    speeds[3_000..].iter().rposition(outside).map_or(0, |last| last + 1)
}

const UPPER_V: f64 = 15.5;

#[test]
fn without_limits_winches_lift_the_bus_until_their_bridges_open_and_they_run_away() {
    for motors in [1, 4] {
        let measured = Run { motors, bus: UNLIMITED, motor: WINCH, seconds: 4.0 }.measure(2_000);
        assert!(measured.highest_v > 20.0, "{motors}: {}", measured.highest_v);
        let above = measured.bus.iter().position(|&v| v > 18.0).expect("it rises");
        assert!(above < 2_150, "{motors}: within 150 ms, not {above}");
    }
    let four = Run { motors: 4, bus: UNLIMITED, motor: WINCH, seconds: 8.0 }.measure(2_000);
    assert!(four.shut_down);
    assert!(*four.speeds[0].last().expect("ran") > 4_000.0, "they run away");
}

#[test]
fn winches_on_a_bus_that_cannot_sink_are_held_and_the_bus_stays_below_its_upper_limit() {
    for motors in [1, 4] {
        let measured = Run { motors, bus: ONE_WAY, motor: WINCH, seconds: 8.0 }.measure(2_000);
        assert!(measured.highest_v <= UPPER_V, "{motors}: {} V", measured.highest_v);
        assert!(!measured.coasted && !measured.shut_down, "{motors}: no motor that brakes coasts");
        assert_eq!(measured.most_at_once, 1, "{motors}: windings give back their energy one after the other");
        for speeds in &measured.speeds {
            // At this time the regulator has estimated the load.
            let (low, high) = extremes(speeds, 2_250);
            assert!(low > 0.98 * 1360.0 && high < 1.02 * 1360.0, "{motors}: {low} to {high} counts/s");
        }
    }
}

#[test]
fn winches_are_held_at_every_period_when_unknown_and_by_real_bridges() {
    let real = &format!("{WINCH}bridge = \"vnh5019\"\n");
    let unknown = &format!("{WINCH}configured = \"nothing\"\n");
    for (period_ms, motor) in [(1, WINCH), (10, real), (10, unknown), (50, real), (100, real)] {
        let measured = Run { motors: 4, bus: ONE_WAY, motor, seconds: 6.0 }.measure_at(period_ms, 2_000);
        assert!(
            measured.highest_v <= UPPER_V && !measured.coasted,
            "{period_ms} ms: {} V",
            measured.highest_v
        );
        let (low, high) = extremes(&measured.speeds[3], 2_500);
        assert!(low > 0.98 * 1360.0 && high < 1.02 * 1360.0, "{period_ms} ms: {low} to {high} counts/s");
    }
}

#[test]
fn winches_are_held_after_a_contactor_has_opened_while_they_brake() {
    for motors in [1, 4] {
        let opens = "capacitance_f = 0.001\nopens_at_s = 3.013\nburn_between_v = [14.0, 15.5]";
        let measured = Run { motors, bus: opens, motor: WINCH, seconds: 6.0 }.measure(2_000);
        assert!(measured.highest_v <= UPPER_V, "{motors}: {} V", measured.highest_v);
        let (_, fastest) = extremes(&measured.speeds[0], 2_500);
        assert!(fastest < 1.02 * 1360.0, "{motors}: {fastest} counts/s");
    }
}

#[test]
fn a_step_down_settles_as_soon_as_on_a_battery_that_sinks() {
    for motors in [1, 4] {
        let step = |bus| Run { motors, bus, motor: FLYWHEEL, seconds: 5.0 }.measure(3_000);
        let (sinks, one_way) = (step(SINKS), step(ONE_WAY));
        let [on_battery, on_supply] = [&sinks, &one_way].map(|measured| settled_ms(&measured.speeds[0]));
        assert!(on_supply * 10 <= on_battery * 11, "{motors}: {on_supply} ms, {on_battery} ms on a battery");
        assert!(one_way.highest_v <= UPPER_V, "{motors}: {} V", one_way.highest_v);
        assert!(!one_way.coasted, "{motors}: no motor that brakes coasts");
        assert!(sinks.highest_v < 12.2, "{motors}: {} V", sinks.highest_v);
    }
}

#[test]
fn motors_that_all_begin_to_brake_at_once_stay_below_the_upper_limit_between_two_samples() {
    let scheme_c = &format!("{FLYWHEEL}scheme = \"C\"\n");
    let unknown = &format!("{FLYWHEEL}configured = \"nothing\"\n");
    let real = &format!("{FLYWHEEL}scheme = \"C\"\nbridge = \"vnh5019\"\n");
    for (period_ms, motor) in [(1, scheme_c), (1, real), (50, scheme_c), (50, unknown), (100, unknown)] {
        let measured = Run { motors: 4, bus: ONE_WAY, motor, seconds: 5.0 }.measure_at(period_ms, 3_000);
        assert!(measured.highest_v <= UPPER_V, "{period_ms} ms: {} V", measured.highest_v);
        assert!(!measured.coasted && !measured.shut_down, "{period_ms} ms: no motor that brakes coasts");
    }
}

#[test]
fn a_heavy_flywheel_that_is_braked_stays_below_the_upper_limit() {
    let heavy = WINCH.replace("0.05", "0.2").replace(LOAD, "");
    let heavy =
        &heavy.replace("velocity_cps = 1360 }", "velocity_cps = 2400 }, { at_s = 4.0, velocity_cps = 600 }");
    let measured = Run { motors: 4, bus: ONE_WAY, motor: heavy, seconds: 7.0 }.measure(4_000);
    assert!(measured.highest_v <= UPPER_V, "{} V", measured.highest_v);
    assert!((measured.speeds[0].last().expect("ran") - 600.0).abs() < 20.0);
}

#[test]
fn a_motor_that_its_load_drives_on_a_battery_above_14_volts_keeps_its_mean_speed() {
    for (motor, torque_nm, cps) in [("AM 20 A", 0.15, 1_500), ("AM 60 A", 0.8, 816)] {
        for period_ms in [5, 10, 50] {
            let text = format!(
                "name = \"full\"\nduration_s = 12\ncontrol_period_ms = {period_ms}\n\
                 [battery]\nemf_v = 14.6\nresistance_ohm = 0.05\n[[motors]]\nlabel = \"m\"\nmotor = \"{motor}\"\n\
                 load = {{ inertia_kg_m2 = 0.001, torque_nm = {torque_nm} }}\n\
                 setpoints = [{{ at_s = 0, velocity_cps = {cps} }}]"
            );
            let scenario = Scenario::parse("full.toml", &text).expect("valid");
            let mut speeds = Vec::new();
            without_tasks::run(&scenario, |moment| {
                if moment.ms >= 4_000 {
                    speeds.push(moment.view.motors[0].0);
                }
            })
            .expect("it runs");
            let mean = speeds.iter().sum::<f64>() / speeds.len() as f64;
            let error = mean / f64::from(cps) - 1.0;
            assert!(error.abs() < 0.01, "{motor}, {period_ms} ms: {mean:.0} of {cps} counts/s");
        }
    }
}

#[test]
fn the_snapshot_reports_returned_and_dissipated_energy() {
    let run = |bus| Run { motors: 1, bus, motor: WINCH, seconds: 8.0 };
    let sinks = run(SINKS).measure(2_000);
    let reported = sinks.returned_j;
    // Returned energy according to the model, from the trace of the same run.
    let trace = crate::run_tasks(&run(SINKS).scenario(50));
    let truly: f64 = trace.motor(0).map(|(_, sample)| sample.flow.energy_to_battery.0).sum();
    assert!((reported - truly).abs() < 0.15 * truly, "{reported} J reported, {truly} J returned");
    let one_way = run(ONE_WAY).measure(2_000);
    assert!(one_way.returned_j < 0.25 * reported, "{} J", one_way.returned_j);
    assert!(
        one_way.dissipated_j > 1.5 * sinks.dissipated_j,
        "{} J, {} J",
        one_way.dissipated_j,
        sinks.dissipated_j
    );
}

#[test]
fn a_weak_battery_is_derated_in_few_stages_and_stays_above_the_voltage_at_which_bridges_open() {
    // A weak battery of 7.6 V: four starting motors would pull the voltage down to 3 V.
    let motor = &WINCH.replace("1360", "1300").replace(LOAD, "");
    let mut scenario = Run { motors: 4, bus: SINKS, motor, seconds: 8.0 }.scenario(50);
    scenario.battery = Battery { emf: Volts(7.6), resistance: Ohms(0.5) };
    let (mut stages, mut speed, mut opened) = (Vec::new(), 0.0, 0);
    without_tasks::run(&scenario, |moment| {
        if moment.ms > 100 && stages.last() != Some(&moment.snapshot.draw_stage) {
            stages.push(moment.snapshot.draw_stage);
        }
        opened = opened.max(moment.view.shut_down);
        speed = moment.view.motors[0].0;
    })
    .expect("it runs");
    assert_eq!(opened, 0, "no bridge opens on its own");
    let draws_nothing =
        [DrawStage::Cutoff, DrawStage::Overvoltage].iter().any(|stage| stages.contains(stage));
    assert!(!draws_nothing && stages.len() <= 3, "{stages:?}");
    assert!(speed > 1_200.0, "slowly reached: {speed} counts/s");
}

#[test]
fn a_moment_shows_the_commands_of_the_bridges_after_a_change_within_a_millisecond() {
    let run = Run { motors: 1, bus: ONE_WAY, motor: WINCH, seconds: 3.0 };
    let (mut before, mut stale_ms) = ((0.0, Drive::BRAKE), Vec::new());
    without_tasks::run(&run.scenario(50), |moment| {
        let (bus_v, drive) = before;
        // The battery gives no current to a bus above 13 V, so the voltage changes unless the bridge shorts the motor.
        if bus_v > 13.0 && drive != Drive::BRAKE && moment.view.battery_v == bus_v {
            stale_ms.push(moment.ms);
        }
        before = (moment.view.battery_v, moment.drives[0]);
    })
    .expect("it runs");
    assert!(
        stale_ms.is_empty(),
        "the bridge shorts its motor, but another command is shown: {stale_ms:?} ms"
    );
}
