//! Battery voltage from ADC readings, and what the supply allows motors to do by this voltage.

use motor_hub::supply::{
    Battery, BusState, DrawStage, Levels, Limits, Supply, VrefintCalibration, VrefintScale,
};
use motor_hub::units::{Micros, Millivolts, RangeError, Share};

const CALIBRATION: u16 = 1500;

/// Returns the calibration of an STM32F4 with this reading.
fn calibration(reading: u16) -> VrefintCalibration {
    VrefintCalibration { reading, rail: Millivolts::new(3_300), bits: 12 }
}

fn scale() -> VrefintScale {
    VrefintScale::new(47_000, 10_000, calibration(CALIBRATION)).expect("divider")
}

/// A pair of readings: of the battery's divider and of the reference.
#[derive(Clone, Copy)]
struct Sample {
    battery: u16,
    vrefint: u16,
}

/// What the converter reads at this battery voltage when its own supply is `rail_mv`.
fn sample(battery_mv: f64, rail_mv: f64) -> Sample {
    let pin_mv = battery_mv * 10.0 / 57.0;
    let reference_mv = f64::from(CALIBRATION) / 4095.0 * 3300.0;
    Sample {
        battery: (pin_mv / rail_mv * 4095.0).round() as u16,
        vrefint: (reference_mv / rail_mv * 4095.0).round() as u16,
    }
}

fn first(sample: Sample) -> Option<Battery> {
    let measured = scale().battery(sample.battery, sample.vrefint);
    Supply::new(Limits::default()).step(measured, Micros::new(7))
}

#[test]
fn a_voltage_and_its_reading_are_converted_within_one_and_a_half_steps_whatever_the_rail_is() {
    for (rail, highest_mv) in [(2_800.0, 15_950), (3_000.0, 17_050), (3_300.0, 17_990), (3_500.0, 17_990)] {
        let step_mv = rail / 4095.0 * 5.7;
        // The reference is rounded too. At 3.3 V it is exactly 1500 counts.
        let reference_error = if rail == 3_300.0 { 0.0 } else { 1.0 / 3000.0 };
        for mv in (5_010..highest_mv).step_by(7) {
            let sample = sample(f64::from(mv), rail);
            let battery = first(sample).expect("plausible");
            let error = f64::from(battery.voltage.get()) - f64::from(mv);
            let most = 1.5 * step_mv + 1.0 + f64::from(mv) * reference_error;
            assert!(error.abs() <= most, "{mv} mV at {rail} mV: off by {error}");
            assert_eq!(battery.at, Micros::new(7));

            let reading = scale().reading(Millivolts::new(mv), sample.vrefint);
            let miss = f64::from(reading.abs_diff(sample.battery));
            let most = 1.5 + f64::from(sample.battery) * reference_error;
            assert!(miss <= most, "{mv} mV at {rail} mV: {reading}, {}", sample.battery);
        }
    }
    assert_eq!(scale().reading(Millivolts::new(u16::MAX), 1500), 4095);
}

#[test]
fn implausible_readings_give_no_voltage() {
    let good = sample(12_000.0, 3300.0);
    assert_eq!(first(Sample { vrefint: 0, ..good }), None, "dead reference");
    assert_eq!(first(Sample { vrefint: 4095, ..good }), None, "a rail of 1.2 V");
    assert_eq!(first(Sample { vrefint: 700, ..good }), None, "a rail of 7 V");
    assert_eq!(first(Sample { battery: 0, ..good }), None, "no battery");
    assert_eq!(first(sample(4_900.0, 3300.0)), None, "too low");
    assert_eq!(first(Sample { battery: u16::MAX, vrefint: u16::MAX }), None, "not 12 bits");
}

#[test]
fn absurd_scales_do_not_overflow() {
    assert_eq!(VrefintScale::new(0, 1, calibration(1)), Err(RangeError::Divider));
    assert_eq!(VrefintScale::new(1, 0, calibration(1)), Err(RangeError::Divider));
    for bits in [0, 17, u8::MAX] {
        let calibration = VrefintCalibration { bits, ..calibration(1) };
        assert_eq!(VrefintScale::new(1, 1, calibration), Err(RangeError::Resolution), "{bits}");
    }
    let absurd = [(0, 0, 1), (1, 3_300, 12), (u16::MAX, 3_300, 12), (u16::MAX, u16::MAX, 16)];
    for (reading, rail, bits) in absurd {
        let calibration = VrefintCalibration { reading, rail: Millivolts::new(rail), bits };
        for (top, bottom) in [(u32::MAX, 1), (1, u32::MAX), (u32::MAX, u32::MAX)] {
            let scale = VrefintScale::new(top, bottom, calibration).expect("above 0");
            for reading in [0, 1, 4095, u16::MAX] {
                let _ = scale.battery(reading, reading);
            }
        }
    }
}

