//! Tests of the NUCLEO-H743ZI2 alone, and tests of all boards that the quick tests run on it too.

use std::time::Duration;

use crate::common::{COUNTER, am60, bits, booted, log, ms, on, setup, time_to};
use emulated::{Bench, Board, FaultyCode, Output};

/// Tests of all boards that `cargo xtask test emulated` runs on this board too. `cargo xtask test BOARD` leaves them out.
mod repeated {
    use crate::common::on;
    use crate::{boot, chain, currents, devices, link, record, running, supply};
    use emulated::Board;

    macro_rules! on_h743 {
        ($($room:ident::$test:ident),+ $(,)?) => {
            $(
                #[test]
                fn $test() {
                    on(Board::NucleoH743zi2, $room::$test);
                }
            )+
        };
    }

    on_h743!(
        boot::bridges_stay_open_from_power_on_without_a_command,
        boot::pins_drive_their_idle_levels_within_milliseconds_of_reset,
        running::four_motors_with_different_loads_reach_their_speed_and_stand_still_again,
        running::the_log_shows_the_speeds_and_the_voltage_of_the_physics,
        chain::both_motors_turn_and_the_parent_answers_in_time_whatever_the_line_does,
        currents::a_host_gets_the_currents_that_flow_also_of_a_motor_whose_constants_are_wrong,
        currents::a_broken_sense_line_is_reported_and_not_used,
        devices::analog_inputs_rail_and_temperature_are_measured_and_never_old,
        devices::i2c_devices_are_read_and_written_at_both_speeds_on_every_bus,
        link::power_and_coast_reach_the_bridge_within_2_ms,
        link::digital_pins_are_read_and_driven,
        running::a_bridge_that_switches_itself_off_stops_its_own_motor,
        supply::halted_cores_noisy_encoders_and_open_lines_find_their_registers_set,
        supply::clocks_that_never_start_leave_the_red_lamp_on_and_the_watchdog_tries_again,
        record::a_panic_is_on_record_with_its_line,
        record::the_record_is_empty_after_power_on_whatever_the_memory_holds,
    );
}

// RM0433, memory map and register descriptions.
const RCC_CR: u64 = 0x5802_4400;
const RCC_PLLCKSELR: u64 = 0x5802_4428;
const RCC_PLL1DIVR: u64 = 0x5802_4430;
const RCC_PLL2DIVR: u64 = 0x5802_4438;
const FLASH_ACR: u64 = 0x5200_2000;

#[test]
fn nothing_outside_the_chip_makes_its_clock() {
    // The bench has no oscillator on OSC_IN. A chip that used OSC_IN would have no clock.
    let mut bench = on(Board::NucleoH743zi2, || booted(vec![am60()]));
    // The log names the clock of TIM1.
    assert!(log(&mut bench).contains("200000000 Hz"), "{}", log(&mut bench));
    let control = bench.register(RCC_CR);
    assert_eq!(bits(control, 16, 16), 0, "HSEON");
    assert_eq!(
        [24, 26, 28].map(|pll| bits(control, pll, pll)),
        [1, 1, 0],
        "PLL1 and PLL2 run, PLL3 does not"
    );
    let source = bench.register(RCC_PLLCKSELR);
    assert_eq!(bits(source, 1, 0), 0, "PLLSRC is the HSI");
    // The registers hold DIVMx, DIVNx - 1 and DIVPx - 1.
    for (prediv, at, mhz) in [(9, RCC_PLL1DIVR, 400), (17, RCC_PLL2DIVR, 32)] {
        let divider = bench.register(at);
        let made =
            64 / bits(source, prediv, prediv - 5) * (bits(divider, 8, 0) + 1) / (bits(divider, 15, 9) + 1);
        assert_eq!(made, mhz, "MHz");
    }
    bench.assert_sound();
}

