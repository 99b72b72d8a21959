//! The server of `motor-hub dashboard`, by sockets without a browser: which page may move motors, and when motors stop.

use crate::client_update::{KEY, RUNS, image, with_slot};
use crate::common::{client, err, json as document, scenario, store};
use crate::conformance::Hub;
use crate::hub_support::{Hub as FakeHub, SIGNATURE, SLOT, Server};
use crate::page::{Dashboard, Page};
use motor_hub::extension::settings::Group;
use motor_hub::store::Found;
use motor_hub::update::{Slot, public_key};
use serde_json::{Value, json};
use std::io::{BufRead, Read};
use std::time::{Duration, Instant};
use tungstenite::Message;

#[test]
fn one_page_is_in_control_and_anyone_may_stop() {
    let dashboard = Dashboard::start(&[]);
    let (mut driver, mut viewer) = (Page::ready(&dashboard), Page::ready(&dashboard));
    for (order, fields) in [
        ("drive", json!({ "motor": 0, "mode": "power", "value": 0.1 })),
        ("enable", json!({ "motor": 0, "on": true })),
        ("world", json!({ "battery": { "volts": 7 } })),
        ("set-up", json!({ "motor": 0, "scheme": "B", "duty": "linear-duty" })),
        ("identify", json!({ "motor": 0 })),
        ("hub", json!({ "address": 3 })),
        ("device", json!({ "servo": { "servo": 0, "period_us": 20000, "width_us": 1500, "on": true } })),
    ] {
        assert_eq!(viewer.refused(order, fields), "this page is not in control", "{order}");
    }
    driver.run(0);
    viewer.order("stop", Value::Null);
    driver.off("stopped");
    driver.run(0);
    viewer.order("take", Value::Null);
    driver.until("a request", |_, message| message["kind"] == "control" && message["asks"] == 2);
    driver.stay(Duration::from_millis(300));
    assert!(driver.enabled(0), "a request alone stops nothing");
    assert_eq!(viewer.refused("enable", json!({ "motor": 0, "on": true })), "this page is not in control");
    // A page that releases control leaves no motor enabled, and the page that has asked is in control.
    driver.order("release", Value::Null);
    driver.off("control was released");
    viewer.run(0);
    assert_eq!(driver.refused("enable", json!({ "motor": 0, "on": false })), "this page is not in control");
}

#[test]
fn a_flood_of_another_page_delays_neither_frames_nor_stop() {
    let dashboard = Dashboard::start(&[]);
    let (mut driver, mut viewer) = (Page::ready(&dashboard), Page::ready(&dashboard));
    driver.run(0);
    let begun = Instant::now();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            // The server closes the page if it does not read its answers.
            while begun.elapsed() < Duration::from_secs(4)
                && viewer.connection.send(Message::text("\"export\"")).is_ok()
            {
                viewer.receive();
            }
        });
        let before = driver.frame["number"].as_u64();
        driver.stay(Duration::from_secs(2));
        let frames = driver.frame["number"].as_u64().unwrap_or_default() - before.unwrap_or_default();
        assert!(frames > 40 && driver.enabled(0), "{frames} frames in 2 s");
        let since = Instant::now();
        driver.order("stop", Value::Null);
        driver.off("stopped");
        assert!(since.elapsed() < Duration::from_secs(1), "{:?}", since.elapsed());
    });
}

