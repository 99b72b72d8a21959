//! The image's use of the chip: clocks, flash, pins, supply, and a log without a reader.

use std::time::Duration;

use crate::common::{
    am60, bits, booted, by_board, counts_in, expect_open_within, four_loads, log, ms, on, set_speeds, setup,
    too_low, turning, with_host,
};
use emulated::{Bench, Board, ChipFaults, Lines, Setup};
use motor_hub::protocol::requests::{AdcChannel, BATTERY};

// RM0090 and RM0433, memory maps and register descriptions.
const RCC_CR: u64 = 0x4002_3800;
const RCC_PLLCFGR: u64 = 0x4002_3804;
const FLASH_ACR: u64 = 0x4002_3C00;
const TIM1_BDTR: u64 = 0x4001_0044;

#[test]
fn nothing_outside_the_chip_makes_its_clock() {
    // The bench has no oscillator on OSC_IN. A chip that used OSC_IN would have no clock.
    let mut bench = on(Board::NucleoF429zi, || booted(four_loads()));
    assert!(log(&mut bench).contains("168000000 Hz"), "{}", log(&mut bench));
    assert_eq!(bits(bench.register(RCC_CR), 16, 16), 0, "HSEON");
    let pll = bench.register(RCC_PLLCFGR);
    assert_eq!(bits(pll, 22, 22), 0, "PLLSRC is the HSI");
    let [m, n, p, q] = [(5, 0), (14, 6), (17, 16), (27, 24)].map(|(high, low)| bits(pll, high, low));
    assert_eq!(16 / m * n / (2 * p + 2), 168, "MHz of the core");
    // RM0090 6.3.2: 0 and 1 are forbidden, and the clock behind this divider is at most 48 MHz.
    assert!(q >= 2 && 16 / m * n / q <= 48, "PLLQ is {q}");
    bench.assert_sound();
}

#[test]
fn flash_is_read_ahead_and_cached_with_five_wait_states() {
    // PRFTEN also avoids erratum 2.2.3 (WFE at an address that ends in 4).
    let mut bench = on(Board::NucleoF429zi, || booted(vec![am60()]));
    let control = bench.register(FLASH_ACR);
    assert_eq!(bits(control, 3, 0), 5, "wait states at 168 MHz and 2.7 V (RM0090 table 12)");
    for (bit, name) in [(8, "prefetch"), (9, "instruction cache"), (10, "data cache")] {
        assert_eq!(bits(control, bit, bit), 1, "{name}");
    }
}

/// Registers that protect the chip and its motors from what is outside. Nothing else in a run shows them.
#[test]
pub(crate) fn halted_cores_noisy_encoders_and_open_lines_find_their_registers_set() {
    let mut bench = booted(vec![am60()]);
    let (freeze, ports) = by_board((0xE004_200C, 0x4002_0000), (0x5C00_104C, 0x5802_0000));
    let pulls = |port: u64| ports + 0x400 * port + 0x0C;
    let mut fields = vec![
        ("DBG_TIM1_STOP: a halted core stops the PWM", freeze, 0..=0, 1),
        ("OSSI: the pins of a halted timer are driven low", TIM1_BDTR, 10..=10, 1),
        ("PD9, RX: an undriven line of the host is pulled up", pulls(3), 18..=19, 0b01),
        ("PC13: a button that is not connected reads as released", pulls(2), 26..=27, 0b10),
    ];
    for timer in [0x4000_0000, 0x4000_0400, 0x4000_0800, 0x4001_0400] {
        // CKD divides the timer's clock by 4. IC1F and IC2F divide it by 32 more, and need eight equal samples.
        fields.push(("CKD of an encoder", timer, 8..=9, 2));
        fields.extend([4..=7, 12..=15].map(|filter| ("filter of an encoder", timer + 0x18, filter, 15)));
    }
    // With a pull-up of the chip, current of an encoder's 5 V would flow into the chip.
    // PA15, PB3, PB4, PB5, PC6, PC7, PD12, PD13.
    for (port, pin) in [(0, 15), (1, 3), (1, 4), (1, 5), (2, 6), (2, 7), (3, 12), (3, 13)] {
        fields.push(("no pull on an encoder's pin", pulls(port), 2 * pin..=2 * pin + 1, 0b00));
    }
    for (what, at, field, value) in fields {
        let found = bits(bench.register(at), *field.end(), *field.start());
        assert_eq!(found, value, "{what}: bits {field:?} of {at:#x}");
    }
}

