//! `motor-hub dashboard` in a real browser: nothing moves by accident, STOP always stops, and the page shows what runs.

use crate::browser::page::{
    card, drive, drive_until, focus, live, motor, mouse, number, off, open, open_all, point, press,
    with_driver_and_viewer, with_page, with_page_of, with_two_pages,
};
use crate::browser::{Browser, Tab, find};
use crate::common::{alone, made_folder, signal, wait_for};
use crate::page::Dashboard;
use serde_json::{Value, json};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// Long enough for an order to reach the hub, and for its answer to reach the page.
const ANSWERED: Duration = Duration::from_millis(400);

/// Share of the slider's track at which its thumb stands, 0 to 1.
const THUMB: &str = "(() => { const e = document.querySelector('#motors .card:nth-child(1) input[type=range]'); \
                     return (e.value - e.min) / (e.max - e.min) })()";

/// Returns the point of the slider of motor 0 at a share of the track; `None` is the middle of the thumb.
fn on_slider(tab: &mut Tab<'_>, share: Option<f64>) -> (f64, f64) {
    let share = share.unwrap_or_else(|| tab.ask(THUMB).as_f64().unwrap());
    // A thumb's middle stays half a thumb away from both ends.
    point(tab, &card(0, "input[type=range]"), &format!("8 + {share} * (b.width - 16)"), "b.height / 2")
}

fn target(tab: &mut Tab<'_>) -> f64 {
    std::thread::sleep(ANSWERED);
    tab.ask(&motor(0, "target")).as_f64().unwrap()
}

/// Puts a finger down, moves it in small steps, and ends with `end`.
fn swipe(tab: &mut Tab<'_>, (x, y): (f64, f64), (by_x, by_y): (f64, f64), end: &str) {
    let touch = |tab: &mut Tab<'_>, kind: &str, points: Value| {
        tab.call("Input.dispatchTouchEvent", json!({ "type": kind, "touchPoints": points }));
    };
    touch(tab, "touchStart", json!([{ "x": x, "y": y }]));
    for step in 1..=20 {
        let share = f64::from(step) / 20.0;
        touch(tab, "touchMove", json!([{ "x": x + share * by_x, "y": y + share * by_y }]));
        std::thread::sleep(Duration::from_millis(12));
    }
    touch(tab, end, json!([]));
}

fn as_phone(tab: &mut Tab<'_>) {
    let size = json!({ "width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": true });
    tab.call("Emulation.setDeviceMetricsOverride", size);
    tab.call("Emulation.setTouchEmulationEnabled", json!({ "enabled": true }));
}

#[test]
fn a_swipe_that_scrolls_the_page_does_not_change_the_speed() {
    with_page(|tab| {
        as_phone(tab);
        drive(tab, 0, 200);
        let mut scrolled = false;
        for share in [None, Some(0.95), Some(0.05)] {
            for (by_x, by_y) in [(0.0, -150.0), (30.0, -150.0), (-45.0, 150.0)] {
                tab.ask("scrollTo(0, 200)");
                tab.ask(&format!(
                    "document.querySelector('{}').scrollIntoView({{block: 'center'}})",
                    card(0, "input[type=range]")
                ));
                let (from, top) = (on_slider(tab, share), tab.ask("scrollY"));
                swipe(tab, from, (by_x, by_y), "touchEnd");
                scrolled |= tab.ask("scrollY") != top;
            }
            assert!((target(tab) - 200.0).abs() < 0.5, "from {share:?}");
        }
        assert!(scrolled, "the swipes scroll the page");
    });
}

#[test]
fn a_tap_or_a_click_on_a_track_does_not_jump() {
    with_page(|tab| {
        drive(tab, 0, 200);
        for share in [0.05, 0.9, 0.95] {
            let at = on_slider(tab, Some(share));
            mouse(tab, "mousePressed", at);
            mouse(tab, "mouseReleased", at);
        }
        assert!((target(tab) - 200.0).abs() < 0.5, "a click");
        as_phone(tab);
        for share in [0.05, 0.9, 0.95] {
            let at = on_slider(tab, Some(share));
            swipe(tab, at, (0.0, 0.0), "touchEnd");
            // A drag that does not start at the thumb is none either.
            swipe(tab, at, (-40.0, 0.0), "touchEnd");
        }
        assert!((target(tab) - 200.0).abs() < 0.5, "a tap");
    });
}

