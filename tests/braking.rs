//! Placement of every control value among the points, for many speeds and battery voltages.

use motor_hub::braking::{Blend, BlendFraction, OperatingPoint, Placement, Points, Regime, Scheme, place};
use motor_hub::bridge::{Drive, Mode};
use motor_hub::units::{Control, CountsPerSecond, EmfConstant, Millivolts};

fn fraction(bits: u32) -> Scheme {
    Scheme::D(Blend::Fixed(BlendFraction::from_bits(bits).expect("at most 1")))
}

fn schemes() -> [Scheme; 8] {
    [
        Scheme::ForwardReverse,
        Scheme::A,
        Scheme::B,
        Scheme::C,
        fraction(0),
        fraction(1 << 14),
        fraction(1 << 16),
        Scheme::D(Blend::Automatic),
    ]
}

/// Back EMF of `cps` for a NeveRest 60 on `battery_mv`.
fn at(cps: i32, battery_mv: u16) -> OperatingPoint {
    let neverest_60 = EmfConstant::from_bits(4_180_495).expect("in range");
    OperatingPoint::new(neverest_60.emf(CountsPerSecond::new(cps)), Millivolts::new(battery_mv))
        .expect("battery")
}

/// Speeds from standstill to 40 times the free speed, clockwise.
const SPEEDS: [i32; 14] = [0, 1, 2, 30, 272, 800, 1360, 1500, 2400, 2720, 3009, 3010, 3011, 100_000];
const BATTERIES: [u16; 5] = [1, 6_500, 9_500, 12_000, u16::MAX];

fn every_control() -> impl Iterator<Item = Control> {
    (-i16::MAX..=i16::MAX).map(Control::new)
}

/// A number that grows with the torque that a placement asks for: regime first, then duty.
fn order(placement: Placement) -> i32 {
    let duty = i32::from(placement.drive.duty.to_bits());
    match placement.regime {
        Regime::Reverse => -(1 << 16) - duty,
        Regime::Braking => -duty,
        Regime::Forward => duty,
    }
}

#[test]
fn torque_never_falls_as_control_rises() {
    for scheme in schemes() {
        for (cps, battery) in SPEEDS.iter().flat_map(|&s| BATTERIES.map(|b| (s, b))) {
            let at = at(cps, battery);
            let mut last = i32::MIN;
            for control in every_control() {
                let rank = order(place(scheme, at, control));
                assert!(rank >= last, "{scheme:?} {cps} cps {battery} mV at {}", control.get());
                last = rank;
            }
        }
    }
}

#[test]
fn regimes_meet_without_gap_or_overlap() {
    for scheme in schemes() {
        for (cps, battery) in SPEEDS.iter().flat_map(|&s| BATTERIES.map(|b| (s, b))) {
            let at = at(cps, battery);
            let points = Points::new(scheme, at);
            let t = points.t.to_f64();
            let z = points.z.to_f64();
            let (s, g) = (points.s.to_f64(), points.g.to_f64());
            assert!(s < t && t <= z && z <= g.max(z), "{scheme:?} {points:?}");
            for control in every_control() {
                let c = f64::from(control.get());
                let placement = place(scheme, at, control);
                let (regime, wanted) = if c > z {
                    (Regime::Forward, (c - z) / (g - z))
                } else if c >= t {
                    (Regime::Braking, if t == z { 0.0 } else { (z - c) / (z - t) })
                } else {
                    (Regime::Reverse, (t - c) / (t - s))
                };
                assert_eq!(placement.regime, regime, "{scheme:?} {cps} cps {battery} mV at {c}");
                let error = placement.drive.duty.to_f64() - wanted;
                assert!(error.abs() <= 0.5 / 32768.0 + 1e-12, "{scheme:?} {cps} {battery} at {c}: {error}");
            }
        }
    }
}

#[test]
fn the_ends_of_the_control_range_are_full_drive_where_the_scheme_keeps_them() {
    for (cps, battery) in [(0, 12_000), (800, 6_500), (1360, 12_000), (2700, 12_000)] {
        let at = at(cps, battery);
        for scheme in [Scheme::A, Scheme::B, Scheme::ForwardReverse] {
            let full_reverse = place(scheme, at, Control::MIN);
            assert_eq!(full_reverse.regime, Regime::Reverse);
            assert_eq!(full_reverse.drive.duty.to_f64(), 1.0);
            let full_forward = place(scheme, at, Control::MAX);
            assert_eq!(full_forward.regime, Regime::Forward);
            assert_eq!(full_forward.drive.duty.to_f64(), 1.0);
        }
    }
}

#[test]
fn counter_clockwise_is_the_mirror_image() {
    for scheme in schemes() {
        for (cps, battery) in [(1, 12_000), (800, 6_500), (1360, 12_000), (3010, 12_000), (9000, 6_500)] {
            let (cw, ccw) = (at(cps, battery), at(-cps, battery));
            for control in every_control() {
                let there = place(scheme, cw, control);
                let here = place(scheme, ccw, -control);
                assert_eq!(there.regime, here.regime);
                assert_eq!(there.drive.duty, here.drive.duty);
                assert_eq!(there.drive.mode, here.drive.mode.mirrored());
            }
        }
    }
}

