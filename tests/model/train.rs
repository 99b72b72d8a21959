//! Compares a plant behind a train, with backlash and a compliant shaft, with integration in small steps and with the
//! conservation of energy.

use crate::{BATTERY, BRIDGE, am60, rk4};
use motor_hub::bridge::Mode;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::friction::{Cogging, Friction};
use motor_hub::model::load::Load;
use motor_hub::model::plant::{Flow, Plant, PlantInput};
use motor_hub::model::si::{Amps, Drag, Hertz, KgM2, NewtonMetres, RadPerSec, Seconds, Volts};
use motor_hub::model::train::Train;

const LOAD: Load =
    Load { inertia_after: KgM2(0.01), drag_after: Drag(0.01), torque_after: NewtonMetres(-0.3) };

fn train(backlash_degrees: f64, stiffness_after: f64, damping_after: f64) -> Train {
    Train { backlash_after: backlash_degrees.to_radians(), stiffness_after, damping_after }
}

fn plant(motor: Motor, load: Load, train: Train) -> Plant {
    Plant::new(motor, load, BRIDGE, Hertz(20e3)).with_train(train)
}

/// Motor and load as five equations: current, and speed and angle of both. All closed switches conduct both ways.
struct Reference {
    motor: Motor,
    train: Train,
    state: [f64; 5],
}

impl Reference {
    fn slope(&self, volts: f64, [i, wm, pm, wl, pl]: [f64; 5]) -> [f64; 5] {
        let Motor { r, l, ke, kt, b, j, eta, gear_ratio: n, .. } = self.motor;
        let reflection = 1.0 / (eta * n * n);
        let gap = 0.5 * n * self.train.backlash_after;
        let theta = pm - pl;
        let twist = theta - theta.clamp(-gap, gap);
        let linear = reflection * (self.train.stiffness_after * twist + self.train.damping_after * (wm - wl));
        // Teeth push and never pull.
        let coupling = if gap == 0.0 || twist * linear > 0.0 { linear } else { 0.0 };
        let load_torque = LOAD.torque_after.0 / (eta * n) + coupling - reflection * LOAD.drag_after.0 * wl;
        [
            (volts - (r.0 + 2.0 * BRIDGE.ron.0) * i - ke.0 * wm) / l.0,
            (kt.0 * i - b.0 * wm - coupling) / j.0,
            wm,
            load_torque / (reflection * LOAD.inertia_after.0),
            wl,
        ]
    }

    fn step(&mut self, volts: f64, h: f64) {
        self.state = rk4(self.state, h, |x| self.slope(volts, x));
    }
}

#[test]
fn a_train_agrees_with_integration_in_small_steps_within_a_thousandth() {
    for train in [train(0.0, 30.0, 0.02), train(2.0, 300.0, 0.1), train(10.0, 60.0, 0.0)] {
        let mut reference = Reference { motor: am60(), train, state: [0.0; 5] };
        let mut plant = plant(am60(), LOAD, train);
        // The motor is driven up, and then against its motion. The teeth of the gear separate, and meet on their other
        // sides.
        for (mode, volts, ms) in [(Mode::Cw98, BATTERY, 60), (Mode::Ccw62, -BATTERY, 60)] {
            for _ in 0..ms {
                (0..1_000).for_each(|_| reference.step(volts, 1e-6));
                plant.run(Seconds(1e-3), PlantInput::pwm(mode, 1.0), Volts(BATTERY));
                let [_, wm, pm, wl, pl] = reference.state;
                let n = am60().gear_ratio;
                let free = BATTERY / am60().ke.0;
                let misses = [
                    (plant.speed().0 - wm) / free,
                    (n * plant.speed_after().0 - wl) / free,
                    (plant.angle() - pm) / (0.06 * free),
                    (n * plant.angle_after() - pl) / (0.06 * free),
                ];
                let miss = misses.iter().map(|miss| miss.abs()).fold(0.0, f64::max);
                assert!(miss < 1e-3, "{train:?}: {misses:?}");
            }
        }
    }
}

