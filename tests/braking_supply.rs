//! Where the energy of a braking motor goes.

mod common;

use common::{BATTERY, inertia, neverest_60, plant};
use motor_hub::braking::{DutyRule, Modulator, OperatingPoint, Scheme, Winding};
use motor_hub::bridge::{BridgeConstants, Drive, Mode};
use motor_hub::model::plant::PlantInput;
use motor_hub::model::si::{Amps, RadPerSec, Seconds, Volts};
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
fn returned_and_dissipated_power_are_those_of_the_model() {
    for cps in [800, 1505, 2500] {
        for percent in [10, 30, 50, 70, 90, 100] {
            let drive = Drive { mode: Mode::Brake50, duty: Duty::ratio(percent, 100) };
            let command = modulator().modulation(at(cps), drive);
            let computed = modulator().braking_power(at(cps), command, OHMS);
            // The flywheel is so heavy that the speed does not change.
            let mut plant = plant(neverest_60(), inertia(100.0));
            let speed = f64::from(cps) / 28.0 * std::f64::consts::TAU;
            plant.set_state(Amps(0.0), RadPerSec(speed), 0.0);
            let influence = PlantInput::pwm(drive.mode, drive.duty.to_f64());
            plant.run(Seconds(0.005), influence, Volts(BATTERY));
            let flow = plant.run(Seconds(0.01), influence, Volts(BATTERY));
            let [returned, dissipated] = [flow.energy_to_battery.0, flow.heat.0].map(|joules| joules / 0.01);
            for (what, computed, truly) in [
                ("returned", computed.returned_watts, returned),
                ("dissipated", computed.dissipated_watts, dissipated),
            ] {
                let miss = (f64::from(computed) - truly).abs();
                assert!(
                    miss < 0.1 * (returned + dissipated) + 0.02,
                    "{cps} {percent} %: {what} {computed} W, {truly} W"
                );
            }
        }
    }
}
