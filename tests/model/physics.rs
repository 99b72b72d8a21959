//! The model compared with first principles: integration in small steps, and conservation laws.

use crate::{BATTERY, BRIDGE, am60, close, motor, rk4};
use motor_hub::bridge::{Mode, State};
use motor_hub::model::battery::Battery;
use motor_hub::model::catalogue::{Motor, motors};
use motor_hub::model::friction::{Cogging, Friction};
use motor_hub::model::load::{Load, Shaft};
use motor_hub::model::periodic::Conduction;
use motor_hub::model::plant::{Flow, Plant, PlantInput, counts};
use motor_hub::model::response::{Applied, GearedMotor, Motion};
use motor_hub::model::rig::Rig;
use motor_hub::model::si::{
    Amps, Drag, Hertz, KgM2, Kilograms, Metres, NewtonMetres, Ohms, RadPerSec, Seconds, Volts,
};
use motor_hub::model::switching::{Circuit, Conditions, Integrals, Pwm};

const MODES: [Mode; 3] = [Mode::Cw98, Mode::Ccw62, Mode::Brake50];

fn at(emf: f64) -> Conditions {
    Conditions { battery: Volts(BATTERY), emf: Volts(emf) }
}

/// Voltage across the motor, from the potentials of its two terminals. A closed switch connects its terminal to a rail
/// through `Ron`. If both switches of a terminal are open, the current flows through the diode that conducts in its
/// direction. `direction` is the sign of the current, or of the current that may start.
fn terminal_voltage(state: State, current: f64, direction: f64) -> f64 {
    let [s1, s2, s3, s4] = state.pattern().switches();
    let (vd, ron) = (BRIDGE.vd.0, BRIDGE.ron.0);
    // Current into the motor at the left, out of it at the right.
    let left = match (s1, s2) {
        (true, _) => BATTERY - ron * current,
        (_, true) => -ron * current,
        _ if direction > 0.0 => -vd,
        _ => BATTERY + vd,
    };
    let right = match (s3, s4) {
        (true, _) => BATTERY + ron * current,
        (_, true) => ron * current,
        _ if direction > 0.0 => BATTERY + vd,
        _ => -vd,
    };
    left - right
}

/// Returns the direction in which a current starts from zero in a state: 1, -1, or 0 if no current starts.
fn direction(state: State, current: f64, emf: f64) -> f64 {
    if current != 0.0 {
        current.signum()
    } else if terminal_voltage(state, 0.0, 1.0) > emf {
        1.0
    } else if terminal_voltage(state, 0.0, -1.0) < emf {
        -1.0
    } else {
        0.0
    }
}

/// Motor, load and bridge in small steps: current, speed, and the integral of the current.
struct Reference {
    motor: Motor,
    shaft: Shaft,
    torque: f64,
    state: [f64; 3],
}

impl Reference {
    fn dwell(&mut self, state: State, time: f64, steps: u32) {
        let h = time / f64::from(steps);
        let Motor { r, l, ke, kt, .. } = self.motor;
        let (shaft, torque) = (self.shaft, self.torque);
        for _ in 0..steps {
            let [current, speed, _] = self.state;
            let way = direction(state, current, ke.0 * speed);
            let next = rk4(self.state, h, |[i, w, _]| {
                let voltage = terminal_voltage(state, i, way) - r.0 * i - ke.0 * w;
                [
                    if way == 0.0 { 0.0 } else { voltage / l.0 },
                    (kt.0 * i + torque - shaft.drag.0 * w) / shaft.inertia.0,
                    i,
                ]
            });
            self.state = next;
            if next[0] * way < 0.0 {
                // The current has passed zero within the step: stop at zero, and find the direction again.
                self.state[0] = 0.0;
            }
        }
    }
}

