//! Ranges of the fixed-point quantities, driven to both ends.

use motor_hub::braking::Winding;
use motor_hub::units::{
    Coefficient, Control, CountsPerSecond, Duty, EmfConstant, Micros, Period, RangeError,
};

#[test]
fn control_is_symmetric() {
    assert_eq!(Control::new(i16::MIN), Control::MIN);
    assert_eq!(-Control::MIN, Control::MAX);
    assert_eq!(Control::saturating(i64::MAX), Control::MAX);
    assert_eq!(Control::saturating(i64::MIN), Control::MIN);
    for value in -i16::MAX..=i16::MAX {
        assert_eq!(Control::new(value).get(), value);
        assert_eq!((-Control::new(value)).get(), -value);
    }
}

#[test]
fn duty_never_leaves_0_to_1_and_both_ends_are_exact() {
    assert_eq!(Duty::from_bits(u16::MAX), Duty::ONE);
    assert_eq!(Duty::ONE.to_f64(), 1.0);
    for (part, whole) in [(-1, 5), (0, 5), (3, 0), (3, -3), (i64::MIN, i64::MAX)] {
        assert_eq!(Duty::ratio(part, whole), Duty::ZERO, "{part}/{whole}");
    }
    for (part, whole) in [(5, 5), (6, 5), (i64::MAX, 1), ((1 << 47) - 1, (1 << 47) - 1)] {
        assert_eq!(Duty::ratio(part, whole), Duty::ONE, "{part}/{whole}");
    }
    let largest = (1 << 47) - 1;
    assert_eq!(Duty::ratio(largest - 1, largest).to_bits(), 1 << 15);
    assert_eq!(Duty::ratio(1, 2).to_bits(), 1 << 14);
}

#[test]
fn timer_compare_values_reach_from_0_to_the_period() {
    for period in [1, 8400, u16::MAX] {
        assert_eq!(Duty::ZERO.of_period(period), 0);
        assert_eq!(Duty::ONE.of_period(period), period);
        let mut last = 0;
        for bits in 0..=1 << 15 {
            let compare = Duty::from_bits(bits).of_period(period);
            assert!(compare >= last && compare <= period);
            last = compare;
        }
    }
}

#[test]
fn emf_saturates_far_above_any_battery_and_is_exact_below() {
    let largest = EmfConstant::from_bits((1 << 25) - 1).expect("largest");
    let fastest = CountsPerSecond::saturating_from_bits(i64::MAX);
    assert_eq!(largest.emf(fastest).to_bits(), 131_071 << 20);
    let backwards = CountsPerSecond::saturating_from_bits(i64::MIN);
    assert_eq!(largest.emf(backwards).to_bits(), -(131_071 << 20));

    // 513 counts/s of a NeveRest 60 no longer fit 32 bits.
    let neverest_60 = Winding::NEVEREST_60.emf();
    assert_eq!(neverest_60.emf(CountsPerSecond::new(514)).to_bits(), 514 * i64::from(neverest_60.to_bits()));
    assert_eq!(
        neverest_60.emf(CountsPerSecond::new(-2720)).to_bits(),
        -2720 * i64::from(neverest_60.to_bits())
    );
}

#[test]
fn numbers_out_of_range_are_refused_with_the_range_named() {
    for bits in [i32::MIN, -1, 0, 1 << 25, i32::MAX] {
        assert_eq!(EmfConstant::from_bits(bits), Err(RangeError::EmfConstant), "{bits}");
    }
    for bits in [1, (1 << 25) - 1] {
        assert_eq!(EmfConstant::from_bits(bits).map(EmfConstant::to_bits), Ok(bits));
    }
    for bits in [i32::MIN, -1, i32::MAX] {
        assert_eq!(Coefficient::from_bits(bits).to_bits(), bits);
    }
    for ms in [0, 101, u32::MAX] {
        assert_eq!(Period::from_millis(ms), Err(RangeError::Period), "{ms}");
    }
    for ms in [1, 50, 100] {
        assert_eq!(Period::from_millis(ms).map(Period::as_millis), Ok(ms));
    }
    assert!(RangeError::Period.to_string().contains("1 to 100 ms"));
}

#[test]
fn speeds_round_and_saturate() {
    assert_eq!(CountsPerSecond::new(i32::MAX).round(), 8_388_607);
    assert_eq!(CountsPerSecond::new(i32::MIN).round(), -8_388_608);
    assert_eq!(CountsPerSecond::saturating_from_bits(383).round(), 1);
    assert_eq!(CountsPerSecond::saturating_from_bits(384).round(), 2);
    assert_eq!(Micros(3).since(Micros(5)), 0);
}
