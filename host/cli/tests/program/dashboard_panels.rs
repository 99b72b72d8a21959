//! The panels of `motor-hub dashboard` in a real browser.

use crate::browser::Tab;
use crate::browser::page::{
    CATCH, ESCAPE, choose, drive, drive_until, focus, motor, mouse, number, off, open, pictures, point,
    press, saved, unobstructed, with_page, with_page_of,
};
use crate::client_update::{KEY, RUNS, image, with_slot};
use crate::hub_support::{SIGNATURE, SLOT, Server};
use crate::page::Page;
use motor_hub::update::{Slot, public_key};
use serde_json::json;
use std::process::Command;
use std::time::{Duration, Instant};

const FROM: &str = "#panel-tune [aria-label=\"Step from\"]";
const TO: &str = "#panel-tune [aria-label=\"Step to\"]";
const SAYS: &str = "#panel-tune [role=status]";

#[test]
fn a_step_begins_at_the_speed_that_was_asked_for() {
    with_page(|tab| {
        tab.click("#tab-tune");
        // So heavy that it takes longer than a second to the first speed.
        tab.ask("dashboard.link.order('world', { inertia: { motor: 0, kg_m2: 0.02 } })");
        let free = tab.ask("12000 / dashboard.state.settings[0].emf_mv_s_per_count").as_f64().unwrap();
        let from = (0.7 * free).round();
        tab.fill(FROM, &from.to_string());
        tab.fill(TO, "500");
        tab.click("#panel-tune button.primary");
        tab.reads(SAYS, "Done.");
        let label = "document.querySelector('#panel-tune .chart').getAttribute('aria-label')";
        let most = tab.ask(&format!("Number({label}.match(/now from .* to (.*),/)[1])")).as_f64().unwrap();
        assert!((most - from).abs() < 0.06 * from, "from {most} instead of {from} counts/s");
    });
}

#[test]
#[ignore = "long: cargo xtask long"]
fn a_step_whose_first_speed_is_not_reached_is_not_recorded() {
    with_page(|tab| {
        tab.click("#tab-tune");
        tab.ask("dashboard.link.order('world', { hold: { motor: 0, held: true } })");
        tab.fill(FROM, "600");
        tab.click("#panel-tune button.primary");
        tab.says(SAYS, "The motor did not reach 600 counts/s within 6 s");
        off(tab, Instant::now());
        assert_eq!(tab.ask("document.querySelectorAll('#panel-tune tbody tr').length"), 0);
    });
}

#[test]
fn a_step_ends_with_its_own_motor_off_when_another_hub_is_chosen() {
    with_page_of(&["--hubs", "2"], |_, tab| {
        // The hub receives orders later than the first frames after the beginning of the step.
        tab.ask(
            "(() => { const { link } = dashboard, order = link.order; \
             link.order = (...sent) => setTimeout(() => order.apply(link, sent), sent[0] === 'shown' ? 0 : 500); })()",
        );
        tab.click("#tab-tune");
        tab.fill(FROM, "300");
        tab.click("#panel-tune button.primary");
        tab.wait(&format!("{} > 100", motor(0, "velocity")));
        tab.click("#hubs button:nth-child(2)");
        tab.wait("dashboard.state.hubs[1].shown");
        tab.says(SAYS, "Another hub was chosen");
        std::thread::sleep(Duration::from_secs(1));
        assert_eq!(tab.ask("dashboard.state.hubs.map(({ running }) => running.length)"), json!([0, 0]));
        assert_eq!(tab.ask(&motor(0, "velocity")), 0);
    });
}

