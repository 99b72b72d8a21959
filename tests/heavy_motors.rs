//! The encoder check takes a heavy motor that was not configured neither for unplugged nor for reversed, and still
//! finds an encoder that becomes reversed.

mod common;

use common::{Bench, Cable, free_cps, inertia, motor, plant, rotors, unknown, velocity};
use motor_hub::model::load::Load;

const PERIODS_MS: [u32; 4] = [1, 10, 50, 100];

/// Sets up an unknown motor with a load.
fn bench(name: &str, load: Load, period_ms: u32, at_counts: f64) -> Bench<1> {
    let motor = motor(name);
    let mut bench = Bench::one(unknown(&motor), plant(motor, load), period_ms);
    bench.place(0, at_counts, 0.0);
    bench
}

#[test]
fn a_heavy_unknown_motor_that_slows_down_after_a_long_steady_speed_has_a_sound_encoder() {
    for (name, kg_m2, fast, slow) in
        [("CoreHex A", 0.0, 500, 100), ("CoreHex C", 0.0, 500, 100), ("AM 3.7 B", 0.05, 700, 200)]
    {
        for period_ms in PERIODS_MS {
            let mut bench = bench(name, inertia(kg_m2), period_ms, 0.5);
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
                let mut bench = bench(name, inertia(kg_m2), period_ms, at_counts);
                bench.set(0, velocity(1_500));
                bench.run_ms(3_000);
                let report = bench.report();
                assert_eq!(report.faults.encoder, None, "{name}, {period_ms} ms, from {at_counts}");
                assert!(report.velocity.round() > 100, "{name}, {period_ms} ms, {at_counts}: {report:?}");
            }
        }
    }
}

#[test]
fn a_heavy_unknown_motor_that_is_reversed_before_its_first_count_has_a_sound_encoder() {
    let free = free_cps(&motor("Matrix C"));
    for times in [8.0, 10.0] {
        for period_ms in [10, 20, 50] {
            for (at_counts, started_ms) in [(0.02, 20), (0.02, 55), (0.98, 20), (0.98, 55), (0.98, 90)] {
                let mut bench = bench("Matrix C", rotors(&motor("Matrix C"), times), period_ms, at_counts);
                bench.sample();
                bench.set(0, velocity((-0.156 * free) as i32));
                bench.run_ms(started_ms);
                bench.set(0, velocity((0.255 * free) as i32));
                for _ in 0..200 {
                    bench.run_ms(10);
                    let report = bench.report();
                    let context = format!("{times}, {period_ms} ms, from {at_counts}, {started_ms} ms");
                    assert_eq!((report.faults.encoder, report.stalled), (None, false), "{context}");
                }
            }
        }
    }
}

#[test]
fn a_heavy_unknown_motor_in_a_long_reversal_has_a_sound_encoder() {
    for (name, times) in
        [("AM 40 C", 300.0), ("AM 60 B", 300.0), ("Matrix A", 100.0), ("Matrix B", 30.0), ("Matrix C", 30.0)]
    {
        for period_ms in [10, 50] {
            let free = free_cps(&motor(name));
            let mut bench = bench(name, rotors(&motor(name), times), period_ms, 0.5);
            for (share, seconds) in [(0.7, 40), (0.15, 15), (-0.5, 35), (0.3, 20), (0.0, 10)] {
                bench.set(0, velocity((share * free) as i32));
                for _ in 0..10 * seconds {
                    bench.run_ms(100);
                    let fault = bench.report().faults.encoder;
                    assert_eq!(fault, None, "{name} x{times}, {period_ms} ms, at {} ms", bench.ms);
                }
            }
        }
    }
}

#[test]
fn an_encoder_reversed_under_an_unknown_motor_at_work_is_at_fault_within_250_ms_and_three_periods() {
    for name in ["AM 60 A", "AM 20 A", "AM 3.7 B"] {
        for period_ms in PERIODS_MS {
            for share in [0.2, 0.4, -0.6] {
                let mut bench = bench(name, Load::NONE, period_ms, 0.5);
                bench.set(0, velocity((share * free_cps(&motor(name))) as i32));
                bench.run_ms(3_000);
                bench.axes[0].cable = Cable::Reversed;
                let ms = bench.wait_until(5_000, |bench| bench.report().faults.encoder.is_some());
                // One period each until the first tick with wrong counts, until full drive, and until the decision.
                let most = 250 + 3 * u64::from(period_ms);
                let is_soon = ms.is_some_and(|ms| ms <= most);
                assert!(is_soon, "{name}, {period_ms} ms, {share} of the free speed: after {ms:?} ms");
            }
        }
    }
}
