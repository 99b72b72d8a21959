//! The model against reference values that were computed elsewhere, in many digits.

#![cfg(feature = "model")]
#![expect(clippy::unwrap_used, clippy::indexing_slicing, reason = "a failed access is a failed test")]

use motor_hub::bridge::{Mode, State};
use motor_hub::model::bridge_states::CurrentSign;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::friction::{Cogging, Friction};
use motor_hub::model::load::Load;
use motor_hub::model::paper::{OpenLoop, Point, Scheme};
use motor_hub::model::response::{Applied, GearedMotor, Motion, Poles};
use motor_hub::model::si::{
    Amps, Drag, EmfConstant, Henries, Hertz, KgM2, NewtonMetres, Ohms, RadPerSec, Seconds, TorqueConstant,
    Volts,
};
use motor_hub::model::switching::{Bridge, Circuit, Conditions, Pwm};
use serde_json::Value;

fn golden() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/golden.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Calls `check` for each case of a formula, and fails if there were not `expected` of them.
fn for_each(formula: &str, expected: usize, mut check: impl FnMut(&Value, &Value, &Value)) {
    let data = golden();
    let mut count = 0;
    for case in data["cases"].as_array().unwrap() {
        if case["formula"] == formula {
            check(&data, &case["inputs"], &case["outputs"]);
            count += 1;
        }
    }
    assert_eq!(count, expected, "cases of {formula}");
}