#[test]
fn the_speeds_of_a_step_are_converted_to_another_unit_and_limited_to_the_motor() {
    with_page(|tab| {
        tab.click("#tab-tune");
        let per_turn = tab.ask("dashboard.state.settings[0].counts_per_turn").as_f64().unwrap();
        let free = tab.ask("12000 / dashboard.state.settings[0].emf_mv_s_per_count").as_f64().unwrap();
        tab.fill("#unit", "rpm");
        let rpm = number(tab, TO);
        assert!((rpm - 800.0 * 60.0 / per_turn).abs() < 0.06, "{rpm} rpm");
        tab.fill(FROM, "99999");
        let rpm = number(tab, FROM);
        assert!((rpm - free * 60.0 / per_turn).abs() < 0.02 * rpm, "{rpm} rpm");
        tab.says(SAYS, "Limited to");
        tab.fill("#unit", "cps");
        assert!((number(tab, TO) - 800.0).abs() < 0.5);
        assert_eq!(tab.ask(&motor(0, "enabled")), false);
    });
}

#[test]
fn settings_are_exported_changed_and_imported() {
    with_page(|tab| {
        tab.click("#tab-hub");
        open(tab, "Settings of all motors");
        tab.ask(CATCH);
        press(tab, "Export to a file");
        let text = saved(tab);
        assert!(text.contains("schema_version = 1") && text.matches("[[motor]]").count() == 4, "{text}");
        assert_eq!(tab.ask("dashboard.state.settings[2].scheme.scheme"), "A");
        choose(tab, "#settings-file", "other.toml", text.replace("scheme = \"A\"", "scheme = \"B\""));
        tab.wait("dashboard.state.settings.every(({ scheme }) => scheme.scheme === 'B')");
        choose(tab, "#settings-file", "wrong.toml", "schema_version = 99");
        tab.wait("document.querySelector('#notice').textContent.includes('schema_version is 99')");
        choose(tab, "#settings-file", "long.toml", format!("{text}{}", "# note\n".repeat(2_400)));
        tab.wait("document.querySelector('#notice').textContent.includes('allowed are at most 16384')");
        assert_eq!(tab.ask("dashboard.state.open && dashboard.state.you"), 1);
    });
}

#[test]
fn faults_are_listed_with_their_explanation() {
    with_page(|tab| {
        tab.click("#tab-hub");
        open(tab, "Faults and resets");
        press(tab, "Show faults");
        tab.says("#hub-faults", "No faults");
        drive(tab, 1, 600);
        tab.ask("dashboard.link.order('world', { encoder: { motor: 1, is: 'unplugged' } })");
        tab.wait(&motor(1, "fault"));
        press(tab, "Show faults");
        let first = "document.querySelector('#hub-faults details')";
        tab.wait(&format!("{first}?.textContent.includes('2 no counts although driven, motor 1')"));
        assert!(tab.ask(&format!("{first}.textContent.includes('Look at the shaft first')")) == true);
    });
}

#[test]
fn a_recording_ends_when_another_hub_is_shown() {
    with_page_of(&["--hubs", "2"], |_, tab| {
        tab.click("#tab-record");
        press(tab, "Record");
        tab.says("#recording", "● Recording, 1 s");
        tab.click("#hubs button:nth-child(2)");
        tab.says("#panel-record [role=status]", "Another hub is shown");
        assert_eq!(tab.ask("document.querySelector('#recording').hidden"), true);
        press(tab, "Record");
        tab.says("#recording", "● Recording, 1 s");
    });
}

#[test]
fn typed_values_stay_when_another_page_opens_or_another_motor_is_changed() {
    with_page_of(&[], |dashboard, tab| {
        let limit = "#panel-tune [aria-label^=\"Largest acc\"]";
        tab.click("#tab-tune");
        tab.fill(limit, "4321");
        tab.click("#tab-setup");
        tab.fill("#setup-scheme", "D");
        let other = Page::open(dashboard);
        tab.wait("dashboard.state.pages === 2");
        drop(other);
        tab.wait("dashboard.state.pages === 1");
        tab.ask("dashboard.link.order('configure', { motor: 1, values: { current_limit_ma: 2000 } })");
        tab.wait("dashboard.state.settings[1].undoable === 1");
        assert_eq!(number(tab, limit), 4321.0);
        assert_eq!(tab.ask("document.querySelector('#setup-scheme').value"), "D");
    });
}

