//! `motor-hub dashboard` in a real browser: control, motors, plots and stops.

use crate::browser::Tab;
use crate::browser::page::{
    ENTER, ESCAPE, PANELS, SPACE, card, drive, focus, live, motor, off, open_all, pictures, theme,
    unobstructed, with_page, with_page_of, with_two_pages,
};
use crate::page::{Dashboard, Page};
use serde_json::json;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

#[test]
fn a_tab_that_is_killed_loses_its_motors() {
    // On a busy computer the page falls silent before its socket is closed.
    let kill = |tab: Tab<'_>| tab.kill();
    let says = ["the page in control was closed", "the page in control showed no new values for 1 s"];
    with_two_pages("killed", kill, &says, Duration::from_secs(2));
}

/// A way to stop the motors.
type Way<'a> = &'a dyn Fn(&mut Tab<'_>);

#[test]
fn a_motor_is_driven_to_a_speed_and_stopped_by_a_click_by_escape_and_by_space() {
    const FIELD: &str = "#motors input[type=number]";
    let in_list = |tab: &mut Tab<'_>, list: &str| {
        tab.click(list);
        std::thread::sleep(Duration::from_millis(300));
        tab.press(ESCAPE);
    };
    let ways: [(&str, Way<'_>); 9] = [
        ("a click", &|tab| tab.click("#stop")),
        ("Escape", &|tab| tab.press(ESCAPE)),
        ("Space", &|tab| tab.press(SPACE)),
        // In a field Space enters a character, but Escape stops.
        ("Escape in a field", &|tab| {
            focus(tab, FIELD);
            tab.press(ESCAPE);
        }),
        // Space stops also on a button, which it would press otherwise.
        ("Space on a button", &|tab| {
            focus(tab, "#pause");
            tab.press(SPACE);
        }),
        ("Space after a speed was entered", &|tab| {
            tab.click(FIELD);
            tab.ask("document.activeElement.select()");
            tab.call("Input.insertText", json!({ "text": "700" }));
            tab.press(ENTER);
            tab.wait(&format!("{} === 700", motor(0, "target")));
            tab.press(SPACE);
        }),
        ("Escape in the list of units", &|tab| in_list(tab, "#unit")),
        ("Escape in the list of modes", &|tab| in_list(tab, &card(0, "[aria-label^=Mode]"))),
        ("Escape in the list of windows", &|tab| in_list(tab, "#window")),
    ];
    with_page(|tab| {
        for (how, stop) in &ways {
            drive(tab, 0, 900);
            let since = Instant::now();
            stop(tab);
            println!("stopped by {how} after {:.0} ms", off(tab, since).as_secs_f64() * 1e3);
            let paused = tab.ask("document.querySelector('#pause').getAttribute('aria-pressed')");
            assert_eq!(paused, "false", "{how}");
            assert_eq!(tab.text("#notice"), "All motors are disabled: stopped.", "{how}");
            tab.wait(&format!("{} === 0", motor(0, "velocity")));
        }
        // Space in a field stops nothing.
        drive(tab, 1, 500);
        tab.click("#tab-group");
        tab.click("#panel-group .parts > details:nth-child(2) > summary");
        focus(tab, "#group-speed");
        tab.press(SPACE);
        std::thread::sleep(Duration::from_millis(300));
        assert_eq!(tab.ask(&motor(1, "enabled")), true);
    });
}

#[test]
#[ignore = "long: cargo xtask long"]
fn everything_is_in_sight_and_nothing_lies_over_anything_else() {
    with_page(|tab| {
        drive(tab, 0, 800);
        open_all(tab);
        for (width, height) in
            [(1280, 1000), (768, 1024), (390, 844), (320, 640), (1366, 768), (1920, 1080), (3840, 2160)]
        {
            tab.resize(width, height);
            tab.settle();
            for panel in PANELS {
                tab.click(&format!("#tab-{panel}"));
                assert_eq!(unobstructed(tab), Vec::<String>::new(), "{width} wide, {panel}");
            }
            for share in [0.0, 0.5, 1.0] {
                tab.ask(&format!("scrollTo(0, {share} * document.documentElement.scrollHeight)"));
                let seen = "(() => { const b = document.querySelector('#stop').getBoundingClientRect(); \
                            const e = document.elementFromPoint(b.x + b.width / 2, b.y + b.height / 2); \
                            return b.top >= 0 && b.left >= 0 && b.bottom <= innerHeight && b.right <= innerWidth && e.id === 'stop' })()";
                assert_eq!(tab.ask(seen), true, "STOP at {share} of the page, {width} wide");
            }
            assert_eq!(tab.ask(&motor(0, "enabled")), true, "nothing of that was a click on STOP");
            tab.ask("scrollTo(0, 0)");
            for name in ["dark", "light"] {
                theme(tab, name);
                tab.settle();
                tab.picture(&pictures().join(format!("{width}x{height}-{name}.png")), width < 1000);
            }
        }
    });
}

#[test]
#[ignore = "long: cargo xtask long"]
fn the_regimes_of_a_winch_are_shown() {
    with_page(|tab| {
        drive(tab, 1, 600);
        drive(tab, 2, -400);
        drive(tab, 0, 700);
        tab.says("#motors .pill", "Driving");
        tab.click("#tab-world");
        let pull = |tab: &mut Tab<'_>, nm: &str| {
            tab.fill("#panel-world input[type=range]", nm);
            std::thread::sleep(Duration::from_millis(800));
        };
        let turn = |tab: &mut Tab<'_>, cps: &str| {
            tab.fill("#motors .card:nth-child(1) input[type=number]", cps);
            std::thread::sleep(Duration::from_millis(800));
        };
        pull(tab, "0.3");
        tab.says("#motors .pill", "Braking");
        turn(tab, "1600");
        tab.says("#motors .pill", "Braking");
        pull(tab, "0.6");
        turn(tab, "1000");
        pull(tab, "-0.3");
        tab.says("#motors .pill", "Driving");
        turn(tab, "1800");
        pull(tab, "0.4");
        turn(tab, "1200");
        tab.says("#motors .pill", "Braking");
        // Without the panels below the plots.
        tab.ask("scrollTo(0, 0)");
        tab.resize(1280, 900);
        std::thread::sleep(Duration::from_millis(200));
        tab.picture(&pictures().join("light.png"), false);
        tab.click("#theme");
        tab.click("#theme");
        assert_eq!(tab.ask("document.documentElement.dataset.theme"), "dark");
        std::thread::sleep(Duration::from_millis(200));
        tab.picture(&pictures().join("dark.png"), false);
    });
}

