//! The bus of the model: energy is conserved, a source that cannot sink takes no current, and bridges switch themselves
//! off.

use crate::{BRIDGE, am60};
use motor_hub::bridge::{Mode, State};
use motor_hub::model::battery::Battery;
use motor_hub::model::bus::{Bus, Protection, Shutdown};
use motor_hub::model::load::Load;
use motor_hub::model::plant::{Flow, Plant, PlantInput};
use motor_hub::model::rig::Rig;
use motor_hub::model::si::{Amps, Hertz, KgM2, Ohms, RadPerSec, Seconds, Volts};

const SOURCE: Battery = Battery { emf: Volts(12.0), resistance: Ohms(0.05) };

/// A NeveRest 60 that turns a flywheel at this share of the speed whose back EMF is 12 V, on 1000 uF.
fn spinning(share: f64, bus: impl FnOnce(&mut Bus)) -> Rig {
    let motor = am60();
    let mut plant = Plant::new(motor, Load::inertia(KgM2(0.2)), BRIDGE, Hertz(20_000.0));
    plant.set_state(Amps(0.0), RadPerSec(share * 12.0 / motor.ke.0), 0.0);
    let mut capacitor = Bus::new(SOURCE, 1e-3);
    bus(&mut capacitor);
    Rig::new(SOURCE, vec![plant]).with_bus(capacitor)
}

fn unprotected(bus: &mut Bus) {
    bus.one_way = true;
    bus.protection = Protection::NONE;
}

/// Magnetic energy of the winding.
fn magnetic(rig: &Rig) -> f64 {
    let plant = &rig.plants[0];
    0.5 * plant.motor().l.0 * plant.current().0 * plant.current().0
}

#[test]
fn source_capacitor_winding_shaft_and_heat_balance_to_1e_9() {
    type Kind = (&'static str, fn(&mut Bus));
    let kinds: [Kind; 3] = [
        ("sinks", |_| ()),
        ("one way", unprotected),
        ("open", |bus| (bus.closed, bus.protection) = (false, Protection::NONE)),
    ];
    for (name, kind) in kinds {
        for (mode, duty) in
            [(Mode::Cw98, 0.9), (Mode::Brake50, 0.5), (Mode::Brake50, 0.05), (Mode::Ccw62, 0.1)]
        {
            let mut rig = spinning(0.7, kind);
            let before = rig.bus.expect("there").stored().0;
            let flow = rig.run(Seconds(0.02), &[PlantInput::pwm(mode, duty)])[0];
            let bus = rig.bus.expect("there");
            // What left the source is in the capacitor and the winding, or became heat and motion.
            let found =
                bus.stored().0 - before + bus.lost().0 + magnetic(&rig) + flow.heat.0 + flow.shaft_work.0;
            let moved = flow.energy_from_battery.0 + flow.energy_to_battery.0 + bus.delivered().0.abs();
            let miss = (found - bus.delivered().0).abs();
            assert!(miss <= 1e-9 * moved.max(1.0), "{name}, {} at {duty}: {miss} J of {moved}", mode.name());
        }
    }
}

#[test]
fn proportional_braking_lifts_a_bus_that_cannot_sink_beyond_what_bridges_stand() {
    // Mode 5/0 at a fixed duty, with 0.2 kg m² at 80 % of the free speed. No bridge switches itself off.
    let mut rig = spinning(0.8, unprotected);
    rig.run(Seconds(2.0), &[PlantInput::pwm(Mode::Brake50, 0.5)]);
    let (_, highest) = rig.range();
    assert!(highest.0 > 41.0, "the absolute maximum of a VNH5019 is 41 V: {highest}");
    // A battery takes the energy. A full short returns none.
    let mut rig = spinning(0.8, |_| ());
    rig.run(Seconds(2.0), &[PlantInput::pwm(Mode::Brake50, 0.5)]);
    assert!(rig.range().1.0 < 12.2, "{}", rig.range().1);
    let mut rig = spinning(0.8, unprotected);
    rig.run(Seconds(2.0), &[PlantInput::pwm(Mode::Brake50, 1.0)]);
    assert!(rig.range().1.0 < 12.01, "{}", rig.range().1);
}

#[test]
fn a_contactor_that_opens_in_mid_braking_leaves_the_bus_to_the_motor() {
    let mut rig = spinning(0.8, |_| ());
    let braking = [PlantInput::pwm(Mode::Brake50, 0.5)];
    rig.run(Seconds(0.1), &braking);
    assert!(rig.voltage().0 < 12.2);
    rig.bus.as_mut().expect("there").closed = false;
    rig.run(Seconds(0.1), &braking);
    assert!(rig.voltage().0 > 18.0, "{}", rig.voltage());
}

#[test]
fn a_bridge_opens_on_over_voltage_and_stays_open_until_its_lines_change() {
    let mut rig = spinning(0.8, |bus| bus.one_way = true);
    let braking = [PlantInput::pwm(Mode::Brake50, 0.5)];
    rig.run(Seconds(0.5), &braking);
    assert_eq!(rig.shutdowns(), [Shutdown::Over(State::BrakeLow, State::Coast)]);
    assert!(rig.range().1.0 < Protection::VNH5019.over.0 + 1.0, "{}", rig.range().1);
    let coasting = rig.run(Seconds(0.1), &braking)[0];
    assert!(coasting.shaft_work.0.abs() < 1e-6, "it brakes no more");
    // New levels of the lines close the bridge again, after the bus voltage has fallen.
    rig.bus = Some(Bus::new(SOURCE, 1e-3));
    rig.run(Seconds(1e-3), &braking);
    assert_ne!(rig.shutdowns(), [Shutdown::None], "the same lines do not");
    let driving = rig.run(Seconds(1e-3), &[PlantInput::pwm(Mode::Cw98, 1.0)])[0];
    assert_eq!(rig.shutdowns(), [Shutdown::None]);
    assert!(driving.charge.0 > 0.0);
}

#[test]
fn a_bridge_opens_on_under_voltage_and_comes_back_with_hysteresis() {
    let lines = (State::DriveCw, State::HighLeft);
    let mut shutdown = Shutdown::None;
    let seen = [4.6, 4.4, 4.6, 4.9, 5.1, 4.6].map(|volts| {
        shutdown = shutdown.step(&Protection::VNH5019, Volts(volts), lines);
        shutdown == Shutdown::None
    });
    assert_eq!(seen, [true, false, false, false, true, true]);
}

#[test]
fn a_capacitor_that_is_drawn_on_recovers_by_its_source() {
    let mut rig = spinning(0.0, |_| ());
    let driving = [PlantInput::pwm(Mode::Cw98, 1.0)];
    let flow: Flow = rig.run(Seconds(0.05), &driving)[0];
    let sag = 12.0 - rig.voltage().0;
    let drawn = flow.battery_charge() / 0.05;
    assert!(sag > 0.05 && (sag - drawn * 0.05).abs() < 0.1 * sag, "{sag} V at {drawn} A");
    rig.run(Seconds(0.01), &[]);
    assert!((rig.voltage().0 - 12.0).abs() < 1e-6);
}
