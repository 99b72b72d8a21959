//! Motor currents: currents in the model, voltages of the sense lines, and values in the answers to a host agree.

use std::time::Duration;

use crate::common::{am60, ms, on, with_host};
use emulated::host_link::HostLink;
use emulated::{Bench, Board, Mounting};
use motor_hub::extension::MotorFunction;
use motor_hub::extension::report::Condition;
use motor_hub::model::si::Ohms;
use motor_hub::motor::SenseLine;
use motor_hub::protocol::requests::{AdcChannel, BATTERY_CURRENT};
use simulated::current_line::CurrentLine;

/// Returns a motor that a hard stop holds from the beginning.
fn held() -> Mounting {
    Mounting { stops: Some((0, 0)), ..am60() }
}

fn condition(bench: &mut Bench, host: &mut HostLink, motor: u8) -> Condition {
    host.read(bench, MotorFunction::Condition.to(motor))
}

/// Returns the current of a motor in mA that a host gets.
fn reported(bench: &mut Bench, host: &mut HostLink, motor: u8) -> f64 {
    f64::from(host.analog(bench, AdcChannel::new(8 + motor).expect("a channel")))
}

/// Expects that the hub measures the current of each motor, and reports the currents in mA that flow.
#[track_caller]
fn expect_measured(bench: &mut Bench, host: &mut HostLink, flows: [f64; 4]) {
    for (motor, flows) in (0..).zip(flows) {
        let reported = reported(bench, host, motor);
        println!("motor {motor}: {flows:.0} mA flow, {reported:.0} mA reported");
        let tolerance = 10.0 + 0.02 * flows.abs();
        assert!((reported - flows.abs()).abs() < tolerance, "motor {motor}: {flows}, {reported} mA");
        let Condition { measured_ma, sense_line, .. } = condition(bench, host, motor);
        assert_eq!((measured_ma.is_some(), sense_line), (true, SenseLine::Sound), "motor {motor}");
    }
}

/// Returns the mean current of each motor and of the battery over 100 ms, in mA.
fn flowing(bench: &mut Bench) -> ([f64; 4], f64) {
    let charges = |bench: &mut Bench| {
        let flows = [0, 1, 2, 3].map(|motor| bench.look(motor).flow);
        (flows.map(|flow| flow.charge.0), flows.iter().map(|flow| flow.battery_charge()).sum::<f64>())
    };
    let (from, drawn_from) = charges(bench);
    bench.run(ms(100));
    let (to, drawn_to) = charges(bench);
    (std::array::from_fn(|motor| 1e4 * (to[motor] - from[motor])), 1e4 * (drawn_to - drawn_from))
}

#[test]
pub(crate) fn a_host_gets_the_currents_that_flow_also_of_a_motor_whose_constants_are_wrong() {
    // Motor 0 is held, motor 1 runs free, motor 2 is held and has half of its configured resistance, and motor 3 turns
    // in reverse under a load.
    let mut other = held();
    other.motor.r = Ohms(0.5 * other.motor.r.0);
    let (mut bench, mut host) = with_host(vec![held(), am60(), other, am60()]);
    bench.set_torque(3, 0.4);
    for (motor, power) in [(0, 16_384), (1, 29_000), (2, 10_000), (3, -20_000)] {
        host.power(&mut bench, motor, power);
    }
    bench.run(ms(600));
    let (flows, drawn) = flowing(&mut bench);
    expect_measured(&mut bench, &mut host, flows);
    let modelled = f64::from(condition(&mut bench, &mut host, 2).current.get());
    assert!(modelled < 0.6 * flows[2], "{modelled} mA by the configured constants");
    let reported = f64::from(host.analog(&mut bench, BATTERY_CURRENT));
    println!("battery: {drawn:.0} mA, {reported:.0} mA reported");
    let (battery_v, _) = bench.battery();
    // The hub multiplies each motor's current by the motor voltage and divides the product by the battery voltage. The
    // motor voltage is computed from the configured resistance, and motor 2 has half of this resistance.
    let excess = 1e-3 * flows[2].powi(2) * 0.5 * held().motor.r.0 / battery_v;
    // The hub does not count the losses of the bridge. The current flows through two switches, or through a switch and a catch diode.
    let bridge = held().bridge;
    let lost_volts = |ma: f64| bridge.vd.0 + 2.0 * bridge.ron.0 * 1e-3 * ma;
    let lost: f64 = flows.iter().map(|ma| ma.abs() * lost_volts(ma.abs()) / battery_v).sum();
    // No motor voltage exceeds the battery voltage. The error of the battery current is therefore at most the sum of the
    // errors of the motor currents.
    let tolerance: f64 = flows.iter().map(|ma| 10.0 + 0.02 * ma.abs()).sum();
    let expected = drawn + excess - lost - tolerance..=drawn + excess + tolerance;
    assert!(expected.contains(&reported), "battery: {reported} mA reported, {expected:?} mA expected");
    bench.assert_sound();
}