#[test]
#[ignore = "long: cargo xtask long"]
fn the_reason_why_a_motor_stands_is_shown() {
    with_page(|tab| {
        let why = "document.querySelector('#motors .card:nth-child(2) .why').textContent";
        assert_eq!(tab.ask(why), "Disabled.");
        tab.press(("1", 49));
        drive(tab, 1, 600);
        tab.click("#tab-world");
        tab.fill("#world-encoder", "unplugged");
        tab.wait(&format!("{why}.startsWith('No counts although driven')"));
        tab.fill("#world-encoder", "sound");
        tab.press(ESCAPE);
        tab.wait(&format!("{why} === 'Disabled.'"));
        drive(tab, 1, 600);
        // At 5.5 V the battery is too low to draw current from.
        tab.fill("#panel-world .stack:nth-child(2) input[type=range]", "5.5");
        tab.wait(&format!("{why}.includes('battery')"));
    });
}

#[test]
#[ignore = "long: cargo xtask long"]
fn a_step_is_plotted_over_the_step_before_and_a_change_is_undone() {
    with_page(|tab| {
        tab.click("#tab-tune");
        let step = |tab: &mut Tab<'_>| {
            tab.click("#panel-tune button.primary");
            tab.reads("#panel-tune [role=status]", "Done.");
        };
        step(tab);
        assert_eq!(tab.ask("document.querySelectorAll('#panel-tune tbody tr').length"), 1);
        let regulator = "document.querySelector('#panel-tune b').textContent";
        assert_eq!(tab.ask(regulator), "the motor model");
        let undo = "#panel-tune .row button:nth-child(3)";
        tab.click("#panel-tune .row button:nth-child(2)");
        tab.wait(&format!("{regulator} === 'PID'"));
        step(tab);
        assert_eq!(tab.ask("document.querySelectorAll('#panel-tune tbody tr').length"), 2);
        tab.picture(&pictures().join("tune.png"), true);
        tab.click(undo);
        tab.wait(&format!("{regulator} === 'the motor model'"));
        assert_eq!(tab.ask(&format!("document.querySelector('{undo}').disabled")), true);
    });
}