#[test]
fn a_drag_of_the_thumb_sets_the_speed_and_a_cancelled_one_restores_it() {
    with_page(|tab| {
        drive(tab, 0, 200);
        let (x, y) = on_slider(tab, None);
        mouse(tab, "mousePressed", (x, y));
        for step in 1..=10 {
            mouse(tab, "mouseMoved", (x + f64::from(4 * step), y));
        }
        mouse(tab, "mouseReleased", (x + 40.0, y));
        tab.wait(&format!("{} > 400", motor(0, "target")));
        let dragged = target(tab);
        assert_eq!(number(tab, &card(0, "input[type=number]")), dragged);
        as_phone(tab);
        let at = on_slider(tab, None);
        swipe(tab, at, (60.0, 0.0), "touchCancel");
        assert!((target(tab) - dragged).abs() < 0.5, "a cancelled drag");
        let at = on_slider(tab, None);
        swipe(tab, at, (-60.0, 0.0), "touchEnd");
        tab.wait(&format!("{} < {}", motor(0, "target"), dragged - 100.0));
    });
}

#[test]
fn a_slider_moves_a_position_beyond_its_range_by_no_more_than_its_thumb() {
    with_page(|tab| {
        tab.fill(&card(0, "[aria-label^=Mode]"), "position");
        let [slider, field] = ["input[type=range]", "input[type=number]"].map(|part| card(0, part));
        for position in [20_000, -20_000, 3_000] {
            tab.fill(&field, &position.to_string());
            assert_eq!(number(tab, &slider), f64::from(position));
            focus(tab, &slider);
            tab.press(("ArrowRight", 39));
            assert_eq!(number(tab, &field), f64::from(position + 1));
        }
    });
}

/// A process that was stopped. It goes on at the end, also if the test fails.
struct Stopped(u32);

impl Drop for Stopped {
    fn drop(&mut self) {
        // The process may have ended with its browser.
        let _ = Command::new("kill").args(["-CONT", &self.0.to_string()]).status();
    }
}

#[test]
fn a_page_that_paints_nothing_loses_its_motors_after_a_second() {
    let mut stopped = None;
    let stop_painting = |mut tab: Tab<'_>| {
        let painter = tab.painter();
        signal(painter, "-STOP");
        stopped = Some(Stopped(painter));
    };
    with_two_pages("unpainted", stop_painting, &["showed no new values for 1 s"], Duration::from_secs(3));
    drop(stopped);
}

#[test]
fn a_page_that_connects_while_it_is_hidden_loses_control_too() {
    with_page(|tab| {
        tab.hide();
        tab.ask("location.reload(); 0");
        tab.wait("window.dashboard?.state.you > 1 && dashboard.state.controller === dashboard.state.you");
        assert_eq!(tab.ask("document.hidden"), true);
        tab.wait("dashboard.state.open && dashboard.state.controller === null");
    });
}

#[test]
fn a_hidden_page_has_acknowledged_its_newest_frame_when_its_hub_is_lost() {
    with_page(|tab| {
        tab.hide();
        let lost = json!({ "kind": "line", "connected": false, "why": "", "reports": true, "stores": false, "has": null });
        // Otherwise a hidden page acknowledges one of five frames.
        for _ in 0..20 {
            let missing = "dashboard.link.newest - dashboard.link.acknowledged";
            assert_eq!(tab.ask(&format!("dashboard.link.take(JSON.stringify({lost})), {missing}")), 0);
        }
    });
}

#[test]
fn a_gamepad_drives_while_its_button_is_held_and_not_in_a_hidden_page() {
    with_page(|tab| {
        tab.ask(
            "window.pad = { connected: true, buttons: [{ pressed: true }], axes: [0, -1] }; \
             navigator.getGamepads = () => [window.pad]; 0",
        );
        tab.wait(&format!("{} > 300", motor(0, "velocity")));
        tab.ask("window.pad.buttons[0].pressed = false");
        off(tab, Instant::now());
        tab.ask("window.pad.buttons[0].pressed = true");
        tab.wait(&motor(0, "enabled"));
        tab.wait(&format!("{} > 300", motor(0, "velocity")));
        let since = Instant::now();
        tab.hide();
        let took = off(tab, since);
        println!("a motor of the gamepad off {:.0} ms after its page was hidden", took.as_secs_f64() * 1e3);
        assert!(took < Duration::from_secs(2), "{took:?}");
        // A page that is seen again waits until the button is released, also if it was pressed while the page was hidden.
        for pressed_before in [true, false] {
            tab.call("Page.bringToFront", json!({}));
            std::thread::sleep(Duration::from_secs(1));
            assert_eq!(tab.ask(&motor(0, "enabled")), false, "pressed before: {pressed_before}");
            tab.ask("window.pad.buttons[0].pressed = false");
            std::thread::sleep(Duration::from_millis(200));
            tab.hide();
            tab.ask("window.pad.buttons[0].pressed = true");
        }
    });
}

