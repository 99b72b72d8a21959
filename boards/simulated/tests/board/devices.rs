//! Servos, analog inputs and the inertial sensor of the simulated board.

use crate::board;
use motor_hub::board::{Bridges, Devices, ServoPulse};
use motor_hub::bridge::{Drive, Mode};
use motor_hub::model::si::Seconds;
use motor_hub::protocol::pins::Pin;
use motor_hub::units::Duty;
use simulated::bno055::Bno055;
use simulated::hardware::BRIDGE;
use simulated::i2c::Fault;
use simulated::scenario::Scenario;
use std::f64::consts::TAU;

fn read<const N: usize>(imu: &mut Bno055, register: u8) -> [u8; N] {
    let mut bytes = [0; N];
    imu.write(&[register]);
    imu.read(&mut bytes);
    bytes
}

fn word(imu: &mut Bno055, register: u8) -> i16 {
    i16::from_le_bytes(read(imu, register))
}

#[test]
fn analog_inputs_are_read_in_millivolts_and_counts_and_open_ones_read_0() {
    let mut board = board(&[BRIDGE; 2]);
    for volts in [0.0, 0.1, 1.65, 3.2] {
        board.set_analog(2, volts);
        let readings = board.analog();
        let input = readings.inputs[2].expect("measured");
        assert!((f64::from(input.voltage.get()) - 1e3 * volts).abs() < 3.0, "{volts} {input:?}");
        assert!((f64::from(input.counts) - volts / 3.27 * 4095.0).abs() <= 0.5, "{volts} {input:?}");
        assert_eq!(readings.inputs[0].map(|input| input.voltage.get()), Some(0), "open");
        assert!(readings.rail.is_some_and(|rail| rail.get().abs_diff(5_020) < 10), "{:?}", readings.rail);
    }
}

#[test]
fn servo_pulses_are_recorded() {
    let mut board = board(&[BRIDGE; 2]);
    let pulse = Some(ServoPulse { period_us: 20_000, width_us: 1_500 });
    board.set_servos(&[None, pulse, None, None, None, None]);
    assert_eq!(board.servos()[1], pulse);
}

/// The start sequence of the competition's software.
#[test]
fn the_inertial_sensor_starts_as_hosts_start_it() {
    let mut imu = Bno055::default();
    assert!(!imu.answers());
    imu.run(0.7, 0.0, 0.0);
    assert!(imu.answers());
    assert_eq!(read(&mut imu, 0), [0xA0, 0xFB, 0x32, 0x0F]);
    assert_eq!(read(&mut imu, 0x3D), [0], "configuration mode");
    imu.write(&[0x3E, 0]);
    for setting in [
        [0x07, 0x00],
        [0x3B, 0x80],
        [0x41, 0x24],
        [0x42, 0x00],
        [0x07, 0x01],
        [0x08, 0x0D],
        [0x09, 0x0B],
        [0x0A, 0x38],
        [0x0B, 0x00],
        [0x07, 0x00],
        [0x3F, 0x00],
    ] {
        imu.write(&setting);
    }
    imu.write(&[0x07, 1]);
    assert_eq!(read(&mut imu, 0x08), [0x0D, 0x0B, 0x38, 0x00], "the second page keeps its registers");
    imu.write(&[0x07, 0]);
    assert_eq!(read(&mut imu, 0x20), [0; 8], "the configuration mode shows zeros");
    imu.write(&[0x3D, 8]);
    imu.run(0.005, 0.0, 0.0);
    assert_eq!(read(&mut imu, 0x39), [0], "the mode changes after 7 ms");
    imu.run(0.01, 0.0, 0.0);
    assert_eq!([read(&mut imu, 0x3D), read(&mut imu, 0x39)], [[8], [5]]);
    assert_eq!(read(&mut imu, 0x20), [0, 0x40, 0, 0, 0, 0, 0, 0], "no rotation");
    // Settings are ignored outside of the configuration mode.
    imu.write(&[0x3B, 0x86]);
    assert_eq!(read(&mut imu, 0x3B), [0x80]);
}