#[test]
fn a_change_of_settings_is_answered_to_the_page_that_asked_for_it() {
    let dashboard = Dashboard::start(&[]);
    let mut page = Page::ready(&dashboard);
    for (order, fields) in [
        ("set-up", json!({ "motor": 1, "scheme": "B", "duty": "linear-duty" })),
        ("acceleration", json!({ "motor": 1, "limit": 2000 })),
        ("regulator", json!({ "motor": 1, "kind": "pid" })),
        ("coefficients", json!({ "motor": 1, "of": "velocity", "pidf": [1, 0, 0, 0] })),
        ("undo", json!({ "motor": 1 })),
        ("reset-encoder", json!({ "motor": 1 })),
    ] {
        page.order(order, fields);
        let answer =
            page.until(order, |_, message| ["notice", "refused"].iter().any(|kind| message["kind"] == *kind));
        assert!(
            answer["kind"] == "notice" && answer["text"].as_str().unwrap().contains("motor 1"),
            "{answer}"
        );
    }
    page.order("acceleration", json!({ "motor": 1, "limit": 4000.6 }));
    page.notice("motor 1: the acceleration limit is 4001 counts/s²");
}

#[test]
fn a_motor_has_a_constant_current_once_it_is_enabled() {
    let dashboard = Dashboard::start(&[]);
    let mut page = Page::ready(&dashboard);
    page.order("current", json!({ "motor": 0, "amperes": 0.4, "speed": 600, "enable": true }));
    page.until("a constant current", |page, _| {
        let motor = &page.frame["motors"][0];
        motor["setpoint"] == "current" && motor["target"] == 0.4 && motor["velocity"].as_f64() > Some(500.0)
    });
    assert_eq!(page.frame["motors"][0]["current_limited"], false);
}