#[test]
fn run_after_stop_needs_a_new_speed() {
    with_page(|tab| {
        drive(tab, 0, 900);
        tab.click("#stop");
        off(tab, Instant::now());
        tab.wait(&format!("{} === 0", motor(0, "velocity")));
        // STOP also clears a speed that is entered while the motor is off.
        tab.fill(&card(0, "input[type=number]"), "700");
        tab.click("#stop");
        tab.wait(&format!("document.querySelector('{}').value === '0'", card(0, "input[type=number]")));
        tab.click(&card(0, ".run"));
        tab.wait(&motor(0, "enabled"));
        assert_eq!(target(tab), 0.0);
        // The motor still comes to rest by itself, so its speed may differ from 0. It must not go on by more than some counts.
        let position = |tab: &mut Tab<'_>| tab.ask(&motor(0, "position")).as_i64().expect("a position");
        let before = position(tab);
        std::thread::sleep(Duration::from_secs(1));
        assert!((position(tab) - before).abs() <= 3, "{} from {before}", position(tab));
    });
}

#[test]
fn run_does_not_start_a_motor_whose_set_point_is_refused() {
    with_page(|tab| {
        drive(tab, 0, 900);
        tab.click("#stop");
        off(tab, Instant::now());
        tab.ask("import('/js/motors.js').then(({ motion }) => { motion.tolerance = 70000; })");
        tab.click(&card(0, ".run"));
        tab.says("#notice", "Not done");
        std::thread::sleep(ANSWERED);
        assert_eq!(tab.ask(&motor(0, "enabled")), false);
        // The field keeps its range.
        tab.click("#tab-group");
        open(tab, "Limits of set-points");
        tab.fill("#motion-tolerance", "70000");
        assert_eq!(number(tab, "#motion-tolerance"), 65_535.0);
    });
}

/// Switches motor 0 off, and checks that *Run* then leaves the motor where it is, also after `between`.
fn stays_at_run_after(tab: &mut Tab<'_>, between: impl Fn(&mut Tab<'_>)) {
    let position = |tab: &mut Tab<'_>| tab.ask(&motor(0, "position")).as_i64().expect("a position");
    tab.click(&card(0, ".run"));
    off(tab, Instant::now());
    tab.wait(&format!("{} === 0", motor(0, "velocity")));
    between(tab);
    std::thread::sleep(ANSWERED);
    let before = position(tab);
    tab.click(&card(0, ".run"));
    tab.wait(&motor(0, "enabled"));
    std::thread::sleep(Duration::from_secs(1));
    assert!((position(tab) - before).abs() <= 20, "{} from {before}", position(tab));
}

#[test]
fn run_holds_the_present_position_after_a_new_zero_and_on_another_hub() {
    with_page_of(&["--hubs", "2"], |_, tab| {
        let reach = |tab: &mut Tab<'_>| {
            let is_reached = format!("Math.abs({} - 2000) < 20", motor(0, "position"));
            drive_until(tab, 0, "2000", &is_reached);
        };
        tab.fill(&card(0, "[aria-label^=Mode]"), "position");
        reach(tab);
        tab.click("#tab-setup");
        press(tab, "Set zero here");
        tab.says("#notice", "Not done: motor 0 holds a position");
        stays_at_run_after(tab, |tab| {
            press(tab, "Set zero here");
            tab.wait(&format!("Math.abs({}) < 20", motor(0, "position")));
        });
        reach(tab);
        stays_at_run_after(tab, |tab| {
            tab.fill(&card(0, "input[type=number]"), "3000");
            tab.click("#hubs button:nth-child(2)");
            tab.wait("dashboard.state.hubs[1].shown");
        });
    });
}

