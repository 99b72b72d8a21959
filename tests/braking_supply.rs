//! What a supply leaves of a placement: less is drawn, and what would be returned is burnt.

use motor_hub::braking::{DutyRule, place};
use motor_hub::braking::{OperatingPoint, Placement, Placer, Regime, Scheme, Winding};
use motor_hub::bridge::{BridgeConstants, Drive, Mode};
use motor_hub::model::catalogue::characterised;
use motor_hub::model::load::Load;
use motor_hub::model::plant::{Influence, Plant};
use motor_hub::model::si::{Amps, Hertz, KgM2, RadPerSec, Seconds, Volts};
use motor_hub::units::{Control, CountsPerSecond, Duty, Millivolts, Share};
use proptest::prelude::*;

const OHMS: f32 = 3.4;

fn at(cps: i32) -> OperatingPoint {
    let emf = Winding::NEVEREST_60.emf.emf(CountsPerSecond::new(cps));
    OperatingPoint::new(emf, Millivolts::new(12_000)).expect("there is a battery")
}

fn share(percent: u64) -> Share {
    Share::from_f32(percent as f32 / 100.0)
}

/// By Scheme A: half of 12 V is the back EMF of 1505 counts/s.
fn placed(cps: i32, control: i16) -> Placement {
    place(Scheme::A, at(cps), Control::new(control))
}

/// Of a bridge that obeys any duty.
fn placer() -> Placer {
    Placer::new(&Winding::NEVEREST_60, &BridgeConstants::VNH5019, Scheme::A, DutyRule::LinearDuty)
}

#[test]
fn proportional_braking_fades_to_a_full_short() {
    let braking = placed(1505, 8_000);
    assert_eq!(braking.regime, Regime::Braking);
    let duties: Vec<f64> =
        (0..=4).map(|n| placer().burning(braking, share(25 * n), at(1505)).drive.duty.to_f64()).collect();
    assert_eq!(placer().burning(braking, Share::NONE, at(1505)), braking);
    assert!(duties.windows(2).all(|pair| pair[0] < pair[1]), "{duties:?}");
    assert_eq!(placer().burning(braking, Share::ALL, at(1505)).drive, Drive::BRAKE);
}

#[test]
fn a_motor_that_is_braked_in_reverse_comes_to_the_same_full_short() {
    for cps in [1505, -1505] {
        let reverse = placed(cps, if cps > 0 { -16_000 } else { 16_000 });
        assert_eq!(reverse.regime, Regime::Reverse);
        let half = placer().burning(reverse, share(50), at(cps)).drive;
        assert_eq!(half.mode, reverse.drive.mode);
        assert!((half.duty.to_f64() - 0.5 * reverse.drive.duty.to_f64()).abs() < 1e-3);
        assert_eq!(placer().burning(reverse, Share::ALL, at(cps)).drive, Drive::BRAKE);
    }
}

#[test]
fn a_motor_that_is_driven_started_or_open_is_left_alone() {
    for (cps, control) in [(1505, 24_000), (0, -16_000), (100, -16_000)] {
        let placement = placed(cps, control);
        assert_eq!(placer().burning(placement, Share::ALL, at(cps)), placement, "{cps} {control}");
    }
    let open = Placement { drive: Drive::COAST, ..placed(1505, 8_000) };
    assert_eq!(placer().burning(open, Share::ALL, at(1505)).drive, Drive::COAST);
}

#[test]
fn nothing_to_draw_leaves_a_driven_motor_open_and_a_reversed_one_braked() {
    let cut = |cps, control| placer().drawing_at_most(placed(cps, control), Share::NONE, at(cps)).drive;
    assert_eq!(cut(1505, 24_000), Drive::COAST);
    assert_eq!(cut(1505, -16_000), Drive::BRAKE);
    assert_eq!(cut(1505, 8_000), placed(1505, 8_000).drive, "braking draws nothing");
}

proptest! {
    #[test]
    fn no_more_is_drawn_than_the_share(cps in -2_500i32..2_500, control in any::<i16>(), percent in 1u64..100) {
        let placement = placed(cps, Control::new(control).get());
        let drawing = placer().drawing_at_most(placement, share(percent), at(cps));
        prop_assert_eq!(drawing.drive.mode, placement.drive.mode);
        prop_assert!(drawing.drive.duty <= placement.drive.duty);
        let e = 3.98683e-3 * f64::from(cps.abs());
        let duty = drawing.drive.duty.to_f64();
        let push = match placement.regime {
            Regime::Forward => 12.0 * duty - e,
            Regime::Reverse => 12.0 * duty + e,
            Regime::Braking => return Ok(()),
        };
        // As a share of the stall current; the duty has 15 bits.
        prop_assert!(duty * push / 12.0 <= percent as f64 / 100.0 + 1e-3, "{} {}", duty, push);
    }

    #[test]
    fn burning_never_brakes_less_and_ends_nowhere_but_at_a_full_short(
        cps in 400i32..2_500, duty in 1u16..=32_768, percent in 0u64..=100,
    ) {
        let braking = Placement { drive: Drive { mode: Mode::Brake50, duty: Duty::from_bits(duty) }, ..placed(cps, 0) };
        let burning = placer().burning(braking, share(percent), at(cps)).drive;
        prop_assert_eq!(burning.mode, Mode::Brake50);
        prop_assert!(burning.duty >= braking.drive.duty);
    }
}

#[test]
fn what_goes_back_and_what_is_burnt_is_what_the_model_says() {
    let motor = characterised("AM 60 A").expect("known").with_measured_rotor_inertia();
    for cps in [800, 1505, 2500] {
        for percent in [10, 30, 50, 70, 90, 100] {
            let drive = Drive { mode: Mode::Brake50, duty: Duty::ratio(percent, 100) };
            let placement = Placement { drive, ..placed(cps, 0) };
            let flows = placer().flows(at(cps), placement);
            let told = placer().returned(at(cps), placement, flows, OHMS);
            // A flywheel so heavy that the speed stays.
            let load = Load { inertia_after: KgM2(100.0), ..Load::NONE };
            let mut plant = Plant::new(motor, load, BridgeConstants::VNH5019.into(), Hertz(20_000.0));
            let speed = f64::from(cps) / 28.0 * std::f64::consts::TAU;
            plant.place(Amps(0.0), RadPerSec(speed), 0.0);
            let influence = Influence::pwm(drive.mode, drive.duty.to_f64());
            plant.run(Seconds(0.005), influence, Volts(12.0));
            let flow = plant.run(Seconds(0.01), influence, Volts(12.0));
            let [returned, burnt] = [flow.energy_to_battery.0, flow.heat.0].map(|joules| joules / 0.01);
            for (what, told, truly) in [("returned", told.returned, returned), ("burnt", told.burnt, burnt)] {
                let miss = (f64::from(told) - truly).abs();
                assert!(
                    miss < 0.1 * (returned + burnt) + 0.02,
                    "{cps} {percent} %: {what} {told} W, {truly} W"
                );
            }
        }
    }
}
