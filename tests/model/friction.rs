//! Dry friction and cogging of the plant, compared with an integration in small steps by another method, and with
//! closed forms.

use crate::{BRIDGE, close, motor};
use motor_hub::bridge::{Mode, State};
use motor_hub::model::catalogue::{Motor, motors};
use motor_hub::model::friction::{Cogging, Friction};
use motor_hub::model::load::{Load, Shaft};
use motor_hub::model::plant::{Flow, Plant, PlantInput};
use motor_hub::model::si::{Amps, Drag, Hertz, KgM2, NewtonMetres, RadPerSec, Seconds, Volts};
use motor_hub::model::switching::Bridge;

const BATTERY: Volts = Volts(crate::BATTERY);
const PWM: Hertz = Hertz(20e3);

/// A motor with friction and cogging in percent of its stall torque at 12 V.
fn rough(motor: Motor, coulomb: f64, cogging: f64) -> Motor {
    let share = |percent: f64| NewtonMetres(percent / 100.0 * motor.stall_torque(BATTERY).0);
    Motor {
        friction: Friction::with_coulomb(share(coulomb)),
        cogging: Cogging { amplitude: share(cogging), per_turn: 10 },
        ..motor.with_measured_rotor_inertia()
    }
}

fn am60(coulomb: f64, cogging: f64) -> Motor {
    rough(motor("AM 60 A"), coulomb, cogging)
}

fn bare(motor: Motor) -> Plant {
    Plant::new(motor, Load::NONE, Bridge::IDEAL, PWM)
}

/// The battery voltage on the motor during the whole PWM period.
const FULL: PlantInput = PlantInput::pwm(Mode::Cw98, 1.0);

/// Motor and load by Moreau's time stepping. After the free motion of a small step friction takes an impulse of at most
/// its torque times the step. Friction never turns the shaft back.
struct SmallSteps {
    motor: Motor,
    shaft: Shaft,
    torque: f64,
    current: f64,
    speed: f64,
    angle: f64,
    heat: f64,
}

impl SmallSteps {
    /// Applies a state of an ideal bridge for `time` seconds, in steps of `h` seconds.
    fn dwell(&mut self, state: State, time: f64, h: f64) {
        let Motor { r, l, ke, kt, friction, cogging, .. } = self.motor;
        let (inertia, drag) = (self.shaft.inertia.0, self.shaft.drag.0);
        for _ in 0..(time / h).round() as u64 {
            let before = self.current;
            // Current that no closed switch carries flows through diodes against the battery, and decays.
            let dies = match state {
                State::Coast => true,
                State::HighLeft => before < 0.0,
                State::HighRight => before > 0.0,
                _ => false,
            };
            let voltage = match state {
                State::DriveCw => BATTERY.0,
                State::DriveCcw => -BATTERY.0,
                _ if dies && before != 0.0 => -BATTERY.0 * before.signum(),
                _ => 0.0,
            };
            // The current follows the trapezoidal rule, with the speed at the start of the step.
            let x = 0.5 * h * r.0 / l.0;
            let next = ((1.0 - x) * before + h / l.0 * (voltage - ke.0 * self.speed)) / (1.0 + x);
            self.current = match state {
                _ if dies && next * before <= 0.0 => 0.0,
                State::HighLeft if !dies => next.max(0.0),
                State::HighRight if !dies => next.min(0.0),
                _ => next,
            };
            let mean = 0.5 * (before + self.current);
            let angle = self.angle + 0.5 * h * self.speed;
            let pull = -cogging.amplitude.0 * (f64::from(cogging.per_turn) * angle).sin();
            let torque = kt.0 * mean + self.torque + pull;
            let stays = self.speed == 0.0 && torque.abs() <= friction.breakaway.0;
            let free = self.speed + h / inertia * (torque - drag * self.speed);
            let most = h / inertia * friction.coulomb.0;
            let next = if stays || free.abs() <= most { 0.0 } else { free - most.copysign(free) };
            let way = 0.5 * h * (self.speed + next);
            self.heat += friction.coulomb.0 * way.abs();
            self.angle += way;
            self.speed = next;
        }
    }
}