#[test]
fn a_temperature_that_no_chip_has_is_none() {
    let decidegrees = |reference, factory| {
        VrefintCalibration { reading: reference, ..calibration(1) }.decidegrees(factory, 1, 1)
    };
    assert_eq!(decidegrees(3_712, [0, 100]), Some(29_996));
    // 0.1 degrees Celsius: 33 068 at the reading 4096, and the lowest number of 16 bits at the reading 1.
    assert_eq!(decidegrees(4_096, [0, 100]), None);
    assert_eq!(decidegrees(1, [33_069, 33_869]), None);
}

#[test]
fn a_voltage_goes_stale() {
    let battery = Battery::unlimited(Millivolts::new(12_000), Micros::new(1_000_000));
    assert!(battery.is_fresh(Micros::new(1_100_000)));
    assert!(!battery.is_fresh(Micros::new(1_100_001)));
}

#[test]
fn a_reference_calibrated_at_another_rail_and_resolution_gives_the_same_voltage() {
    for (bits, rail) in [(12, 3_000), (12, 3_300), (16, 3_300), (14, 1_800)] {
        let full_scale = f64::from((1_u32 << bits) - 1);
        let rail = Millivolts::new(rail);
        // 1.21 V, and 12 V behind the divider, on a rail of 3.27 V.
        let reading = (1_210.0 / f64::from(rail.get()) * full_scale).round() as u16;
        let convert = |mv: f64| (mv / 3_270.0 * full_scale).round() as u16;
        let scale = VrefintScale::new(47_000, 10_000, VrefintCalibration { reading, rail, bits });
        let voltage =
            scale.expect("sound").battery(convert(12_000.0 / 5.7), convert(1_210.0)).expect("a rail").get();
        assert!((11_985..=12_015).contains(&voltage), "{bits} bits at {rail:?}: {voltage}");
    }
}

/// A supply that is sampled every millisecond.
struct Sampled {
    supply: Supply,
    ms: u64,
}

impl Sampled {
    fn new() -> Self {
        Self { supply: Supply::new(Limits::default()), ms: 0 }
    }

    fn sample(&mut self, mv: u16) -> Battery {
        self.ms += 1;
        self.supply.step(Some(Millivolts::new(mv)), Micros::new(1000 * self.ms)).expect("plausible")
    }

    /// Holds a voltage for 2 s, until the filter and the draw have settled.
    fn hold(&mut self, mv: u16) -> Battery {
        (0..2_000).map(|_| self.sample(mv)).last().expect("2 000 samples")
    }
}

#[test]
fn noise_is_filtered_with_a_time_constant_of_30_ms_and_a_sample() {
    // From 12 V to 10 V: the interval of the samples in ms, the number of samples, and the filtered voltage.
    for (interval_ms, samples, range) in [
        // A quarter of the way.
        (10, 1, 11_498..=11_502),
        (10, 4, 10_628..=10_636),
        (10, 20, 9_990..=10_010),
        // Two time constants. With a longer sampling interval the filter is a little slower.
        (1, 60, 10_200..=10_400),
        (2, 30, 10_200..=10_400),
        (10, 6, 10_200..=10_400),
    ] {
        let mut supply = Supply::new(Limits::default());
        supply.step(Some(Millivolts::new(12_000)), Micros::new(0));
        let last = (1..=samples)
            .filter_map(|n| supply.step(Some(Millivolts::new(10_000)), Micros::new(1_000 * n * interval_ms)))
            .last()
            .expect("plausible");
        assert!(range.contains(&last.voltage.get()), "{samples} of {interval_ms} ms: {:?}", last.voltage);
    }
}

#[test]
fn the_filter_restarts_after_a_missing_and_an_implausible_reading_and_after_a_gap() {
    // Times in us, and readings in mV. No reading is reported missing in the gap: the task was delayed.
    for readings in [
        &[(0, Some(16_000)), (1, None), (2, Some(8_000))][..],
        &[(0, Some(16_000)), (1, Some(0)), (2, Some(8_000))],
        &[(0, Some(12_600)), (10_000_000, Some(9_000))],
    ] {
        let mut supply = Supply::new(Limits::default());
        for (us, mv) in readings {
            let battery = supply.step(mv.map(Millivolts::new), Micros::new(*us));
            let voltage = battery.map(|battery| battery.voltage.get());
            assert_eq!(voltage, mv.filter(|mv| *mv > 0), "at {us} us of {readings:?}");
        }
    }
}

