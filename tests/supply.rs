//! Battery voltage from ADC readings.

use motor_hub::supply::{Battery, Limits, Supply, VrefintCalibration, VrefintScale};
use motor_hub::units::{Micros, Millivolts, RangeError};

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

/// A converter and the filter behind it.
struct Measured {
    scale: VrefintScale,
    supply: Supply,
}

impl Measured {
    fn step(&mut self, sample: Sample, now: Micros) -> Option<Battery> {
        self.supply.step(self.scale.battery(sample.battery, sample.vrefint), now)
    }
}

fn supply() -> Measured {
    Measured { scale: scale(), supply: Supply::new(Limits::default()) }
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
    supply().step(sample, Micros::new(7))
}

#[test]
fn every_plausible_voltage_is_read_within_one_and_a_half_steps_of_the_converter() {
    let step_mv = 3300.0 / 4095.0 * 5.7;
    for mv in (5_010..17_990).step_by(7) {
        let battery = first(sample(f64::from(mv), 3300.0)).expect("plausible");
        let error = f64::from(battery.voltage.get()) - f64::from(mv);
        assert!(error.abs() <= 1.5 * step_mv + 1.0, "{mv} mV: off by {error}");
        assert_eq!(battery.at, Micros::new(7));
    }
}

#[test]
fn a_voltage_is_read_as_the_converter_would_read_it_whatever_its_rail_is() {
    for rail in [2_800.0, 3_300.0, 3_500.0] {
        for mv in (5_000..15_000).step_by(7) {
            let Sample { battery, vrefint } = sample(f64::from(mv), rail);
            let reading = scale().reading(Millivolts::new(mv), vrefint);
            // The reference is rounded too: 1500 counts.
            let miss = (f64::from(reading) - f64::from(battery)).abs();
            assert!(miss <= 1.5 + f64::from(battery) / 3000.0, "{mv} mV: {reading}, {battery}");
        }
    }
    assert_eq!(scale().reading(Millivolts::new(u16::MAX), 1500), 4095);
}

#[test]
fn a_sagging_rail_is_not_taken_for_a_rising_battery() {
    for rail in [2_800.0, 3_000.0, 3_300.0, 3_500.0] {
        let battery = first(sample(12_000.0, rail)).expect("plausible");
        assert!((f64::from(battery.voltage.get()) - 12_000.0).abs() < 20.0, "{rail}: {battery:?}");
    }
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
            let mut supply = Measured { scale, supply: supply().supply };
            for reading in [0, 1, 4095, u16::MAX] {
                let _ = supply.step(Sample { battery: reading, vrefint: reading }, Micros::new(0));
            }
        }
    }
}

#[test]
fn noise_is_filtered_with_a_time_constant_of_30_ms_and_a_sample() {
    let mut supply = supply();
    supply.step(sample(12_000.0, 3300.0), Micros::new(0));
    let voltages: Vec<f64> = (0..20)
        .filter_map(|n| supply.step(sample(10_000.0, 3300.0), Micros::new(10_000 * (n + 1))))
        .map(|battery| f64::from(battery.voltage.get()))
        .collect();
    assert!((voltages[0] - 11_500.0).abs() < 10.0, "a quarter of the way: {voltages:?}");
    assert!((voltages[3] - 10_632.0).abs() < 15.0, "{voltages:?}");
    assert!((voltages[19] - 10_000.0).abs() < 20.0, "{voltages:?}");
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