#[test]
fn a_reset_takes_650_ms_and_ends_in_the_configuration_mode() {
    let mut imu = Bno055::default();
    imu.run(1.0, 0.0, 0.0);
    imu.write(&[0x3D, 8]);
    imu.run(1.0, 0.0, 0.0);
    imu.write(&[0x3F, 0x20]);
    imu.run(0.6, 0.0, 0.0);
    assert!(!imu.answers());
    imu.run(0.1, 0.0, 0.0);
    assert!(imu.answers());
    assert_eq!(read(&mut imu, 0x3D), [0]);
}

#[test]
fn heading_grows_clockwise_and_rate_and_quaternion_to_the_left() {
    let mut imu = Bno055::default();
    imu.run(1.0, 0.3, 0.0);
    imu.write(&[0x3D, 8]);
    imu.run(0.01, 0.3, 0.0);
    for (turned, heading) in [(0.0, 0), (-0.25, 90), (0.25, 270), (0.75, 90), (-3.5, 180)] {
        imu.run(0.01, 0.3 + TAU * turned, TAU / 360.0 * 90.0);
        assert_eq!(word(&mut imu, 0x1A), 16 * heading, "{turned}");
        assert_eq!(word(&mut imu, 0x18), 16 * 90, "degrees per second");
        let half = 0.5 * TAU * turned;
        assert_eq!(word(&mut imu, 0x20), (16_384.0 * half.cos()).round() as i16);
        assert_eq!(word(&mut imu, 0x26), (16_384.0 * half.sin()).round() as i16);
    }
    // In radians.
    imu.write(&[0x3D, 0]);
    imu.run(0.02, 0.0, 0.0);
    imu.write(&[0x3B, 0x86]);
    imu.write(&[0x3D, 8]);
    imu.run(0.01, 0.0, 0.0);
    imu.run(0.01, -1.0, -2.0);
    assert_eq!([word(&mut imu, 0x1A), word(&mut imu, 0x18)], [900, -1800]);
    // A turn has 5654.87 units of 1/900 radian. Values from 5654.5 on round to a full turn, which reads 0.
    for (units, heading) in [(5653.0, 5653), (5654.0, 5654), (5654.4, 5654), (5654.6, 0), (0.4, 0), (0.6, 1)]
    {
        imu.run(0.01, -units / 900.0, 0.0);
        assert_eq!(word(&mut imu, 0x1A), heading, "{units}");
    }
}

#[test]
fn the_inertial_sensor_turns_with_the_wheels_of_motors_0_and_1() {
    let mut board = board(&[BRIDGE; 2]);
    // The right wheel drives forward, so the base turns left: headings grow clockwise.
    let forward = Drive { mode: Mode::Cw98, duty: Duty::ONE };
    board.run(Seconds(1.0), &[0.0; 2]);
    board.with_imu(|imu| imu.write(&[0x3D, 8]));
    board.run(Seconds(0.02), &[0.0; 2]);
    board.apply(&[Drive::COAST, forward, Drive::COAST, Drive::COAST]);
    for _ in 0..500 {
        board.run(Seconds(1e-3), &[0.0; 2]);
    }
    let counts = board.view().motors.iter().map(|(_, counts)| *counts as f64 / 1680.0).collect::<Vec<_>>();
    let turned = (counts[1] - counts[0]) * 0.5 * 90.0 / 300.0;
    assert!(turned > 0.05, "{turned} turns");
    let heading = f64::from(board.with_imu(|imu| word(imu, 0x1A))) / 16.0;
    assert!((heading - 360.0 * (1.0 - turned.fract())).abs() < 0.5, "{heading} {turned}");
}

#[test]
fn a_scenario_says_what_is_connected() {
    let text = "name = \"x\"\nduration_s = 1\nbattery = { emf_v = 12, resistance_ohm = 0.1 }\n\
                attached = { analog_v = [1.5, 3.3], low_pins = [2], i2c_faults = [\"none\", \"stuck-clock\"] }\n\
                motors = [{ label = \"a\", motor = \"NeveRest 60\", setpoints = [{ at_s = 0, power = 0.1 }] }]\n";
    let attached = Scenario::parse("my.toml", text).expect("right").attached;
    assert_eq!(attached.analog_v, [1.5, 3.3]);
    assert_eq!(attached.low_pins, Some(vec![Pin::new(2).expect("a pin")]));
    assert_eq!(attached.i2c_faults, [Fault::None, Fault::StuckClock]);
}
