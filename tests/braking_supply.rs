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
    Placer::new(&Winding::NEVEREST_60, &BridgeConstants::IDEAL, Scheme::A, DutyRule::LinearDuty)
}

#[test]
fn between_two_shorts_a_motor_is_driven_a_little_beyond_its_back_emf_and_the_further_the_higher_the_bus() {
    for cps in [1505, -1505] {
        let beyond = |percent| placer().beyond_emf(share(percent), at(cps)).expect("the bus can push");
        let emf = 3.98683e-3 * f64::from(cps);
        let shares: Vec<f64> =
            [0, 50, 100].map(|percent| f64::from(beyond(percent).asked.to_volts()) / emf).into();
        assert!(shares[0] > 1.05 && shares[2] < 1.5, "{shares:?}");
        assert!(shares.windows(2).all(|pair| pair[0] < pair[1]), "{shares:?}");
        assert_eq!(beyond(0).drive.mode, if cps > 0 { Mode::Cw98 } else { Mode::Ccw62 });
        let flows = placer().flows(at(cps), beyond(50)).to_volts();
        assert!((f64::from(flows) - shares[1] * emf).abs() < 0.02, "{flows} V");
    }
}

#[test]
fn a_bus_that_cannot_push_beyond_the_back_emf_drives_nothing() {
    assert_eq!(placer().beyond_emf(Share::NONE, at(2_900)), None);
    assert_eq!(placer().beyond_emf(Share::NONE, at(3_500)), None, "in overrun");
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
            let mut plant = Plant::new(motor, load, BridgeConstants::IDEAL.into(), Hertz(20_000.0));
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
