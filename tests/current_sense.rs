//! Current-sense lines: which part of a motor's current they show, and which lines a hub accepts.

mod common;

use common::{BATTERY, Bench, inertia, neverest_60, plant};
use motor_hub::braking::Winding;
use motor_hub::bridge::{BridgeFeedback, Drive, Mode, SenseScale};
use motor_hub::extension::report::MotorReport;
use motor_hub::model::plant::PlantInput;
use motor_hub::model::si::{Amps, RadPerSec, Seconds, Volts};
use motor_hub::motor::SenseLine::{self, Absent, Excessive, NoCurrent, Sound, Stuck};
use motor_hub::motor::{Report, Setpoint, Settings, best_current};
use motor_hub::units::{Control, Milliamperes, Millivolts, RangeError};
use proptest::prelude::*;

/// Control values: half power, the short of mode 5/0, a power at which the current is too small to judge the line, and no change.
const HALF: Option<i16> = Some(16_384);
const SHORT: Option<i16> = Some(0);
const LOW: Option<i16> = Some(4_000);
const SAME: Option<i16> = None;

/// A step: a control value, a time in ms, and the current in mA that the line shows meanwhile. Then what the hub reports: the state
/// of the line, and the measured current in mA.
type Step = (Option<i16>, u64, Option<i32>, SenseLine, Option<i32>);

/// A motor whose shaft is held, with a current-sense line that shows what the test sets.
struct Held(Bench<1>);

impl Held {
    /// Starts at rest, and takes these steps.
    fn after(steps: &[Step]) -> Self {
        let mut bench = Bench::turned(Settings::new(Winding::NEVEREST_60), [0.0]);
        // From now on each step ends with the millisecond of a tick.
        bench.run_ms(1);
        let mut held = Self(bench);
        held.follow(steps);
        held
    }

    fn follow(&mut self, steps: &[Step]) {
        for (index, &(power, ms, shown_ma, line, measured_ma)) in steps.iter().enumerate() {
            if let Some(power) = power {
                self.0.set(0, Setpoint::ConstantPower(Control::new(power)));
            }
            let report = self.run(ms, shown_ma);
            let found = (report.sense_line, report.measured.map(Milliamperes::get));
            assert_eq!(found, (line, measured_ma), "step {index} of {steps:?}");
        }
    }

    /// Lets time pass, with a sample of the line every 25 ms and a tick every 50 ms.
    fn run(&mut self, ms: u64, shown_ma: Option<i32>) -> &Report {
        for _ in 0..ms {
            if self.0.ms.is_multiple_of(25) {
                let current = shown_ma.map(Milliamperes::new);
                self.0.hub.set_bridge_feedback(&[BridgeFeedback { current, fault: false }]);
            }
            self.0.run_ms(1);
        }
        self.0.report()
    }

    /// Returns the modelled current in mA, and asserts that the hub uses it.
    fn modelled_ma(&self) -> i32 {
        let report = self.0.report();
        assert_eq!(report.best_current(), report.current);
        report.current.get()
    }
}

#[test]
fn a_line_is_believed_in_9_8_and_6_2_with_the_sign_of_the_model() {
    for (power, sign) in [(HALF, 1), (Some(-16_384), -1)] {
        let held = Held::after(&[(power, 500, Some(1_234), Sound, Some(1_234))]);
        assert_eq!(held.0.report().best_current().get(), sign * 1_234);
    }
}

#[test]
fn a_sample_of_any_size_has_the_sign_of_the_model() {
    for (modelled, measured, best) in [
        (-1, i32::MIN, i32::MIN),
        (-1, i32::MAX, -i32::MAX),
        (1, i32::MIN, i32::MIN),
        (1, i32::MAX, i32::MAX),
    ] {
        let [modelled, measured] = [modelled, measured].map(Milliamperes::new);
        assert_eq!(best_current(modelled, Some(measured)).get(), best, "{modelled:?}, {measured:?}");
    }
}

#[test]
fn a_host_reads_the_same_best_current_as_the_hub() {
    for (modelled, measured, best) in [
        (1_500, Some(1_234), 1_234),
        (-1_500, Some(1_234), -1_234),
        (-1_500, None, -1_500),
        (0, Some(20), 20),
    ] {
        let current = Milliamperes::new(modelled);
        let of_hub = Report { current, measured: measured.map(Milliamperes::new), ..Report::INITIAL };
        let measured_ma = measured.map(|ma| u16::try_from(ma).expect("a magnitude"));
        let of_host = MotorReport { current, measured_ma, ..MotorReport::default() };
        assert_eq!((of_hub.best_current().get(), of_host.best_current().get()), (best, best));
    }
}