#[test]
fn a_slider_of_simulate_shows_the_newly_chosen_motor_although_it_has_the_focus() {
    with_page(|tab| {
        const TORQUE: &str = "#panel-world [aria-label^=Torque]";
        tab.click("#tab-world");
        focus(tab, TORQUE);
        for _ in 0..4 {
            tab.press(("ArrowRight", 39));
        }
        tab.wait("dashboard.state.world.motors[0].nm === 0.2");
        tab.press(("1", 49));
        assert_eq!(number(tab, TORQUE), 0.0);
        tab.press(("ArrowRight", 39));
        tab.wait("dashboard.state.world.motors[1].nm === 0.05");
    });
}

#[test]
fn currents_are_shown_as_the_torque_of_the_shaft() {
    with_page(|tab| {
        drive(tab, 0, 800);
        tab.click("#curves-button");
        press(tab, "As torque, N m");
        tab.wait("[...document.querySelectorAll('.legend h3')].some((one) => one.textContent === 'Torque of the shaft, N m')");
        // The load current is the current that balances friction, drag and the torque.
        let load = "[...document.querySelectorAll('.legend span')].find((one) => one.textContent.startsWith('load')).querySelector('b').textContent";
        let load = format!("Math.abs(Number({load}.replace('−', '-')))");
        tab.wait(&format!("{load} > 0.05 && {load} < 0.25"));
        tab.ask(&format!("window.before = {load}"));
        tab.ask("dashboard.link.order('world', { torque: { motor: 0, nm: -0.3 } })");
        tab.wait(&format!("Math.abs({load} - before - 0.3) < 0.05"));
    });
}

#[test]
fn a_position_and_its_set_point_are_plotted() {
    with_page(|tab| {
        tab.click("#curves-button");
        tab.click("#curves .row:nth-child(1) button:nth-of-type(2)");
        tab.fill("#motion-speed", "400");
        tab.fill("#motion-zero", "float");
        tab.fill("#motors .card:nth-child(1) [aria-label^=Mode]", "position");
        tab.ask("(() => { window.fastest = 0; const { onMessage } = dashboard.link; dashboard.link.onMessage = (message) => { onMessage(message); if (message.kind === 'frame') fastest = Math.max(fastest, message.motors[0].velocity); }; })()");
        drive_until(tab, 0, "600", &format!("Math.abs({} - 600) < 12", motor(0, "position")));
        let label = "document.querySelector('.chart[aria-label^=Position]').getAttribute('aria-label')";
        tab.wait(&format!("{label}.includes('set-point 600')"));
        let fastest = tab.ask("fastest").as_f64().unwrap();
        assert!((300.0..450.0).contains(&fastest), "{fastest} counts/s with a limit of 400");
    });
}

#[test]
fn a_card_and_the_battery_are_unknown_without_a_connection() {
    with_page_of(&[], |dashboard, tab| {
        drive(tab, 0, 500);
        dashboard.end();
        let card = "document.querySelector('#motors .card:nth-child(1)')";
        tab.wait(&format!("{card}.querySelector('.pill').textContent === 'Unknown'"));
        for (part, text) in [(".run", "Run"), (".speed b", "–")] {
            assert_eq!(tab.ask(&format!("{card}.querySelector('{part}').textContent")), text);
        }
        tab.reads("#battery", "Battery unknown");
    });
}

#[test]
fn an_identification_whose_connection_is_lost_is_shown_as_stopped() {
    with_page_of(&[], |dashboard, tab| {
        tab.click("#tab-learn");
        press(tab, "Identify");
        const SAYS: &str = "#panel-learn [role=status]";
        tab.says(SAYS, "Moving");
        // The motor had power 0 before, but the mode of its card stays.
        assert_eq!(tab.ask("document.querySelector('#motors [aria-label^=Mode]').value"), "velocity");
        dashboard.end();
        tab.says(SAYS, "The connection was lost");
    });
}