#[test]
fn every_voltage_has_a_state_and_a_draw_and_a_share_of_energy_to_dissipate() {
    const FULL: DrawStage = DrawStage::Full;
    let (none, some, all) = ((false, false), (true, false), (true, true));
    // Voltage in mV, and the state of the bus. Then stage and share of the draw, and whether motors dissipate some of
    // the energy and all of it.
    for (mv, state, expected) in [
        (4_500, BusState::TooLow, None),
        (5_900, BusState::Cutoff, Some((DrawStage::Cutoff, 0.0, none))),
        (6_000, BusState::Cutoff, Some((DrawStage::Cutoff, 0.0, none))),
        (6_500, BusState::Derated, Some((DrawStage::Derated, 0.5, none))),
        (7_000, BusState::Quiet, Some((FULL, 1.0, none))),
        (12_000, BusState::Quiet, Some((FULL, 1.0, none))),
        (14_000, BusState::Quiet, Some((FULL, 1.0, none))),
        (14_100, BusState::Dissipating, Some((FULL, 1.0, some))),
        (15_000, BusState::Dissipating, Some((FULL, 1.0, all))),
        (15_600, BusState::TooHigh, Some((FULL, 1.0, all))),
        (24_001, BusState::TooHigh, Some((DrawStage::Overvoltage, 0.0, all))),
        (u16::MAX, BusState::TooHigh, Some((DrawStage::Overvoltage, 0.0, all))),
    ] {
        let mut supply = Supply::new(Limits::default());
        let measured = Some(Millivolts::new(mv));
        let battery = (1..=2_000).map(|ms| supply.step(measured, Micros::new(1_000 * ms))).last().flatten();
        let found = battery.map(|Battery { stage, draw, dissipate, voltage, .. }| {
            assert_eq!(voltage.get(), mv.min(24_000));
            let draw = (1e3 * draw.to_f32()).round() / 1e3;
            (stage, draw, (dissipate > Share::NONE, dissipate == Share::ALL))
        });
        assert_eq!(found, expected, "{mv} mV");
        let seen = supply.last_reading();
        assert_eq!((seen.state, seen.measured), (state, measured), "{mv} mV");
        assert_eq!(seen.as_of(Micros::new(2_100_001)).state, BusState::NoReading, "{mv} mV, long ago");
        supply.step(None, Micros::new(2_001_000));
        assert_eq!(
            (supply.last_reading().state, supply.last_reading().measured),
            (BusState::NoReading, None)
        );
    }
}

#[test]
fn motors_dissipate_by_the_expected_voltage_of_a_bus_that_rises() {
    // The voltage rises by 200 mV per millisecond.
    let mut supply = Sampled::new();
    supply.sample(13_700);
    assert!(supply.sample(13_900).dissipate > Share::NONE);
}

#[test]
fn a_low_battery_stays_low_until_it_has_recovered() {
    use DrawStage::{Derated, Full};
    let mut supply = Sampled::new();
    let stages = [7_050, 6_950, 7_050, 7_450, 7_500, 7_050].map(|mv| supply.hold(mv).stage);
    assert_eq!(stages, [Full, Derated, Derated, Derated, Full, Full]);
}

#[test]
fn after_a_cut_the_draw_rises_slowly_from_the_derate_level() {
    let mut supply = Sampled::new();
    supply.hold(5_900);
    assert_eq!(supply.hold(6_950).stage, DrawStage::Cutoff, "the stage stays Cutoff below the derate level");
    let shares: Vec<f32> = (0..1_200).map(|_| supply.sample(7_400).draw.to_f32()).collect();
    let first = shares.iter().position(|&share| share > 0.0).expect("the draw rises again");
    assert!((0.45..0.55).contains(&shares[first + 500]), "half of it after half a second");
    assert!(shares.windows(2).all(|pair| pair[1] >= pair[0] && pair[1] - pair[0] < 2e-3), "without a step");
}