#[test]
fn closed_form_agrees_with_integration_in_small_steps() {
    let load = Load { inertia_after: KgM2(0.002), drag_after: Drag(0.01), ..Load::NONE };
    for motor in [am60(), motor("AM 60 A"), motor("CoreHex A"), motor("AM 3.7 B")] {
        for load in [Load::NONE, load] {
            let geared = GearedMotor::new(&motor, &load);
            let shaft = *geared.shaft();
            let applied = Applied { voltage: Volts(-7.0), torque_after: NewtonMetres(0.3) };
            let start = Motion { current: Amps(1.5), speed: RadPerSec(200.0) };
            let torque = 0.3 / (motor.eta * motor.gear_ratio);
            let mut x = [start.current.0, start.speed.0, 0.0, 0.0];
            let (h, steps) = (1e-6, 10_000);
            for _ in 0..steps {
                x = rk4(x, h, |[i, w, _, _]| {
                    [
                        (-7.0 - motor.r.0 * i - motor.ke.0 * w) / motor.l.0,
                        (motor.kt.0 * i + torque - shaft.drag.0 * w) / shaft.inertia.0,
                        i,
                        w,
                    ]
                });
            }
            let time = Seconds(h * f64::from(steps));
            let (end, mean) = (geared.after(start, applied, time), geared.mean(start, applied, time));
            let (amps, speed) = (BATTERY / motor.r.0, BATTERY / motor.ke.0);
            for (got, want, scale) in [
                (end.current.0, x[0], amps),
                (end.speed.0, x[1], speed),
                (mean.current.0, x[2] / time.0, amps),
                (mean.speed.0, x[3] / time.0, speed),
            ] {
                close(got, want, 1e-9 * scale, motor.name);
            }
        }
    }
}

#[test]
fn steady_state_of_the_closed_form_does_not_move() {
    let geared = GearedMotor::new(&am60(), &Load::flywheel(Kilograms(10.0), Metres(0.1)));
    let torque_after = NewtonMetres(-0.4);
    let voltage = geared.steady_voltage(RadPerSec(250.0), torque_after);
    let applied = Applied { voltage, torque_after };
    let steady = geared.steady(applied);
    close(steady.speed.0, 250.0, 1e-10, "speed");
    for time in [1e-6, 0.05, 1e6] {
        let later = geared.after(steady, applied, Seconds(time));
        close(later.speed.0, 250.0, 1e-10, time);
        close(later.current.0, steady.current.0, 1e-13, time);
    }
}

#[test]
fn a_dwell_agrees_with_integration_in_small_steps_through_zero() {
    let mut heavy = am60();
    heavy.j = KgM2(1e9);
    let circuit = Circuit::new(&heavy, BRIDGE);
    for state in State::ALL {
        for emf in [-15.0, -14.0, -13.0, -6.0, -0.3, 0.0, 0.3, 6.0, 13.0, 14.0, 15.0] {
            for current in [-2.5, 0.0, 2.5] {
                let shaft = Shaft::new(&heavy, &Load::NONE);
                let speed = emf / heavy.ke.0;
                let mut reference =
                    Reference { motor: heavy, shaft, torque: 0.0, state: [current, speed, 0.0] };
                reference.dwell(state, 3e-4, 30_000);
                let mut sums = Integrals::default();
                let end = circuit.dwell(state, Amps(current), at(emf), Seconds(3e-4), &mut sums);
                let [i, _, charge] = reference.state;
                let miss = (end.0 - i).abs().max((sums.current - charge).abs() / 3e-4);
                assert!(miss < 5e-4, "{state:?} emf {emf} current {current}: {miss}");
            }
        }
    }
}