#[test]
fn a_card_shows_the_state_of_the_bridge_and_names_slider_and_field_apart() {
    with_page(|tab| {
        let pill = "document.querySelector('#motors .card:nth-child(1) .pill')";
        assert_eq!(tab.ask(&format!("{pill}.textContent")), "Off (coasting)");
        drive(tab, 0, 900);
        tab.wait(&format!("/^Driving, \\d+ % duty$/.test({pill}.textContent)"));
        tab.wait(&format!("{pill}.title.startsWith('Mode ' + {})", motor(0, "mode")));
        assert!(
            tab.ask(&format!("{pill}.title")).as_str().unwrap().contains("drives the motor for this share")
        );
        let name = |of: &str| {
            format!(
                "document.querySelector('#motors .card:nth-child(1) input[type={of}]').getAttribute('aria-label')"
            )
        };
        assert_eq!(tab.ask(&name("range")), "Slider for the set-point of motor 0, counts/s");
        assert_eq!(tab.ask(&name("number")), "Set-point of motor 0, counts/s");
    });
}

#[test]
fn a_time_without_frames_is_a_gap_in_the_curves() {
    with_page(|tab| {
        let curve = tab.ask(
            "import('/js/history.js').then(({ History }) => { const all = new History(); \
             for (const at_s of [1, 1.02, 3]) all.push({ at_s, motors: [{ velocity: 5 }] }); \
             return all.motors[0].velocity.last(); })",
        );
        assert_eq!(curve, json!([5, 5, null, 5]));
    });
}

#[test]
fn plots_that_are_zoomed_in_are_resumed_and_a_recording_without_rows_is_refused() {
    with_page(|tab| {
        let pause = |words: &str| format!("document.querySelector('#pause').textContent === '{words}'");
        let [from, to] = ["0.3", "0.6"]
            .map(|share| point(tab, "#charts .u-over", &format!("{share} * b.width"), "b.height / 2"));
        mouse(tab, "mousePressed", from);
        mouse(tab, "mouseMoved", to);
        mouse(tab, "mouseReleased", to);
        tab.wait(&pause("Resume live"));
        tab.click("#unzoom");
        tab.wait(&pause("Pause"));
        tab.click("#tab-record");
        let names = tab.ask("import('/js/history.js').then(({ OF_MOTOR }) => OF_MOTOR.join())");
        let names = names.as_str().unwrap();
        choose(tab, "#record-file", "head.csv", format!("time_s,motor,battery_v,{names}\n"));
        tab.reads(STATUS, "head.csv: the recording has no rows");
        assert_eq!(tab.ask(&pause("Pause")), true);
        // The choice of curves shifts the plots down, and no text lies over another one.
        tab.resize(1280, 900);
        tab.click("#curves-button");
        tab.settle();
        assert_eq!(unobstructed(tab), Vec::<String>::new());
    });
}

const STATUS: &str = "#panel-record [role=status]";

#[test]
#[ignore = "long: cargo xtask long"]
fn a_recording_has_a_banner_all_columns_and_marks_of_its_events_and_is_shown_again() {
    with_page(|tab| {
        tab.click("#tab-record");
        press(tab, "Record");
        tab.says("#recording", "● Recording, 1 s");
        drive(tab, 0, 700);
        tab.fill("#motors .card:nth-child(1) input[type=number]", "900");
        std::thread::sleep(Duration::from_millis(500));
        tab.press(ESCAPE);
        off(tab, Instant::now());
        std::thread::sleep(Duration::from_millis(300));
        press(tab, "Stop recording");
        assert_eq!(tab.ask("document.querySelector('#recording').hidden"), true);
        tab.ask(CATCH);
        press(tab, "Save as CSV");
        let text = saved(tab);
        let head = text.lines().next().unwrap();
        assert!(text.lines().count() > 40 && head.starts_with("time_s,motor,battery_v,velocity"), "{text}");
        for column in ["velocity", "goal", "enabled", "setpoint", "mode", "duty", "regime", "fault", "s", "g"]
        {
            assert!(head.split(',').any(|name| name == column), "no column {column}: {head}");
        }
        choose(tab, "#record-file", "run.csv", &text);
        tab.says(STATUS, "run.csv is shown");
        let marks = tab.ask("dashboard.columns().marks.map(({ words }) => words)");
        assert_eq!(marks, serde_json::json!(["set-point", "set-point", "off"]));
        tab.wait("document.querySelector('.chart[aria-label^=Speed]').getAttribute('aria-label').includes(', recording of ')");
        tab.picture(&pictures().join("recording.png"), false);
        assert_eq!(tab.text("#pause"), "Resume live");
        tab.click("#pause");
        assert_eq!(tab.text("#pause"), "Pause");
    });
}

