//! The encoder check takes a heavy motor that was not configured neither for unplugged nor for reversed.

#[path = "common/mod.rs"]
mod common;

use common::{Bench, inertia, motor, plant, unknown, velocity};

const PERIODS_MS: [u32; 4] = [1, 10, 50, 100];

/// Sets up an unknown motor with an inertia at its output, in kg m².
fn bench(name: &str, kg_m2: f64, period_ms: u32, at_counts: f64) -> Bench<1> {
    let motor = motor(name);
    let mut bench = Bench::one(unknown(&motor), plant(motor, inertia(kg_m2)), period_ms);
    bench.place(0, at_counts, 0.0);
    bench
}

#[test]
fn a_heavy_unknown_motor_that_slows_down_after_a_long_steady_speed_has_a_sound_encoder() {
    for (name, kg_m2, fast, slow) in
        [("CoreHex A", 0.0, 500, 100), ("CoreHex C", 0.0, 500, 100), ("AM 3.7 B", 0.05, 700, 200)]
    {
        for period_ms in PERIODS_MS {
            let mut bench = bench(name, kg_m2, period_ms, 0.5);
            bench.set(0, velocity(fast));
            bench.run_ms(40_000);
            bench.set(0, velocity(slow));
            for _ in 0..50 {
                bench.run_ms(200);
                assert_eq!(bench.report().faults.encoder, None, "{name}, {period_ms} ms, at {} ms", bench.ms);
            }
        }
    }
}

#[test]
fn a_heavy_unknown_motor_that_hardly_starts_has_a_sound_encoder() {
    for (name, kg_m2) in [("AM 60 A", 10.0), ("AM 20 A", 2.0)] {
        for period_ms in PERIODS_MS {
            for at_counts in [0.001, 0.3, 0.5, 0.7, 0.999] {
                let mut bench = bench(name, kg_m2, period_ms, at_counts);
                bench.set(0, velocity(1_500));
                bench.run_ms(3_000);
                let report = bench.report();
                assert_eq!(report.faults.encoder, None, "{name}, {period_ms} ms, from {at_counts}");
                assert!(report.velocity.round() > 100, "{name}, {period_ms} ms, {at_counts}: {report:?}");
            }
        }
    }
}
