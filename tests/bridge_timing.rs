//! Tests a bridge with switching times: in the model, and in the hub's compensation for these times.

mod common;

use common::{Bench, inertia, neverest_60 as am60, velocity};
use motor_hub::braking::Winding;
use motor_hub::bridge::{BridgeConstants, Mode, Timing};
use motor_hub::model::periodic::Steady;
use motor_hub::model::plant::{Plant, PlantInput};
use motor_hub::model::si::{Amps, Hertz, RadPerSec, Seconds, Volts};
use motor_hub::model::switching::{Bridge, Circuit, Conditions, Pwm};
use motor_hub::motor::{Setpoint, Settings};
use motor_hub::units::Control;

const PWM: Hertz = Hertz(20_000.0);

/// Inertia of a flywheel that is so heavy that the speed does not change.
const HEAVY_KG_M2: f64 = 1e6;

fn bridge(timing: Timing) -> Bridge {
    Bridge::new(BridgeConstants::IDEAL.with_timing(timing))
}

/// A motor whose back EMF is 3 V, on a battery of 12 V.
const AT: Conditions = Conditions { battery: Volts(12.0), emf: Volts(3.0) };

/// The steady current of the motor at a duty of mode 9/8.
fn steady(timing: Timing, duty: f64) -> Steady {
    Circuit::new(&am60(), bridge(timing)).steady(Pwm::new(Mode::Cw98, duty, PWM), AT)
}

#[test]
fn edges_shift_the_voltage_of_a_continuous_current_by_half_of_their_difference() {
    // Turning on takes 1 us longer than turning off. For half of this time, 0.5 us in each period of 50 us, the voltage
    // is lower by V + Vd. The mean voltage is therefore lower by 1 % of V + Vd.
    let mean =
        |turn_on_ns, turn_off_ns| steady(Timing { turn_on_ns, turn_off_ns, ..Timing::IDEAL }, 0.6).mean.0;
    let (fast, slow) = (mean(0, 0), mean(2_000, 1_000));
    let lost = (fast - slow) * (am60().r.0 + 0.1);
    assert!((lost - 0.01 * 12.7).abs() < 0.003, "{lost}");
    // Edges of equal duration cancel out, except for the voltage across a switch that is half closed during an edge.
    assert!((mean(2_000, 2_000) - fast).abs() < 2e-3 * fast);
    // At a duty of 0 or 1 the PWM line has no edges, so the timing has no effect.
    for duty in [0.0, 1.0] {
        let [slow, fast] = [Timing::VNH5019, Timing::IDEAL].map(|timing| steady(timing, duty).mean.0);
        assert!((slow - fast).abs() < 1e-9, "{duty}");
    }
}

#[test]
fn switches_get_the_heat_of_their_edges() {
    // During both edges together, 2.2 us of 50 us, the switches dissipate half of the current times 12.7 V.
    let (fast, slow) = (steady(Timing::IDEAL, 0.6), steady(Timing::VNH5019, 0.6));
    let power = |steady: Steady| {
        let work = 3.0 * steady.sums.current;
        // Energy is conserved: the energy from the battery becomes heat or work.
        assert!((12.0 * steady.sums.battery() - work - steady.sums.heat).abs() < 1e-9);
        steady.sums.heat / steady.period.0 - steady.rms.0.powi(2) * (am60().r.0 + 0.08)
    };
    let more = power(slow) - power(fast);
    let wanted = 0.5 * 12.7 * slow.mean.0 * 2.2 / 50.0;
    assert!((more - wanted).abs() < 0.2 * wanted, "{more} W, {wanted} W");
}