/// With `MOTOR_HUB_MCAP`, a Python that has the package `mcap`, the file is read back by that package.
#[test]
#[ignore = "long: cargo xtask long"]
fn a_recording_saved_as_mcap_has_all_rows() {
    with_page(|tab| {
        tab.click("#tab-record");
        press(tab, "Record");
        drive(tab, 0, 700);
        press(tab, "Stop recording");
        tab.ask(CATCH);
        press(tab, "Save as CSV");
        let rows = saved(tab).lines().count() - 1;
        tab.ask("delete window.saved; 0");
        tab.ask(CATCH);
        press(tab, "Save as MCAP");
        tab.wait("window.saved");
        let bytes = tab.ask("window.saved.arrayBuffer().then((all) => [...new Uint8Array(all)])");
        let bytes: Vec<u8> = serde_json::from_value(bytes).unwrap();
        assert!(bytes.starts_with(b"\x89MCAP0\r\n") && bytes.ends_with(b"\x89MCAP0\r\n"));
        let file = pictures().join("recording.mcap");
        std::fs::write(&file, bytes).unwrap();
        let Some(python) = std::env::var_os("MOTOR_HUB_MCAP") else { return };
        let read = Command::new(python).args(["-c", READ]).arg(&file).output().unwrap();
        assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
        let read: serde_json::Value = serde_json::from_slice(&read.stdout).unwrap();
        assert_eq!(read["rows"], rows);
        assert_eq!(read["topics"], serde_json::json!(["/motor/0", "/motor/1", "/motor/2", "/motor/3"]));
        assert!((read["last"]["velocity"].as_f64().unwrap() - 700.0).abs() < 40.0, "{read}");
    });
}

const READ: &str = "
import json, sys
from mcap.reader import make_reader
with open(sys.argv[1], 'rb') as file:
    all = [(channel.topic, message) for _, channel, message in make_reader(file).iter_messages()]
last = [json.loads(message.data) for topic, message in all if topic == '/motor/0'][-1]
print(json.dumps({'rows': len(all), 'topics': sorted({topic for topic, _ in all}), 'last': last}))
";

#[test]
fn every_setting_has_a_field_that_changes_it_and_undo_restores_it() {
    with_page(|tab| {
        tab.click("#tab-setup");
        tab.click("#all-settings summary");
        let value = |name: &str| {
            format!("dashboard.state.settings[0].fields.find((one) => one.name === '{name}').value")
        };
        assert_eq!(tab.ask(&value("current_limit_ma")), serde_json::Value::Null);
        for (name, text) in [
            ("current_limit_ma", "800"),
            ("thermal.continuous_current_ma", "1500"),
            ("on_fault", "brake"),
            ("bridge.turn_on_ns", "400"),
        ] {
            tab.fill(&format!("[id=\"field-{name}\"]"), text);
        }
        press(tab, "Apply changes");
        tab.reads("#notice", "Motor 0: the settings are in force.");
        assert_eq!(tab.ask(&value("current_limit_ma")), 800);
        assert_eq!(tab.ask(&value("on_fault")), "brake");
        assert_eq!(tab.ask(&value("bridge.turn_on_ns")), 400);
        assert!(tab.ask(&value("thermal.winding_s")).as_f64() > Some(1.0));
        tab.fill("[id=\"field-emf_mv_s_per_count\"]", "99");
        press(tab, "Apply changes");
        tab.says("#notice", "Not done: emf_mv_s_per_count is 99");
        // What was typed stays until it is in force or discarded.
        tab.press(("1", 49));
        tab.press(("0", 48));
        std::thread::sleep(Duration::from_millis(300));
        assert_eq!(number(tab, "[id=\"field-emf_mv_s_per_count\"]"), 99.0);
        press(tab, "Discard changes");
        assert!(number(tab, "[id=\"field-emf_mv_s_per_count\"]") < 99.0);
        press(tab, "Undo");
        tab.wait(&format!("{} === null && {} === 'coast'", value("current_limit_ma"), value("on_fault")));
    });
}

