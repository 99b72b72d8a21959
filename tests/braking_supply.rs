//! Where the energy of a braking motor goes.

use motor_hub::braking::{DutyRule, Modulation, Modulator, OperatingPoint, Regime, Scheme, Winding};
use motor_hub::bridge::{BridgeConstants, Drive, Mode};
use motor_hub::model::catalogue::characterised;
use motor_hub::model::load::Load;
use motor_hub::model::plant::{Plant, PlantInput};
use motor_hub::model::si::{Amps, Hertz, KgM2, RadPerSec, Seconds, Volts};
use motor_hub::units::{CountsPerSecond, Duty, Millivolts};

const OHMS: f32 = 3.4;

fn at(cps: i32) -> OperatingPoint {
    let emf = Winding::NEVEREST_60.emf.emf(CountsPerSecond::new(cps));
    OperatingPoint::new(emf, Millivolts::new(12_000)).expect("there is a battery")
}

/// The modulator of a bridge that may have any duty.
fn modulator() -> Modulator {
    Modulator::new(&Winding::NEVEREST_60, &BridgeConstants::IDEAL, Scheme::A, DutyRule::LinearDuty)
}

#[test]
fn what_goes_back_and_what_is_burnt_is_what_the_model_says() {
    let motor = characterised("AM 60 A").expect("known").with_measured_rotor_inertia();
    for cps in [800, 1505, 2500] {
        for percent in [10, 30, 50, 70, 90, 100] {
            let drive = Drive { mode: Mode::Brake50, duty: Duty::ratio(percent, 100) };
            let braking = Modulation { regime: Regime::Braking, drive };
            let flows = modulator().applied(at(cps), braking);
            let energy = modulator().returned(at(cps), braking, flows, OHMS);
            // A flywheel so heavy that the speed stays.
            let load = Load { inertia_after: KgM2(100.0), ..Load::NONE };
            let mut plant = Plant::new(motor, load, BridgeConstants::IDEAL.into(), Hertz(20_000.0));
            let speed = f64::from(cps) / 28.0 * std::f64::consts::TAU;
            plant.place(Amps(0.0), RadPerSec(speed), 0.0);
            let influence = PlantInput::pwm(drive.mode, drive.duty.to_f64());
            plant.run(Seconds(0.005), influence, Volts(12.0));
            let flow = plant.run(Seconds(0.01), influence, Volts(12.0));
            let [returned, burnt] = [flow.energy_to_battery.0, flow.heat.0].map(|joules| joules / 0.01);
            for (what, modelled, truly) in
                [("returned", energy.returned, returned), ("burnt", energy.burnt, burnt)]
            {
                let miss = (f64::from(modelled) - truly).abs();
                assert!(
                    miss < 0.1 * (returned + burnt) + 0.02,
                    "{cps} {percent} %: {what} {modelled} W, {truly} W"
                );
            }
        }
    }
}
