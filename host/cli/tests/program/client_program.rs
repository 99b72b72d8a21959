//! `motor-hub client` against the hub's own side of the protocol, over TCP.

use crate::common::{err, fails, folder, json, motor_hub, out, printed, signal, start_client, wait_for};
use crate::hub_support::{Hub, Server};
use motor_hub::extension::Request;
use motor_hub::protocol::motor::ToMotor;
use motor_hub::regulator::Kind;
use motor_hub::supply::DrawStage;
use motor_hub::units::{CountsPerSecond, EmfConstant, Milliamperes, Millivolts};
use serde_json::Value;
use std::process::Output;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

pub(crate) fn client(server: &Server, arguments: &[&str]) -> Output {
    program(&[&["--tcp", &server.address, "--address", "3"], arguments].concat())
}

fn program(arguments: &[&str]) -> Output {
    motor_hub(&[&["client"], arguments].concat())
}

#[test]
fn the_program_finds_a_hub_and_shows_its_status() {
    let server = Server::start(Hub::new());
    let found = out(&program(&["discover", "--tcp", &server.address]));
    assert!(found.contains("parent") && found.contains('3'), "{found}");

    let status = json(&program(&["--tcp", &server.address, "status", "--json", "--clear"]));
    assert_eq!(status["address"], 3);
    assert_eq!(status["status"], serde_json::json!(["device reset"]));
    assert_eq!(status["battery_v"], 12.345);
    let version = status["version"].as_str().unwrap();
    assert!(version.starts_with("HW: 20, Maj: 1, Min: 8, Eng: 2, mh0."), "{version}");
    assert_eq!(status["motors"].as_array().unwrap().len(), 4);
    assert_eq!(status["motors"][3]["mode"], "power");

    let text = out(&client(&server, &["status"]));
    for says in ["no alerts", "12.345 V", "brake", "target velocity", "Maj: 1"] {
        assert!(text.contains(says), "{says}: {text}");
    }
}

#[test]
fn the_program_sets_and_shows_coefficients() {
    let mut hub = Hub::new();
    // The hub of this test does no control tick, so its report does not follow the coefficients.
    hub.snapshot.motors[2].regulator = Kind::Pid;
    let server = Server::start(hub);
    let read = ["coefficients", "2", "velocity", "--json"];
    let before = json(&client(&server, &read));
    let after = json(&client(&server, &[&read[..], &["--i", "-0.5", "--f", "12.25"]].concat()));
    assert_eq!((&after["i"], &after["f"]), (&(-0.5).into(), &12.25.into()));
    assert_eq!((&after["p"], &after["d"]), (&before["p"], &before["d"]));
    assert_eq!(json(&client(&server, &read)), after);
    let table = out(&client(&server, &["coefficients", "2", "velocity"]));
    assert!(table.contains("-0.500000") && table.contains("12.250000"), "{table}");
}

#[test]
fn the_set_up_of_a_motor_is_shown_and_changed() {
    let mut hub = Hub::new();
    hub.snapshot.motors[1].emf_constant = EmfConstant::from_bits(3 << 20).ok();
    let server = Server::start(hub);
    let set_up = |options: &[&str]| json(&client(&server, &[&["setup", "1", "--json"], options].concat()));
    let before = set_up(&[]);
    assert_eq!((&before["scheme"], &before["duty"]), (&"A".into(), &"linear-current".into()));
    assert_eq!(before["emf_in_force_mv_s_per_count"], 3.0);
    let after = set_up(&["--type", "AM 40 C", "--scheme", "D", "--blend", "0.5"]);
    assert_eq!((&after["scheme"], &after["blend"]), (&"D".into(), &0.5.into()));
    assert_ne!(after["emf_mv_s_per_count"], before["emf_mv_s_per_count"]);
    assert_eq!(set_up(&[]), after);
    // Another scheme does not change the motor's constants.
    let duty = set_up(&["--duty", "linear-duty", "--scheme", "B"]);
    assert_eq!((&duty["duty"], &duty["scheme"]), (&"linear-duty".into(), &"B".into()));
    assert_eq!(duty["emf_mv_s_per_count"], after["emf_mv_s_per_count"]);
    // A duty rule that does not use the winding does not change them either.
    let back = set_up(&["--duty", "linear-current"]);
    assert_eq!((&back["duty"], &back["on_fault"]), (&"linear-current".into(), &"coast".into()));
    for known in ["emf_mv_s_per_count", "resistance_ohm", "inductance_mh"] {
        assert_eq!(back[known], after[known], "{known}");
    }
    let braking = set_up(&["--on-fault", "brake"]);
    assert_eq!((&braking["on_fault"], &braking["scheme"]), (&"brake".into(), &"B".into()));
    assert_eq!((&braking["heat_percent"], &braking["derated"]), (&0.0.into(), &false.into()));
    // The named motor's continuous current is still configured. It can be reset, and so can the bridge's timing.
    assert_eq!(braking["continuous_current_a"], 1.904);
    let free = set_up(&["--continuous-current-a", "0", "--bridge", "vnh5019"]);
    assert_eq!((&free["continuous_current_a"], &free["bridge"]), (&Value::Null, &"vnh5019".into()));
    assert!(err(&client(&server, &["setup", "1", "--continuous-current-a", "70"])).contains("65.535"));
    assert_eq!(free["current_limit_a"], Value::Null);
    let limited = set_up(&["--current-limit-a", "0.8"]);
    assert_eq!((&limited["current_limit_a"], &limited["scheme"]), (&0.8.into(), &"B".into()));
    assert!(out(&client(&server, &["setup", "1"])).contains("0.800 A"));
    assert_eq!(set_up(&["--current-limit-a", "0"])["current_limit_a"], Value::Null);
    let unknown = client(&server, &["setup", "1", "--type", "AM 41"]);
    assert!(err(&unknown).contains("NeveRest 40"), "{}", err(&unknown));
    let table = out(&client(&server, &["setup", "0"]));
    assert!(table.contains("3.300 ohm") && table.contains("scheme A"), "{table}");
}

