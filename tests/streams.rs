//! A host that streams set-points is checked like a host that sets one: the encoder check finds faults, and a stall
//! remains a stall.

mod common;

use common::{
    Bench, Cable, configured, configured_and_unknown, inertia, neverest_60, plant, position, velocity,
};
use motor_hub::group::{Course, GroupCommand};
use motor_hub::motor::{EncoderFault, Setpoint, Settings};
use motor_hub::units::{Acceleration, CountsPerSecond};

/// Inertia of the load on the output shaft, in kg m².
const LOAD: f64 = 0.01;

/// The set-point number `k` of a stream with one set-point every `every_ms`.
type Stream = fn(k: i32, every_ms: i32) -> Setpoint;

/// Two speeds in turn.
fn alternating(k: i32, _: i32) -> Setpoint {
    velocity(1_000 + k % 2)
}

/// A speed that grows by 100 counts/s in a second.
fn ramp(k: i32, every_ms: i32) -> Setpoint {
    velocity(800 + k * every_ms / 10)
}

/// A position that moves by 1000 counts/s.
fn moving_position(k: i32, every_ms: i32) -> Setpoint {
    position(2_000 + k * every_ms, 10, 1_500)
}

const STREAMS: [(&str, Stream); 3] =
    [("alternating", alternating), ("ramp", ramp), ("moving position", moving_position)];

/// Streams set-points. `set` sets number `k` every `every_ms`. After 2 s the encoder of motor 0 is unplugged. Returns the
/// time in ms from then on to the fault that the hub reports.
fn time_to_fault<const N: usize>(
    mut bench: Bench<N>,
    every_ms: u64,
    set: impl Fn(&mut Bench<N>, i32),
) -> u64 {
    let mut k = 0;
    while bench.ms < 4_000 && bench.report().faults.encoder.is_none() {
        if bench.ms >= 2_000 {
            bench.axes[0].cable = Cable::Unplugged;
        }
        if bench.ms.is_multiple_of(every_ms) {
            set(&mut bench, k);
            k += 1;
        }
        bench.run_ms(1);
    }
    assert_eq!(bench.report().faults.encoder, Some(EncoderFault::Stuck), "at {} ms", bench.ms);
    bench.ms.checked_sub(2_000).expect("no fault before")
}

#[test]
fn an_encoder_unplugged_under_a_stream_of_set_points_is_at_fault_within_300_ms() {
    let motor = neverest_60();
    for settings in configured_and_unknown(&motor, &inertia(LOAD)) {
        for (name, stream) in STREAMS {
            for period in [1, 10, 50, 100] {
                for every in [5, 20, 50, 100, 200] {
                    let bench = Bench::one(settings, plant(motor, inertia(LOAD)), period);
                    let ms = time_to_fault(bench, every, |bench, k| bench.set(0, stream(k, every as i32)));
                    let known = settings.dynamics.is_some();
                    assert!(
                        ms <= 300,
                        "{name} every {every} ms, {period} ms period, configured {known}: {ms} ms"
                    );
                }
            }
        }
    }
}

#[test]
fn a_stall_under_a_stream_of_set_points_is_reported_and_probed_once() {
    let motor = neverest_60();
    for settings in configured_and_unknown(&motor, &inertia(LOAD)) {
        for period in [5, 50] {
            for every in [5, 20, 100] {
                let mut bench = Bench::one(settings, plant(motor, inertia(LOAD)), period);
                bench.axes[0].stops.1 = 500.5;
                let (mut probes, mut probing) = (0, false);
                for k in 0..4_000 / every {
                    bench.set(0, alternating(k, every));
                    for _ in 0..every {
                        bench.run_ms(1);
                        let back = bench.control(0).get() < -20_000;
                        probes += u32::from(back && !probing);
                        probing = back;
                    }
                }
                let report = bench.report();
                assert_eq!(report.faults.encoder, None, "{period} ms, every {every} ms");
                assert!(report.stalled, "{period} ms, every {every} ms: {report:?}");
                assert_eq!(probes, 1, "{period} ms, every {every} ms");
            }
        }
    }
}

#[test]
fn an_encoder_unplugged_in_a_group_under_a_stream_of_courses_is_at_fault_within_300_ms() {
    let motor = neverest_60();
    for settings in configured_and_unknown(&motor, &inertia(LOAD)) {
        for (period, every) in [(5, 5), (5, 20), (10, 100), (50, 50), (50, 20)] {
            let plants = [(); 2].map(|()| plant(motor, inertia(LOAD)));
            let ms = time_to_fault(Bench::new([settings; 2], plants, period), every, |bench, k| {
                let speed = CountsPerSecond::new(1_000 + k % 2);
                let course = Course::velocities(&[(0, speed), (1, speed)]).expect("members");
                let acceleration = Acceleration::new(5_000).expect("in range");
                // A group with this lag does not wait for a member.
                let usual = GroupCommand::new(course, speed, acceleration);
                bench.move_group(GroupCommand { lag: u16::MAX, ..usual });
            });
            assert!(ms <= 300, "{period} ms period, every {every} ms: after {ms} ms");
        }
    }
}

/// A demanded speed in counts/s over the time in s.
type Speed = fn(f64) -> f64;