/// Orders, and words of their refusals.
const OUT_OF_RANGE: &str = r#"
{"drive":{"motor":0,"mode":"power","value":1.5}} | a power of 1.5 is out of range; allowed is -1 to 1
{"drive":{"motor":0,"mode":"velocity","value":40000}} | a velocity of 40000 counts/s is out of range; allowed is -32768 to 32767 counts/s
{"drive":{"motor":0,"mode":"position","value":3e9}} | a position of 3000000000 counts is out of range
{"drive":{"motor":4,"mode":"power","value":0}} | there is no motor 4; allowed is 0 to 3
{"drive":{"motor":0,"mode":"sideways","value":0}} | unknown variant `sideways`
{"drive":{"motor":0,"mode":"power"}} | missing field `value`
{"current":{"motor":0,"amperes":70}} | a current of 70 A is out of range; allowed is -65.535 to 65.535 A
{"enable":{"motor":0,"on":true,"more":1}} | unknown field `more`
{"enable":{"motor":0,"on":true}} | no target set
{"coefficients":{"motor":0,"of":"velocity","pidf":[1e9,0,0,0]}} | a coefficient of 1000000000
{"drive":{"motor":0,"mode":"velocity","value":0,"tolerance":70000}} | a tolerance of 70000 counts is out of range; allowed is 0 to 65535 counts
{"acceleration":{"motor":0,"limit":0}} | an acceleration of 0 counts/s² is out of range; allowed is 1 to 4294967295 counts/s²
{"acceleration":{"motor":0,"limit":-5}} | an acceleration of -5 counts/s² is out of range
{"identify":{"motor":0,"travel":-1}} | a travel of -1 counts is out of range; allowed is 0 to 4294967295 counts
{"together":{"by":[3e9,null,null,null],"speed":1,"acceleration":1}} | a distance of 3000000000 counts is out of range
{"turn":{"at":[null,-2e6,null,null],"acceleration":1}} | a group's speed of -2000000 counts/s is out of range
{"device":{"servo":{"servo":0,"period_us":70000,"width_us":1500,"on":true}}} | a servo's period of 70000 us is out of range; allowed is 0 to 65535 us
{"set-up":{"motor":0,"scheme":"E","duty":"linear-duty"}} | unknown scheme `E`
{"set-up":{"motor":0,"name":"AM 61 A","scheme":"A","duty":"linear-duty"}} | AM 61 A
{"apply":{"motor":0}} | not identified yet
{"undo":{"motor":0}} | nothing to undo
{"together":{"by":[null,null,null,null],"speed":1,"acceleration":1}} | at least one motor
{"together":{"by":[1,null,null,null],"speed":0,"acceleration":1}} | allowed is 1 to 1000000
{"world":{"battery":{"volts":99}}} | a battery of 99 V is out of range; allowed is 0 to 16 V
{"world":{"hold":{"motor":9,"held":true}}} | there is no motor 9
{"world":{"encoder":{"motor":0,"is":"wet"}}} | an encoder is not `wet`
{"device":{"servo":{"servo":6,"period_us":20000,"width_us":1500,"on":true}}} | a servo output is 0 to 5, and not 6
{"device":{"servo":{"servo":0,"period_us":1000,"width_us":1500,"on":true}}} | a pulse of 1500 us is longer than its period of 1000 us; allowed are 1 to 1000 us
{"device":{"pin":{"pin":8,"level":null}}} | a digital pin is 0 to 7, and not 8
{"device":{"write":{"bus":0,"address":40,"bytes":[],"fast":false}}} | 1 to 100
{"device":{"scan":{"bus":4}}} | an I2C bus is 0 to 3, and not 4
{"points":{"motor":0,"scheme":"A","cps":-1,"volts":12}} | a speed of -1 counts/s is out of range; allowed is 0 to 1000000 counts/s
{"points":{"motor":0,"scheme":"A","cps":100,"volts":0.5}} | a battery of 0.5 V is out of range; allowed is 1 to 60 V
{"points":{"motor":0,"scheme":"A","cps":1000000,"volts":12}} | back EMF must be -131.071 to 131.071 V
{"points":{"motor":0,"scheme":"A","cps":100,"volts":61}} | a battery of 61 V is out of range; allowed is 1 to 60 V
{"import":{"text":"schema_version = 1\nmotor = []"}} | there is no [[motor]]
{"explode":null} | unknown variant `explode`
{ | not an order
"#;

#[test]
fn what_is_out_of_range_is_refused_with_what_is_allowed() {
    let dashboard = Dashboard::start(&[]);
    let mut page = Page::ready(&dashboard);
    for case in OUT_OF_RANGE.trim().lines() {
        let (order, says) = case.split_once(" | ").unwrap();
        page.connection.send(Message::text(order)).unwrap();
        let why = page.message("refused")["why"].as_str().unwrap().to_owned();
        assert!(why.contains(says), "{order}: {why}");
    }
    page.run(0);
}

#[test]
fn a_message_that_is_too_long_ends_its_page_and_no_other() {
    let dashboard = Dashboard::start(&[]);
    let (mut driver, mut other) = (Page::ready(&dashboard), Page::ready(&dashboard));
    driver.run(0);
    // The server may close the connection during the request.
    let _ = other.connection.send(Message::text("x".repeat(100_000)));
    driver.until("one page", |_, message| message["kind"] == "control" && message["pages"] == 1);
    driver.stay(Duration::from_millis(500));
    assert!(driver.enabled(0));
}

#[test]
#[ignore = "long: cargo xtask long"]
fn a_scenario_is_played_from_its_beginning_and_leaves_its_motors_off() {
    let winch = concat!(env!("CARGO_MANIFEST_DIR"), "/../../boards/simulated/scenarios/winch.toml");
    let dashboard = Dashboard::start(&["--scenario", winch]);
    let mut page = Page::ready(&dashboard);
    page.order("play", Value::Null);
    let winch = |page: &Page, what: &str| page.frame["motors"][0][what].clone();
    page.until("its speed", |page, _| {
        winch(page, "velocity").as_f64().is_some_and(|cps| (cps - 1360.0).abs() < 30.0)
    });
    assert_eq!(winch(&page, "regime"), "forward");
    // From 4 to 8 s a load of 0.8 N m drives the motor.
    page.until("its load", |page, _| {
        winch(page, "regime") == "braking" && winch(page, "load_a").as_f64() < Some(-0.5)
    });
    page.notice("all motors are disabled: the scenario is over");
    let other = Dashboard::start(&[]);
    let mut page = Page::ready(&other);
    assert!(page.refused("play", Value::Null).contains("start the dashboard with --scenario"));
}

#[test]
fn a_scenario_with_a_constant_current_is_played() {
    let text = "[[motors]]\nlabel = \"a\"\nmotor = \"NeveRest 60\"\n\
        setpoints = [{ at_s = 0, current_a = 0.4, speed_limit_cps = 600 }, { at_s = 1, power = 0.2 }, { at_s = 2, current_a = -0.3 }]\n";
    let dashboard = Dashboard::start(&["--scenario", &scenario("dashboard-current", text)]);
    let mut page = Page::ready(&dashboard);
    page.order("play", Value::Null);
    let why = page.refused("identify", json!({ "motor": 1 }));
    assert_eq!(why, "a scenario is being played: wait for its end, or press STOP");
    for (setpoint, target) in [("current", 0.4), ("power", 0.2), ("current", -0.3)] {
        page.until("a set-point of the scenario", |page, _| {
            let motor = &page.frame["motors"][0];
            let is_target = motor["target"].as_f64().is_some_and(|value| (value - target).abs() < 1e-3);
            motor["enabled"] == true && motor["setpoint"] == setpoint && is_target
        });
    }
}

#[test]
fn a_save_that_the_hub_never_ends_is_reported_after_ten_seconds() {
    let mut hub = FakeHub { ends_accesses: false, ..FakeHub::new() };
    hub.responder.restore(Found::default());
    let server = Server::start(hub);
    let dashboard = Dashboard::start(&["--tcp", &server.address]);
    let mut page = Page::ready(&dashboard);
    page.order("save", Value::Null);
    page.notice("settings are not saved: the hub has not finished");
}

#[test]
fn settings_and_an_address_that_a_page_saves_are_in_force_when_the_hub_starts_again() {
    let store = store("dashboard-saved");
    let of_motor_1 = |message: &Value| message["kind"] == "settings" && message["motor"] == 1;
    let mut dashboard = Dashboard::start(&["--store", &store]);
    let mut page = Page::ready(&dashboard);
    page.order("set-up", json!({ "motor": 1, "name": "CoreHex A", "scheme": "C", "duty": "linear-duty" }));
    page.until("another motor", |_, message| of_motor_1(message) && message["name"] == "Core Hex");
    page.order("save", Value::Null);
    page.notice("settings are saved");
    // Other settings give way to the stored ones, and these to the firmware's own.
    page.order(
        "set-up",
        json!({ "motor": 1, "name": "NeveRest 40", "scheme": "A", "duty": "linear-current" }),
    );
    page.until("a third motor", |_, message| of_motor_1(message) && message["name"] == "NeveRest 40");
    page.order("load", Value::Null);
    page.until("the stored motor", |_, message| of_motor_1(message) && message["name"] == "Core Hex");
    for (given, shown) in [(json!(0), "0"), (json!(255), "255"), (json!(3000), "3000")] {
        let why = page.refused("address", json!({ "new": given }));
        assert_eq!(why, format!("an address is {shown}; allowed is 1 to 254"));
    }
    page.order("address", json!({ "new": 9 }));
    page.notice("the hub has address 9 also after a reset; the stored settings of the motors are kept");
    page.run(0);
    page.stop();
    // The hub writes its address after the answer.
    page.stay(Duration::from_millis(300));
    dashboard.end();

    // The address may be given instead of found.
    let again = Dashboard::start(&["--store", &store, "--address", "9"]);
    let mut page = Page::open(&again);
    let seen = page.until("its settings", |_, message| of_motor_1(message));
    assert_eq!((&seen["name"], &seen["duty"]), (&json!("Core Hex"), &json!("linear-duty")), "{seen}");
    page.order("status", Value::Null);
    let status = page.message("status");
    assert_eq!((&status["address"], &status["differs"]), (&json!(9), &json!(false)), "{status}");
    page.battery();
    page.order("reset", Value::Null);
    page.until("the firmware's settings", |_, message| {
        of_motor_1(message) && message["duty"] != "linear-duty"
    });

    let other = Dashboard::start(&[]);
    let mut page = Page::open(&other);
    assert_eq!(page.line(true)["stores"], false);
    page.message("frame");
    assert!(page.refused("save", Value::Null).contains("store its settings"));
    page.order("address", json!({ "new": 9 }));
    page.notice("the hub has address 9 until the next reset: the hub stores no settings");
}

#[test]
fn an_import_that_the_hub_refuses_half_way_changes_nothing_and_names_the_motor() {
    let mut hub = FakeHub::new();
    // The hub refuses the current limit of motor 2, as if it had no such motor.
    hub.change = |packet| {
        if packet.id == Group::CurrentLimit.set_id() && packet.payload.first() == Some(&2) {
            packet.payload[0] = 9;
        }
    };
    let server = Server::start(hub);
    let dashboard = Dashboard::start(&["--tcp", &server.address]);
    let mut page = Page::ready(&dashboard);
    let before = export(&mut page);
    let after = before.replace("scheme = \"A\"", "scheme = \"B\"");
    assert_ne!(before, after);
    let why = page.refused("import", json!({ "text": after }));
    assert!(
        why.starts_with("motor 2: ") && why.ends_with("; the settings before the import are in force"),
        "{why}"
    );
    assert_eq!(export(&mut page), before);
    assert_eq!(page.refused("undo", json!({ "motor": 0 })), "there is nothing to undo");
    // A file that the hub accepts is in force, and an undo takes it back for its motor.
    server.hub().change = |_| ();
    page.order("import", json!({ "text": after }));
    page.notice("the settings of the file");
    assert_eq!(export(&mut page), after);
    page.order("undo", json!({ "motor": 3 }));
    page.notice("undone");
    assert_eq!(
        export(&mut page),
        [after.rsplit_once("\n[[motor]]").unwrap().0, before.rsplit_once("\n[[motor]]").unwrap().1]
            .join("\n[[motor]]")
    );
}

#[test]
fn motors_of_a_hub_that_is_not_shown_stop_with_the_page() {
    let dashboard = Dashboard::start(&["--hubs", "2"]);
    let mut page = Page::ready(&dashboard);
    page.run(0);
    page.order("hub", json!({ "address": 3 }));
    let runs = |page: &mut Page, motors: [&[u8]; 2]| {
        page.until("the hubs' motors", |_, message| {
            message["kind"] == "hubs"
                && (0..2).all(|hub| message["hubs"][hub]["running"] == json!(motors[hub]))
        });
    };
    page.until("the other hub", |page, message| message["kind"] == "line" && !page.enabled(3));
    page.enable(3);
    runs(&mut page, [&[0], &[3]]);
    assert_eq!(page.refused("hub", json!({ "address": 9 })), "there is no hub 9 on this line");
    drop(page);
    let mut page = Page::open(&dashboard);
    runs(&mut page, [&[], &[]]);
    // Each hub is asked again what it does.
    let asked = Instant::now();
    while asked.elapsed() < Duration::from_secs(1) {
        let message = page.receive().unwrap_or_default();
        assert!((0..2).all(|hub| message["kind"] != "hubs" || message["hubs"][hub]["running"] == json!([])));
    }
}

/// The settings in force as a file.
fn export(page: &mut Page) -> String {
    page.order("export", Value::Null);
    page.message("file")["text"].as_str().unwrap().to_owned()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Sends an image of 3000 bytes more as a page does, with a signature and its key in `seal` or unsigned. Returns the last
/// message of the update.
fn update(page: &mut Page, image: &[u8], seal: Value) -> Value {
    let mut image = image.to_vec();
    image.resize(image.len() + 3000, 0xA5);
    let version = String::from_utf8_lossy(&image[8..]).split('\0').next().unwrap().to_owned();
    for (index, part) in image.chunks(1000).enumerate() {
        page.order("firmware", json!({ "offset": 1000 * index, "hex": hex(part) }));
    }
    page.order("update", json!({ "version": version, "seal": seal }));
    let (mut frames, mut percents) = (0, Vec::new());
    let end = page.until("the update's end", |_, message| {
        frames += u32::from(message["kind"] == "frame");
        if message["kind"] == "refused" {
            return true;
        }
        if message["kind"] == "update" {
            percents.push(message["percent"].as_u64().unwrap());
        }
        message["kind"] == "update" && message["state"] != "running"
    });
    // An image that the hub takes whole.
    if end["percent"] == 100 {
        assert!(percents.is_sorted() && percents.len() > 5, "{percents:?}");
        assert!(frames > 5, "{frames} frames during the update");
    }
    end
}

#[test]
fn new_firmware_is_sent_while_frames_go_on_and_the_page_shows_the_result() {
    let server = Server::start(with_slot(SLOT));
    let dashboard = Dashboard::start(&["--tcp", &server.address]);
    let mut page = Page::ready(&dashboard);
    let done = update(&mut page, &image(RUNS), Value::Null);
    assert!(done["state"] == "done" && done["text"].as_str().unwrap().contains("confirmed"), "{done}");
    let other = update(&mut page, &image("mh9.9.9"), Value::Null);
    assert_eq!(other["state"], "failed");
    assert!(other["text"].as_str().unwrap().contains("but the image sent is HW"), "{other}");
}

#[test]
fn a_hub_with_a_key_takes_only_signed_firmware_from_a_page() {
    let server = Server::start(with_slot(Slot { signer: public_key(KEY), ..SLOT }));
    let dashboard = Dashboard::start(&["--tcp", &server.address]);
    let mut page = Page::ready(&dashboard);
    let seal = |signature: &[u8], key: &[u8]| json!({ "signature": hex(signature), "key": hex(key) });
    for (seal, says) in [
        (Value::Null, "must be signed, and is not"),
        (seal(&[8; 64], KEY), "the signature is not of this file by the hub's key"),
        (seal(&SIGNATURE[1..], KEY), "the signature has 63 bytes; an Ed25519 signature has 64"),
        (seal(&SIGNATURE, b"-----BEGIN"), "the key is not an Ed25519 public key in DER"),
    ] {
        let refused = update(&mut page, &image(RUNS), seal);
        let why = refused["why"].as_str().or(refused["text"].as_str()).unwrap();
        assert!(refused["state"] != "done" && why.contains(says), "{refused}");
    }
    let done = update(&mut page, &image(RUNS), seal(&SIGNATURE, KEY));
    assert!(done["state"] == "done" && done["text"].as_str().unwrap().contains("confirmed"), "{done}");
}

#[test]
fn firmware_for_no_slot_is_refused_before_it_is_sent() {
    let server = Server::start(with_slot(SLOT));
    let dashboard = Dashboard::start(&["--tcp", &server.address]);
    let mut page = Page::ready(&dashboard);
    let elsewhere = [&[0; 8], &image(RUNS)[8..]].concat();
    let refused = update(&mut page, &elsewhere, Value::Null);
    assert!(refused["why"].as_str().unwrap().contains("begins at 0x00000000, outside"), "{refused}");
    let simulated = Dashboard::start(&[]);
    let refused = update(&mut Page::ready(&simulated), &image(RUNS), Value::Null);
    assert!(refused["why"].as_str().unwrap().contains("no bootloader"), "{refused}");
    assert!(
        page.refused("firmware", json!({ "offset": 7, "hex": "00" }))
            .contains("is for byte 7, but must be for byte 0")
    );
}

#[test]
fn a_hub_elsewhere_is_driven_and_left_with_its_motors_off_when_the_program_ends() {
    let hub = Hub::served();
    let mut dashboard = Dashboard::start(&["--tcp", &hub.place]);
    let mut page = Page::ready(&dashboard);
    page.run(0);
    dashboard.end();
    drop(page);
    std::thread::sleep(Duration::from_millis(300));
    let status = client(&hub, &["status", "--json"]);
    assert!(!err(&status).contains("left running"), "{}", err(&status));
    let status = document(&status);
    let motor = &status["motors"][0];
    assert_eq!(motor["enabled"], false);
    assert!((motor["power"].as_f64().unwrap() - 0.3).abs() < 1e-4, "its target is kept: {motor}");
}

#[test]
fn a_lost_hub_is_reported_and_found_again() {
    let hub = Hub::served();
    let place = hub.place.clone();
    let dashboard = Dashboard::start(&["--tcp", &place]);
    let mut page = Page::ready(&dashboard);
    drop(hub);
    page.line(false);
    assert_eq!(page.refused("enable", json!({ "motor": 0, "on": true })), "the hub is not connected");
    // The page has nothing to show meanwhile, so it keeps control.
    page.stay(Duration::from_millis(1500));
    let _again = Hub::start(&["--tcp", &place]);
    page.until("a hub", |_, message| {
        assert_ne!(message["kind"], "control", "{message}");
        message["kind"] == "line" && message["connected"] == true
    });
    page.message("frame");
    page.run(0);
}

#[test]
fn a_page_for_other_machines_prints_its_url_as_a_square_code() {
    let mut dashboard = Dashboard::start(&["--listen", "127.0.0.1:0"]);
    let mut lines = dashboard.output.by_ref().lines().map(Result::unwrap);
    let first = lines.next().unwrap();
    let width = first.chars().count();
    // Two rows of modules are a line. The margin of four modules is light.
    let rows: Vec<String> = std::iter::once(first).chain(lines.take(width.div_ceil(2) - 1)).collect();
    assert!(dashboard.url.starts_with("http://127.0.0.1:") && width >= 21 + 8, "{}", dashboard.url);
    assert!(rows.iter().all(|row| row.chars().count() == width && row.starts_with("████")), "{rows:#?}");
    assert!(rows.iter().take(2).all(|row| row.chars().all(|module| module == '█')), "{rows:#?}");
    // The corner of the first finder pattern: a dark line over a light one.
    assert!(rows[2].starts_with("████ ▄▄▄▄▄ "), "{}", rows[2]);
}

#[test]
fn a_hub_of_another_maker_is_driven_and_values_that_it_does_not_report_are_left_out() {
    let server = Server::start(FakeHub { foreign: true, ..FakeHub::new() });
    let dashboard = Dashboard::start(&["--tcp", &server.address]);
    let mut page = Page::open(&dashboard);
    assert_eq!(page.line(true)["reports"], false, "the plots of its values stay empty");
    let frame = page.message("frame");
    assert_eq!((&frame["battery_v"], &frame["bus"]), (&json!(12.345), &Value::Null));
    let motor = &frame["motors"][0];
    assert_eq!(motor["enabled"], false);
    assert!(motor["control"].is_null() && motor["points"].is_null(), "{motor}");

    page.order("drive", json!({ "motor": 0, "mode": "velocity", "value": 300 }));
    page.order("enable", json!({ "motor": 0, "on": true }));
    page.until("a motor that runs", |page, _| page.enabled(0));
    let motor = &page.frame["motors"][0];
    assert_eq!((&motor["setpoint"], &motor["target"]), (&json!("velocity"), &json!(300.0)));
    let why = page.refused("current", json!({ "motor": 0, "amperes": 0.5 }));
    assert!(why.contains("regulates no current"), "{why}");
    page.order("identify", json!({ "motor": 0 }));
    let end = page
        .until("an end", |_, message| message["kind"] == "refused" || message["kind"] == "identification");
    assert!(end["why"].as_str().unwrap().contains("refuses"), "{end}");
    page.order("stop", Value::Null);
    page.until("a disabled motor", |page, _| !page.enabled(0));
}