#[test]
fn the_hub_panel_shows_the_version_and_sets_lamp_and_address() {
    with_page(|tab| {
        tab.click("#tab-hub");
        tab.wait("/version.*HW: 20.*address.*2/.test(document.querySelector('#panel-hub').textContent)");
        tab.fill("#hub-lamp", "#102030");
        // Another look at the hub shows the colour that the hub has.
        tab.click("#tab-group");
        tab.ask("document.querySelector('#hub-lamp').value = '#000000'");
        tab.click("#tab-hub");
        tab.wait("document.querySelector('#hub-lamp').value === '#102030'");
        tab.fill("#hub-address", "9");
        press(tab, "Set");
        tab.says("#notice", "The hub has address 9 ");
        tab.wait("/address.*9/.test(document.querySelector('#panel-hub table').textContent)");
        open(tab, "Faults and resets");
        press(tab, "Clear");
        tab.reads("#notice", "The record of faults is cleared.");
    });
}

#[test]
fn new_firmware_is_chosen_as_a_file_and_its_progress_is_shown() {
    // Once restarted, this hub has no key.
    let server = Server::start(with_slot(Slot { signer: public_key(KEY), ..SLOT }));
    with_page_of(&["--tcp", &server.address], |_, tab| {
        tab.click("#tab-hub");
        open(tab, "New firmware");
        let says = "document.querySelector('#firmware-file').closest('.stack').querySelector('[role=status]').textContent";
        choose(tab, "#firmware-file", "hub.bin", "no firmware");
        tab.wait(&format!("{says}.startsWith('hub.bin: it is no motor-hub firmware')"));
        choose(tab, "#firmware-file", "cut.elf", b"\x7FELF\x01\x01\x01");
        tab.wait(&format!("{says} === 'cut.elf: the ELF file is cut off: build or copy it again.'"));
        let no_slot = [&[0; 100], b"HW: 20, Maj: 1, Min: 0\0".as_slice()].concat();
        choose(tab, "#firmware-file", "hub.bin", no_slot);
        tab.wait(&format!("{says}.startsWith('The firmware is refused: ')"));
        let mut image = image(RUNS);
        image.resize(20_000, 0xA5);
        // An ELF file (32 bits, ARM) with one segment that is loaded to the slot.
        let words = |all: &[u32]| all.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
        let length = u32::try_from(image.len()).unwrap();
        let header =
            [b"\x7FELF\x01\x01\x01".as_slice(), &[0; 9], &words(&[0x28_0002, 1, 0, 52, 0, 0, 0x20_0034, 1])]
                .concat();
        let segment = words(&[1, 84, SLOT.origin, SLOT.origin, length, length, 5, 4]);
        let elf = [&*header, &[0; 4], &segment, &image].concat();
        choose(tab, "#firmware-signature", "hub.sig", SIGNATURE);
        choose(tab, "#firmware-file", "hub.bin", &image);
        tab.wait(&format!("{says}.endsWith('choose the key too.')"));
        choose(tab, "#firmware-key", "public.der", KEY);
        choose(tab, "#firmware-file", "hub.elf", &elf);
        tab.wait(&format!("{says}.includes('a signature needs raw bytes')"));
        choose(tab, "#firmware-file", "hub.bin", &image);
        tab.wait(&format!("{says}.startsWith('The update is done: the hub runs HW')"));
        press(tab, "Neither");
        tab.ask(&format!(
        "(() => {{ window.seen = []; new MutationObserver(() => seen.push({says})).observe(document.querySelector('#firmware-file').closest('.stack'), {{ childList: true, subtree: true, characterData: true }}); \
         }})()"
    ));
        choose(tab, "#firmware-file", "hub.elf", &elf);
        tab.wait(&format!("seen.length && {says}.startsWith('The update is done: the hub runs HW')"));
        tab.wait("seen.some((text) => /^The firmware is sent. [1-9][0-9] %$/.test(text))");
        assert_eq!(
            tab.ask(
                "document.querySelector('#firmware-file').closest('.stack').querySelector('progress').value"
            ),
            100
        );
        assert_eq!(tab.complaints(), Vec::<String>::new());
    });
}

