//! Tests the bridge command of every control value, for many speeds and battery voltages.

use motor_hub::braking::{
    Blend, BlendFraction, Location, OperatingPoint, Points, Regime, Scheme, UnboundedControl, Winding,
    linear_duty,
};
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

/// Operating point of a NeveRest 60 that turns at `cps` counts/s on a battery of `battery_mv`.
fn at(cps: i32, battery_mv: u16) -> OperatingPoint {
    let neverest_60 = Winding::NEVEREST_60.emf;
    OperatingPoint::new(neverest_60.emf(CountsPerSecond::new(cps)), Millivolts::new(battery_mv))
        .expect("battery")
}

/// Speeds in counts/s from standstill to 33 times the speed whose back EMF is 12 V, clockwise.
const SPEEDS: [i32; 14] = [0, 1, 2, 30, 272, 800, 1360, 1500, 2400, 2720, 3009, 3010, 3011, 100_000];
const BATTERIES: [u16; 5] = [1, 6_500, 9_500, 12_000, u16::MAX];

fn every_control() -> impl Iterator<Item = Control> {
    (-i16::MAX..=i16::MAX).map(Control::new)
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
                let placement = linear_duty(scheme, at, control);
                let (regime, wanted) = if c > z {
                    (Regime::Forward, (c - z) / (g - z))
                } else if c >= t {
                    (Regime::Braking, if t == z { 0.0 } else { (z - c) / (z - t) })
                } else {
                    (Regime::Reverse, (t - c) / (t - s))
                };
                assert_eq!(at.regime(placement), regime, "{scheme:?} {cps} cps {battery} mV at {c}");
                let error = placement.duty.to_f64() - wanted;
                assert!(error.abs() <= 0.5 / 32768.0 + 1e-12, "{scheme:?} {cps} {battery} at {c}: {error}");
            }
        }
    }
}

#[test]
fn counter_clockwise_is_the_mirror_image() {
    for scheme in schemes() {
        for (cps, battery) in [(1, 12_000), (800, 6_500), (1360, 12_000), (3010, 12_000), (9000, 6_500)] {
            let (cw, ccw) = (at(cps, battery), at(-cps, battery));
            for control in every_control() {
                let there = linear_duty(scheme, cw, control);
                let here = linear_duty(scheme, ccw, control.reversed());
                assert_eq!(cw.regime(there), ccw.regime(here));
                assert_eq!(there.duty, here.duty);
                assert_eq!(there.mode, here.mode.mirrored());
            }
        }
    }
}

#[test]
fn a_regime_lies_where_the_paper_puts_it() {
    // Scheme A at half of the battery voltage: T at 0, Z at half of the range.
    let half = at(1505, 12_000);
    assert_eq!(linear_duty(Scheme::A, half, Control::new(-1)).mode, Mode::Ccw62);
    assert_eq!(linear_duty(Scheme::A, half, Control::ZERO), Drive::BRAKE);
    assert_eq!(linear_duty(Scheme::A, half, Control::new(16_000)).mode, Mode::Brake50);
    assert_eq!(linear_duty(Scheme::A, half, Control::new(17_000)).mode, Mode::Cw98);
    // Scheme B: Z at 0, T at minus a third of the range.
    assert_eq!(linear_duty(Scheme::B, half, Control::ZERO), Drive::COAST);
    assert_eq!(linear_duty(Scheme::B, half, Control::new(1)).mode, Mode::Cw98);
    assert_eq!(linear_duty(Scheme::B, half, Control::new(-10_900)).mode, Mode::Brake50);
    assert_eq!(linear_duty(Scheme::B, half, Control::new(-10_930)).mode, Mode::Ccw62);
    // Scheme C: at half of the battery voltage T is at the lower end of the range.
    assert!((Points::new(Scheme::C, half).t.to_f64() + 32_767.0).abs() < 40.0);
    // Without a braking regime, negative control values drive in reverse.
    assert_eq!(linear_duty(Scheme::ForwardReverse, half, Control::new(-1)).mode, Mode::Ccw62);
}

#[test]
fn in_overrun_scheme_a_only_brakes_and_schemes_c_and_automatic_d_brake_fully_at_the_end_of_the_range() {
    let over = at(3300, 12_000);
    for control in every_control() {
        let a = over.regime(linear_duty(Scheme::A, over, control));
        assert_eq!(a == Regime::Reverse, control < Control::ZERO);
        assert_ne!(a, Regime::Forward);
        for scheme in [Scheme::C, fraction(1 << 16), Scheme::D(Blend::Automatic)] {
            let share = 0.max(-i32::from(control.get())) * 32_768;
            let placement = linear_duty(scheme, over, control);
            assert_eq!(over.regime(placement) == Regime::Forward, control > Control::ZERO, "{scheme:?}");
            if control <= Control::ZERO {
                assert_eq!(over.regime(placement), Regime::Braking, "{scheme:?}");
                let error = i32::from(placement.duty.to_bits()) * 32_767 - share;
                assert!(error.abs() <= 32_767 / 2, "{scheme:?} at {}", control.get());
            }
        }
    }
}