#[test]
fn the_bridge_conserves_energy() {
    for motor in motors() {
        let circuit = Circuit::new(&motor, BRIDGE);
        for state in State::ALL {
            for emf in [-16.0, -5.0, 0.0, 3.0, 13.0] {
                for start in [-3.0, -0.1, 0.0, 0.1, 3.0] {
                    for time in [1e-6, 1e-4, 1e-2] {
                        let mut sums = Integrals::default();
                        let end = circuit.dwell(state, Amps(start), at(emf), Seconds(time), &mut sums);
                        let stored = 0.5 * circuit.l.0 * (end.0 * end.0 - start * start);
                        let battery = BATTERY * sums.battery();
                        let shaft = emf * sums.current;
                        let scale = battery.abs() + sums.heat + shaft.abs() + stored.abs() + 1e-12;
                        let miss = (battery - sums.heat - shaft - stored).abs() / scale;
                        assert!(miss < 1e-9, "{} {state:?} {emf} {start} {time}: {miss}", motor.name);
                        assert!(sums.heat >= circuit.r.0 * sums.square * (1.0 - 1e-9));
                        assert!(sums.from_battery >= 0.0 && sums.to_battery >= 0.0);
                    }
                }
            }
        }
    }
}

#[test]
fn periodic_state_is_where_a_long_run_ends_for_every_pair_of_states() {
    let circuit = Circuit::new(&am60(), BRIDGE);
    let mut mixed = 0;
    for on in State::ALL {
        for off in State::ALL {
            for frequency in [1e3, 20e3] {
                for emf in [-14.0, -4.0, -0.2, 0.0, 0.5, 6.0, 11.5, 16.0] {
                    for duty in [0.0, 0.1, 0.47, 0.8, 1.0] {
                        let pwm = Pwm { on, off, duty, frequency: Hertz(frequency) };
                        let mut current = Amps(1.0);
                        for _ in 0..200 {
                            current = circuit.period(pwm, current, at(emf), &mut Integrals::default());
                        }
                        let mut sums = Integrals::default();
                        let end = circuit.period(pwm, current, at(emf), &mut sums);
                        let steady = circuit.steady(pwm, at(emf));
                        let miss = (steady.start.0 - end.0)
                            .abs()
                            .max((steady.mean.0 - sums.current * frequency).abs())
                            .max((steady.battery.0 - sums.battery() * frequency).abs());
                        assert!(miss < 1e-11, "{pwm:?} {emf}: {miss}");
                        let one_signed = steady.rms.0 >= steady.mean.0.abs() * (1.0 - 1e-12);
                        assert!(one_signed || steady.conduction == Conduction::Zero);
                        mixed += u32::from(on != off && steady.start.0 * steady.mean.0 < 0.0);
                    }
                }
            }
        }
    }
    assert!(mixed > 0, "no case in which the current changes sign");
}

#[test]
fn duty_for_current_inverts_the_bridge_for_every_motor() {
    let (mut worst_formula, mut worst_miss): (f64, f64) = (0.0, 0.0);
    for motor in motors() {
        let circuit = Circuit::new(&motor, BRIDGE);
        for frequency in [1e3, 8e3, 15.6e3, 20e3].map(Hertz) {
            for battery in [6.5, 14.5].map(Volts) {
                for u in [-0.95, -0.5, -0.1, 0.0, 0.1, 0.5, 0.95] {
                    let at = Conditions { battery, emf: Volts(u * battery.0) };
                    let full = battery.0 / motor.r.0;
                    for step in -19..=19 {
                        let wanted = Amps(f64::from(step) / 20.0 * full);
                        let pwm = circuit.duty_for_current(wanted, frequency, at);
                        let got = circuit.steady(pwm, at).mean;
                        if pwm.duty < 1.0 {
                            let miss = (got.0 - wanted.0).abs() / full;
                            assert!(miss < 1e-12, "{} {frequency} {at:?} {wanted}: {got}", motor.name);
                        } else {
                            // The current is out of reach, so the bridge applies its largest voltage.
                            assert!(got.0.abs() <= wanted.0.abs() + 1e-12 * full);
                        }
                        let formula = circuit.duty_for_current_formula(wanted, frequency, at);
                        assert_eq!((formula.on, formula.off), (pwm.on, pwm.off));
                        // The mean current does not depend on the duty of 5/0 at standstill.
                        if wanted.0 != 0.0 {
                            let off = (formula.duty - pwm.duty).abs();
                            let miss = (circuit.steady(formula, at).mean.0 - got.0).abs() / full;
                            worst_miss = worst_miss.max(miss);
                            worst_formula = worst_formula.max(off);
                            assert!(
                                frequency.0 < 15e3 || off < 1e-3,
                                "{} {at:?} {wanted}: {off}",
                                motor.name
                            );
                        }
                    }
                }
            }
        }
    }
    assert!(worst_formula < 0.01 && worst_miss < 0.01, "{worst_formula} {worst_miss}");
}