#[test]
fn a_plant_runs_as_its_steady_current_says_whatever_the_step() {
    let emf = am60().ke.0 * 100.0;
    let at = Conditions { battery: Volts(12.0), emf: Volts(emf) };
    let timing = Timing { change_us: 0, ..Timing::VNH5019 };
    for (mode, duty) in [(Mode::Cw98, 0.3), (Mode::Cw98, 0.7), (Mode::Brake50, 0.5), (Mode::Ccw62, 0.1)] {
        let wanted = Circuit::new(&am60(), bridge(timing)).steady(Pwm::new(mode, duty, PWM), at).mean.0;
        for step in [1e-3, 1.7e-5] {
            let mut plant = Plant::new(am60(), inertia(HEAVY_KG_M2), bridge(timing), PWM);
            plant.set_state(Amps(wanted), RadPerSec(100.0), 0.0);
            let mut run = |seconds: f64| {
                let mut charge = 0.0;
                for _ in 0..(seconds / step) as u64 {
                    charge += plant.run(Seconds(step), PlantInput::pwm(mode, duty), Volts(12.0)).charge.0;
                }
                charge
            };
            run(0.01);
            let mean = run(0.051) / ((0.051 / step) as u64 as f64 * step);
            assert!(
                (mean - wanted).abs() < 5e-3 * (1.0 + wanted.abs()),
                "{mode:?} {duty} {step}: {mean}, {wanted}"
            );
        }
    }
}

#[test]
fn a_bridge_is_open_while_its_mode_changes_and_at_no_other_time() {
    let mut plant = Plant::new(am60(), inertia(HEAVY_KG_M2), bridge(Timing::VNH5019), PWM);
    let mut charge =
        |mode, duty, seconds| plant.run(Seconds(seconds), PlantInput::pwm(mode, duty), Volts(12.0)).charge.0;
    assert!(charge(Mode::Cw98, 1.0, 6e-4).abs() < 1e-12);
    assert!(charge(Mode::Cw98, 1.0, 6e-4) > 1e-4);
    // A new duty in the same mode does not open the bridge.
    charge(Mode::Cw98, 1.0, 1e-2);
    let going_on = charge(Mode::Cw98, 0.9, 6e-4);
    assert!(going_on > 1.5e-3, "{going_on}");
    // The previous current decays to zero while the bridge is open.
    charge(Mode::Ccw62, 1.0, 5.9e-4);
    assert!(charge(Mode::Ccw62, 1.0, 5e-6).abs() < 1e-12);
    assert!(charge(Mode::Ccw62, 1.0, 1e-3) < -1e-3);
}

#[test]
fn the_current_of_a_period_that_begins_with_a_change_of_mode_is_less_by_what_that_takes() {
    let bridge = BridgeConstants::VNH5019;
    for (ms, left) in [(50, 1.0 - 0.6 / 50.0), (10, 0.94), (1, 0.4)] {
        let settings = Settings { bridge, ..Settings::new(Winding::NEVEREST_60) };
        let mut bench = Bench::one(settings, common::plant(am60(), inertia(HEAVY_KG_M2)), ms);
        bench.set(0, Setpoint::ConstantPower(Control::MAX));
        let first = bench.tick().motors[0].current.get();
        assert!((f64::from(first) - left * 12_000.0 / 3.4).abs() < 2.0, "{ms} ms: {first}");
    }
}

#[test]
fn a_winch_on_a_real_bridge_is_held_as_on_an_ideal_one() {
    for ms in [50, 10] {
        let settings = Settings { bridge: BridgeConstants::VNH5019, ..Settings::new(Winding::NEVEREST_60) };
        let plant = Plant::new(am60(), inertia(0.05), bridge(Timing::VNH5019), PWM);
        let mut bench = Bench::one(settings, plant, ms);
        bench.set(0, velocity(1_360));
        // Without a load, and lowering one.
        for torque in [0.0, 0.8] {
            bench.axes[0].torque = torque;
            bench.run_ms(4_000);
            let error = bench.highest(1_000, |bench| (bench.speed(0) - 1_360.0).abs());
            assert!(error < 15.0, "{ms} ms, {torque} N m: {error} counts/s");
        }
    }
}