#[test]
fn a_reset_of_the_hub_ends_identify_and_tune_with_an_error_that_names_the_reset() {
    for command in ["identify", "tune"] {
        // The hub of this test does no control tick. As after a reset, it knows no identification.
        let server = Server::start(Hub::new());
        let ended = client(&server, &[command, "0"]);
        fails(&ended, 1, "motor 0 was not identified: the hub was reset");
        assert!(!printed(&ended).contains("in force"), "{}", printed(&ended));
    }
}

#[test]
fn a_motor_that_the_catalogue_lacks_is_set_up_by_its_constants() {
    let server = Server::start(Hub::new());
    let show = ["setup", "2", "--json"];
    let set_up = |options: &[&str]| json(&client(&server, &[&show, options].concat()));
    let before = set_up(&[]);
    let shaft = ["--ke-v-s-per-rad", "0.02", "--counts-per-rev", "12"];
    let after = set_up(&[&shaft[..], &["--resistance-ohm", "2.5", "--inductance-mh", "0.8"]].concat());
    // 2000 pi Ke / counts.
    assert!((after["emf_mv_s_per_count"].as_f64().unwrap() - 10.471_976).abs() < 1e-5, "{after}");
    assert_eq!((&after["resistance_ohm"], &after["inductance_mh"]), (&2.5.into(), &0.8.into()));
    assert_eq!((&after["scheme"], &after["duty"]), (&before["scheme"], &before["duty"]));
    // A single constant leaves the others. The name of a motor may be the name it is sold under.
    let ohms = set_up(&["--resistance-ohm", "3"]);
    assert_eq!(
        (&ohms["emf_mv_s_per_count"], &ohms["resistance_ohm"]),
        (&after["emf_mv_s_per_count"], &3.0.into())
    );
    let named = set_up(&["--type", "neverest 60"]);
    assert_eq!(named["resistance_ohm"], 3.3);
    // A wrong option changes nothing, not even by options before it.
    for (wrong, says) in [
        (
            &["--ke-v-s-per-rad", "9", "--counts-per-rev", "12"][..],
            "--ke-v-s-per-rad 9 is out of range; with --counts-per-rev 12 allowed is above 0 and below 0.0611 V s/rad",
        ),
        (
            &["--resistance-ohm", "0", "--on-fault", "brake"],
            "a resistance is a number from 0.001 to 65.535 ohm",
        ),
        (&["--ke-v-s-per-rad", "0.02"], "--counts-per-rev"),
        (
            &["--ke-v-s-per-rad", "0.02", "--counts-per-rev", "0"],
            "an encoder's resolution is a number from 1 to 1000000 counts in a turn",
        ),
        (&["--ke-v-s-per-rad", "0.02", "--counts-per-rev", "12", "--type", "AM 60 A"], "cannot be used with"),
    ] {
        fails(&client(&server, &[&show[..], wrong].concat()), 2, says);
        assert_eq!(set_up(&[]), named, "{wrong:?}");
    }
}

