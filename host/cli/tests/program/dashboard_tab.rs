//! `docs/try/index.html`, the dashboard without a server, in a real browser: with its simulated hub, and with a served hub on a
//! serial port. A stand-in for the browser's serial port passes bytes to the served hub.

use crate::browser::page::{ESCAPE, drive, motor, off};
use crate::browser::{Browser, Tab, find};
use crate::common::alone;
use crate::conformance::Hub;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::time::{Duration, Instant};
use tungstenite::{Message, accept};

/// The hub's keep-alive.
const KEEP_ALIVE: Duration = Duration::from_millis(2500);

/// Runs a test with the file that `cargo xtask try` has made.
fn with_file(test: impl FnOnce(&mut Tab<'_>)) {
    let Some(program) = find() else { return };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/try/index.html").canonicalize();
    let file =
        file.unwrap_or_else(|error| panic!("docs/try/index.html: {error}; `cargo xtask try` makes it"));
    let _alone = alone();
    let mut browser = Browser::start(&program);
    let mut tab = browser.open(&format!("file://{}", file.display()), 1366, 768);
    tab.wait("window.dashboard?.state.frame?.battery_v > 11 && dashboard.state.settings.length === 4");
    test(&mut tab);
}

#[test]
fn without_a_server_a_motor_moves_within_ten_seconds_and_stops() {
    with_file(|tab| {
        drive(tab, 0, 900);
        // The page's own clock begins when the file is opened.
        let took = tab.ask("performance.now()").as_f64().unwrap() / 1e3;
        println!("a motor at its speed {took:.1} s after the file was opened");
        assert!(took < 10.0);
        tab.press(ESCAPE);
        off(tab, Instant::now());
        tab.wait(&format!("{} === 0", motor(0, "velocity")));
    });
}

#[test]
fn points_move_with_speed_and_battery_by_the_formulas_of_the_paper() {
    with_file(|tab| {
        tab.click("#tab-regimes");
        let cell = |point: u32, column: u32| {
            let selector = format!("#panel-regimes tbody tr:nth-child({point}) :nth-child({column})");
            format!("Number(document.querySelector('{selector}')?.textContent.replace('−', '-'))")
        };
        let slider = |row: u32| format!("#panel-regimes .pair > :nth-child({}) input", 2 * row);
        let emf = tab.ask("dashboard.state.settings[0].emf_mv_s_per_count").as_f64().unwrap() / 1e3;
        for (cps, volts) in [(1000.0, 12.0), (2000.0, 12.0), (1000.0, 8.0)] {
            tab.fill(&slider(2), &cps.to_string());
            tab.fill(&slider(3), &volts.to_string());
            // Scheme A: Z is at e / V. Scheme B: T is at -e / (V + e).
            // Scheme C: T is at -e / (V - e), D: at -k e / (V + e).
            let (e, u) = (emf * cps, emf * cps / volts);
            let blend = f64::min(1.0, (1.0 - u) / (2.0 * u * u));
            let k = 1.0 + 2.0 * blend * e / (volts - e);
            let expected = [
                ("A", 3, u),
                ("B", 2, -e / (volts + e)),
                ("C", 2, -e / (volts - e)),
                ("D", 2, -k * e / (volts + e)),
            ];
            for (scheme, point, at) in expected {
                tab.fill("#regimes-scheme", scheme);
                for column in [3, 4] {
                    tab.wait(&format!("Math.abs({} - {at}) < 1e-3", cell(point, column)));
                }
            }
        }
    });
}

/// `cargo test --test program report_of_first_paint -- --ignored --nocapture`
#[test]
#[ignore = "a report, not a test: times are this machine's"]
fn report_of_first_paint_and_sizes() {
    with_file(|tab| {
        tab.wait("performance.getEntriesByName('first-contentful-paint').length");
        let report = tab.ask(
            "({ first_paint_ms: Math.round(performance.getEntriesByName('first-contentful-paint')[0].startTime), \
                file_kb: Math.round(document.documentElement.outerHTML.length / 1000), \
                wasm_packed_kb: Math.round(0.75 * document.querySelector('#relay').textContent.length / 1000) })",
        );
        println!("{report:#}");
    });
}

#[test]
fn simulated_time_passes_as_on_the_clock_from_the_start() {
    with_file(|tab| {
        let mut times = || {
            let times = tab.ask("[dashboard.state.frame.tick_ms, performance.now()]");
            [0, 1].map(|index| times.get(index).and_then(serde_json::Value::as_f64).unwrap())
        };
        let [tick, now] = times();
        std::thread::sleep(Duration::from_millis(1500));
        let [later_tick, later] = times();
        let share = (later_tick - tick) / (later - now);
        assert!((share - 1.0).abs() < 0.17, "simulated time runs {share:.2} times as fast as the clock");
    });
}

#[test]
fn a_serial_port_that_cannot_be_opened_is_reported_and_the_simulation_goes_on() {
    with_file(|tab| {
        tab.ask("Object.defineProperty(navigator, 'serial', { value: { requestPort: async () => ({ open: async () => { throw new Error('Failed to open serial port.'); } }) } })");
        tab.click("#serial");
        tab.wait("document.querySelector('#notice').textContent.includes('cannot be opened: Failed to open serial port.')");
        assert_eq!(tab.text("#serial"), "Connect a hub");
        drive(tab, 0, 900);
        assert_eq!(tab.ask("dashboard.state.simulated"), true);
    });
}

/// Passes bytes between the first WebSocket that comes and a served hub.
fn bridge(place: &str) -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let mut hub = TcpStream::connect(place).unwrap();
    hub.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
    std::thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        let mut page = accept(stream).unwrap();
        page.get_ref().set_read_timeout(Some(Duration::from_millis(1))).unwrap();
        let mut bytes = [0; 512];
        loop {
            match page.read() {
                Ok(Message::Binary(sent)) => hub.write_all(&sent).unwrap(),
                Err(tungstenite::Error::Io(error))
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Ok(Message::Close(_)) | Err(_) => return,
                Ok(_) => {}
            }
            if let Ok(count @ 1..) = hub.read(&mut bytes) {
                let _ = page.send(Message::binary(bytes[..count].to_vec()));
            }
        }
    });
    port
}