#[test]
fn reverse_continues_full_braking_at_the_computed_duty() {
    let circuit = Circuit::new(&am60(), BRIDGE);
    for emf in [0.1 * BATTERY, 0.5 * BATTERY, 0.9 * BATTERY] {
        let crossing = circuit.reverse0(32767.0, at(emf));
        let pwm = Pwm::new(Mode::Ccw62, crossing.duty_at_t, Hertz(20e3));
        let full = circuit.steady(Pwm::new(Mode::Brake50, 1.0, Hertz(20e3)), at(emf)).mean.0;
        close(crossing.current_at_t.0, full, 1e-12, emf);
        close(circuit.steady(pwm, at(emf)).mean.0, full, 2e-4, emf);
        let off = circuit.steady(Pwm { duty: 0.0, ..pwm }, at(emf)).mean.0;
        close(crossing.current.0, off, 1e-12, emf);
    }
}

#[test]
fn plant_follows_the_event_exact_motor_within_a_thousandth() {
    let flywheel = Load::inertia(KgM2(0.05));
    let cases = [(am60(), flywheel), (am60(), Load::NONE), (motor("AM 60 A"), Load::NONE)];
    for (motor, load) in cases {
        for (frequency, steps) in [(1e3, 2000), (8e3, 500), (20e3, 200)] {
            for mode in MODES {
                for duty in [0.1, 0.5, 0.85] {
                    let period = 1.0 / frequency;
                    let shaft = Shaft::new(&motor, &load);
                    let torque = 0.5 * shaft.torque_ratio;
                    let mut reference = Reference { motor, shaft, torque, state: [0.0, 300.0, 0.0] };
                    let mut plant = Plant::new(motor, load, BRIDGE, Hertz(frequency));
                    plant.set_state(Amps(0.0), RadPerSec(300.0), 0.0);
                    let command =
                        PlantInput { torque_after: NewtonMetres(0.5), ..PlantInput::pwm(mode, duty) };
                    // Means over 5 ms, as a controller would see them.
                    for _ in 0..4 {
                        let periods = (5e-3 * frequency).round();
                        reference.state[2] = 0.0;
                        let mut left = periods;
                        while left > 0.5 {
                            let on = (duty * f64::from(steps)).round();
                            reference.dwell(mode.on(), duty * period, on as u32);
                            reference.dwell(mode.off(), (1.0 - duty) * period, steps - on as u32);
                            left -= 1.0;
                        }
                        let flow = plant.run(Seconds(periods * period), command, Volts(BATTERY));
                        let mean = reference.state[2] / (periods * period);
                        let miss = (flow.mean_current().0 - mean).abs() * motor.r.0 / BATTERY;
                        let slip = (plant.speed().0 - reference.state[1]).abs() * motor.ke.0 / BATTERY;
                        let what = format!("{mode:?} {duty} {frequency} {load:?} {}", motor.j);
                        assert!(miss < 1e-3, "{what}: {miss}");
                        assert!(slip < 1e-3, "{what}: {slip}");
                    }
                }
            }
        }
    }
}

#[test]
fn plant_settles_at_the_steady_speed_of_its_duty() {
    for (mode, duty) in [(Mode::Cw98, 0.3), (Mode::Cw98, 0.9), (Mode::Ccw62, 0.5)] {
        let mut plant = Plant::new(am60(), Load::NONE, BRIDGE, Hertz(20e3));
        plant.run(Seconds(6.0), PlantInput::pwm(mode, duty), Volts(BATTERY));
        let pwm = Pwm::new(mode, duty, Hertz(20e3));
        let steady = GearedMotor::new(&am60(), &Load::NONE).speed_at_duty(BRIDGE, pwm, Volts(BATTERY));
        close(plant.speed().0, steady.0, 0.02, (mode, duty));
    }
}