#[test]
fn a_page_that_only_watches_shows_the_speed_that_runs() {
    with_driver_and_viewer(|mut driver, mut viewer| {
        let shows = |tab: &mut Tab<'_>, what: &str, value: &str| {
            tab.wait(&format!("document.querySelector('{}').value === '{value}'", card(0, what)));
        };
        shows(&mut viewer, "input[type=number]", "900");
        shows(&mut viewer, "input[type=range]", "900");
        let inputs = "[...document.querySelectorAll('#panel-tune input')].every(({ disabled }) => disabled)";
        assert_eq!(viewer.ask(inputs), true);
        driver.fill(&card(0, "[aria-label^=Mode]"), "power");
        driver.fill(&card(0, "input[type=number]"), "25");
        shows(&mut viewer, "[aria-label^=Mode]", "power");
        shows(&mut viewer, "input[type=number]", "25");
        driver.click("#stop");
        shows(&mut viewer, "input[type=number]", "0");
        shows(&mut driver, "input[type=number]", "0");
    });
}

#[test]
#[ignore = "long: cargo xtask long"]
fn a_scenario_that_plays_is_shown_in_the_cards() {
    let winch = concat!(env!("CARGO_MANIFEST_DIR"), "/../../boards/simulated/scenarios/winch.toml");
    with_page_of(&["--scenario", winch], |_, tab| {
        tab.click("#tab-world");
        tab.click("#world-play");
        tab.wait(&motor(0, "enabled"));
        let field = |part: &str| format!("document.querySelector('{}').value", card(0, part));
        tab.wait(&format!("{} === {}", field("[aria-label^=Mode]"), motor(0, "setpoint")));
        tab.wait(&format!("Number({}) !== 0", field("input[type=number]")));
    });
}

#[test]
fn another_unit_converts_the_entered_speed_and_leaves_the_motor_alone() {
    with_page(|tab| {
        drive(tab, 0, 900);
        let field = card(0, "input[type=number]");
        let per_turn = tab.ask("dashboard.state.settings[0].counts_per_turn").as_f64().unwrap();
        tab.fill("#unit", "rpm");
        let rpm = number(tab, &field);
        assert!((rpm - 900.0 * 60.0 / per_turn).abs() < 0.06, "{rpm} rpm");
        assert!((target(tab) - 900.0).abs() < 0.5);
        tab.fill("#unit", "cps");
        assert_eq!(number(tab, &field), 900.0);
    });
}

#[test]
fn a_speed_above_the_free_speed_is_limited_with_a_message() {
    with_page(|tab| {
        let free = tab.ask("12000 / dashboard.state.settings[0].emf_mv_s_per_count").as_f64().unwrap();
        drive(tab, 0, 300);
        tab.fill(&card(0, "input[type=number]"), "9999");
        let limited = target(tab);
        assert!(limited <= free && limited > 0.98 * free, "{limited} of {free}");
        assert_eq!(number(tab, &card(0, "input[type=number]")), limited);
        let says = |text: &str| {
            format!("document.querySelector('{}').textContent.includes('{text}')", card(0, ".why"))
        };
        tab.wait(&says("the free speed at 12 V: 9999 was entered"));
        // This motor is faster than a hub accepts.
        tab.ask("dashboard.link.order('configure', { motor: 0, values: { emf_mv_s_per_count: 0.1 } })");
        tab.wait("dashboard.state.settings[0].emf_mv_s_per_count < 0.2");
        tab.fill(&card(0, "input[type=number]"), "99999");
        tab.wait(&says("the highest speed that a hub accepts: 99999 was entered"));
    });
}

