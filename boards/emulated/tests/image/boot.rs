//! The time from power-on until all bridges are driven safely, and the times of the control ticks.

use std::path::Path;
use std::time::Duration;

use crate::common::{am60, board, booted, by_board, expect_speed, four_loads, log, ms, publish, setup};
use crate::recording::Configuration;
use emulated::Bench;
use emulated::elf::{self, Variant};
use emulated::host_link::HostLink;
use motor_hub::braking::Winding;
use motor_hub::extension::settings::Group;
use motor_hub::motor::Settings;

#[test]
pub(crate) fn bridges_stay_open_from_power_on_without_a_command() {
    let mut bench = booted(four_loads());
    bench.run(ms(1000));
    assert_eq!(bench.transitions(), []);
    for motor in 0..4 {
        assert!(bench.lines(motor).open());
        let look = bench.look(motor);
        assert_eq!((look.counts, look.current), (0, 0.0));
    }
    assert!(log(&mut bench).contains("tick 19 missed 0"));
    bench.assert_sound();
}

#[test]
pub(crate) fn pins_drive_their_idle_levels_within_milliseconds_of_reset() {
    let mut bench = Bench::new(setup(vec![am60()]));
    let safe = first_safe_output(&mut bench);
    // The bench has its full clock from the beginning. A chip has the clock of its oscillator until nearly the end, because it
    // clears its memory before it starts the PLL.
    let oscillator_khz = by_board(16_000, 64_000);
    let on_a_chip = bench.instructions() as f64 / f64::from(oscillator_khz);
    println!(
        "first safe output {:.3} ms after reset; at a cycle for each instruction {on_a_chip:.1} ms on a chip",
        safe.as_secs_f64() * 1e3
    );
    assert!(safe < ms(1), "{safe:?}");
    assert!(on_a_chip < by_board(4.0, 2.5), "{on_a_chip} ms");
}

/// Returns the time after power-on at which port D and the PWM pins first drive their idle levels. Until then pull-down
/// resistors hold the lines low.
pub(crate) fn first_safe_output(bench: &mut Bench) -> Duration {
    let safe = bench.run_while(Duration::from_micros(10), ms(20), |bench| {
        // RCC_AHB1ENR, RCC_AHB4ENR: registers of a port without a clock cannot be read.
        let (clocks, port_d) = by_board((0x4002_3830, 0x4002_0C00), (0x5802_44E0, 0x5802_0C00));
        if bench.register(clocks) >> 3 & 1 == 0 {
            return false;
        }
        // MODER and ODR of GPIOD: pins 0 to 7 are outputs (01), and low.
        let [modes, outputs] = [port_d, port_d + 0x14].map(|at| bench.register(at));
        modes & 0xFFFF == 0x5555 && outputs & 0xFF == 0 && bench.pwm_grid().is_some()
    });
    assert!(safe);
    assert_eq!(bench.transitions(), []);
    bench.now()
}

/// Returns a hub whose four motors, with different loads, turn at 1000 counts/s.
pub(crate) fn at_speed(image: &Path, configuration: Configuration) -> Bench {
    let mut bench = Bench::with_image(setup(four_loads()), image);
    let mut host = HostLink::default();
    bench.run(ms(300));
    for (motor, mounting) in four_loads().iter().enumerate() {
        let settings = Settings::new(Winding::NEVEREST_60);
        let settings = configuration.apply(settings, mounting);
        let groups =
            [settings.dynamics.map(|_| Group::Motion), settings.coefficients.map(|_| Group::VelocityLoop)];
        for group in groups.into_iter().flatten() {
            host.set(&mut bench, motor as u8, group, settings);
        }
        host.velocity(&mut bench, motor as u8, 1000);
    }
    bench.run(ms(1500));
    expect_speed(&mut bench, 0..4, 100.0);
    host.keep_alive(&mut bench);
    bench
}

/// Returns the share of the core's instructions in percent that the hub with motors at 1000 counts/s needs.
fn share(image: &Path, configuration: Configuration) -> f64 {
    let mut bench = at_speed(image, configuration);
    let before = bench.instructions();
    bench.run(ms(2000));
    let per_second = (bench.instructions() - before) as f64 / 2.0;
    bench.assert_sound();
    100.0 * per_second / board().core_hz() as f64
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn the_whole_hub_needs_little_of_the_core() {
    let board = board();
    // The control period in ms, and the largest share of the core's instructions in percent.
    for (period_ms, variant, most) in
        [(50, Variant::Usual, by_board(2.0, 1.0)), (1, Variant::Period(1), 20.0)]
    {
        let mut table = format!(
            "Share of the {} million instructions per second of {board}, with a control period of {period_ms} ms: four \
             motors, all tasks and the log.\n\n\
             | motor | share |\n|---|---|\n",
            board.core_hz() / 1_000_000
        );
        let image = elf::build(board.name(), variant);
        let shares = Configuration::ALL.map(|configuration| (configuration, share(&image, configuration)));
        for (configuration, share) in shares {
            table += &format!("| {} | {share:.2} % |\n", configuration.name());
        }
        publish(&format!("hub-{period_ms}-ms"), &table);
        for (configuration, share) in shares {
            assert!(share <= most, "every {period_ms} ms, {configuration:?}: {share} %");
        }
    }
}
