//! Current-sense lines: what of a motor's current they show, and which of them a hub believes.

mod common;

use common::{BATTERY, Bench, inertia, neverest_60, plant};
use motor_hub::braking::Winding;
use motor_hub::bridge::{BridgeFeedback, Drive, Mode, SenseScale};
use motor_hub::extension::report::MotorReport;
use motor_hub::model::plant::PlantInput;
use motor_hub::model::si::{Amps, RadPerSec, Seconds, Volts};
use motor_hub::motor::{Report, SenseLine, Setpoint, Settings};
use motor_hub::units::{Control, Milliamperes, Millivolts, RangeError};
use proptest::prelude::*;

const HALF: Control = Control::new(16_384);

/// A motor whose shaft is held, with a current-sense line that shows what the test sets.
struct Held(Bench<1>);

impl Held {
    fn new() -> Self {
        let mut bench = Bench::turned(Settings::new(Winding::NEVEREST_60), [0.0]);
        // From now on each run ends with the millisecond of a tick.
        bench.run_ms(1);
        Self(bench)
    }

    /// A sample of the line every 25 ms, and a tick every 50.
    fn run(&mut self, ms: u64, shown_ma: Option<i32>) -> &Report {
        for _ in 0..ms {
            if self.0.ms.is_multiple_of(25) {
                self.0
                    .hub
                    .sense(&[BridgeFeedback { current: shown_ma.map(Milliamperes::new), fault: false }]);
            }
            self.0.run_ms(1);
        }
        self.0.report()
    }

    fn power(&mut self, power: Control) {
        self.0.set(0, Setpoint::ConstantPower(power));
    }
}

fn line_and_current(report: &Report) -> (SenseLine, Option<i32>) {
    (report.sense_line, report.measured.map(Milliamperes::get))
}

#[test]
fn the_current_of_a_motor_without_a_line_is_modelled() {
    let mut held = Held::new();
    held.power(HALF);
    let report = held.run(500, None);
    assert_eq!(line_and_current(report), (SenseLine::Absent, None));
    assert!(report.current.get() > 1_500 && report.best_current() == report.current, "{:?}", report.current);
}