#[test]
fn a_stiff_train_without_backlash_is_a_rigid_load() {
    let command = PlantInput::pwm(Mode::Cw98, 0.4);
    let mut rigid = Plant::new(am60(), LOAD, BRIDGE, Hertz(20e3));
    let mut stiff = plant(am60(), LOAD, train(0.0, 2e4, 5.0));
    for _ in 0..100 {
        rigid.run(Seconds(1e-3), command, Volts(BATTERY));
        stiff.run(Seconds(1e-3), command, Volts(BATTERY));
    }
    assert!((rigid.speed().0 / stiff.speed().0 - 1.0).abs() < 2e-3, "{} {}", rigid.speed(), stiff.speed());
}

#[test]
fn a_train_conserves_energy() {
    let smooth = Motor { b: Drag(0.0), ..am60() };
    let coulomb = NewtonMetres(0.03 * smooth.stall_torque(Volts(BATTERY)).0);
    let rough = Motor {
        friction: Friction::with_coulomb(coulomb),
        cogging: Cogging { amplitude: coulomb, per_turn: 6 },
        ..smooth
    };
    for (name, motor) in [("smooth", smooth), ("rough", rough)] {
        for train in [train(0.0, 30.0, 0.02), train(2.0, 300.0, 0.1), train(10.0, 60.0, 0.0)] {
            let mut plant = plant(motor, Load::inertia(KgM2(0.01)), train);
            let mut flow = Flow::default();
            for mode in [Mode::Cw98, Mode::Ccw62, Mode::Brake50] {
                flow.append(&plant.run(Seconds(0.05), PlantInput::pwm(mode, 0.7), Volts(BATTERY)));
            }
            let kept = plant.motion_energy().0 + motor.cogging.energy(plant.angle()).0;
            let lost = flow.friction_heat.0 + flow.train_heat.0;
            let scale = flow.shaft_work.0.abs() + lost + kept;
            let miss = (flow.shaft_work.0 - kept - lost) / scale;
            assert!(miss.abs() < 1e-3, "{name}, {train:?}: {miss:.1e} of {scale} J");
            assert_eq!(flow.train_heat.0 > 0.0, train.damping_after > 0.0);
        }
    }
}

#[test]
fn a_load_that_becomes_heavier_keeps_the_speed_and_its_energy_is_accounted_for() {
    let smooth = Motor { b: Drag(0.0), ..am60() };
    let rigid = Plant::new(smooth, Load::inertia(KgM2(0.01)), BRIDGE, Hertz(20e3));
    for mut plant in [rigid.clone(), rigid.with_train(train(2.0, 300.0, 0.1))] {
        plant.run(Seconds(0.2), PlantInput::pwm(Mode::Cw98, 1.0), Volts(BATTERY));
        let (speed, before) = (plant.speed_after(), plant.motion_energy().0);
        plant.set_load(Load::inertia(KgM2(0.03)));
        assert_eq!(plant.speed_after(), speed);
        let added = 0.5 * 0.02 * speed.0 * speed.0 / smooth.eta;
        assert!((plant.motion_energy().0 - before - added).abs() < 1e-9 * before);
        let flow = plant.run(Seconds(0.1), PlantInput::COAST, Volts(BATTERY));
        assert!((flow.load_work.0 - added).abs() < 1e-9 * before);
        assert_eq!(plant.run(Seconds(0.1), PlantInput::COAST, Volts(BATTERY)).load_work.0, 0.0);
    }
}

#[test]
fn the_output_shaft_turns_freely_by_the_backlash_and_no_farther() {
    let mut plant = plant(am60(), LOAD, train(10.0, 500.0, 0.5));
    plant.run(Seconds(0.5), PlantInput::pwm(Mode::Cw98, 0.6), Volts(BATTERY));
    // The motor pushes its load, so it leads by half of the backlash, and by the twist of the shaft.
    let lead = plant.angle() / am60().gear_ratio - plant.angle_after();
    assert!((lead.to_degrees() - 5.0).abs() < 0.5, "{} degrees", lead.to_degrees());
    plant.set_state(Amps(0.0), RadPerSec(0.0), 0.0);
    assert_eq!((plant.speed_after(), plant.angle_after()), (RadPerSec(0.0), 0.0));
}