#[test]
fn in_5_0_a_line_shows_nothing_and_the_model_goes_on() {
    let mut held = Held::after(&[(HALF, 500, Some(1_800), Sound, Some(1_800))]);
    held.0.axes[0].turned = Some(-2_000.0);
    held.follow(&[(SHORT, 500, Some(0), Sound, None)]);
    assert_eq!(held.0.report().drive, Drive::BRAKE);
    let modelled = held.modelled_ma();
    assert!(modelled > 1_000, "{modelled}");
}

#[test]
fn the_first_sample_of_a_mode_proves_nothing_and_four_after_it_do() {
    Held::after(&[
        (HALF, 500, Some(1_800), Sound, Some(1_800)),
        // The tick at 550 ms changes to the short of mode 5/0. Until then the line shows the current of mode 9/8.
        (SHORT, 50, Some(1_800), Sound, None),
        (SAME, 450, Some(0), Sound, None),
        // The first sample in a mode may belong to the mode before, so it is not used.
        (HALF, 50, Some(0), Sound, None),
        (SAME, 50, Some(0), Sound, Some(0)),
        // With the next sample, four samples in mode 9/8 count.
        (SAME, 50, Some(0), Sound, Some(0)),
        (SAME, 50, Some(0), NoCurrent, None),
    ]);
}

#[test]
fn a_broken_line_is_found_although_the_motor_brakes_before_it_has_four_samples_of_a_mode() {
    let mut held = Held::after(&[(HALF, 500, Some(1_800), Sound, Some(1_800))]);
    // Each mode lasts 100 ms. The first of its samples is not used, and two or three remain.
    for _ in 0..3 {
        held.0.set(0, Setpoint::ConstantPower(Control::ZERO));
        held.run(100, Some(0));
        held.0.set(0, Setpoint::ConstantPower(Control::new(16_384)));
        held.run(100, Some(0));
    }
    assert_eq!(held.0.report().sense_line, NoCurrent);
}

#[test]
fn nothing_where_an_ampere_is_due_is_a_broken_line_but_little_is_another_motor() {
    for (ma, line, measured_ma) in [(0, NoCurrent, None), (40, NoCurrent, None), (60, Sound, Some(60))] {
        Held::after(&[(HALF, 500, Some(ma), line, measured_ma)]);
    }
    Held::after(&[(LOW, 500, Some(0), Sound, None)]);
}

#[test]
fn a_line_is_not_judged_without_encoder_readings() {
    let mut held = Held::after(&[]);
    held.0.axes[0].unread_ms = u64::MAX;
    held.follow(&[(HALF, 2_000, Some(0), Sound, None)]);
    assert!(held.0.report().faults.encoder_stale);
}

#[test]
fn a_line_to_ground_measures_nothing_however_little_the_motor_takes() {
    // At first the modelled current is too small to judge the line. A single spike does not count as a current. No tick
    // follows the spike within its step.
    let spike = (SAME, 25, Some(80), Sound, None);
    let mut held =
        Held::after(&[(LOW, 1_000, Some(0), Sound, None), spike, (SAME, 1_000, Some(0), Sound, None)]);
    let modelled = held.modelled_ma();
    assert!(modelled > 200, "{modelled}");
    // At low power the current is too small to judge the line, so the line stays silent.
    held.follow(&[(HALF, 500, Some(0), NoCurrent, None), (LOW, 2_000, Some(0), NoCurrent, None)]);
    let modelled = held.modelled_ma();
    assert!(modelled > 200, "{modelled}");
}

#[test]
fn a_line_that_has_shown_a_current_may_show_none() {
    Held::after(&[
        (LOW, 200, Some(600), Sound, Some(600)),
        // The line shows 10 mA because the stalled motor slips, for example.
        (SAME, 500, Some(10), Sound, Some(10)),
        (SAME, 500, None, Absent, None),
        // After a missing line, the line may be another one, so it must show a current again.
        (SAME, 500, Some(0), Sound, None),
        (SAME, 50, Some(600), Sound, Some(600)),
    ]);
}

#[test]
fn a_line_that_shows_a_current_where_the_bridge_can_show_none_is_stuck_until_it_shows_none_there() {
    Held::after(&[
        (SAME, 300, Some(23_571), Stuck, None),
        // A line that shows the right current again is not accepted while the motor is driven.
        (HALF, 500, Some(1_800), Stuck, None),
        (SHORT, 300, Some(0), Sound, None),
        (HALF, 100, Some(1_800), Sound, Some(1_800)),
    ]);
}