#[test]
fn the_points_are_the_papers_up_to_nine_tenths_of_the_battery_voltage() {
    for scheme in schemes() {
        for cps in 0..=2708 {
            let at = at(cps, 12_000);
            assert_eq!(Some(Points::new(scheme, at)), Points::from_formula(scheme, at), "{cps} cps");
        }
    }
}

#[test]
fn a_fixed_blend_lies_between_b_and_c_and_full_braking_comes_within_reach_in_overrun() {
    for cps in 0..6600 {
        let at = at(cps, 12_000);
        let [b, c] = [Scheme::B, Scheme::C].map(|scheme| Points::new(scheme, at));
        for bits in [0, 1, 1 << 8, 1 << 14, 1 << 16] {
            let d = Points::new(fraction(bits), at);
            assert!(c.t <= d.t && d.t <= b.t && c.s <= d.s && d.s <= b.s, "{cps} cps: {d:?}");
            assert!(!at.is_overrun() || d.t >= UnboundedControl::of(Control::MIN), "{cps} cps: {d:?}");
        }
        assert_eq!(Points::new(fraction(0), at), b);
        assert_eq!(Points::new(fraction(1 << 16), at), c);
    }
}

/// Returns the torque of a regime and a fraction, as a share of the stall torque. It is the current that the fraction
/// stands for.
fn torque(place: Location, u: f64) -> f64 {
    let f = place.fraction.to_f64();
    match place.regime {
        Regime::Forward => f * (1.0 - u),
        Regime::Braking => -f * u,
        Regime::Reverse => -(u + f),
    }
}

#[test]
fn torque_does_not_jump_as_the_speed_passes_the_free_speed() {
    // A change of u changes the torque by at most 12 times as much, and with a fixed blend by 55 times: 1.8 % from one
    // count/s to the next. The worst case is a blend of 0.05 at u = 0.91. The rounding of an abscissa is added.
    let steepest = |scheme| if matches!(scheme, Scheme::D(Blend::Fixed(_))) { 55.0 } else { 12.0 };
    for battery in [6_500, 9_500, 12_000, 14_500] {
        let full = f64::from(battery) / (f64::from(Winding::NEVEREST_60.emf.to_bits()) / f64::from(1 << 20));
        for scheme in schemes().into_iter().chain([fraction(1), fraction(1 << 10), fraction(3_120)]) {
            for control in (-32_767..=32_767).step_by(1_057).map(Control::new) {
                let mut last = None;
                for cps in 0..(2.2 * full) as i32 {
                    let place = Points::new(scheme, at(cps, battery)).locate(control);
                    let now = torque(place, f64::from(cps) / full);
                    let jump = last.map_or(0.0, |last: f64| (now - last).abs());
                    let most = steepest(scheme) / full + 1e-5;
                    assert!(jump < most, "{scheme:?} {} at {cps} cps {battery} mV: {jump}", control.get());
                    last = Some(now);
                }
            }
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
            // The automatic blend differs from Scheme C by no more than necessary, with a resolution of one step of the
            // blend.
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
        // The points are nearly the same at a back EMF just below the battery voltage, where the formula is defined.
        let below =
            EmfConstant::from_bits((1 << 20) - 1).expect("in range").emf(CountsPerSecond::new(12_000));
        let below = OperatingPoint::new(below, Millivolts::new(12_000)).expect("battery");
        let (here, there) = (Points::new(scheme, at), Points::new(scheme, below));
        assert!((here.t.to_f64() - there.t.to_f64()).abs() < 1.0, "{here:?} {there:?}");
        assert!((here.s.to_f64() - there.s.to_f64()).abs() < 1.0, "{here:?} {there:?}");
    }
}

#[test]
fn points_of_any_bits_are_limited_and_locate_every_control_value() {
    let [low, high] = [i64::MIN, i64::MAX].map(UnboundedControl::from_bits);
    assert_eq!((low.to_f64(), high.to_f64()), (-137_438_953_472.0, 137_438_953_472.0));
    assert_eq!((low.round(), high.round()), (-(1 << 37), 1 << 37));
    let ends = Points { s: low, t: low, z: high, g: high };
    let turned = Points { s: high, t: high, z: low, g: low };
    for control in [Control::MIN, Control::ZERO, Control::MAX] {
        assert_eq!(ends.locate(control).regime, Regime::Braking, "{control:?}");
        assert_eq!(turned.locate(control).regime, Regime::Forward, "{control:?}");
    }
}