#[test]
fn plant_with_friction_and_cogging_follows_an_integration_in_small_steps() {
    let cases = [(5.0, 0.0), (10.0, 0.0), (0.0, 4.0), (5.0, 3.0), (3.0, 8.0)];
    // Mode, duty, external torque in percent of the stall torque, ms.
    let story = [
        (Mode::Cw98, 1.0, 0.0, 40),
        (Mode::Ccw62, 1.0, 0.0, 25),
        (Mode::Brake50, 1.0, 0.0, 400),
        (Mode::Cw98, 0.4, 0.0, 150),
        (Mode::Cw98, 0.0, 0.0, 200),
        (Mode::Cw98, 0.4, -30.0, 60),
        (Mode::Ccw62, 0.3, 20.0, 100),
        (Mode::Brake50, 0.5, 0.0, 300),
        (Mode::Cw98, 0.02, 0.0, 50),
    ];
    let (mut stops, mut turns) = (0, 0);
    for name in ["AM 60 A", "AM 3.7 B"] {
        for (coulomb, cogging) in cases {
            let motor = rough(motor(name), coulomb, cogging);
            let load = Load::inertia(KgM2(3e-6 * motor.gear_ratio * motor.gear_ratio));
            let shaft = Shaft::new(&motor, &load);
            let mut plant = Plant::new(motor, load, Bridge::IDEAL, PWM);
            let mut flow = Flow::default();
            let mut steps =
                SmallSteps { motor, shaft, torque: 0.0, current: 0.0, speed: 0.0, angle: 0.0, heat: 0.0 };
            for (n, (mode, duty, percent, ms)) in story.into_iter().enumerate() {
                let torque = percent / 100.0 * motor.stall_torque(BATTERY).0;
                steps.torque = torque;
                let torque_after = NewtonMetres(torque / shaft.torque_ratio);
                let command = PlantInput { torque_after, ..PlantInput::pwm(mode, duty) };
                for _ in 0..ms {
                    let before = plant.speed().0;
                    flow.append(&plant.run(Seconds(1e-3), command, BATTERY));
                    for _ in 0..20 {
                        steps.dwell(mode.on(), duty / PWM.0, 5e-7);
                        steps.dwell(mode.off(), (1.0 - duty) / PWM.0, 5e-7);
                    }
                    stops += u32::from(before != 0.0 && plant.speed().0 == 0.0);
                    turns += u32::from(before * plant.speed().0 < 0.0);
                    let misses = [
                        (plant.speed().0 - steps.speed).abs() * motor.ke.0 / BATTERY.0,
                        (plant.angle() - steps.angle).abs() / std::f64::consts::TAU,
                        (flow.friction_heat.0 - steps.heat).abs() / flow.energy_from_battery.0,
                    ];
                    let what = format!("{name} {coulomb} % {cogging} %, part {n}: {misses:?}");
                    assert!(misses.iter().all(|&miss| miss < 5e-4), "{what}");
                }
            }
        }
    }
    assert!(stops > 10 && turns > 10, "{stops} stops, {turns} turns");
}

#[test]
fn a_resting_motor_neither_creeps_nor_trembles() {
    let motor = am60(5.0, 0.0);
    let mut plant = bare(motor);
    plant.set_state(Amps(0.0), RadPerSec(0.0), 0.123);
    let mut flow = Flow::default();
    for ms in 0..10_000 {
        // The motor gets up to 6 % of the stall torque in either direction, by its drive and by an external torque.
        let torque_after = NewtonMetres(0.03 * motor.stall_torque(BATTERY).0 * motor.gear_ratio * motor.eta);
        let command = match ms % 4 {
            0 => PlantInput::pwm(Mode::Cw98, 0.06),
            1 => PlantInput::pwm(Mode::Ccw62, 0.05),
            2 => PlantInput { torque_after, ..PlantInput::pwm(Mode::Cw98, 0.03) },
            _ => PlantInput::pwm(Mode::Brake50, 0.7),
        };
        flow.append(&plant.run(Seconds(1e-3), command, BATTERY));
        assert_eq!((plant.speed(), plant.angle()), (RadPerSec(0.0), 0.123), "at {ms} ms");
    }
    assert_eq!((flow.friction_heat.0, flow.shaft_work.0), (0.0, 0.0));
}

