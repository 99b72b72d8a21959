//! Servos, sensors, pins, I2C buses and the hubs of a chain on the page of `motor-hub dashboard`, in a real browser.

use crate::browser::Tab;
use crate::browser::page::{
    ESCAPE, drive, off, open, pictures, press, theme, unobstructed, with_page, with_page_of,
};
use std::time::{Duration, Instant};

/// Leaves pictures of a phone and a laptop in two themes in `target/dashboard`.
fn look(tab: &mut Tab<'_>, name: &str) {
    for (width, height) in [(390, 844), (1366, 768)] {
        tab.resize(width, height);
        for wanted in ["light", "dark"] {
            theme(tab, wanted);
            tab.settle();
            assert_eq!(unobstructed(tab), Vec::<String>::new(), "{name} at {width}x{height}");
            tab.picture(&pictures().join(format!("{name}-{width}-{wanted}.png")), width < 500);
        }
    }
}

#[test]
fn servos_run_until_stop() {
    with_page(|tab| {
        tab.click("#tab-devices");
        let run = "#panel-devices [aria-label=\"Pulses of servo 2\"]";
        let is =
            |on: bool| format!("document.querySelector('{run}').getAttribute('aria-checked') === '{on}'");
        tab.wait(&format!("document.querySelector('{run}').checkVisibility()"));
        tab.click(run);
        tab.wait(&is(true));
        // Another period is sent to the servos with pulses.
        tab.fill("#servo-period", "1400");
        tab.says("#notice", "Not done: a pulse of 1500");
        tab.fill("#servo-period", "20000");
        tab.press(ESCAPE);
        tab.wait(&is(false));
        // A width that the slider has not sent yet at STOP starts no pulses.
        tab.click(run);
        tab.wait(&is(true));
        tab.ask(
            "(() => { const slider = document.querySelector('[aria-label=\"Pulse of servo 2, µs\"]'); \
             slider.value = 1700; slider.dispatchEvent(new Event('input')); \
             return new Promise((done) => setTimeout(() => { document.querySelector('#stop').click(); done(0); }, 40)); })()",
        );
        std::thread::sleep(Duration::from_millis(500));
        assert_eq!(tab.ask(&is(true)), false);
        // Neither does the order of a page that does not know of the STOP.
        tab.ask("dashboard.link.order('device', { servo: { servo: 2, period_us: 20000, width_us: 1700, on: null } })");
        std::thread::sleep(Duration::from_millis(300));
        tab.ask("dashboard.link.order('look', 'servos')");
        std::thread::sleep(Duration::from_millis(300));
        assert_eq!(tab.ask(&is(false)), true);
        // A hub that has motors only takes the place of this one.
        tab.ask("import('/js/state.js').then(({ state, emit }) => { state.has = { servos: 0, analog: 0, pins: [], buses: 0 }; emit('line'); })");
        tab.wait("document.querySelector('#tab-devices').hidden && document.querySelector('#panel-tune').checkVisibility()");
    });
}

#[test]
#[ignore = "long: cargo xtask long"]
fn analog_inputs_are_shown_and_pins_are_outputs_until_stop() {
    with_page(|tab| {
        tab.click("#tab-devices");
        open(tab, "Analog inputs");
        tab.wait("document.querySelector('#analog').textContent.includes('analog input 3')");
        open(tab, "Digital pins");
        tab.wait("document.querySelector('#pin-3')?.parentElement.textContent.includes('reads high')");
        tab.fill("#pin-3", "low");
        tab.wait("document.querySelector('#pin-3').value === 'low' && !document.querySelector('#pin-3').parentElement.textContent.includes('reads')");
        look(tab, "pins");
        tab.press(ESCAPE);
        tab.wait("document.querySelector('#pin-3').value === 'released'");
    });
}

#[test]
#[ignore = "long: cargo xtask long"]
fn devices_on_an_i2c_bus_are_found_read_and_written() {
    with_page(|tab| {
        tab.click("#tab-devices");
        open(tab, "I2C buses");
        let says = |tab: &mut Tab<'_>, text: &str| {
            tab.wait(&format!("document.querySelector('#i2c-result').textContent.includes('{text}')"));
        };
        press(tab, "Scan");
        says(tab, "devices at 0x28");
        // The register 0 of a BNO055 is its number.
        press(tab, "Read");
        says(tab, "read a0");
        tab.fill("#i2c-bytes", "0x3d 0");
        press(tab, "Write");
        says(tab, "wrote 3d 00");
        tab.fill("#i2c-address", "0x29");
        press(tab, "Read");
        says(tab, "no device acknowledges this address");
        look(tab, "i2c");
    });
}

#[test]
#[ignore = "long: cargo xtask long"]
fn a_chain_shows_what_each_hub_does_and_has_one_stop() {
    with_page_of(&["--hubs", "3"], |_, tab| {
        tab.resize(1366, 768);
        drive(tab, 1, 600);
        tab.reads("#hubs button", "Hub 2, parentmotor 1 runs");
        tab.click("#hubs button:nth-child(2)");
        tab.says("#motors .card", "Motor 3:0");
        drive(tab, 0, 600);
        for (hub, motor) in [(0, 1), (1, 0)] {
            tab.wait(&format!("dashboard.state.hubs[{hub}].running.join() === '{motor}'"));
        }
        look(tab, "chain");
        tab.press(ESCAPE);
        off(tab, Instant::now());
        tab.wait("dashboard.state.hubs.every(({ running, lost }) => !running.length && !lost)");
        assert_eq!(tab.complaints(), Vec::<String>::new());
    });
}
