//! Compares the bench's simple models of TIM1 and of the memory protection unit with the emulator's own models.

use crate::common::{booted_as, four_loads, ms, setup};
use emulated::{Bench, Encoder, Output, Setup};

/// Runs a hub whose motors speed up, are disturbed, brake and lose an encoder. The hub is then reset while motors run,
/// and starts again.
fn reference_run(full: bool) -> Bench {
    let mut bench = booted_as(Setup { full_timer: full, full_mpu: full, ..setup(four_loads()) });
    bench.press(true);
    bench.run(ms(900));
    bench.set_torque(0, 0.8);
    bench.set_torque(3, -0.8);
    bench.run(ms(400));
    bench.press(false);
    bench.set_torque(0, 0.0);
    bench.run(ms(400));
    bench.press(true);
    bench.set_encoder(2, Encoder::Unplugged);
    bench.run(ms(600));
    let at = bench.now() + ms(5);
    bench.pull_reset(at);
    bench.run(ms(700));
    bench
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn light_models_of_timer_and_memory_protection_make_the_same_run_to_the_last_edge() {
    let mut light = reference_run(false);
    let mut full = reference_run(true);
    assert_eq!(light.transitions(), full.transitions());
    assert!(light.transitions().len() > 100);
    assert_eq!(light.log(), full.log());
    assert_eq!(light.instructions(), full.instructions());
    for motor in 0..4 {
        assert_eq!(light.look(motor), full.look(motor));
    }
    light.assert_sound();
    full.assert_sound();
}

#[test]
fn the_emulators_timer_puts_the_same_pulse_on_every_pin() {
    let mut bench = booted_as(Setup { full_timer: true, ..setup(four_loads()) });
    bench.press(true);
    let mut compared = 0;
    for step in 0..1500 {
        if step == 800 {
            bench.press(false);
        }
        bench.run(ms(1));
        let Some(grid) = bench.pwm_grid() else { continue };
        for motor in 0..4 {
            let Output::Pulse(high) = bench.lines(motor).pwm else { continue };
            let nanos = |ticks: u32| u64::from(ticks) * 1_000_000_000 / grid.hz;
            let (width, period) = bench.emulated_pulse(motor).expect("a pulse on the pin");
            assert!(width.abs_diff(nanos(high)) <= 1 && period.abs_diff(nanos(grid.ticks)) <= 1);
            compared += 1;
        }
    }
    assert!(compared > 1000, "{compared} pulses compared");
}