#[test]
fn every_motor_breaks_away_at_the_voltage_of_its_breakaway_torque() {
    for motor in motors().map(|motor| rough(motor, 4.0, 0.0)) {
        let speed = |volts: f64, command: PlantInput| {
            let mut plant = bare(motor);
            plant.run(Seconds(0.2), command, Volts(volts));
            plant.speed().0
        };
        let voltage = 1.3 * 0.04 * BATTERY.0;
        let reverse = PlantInput::pwm(Mode::Ccw62, 1.0);
        assert_eq!(
            [FULL, reverse].map(|command| speed(0.9999 * voltage, command)),
            [0.0; 2],
            "{}",
            motor.name
        );
        assert!(speed(1.0001 * voltage, FULL) > 0.0, "{}", motor.name);
        assert!(speed(1.0001 * voltage, reverse) < 0.0, "{}", motor.name);
    }
}

#[test]
fn coasting_down_ends_when_the_closed_form_says_and_where() {
    for name in ["AM 60 A", "AM 3.7 B", "CoreHex A"] {
        for coulomb in [0.5, 5.0, 20.0] {
            let motor = rough(motor(name), coulomb, 0.0);
            let (inertia, drag, torque) = (motor.j.0, motor.b.0, motor.friction.coulomb.0);
            for start in [0.3, -0.7].map(|share| share * BATTERY.0 / motor.ke.0) {
                // w(t) = (w0 + C/B) exp(-t B/J) - C/B.
                let stop = inertia / drag * (drag * start.abs() / torque).ln_1p();
                let mut plant = bare(motor);
                plant.set_state(Amps(0.0), RadPerSec(start), 2.0);
                let half = plant.run(Seconds(0.5 * stop), PlantInput::COAST, BATTERY);
                let offset = torque / drag;
                let speed = (start.abs() + offset) * (-0.5 * stop * drag / inertia).exp() - offset;
                close(plant.speed().0 / start, speed / start.abs(), 1e-9, (name, coulomb, "half-way"));
                // The motor stops within a microsecond of the computed time.
                let rest = 0.5 * stop;
                let mut flow = plant.run(Seconds(rest - 1e-6), PlantInput::COAST, BATTERY);
                assert!(plant.speed().0 * start > 0.0, "{name} {coulomb}");
                flow.append(&plant.run(Seconds(2e-6), PlantInput::COAST, BATTERY));
                assert_eq!(plant.speed().0, 0.0, "{name} {coulomb}");
                let turned = (start.abs() * inertia - torque * stop) / drag;
                close((plant.angle() - 2.0) * start.signum() / turned, 1.0, 1e-9, (name, coulomb, "angle"));
                flow.append(&half);
                close(flow.friction_heat.0 / (torque * turned), 1.0, 1e-9, (name, coulomb, "heat"));
                let there = plant.angle();
                plant.run(Seconds(1.0), PlantInput::COAST, BATTERY);
                assert_eq!((plant.speed().0, plant.angle()), (0.0, there), "{name} {coulomb}");
            }
        }
    }
}