/// Connects the page to a served hub, and drives a motor.
fn connect(tab: &mut Tab<'_>, hub: &Hub) {
    let port = bridge(&hub.place);
    tab.ask(&format!(
        "Object.defineProperty(navigator, 'serial', {{ value: {{ requestPort: async () => ({{ open: async function ({{ baudRate }}) {{ \
            const socket = window.socket = new WebSocket('ws://127.0.0.1:{port}'); socket.binaryType = 'arraybuffer'; \
            await new Promise((open) => {{ socket.onopen = open; }}); window.baud = baudRate; \
            this.readable = new ReadableStream({{ start(to) {{ socket.onmessage = (m) => to.enqueue(new Uint8Array(m.data)); socket.onclose = () => to.close(); }} }}); \
            this.writable = new WritableStream({{ write(bytes) {{ socket.send(bytes); }} }}); }} }}) }} }})"
    ));
    tab.click("#serial");
    tab.wait("!dashboard.state.simulated && dashboard.state.connected && dashboard.state.frame.number > 20");
    assert_eq!(tab.ask("window.baud"), 460_800);
    tab.wait("dashboard.state.frame.battery_v > 11");
    drive(tab, 0, 700);
}

#[test]
fn a_hub_on_a_serial_port_is_stopped_and_its_keep_alive_disables_its_motors_when_it_is_unplugged() {
    let hub = Hub::served();
    with_file(|tab| {
        connect(tab, &hub);
        tab.press(ESCAPE);
        println!("stopped over the serial port after {:.0} ms", off(tab, Instant::now()).as_secs_f64() * 1e3);
        drive(tab, 0, 700);
        tab.ask("window.socket.close()");
        tab.says("#line", "Hub not connected");
        tab.reads("#serial", "Connect a hub");
        std::thread::sleep(KEEP_ALIVE + Duration::from_millis(500));
    });
    assert!(!hub.tcp().enabled());
}

#[test]
fn a_file_in_a_hidden_tab_sends_nothing_and_the_hub_disables_its_motors() {
    with_file(|tab| {
        let hub = Hub::served();
        connect(tab, &hub);
        tab.hide();
        // A frame that was read before may arrive meanwhile.
        std::thread::sleep(Duration::from_millis(200));
        let number = tab.ask("dashboard.state.frame.number");
        std::thread::sleep(KEEP_ALIVE + Duration::from_millis(500));
        assert_eq!(tab.ask("dashboard.state.frame.number"), number, "frames of a hidden page");
        // The page is visible again and reads the hub: the motor is off, and the page must take control again.
        tab.call("Page.bringToFront", serde_json::json!({}));
        tab.wait(&format!("{} === false", motor(0, "enabled")));
        tab.wait("document.querySelector('#take').checkVisibility()");
    });
}

#[test]
fn a_file_that_hangs_loses_its_motors_by_the_keep_alive() {
    let hub = Hub::served();
    with_file(|tab| {
        connect(tab, &hub);
        tab.hang();
        std::thread::sleep(KEEP_ALIVE + Duration::from_millis(500));
    });
    // The browser is gone, and with it the other host on the hub's line.
    assert!(!hub.tcp().enabled());
}
