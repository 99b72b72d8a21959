//! The button on a board.

use motor_hub::motor::Setpoint;
use motor_hub::responder::button::{Button, ButtonInputs, DEBOUNCE_MICROS, HOLD_MICROS};
use motor_hub::units::{CountsPerSecond, Micros};

const TURN: Setpoint = Setpoint::Velocity(CountsPerSecond::new(1000));
const HALT: Setpoint = Setpoint::Velocity(CountsPerSecond::ZERO);

/// Interval in us at which a board reads its button.
const STEP: u64 = 10_000;

/// A board whose button is read every 10 ms.
struct Bench {
    button: Button,
    now: u64,
    battery_good: bool,
    permitted: bool,
}

impl Bench {
    /// Powered on with the button up.
    fn new() -> Self {
        let mut bench = Self { button: Button::default(), now: 0, battery_good: true, permitted: true };
        bench.look(false);
        bench
    }

    fn look(&mut self, down: bool) -> Setpoint {
        self.now += STEP;
        let (battery_good, permitted) = (self.battery_good, self.permitted);
        self.button.step(ButtonInputs { down, permitted, battery_good, now: Micros::new(self.now) })
    }

    /// Holds the button for this time in us. Returns the set-point at the end.
    fn keep(&mut self, down: bool, micros: u64) -> Setpoint {
        (0..micros / STEP).map(|_| self.look(down)).last().expect("10 ms or more")
    }

    fn turning() -> Self {
        let mut bench = Self::new();
        assert_eq!(bench.keep(true, 100_000), TURN);
        bench
    }
}

#[test]
fn motors_turn_while_the_button_is_held_then_halt_and_coast_a_second_later() {
    let mut bench = Bench::new();
    assert_eq!(bench.keep(true, DEBOUNCE_MICROS), Setpoint::Disabled);
    assert_eq!(bench.look(true), TURN);
    assert_eq!(bench.keep(true, 10_000_000), TURN);
    assert_eq!(bench.look(false), HALT);
    assert_eq!(bench.keep(false, HOLD_MICROS - STEP), HALT);
    assert_eq!(bench.look(false), Setpoint::Disabled);
}

#[test]
fn the_button_may_be_pressed_again_while_motors_are_held_at_standstill() {
    let mut bench = Bench::turning();
    assert_eq!(bench.keep(false, 500_000), HALT);
    assert_eq!(bench.keep(true, 500_000), TURN);
    assert_eq!(bench.keep(false, HOLD_MICROS), HALT);
}

#[test]
fn a_contact_that_bounces_is_not_pressed() {
    let mut bench = Bench::new();
    for _ in 0..50 {
        assert_eq!(bench.keep(true, DEBOUNCE_MICROS), Setpoint::Disabled);
        assert_eq!(bench.look(false), Setpoint::Disabled);
    }
}

#[test]
fn a_button_that_is_closed_since_a_reset_has_no_effect_until_it_is_pressed_again() {
    let mut bench = Bench { button: Button::default(), ..Bench::new() };
    assert_eq!(bench.keep(true, 5_000_000), Setpoint::Disabled);
    assert_eq!(bench.look(false), Setpoint::Disabled);
    assert_eq!(bench.keep(true, 100_000), TURN);
}

#[test]
fn a_button_that_is_pressed_without_a_good_battery_or_a_permission_has_no_effect_until_it_is_pressed_again() {
    let battery: fn(&mut Bench, bool) = |bench, good| bench.battery_good = good;
    let permission: fn(&mut Bench, bool) = |bench, permitted| bench.permitted = permitted;
    for (what, allow) in [("battery", battery), ("permission", permission)] {
        let mut bench = Bench::new();
        allow(&mut bench, false);
        assert_eq!(bench.keep(true, 1_000_000), Setpoint::Disabled, "{what}");
        allow(&mut bench, true);
        assert_eq!(bench.keep(true, 1_000_000), Setpoint::Disabled, "{what}: held before it was good");
        bench.look(false);
        assert_eq!(bench.keep(true, 100_000), TURN, "{what}: pressed again");
    }
}

#[test]
fn turning_motors_continue_when_the_battery_becomes_low() {
    let mut bench = Bench::turning();
    bench.battery_good = false;
    assert_eq!(bench.keep(true, 1_000_000), TURN);
}

#[test]
fn the_first_packet_of_a_host_disables_the_motors_and_the_button() {
    let mut bench = Bench::turning();
    bench.permitted = false;
    assert_eq!(bench.look(true), Setpoint::Disabled);
    assert_eq!(bench.keep(false, 100_000), Setpoint::Disabled);
    assert_eq!(bench.keep(true, 1_000_000), Setpoint::Disabled);

    let mut bench = Bench::turning();
    assert_eq!(bench.keep(false, 100_000), HALT);
    bench.permitted = false;
    assert_eq!(bench.look(false), Setpoint::Disabled);
}