#[test]
fn a_supply_that_falls_opens_all_bridges_before_the_flash_is_too_slow() {
    let mut bench = turning(four_loads());
    let at = bench.now();
    bench.set_rail(too_low());
    bench.press(false);
    bench.run(ms(5));
    expect_open_within(&mut bench, at, Duration::from_micros(10));
    assert!(log(&mut bench).contains("supply fell"), "{}", log(&mut bench));
    // The supply is back before the watchdog resets the chip.
    bench.set_rail(3_300);
    bench.run(ms(1000));
    assert_eq!(bench.resets().len(), 1);
    assert!(log(&mut bench).contains("tick 19 missed 0"), "{}", log(&mut bench));
    bench.assert_sound();
}

#[test]
fn a_supply_that_is_low_from_the_beginning_starts_no_hub() {
    let mut bench = Bench::new(setup(vec![am60()]));
    bench.set_rail(too_low());
    bench.run(ms(300));
    assert!(log(&mut bench).contains("supply fell"), "{}", log(&mut bench));
    assert!(!log(&mut bench).contains("tick"), "{}", log(&mut bench));
    assert_eq!(bench.transitions(), []);
    // Once the supply is back, a reset by the watchdog starts the hub.
    bench.set_rail(3_300);
    bench.run(ms(1500));
    assert!(log(&mut bench).contains("tick 19 missed 0"), "{}", log(&mut bench));
    bench.assert_sound();
}

/// The converter's watchdog reports a low battery within two conversions. The hub then samples twice, a millisecond apart,
/// instead of every 10 ms.
#[test]
fn a_battery_that_breaks_down_opens_the_bridges_within_4_ms() {
    let (mut bench, mut host) = with_host(vec![am60(); 4]);
    for phase in 0..4 {
        set_speeds(&mut bench, &mut host);
        // After this time the hub no longer limits the current of the motors.
        bench.run(ms(1500 + 3 * phase));
        let at = bench.now();
        bench.set_battery(4.5);
        bench.run(ms(20));
        expect_open_within(&mut bench, at, ms(4));
        bench.set_battery(12.0);
        bench.run(ms(200));
    }
    bench.assert_sound();
}

#[test]
fn a_bus_that_rises_ends_what_a_braking_motor_returns_before_the_next_millisecond() {
    let (mut bench, mut host) = with_host(vec![am60()]);
    bench.set_torque(0, 0.8);
    host.velocity(&mut bench, 0, 1_000);
    bench.run(ms(1_000));
    for round in 0..6 {
        host.keep_alive(&mut bench);
        // Each round begins at another phase between two samples of the hub.
        bench.run(ms(80) + Duration::from_micros(170) * round);
        let from = bench.now();
        bench.set_battery(15.0);
        assert!(bench.run_while(Duration::from_micros(10), ms(5), |bench| bench.battery().0 > 14.5));
        let rose = bench.now();
        bench.run(ms(3));
        // A burn pulse shorts the motor, or drives it beyond its back EMF.
        let burns = |lines: Lines| lines.shorted() || lines.ina || lines.inb;
        let burnt = bench.transitions().into_iter().find(|t| t.at > from && burns(t.lines));
        let burnt = burnt.map(|transition| transition.at).expect("a burn pulse");
        let after = burnt.saturating_sub(rose);
        println!("round {round}: burn pulse after {after:?}");
        assert!(after < Duration::from_micros(200), "round {round}: {after:?}");
        bench.set_battery(12.0);
        bench.run(ms(300));
    }
    bench.assert_sound();
}