#[test]
fn a_line_is_believed_in_9_8_and_6_2_with_the_sign_of_the_model() {
    for (power, sign) in [(HALF, 1), (Control::new(-16_384), -1)] {
        let mut held = Held::new();
        held.power(power);
        let report = held.run(500, Some(1_234));
        assert_eq!(line_and_current(report), (SenseLine::Sound, Some(1_234)));
        assert_eq!(report.best_current().get(), sign * 1_234);
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
    let mut held = Held::new();
    held.power(HALF);
    held.run(500, Some(1_800));
    held.0.axes[0].turned = Some(-2_000.0);
    held.power(Control::ZERO);
    let report = held.run(500, Some(0));
    assert_eq!(report.drive, Drive::BRAKE);
    assert_eq!(line_and_current(report), (SenseLine::Sound, None));
    assert!(report.best_current() == report.current && report.current.get() > 1_000, "{:?}", report.current);
}

#[test]
fn a_sample_of_another_mode_is_not_the_current_of_this_one() {
    let mut held = Held::new();
    held.power(HALF);
    held.run(500, Some(1_800));
    held.power(Control::ZERO);
    // The tick at 550 ms shorts it; the sample of 525 ms was of 9/8.
    assert_eq!(line_and_current(held.run(50, Some(1_800))), (SenseLine::Sound, None));
    held.power(HALF);
    assert_eq!(line_and_current(held.run(50, Some(0))), (SenseLine::Sound, None));
    // The first sample in it may belong to the mode before.
    assert_eq!(line_and_current(held.run(50, Some(1_800))), (SenseLine::Sound, Some(1_800)));
}

#[test]
fn the_first_sample_of_a_mode_proves_nothing_and_four_after_it_do() {
    let mut held = Held::new();
    held.power(HALF);
    held.run(500, Some(1_800));
    held.power(Control::ZERO);
    held.run(500, Some(0));
    held.power(HALF);
    held.run(50, Some(0));
    // Four samples in mode 9/8. The first may belong to the short, so the next sample is the fourth that counts.
    assert_eq!(held.run(100, Some(0)).sense_line, SenseLine::Sound);
    assert_eq!(held.run(50, Some(0)).sense_line, SenseLine::Silent);
}

#[test]
fn nothing_where_an_ampere_is_due_is_a_broken_line_but_little_is_another_motor() {
    for (ma, line) in [(0, SenseLine::Silent), (40, SenseLine::Silent), (60, SenseLine::Sound)] {
        let mut held = Held::new();
        held.power(HALF);
        assert_eq!(held.run(500, Some(ma)).sense_line, line, "{ma} mA");
    }
    // A current of a few hundred milliamperes is too small to judge the line.
    let mut held = Held::new();
    held.power(Control::new(4_000));
    assert_eq!(held.run(500, Some(0)).sense_line, SenseLine::Sound);
}

#[test]
fn a_line_is_not_judged_without_encoder_readings() {
    let mut held = Held::new();
    held.power(HALF);
    held.0.axes[0].unread_ms = u64::MAX;
    let report = held.run(2_000, Some(0));
    assert!(report.faults.encoder_stale);
    assert_eq!(line_and_current(report), (SenseLine::Sound, None));
}

#[test]
fn a_line_to_ground_measures_nothing_however_little_the_motor_takes() {
    let mut held = Held::new();
    held.power(Control::new(4_000));
    let report = held.run(1_000, Some(0));
    assert_eq!(line_and_current(report), (SenseLine::Sound, None), "nothing has been due yet");
    held.run(25, Some(80));
    let report = held.run(1_000, Some(0));
    assert_eq!(line_and_current(report), (SenseLine::Sound, None), "a spike is no current");
    assert!(report.best_current() == report.current && report.current.get() > 200, "{:?}", report.current);
    held.power(HALF);
    assert_eq!(line_and_current(held.run(500, Some(0))), (SenseLine::Silent, None));
    // The current at speed does not prove that the line is mended.
    held.power(Control::new(4_000));
    let report = held.run(2_000, Some(0));
    assert_eq!(line_and_current(report), (SenseLine::Silent, None));
    assert!(report.best_current().get() > 200, "{:?}", report.current);
}

#[test]
fn a_line_that_has_shown_a_current_may_show_none() {
    let mut held = Held::new();
    held.power(Control::new(4_000));
    held.run(200, Some(600));
    assert_eq!(line_and_current(held.run(500, Some(10))), (SenseLine::Sound, Some(10)), "it slips");
    assert_eq!(line_and_current(held.run(500, None)), (SenseLine::Absent, None));
    assert_eq!(line_and_current(held.run(500, Some(0))), (SenseLine::Sound, None), "it may be another line");
}

#[test]
fn a_line_that_shows_a_current_where_the_bridge_can_show_none_is_stuck_until_it_shows_none_there() {
    let mut held = Held::new();
    assert_eq!(line_and_current(held.run(300, Some(23_571))), (SenseLine::Stuck, None));
    held.power(HALF);
    // A line that shows the right current again is not accepted while the motor is driven.
    assert_eq!(line_and_current(held.run(500, Some(1_800))), (SenseLine::Stuck, None));
    held.power(Control::ZERO);
    assert_eq!(held.run(300, Some(0)).sense_line, SenseLine::Sound);
    held.power(HALF);
    assert_eq!(line_and_current(held.run(100, Some(1_800))), (SenseLine::Sound, Some(1_800)));
}

#[test]
fn a_silent_line_that_is_mended_is_believed_again_by_what_it_shows() {
    let mut held = Held::new();
    held.power(HALF);
    assert_eq!(held.run(500, Some(0)).sense_line, SenseLine::Silent);
    held.power(Control::ZERO);
    assert_eq!(held.run(500, Some(0)).sense_line, SenseLine::Silent, "nothing is what it should show here");
    held.power(HALF);
    assert_eq!(line_and_current(held.run(500, Some(1_700))), (SenseLine::Sound, Some(1_700)));
}

#[test]
fn a_current_far_above_the_modelled_one_is_used_and_reported_as_excessive() {
    let mut held = Held::new();
    held.power(HALF);
    let modelled = held.run(100, Some(1_800)).current.get();
    assert_eq!(held.run(500, Some(2 * modelled)).sense_line, SenseLine::Sound, "a chip of the worst ratio");
    assert_eq!(line_and_current(held.run(500, Some(12_000))), (SenseLine::Excessive, Some(12_000)));
    assert_eq!(held.run(500, Some(1_800)).sense_line, SenseLine::Sound);
}

#[test]
fn a_single_wrong_sample_changes_no_state() {
    let mut held = Held::new();
    held.power(HALF);
    for _ in 0..10 {
        held.run(100, Some(1_800));
        assert_eq!(held.run(50, Some(0)).sense_line, SenseLine::Sound);
    }
}

#[test]
fn a_converter_that_dies_leaves_the_model() {
    let mut held = Held::new();
    held.power(HALF);
    assert_eq!(line_and_current(held.run(500, Some(1_800))), (SenseLine::Sound, Some(1_800)));
    assert_eq!(line_and_current(held.run(50, None)), (SenseLine::Absent, None));
    assert_eq!(line_and_current(held.run(50, Some(1_800))), (SenseLine::Sound, Some(1_800)));
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

/// True and shown current in A, after a tenth of a second in a mode at a duty, from a speed on.
fn shown(mode: Mode, duty: f64, speed: f64) -> (f64, f64) {
    // The load is so heavy that the speed does not change.
    let mut plant = plant(neverest_60(), inertia(1e3));
    plant.place(Amps(0.0), RadPerSec(speed * BATTERY / plant.motor().ke.0), 0.0);
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