#[test]
#[ignore = "long: cargo xtask long"]
fn the_result_of_an_identification_predicts_the_measured_speed() {
    with_page(|tab| {
        tab.click("#tab-learn");
        tab.click("#panel-learn button.primary");
        tab.reads("#panel-learn [role=status]", "Motor 0 is identified.");
        // Misfit of the two lines of the plot, as the page draws them.
        let off = tab.ask("dashboard.learned().misfit").as_f64().unwrap();
        println!("predicted is off by {:.1} % of what was measured", 100.0 * off);
        assert!(off < 0.1, "predicted is off by {off} of what was measured");
        tab.picture(&pictures().join("learn.png"), true);
        let about = "document.querySelector('#learn-about').textContent";
        let text = tab.ask(about).as_str().unwrap().to_owned();
        println!("{text}");
        let name = tab.ask("dashboard.state.settings[0].name").as_str().unwrap().to_owned();
        assert!(text.contains(&format!("times the inertia of a bare {name}")), "{text}");
        tab.resize(1366, 768);
        in_sight(tab, "an identified motor");
        tab.click("#panel-learn .row button:nth-child(2)");
        tab.wait("dashboard.state.settings[0].undoable === 1");
        // The proposed acceleration is in force too.
        let limit =
            tab.ask(&format!("Number({about}.match(/proposed ([0-9 ]+) counts/)[1].replaceAll(' ', ''))"));
        assert_eq!(tab.ask("dashboard.state.settings[0].acceleration"), limit);
        assert_eq!(tab.ask("dashboard.state.settings[0].dynamics.gain > 0"), true);
        assert_eq!(tab.ask(&motor(0, "enabled")), false);
    });
}

#[test]
#[ignore = "long: cargo xtask long"]
fn every_control_is_reached_by_keys() {
    with_page(|tab| {
        let chosen = "document.querySelector('.card.chosen').getAttribute('aria-label')";
        tab.press(("2", 50));
        assert_eq!(tab.ask(chosen), "Motor 2");
        // From the top, Tab reaches every visible control.
        tab.ask("document.activeElement.blur()");
        let all = tab.ask("document.querySelectorAll('button, select, input').length").as_u64().unwrap();
        let mut reached = std::collections::BTreeSet::new();
        for _ in 0..all + 5 {
            tab.press(("Tab", 9));
            let at =
                "[...document.querySelectorAll('button, select, input')].indexOf(document.activeElement)";
            reached.extend(tab.ask(at).as_i64().filter(|at| *at >= 0));
        }
        let expected = tab.ask(
            "[...document.querySelectorAll('button, select, input')].filter((e) => !e.disabled && e.tabIndex >= 0 && e.checkVisibility()).length",
        );
        assert_eq!(Some(reached.len() as u64), expected.as_u64());
        focus(tab, &card(3, ".run"));
        tab.press(ENTER);
        tab.wait(&motor(3, "enabled"));
    });
}