fn f(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn motor(data: &Value, inputs: &Value) -> Motor {
    let constants = match inputs.get("motor") {
        Some(key) => &data["motors"][key.as_str().unwrap()],
        None => inputs,
    };
    let get = |key: &str| constants.get(key).map_or(1.0, f);
    Motor {
        name: "golden",
        r: Ohms(get("R")),
        l: Henries(get("L")),
        gear_ratio: get("N"),
        eta: get("eta"),
        ke: EmfConstant(get("Ke")),
        kt: TorqueConstant(get("Kt")),
        b: Drag(get("B")),
        friction: Friction::NONE,
        cogging: Cogging::NONE,
        j: KgM2(get("J")),
        j_rotor_measured: KgM2(get("J")),
        counts_per_rev_motor: 28.0,
    }
}

fn mode(name: &str) -> Mode {
    [Mode::Cw98, Mode::Ccw62, Mode::Brake50].into_iter().find(|m| m.name() == name).unwrap()
}

/// The largest error seen, in units of each quantity's natural scale.
#[derive(Default)]
struct Worst(f64);

impl Worst {
    fn see(&mut self, got: f64, want: f64, scale: f64, what: &str) {
        let error = (got - want).abs() / scale;
        assert!(error <= 1.0, "{what}: {got} instead of {want}");
        self.0 = self.0.max(error);
    }
}

struct Operating {
    circuit: Circuit,
    frequency: Hertz,
    at: Conditions,
    scale: f64,
}

fn operating(data: &Value, inputs: &Value) -> Operating {
    let motor = motor(data, inputs);
    let bridge = Bridge::lossy(Volts(f(&inputs["Vd"])), Ohms(f(&inputs["Ron"])));
    let battery = f(&inputs["Vbat"]);
    Operating {
        circuit: Circuit::new(&motor, bridge),
        frequency: Hertz(f(&inputs["f_Hz"])),
        at: Conditions {
            battery: Volts(battery),
            emf: Volts(motor.ke.0 * inputs.get("Omega").map_or(0.0, f)),
        },
        scale: battery / motor.r.0,
    }
}

#[test]
fn terminal_voltages_of_every_state() {
    for_each("bridge_state", 16, |_, inputs, outputs| {
        let Some(state) = State::ALL.into_iter().find(|&s| inputs["state"] == s as u8) else {
            assert_eq!(outputs["short"], true);
            return;
        };
        for (sign, key) in [(CurrentSign::Positive, "v_i_pos"), (CurrentSign::Negative, "v_i_neg")] {
            let terminal = state.terminal(sign);
            assert_eq!(f64::from(terminal.battery), f(&outputs[key]["Vb_coef"]), "{state:?}");
            assert_eq!(f64::from(terminal.diode), f(&outputs[key]["Vd_coef"]), "{state:?}");
            assert_eq!(u64::from(terminal.switches), outputs[key]["Ron_count"], "{state:?}");
        }
    });
}

#[test]
fn periodic_steady_state_of_the_switching_bridge() {
    let mut worst = Worst::default();
    for_each("bridge_pwm", 142, |data, inputs, outputs| {
        let op = operating(data, inputs);
        for row in outputs["rows"].as_array().unwrap() {
            let pwm = Pwm::new(mode(inputs["mode"].as_str().unwrap()), f(&row[0]), op.frequency);
            let steady = op.circuit.steady(pwm, op.at);
            let scale = 1e-10 * op.scale;
            let what = format!("{inputs} {row}");
            worst.see(steady.mean.0, f(&row[1]), scale, &what);
            worst.see(steady.rms.0, f(&row[2]), scale, &what);
            worst.see(steady.battery.0, f(&row[3]), scale, &what);
            assert_eq!(steady.conduction.name(), row[4], "{what}");
        }
    });
    println!("bridge_pwm: worst {:.1e} of Vbat/R", 1e-10 * worst.0);
}

#[test]
fn duty_for_a_current_exactly_and_by_formula() {
    let mut exact = Worst::default();
    let mut formula = Worst::default();
    for_each("duty_for_current", 9, |data, inputs, outputs| {
        let op = operating(data, inputs);
        for row in outputs["rows"].as_array().unwrap() {
            let what = format!("{inputs} {row}");
            let wanted = Amps(f(&row[0]));
            let mode_of = |pwm: Pwm| {
                [Mode::Cw98, Mode::Ccw62, Mode::Brake50]
                    .into_iter()
                    .find(|mode| (mode.on(), mode.off()) == (pwm.on, pwm.off))
            };
            let pwm = op.circuit.duty_for_current(wanted, op.frequency, op.at);
            assert_eq!(mode_of(pwm).unwrap().name(), row[1], "{what}");
            exact.see(pwm.duty, f(&row[2]), 1e-10, &what);
            let pwm = op.circuit.duty_for_current_formula(wanted, op.frequency, op.at);
            assert_eq!(mode_of(pwm).unwrap().name(), row[3], "{what}");
            formula.see(pwm.duty, f(&row[4]), 1e-8, &what);
        }
    });
    println!("duty_for_current: worst {:.1e} exact, {:.1e} by formula", 1e-10 * exact.0, 1e-8 * formula.0);
}

fn geared(data: &Value, inputs: &Value) -> (Motor, GearedMotor) {
    let motor = motor(data, inputs);
    let load = Load {
        inertia_after: KgM2(f(&inputs["Jafter"])),
        drag_after: Drag(f(&inputs["Bafter"])),
        ..Load::NONE
    };
    (motor, GearedMotor::new(&motor, &load))
}

#[test]
fn plant_quantities() {
    let mut worst = Worst::default();
    for_each("plant", 20, |data, inputs, outputs| {
        let (motor, geared) = geared(data, inputs);
        let sigma = f(&outputs["sigma"]);
        let mut see = |got: f64, key: &str, scale: f64| {
            worst.see(got, f(&outputs[key]), 1e-12 * scale, &format!("{inputs} {key}"));
        };
        let relative = |key: &str| f(&outputs[key]);
        see(geared.shaft().inertia.0, "Jt", relative("Jt"));
        see(geared.shaft().drag.0, "Bt", relative("Bt"));
        see(geared.sigma(), "sigma", sigma);
        see(geared.gamma2(), "gamma2", sigma * sigma);
        see(geared.tau_m().0, "tau_m", relative("tau_m"));
        see(geared.tau_e().0, "tau_e", relative("tau_e"));
        let free = geared.steady(Applied::voltage(Volts(12.0)));
        see(free.speed.0, "free_speed_12V", 12.0 / motor.ke.0);
        see(free.current.0, "no_load_current_12V", 12.0 / motor.r.0);
        // If both poles are nearly equal, only half of their digits are exact.
        let pole_scale = if f(&outputs["gamma2"]).abs() < 1e-6 * sigma * sigma { 1e5 } else { 1.0 } * sigma;
        let (poles, oscillatory) = match geared.poles() {
            Poles::Real { slow, fast } => ([-slow, 0.0, -fast, 0.0], false),
            Poles::Complex { decay, frequency } => ([-decay, frequency, -decay, -frequency], true),
        };
        for (got, key) in poles.into_iter().zip(["pole1_re", "pole1_im", "pole2_re", "pole2_im"]) {
            see(got, key, pole_scale);
        }
        if pole_scale == sigma {
            assert_eq!(outputs["oscillatory"], oscillatory, "{inputs}");
        }
    });
    println!("plant: worst {:.1e}", 1e-12 * worst.0);
}

#[test]
fn step_response_at_any_time_and_for_any_poles() {
    let mut worst = Worst::default();
    for_each("step_response", 26, |data, inputs, outputs| {
        let (motor, geared) = geared(data, inputs);
        let applied = |voltage: f64, torque: f64| Applied {
            voltage: Volts(voltage),
            torque_after: NewtonMetres(torque),
        };
        let (v, torque) = (f(&inputs["vapp0"]), f(&inputs["tau_app0"]));
        let start = geared.steady(applied(v, torque));
        let after = applied(v + f(&inputs["dv"]), torque + f(&inputs["dtau"]));
        for row in outputs["rows"].as_array().unwrap() {
            let motion = geared.after(start, after, Seconds(f(&row[0])));
            let what = format!("{inputs} {row}");
            let speed_scale = 1e-12 * 12.0 / motor.ke.0;
            worst.see(motion.current.0, f(&row[1]), 1e-12 * 12.0 / motor.r.0, &what);
            worst.see(motion.speed.0, f(&row[2]), speed_scale, &what);
            let output = motion.speed.0 / motor.gear_ratio;
            worst.see(output, f(&row[3]), speed_scale / motor.gear_ratio, &what);
        }
    });
    println!("step_response: worst {:.1e}", 1e-12 * worst.0);
}

#[test]
fn voltage_drops_over_a_control_period() {
    let mut worst = Worst::default();
    for_each("pid_period", 120, |data, inputs, outputs| {
        let (motor, geared) = geared(data, inputs);
        let drop = geared.voltage_drop(RadPerSec(f(&inputs["Omega_motor"])), Seconds(f(&inputs["P"])));
        let mut see = |got: f64, key: &str, scale: f64| {
            worst.see(got, f(&outputs[key]), 1e-12 * scale, &format!("{inputs} {key}"));
        };
        let amps = 12.0 / motor.r.0;
        see(drop.before.0, "vapp0", 12.0);
        see(drop.emf.0, "vg", 12.0);
        see(drop.current_before.0, "i0", amps);
        see(drop.mean_current.0, "mean_i_after_drop_to_vg", amps);
        see(drop.end_current.0, "i_end_after_drop_to_vg", amps);
        see(drop.mean_zero_change.0, "dv_mean_zero", 12.0);
        see(drop.mean_zero_voltage.0, "v_mean_zero", 12.0);
        see(drop.mean_zero_end_speed.0, "omega_end_mean_zero", 12.0 / motor.ke.0);
    });
    println!("pid_period: worst {:.1e}", 1e-12 * worst.0);
}

#[test]
fn mean_current_over_a_control_period() {
    let mut worst = Worst::default();
    for_each("mean_current", 30, |data, inputs, outputs| {
        let (motor, geared) = geared(data, inputs);
        let period = Seconds(f(&inputs["P"]));
        let start = Motion { current: Amps(f(&inputs["i0"])), speed: RadPerSec(f(&inputs["Omega0"])) };
        for row in outputs["rows"].as_array().unwrap() {
            let voltage = Volts(f(&row[0]));
            let mean = geared.mean(start, Applied::voltage(voltage), period);
            let (amps, what) = (1e-12 * 12.0 / motor.r.0, format!("{inputs} {row}"));
            worst.see(mean.current.0, f(&row[1]), amps, &what);
            worst.see(mean.speed.0, f(&row[2]), 1e-12 * 12.0 / motor.ke.0, &what);
            let instant = geared.quasistatic_current(start.speed, voltage);
            worst.see(instant.0, f(&row[3]), amps, &what);
            let estimate = geared.mean_current_estimate(start, voltage, period);
            worst.see(estimate.0, f(&row[4]), amps, &what);
        }
    });
    println!("mean_current: worst {:.1e}", 1e-12 * worst.0);
}

/// Compares a point with its reference value, where null stands for infinity.
fn see_point(worst: &mut Worst, point: Point, outputs: &Value, name: &str, amps: f64, c_max: f64) {
    let what = format!("{name} {outputs}");
    match outputs[format!("x{name}")].as_f64() {
        Some(x) => worst.see(point.x, x, 1e-12 * c_max.max(x.abs()), &what),
        None => assert!(point.x.is_infinite(), "{what}"),
    }
    worst.see(point.y, f(&outputs[format!("y{name}")]), 1e-12 * amps, &what);
}

#[test]
fn points_of_the_schemes() {
    let mut worst = Worst::default();
    for_each("scheme_points", 216, |data, inputs, outputs| {
        let motor = motor(data, inputs);
        let scheme = match inputs["scheme"].as_str().unwrap() {
            "A" => Scheme::A,
            "B" => Scheme::B,
            "C" => Scheme::C,
            _ => Scheme::D { blend: f(&inputs["blend"]) },
        };
        let (battery, c_max) = (f(&inputs["Vbat"]), f(&inputs["cMax"]));
        let emf = Volts(motor.ke.0 * f(&inputs["Omega"]));
        let at = Conditions { battery: Volts(battery), emf };
        let points = scheme.points(c_max, motor.r, at);
        let scale = if scheme == Scheme::A { battery } else { battery / motor.r.0 };
        for (point, name) in [(points.s, "S"), (points.t, "T"), (points.z, "Z"), (points.g, "G")] {
            see_point(&mut worst, point, outputs, name, scale, c_max);
        }
        worst.see(points.u, f(&outputs["u"]), 1e-12, "u");
        assert_eq!(outputs["valid"], points.valid, "{inputs}");
    });
    println!("scheme_points: worst {:.1e}", 1e-12 * worst.0);
}

#[test]
fn points_of_the_schemes_from_encoder_counts() {
    let mut worst = Worst::default();
    for_each("scheme_fw", 16, |_, inputs, outputs| {
        let emf = Volts(f(&inputs["cps"]) * f(&inputs["keFw"]) / 1000.0);
        let at = Conditions { battery: Volts(f(&inputs["mvBattery"]) / 1000.0), emf };
        let (r, c_max) = (Ohms(f(&inputs["R"])), f(&inputs["cMax"]));
        let points = |scheme: Scheme| scheme.points(c_max, r, at);
        let d = points(Scheme::D { blend: f(&inputs["blend"]) });
        let (b, amps) = (points(Scheme::B), at.battery.0 / r.0);
        for (got, key, scale) in [
            (1000.0 * emf.0, "emf_mV", 1000.0),
            (points(Scheme::A).z.x, "A_xZ", c_max),
            (b.t.x, "B_xT", c_max),
            (points(Scheme::C).t.x, "C_xT", c_max),
            (d.t.x, "D_xT", c_max),
            (d.s.x, "D_xS", c_max),
            (b.g.y, "yG_A", amps),
            (b.s.y, "yS_A", amps),
            (b.t.y, "yT_A", amps),
        ] {
            match outputs[key].as_f64() {
                Some(want) => {
                    let scale = 1e-12 * scale.max(want.abs());
                    worst.see(got, want, scale, &format!("{key} {inputs}"));
                }
                None => assert!(got.is_infinite(), "{key} {inputs}"),
            }
        }
    });
    println!("scheme_fw: worst {:.1e}", 1e-12 * worst.0);
}

#[test]
fn emf_constant_per_encoder_count() {
    for_each("keFw", 2, |data, inputs, outputs| {
        let motor = Motor { counts_per_rev_motor: f(&inputs["countsPerRev"]), ..motor(data, inputs) };
        Worst::default().see(motor.ke_fw(), f(&outputs["keFw"]), 1e-13, "keFw");
    });
}

#[test]
fn crossing_from_braking_to_reverse() {
    let mut worst = Worst::default();
    for_each("reverse0", 8, |data, inputs, outputs| {
        let motor = motor(data, inputs);
        let bridge = Bridge::lossy(Volts(f(&inputs["Vd"])), Ohms(0.0));
        let emf = Volts(motor.ke.0 * f(&inputs["Omega"]));
        let at = Conditions { battery: Volts(f(&inputs["Vbat"])), emf };
        let (c_max, amps) = (f(&inputs["cMax"]), at.battery.0 / motor.r.0);
        let got = Circuit::new(&motor, bridge).reverse0(c_max, at);
        for (got, key, scale) in [
            (got.duty_at_t, "duty_at_T", 1.0),
            (got.current.0, "i_reverse0", amps),
            (got.current_at_t.0, "i_T", amps),
            (got.control_a, "controlReverse0_A", c_max),
            (got.control_b, "controlReverse0_B", c_max),
            (got.t_of_b, "xT_B", c_max),
            (got.blend_keeping_t_in_range, "blend_keeping_T_in_range", 1.0),
        ] {
            worst.see(got, f(&outputs[key]), 1e-12 * scale, &format!("{key} {inputs}"));
        }
    });
    println!("reverse0: worst {:.1e}", 1e-12 * worst.0);
}

#[test]
fn steady_speed_at_a_duty() {
    let mut worst = Worst::default();
    for_each("steady_speed_pwm", 3, |data, inputs, outputs| {
        let motor = motor(data, inputs);
        let bridge = Bridge::lossy(Volts(f(&inputs["Vd"])), Ohms(f(&inputs["Ron"])));
        let open_loop = OpenLoop::new(&motor, &Load::NONE, bridge);
        let battery = Volts(f(&inputs["Vbat"]));
        let frequency = Hertz(f(&inputs["f_Hz"]));
        let pwm = |duty: f64| Pwm::new(mode(inputs["mode"].as_str().unwrap()), duty, frequency);
        for row in outputs["rows"].as_array().unwrap() {
            let speed = open_loop.steady_speed(pwm(f(&row[0])), battery);
            worst.see(speed.0, f(&row[1]), 1e-11 * battery.0 / motor.ke.0, &format!("{inputs} {row}"));
        }
        let duty = open_loop.continuity_duty(pwm(0.0), battery).unwrap();
        worst.see(duty, f(&outputs["continuity_duty"]), 2e-11, &inputs.to_string());
    });
    println!("steady_speed_pwm: worst {:.1e}", 1e-11 * worst.0);
}
