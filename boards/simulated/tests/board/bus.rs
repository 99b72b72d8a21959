//! A bus that cannot take the energy of braking motors.

use motor_hub::bridge::{Drive, Mode};
use motor_hub::supply::DrawStage;
use simulated::hardware::MOTORS;
use simulated::scenario::Scenario;
use simulated::without_tasks;

/// A scenario of some motors of one kind on 12 V behind 1000 uF.
struct Run {
    motors: usize,
    bus: &'static str,
    motor: &'static str,
    seconds: f64,
}

/// The README's winch, which its load begins to drive with 0.8 N m at 2 s.
const WINCH: &str = r#"
motor = "AM 60 A"
load = { inertia_kg_m2 = 0.05 }
setpoints = [{ at_s = 0.5, velocity_cps = 1360 }]
torques = [{ at_s = 2.0, torque_nm = 0.8 }]
"#;

/// A motor with a flywheel that slows down from 80 to 30 % of its free speed.
const FLYWHEEL: &str = r#"
motor = "AM 20 A"
load = { inertia_kg_m2 = 0.006 }
setpoints = [{ at_s = 0.5, velocity_cps = 2330 }, { at_s = 3.0, velocity_cps = 875 }]
"#;

const SINKS: &str = "capacitance_f = 0.001";
const ONE_WAY: &str = "capacitance_f = 0.001\none_way = true\nburn_between_v = [14.0, 15.5]";
const UNGUARDED: &str = "capacitance_f = 0.001\none_way = true\nburn_between_v = [23.8, 24.0]";

/// Measurements of a run.
#[derive(Debug, Default)]
struct Seen {
    /// Voltage of the bus at every millisecond.
    bus: Vec<f64>,
    speeds: Vec<Vec<f64>>,
    highest_v: f64,
    coasted: bool,
    /// Motors that went over from a short to driving in the same millisecond between two ticks.
    most_at_once: usize,
    shut_down: bool,
    returned_j: f64,
    burnt_j: f64,
}

impl Run {
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

    fn see(&self, from_ms: u64) -> Seen {
        self.see_every(50, from_ms)
    }