#[test]
fn a_silent_line_that_is_mended_is_believed_again_by_what_it_shows() {
    Held::after(&[
        (HALF, 500, Some(0), NoCurrent, None),
        // In mode 5/0 a sound line shows 0, so the 0 proves nothing.
        (SHORT, 500, Some(0), NoCurrent, None),
        (HALF, 500, Some(1_700), Sound, Some(1_700)),
    ]);
}

#[test]
fn a_current_far_above_the_modelled_one_is_used_and_reported_as_excessive() {
    let mut held = Held::after(&[(HALF, 100, Some(1_800), Sound, Some(1_800))]);
    let worst_ratio = 2 * held.0.report().current.get();
    held.follow(&[
        (SAME, 500, Some(worst_ratio), Sound, Some(worst_ratio)),
        (SAME, 500, Some(12_000), Excessive, Some(12_000)),
        (SAME, 500, Some(1_800), Sound, Some(1_800)),
    ]);
}

#[test]
fn a_single_wrong_sample_changes_no_state() {
    let right = (SAME, 100, Some(1_800), Sound, Some(1_800));
    let mut held = Held::after(&[(HALF, 100, Some(1_800), Sound, Some(1_800))]);
    for _ in 0..10 {
        assert_eq!(held.run(50, Some(0)).sense_line, Sound);
        held.follow(&[right]);
    }
}

#[test]
fn a_scale_needs_a_reference_and_volts_per_ampere() {
    assert_eq!(SenseScale::new(Millivolts::new(0), 140), Err(RangeError::Sense));
    assert_eq!(SenseScale::new(Millivolts::new(3_300), 0), Err(RangeError::Sense));
    assert_eq!(SenseScale::new(Millivolts::new(3_300), 140), Ok(SenseScale::VNH5019_CARRIER));
}

proptest! {
    #[test]
    fn a_word_is_its_share_of_full_scale_and_any_word_some_current(
        mv in 1..=u16::MAX, mv_per_a in 1..=u16::MAX, word: u16, bits in 1_u32..=16,
    ) {
        let scale = SenseScale::new(Millivolts::new(mv), mv_per_a).expect("in range");
        let highest = f64::from((1_u32 << bits) - 1);
        let ma = 1e3 * f64::from(mv) / f64::from(mv_per_a) * f64::from(word) / highest;
        let shown = f64::from(scale.current(word, bits).get());
        if f64::from(word) <= highest {
            prop_assert!((shown - ma).abs() <= 2.0, "{shown} for {ma}");
        }
        prop_assert!(shown >= 0.0);
    }
}

/// Returns the true and the shown current in A in a mode at a duty, as means over 0.1 s. The measurement begins after
/// 0.1 s. `speed` is a share of the speed whose back EMF is the battery's voltage.
fn shown(mode: Mode, duty: f64, speed: f64) -> (f64, f64) {
    // The load is so heavy that the speed does not change.
    let mut plant = plant(neverest_60(), inertia(1e3));
    plant.set_state(Amps(0.0), RadPerSec(speed * BATTERY / plant.motor().ke.0), 0.0);
    let mut run = || plant.run(Seconds(0.1), PlantInput::pwm(mode, duty), Volts(BATTERY));
    run();
    let flow = run();
    (flow.mean_current().0, flow.charge_shown.0 / flow.time.0)
}

#[test]
fn a_bridge_shows_the_whole_current_of_9_8_and_6_2_and_none_of_5_0() {
    for duty in [0.0, 0.1, 0.5, 1.0] {
        for speed in [0.0, 0.3, 0.8] {
            let (flows, shows) = shown(Mode::Cw98, duty, speed);
            // A motor that is faster than its drive returns current through a diode. The line shows forward currents
            // only.
            let expected = flows.max(0.0);
            assert!((shows - expected).abs() < 1e-3, "9/8 {duty} at {speed}: {shows} of {flows} A");
            let (flows, shows) = shown(Mode::Ccw62, duty, speed);
            assert!(
                flows <= 1e-9 && (shows + flows).abs() < 1e-3,
                "6/2 {duty} at {speed}: {shows} of {flows} A"
            );
            let (flows, shows) = shown(Mode::Brake50, duty, speed);
            assert!(shows == 0.0 && flows <= 1e-9, "5/0 {duty} at {speed}: {shows} of {flows} A");
        }
    }
}
