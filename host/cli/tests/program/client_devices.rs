//! `motor-hub client drive`, `odometry`, `servo`, `analog`, `digital` and `i2c` against a served hub.

use crate::client_program::client as fake_client;
use crate::common::{self, BASE, client, driving, err, fails, folder, out, scan, scenario, wait_for};
use crate::conformance::Hub;
use crate::hub_support::{Hub as FakeHub, Server};
use motor_hub::board::{Equipment, SERVOS};
use serde_json::{Value, json};
use std::thread::sleep;
use std::time::Duration;

/// A served hub with devices.
fn served(test: &str, attached: &str) -> Hub {
    let battery = "battery = { emf_v = 12, resistance_ohm = 0.1 }";
    let text =
        format!("{battery}\n[attached]\n{attached}\n[[motors]]\nlabel = \"a\"\nmotor = \"NeveRest 60\"\n");
    Hub::served_with(&["--scenario", &scenario(test, &text)])
}

fn document(hub: &Hub, arguments: &[&str]) -> Value {
    common::json(&client(hub, &[arguments, &["--json"]].concat()))
}

#[test]
fn a_scan_lists_the_devices_of_a_hub() {
    let hub = Hub::served();
    let notes = folder("devices-notes");
    let text = out(&scan(&notes, &[&hub.place]));
    for has in ["6 servos", "4 analog inputs", "8 digital pins", "4 I2C buses"] {
        assert!(text.contains(has), "{text}");
    }
    let document = common::json(&scan(&notes, &[&hub.place, "--json"]));
    let expected = json!({
        "servos": 6, "analog_inputs": 4, "digital_pins": [0, 1, 2, 3, 4, 5, 6, 7], "i2c_buses": 4,
        "measures_rail": true, "measures_temperature": true,
    });
    assert_eq!(document["places"][0]["hubs"][0]["has"], expected, "{document}");
}

#[test]
fn analog_and_digital_inputs_are_shown() {
    let hub = served("devices-inputs", "analog_v = [1.25]\nlow_pins = [3]");
    let analog = document(&hub, &["analog"]);
    let volts = |key: &str| analog[key].as_f64().unwrap();
    assert!((volts("input_0_v") - 1.25).abs() < 0.003 && volts("input_1_v") == 0.0, "{analog}");
    assert!((volts("rail_v") - 5.02).abs() < 0.01 && (volts("battery_v") - 12.0).abs() < 0.1, "{analog}");
    assert!((volts("temperature_c") - 31.2).abs() < 0.01, "{analog}");
    let text = out(&client(&hub, &["analog"]));
    assert!(
        text.contains("analog input 0") && text.contains("31.2 \u{b0}C") && text.contains("1.249 V"),
        "{text}"
    );
    let digital = document(&hub, &["digital"]);
    let levels: Vec<&Value> = digital["pins"].as_array().unwrap().iter().map(|pin| &pin["high"]).collect();
    assert_eq!(
        levels,
        [true, true, true, false, true, true, true, true].map(|high| json!(high)).iter().collect::<Vec<_>>()
    );
}

#[test]
fn a_base_drives_by_its_gyro_and_reports_its_position() {
    let motor = |label| format!("[[motors]]\nlabel = \"{label}\"\nmotor = \"NeveRest 60\"\n");
    let hub = served("devices-base", &format!("[floor]\nslip_in_turns = 0.05\n{}", motor("left")));
    let failed = client(&hub, &["odometry"]);
    fails(&failed, 1, "no drive base is configured (NACK 82)");
    fails(&client(&hub, &["drive", "turn=30"]), 2, "the hub has no drive base; give --wheel-diameter-mm");
    let done = out(&client(&hub, &[&["drive", "turn=30", "straight=-50", "--use-gyro"], &BASE[..]].concat()));
    assert!(done.ends_with("degrees by the gyro\n"), "{done}");
    let at = document(&hub, &["odometry"]);
    let value = |key: &str| at[key].as_f64().unwrap();
    assert!((value("heading_degrees") - 30.0).abs() < 0.5 && at["gyro"] == "good", "{at}");
    // 50 mm backward along this heading.
    assert!((value("x_mm") + 43.3).abs() < 2.0 && (value("y_mm") + 25.0).abs() < 2.0, "{at}");
    let wheels = at["counts"].as_array().unwrap().iter().map(|counts| counts.as_f64().unwrap());
    // 30 degrees are 467 counts of each wheel, and 50 mm are 297.
    for (counts, expected) in wheels.zip([-467.0 - 297.0, 467.0 - 297.0]) {
        assert!((counts - expected).abs() < 10.0, "{at}");
    }
    // The hub's base goes on.
    let done = out(&client(&hub, &["drive", "turn=-30"]));
    assert!(done.ends_with("degrees by the gyro\n"), "{done}");
    let heading = document(&hub, &["odometry"])["heading_degrees"].as_f64().unwrap();
    assert!(heading.abs() < 0.5, "{heading}");
}