    fn see_every(&self, period_ms: u32, from_ms: u64) -> Seen {
        let mut seen = Seen { speeds: vec![Vec::new(); self.motors], ..Seen::default() };
        let mut before = [Drive::COAST; MOTORS];
        without_tasks::run(&self.scenario(period_ms), |moment| {
            seen.bus.push(moment.battery_v);
            for (speeds, (speed, _)) in seen.speeds.iter_mut().zip(moment.motors) {
                speeds.push(*speed);
            }
            if moment.ms > from_ms {
                seen.coasted |= moment.drives.iter().take(self.motors).any(|&drive| drive == Drive::COAST);
            }
            let pairs = before.iter().zip(moment.drives);
            let ended = |(was, is): &(&Drive, &Drive)| **was == Drive::BRAKE && is.mode == Mode::Cw98;
            if !moment.ms.is_multiple_of(period_ms.into()) {
                seen.most_at_once = seen.most_at_once.max(pairs.filter(ended).count());
            }
            before = *moment.drives;
            seen.highest_v = moment.highest_v;
            seen.shut_down |= moment.shut_down > 0;
            seen.returned_j = moment.snapshot.bus.returned.get() as f64 / 1e6;
            seen.burnt_j = moment.snapshot.bus.dissipated.get() as f64 / 1e6;
        })
        .expect("it runs");
        seen
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
fn without_the_guard_winches_lift_the_bus_until_their_bridges_let_go_and_they_run_away() {
    for motors in [1, 4] {
        let seen = Run { motors, bus: UNGUARDED, motor: WINCH, seconds: 4.0 }.see(2_000);
        assert!(seen.highest_v > 20.0, "{motors}: {}", seen.highest_v);
        let above = seen.bus.iter().position(|&v| v > 18.0).expect("it rises");
        assert!(above < 2_150, "{motors}: within 150 ms, not {above}");
    }
    let four = Run { motors: 4, bus: UNGUARDED, motor: WINCH, seconds: 8.0 }.see(2_000);
    assert!(four.shut_down);
    assert!(*four.speeds[0].last().expect("ran") > 4_000.0, "nothing holds them");
}

#[test]
fn winches_on_a_bus_that_cannot_sink_are_held_and_the_bus_stays_below_its_upper_limit() {
    for motors in [1, 4] {
        let seen = Run { motors, bus: ONE_WAY, motor: WINCH, seconds: 8.0 }.see(2_000);
        assert!(seen.highest_v <= UPPER_V, "{motors}: {} V", seen.highest_v);
        assert!(!seen.coasted && !seen.shut_down, "{motors}: a motor that brakes is not let go");
        assert_eq!(seen.most_at_once, 1, "{motors}: windings give back their energy one after the other");
        for speeds in &seen.speeds {
            // The regulator has found the load by then.
            let (low, high) = extremes(speeds, 2_250);
            assert!(low > 0.98 * 1360.0 && high < 1.02 * 1360.0, "{motors}: {low} to {high} counts/s");
        }
    }
}

#[test]
fn winches_are_held_so_at_every_period_when_unknown_and_by_bridges_that_take_their_time() {
    let real: &'static str = format!("{WINCH}bridge = \"vnh5019\"\n").leak();
    let unknown: &'static str = format!("{WINCH}configured = \"nothing\"\n").leak();
    for (period_ms, motor) in [(1, WINCH), (10, real), (10, unknown), (50, real), (100, real)] {
        let seen = Run { motors: 4, bus: ONE_WAY, motor, seconds: 6.0 }.see_every(period_ms, 2_000);
        assert!(seen.highest_v <= UPPER_V && !seen.coasted, "{period_ms} ms: {} V", seen.highest_v);
        let (low, high) = extremes(&seen.speeds[3], 2_500);
        assert!(low > 0.98 * 1360.0 && high < 1.02 * 1360.0, "{period_ms} ms: {low} to {high} counts/s");
    }
}

#[test]
fn a_contactor_that_opens_in_mid_braking_leaves_winches_held() {
    for motors in [1, 4] {
        let opens = "capacitance_f = 0.001\nopens_at_s = 3.013\nburn_between_v = [14.0, 15.5]";
        let seen = Run { motors, bus: opens, motor: WINCH, seconds: 6.0 }.see(2_000);
        assert!(seen.highest_v <= UPPER_V, "{motors}: {} V", seen.highest_v);
        let (_, fastest) = extremes(&seen.speeds[0], 2_500);
        assert!(fastest < 1.02 * 1360.0, "{motors}: {fastest} counts/s");
    }
}

#[test]
fn a_step_down_settles_as_soon_as_on_a_battery_that_sinks() {
    for motors in [1, 4] {
        let step = |bus| Run { motors, bus, motor: FLYWHEEL, seconds: 5.0 }.see(3_000);
        let (sinks, one_way) = (step(SINKS), step(ONE_WAY));
        let [on_battery, on_supply] = [&sinks, &one_way].map(|seen| settled_ms(&seen.speeds[0]));
        assert!(on_supply * 10 <= on_battery * 11, "{motors}: {on_supply} ms, {on_battery} ms on a battery");
        assert!(one_way.highest_v <= UPPER_V, "{motors}: {} V", one_way.highest_v);
        assert!(!one_way.coasted, "{motors}: a motor that brakes is not let go");
        assert!(sinks.highest_v < 12.2, "{motors}: {} V", sinks.highest_v);
    }
}

#[test]
fn motors_that_all_begin_to_brake_at_once_stay_below_the_upper_limit_between_two_looks() {
    let scheme_c: &'static str = format!("{FLYWHEEL}scheme = \"C\"\n").leak();
    let unknown: &'static str = format!("{FLYWHEEL}configured = \"nothing\"\n").leak();
    let real: &'static str = format!("{FLYWHEEL}scheme = \"C\"\nbridge = \"vnh5019\"\n").leak();
    for (period_ms, motor) in [(1, scheme_c), (1, real), (50, scheme_c), (50, unknown), (100, unknown)] {
        let seen = Run { motors: 4, bus: ONE_WAY, motor, seconds: 5.0 }.see_every(period_ms, 3_000);
        assert!(seen.highest_v <= UPPER_V, "{period_ms} ms: {} V", seen.highest_v);
        assert!(!seen.coasted && !seen.shut_down, "{period_ms} ms: a motor that brakes is not let go");
    }
}

#[test]
fn a_heavy_flywheel_that_is_braked_stays_below_the_upper_limit() {
    let heavy = WINCH.replace("0.05", "0.2").replace("torques = [{ at_s = 2.0, torque_nm = 0.8 }]", "");
    let heavy: &'static str = heavy
        .replace("velocity_cps = 1360 }", "velocity_cps = 2400 }, { at_s = 4.0, velocity_cps = 600 }")
        .leak();
    let seen = Run { motors: 4, bus: ONE_WAY, motor: heavy, seconds: 7.0 }.see(4_000);
    assert!(seen.highest_v <= UPPER_V, "{} V", seen.highest_v);
    assert!((seen.speeds[0].last().expect("ran") - 600.0).abs() < 20.0);
}

#[test]
fn the_snapshot_tells_what_went_back_and_what_was_burnt() {
    let run = |bus| Run { motors: 1, bus, motor: WINCH, seconds: 8.0 };
    let sinks = run(SINKS).see(2_000);
    let reported = sinks.returned_j;
    // Returned energy according to the model, from the trace of the same run.
    let trace = simulated::sim::run(&run(SINKS).scenario(50), &mut |_| ()).expect("it runs");
    let truly: f64 = trace.motor(0).map(|(_, sample)| sample.flow.energy_to_battery.0).sum();
    assert!((reported - truly).abs() < 0.15 * truly, "{reported} J reported, {truly} J returned");
    let one_way = run(ONE_WAY).see(2_000);
    assert!(one_way.returned_j < 0.25 * reported, "{} J", one_way.returned_j);
    assert!(one_way.burnt_j > 1.5 * sinks.burnt_j, "{} J, {} J", one_way.burnt_j, sinks.burnt_j);
}

#[test]
fn a_battery_near_its_end_is_derated_and_neither_flickers_nor_falls_to_where_bridges_open() {
    // A weak battery of 7.6 V: four starting motors would pull the voltage down to 3 V.
    let motors: String = (0..4)
        .map(|n| {
            format!(
                "[[motors]]\nlabel = \"{n}\"\nmotor = \"AM 60 A\"\nload = {{ inertia_kg_m2 = 0.05 }}\n\
                 setpoints = [{{ at_s = 0.5, velocity_cps = 1300 }}]\n"
            )
        })
        .collect();
    let text = format!(
        "name = \"low\"\nduration_s = 8\n[battery]\nemf_v = 7.6\nresistance_ohm = 0.5\n\
         [bus]\ncapacitance_f = 0.001\n{motors}"
    );
    let scenario = Scenario::parse("low.toml", &text).expect("valid");
    let (mut stages, mut speed, mut opened) = (Vec::new(), 0.0, 0);
    without_tasks::run(&scenario, |moment| {
        if moment.ms > 100 && stages.last() != Some(&moment.snapshot.bus.stage) {
            stages.push(moment.snapshot.bus.stage);
        }
        opened = opened.max(moment.shut_down);
        speed = moment.motors[0].0;
    })
    .expect("it runs");
    assert_eq!(opened, 0, "no bridge opens for want of voltage");
    assert!(!stages.contains(&DrawStage::Cut) && stages.len() <= 3, "{stages:?}");
    assert!(speed > 1_200.0, "it gets there, in its time: {speed} counts/s");
}