/// `cargo test --test program report_of_drawing -- --ignored --nocapture --test-threads 1`
#[test]
#[ignore = "a report, not a test: times are this machine's"]
fn report_of_drawing_full_plots() {
    with_page(|tab| {
        drive(tab, 0, 900);
        // Fill the history with a minute of frames.
        tab.ask(
            "(() => { const { state } = dashboard; const frame = state.frame; \
                for (let i = 3000; i > 0; i -= 1) { \
                    const motors = frame.motors.map((motor) => ({ ...motor, velocity: 900 * Math.sin(i / 90), control: Math.sin(i / 60), current_a: Math.cos(i / 40) })); \
                    state.history.push({ ...frame, at_s: frame.at_s - i / 50, motors }); \
                } })()",
        );
        std::thread::sleep(Duration::from_millis(500));
        let report = tab.ask(
            "(async () => { const { drawn } = dashboard; drawn.took.length = 0; const at = []; \
                await new Promise((done) => { const step = (now) => { at.push(now); at.length < 600 ? requestAnimationFrame(step) : done() }; requestAnimationFrame(step) }); \
                const of = (all) => { const sorted = [...all].sort((a, b) => a - b); return { n: sorted.length, median: sorted[sorted.length >> 1], p99: sorted[Math.floor(0.99 * sorted.length)] } }; \
                return { points: dashboard.state.history.time.last().length, drawing_ms: of(drawn.took), frame_ms: of(at.slice(1).map((now, i) => now - at[i])) } })()",
        );
        println!("{report:#}");
    });
}

/// Times from Escape until a frame says that the motor is off, by the frames of the page in control.
///
/// `cargo test --test program report_of_stop -- --ignored --nocapture --test-threads 1`
#[test]
#[ignore = "a report, not a test: times are this machine's"]
fn report_of_stop_with_eight_viewers() {
    with_page_of(&[], |dashboard, tab| {
        let dashboard = &*dashboard;
        let ended = AtomicBool::new(false);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    let mut viewer = Page::open(dashboard);
                    while !ended.load(Ordering::Relaxed) {
                        viewer.stay(Duration::from_millis(100));
                    }
                });
            }
            tab.wait("dashboard.state.pages === 9");
            let mut times: Vec<f64> = Vec::new();
            for _ in 0..20 {
                let ten = tab.ask(
                "(async () => { const { link, state } = dashboard; const times = []; \
                    window.onMessage ??= link.onMessage; let heard = () => {}; link.onMessage = (message) => { window.onMessage(message); heard(); }; \
                    const until = (is) => new Promise((done) => { heard = () => is() && done(); heard(); }); \
                    for (let i = 0; i < 10; i += 1) { \
                        link.order('drive', { motor: 0, mode: 'velocity', value: 600 }); link.order('enable', { motor: 0, on: true }); \
                        await until(() => state.frame.motors[0].enabled && state.frame.motors[0].velocity > 100); \
                        await new Promise((done) => setTimeout(done, 40 * Math.random())); \
                        const begun = performance.now(); dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape' })); \
                        await until(() => !state.frame.motors[0].enabled); times.push(performance.now() - begun); \
                    } return times; })()",
            );
                times.extend(ten.as_array().unwrap().iter().filter_map(serde_json::Value::as_f64));
            }
            ended.store(true, Ordering::Relaxed);
            times.sort_by(f64::total_cmp);
            println!(
                "off after STOP, {} tries with 8 viewers: p50 {:.0} ms, max {:.0} ms",
                times.len(),
                times[times.len() / 2],
                times[times.len() - 1]
            );
        });
    });
}