#[test]
fn the_draw_from_a_weak_battery_converges_without_a_cut() {
    // A battery of 8 V. At the full draw of the motors the voltage falls by 3 V.
    let (mut supply, mut share) = (Sampled::new(), 1.0);
    supply.hold(8_000);
    let mut late = Vec::new();
    for ms in 0..8_000 {
        let battery = supply.sample((8_000.0 - 3_000.0 * share) as u16);
        assert_ne!(battery.stage, DrawStage::Cutoff, "at {ms} ms");
        share = f64::from(battery.draw.to_f32());
        if ms > 4_000 {
            late.push(share);
        }
    }
    let (low, high) = late.iter().fold((f64::MAX, 0.0_f64), |(low, high), &s| (s.min(low), s.max(high)));
    assert!(low > 0.4 && high - low < 0.05, "{low} to {high}");
}

#[test]
fn a_collapsed_bus_gives_a_draw_of_zero_until_the_last_state_is_stale() {
    let mut supply = Supply::new(Limits::default());
    let mut sample = |ms: u64, mv| supply.step(Some(Millivolts::new(mv)), Micros::new(1000 * ms));
    let before = sample(10, 7_600).expect("plausible");
    assert_eq!(sample(11, 4_700), None, "one may be a bad reading");
    let down = sample(12, 4_700).expect("known");
    assert_eq!(down, Battery { stage: DrawStage::Derated, draw: Share::NONE, ..before });
    assert!(!down.is_fresh(Micros::new(111_000)));
    // Without a load the voltage is back.
    let back = sample(13, 7_400).expect("plausible");
    assert_eq!((back.voltage, back.stage), (Millivolts::new(7_400), DrawStage::Derated));
    assert!(back.draw < Share::from_f32(0.01), "{:?}", back.draw);
    supply.step(None, Micros::new(14_000));
    let [first, second] =
        [15_000, 16_000].map(|us| supply.step(Some(Millivolts::new(4_700)), Micros::new(us)));
    assert_eq!(first, None, "after a failed conversion, one low voltage is no collapse");
    assert_eq!(second, Some(Battery { stage: DrawStage::Derated, draw: Share::NONE, ..back }));
}

#[test]
fn the_bus_is_quiet_only_while_motors_are_not_limited() {
    let quiet = |mv: &[u16]| {
        let mut supply = Sampled::new();
        for mv in mv {
            supply.hold(*mv);
        }
        supply.supply.quiet().is_some()
    };
    for (mv, expected) in [
        (&[12_000][..], true),
        (&[7_100], true),
        (&[13_900], true),
        (&[14_100], false),
        (&[14_100, 13_900], true),
        (&[6_900], false),
        (&[6_900, 7_100], false),
        (&[6_900, 7_600], true),
    ] {
        assert_eq!(quiet(mv), expected, "{mv:?}");
    }
    assert_eq!(Supply::new(Limits::default()).quiet(), None);
}

#[test]
fn after_an_overvoltage_motors_dissipate_for_50_ms_and_the_bus_is_then_quiet() {
    for mv in [13_900, 12_000] {
        let mut supply = Sampled::new();
        supply.sample(14_100);
        for ms in 1..=60 {
            let dissipate = supply.sample(mv).dissipate;
            assert_eq!(dissipate > Share::NONE, ms < 50, "{mv} mV, {ms} ms later");
            assert_eq!(supply.supply.quiet().is_some(), dissipate == Share::NONE, "{mv} mV, {ms} ms later");
        }
    }
}

#[test]
fn the_first_sample_outside_the_quiet_range_counts_for_one_millisecond() {
    let mut supply = Supply::new(Limits::default());
    supply.step(Some(Millivolts::new(7_600)), Micros::new(0));
    let battery = supply.step(Some(Millivolts::new(5_000)), Micros::new(9_000)).expect("plausible");
    assert!(
        battery.voltage > Millivolts::new(7_500),
        "the sample has the weight of 1 ms in a filter of 30 ms: {:?}",
        battery.voltage
    );
}

#[test]
fn levels_that_do_not_ascend_are_refused() {
    let good = Limits::default().levels();
    assert!(Limits::new(good).is_ok());
    let v = Millivolts::new;
    let wrong = [
        Levels { min: v(6_001), ..good },
        Levels { cutoff: v(7_000), ..good },
        Levels { derate: v(7_501), ..good },
        Levels { recover: v(14_000), ..good },
        Levels { dissipate: v(15_500), ..good },
        Levels { ceiling: v(24_001), ..good },
        Levels { max: v(15_499), ..good },
    ];
    for levels in wrong {
        assert_eq!(Limits::new(levels), Err(RangeError::SupplyLevels), "{levels:?}");
    }
    assert!(RangeError::SupplyLevels.to_string().contains("min <= cutoff < derate"));
}