#[test]
fn flash_has_its_wait_states_and_data_are_where_no_cache_is() {
    let mut bench = on(Board::NucleoH743zi2, || booted(vec![am60()]));
    let flash = bench.register(FLASH_ACR);
    assert!(bits(flash, 3, 0) >= 2, "wait states at 200 MHz and VOS1 (RM0433 table 17): {flash:#x}");
    // All statics are in the DTCM.
    let ram = Board::NucleoH743zi2.ram();
    let statics: Vec<_> = bench.symbols().iter().filter(|s| s.address >= ram.start).cloned().collect();
    assert!(statics.len() > 5 && statics.iter().all(|s| ram.contains(&s.address)), "{statics:?}");
}

/// TIM1's registers BDTR and AF1 (RM0433 38.4.20, 38.4.25).
const TIM1_BDTR: u64 = 0x4001_0044;
const TIM1_AF1: u64 = 0x4001_0060;

/// Returns a hub on a chip of this revision, which drives two motors.
fn driving(revision: u16) -> Bench {
    let mut bench = on(Board::NucleoH743zi2, || Bench::new(setup(vec![am60(); 2])));
    bench.set_revision(revision);
    bench.run(ms(300));
    bench.press(true);
    bench.run(ms(500));
    assert!((0..2).all(|motor| !bench.lines(motor).open()));
    bench
}

/// Watches both bridges for this time. Returns the time from now until all PWM lines are low and stay low. A break does
/// not change the direction lines. With PWM low the low-side switches are open, so no motor is driven.
fn time_to_low(bench: &mut Bench, watched: Duration) -> Duration {
    let at = bench.now();
    bench.press(false);
    bench.run(watched);
    let transitions = bench.transitions();
    let low = |motor| time_to(&transitions, motor, at, |lines| lines.pwm == Output::Level(false));
    low(0).max(low(1)).expect("PWM is low")
}

/// Before revision V the timer ignores the break of a lock-up (ES0392 2.2.2), and the PWM stays on until the watchdog
/// resets the chip.
#[test]
fn a_core_that_locks_up_leaves_no_pwm_on_from_revision_v_on() {
    for (revision, limit) in [(0x2003, Duration::from_micros(1_100)), (0x1003, ms(600))] {
        let mut bench = driving(revision);
        bench.lock_up(COUNTER);
        let time = time_to_low(&mut bench, ms(700));
        println!("revision {revision:#x}: PWM low after {time:?}");
        assert!(time < limit, "revision {revision:#x}: {time:?}");
        assert_eq!(bench.resets().len(), 1, "a locked core is reset by the watchdog");
    }
}

#[test]
fn a_supply_that_falls_leaves_no_pwm_on_though_a_hung_core_takes_no_interrupt() {
    let mut bench = driving(0x2003);
    bench.divert("capture", FaultyCode::LoopsMasked);
    bench.run(ms(5));
    assert!((0..2).all(|motor| !bench.lines(motor).open()), "a hung core drives on");
    bench.set_rail(2_740);
    let time = time_to_low(&mut bench, ms(1));
    println!("PWM low after {time:?}");
    assert!(time < Duration::from_micros(10), "{time:?}");
}

/// The open pin BKIN is not a break source, and no other source asserts the break input, which is active high.
#[test]
fn no_pin_breaks_the_timer() {
    let mut bench = driving(0x2003);
    let [breaks, sources] = [TIM1_BDTR, TIM1_AF1].map(|at| bench.register(at));
    assert_eq!(bits(breaks, 13, 12), 0b11, "BKP, BKE");
    assert_eq!(bits(sources, 0, 0), 0, "BKINE");
    bench.assert_sound();
}

/// Revision Y has one bit for the current of a converter, and does not halve the converter's clock of 32 MHz (ES0392).
#[test]
fn converters_have_the_current_that_their_clock_needs_on_each_revision() {
    for (revision, boost) in [(0x2003, 0b10), (0x1003, 0b01)] {
        let mut bench = on(Board::NucleoH743zi2, || Bench::new(setup(vec![am60()])));
        bench.set_revision(revision);
        bench.run(ms(20));
        for control in [0x4002_2008, 0x4002_2108, 0x5802_6008] {
            assert_eq!(
                bits(bench.register(control), 9, 8),
                boost,
                "revision {revision:#x}, CR at {control:#x}"
            );
        }
    }
}