#[test]
fn battery_energy_is_heat_friction_and_what_is_stored() {
    for (coulomb, cogging) in [(0.0, 0.0), (5.0, 0.0), (0.0, 5.0), (5.0, 3.0)] {
        for name in ["AM 60 A", "AM 20 B", "CoreHex A"] {
            let motor = Motor { b: Drag(0.0), ..rough(motor(name), coulomb, cogging) };
            let mut plant = Plant::new(motor, Load::NONE, BRIDGE, PWM);
            let mut flow = Flow::default();
            for (mode, duty) in
                [(Mode::Cw98, 0.6), (Mode::Ccw62, 0.8), (Mode::Brake50, 0.5), (Mode::Cw98, 0.3)]
            {
                for _ in 0..300 {
                    flow.append(&plant.run(Seconds(1e-3), PlantInput::pwm(mode, duty), BATTERY));
                    let battery = flow.energy_from_battery.0 - flow.energy_to_battery.0;
                    let coil = 0.5 * motor.l.0 * plant.current().0.powi(2);
                    let motion =
                        0.5 * motor.j.0 * plant.speed().0.powi(2) + motor.cogging.energy(plant.angle()).0;
                    let scale = flow.energy_from_battery.0;
                    let what = (name, coulomb, cogging);
                    // The energy balance of the bridge is exact to rounding errors. The balance of the shaft is less
                    // exact, because Kt and Ke differ in their last digits.
                    close(battery, flow.heat.0 + flow.shaft_work.0 + coil, 1e-9 * scale, what);
                    let shaft = flow.shaft_work.0 * motor.kt.0 / motor.ke.0;
                    let miss = (shaft - flow.friction_heat.0 - motion).abs() / scale;
                    assert!(miss < 1e-6, "{what:?}: {miss}");
                }
            }
            assert!(flow.friction_heat.0 > 0.0 || coulomb == 0.0);
        }
    }
}

#[test]
fn without_friction_the_way_through_it_changes_no_bit() {
    // Cogging with an amplitude of 0: the plant uses the computation for motors with friction and cogging.
    let toothed = Motor { cogging: Cogging { amplitude: NewtonMetres(0.0), per_turn: 10 }, ..am60(0.0, 0.0) };
    let smooth = Motor { cogging: Cogging::NONE, ..toothed };
    for mode in [Mode::Cw98, Mode::Brake50] {
        let (mut a, mut b) = (bare(toothed), bare(smooth));
        for plant in [&mut a, &mut b] {
            plant.set_state(Amps(0.2), RadPerSec(200.0), 1.0);
        }
        for ms in 0..500 {
            let command = PlantInput::pwm(mode, f64::from(ms % 100) / 100.0);
            let flows = [&mut a, &mut b].map(|plant| plant.run(Seconds(1e-3), command, BATTERY));
            let [rough, smooth] =
                [&a, &b].map(|plant| [plant.speed().0, plant.angle(), plant.current().0].map(f64::to_bits));
            assert_eq!(rough, smooth, "{mode:?} {ms}");
            assert_eq!(flows[0], flows[1], "{mode:?} {ms}");
        }
    }
}

#[test]
fn cogging_alone_takes_nothing_from_a_coasting_rotor() {
    let motor = Motor { b: Drag(0.0), ..am60(0.0, 5.0) };
    let tooth = std::f64::consts::TAU / 10.0;
    let energy =
        |plant: &Plant| 0.5 * motor.j.0 * plant.speed().0.powi(2) + motor.cogging.energy(plant.angle()).0;
    let peak = motor.cogging.energy(0.5 * tooth).0;
    // The energies are from just above the energy that passes the cogging teeth, to the energy at the free speed.
    for share in [1.01, 2.0, 1e3] {
        let start = (2.0 * share * peak / motor.j.0).sqrt();
        let mut plant = bare(motor);
        plant.set_state(Amps(0.0), RadPerSec(start), 0.0);
        let first = energy(&plant);
        let (mut slowest, mut fastest) = (start, start);
        for _ in 0..100_000 {
            plant.run(Seconds(1e-4), PlantInput::COAST, BATTERY);
            close(energy(&plant) / first, 1.0, 1e-9, share);
            slowest = plant.speed().0.min(slowest);
            fastest = plant.speed().0.max(fastest);
        }
        assert!(plant.angle() > 5.0 * std::f64::consts::TAU, "{share}: {}", plant.angle());
        close(fastest / start, 1.0, 1e-6, share);
        close(slowest / start, (1.0 - 1.0 / share).sqrt(), 2e-3, share);
    }
}
