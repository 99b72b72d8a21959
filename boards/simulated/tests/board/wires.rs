//! A wire of an encoder breaks while its motor turns. The tests measure the time until the hub detects the fault: at
//! every period, at any moment between two ticks, with several loads, for configured and unknown motors.

use motor_hub::units::Period;
use simulated::encoder::{Encoder, Wire};
use simulated::scenario::{Scenario, Timed};
use simulated::without_tasks;
use std::thread;

const PERIODS_MS: [u32; 9] = [1, 2, 5, 10, 20, 50, 60, 80, 100];

/// Longest allowed time from the break to a safe bridge.
const WITHIN_MS: u64 = 250;

/// Time of the break. The motor has reached its speed, or nearly.
const BREAKS_MS: u64 = 2_500;

/// All ways in which one wire or both can break.
const BROKEN: [Encoder; 5] = [
    Encoder::Unplugged,
    Encoder::Stuck { wire: Wire::A, high: false },
    Encoder::Stuck { wire: Wire::A, high: true },
    Encoder::Stuck { wire: Wire::B, high: false },
    Encoder::Stuck { wire: Wire::B, high: true },
];

/// A motor that turns at a speed in counts/s, its inertia, and its load torque.
struct Axis {
    name: &'static str,
    cps: i32,
    toml: &'static str,
}

const AXES: [Axis; 8] = [
    Axis { name: "bare", cps: 1_000, toml: "" },
    Axis { name: "flywheel", cps: 1_000, toml: "load = { inertia_kg_m2 = 0.05 }" },
    Axis { name: "heavy flywheel", cps: 1_000, toml: "load = { inertia_kg_m2 = 0.5 }" },
    Axis { name: "backwards", cps: -1_000, toml: "load = { inertia_kg_m2 = 0.05 }" },
    Axis {
        name: "lifts",
        cps: 1_000,
        toml: "load = { inertia_kg_m2 = 0.05 }\ntorques = [{ at_s = 0.1, torque_nm = -0.8 }]",
    },
    Axis {
        name: "lets down",
        cps: 300,
        toml: "load = { inertia_kg_m2 = 0.05 }\ntorques = [{ at_s = 0.1, torque_nm = 0.8 }]",
    },
    Axis {
        name: "friction of a tenth",
        cps: 1_000,
        toml: "load = { inertia_kg_m2 = 0.05 }\nfriction = { coulomb_percent = 10 }",
    },
    Axis {
        name: "friction of 40 %",
        cps: 1_000,
        toml: "load = { inertia_kg_m2 = 0.05 }\nfriction = { coulomb_percent = 40 }",
    },
];

impl Axis {
    fn scenario(&self, period_ms: u32, configured: bool) -> Scenario {
        let Self { cps, toml, .. } = self;
        let text = format!(
            "name = \"wires\"\nduration_s = 4.0\n[battery]\nemf_v = 12\nresistance_ohm = 0.05\n\
             [[motors]]\nlabel = \"it\"\nmotor = \"AM 60 A\"\n{toml}\n\
             setpoints = [{{ at_s = 0.1, velocity_cps = {cps} }}]\n"
        );
        let mut scenario = Scenario::parse("wires.toml", &text).expect("valid");
        scenario.period = Period::from_millis(period_ms).expect("in range");
        for motor in &mut scenario.motors {
            motor.configuration.is_motion_known = configured;
        }
        scenario
    }

    /// Returns the time in milliseconds from the break until the hub reports the encoder fault.
    fn until_known(&self, period_ms: u32, configured: bool, broken: Encoder, phase_ms: u64) -> Option<u64> {
        let mut scenario = self.scenario(period_ms, configured);
        let breaks_ms = BREAKS_MS + phase_ms;
        for motor in &mut scenario.motors {
            motor.encoder = vec![Timed { at_s: breaks_ms as f64 / 1e3, value: broken }];
        }
        let mut known_ms = None;
        without_tasks::run(&scenario, |moment| {
            let fault = moment.snapshot.motors.first().and_then(|report| report.faults.encoder);
            if fault.is_some() && known_ms.is_none() {
                known_ms = Some(moment.ms);
            }
        })
        .expect("it runs");
        known_ms.map(|ms| ms.checked_sub(breaks_ms).expect("no fault of a sound encoder"))
    }
}

/// Longest time by period over all breaks at a number of moments between two ticks; `None` if a break was not detected.
fn longest(axis: &Axis, configured: bool, periods_ms: &[u32], steps: u64) -> Vec<(u32, Option<u64>)> {
    let of_period = |&period_ms: &u32| {
        let phases = (0..steps).map(|step| u64::from(period_ms) * step / steps);
        let cases = phases.flat_map(|phase_ms| BROKEN.map(|broken| (phase_ms, broken)));
        let times = cases.map(|(phase_ms, broken)| axis.until_known(period_ms, configured, broken, phase_ms));
        (period_ms, times.reduce(|a, b| a.zip(b).map(|(a, b)| a.max(b))).flatten())
    };
    periods_ms.iter().map(of_period).collect()
}

fn are_known_in_time(periods_ms: &[u32], steps: u64) {
    for configured in [true, false] {
        thread::scope(|scope| {
            let runs = AXES
                .each_ref()
                .map(|axis| (axis, scope.spawn(move || longest(axis, configured, periods_ms, steps))));
            for (axis, run) in runs {
                let longest = run.join().expect("it ends");
                println!("{:20} configured {configured:5} {longest:?}", axis.name);
                let in_time = longest.iter().all(|(_, known)| known.is_some_and(|ms| ms <= WITHIN_MS));
                assert!(
                    in_time,
                    "{}, configured {configured}: by period, milliseconds {longest:?}",
                    axis.name
                );
            }
        });
    }
}

#[test]
fn a_wire_that_breaks_in_mid_run_is_known_within_250_ms() {
    are_known_in_time(&[1, 50, 100], 2);
}

#[test]
#[ignore = "long: cargo xtask long"]
fn a_wire_that_breaks_anywhere_between_two_ticks_is_known_within_250_ms_at_every_period() {
    are_known_in_time(&PERIODS_MS, 10);
}