#[test]
fn the_wheels_of_a_base_that_move_by_no_counts_do_not_turn_it() {
    let motor = "[[motors]]\nlabel = \"left\"\nmotor = \"NeveRest 60\"\n";
    let hub = served("devices-base-by", &format!("[floor]\nslip_in_turns = 0.1\n{motor}"));
    out(&client(&hub, &[&["drive", "turn=90", "--use-gyro"], &BASE[..]].concat()));
    let heading = || document(&hub, &["odometry"])["heading_degrees"].as_f64().unwrap();
    let before = heading();
    out(&client(&hub, &["together", "0=0", "1=0", "--by"]));
    assert!((heading() - before).abs() < 0.5, "{} degrees, {before} before", heading());
}

#[test]
fn a_drive_warns_of_its_own_losses_of_the_gyro_only() {
    let changes = "over_time = [{ at_s = 4, i2c_faults = [\"no-acknowledge\"] }, { at_s = 4.5, i2c_faults = [\"none\"] }]";
    let motor = "[[motors]]\nlabel = \"left\"\nmotor = \"NeveRest 60\"\n";
    let hub = served("devices-gyro-lost", &format!("{changes}\n[floor]\nslip_in_turns = 0.05\n{motor}"));
    out(&client(&hub, &[&["drive", "turn=5", "--use-gyro"], &BASE[..]].concat()));
    wait_for("a gyro that is good again", || {
        let at = document(&hub, &["odometry"]);
        (at["gyro_losses"] == 1 && at["gyro"] == "good").then_some(())
    });
    let driven = client(&hub, &["drive", "turn=5"]);
    assert_eq!(
        (out(&driven).contains("by the gyro, gyro lost 1 times"), err(&driven)),
        (true, String::new())
    );
}

#[test]
fn analog_inputs_pins_and_buses_change_while_a_hub_is_served() {
    let changes = "over_time = [{ at_s = 0.6, analog_v = [0.5, 2.5], low_pins = [1], i2c_faults = [\"no-acknowledge\"] }]";
    let hub = served("devices-over-time", &format!("analog_v = [1.25]\nlow_pins = [3]\n{changes}"));
    let low = |hub: &Hub| {
        document(hub, &["digital"])["pins"].as_array().unwrap().iter().position(|pin| pin["high"] == false)
    };
    wait_for("pin 1 low", || (low(&hub) == Some(1)).then_some(()));
    let analog = document(&hub, &["analog"]);
    assert!((analog["input_1_v"].as_f64().unwrap() - 2.5).abs() < 0.003, "{analog}");
    fails(&client(&hub, &["i2c", "read", "0", "0x28"]), 1, "acknowledge");
}

#[test]
fn a_servo_and_an_output_are_on_while_their_commands_run() {
    let hub = served("devices-outputs", "");
    let done = out(&client(&hub, &["servo", "2", "1500", "--for-s", "0.3"]));
    assert_eq!(done, "servo 2: pulses of 1500 us every 20000 us\n");
    let servo = json!({ "servo": 2, "period_us": 20_000, "width_us": 1500, "enabled": false });
    assert_eq!(document(&hub, &["servo", "2"])["servos"], json!([servo]));
    assert_eq!(document(&hub, &["servo"])["servos"].as_array().map(Vec::len), Some(6));
    assert_eq!(out(&client(&hub, &["digital", "5", "low", "--for-s", "0.1"])), "digital pin 5 is low\n");
    let pin = json!({ "pin": 5, "direction": "input", "high": true });
    assert_eq!(document(&hub, &["digital", "5"])["pins"], json!([pin]));
    assert_eq!(document(&hub, &["servo", "0"])["servos"][0]["width_us"], 0);
}

#[test]
fn ctrl_c_is_no_failure_of_a_command_that_keeps_an_output_on_without_a_duration() {
    let hub = Hub::served();
    for (arguments, code, says) in [
        (&["servo", "1", "1500"][..], 0, ""),
        (&["digital", "5", "low"], 0, ""),
        (&["servo", "1", "1500", "--for-s", "60"], 1, "error: stopped by Ctrl-C\n"),
    ] {
        let process = driving(&hub, arguments);
        common::signal(process.id(), "-INT");
        let output = process.wait_with_output().unwrap();
        assert_eq!((output.status.code(), &*err(&output)), (Some(code), says), "{arguments:?}");
        assert_eq!(document(&hub, &["servo", "1"])["servos"][0]["enabled"], false);
    }
}

#[test]
fn the_servo_and_the_output_of_a_killed_host_are_switched_off_by_the_next_command() {
    let hub = Hub::served_with(&["--wire", "4,5"]);
    for (arguments, says) in [
        (["servo", "1", "1500"], "disabled servo 1, left running by another host\n"),
        (["digital", "5", "low"], "released digital pin 5, left as output by another host\n"),
    ] {
        let mut process = driving(&hub, &arguments);
        common::signal(process.id(), "-KILL");
        process.wait().unwrap();
        let asked = client(&hub, &["status"]);
        assert_eq!(err(&asked), says);
        assert_eq!(document(&hub, &["servo", "1"])["servos"][0]["enabled"], false);
        // The wire to pin 5 would pull pin 4 low.
        let pins = document(&hub, &["digital"]);
        assert_eq!(
            (&pins["pins"][4]["high"], &pins["pins"][5]["direction"]),
            (&json!(true), &json!("input"))
        );
    }
}