#[test]
fn after_conversions_that_came_too_late_each_motor_has_its_own_current_again() {
    on(Board::NucleoH743zi2, || {
        let (mut bench, mut host) = with_host(vec![held(), held(), held(), held()]);
        // Three late conversions make more words than the FIFO of the converter holds.
        for _ in 0..3 {
            bench.delay_conversion(2, Duration::from_micros(300));
            bench.run(ms(60));
        }
        for (motor, power) in [(0, 16_384), (1, 12_000), (2, 8_000), (3, 4_000)] {
            host.power(&mut bench, motor, power);
        }
        bench.run(ms(600));
        let (flows, _) = flowing(&mut bench);
        expect_measured(&mut bench, &mut host, flows);
        bench.assert_sound();
    });
}

#[test]
fn converters_that_a_disturbance_has_switched_off_measure_again() {
    on(Board::NucleoF429zi, || {
        let (mut bench, mut host) = with_host(vec![held()]);
        host.power(&mut bench, 0, 12_000);
        bench.run(ms(600));
        assert!(condition(&mut bench, &mut host, 0).measured_ma.is_some());
        // ADC2_CR2 and ADC3_CR2, whose bit ADON is then 0 (RM0090 13.13.3).
        bench.write_register(0x4001_2108, 0);
        bench.write_register(0x4001_2208, 0);
        bench.set_analog(0, 1_500);
        bench.run(ms(300));
        let input = host.analog(&mut bench, AdcChannel::new(0).expect("a channel"));
        assert!((input - 1_500).abs() <= 3, "{input} mV");
        let measured = condition(&mut bench, &mut host, 0).measured_ma;
        assert!(measured.is_some(), "the converter has not been switched on");
    });
}

#[test]
pub(crate) fn a_broken_sense_line_is_reported_and_not_used() {
    let (mut bench, mut host) = with_host(vec![held(), held(), held()]);
    bench.set_current_line(0, CurrentLine::StuckLow);
    bench.set_current_line(1, CurrentLine::StuckHigh);
    bench.run(ms(300));
    for motor in 0..3 {
        host.power(&mut bench, motor, 16_384);
    }
    bench.run(ms(600));
    let said = [0, 1, 2].map(|motor| condition(&mut bench, &mut host, motor));
    assert_eq!(
        said.map(|is| (is.sense_line, is.measured_ma.is_some())),
        [(SenseLine::NoCurrent, false), (SenseLine::Stuck, false), (SenseLine::Sound, true)]
    );
    let modelled = f64::from(said[0].current.get());
    for motor in 0..2 {
        let reported = reported(&mut bench, &mut host, motor);
        assert!((reported - modelled).abs() < 20.0, "motor {motor}: {reported} mA for {modelled}");
    }
    // A repaired line needs no reset.
    bench.set_current_line(0, CurrentLine::Sound);
    bench.set_current_line(1, CurrentLine::Sound);
    bench.run(ms(300));
    host.enable(&mut bench, 1, false);
    bench.run(ms(300));
    for motor in 0..2 {
        assert_eq!(condition(&mut bench, &mut host, motor).sense_line, SenseLine::Sound, "motor {motor}");
    }
    bench.assert_sound();
}