#[test]
fn a_recording_has_the_current_of_hubs_that_measure_it() {
    let mut hub = Hub::new();
    hub.snapshot.motors[1].measured = Some(Milliamperes::new(1_250));
    let server = Server::start(hub);
    let folder = folder("current");
    let to = folder.to_str().unwrap();
    out(&client(
        &server,
        &["record", "--out", to, "--rate-hz", "100", "--", "power", "1", "0.5", "--for-s", "0.2"],
    ));
    let text = std::fs::read_to_string(folder.join("record.csv")).unwrap();
    assert!(
        text.lines().count() > 5 && text.lines().skip(1).all(|row| row.ends_with(",1.250,false,2")),
        "{text}"
    );
    let svg = std::fs::read_to_string(folder.join("motor-1.svg")).unwrap();
    assert!(svg.contains("magnitude of the motor current"));
}

#[test]
fn motors_run_for_the_time_asked_for_and_are_disabled_then() {
    let mut hub = Hub::new();
    hub.snapshot.motors.iter_mut().for_each(|motor| motor.velocity = CountsPerSecond::new(-300));
    let server = Server::start(hub);
    let begin = Instant::now();
    let shown = out(&client(&server, &["velocity", "0,2", "-300", "--for-s", "0.3", "--float"]));
    assert!(begin.elapsed() >= Duration::from_millis(300));
    assert!(shown.contains("motor 0") && shown.contains("motor 2"), "{shown}");
    let hub = server.hub();
    assert_eq!(hub.was_enabled, [true, false, true, false]);
    assert_eq!(hub.responder.enabled(), [false; 4]);
    drop(hub);
    let status = json(&client(&server, &["status", "--json"]));
    let motor = &status["motors"][2];
    assert_eq!((&motor["mode"], &motor["zero_behaviour"]), (&"velocity".into(), &"float".into()));
    assert_eq!((&motor["target_velocity"], &motor["enabled"]), (&(-300).into(), &false.into()));
}

#[test]
fn a_constant_current_needs_a_hub_of_this_project() {
    let server = Server::start(Hub { foreign: true, ..Hub::new() });
    fails(&client(&server, &["current", "0", "0.5"]), 1, "the hub regulates no current");
    assert_eq!(server.hub().was_enabled, [false; 4]);
}

#[test]
fn a_position_ends_at_its_target_or_fails_in_time() {
    let mut hub = Hub::new();
    hub.snapshot.motors.iter_mut().for_each(|motor| (motor.position, motor.settled) = (1000, true));
    let server = Server::start(hub);
    assert!(out(&client(&server, &["position", "all", "1004"])).ends_with("settled at the target\n"));
    assert_eq!(server.hub().was_enabled, [true; 4]);
    assert_eq!(server.hub().responder.enabled(), [false; 4]);

    server.hub().snapshot.motors[1].settled = false;
    fails(
        &client(&server, &["position", "1", "-2000", "--tolerance-counts", "0", "--for-s", "0.2"]),
        1,
        "target not reached after 0.2 s",
    );
    assert_eq!(server.hub().responder.enabled(), [false; 4]);
}

#[test]
fn a_motor_that_the_hub_disables_ends_the_command() {
    let server = Server::start(Hub { fail_safe_at_bulk: true, ..Hub::new() });
    let output = client(&server, &["power", "1", "0.5"]);
    fails(&output, 1, "disabled motor 1");
    fails(&output, 1, "fail-safe");
}

#[test]
fn the_reason_of_a_refusal_is_shown() {
    let mut hub = Hub::new();
    hub.snapshot.battery = Some(Millivolts::new(6_000));
    hub.snapshot.draw_stage = DrawStage::Derated;
    let server = Server::start(hub);
    let output = client(&server, &["power", "0", "0.5", "--for-s", "5"]);
    fails(&output, 1, "enable motor 0: battery unknown, below 7 V, or not at 7.5 V again (NACK 52)");
    fails(&output, 1, &server.address);
}

/// Starts a command that drives motor 0, makes the hub ignore all requests, and signals the command to end.
fn interrupted_on_a_deaf_hub(timeout: &str) -> (Server, std::process::Child) {
    let server = Server::start(Hub::new());
    let arguments = ["--address", "3", "--timeout-ms", timeout, "power", "0", "0.5"];
    let process = start_client(&server.address, &arguments);
    wait_for("an enabled motor", || server.hub().was_enabled[0].then_some(()));
    std::thread::sleep(Duration::from_millis(200));
    server.hub().deaf_for = u32::MAX;
    std::thread::sleep(Duration::from_millis(200));
    signal(process.id(), "-INT");
    (server, process)
}

#[test]
fn a_motor_that_could_not_be_disabled_is_warned_of() {
    let (_server, process) = interrupted_on_a_deaf_hub("300");
    let begin = Instant::now();
    let output = process.wait_with_output().unwrap();
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
    let says = err(&output);
    assert!(says.contains("warning: motor 0 could not be disabled") && says.contains("2.5 s"), "{says}");
}