/// Streams a speed every 20 ms for 4 s. The first set-point comes `phase_ms` after a tick, and each may be `jitter_ms` late.
/// Returns the true speed in counts/s at each millisecond.
fn speeds(settings: Settings, period_ms: u32, phase_ms: u64, jitter_ms: u64, demand: Speed) -> Vec<f64> {
    let mut bench = Bench::one(settings, plant(neverest_60(), inertia(LOAD)), period_ms);
    bench.set(0, velocity(demand(0.0).round() as i32));
    bench.run_ms(2_000 + phase_ms);
    let mut speeds = Vec::new();
    for ms in 0..4_000 {
        let (number, late_ms) = (ms / 20, ms % 20);
        if late_ms == number * 5 % (jitter_ms + 1) {
            bench.set(0, velocity(demand(20e-3 * number as f64).round() as i32));
        }
        bench.run_ms(1);
        speeds.push(bench.speed(0));
    }
    speeds
}

/// Returns the lag in ms with which these speeds follow the demand with the least rms error, and this rms error in
/// counts/s. The first second is not used.
fn lag(speeds: &[f64], demand: Speed) -> (u32, f64) {
    let rms = |lag_ms: u32| {
        let late = |(ms, speed): (usize, &f64)| {
            (speed - demand(1e-3 * (ms as f64 + 1.0 - f64::from(lag_ms)))).powi(2)
        };
        (speeds.iter().enumerate().skip(1_000).map(late).sum::<f64>() / (speeds.len() - 1_000) as f64).sqrt()
    };
    let best = (0..150).min_by(|a, b| rms(*a).total_cmp(&rms(*b))).unwrap_or_default();
    (best, rms(best))
}

#[test]
fn a_streamed_speed_lags_by_at_most_a_period_and_5_ms() {
    let motor = neverest_60();
    let demands: [(&str, Speed); 2] =
        [("ramp", |s| 300.0 + 400.0 * s), ("sine", |s| 1_000.0 + 700.0 * (std::f64::consts::PI * s).sin())];
    for settings in configured_and_unknown(&motor, &inertia(LOAD)) {
        for period_ms in [1, 10, 50] {
            for ((name, demand), jitter_ms) in
                demands.into_iter().flat_map(|demand| [0, 6].map(|ms| (demand, ms)))
            {
                let what = format!(
                    "{name}, {period_ms} ms period, set-points up to {jitter_ms} ms late, configured {}",
                    settings.dynamics.is_some()
                );
                // The lag depends on how long a set-point waits for its tick.
                let runs = [1, 7, 13, 19]
                    .map(|phase_ms| lag(&speeds(settings, period_ms, phase_ms, jitter_ms, demand), demand));
                let mean_ms = f64::from(runs.iter().map(|(ms, _)| ms).sum::<u32>()) / 4.0;
                let most_ms = f64::from(period_ms) + 5.0 + jitter_ms as f64;
                assert!(mean_ms <= most_ms, "{what}: {mean_ms} ms of {runs:?}");
                assert!(runs.iter().all(|(_, rms)| *rms < 25.0), "{what}: {runs:?}");
            }
        }
    }
}

#[test]
fn a_streamed_ramp_that_ends_overshoots_by_what_it_would_gain_before_its_end_is_noticed() {
    let motor = neverest_60();
    let demand: Speed = |s| 300.0 + 1_000.0 * (s / 0.4).min(1.0);
    for settings in configured_and_unknown(&motor, &inertia(LOAD)) {
        for (period_ms, phase_ms) in
            [1, 10, 50].into_iter().flat_map(|period_ms| [(period_ms, 1), (period_ms, 11)])
        {
            let speeds = speeds(settings, period_ms, phase_ms, 0, demand);
            let overshoot = speeds.into_iter().fold(0.0, f64::max) - 1_300.0;
            // The ramp gains 2.5 counts/s in each millisecond. The hub continues the ramp for at most one and a half
            // intervals of 20 ms, and half a period.
            let most = 2.5 * (30.0 + 0.5 * f64::from(period_ms));
            assert!(overshoot <= most, "{period_ms} ms, from {phase_ms} ms on: {overshoot} counts/s");
        }
    }
}

#[test]
fn a_speed_after_a_time_at_rest_continues_no_stream() {
    let off = (Setpoint::Disabled, 50);
    for period_ms in [1, 5, 10, 20, 50, 100] {
        for history in [
            [(velocity(-600), 60), (velocity(0), 100), (velocity(0), 100)],
            [(velocity(150), 60), (velocity(300), 60), off],
            [(velocity(-500), 50), (velocity(-250), 50), (velocity(0), 100)],
            [(velocity(-300), 60), (position(0, 5, 500), 60), (position(0, 5, 500), 60)],
        ] {
            let (motor, load) = (neverest_60(), inertia(0.03));
            let mut bench = Bench::one(configured(&motor, &load), plant(motor, load), period_ms);
            for (setpoint, ms) in history {
                bench.set(0, setpoint);
                bench.run_ms(ms);
            }
            bench.run_ms(5_000);
            bench.set(0, velocity(650));
            let fastest = bench.highest(1_000, |bench| bench.speed(0));
            assert!(fastest < 1.1 * 650.0, "{period_ms} ms, {history:?}: {fastest:.0} counts/s");
        }
    }
}

#[test]
fn a_speed_that_is_streamed_to_0_does_not_reverse() {
    let motor = neverest_60();
    let demand: Speed = |s| (500.0 - 1_000.0 * s).max(0.0);
    for period_ms in [1, 10, 50] {
        let speeds = speeds(configured(&motor, &inertia(LOAD)), period_ms, 1, 0, demand);
        let lowest = speeds.into_iter().fold(0.0, f64::min);
        assert!(lowest > -5.0, "{period_ms} ms: {lowest} counts/s");
    }
}
