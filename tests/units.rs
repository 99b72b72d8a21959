//! Ranges of the fixed-point quantities, driven to both ends.

use motor_hub::braking::Winding;
use motor_hub::model::catalogue;
use motor_hub::units::{
    Coefficient, Control, CountsPerSecond, Duty, EmfConstant, Inductance, Micros, Millivolts, Period,
    RangeError, Resistance, Voltage,
};

#[test]
fn a_voltage_in_16_bits_ends_at_the_ends_of_their_range() {
    let millivolts = |volts| Voltage::from_volts(volts).to_millivolts();
    assert_eq!([0.0, 11.5, -11.5, 32.7, -32.7].map(millivolts), [0, 11_500, -11_500, 32_700, -32_700]);
    assert_eq!([40.0, -40.0, 200_000.0].map(millivolts), [i16::MAX, i16::MIN, i16::MAX]);
}

#[test]
fn control_is_symmetric() {
    assert_eq!(Control::new(i16::MIN), Control::MIN);
    assert_eq!(Control::MIN.reversed(), Control::MAX);
    assert_eq!(Control::saturating(i64::MAX), Control::MAX);
    assert_eq!(Control::saturating(i64::MIN), Control::MIN);
    for value in -i16::MAX..=i16::MAX {
        assert_eq!(Control::new(value).get(), value);
        assert_eq!(Control::new(value).reversed().get(), -value);
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
    // With 16 mV s/count: 131 071 mV is 8191.94 counts/s.
    let constant = EmfConstant::from_bits(1 << 24).expect("16 mV s/count");
    for (cps, refused) in [(8191, false), (-8191, false), (8192, true), (-8192, true)] {
        let speed = CountsPerSecond::new(cps);
        let expected = if refused { Err(RangeError::Emf) } else { Ok(constant.emf(speed)) };
        assert_eq!(constant.emf_within_range(speed), expected, "{cps} counts/s");
    }

    // 513 counts/s of a NeveRest 60 no longer fit 32 bits.
    let neverest_60 = Winding::NEVEREST_60.emf;
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
    for (bits, limited) in [(i32::MIN, -i32::MAX), (-i32::MAX, -i32::MAX), (i32::MAX, i32::MAX)] {
        assert_eq!(CountsPerSecond::from_bits(bits).to_bits(), limited, "{bits}");
    }
    assert_eq!(CountsPerSecond::saturating_from_bits(383).round(), 1);
    assert_eq!(CountsPerSecond::saturating_from_bits(384).round(), 2);
}

#[test]
fn times_reach_to_the_end_of_the_clock_and_none_is_before_its_begin() {
    assert_eq!(Micros::new(3).since(Micros::new(5)), 0);
    assert_eq!(Micros::new(u64::MAX).since(Micros::new(0)), u64::MAX);
    assert_eq!(Micros::new(u64::MAX).get(), u64::MAX);
}

#[test]
fn voltages_windings_and_inductances_reach_both_ends_of_their_range_and_no_further() {
    for mv in [0, 1, 12_000, u16::MAX] {
        assert_eq!(Millivolts::new(mv).get(), mv);
        assert_eq!(Millivolts::from_volts(f64::from(mv) / 1e3), Ok(Millivolts::new(mv)));
    }
    assert_eq!(Millivolts::from_volts(-0.000_4), Ok(Millivolts::new(0)), "to the nearest");
    assert_eq!(Millivolts::from_volts(65.535_4), Ok(Millivolts::new(u16::MAX)), "to the nearest");
    for volts in [-0.000_5, 65.535_5, f64::NAN, f64::INFINITY, f64::MAX, f64::MIN] {
        assert_eq!(Millivolts::from_volts(volts), Err(RangeError::Voltage), "{volts}");
    }

    for whole in 1..=u16::MAX {
        let thousandths = f64::from(whole) / 1e3;
        assert_eq!(Resistance::from_milliohms(whole).map(Resistance::as_milliohms), Ok(whole));
        assert_eq!(Resistance::from_ohms(thousandths).map(Resistance::as_milliohms), Ok(whole));
        assert_eq!(Inductance::from_microhenries(whole).map(Inductance::as_microhenries), Ok(whole));
        assert_eq!(Inductance::from_millihenries(thousandths).map(Inductance::as_microhenries), Ok(whole));
    }
    assert_eq!(Resistance::from_milliohms(0), Err(RangeError::Resistance));
    assert_eq!(Inductance::from_microhenries(0), Err(RangeError::Inductance));
    for thousandths in [-3.3, 0.0, 0.000_4, 65.535_5, f64::NAN, f64::INFINITY, f64::MAX] {
        assert_eq!(Resistance::from_ohms(thousandths), Err(RangeError::Resistance), "{thousandths}");
        assert_eq!(Inductance::from_millihenries(thousandths), Err(RangeError::Inductance), "{thousandths}");
    }
}

#[test]
fn ke_of_every_motor_in_the_catalogue_is_its_ke_fw_to_the_nearest_step() {
    let motors: Vec<_> = catalogue::motors().collect();
    assert!(!motors.is_empty());
    for motor in motors {
        let constant = EmfConstant::from_ke(motor.ke.0, motor.counts_per_rev_motor).expect(motor.name);
        let error = f64::from(constant.to_bits()) - motor.ke_fw() * f64::from(1 << 20);
        assert!(error.abs() <= 0.5 + 1e-6, "{}: off by {error} steps", motor.name);
    }
}

#[test]
fn ke_out_of_range_is_refused() {
    // At this number of counts per turn keFw in mV s/count is equal to Ke.
    let counts = 2e3 * std::f64::consts::PI;
    let step = f64::from(1 << 20).recip();
    let bits = |ke| EmfConstant::from_ke(ke, counts).map(EmfConstant::to_bits);
    assert_eq!(bits(step), Ok(1));
    assert_eq!(bits(0.6 * step), Ok(1));
    assert_eq!(bits(32.0 - step), Ok((1 << 25) - 1));
    for ke in [0.4 * step, 0.0, -1.0, -4096.0, 32.0, 4096.0, 8192.0, f64::NAN, f64::INFINITY] {
        assert_eq!(bits(ke), Err(RangeError::EmfConstant), "{ke}");
    }
    for (ke, counts) in [(1.0, 0.0), (0.0, 0.0), (1.0, -28.0), (-1.0, -28.0), (1.0, f64::NAN)] {
        assert_eq!(EmfConstant::from_ke(ke, counts), Err(RangeError::EmfConstant), "{ke} {counts}");
    }
}

#[test]
fn speeds_come_from_rpm() {
    let speed = |bits| Ok(CountsPerSecond::from_bits(bits));
    for (rpm, counts, bits) in [
        (0.0, 28.0, 0),
        (60.0, 1680.0, 1680 << 8),
        (-60.0, 1680.0, -(1680 << 8)),
        (60.0 / 256.0, 1.0, 1),
        (-0.6 * 60.0 / 256.0, 1.0, -1),
        (60.0 * 8_388_607.0, 1.0, 8_388_607 << 8),
        (-60.0 * 8_388_607.0, 1.0, -(8_388_607 << 8)),
    ] {
        assert_eq!(CountsPerSecond::from_rpm(rpm, counts), speed(bits), "{rpm}");
    }
    for (rpm, counts) in [
        (60.0 * 8_388_608.0, 1.0),
        (-60.0 * 8_388_608.0, 1.0),
        (f64::NAN, 1.0),
        (f64::INFINITY, 1.0),
        (f64::MAX, f64::MAX),
        (60.0, 0.0),
        (60.0, -1.0),
        (0.0, f64::INFINITY),
    ] {
        assert_eq!(CountsPerSecond::from_rpm(rpm, counts), Err(RangeError::Speed), "{rpm} {counts}");
    }
}