#[test]
fn a_log_without_a_reader_stops_nothing_and_is_whole_when_a_reader_comes() {
    let mut bench = Bench::new(setup(four_loads()));
    bench.set_log_abandoned(true);
    bench.run(ms(300));
    bench.press(true);
    bench.run(ms(1500));
    // Four motors keep their speed until the log's buffer is full and longer, with new duties in every second.
    for second in 0..15 {
        // The load changes, so that the regulator changes duties. A larger load that alternates teaches unknown motors a wrong
        // gain.
        let load = if second % 2 == 0 { 0.05 } else { -0.05 };
        (0..4).for_each(|motor| bench.set_torque(motor, load));
        let (from, changes) = (bench.now(), bench.transitions().len());
        // After this time each motor has its speed again.
        bench.run(ms(300));
        let turned = counts_in(&mut bench, ms(700));
        assert_eq!(bench.resets(), [], "after {from:?}");
        let changes = bench.transitions().len() - changes;
        assert!(changes > 4, "{changes} changes of four PWMs in a second after {from:?}");
        for (motor, counts) in turned.into_iter().enumerate() {
            assert!(
                (counts - 700).abs() < 35,
                "motor {motor} turned {counts} counts from 0.3 s to 1 s after {from:?}"
            );
        }
    }
    bench.set_log_abandoned(false);
    let lines = bench.log().len();
    bench.run(ms(2000));
    assert!(bench.log().len() > lines + 8);
    assert!(!log(&mut bench).contains("malformed"), "{}", log(&mut bench));
    bench.assert_sound();
}

/// The HAL waits without a time-out for the over-drive (F429) or the voltage scaling (H743).
#[test]
pub(crate) fn clocks_that_never_start_leave_the_red_lamp_on_and_the_watchdog_tries_again() {
    clocks_never_start(setup(vec![am60()]));
}

/// Expects a red lamp and resets while the regulator is not ready, and a hub once it is.
pub(crate) fn clocks_never_start(setup: Setup) {
    let mut bench = Bench::new(setup);
    bench.set_chip_faults(ChipFaults { power_dead: true, ..ChipFaults::default() });
    // A core that waits for its clocks is slow to emulate, because each read of a register leaves the emulated core.
    let is_reset = bench.run_while(ms(50), ms(900), |bench| !bench.resets().is_empty());
    assert!(is_reset, "the watchdog has not reset the chip");
    // A reset switches the lamp off, so a red lamp shows that the chip has started again.
    bench.run(ms(50));
    assert!(log(&mut bench).is_empty(), "no clock, and yet the hub runs");
    // MODER and ODR of GPIOB: PB14 is the red lamp.
    let port_b = by_board(0x4002_0400, 0x5802_0400);
    let [modes, outputs] = [port_b, port_b + 0x14].map(|at| bench.register(at));
    assert_eq!((modes >> 28 & 3, outputs >> 14 & 1), (1, 1), "the red lamp is driven high");
    assert!(bench.lines(0).open());
    bench.set_chip_faults(ChipFaults::default());
    bench.run(ms(800));
    assert!(log(&mut bench).contains("motor-hub"), "the clocks start again, and the hub does too");
}

#[test]
fn a_reference_that_stops_in_the_middle_of_a_sequence_leaves_the_battery_known() {
    on(Board::NucleoH743zi2, || {
        let (mut bench, mut host) = with_host(vec![]);
        // Bit ADSTART of ADC3_CR (RM0433 25.6.3).
        let converts = |bench: &mut Bench| bits(bench.register(0x5802_6008), 2, 2) == 1;
        assert!(bench.run_while(Duration::from_micros(2), ms(20), converts), "a sequence runs");
        // Some words of the sequence are in the FIFO when the next conversion hangs.
        bench.run(Duration::from_micros(16));
        bench.delay_conversion(3, ms(60));
        bench.run(ms(300));
        bench.set_analog(2, 1_500);
        bench.run(ms(50));
        let battery = host.analog(&mut bench, BATTERY);
        assert!((battery - 12_000).abs() < 200, "{battery} mV");
        let input = host.analog(&mut bench, AdcChannel::new(2).expect("a channel"));
        assert!((input - 1_500).abs() < 5, "{input} mV");
        bench.assert_sound();
    });
}