#[test]
fn plant_stays_bounded_for_any_inertia() {
    let friction = Friction::with_coulomb(NewtonMetres(0.05 * am60().stall_torque(Volts(BATTERY)).0));
    let cogging = Cogging { amplitude: friction.coulomb, per_turn: 10 };
    let rough = Motor { friction, cogging, ..am60() };
    for (motor, j) in [1e-12, 1e-10, 1e-8, 1e-6, 1e-4].into_iter().flat_map(|j| [(am60(), j), (rough, j)]) {
        let motor = Motor { j: KgM2(j), ..motor };
        for mode in MODES {
            let mut plant = Plant::new(motor, Load::NONE, BRIDGE, Hertz(8e3));
            for _ in 0..10 {
                plant.run(Seconds(1e-3), PlantInput::pwm(mode, 0.5), Volts(BATTERY));
                assert!(plant.speed().0.abs() < 3.0 * BATTERY / motor.ke.0, "{j} {mode:?}");
                assert!(plant.current().0.abs() < 3.0 * BATTERY / motor.r.0, "{j} {mode:?}");
            }
        }
    }
}

#[test]
fn encoder_counts_floor_in_both_directions() {
    let quarter = core::f64::consts::TAU / 28.0;
    assert_eq!(counts(0.0, 28.0), 0);
    assert_eq!(counts(2.5 * quarter, 28.0), 2);
    assert_eq!(counts(-0.5 * quarter, 28.0), -1);
    assert_eq!(counts(1e6 * core::f64::consts::TAU + 0.5 * quarter, 28.0), 28_000_000);
}

#[test]
fn a_battery_sags_under_load_and_rises_when_charged() {
    let battery = Battery { emf: Volts(12.0), resistance: Ohms(0.1) };
    assert_eq!(battery.voltage(Amps(0.0)), Volts(12.0));
    close(battery.voltage(Amps(5.0)).0, 11.5, 1e-12, "sag");
    close(battery.voltage(Amps(-5.0)).0, 12.5, 1e-12, "charge");
    assert_eq!(battery.voltage(Amps(1000.0)), Volts(0.0));
}

#[test]
fn plants_on_one_battery_share_its_sag_and_its_gain() {
    let battery = Battery { emf: Volts(12.0), resistance: Ohms(0.2) };
    let plant = |speed: f64| {
        let mut plant = Plant::new(am60(), Load::inertia(KgM2(10.0)), BRIDGE, Hertz(20e3));
        plant.set_state(Amps(0.0), RadPerSec(speed), 0.0);
        plant
    };
    // Two motors at standstill with full voltage: v = emf - Rb 2 v / (R + 2 Ron).
    let mut rig = Rig::new(battery, vec![plant(0.0), plant(0.0)]);
    let full = PlantInput::pwm(Mode::Cw98, 1.0);
    let flows = rig.run(Seconds(0.05), &[full, full]);
    let current = flows.iter().map(Flow::battery_charge).sum::<f64>() / 0.05;
    close(rig.voltage().0, 12.0 / (1.0 + 0.4 / 3.4), 2e-2, "sag");
    close(rig.voltage().0, 12.0 - 0.2 * current, 2e-2, "present");
    assert_eq!(flows.len(), 2);

    // Braking with 5/0 at speed is a boost chopper: it charges the battery. A plant without a command coasts.
    let mut rig = Rig::new(battery, vec![plant(550.0), plant(550.0)]);
    let flows = rig.run(Seconds(0.05), &[PlantInput::pwm(Mode::Brake50, 0.5)]);
    assert!(rig.voltage().0 > 12.05, "{}", rig.voltage());
    assert_eq!(flows.last().map(|flow| flow.charge.0), Some(0.0));
}