#[test]
fn a_command_fails_when_the_hub_has_switched_its_output_off() {
    // One hub for each command: a hub keeps the events of its status.
    let commands = [["servo", "1", "1500", "--for-s", "10"], ["digital", "5", "low", "--for-s", "10"]];
    let hubs = commands.map(|_| Hub::served());
    let kept = [0, 1].map(|index| driving(&hubs[index], &commands[index]));
    kept.iter().for_each(|process| common::signal(process.id(), "-STOP"));
    // The hub's keep-alive ends after 2.5 s.
    sleep(Duration::from_secs(3));
    kept.iter().for_each(|process| common::signal(process.id(), "-CONT"));
    for process in kept {
        let output = process.wait_with_output().unwrap();
        fails(&output, 1, "the hub has switched the output off; hub status: keep-alive timeout");
    }
}

#[test]
fn an_output_is_released_when_the_answer_to_its_switch_on_is_lost() {
    let mut hub = FakeHub::new();
    let equipment = Equipment { servos: SERVOS as u8, digital: u8::MAX, ..Equipment::default() };
    hub.responder.outputs.equipment = equipment;
    // The answers to "enable servo 2" and to "output of pin 5" are lost.
    hub.loses_reply = Box::new(|packet| {
        packet.id == 0x1023 && packet.payload[..] == [2, 1]
            || packet.id == 0x1003 && packet.payload[..] == [5, 1]
    });
    let server = Server::start(hub);
    for (switch_on, state) in [
        (
            ["servo", "2", "1500"],
            json!({ "servo": 2, "period_us": 20_000, "width_us": 1500, "enabled": false }),
        ),
        (["digital", "5", "low"], json!({ "pin": 5, "direction": "input", "high": true })),
    ] {
        let arguments = [&["--timeout-ms", "300"], &switch_on[..], &["--for-s", "0.1"]].concat();
        fails(&fake_client(&server, &arguments), 1, "does not answer");
        let [what, number, _] = switch_on;
        let document = common::json(&fake_client(&server, &[what, number, "--json"]));
        assert_eq!(document[format!("{what}s").replace("digitals", "pins")], json!([state]));
    }
}

#[test]
fn i2c_devices_are_found_read_and_written() {
    let hub = served("devices-i2c", "i2c_faults = [\"none\", \"none\", \"stuck-clock\"]");
    // A BNO055 answers 0.65 s after its supply is on.
    sleep(Duration::from_millis(700));
    let found = document(&hub, &["i2c", "scan"]);
    let devices: Vec<&Value> = found["buses"].as_array().unwrap().iter().map(|bus| &bus["devices"]).collect();
    assert_eq!(devices, [&json!([0x28]), &json!([0x50]), &json!([]), &json!([])]);
    assert!(found["buses"][2]["reason"].as_str().unwrap().contains("time-out"), "{found}");
    // The identification of a BNO055.
    let read = |bus: &str, address: &str, more: &[&str]| {
        out(&client(&hub, &[&["i2c", "read", bus, address], more].concat()))
    };
    assert_eq!(read("0", "0x28", &["4", "--register", "0"]), "a0 fb 32 0f\n");
    assert_eq!(
        out(&client(&hub, &["i2c", "write", "1", "0x50", "0x10", "1", "2", "0xfe"])),
        "4 bytes written\n"
    );
    assert_eq!(read("1", "80", &["3", "--register", "16", "--fast"]), "01 02 fe\n");
    assert_eq!(document(&hub, &["i2c", "read", "1", "80", "2", "--register", "16"])["bytes"], json!([1, 2]));
    for (address, bus, says) in
        [("0x29", "0", "no device acknowledges this address"), ("0x28", "2", "time-out")]
    {
        fails(&client(&hub, &["i2c", "read", bus, address]), 1, says);
    }
}

#[test]
fn a_stuck_data_line_is_freed_and_a_stretched_clock_is_waited_for() {
    let hub = served(
        "devices-faults",
        "i2c_faults = [\"none\", \"stuck-data\", \"stretching\", \"no-acknowledge\"]",
    );
    let read = |bus| client(&hub, &["i2c", "read", bus, "0x50"]);
    // Arbitration is lost to the device that holds SDA. Then nine clocks have freed SDA.
    fails(&read("1"), 1, "status 0x04");
    assert_eq!(out(&read("1")), "00\n");
    // After 30 ms no device has acknowledged.
    fails(&read("2"), 1, "status 0x01");
    fails(&read("3"), 1, "status 0x01");
}

#[test]
fn a_transfer_that_a_reset_has_interrupted_leaves_no_stuck_line() {
    // The device holds SDA when the hub starts.
    let hub = served("devices-interrupted", "i2c_faults = [\"none\", \"interrupted\"]");
    let read = out(&client(&hub, &["i2c", "read", "1", "0x50", "1"]));
    assert!(read.contains("00"), "{read}");
}
