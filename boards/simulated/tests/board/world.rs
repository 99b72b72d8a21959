//! Plants and devices behind the board's traits: bridges, pins, servos, analog inputs and the inertial sensor.

use crate::{board, scenario};
use embassy_futures::block_on;
use motor_hub::board::{BridgeSensors, Bridges, Devices, ServoPulse};
use motor_hub::bridge::{Drive, Mode};
use motor_hub::model::load::Load;
use motor_hub::model::si::{Drag, KgM2, Seconds};
use motor_hub::model::train::Train;
use motor_hub::protocol::pins::Pin;
use motor_hub::units::Duty;
use simulated::bno055::Bno055;
use simulated::hardware::{BRIDGE, MOTORS, REAL_BRIDGE, WHEEL_DIAMETER_MM};
use simulated::i2c::Fault;
use simulated::scenario::Scenario;
use simulated::world::Board;
use std::f64::consts::TAU;

#[test]
fn a_real_bridge_takes_too_short_a_low_time_for_a_short_circuit_and_is_open_until_its_lines_are_low() {
    let mut board = board(&[BRIDGE, REAL_BRIDGE]);
    let mut run = |share: f64| {
        let drive = Drive { mode: Mode::Cw98, duty: Duty::from_bits((32_768.0 * share) as u16) };
        let drive = if share == 0.0 { Drive::COAST } else { drive };
        board.apply(&[drive, drive, Drive::COAST, Drive::COAST]);
        let flows = board.run(Seconds(0.05), &[0.0; 2]);
        (
            block_on(board.sample()).map(|bridge| bridge.fault),
            [flows[0].charge.0 > 1e-3, flows[1].charge.0 > 1e-3],
        )
    };
    let (sound, fault) = ([false; MOTORS], [false, true, false, false]);
    assert_eq!(run(0.879), (sound, [true, true]));
    assert_eq!(run(1.0), (sound, [true, true]));
    assert_eq!(run(0.9), (fault, [true, false]));
    assert_eq!(run(0.5), (fault, [true, false]));
    assert_eq!(run(0.0), (sound, [false, false]));
    assert_eq!(run(0.5), (sound, [true, true]));
}

#[test]
fn digital_pins_are_pulled_up_unless_something_pulls_them_down_or_the_hub_drives_them() {
    let mut board = board(&[BRIDGE]);
    assert_eq!(board.update_digital_pins(0, 0), 0xFF);
    board.press(3, true);
    assert_eq!(board.update_digital_pins(0, 0), 0xF7);
    assert_eq!(board.update_digital_pins(0b11, 0b10), 0xF6);
    board.press(3, false);
    assert_eq!(board.update_digital_pins(0, 0b10), 0xFF);
}

#[test]
fn pins_that_a_wire_connects_have_one_level_low_if_either_is_pulled_low() {
    let wire = [4, 5].map(|pin| Pin::new(pin).expect("a pin"));
    let mut board = Board::new(&Scenario { wire: Some(wire), ..scenario(&[BRIDGE]) });
    let (four, five) = (1 << 4, 1 << 5);
    assert_eq!(board.update_digital_pins(0, 0), 0xFF, "both are pulled up");
    for driven in [four, five] {
        assert_eq!(board.update_digital_pins(driven, 0), 0xCF, "driven low");
        assert_eq!(board.update_digital_pins(driven, driven), 0xFF, "driven high");
    }
    assert_eq!(board.update_digital_pins(1, 0), 0xFE, "another pin");
    board.press(5, true);
    assert_eq!(board.update_digital_pins(0, 0), 0xCF, "connected to ground");
}

#[test]
fn a_drive_base_stands_on_the_wheels_and_not_on_the_encoders_behind_the_backlash() {
    let mut scenario = scenario(&[BRIDGE; 2]);
    let train = Train { backlash_after: 10_f64.to_radians(), stiffness_after: 300.0, damping_after: 0.3 };
    for motor in &mut scenario.motors {
        // The drag keeps the wheel from running ahead of the motor.
        motor.load = Load { drag_after: Drag(0.02), ..Load::inertia(KgM2(0.006)) };
        motor.train = Some(train);
    }
    let mut board = Board::new(&scenario);
    let forward = Drive { mode: Mode::Cw98, duty: Duty::ONE };
    board.apply(&[forward, forward, Drive::COAST, Drive::COAST]);
    board.run(Seconds(1.0), &[0.0; 2]);
    let counted_degrees =
        360.0 * board.view().motors[0].1 as f64 / scenario.motors[0].constants.counts_per_rev_output();
    let wheel_degrees = (2.0 * board.pose().x_mm / WHEEL_DIAMETER_MM).to_degrees();
    // The motor pushes the wheel, so it leads by half of the backlash.
    let lead = counted_degrees - wheel_degrees;
    assert!((4.5..5.5).contains(&lead), "{lead} degrees");
}

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
fn a_scenario_says_what_is_connected() {
    let text = "name = \"x\"\nduration_s = 1\nbattery = { emf_v = 12, resistance_ohm = 0.1 }\n\
                attached = { analog_v = [1.5, 3.3], low_pins = [2], i2c_faults = [\"none\", \"stuck-clock\"] }\n\
                motors = [{ label = \"a\", motor = \"NeveRest 60\", setpoints = [{ at_s = 0, power = 0.1 }] }]\n";
    let attached = Scenario::parse("my.toml", text).expect("right").attached;
    assert_eq!(attached.analog_v, [1.5, 3.3]);
    assert_eq!(attached.low_pins, Some(vec![Pin::new(2).expect("a pin")]));
    assert_eq!(attached.i2c_faults, [Fault::None, Fault::StuckClock]);
}