#[test]
fn a_held_button_drives_and_everything_that_releases_it_stops() {
    with_page(|tab| {
        tab.click("#tab-group");
        let turns = format!("{} > 250", motor(0, "velocity"));
        tab.fill("#jog-level", "400");
        let at = point(tab, "#panel-group .jog:last-child", "b.width / 2", "b.height / 2");
        // Released, or with the pointer beside the button, the motor is regulated to a stop.
        for end in ["mouseReleased", "mouseMoved"] {
            mouse(tab, "mousePressed", at);
            tab.wait(&turns);
            mouse(tab, end, (at.0, at.1 + if end == "mouseMoved" { 100.0 } else { 0.0 }));
            tab.wait(&format!("{} === 0 && {} === 0", motor(0, "target"), motor(0, "velocity")));
            assert_eq!(tab.ask(&motor(0, "enabled")), true, "{end}");
            mouse(tab, "mouseReleased", (at.0, at.1 + 100.0));
        }
        // A cancelled touch stops too.
        mouse(tab, "mousePressed", at);
        tab.wait(&turns);
        tab.ask("document.querySelector('#panel-group .jog:last-child').dispatchEvent(new PointerEvent('pointercancel'))");
        tab.wait(&format!("{} === 0", motor(0, "velocity")));
        mouse(tab, "mouseReleased", at);
        // STOP, and a window without the focus, switch the motor off. Releasing the button starts nothing.
        for end in ["STOP", "blur"] {
            mouse(tab, "mousePressed", at);
            tab.wait(&turns);
            if end == "STOP" {
                tab.press(ESCAPE);
            } else {
                tab.ask("dispatchEvent(new Event('blur'))");
            }
            off(tab, Instant::now());
            mouse(tab, "mouseReleased", at);
            std::thread::sleep(Duration::from_millis(200));
            assert_eq!(tab.ask(&motor(0, "enabled")), false, "{end}");
        }
        // Backward, by the key Enter, with all motors.
        tab.fill("#jog-motors", "all");
        focus(tab, "#panel-group .jog");
        let key = |tab: &mut Tab<'_>, kind: &str| {
            tab.call(
                "Input.dispatchKeyEvent",
                json!({ "type": kind, "key": "Enter", "code": "Enter", "windowsVirtualKeyCode": 13 }),
            );
        };
        key(tab, "rawKeyDown");
        tab.wait(&format!("{} < -250 && {} < -250", motor(0, "velocity"), motor(3, "velocity")));
        key(tab, "keyUp");
        tab.wait(&format!("{} === 0 && {} === 0", motor(0, "velocity"), motor(3, "velocity")));
        // A hidden page switches the motors off.
        key(tab, "rawKeyDown");
        tab.wait(&format!("{} < -250", motor(0, "velocity")));
        tab.hide();
        off(tab, Instant::now());
    });
}

#[test]
fn motors_turn_together_at_speeds() {
    with_page(|tab| {
        tab.click("#tab-group");
        for (motor, cps) in [(0, "600"), (1, "-300")] {
            tab.fill(&format!("[aria-label=\"Turn motor {motor} at, counts/s\"]"), cps);
        }
        open(tab, "Several motors in step");
        press(tab, "Turn together");
        tab.wait(&format!("Math.abs({} - 600) < 30", motor(0, "velocity")));
        tab.wait(&format!("Math.abs({} + 300) < 30", motor(1, "velocity")));
        assert_eq!(tab.ask(&motor(2, "enabled")), false);
    });
}