#[test]
fn a_program_that_hangs_is_ended_by_another_signal_later() {
    let (_server, mut process) = interrupted_on_a_deaf_hub("60000");
    std::thread::sleep(Duration::from_millis(3300));
    assert!(process.try_wait().unwrap().is_none(), "it waits for the hub");
    signal(process.id(), "-INT");
    let begin = Instant::now();
    assert_eq!(process.wait().unwrap().code(), Some(1));
    assert!(begin.elapsed() < Duration::from_secs(1));
}

#[test]
fn single_commands_do_what_they_say() {
    let mut hub = Hub::new();
    hub.snapshot.motors[1].position = 55;
    let server = Server::start(hub);
    out(&client(&server, &["reset-encoder", "1"]));
    out(&client(&server, &["led", "9", "8", "7"]));
    out(&client(&server, &["stop"]));
    let status = json(&client(&server, &["status", "--json"]));
    assert_eq!(status["motors"][1]["position"], 0);
    assert_eq!(status["led"], serde_json::json!({ "red": 9, "green": 8, "blue": 7 }));
    assert_eq!(status["status"], serde_json::json!(["device reset", "fail-safe"]));
    out(&client(&server, &["set-address", "200"]));
    assert_eq!(server.hub().responder.address().get(), 200);
}

#[test]
fn watching_gives_a_document_per_interval() {
    let mut hub = Hub::new();
    hub.snapshot.motors[1].velocity = CountsPerSecond::new(840);
    let server = Server::start(hub);
    let watch = ["watch", "--interval-ms", "50", "--for-s", "0.2", "--type", "NeveRest 60"];
    let shown = out(&client(&server, &watch));
    let lines: Vec<Value> = shown.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!((2..=4).contains(&lines.len()), "{shown}");
    assert_eq!(lines[0]["battery_v"], 12.345);
    let motor = &lines[0]["motors"][1];
    assert_eq!((&motor["velocity"], &motor["rpm"]), (&840.into(), &30.0.into()));
    assert!((motor["rad_per_s"].as_f64().unwrap() - std::f64::consts::PI).abs() < 1e-3, "{motor}");
    assert_eq!(lines[0]["motors"].as_array().unwrap().len(), 4);
}

#[test]
fn without_a_hub_the_program_fails_within_the_timeout() {
    let server = Server::start(Hub { deaf_for: u32::MAX, ..Hub::new() });
    for (arguments, says) in [
        (&["status"][..], "no hub answers"),
        (&["--address", "3", "status"], "hub 3 does not answer"),
        (&["discover"], "no hub answers"),
    ] {
        let begin = Instant::now();
        let output = program(&[&["--tcp", &server.address, "--timeout-ms", "150"], arguments].concat());
        fails(&output, 1, says);
        fails(&output, 1, &server.address);
        assert!(begin.elapsed() < Duration::from_secs(2), "{arguments:?}");
    }
    let file = program(&["--port", "/dev/null", "status"]);
    assert!(err(&file).contains("/dev/null: is not a serial port"), "{}", err(&file));
    fails(&program(&["--port", "/no/such/port", "status"]), 1, "/no/such/port");
    assert!(out(&program(&["ports"])).contains("erial ports"));
}

#[test]
fn a_motor_with_the_address_of_its_hub_is_sought_at_that_hub_by_every_command() {
    let server = Server::start(Hub::new());
    let folder = folder("another-hub");
    let record = ["record", "--out", folder.to_str().unwrap(), "--", "power", "4:1", "0"];
    for arguments in [
        &["power", "4:1", "0"][..],
        &["together", "4:0=1", "4:1=2"],
        &["coefficients", "4:1", "velocity"],
        &["setup", "4:1"],
        &["identify", "4:1"],
        &["reset-encoder", "4:1"],
        &record,
    ] {
        let options = ["--tcp", &server.address, "--timeout-ms", "100"];
        fails(&program(&[&options, arguments].concat()), 1, "hub 4 does not answer");
    }
}

#[test]
fn a_motion_that_a_reset_has_ended_names_the_reset() {
    let enable: Request = ToMotor::SetEnable { on: true }.to(0);
    let mut hub = Hub::running_for(60_000);
    let enabling =
        hub.lose_replies(move |packet| packet.id == enable.id() && packet.payload.as_slice() == [0, 1]);
    let server = Server::start(hub);
    let process = start_client(&server.address, &["velocity", "0", "400"]);
    wait_for("a motor that is enabled", || enabling.load(Ordering::Relaxed).then_some(()));
    *server.hub() = Hub::running_for(20);
    fails(&process.wait_with_output().unwrap(), 1, "the hub was reset meanwhile");
}