#[test]
fn an_empty_field_and_a_text_that_is_no_number_change_nothing_and_are_named() {
    with_page(|tab| {
        let type_text = |tab: &mut Tab<'_>, field: &str, text: &str| {
            tab.ask(&format!(
                "(() => {{ const e = document.querySelector('{field}'); e.focus(); e.select(); document.execCommand('delete'); }})()"
            ));
            tab.call("Input.insertText", json!({ "text": text }));
            tab.ask("document.activeElement.blur()");
        };
        let refused = |tab: &mut Tab<'_>, field: &str| {
            tab.reads("#notice", &format!("Not done: {field}: enter a number."));
            tab.ask("document.querySelector('#notice').textContent = ''");
        };
        let field = card(0, "input[type=number]");
        tab.fill(&card(0, "[aria-label^=Mode]"), "position");
        drive_until(tab, 0, "300", &format!("Math.abs({} - 300) < 20", motor(0, "position")));
        for text in ["", "1e", "-"] {
            type_text(tab, &field, text);
            refused(tab, "Set-point of motor 0, counts");
            assert_eq!((target(tab), number(tab, &field)), (300.0, 300.0), "{text}");
        }
        tab.ask("dashboard.link.order('acceleration', { motor: 0, limit: 2000 })");
        tab.wait("dashboard.state.settings[0].undoable === 1");
        open_all(tab);
        for (panel, field, button, name) in [
            ("tune", "[aria-label=\"P of the velocity loop\"]", "Set", "P of the velocity loop"),
            ("setup", "[id=\"field-acceleration_limit_cps2\"]", "Apply changes", "acceleration_limit_cps2"),
            ("group", "#group-speed", "Move together", "Speed, counts/s"),
            ("group", "#motion-speed", "", "Speed to a position, counts/s"),
        ] {
            tab.click(&format!("#tab-{panel}"));
            type_text(tab, field, "1e");
            if !button.is_empty() {
                press(tab, button);
            }
            refused(tab, name);
        }
        assert_eq!(number(tab, "#motion-speed"), 1000.0);
        std::thread::sleep(ANSWERED);
        assert_eq!(tab.ask("dashboard.state.settings[0].undoable"), 1);
    });
}

#[test]
fn the_wheel_over_a_field_changes_nothing() {
    with_page(|tab| {
        drive(tab, 0, 300);
        tab.click(&card(0, "input[type=number]"));
        let (x, y) = point(tab, &card(0, "input[type=number]"), "b.width / 3", "b.height / 2");
        for by in [-120, 120, 120] {
            tab.call(
                "Input.dispatchMouseEvent",
                json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": by }),
            );
        }
        assert!((target(tab) - 300.0).abs() < 0.5);
        assert_eq!(number(tab, &card(0, "input[type=number]")), 300.0);
    });
}

/// Text of the reason in the card of motor 0, once there is one of these words.
fn reason(tab: &mut Tab<'_>, word: &str) -> String {
    let why = format!("document.querySelector('{}').textContent", card(0, ".why"));
    tab.wait(&format!("{why}.includes('{word}')"));
    tab.ask(&why).as_str().unwrap().to_owned()
}

#[test]
fn a_held_shaft_is_reported_as_stalled_and_not_as_an_encoder_fault() {
    with_page(|tab| {
        drive(tab, 0, 600);
        tab.ask("dashboard.link.order('world', { hold: { motor: 0, held: true } })");
        let stalls = format!("{} || {}", motor(0, "stalled"), motor(0, "fault"));
        tab.wait(&stalls);
        let why = reason(tab, "held");
        assert!(!why.contains("does not count") && !why.contains("plug,"), "{why}");
    });
}

#[test]
fn a_load_beyond_the_stall_torque_is_named_before_swapped_wires() {
    with_page(|tab| {
        drive(tab, 0, 600);
        // Beyond the stall torque of each motor of the scenario.
        tab.ask("dashboard.link.order('world', { torque: { motor: 0, nm: -5 } })");
        let why = reason(tab, "load");
        assert!(why.find("load").unwrap() < why.find("swapped").unwrap_or(usize::MAX), "{why}");
    });
}

#[test]
fn the_browser_is_started_without_the_token_in_the_process_list() {
    let folder = made_folder("dashboard-open");
    let (opener, said) = (folder.join("xdg-open"), folder.join("said"));
    std::fs::write(
        &opener,
        format!("#!/bin/sh\necho \"$@\" > {0}.part && mv {0}.part {0}\n", said.display()),
    )
    .unwrap();
    std::fs::set_permissions(&opener, std::fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", folder.display(), std::env::var("PATH").unwrap());
    let mut dashboard = Dashboard::start_with(&["--open"], &[("PATH", &path)]);
    let given = wait_for("a started browser", || std::fs::read_to_string(&said).ok());
    let (_, token) = dashboard.url.split_once("token=").unwrap();
    assert!(!given.contains(token), "{given}");
    let file = Path::new(given.trim().trim_start_matches("file://")).to_owned();
    let mode = std::fs::metadata(&file).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o600, "{}", file.display());
    if let Some(program) = find() {
        let _alone = alone();
        let mut browser = Browser::start(&program);
        let mut tab = browser.open(&format!("file://{}", file.display()), 1280, 1000);
        live(&mut tab);
    }
    dashboard.end();
    assert!(!file.exists(), "the file is removed at the end");
}
