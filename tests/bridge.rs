//! The sixteen switch patterns against the paper's table, and the drives that a bridge may be given.

use motor_hub::bridge::{Drive, Mode, State};
use motor_hub::model::bridge_states::{CurrentSign, Effect, SwitchPattern};
use motor_hub::units::Duty;

const BATTERY: i32 = 12_000;
const DIODE: i32 = 700;

/// The paper's table (section 1.2), with the short-circuit rows as corrected.
#[rustfmt::skip]
const TABLE: [(u8, [u8; 4], Effect, Effect); 16] = {
    use Effect::*;
    [
        (9, [1, 0, 0, 1], DriveCw, DriveCw),
        (6, [0, 1, 1, 0], DriveCcw, DriveCcw),
        (0, [0, 0, 0, 0], Coast, Coast),
        (8, [1, 0, 0, 0], Coast, BrakeToVcc),
        (4, [0, 1, 0, 0], BrakeToGnd, Coast),
        (2, [0, 0, 1, 0], BrakeToVcc, Coast),
        (1, [0, 0, 0, 1], Coast, BrakeToGnd),
        (5, [0, 1, 0, 1], BrakeToGnd, BrakeToGnd),
        (10, [1, 0, 1, 0], BrakeToVcc, BrakeToVcc),
        (12, [1, 1, 0, 0], ShortCircuit, ShortCircuit),
        (3, [0, 0, 1, 1], ShortCircuit, ShortCircuit),
        (7, [0, 1, 1, 1], ShortCircuit, ShortCircuit),
        (11, [1, 0, 1, 1], ShortCircuit, ShortCircuit),
        (13, [1, 1, 0, 1], ShortCircuit, ShortCircuit),
        (14, [1, 1, 1, 0], ShortCircuit, ShortCircuit),
        (15, [1, 1, 1, 1], ShortCircuit, ShortCircuit),
    ]
};

fn pattern(number: u8) -> SwitchPattern {
    SwitchPattern::new(number).expect("0 to 15")
}

#[test]
fn every_pattern_does_to_a_turning_motor_what_the_paper_prints() {
    for (number, switches, cw, ccw) in TABLE {
        let pattern = pattern(number);
        assert_eq!(pattern.switches().map(u8::from), switches, "switches of {number}");
        assert_eq!(pattern.effect(5_000, BATTERY, DIODE), cw, "{number} turning CW");
        assert_eq!(pattern.effect(-5_000, BATTERY, DIODE), ccw, "{number} turning CCW");
    }
}

#[test]
fn braking_through_one_diode_needs_an_emf_above_its_drop() {
    for (number, sign) in [(8, -1), (4, 1), (2, 1), (1, -1)] {
        assert_eq!(pattern(number).effect(sign * DIODE, BATTERY, DIODE), Effect::Coast, "{number}");
        assert_ne!(pattern(number).effect(sign * (DIODE + 1), BATTERY, DIODE), Effect::Coast, "{number}");
    }
    // Full dynamic braking has no threshold.
    assert_eq!(pattern(5).effect(1, BATTERY, DIODE), Effect::BrakeToGnd);
    assert_eq!(pattern(10).effect(-1, BATTERY, DIODE), Effect::BrakeToVcc);
}

#[test]
fn coasting_becomes_regeneration_above_the_battery_and_the_diodes_in_the_path() {
    for (number, sign, diodes) in [(8, 1, 1), (4, -1, 1), (2, -1, 1), (1, 1, 1), (0, 1, 2), (0, -1, 2)] {
        let threshold = BATTERY + diodes * DIODE;
        assert_eq!(pattern(number).effect(sign * threshold, BATTERY, DIODE), Effect::Coast, "{number}");
        let above = pattern(number).effect(sign * (threshold + 1), BATTERY, DIODE);
        assert_eq!(above, Effect::Regenerate, "{number}");
    }
}

#[test]
fn exactly_the_nine_patterns_that_short_no_leg_can_be_commanded() {
    let commandable: Vec<u8> = State::ALL.iter().map(|state| state.pattern().number()).collect();
    let legal: Vec<u8> = (0..16).filter(|&n| !pattern(n).is_short_circuit()).collect();
    assert_eq!(commandable, legal);
    assert_eq!(SwitchPattern::new(16), None);
    for state in State::ALL {
        for sign in [CurrentSign::Positive, CurrentSign::Negative] {
            assert_eq!(Some(state.terminal(sign)), state.pattern().terminal(sign));
        }
    }
}

#[test]
fn no_state_of_a_mode_or_between_its_states_shorts_a_leg() {
    for mode in [Mode::Cw98, Mode::Ccw62, Mode::Brake50] {
        let (on, off) = (mode.on().pattern().number(), mode.off().pattern().number());
        // Switches of both states may overlap in time while they change over.
        assert!(!pattern(on | off).is_short_circuit(), "{}", mode.name());
        assert_eq!(mode.name(), format!("{on}/{off}"));
        assert_eq!(mode.mirrored().mirrored(), mode);
    }
}

#[test]
fn coast_is_state_0_and_brake_is_state_5_all_the_time() {
    assert_eq!((Drive::COAST.mode.off(), Drive::COAST.duty), (State::Coast, Duty::ZERO));
    assert_eq!((Drive::BRAKE.mode.on(), Drive::BRAKE.duty), (State::BrakeLow, Duty::ONE));
}