#[test]
fn at_standstill_t_and_z_coincide_and_every_scheme_drives_in_the_same_way() {
    let at = at(0, 12_000);
    for scheme in schemes() {
        let points = Points::new(scheme, at);
        assert_eq!((points.t, points.z), (Points::new(Scheme::A, at).t, Points::new(Scheme::A, at).z));
        assert_eq!(place(scheme, at, Control::ZERO).drive, Drive::COAST);
        assert_eq!(place(scheme, at, Control::new(1)).drive.mode, Mode::Cw98);
        assert_eq!(place(scheme, at, Control::new(-1)).drive.mode, Mode::Ccw62);
    }
}

#[test]
fn a_regime_lies_where_the_paper_puts_it() {
    // Scheme A at half of the battery voltage: T at 0, Z at half of the range.
    let half = at(1505, 12_000);
    assert_eq!(place(Scheme::A, half, Control::new(-1)).drive.mode, Mode::Ccw62);
    assert_eq!(place(Scheme::A, half, Control::ZERO).drive, Drive::BRAKE);
    assert_eq!(place(Scheme::A, half, Control::new(16_000)).drive.mode, Mode::Brake50);
    assert_eq!(place(Scheme::A, half, Control::new(17_000)).drive.mode, Mode::Cw98);
    // Scheme B: Z at 0, T at a third of the range.
    assert_eq!(place(Scheme::B, half, Control::ZERO).drive, Drive::COAST);
    assert_eq!(place(Scheme::B, half, Control::new(1)).drive.mode, Mode::Cw98);
    assert_eq!(place(Scheme::B, half, Control::new(-10_900)).drive.mode, Mode::Brake50);
    assert_eq!(place(Scheme::B, half, Control::new(-10_930)).drive.mode, Mode::Ccw62);
    // Scheme C: T just reaches the end of the range at half of the battery voltage.
    assert!((Points::new(Scheme::C, half).t.to_f64() + 32_767.0).abs() < 40.0);
    // No braking regime at all.
    assert_eq!(place(Scheme::ForwardReverse, half, Control::new(-1)).drive.mode, Mode::Ccw62);
}

#[test]
fn in_overrun_scheme_a_only_brakes_and_schemes_c_and_d_are_scheme_b() {
    let over = at(3300, 12_000);
    for control in every_control() {
        let a = place(Scheme::A, over, control).regime;
        assert_eq!(a == Regime::Reverse, control < Control::ZERO);
        assert_ne!(a, Regime::Forward);
        let b = place(Scheme::B, over, control);
        for scheme in [Scheme::C, fraction(1 << 15), Scheme::D(Blend::Automatic)] {
            assert_eq!(place(scheme, over, control), b, "{scheme:?}");
        }
    }
}

#[test]
fn the_automatic_blend_keeps_full_dynamic_braking_in_the_control_range() {
    let mut below_c = 0;
    for cps in 0..3010 {
        let at = at(cps, 12_000);
        let points = Points::new(Scheme::D(Blend::Automatic), at);
        assert!(points.t.to_f64() >= -32_767.0, "{cps} cps: {points:?}");
        let c = Points::new(Scheme::C, at);
        if c.t < points.t {
            below_c += 1;
            // It gives up no more of C than it must: one step of the blend.
            let step = c.t.to_f64().abs() / 65_536.0;
            assert!(points.t.to_f64() < -32_766.0 + 1.1 * step, "{cps} cps: {points:?}");
        } else {
            assert_eq!(points, c);
        }
    }
    assert!((1490..1520).contains(&below_c), "{below_c}: C loses full braking above half speed");
}

#[test]
fn schemes_c_and_d_have_no_formula_where_the_emf_equals_the_battery() {
    // 1 mV s/count at 12 000 counts/s.
    let emf = EmfConstant::from_bits(1 << 20).expect("in range").emf(CountsPerSecond::new(12_000));
    let at = OperatingPoint::new(emf, Millivolts::new(12_000)).expect("battery");
    for scheme in [Scheme::C, fraction(1 << 14), Scheme::D(Blend::Automatic)] {
        assert_eq!(Points::from_formula(scheme, at), None);
        assert_eq!(Points::new(scheme, at), Points::new(Scheme::B, at));
    }
}

#[test]
fn points_hold_at_both_ends_of_emf_and_battery() {
    for cps in [0, 1, i32::MAX] {
        for battery in [1, u16::MAX] {
            let constant = EmfConstant::from_bits((1 << 25) - 1).expect("largest");
            let at = OperatingPoint::new(constant.emf(CountsPerSecond::new(cps)), Millivolts::new(battery));
            let at = at.expect("battery");
            for scheme in schemes() {
                let points = Points::new(scheme, at);
                for control in [Control::MIN, Control::new(-1), Control::ZERO, Control::new(1), Control::MAX]
                {
                    let _ = points.place(control);
                }
            }
        }
    }
    assert_eq!(OperatingPoint::new(Default::default(), Millivolts::new(0)), None);
}