#[test]
fn motors_plots_and_the_panel_in_use_are_in_sight_at_1366_by_768() {
    with_page(|tab| {
        tab.resize(1366, 768);
        for panel in PANELS {
            tab.click(&format!("#tab-{panel}"));
            in_sight(tab, panel);
        }
        for (panel, parts) in [("group", 3), ("hub", 5)] {
            tab.click(&format!("#tab-{panel}"));
            for part in (1..=parts).rev() {
                tab.click(&format!("#panel-{panel} .parts > details:nth-child({part}) > summary"));
                in_sight(tab, panel);
            }
        }
    });
}

/// Checks that motors, plots and the panel in use are whole in the window.
fn in_sight(tab: &mut Tab<'_>, panel: &str) {
    tab.settle();
    let hidden = tab.ask(
                "[...document.querySelectorAll('.card, .chart, #panel button, #panel input, #panel tr, .parts p')] \
                    .filter((e) => e.checkVisibility() && e.getBoundingClientRect().bottom > innerHeight).length",
            );
    assert_eq!(hidden, 0, "{panel}");
    assert_eq!(tab.ask("document.documentElement.scrollHeight <= innerHeight"), true, "{panel}");
}

#[test]
fn a_reload_keeps_unit_motor_tab_and_curves() {
    with_page(|tab| {
        tab.fill("#unit", "rpm");
        tab.press(("2", 50));
        tab.click("#tab-record");
        tab.click("#curves-button");
        tab.click("#curves .row:nth-child(1) button:nth-of-type(2)");
        tab.click("#curves .row:nth-child(4) button:nth-of-type(1)");
        let position = "document.querySelector('.chart[aria-label^=Position]').checkVisibility()";
        assert_eq!(tab.ask(position), true);
        tab.call("Page.reload", json!({}));
        // Until the old page is gone.
        std::thread::sleep(Duration::from_millis(500));
        live(tab);
        assert_eq!(tab.ask("document.querySelector('#unit').value"), "rpm");
        assert_eq!(tab.ask("document.querySelector('.card.chosen').getAttribute('aria-label')"), "Motor 2");
        assert_eq!(tab.ask("document.querySelector('#tab-record').getAttribute('aria-selected')"), "true");
        assert_eq!(tab.ask(position), true);
        // The label of a plot has the values of its curves, also of another motor.
        tab.wait("document.querySelector('.chart[aria-label^=Speed]').getAttribute('aria-label').includes('motor 0 0')");
    });
}

#[test]
fn a_step_that_the_server_refuses_is_not_done() {
    with_page(|tab| {
        tab.click("#tab-tune");
        // The field limits the speed, so the order is changed on its way.
        tab.ask(
            "const order = dashboard.link.order.bind(dashboard.link); \
             dashboard.link.order = (name, fields) => order(name, name === 'drive' ? { ...fields, value: 40000 } : fields); 0",
        );
        tab.click("#panel-tune button.primary");
        tab.says("#panel-tune [role=status]", "Refused");
        tab.wait(&format!("{} === false", motor(0, "enabled")));
        assert_eq!(tab.ask("document.querySelectorAll('#panel-tune tbody tr').length"), 0);
    });
}

#[test]
fn a_click_on_release_gives_control_to_the_page_that_asked_with_motors_off() {
    let release = |mut driver: Tab<'_>| {
        driver.wait("document.querySelector('#release').checkVisibility()");
        driver.click("#release");
        // Control is released. The page stays open until the other page is served.
        driver.wait("document.querySelector('#take').checkVisibility()");
    };
    with_two_pages("released", release, &["control was released"], Duration::from_secs(3));
}

#[test]
fn a_page_of_a_program_that_was_started_again_asks_for_the_new_url() {
    with_page_of(&[], |dashboard, tab| {
        let address = dashboard.url.trim_start_matches("http://").split('/').next().unwrap().to_owned();
        dashboard.end();
        tab.says("#line", "No connection");
        let _again = Dashboard::start(&["--http", &address]);
        tab.wait("document.querySelector('#line').textContent.includes('started again: open the URL')");
    });
}
