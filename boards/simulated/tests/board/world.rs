//! Plants behind the board's traits.

use crate::{board, scenario};
use motor_hub::board::{BridgeFaults, Bridges, Devices};
use motor_hub::bridge::{Drive, Mode};
use motor_hub::model::load::Load;
use motor_hub::model::si::{Drag, KgM2, Seconds};
use motor_hub::model::train::Train;
use motor_hub::protocol::pins::Pin;
use motor_hub::units::Duty;
use simulated::hardware::{BRIDGE, MOTORS, REAL_BRIDGE, WHEEL_DIAMETER_MM};
use simulated::scenario::Scenario;
use simulated::world::Board;

#[test]
fn a_real_bridge_takes_too_short_a_low_time_for_a_short_circuit_and_is_open_until_its_lines_are_low() {
    let mut board = board(&[BRIDGE, REAL_BRIDGE]);
    let mut run = |share: f64| {
        let drive = Drive { mode: Mode::Cw98, duty: Duty::from_bits((32_768.0 * share) as u16) };
        let drive = if share == 0.0 { Drive::COAST } else { drive };
        board.apply(&[drive, drive, Drive::COAST, Drive::COAST]);
        let flows = board.run(Seconds(0.05), &[0.0; 2]);
        (board.faults(), [flows[0].charge.0 > 1e-3, flows[1].charge.0 > 1e-3])
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
