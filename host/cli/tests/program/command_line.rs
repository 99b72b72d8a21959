//! The command line: exit codes, outputs, and what a run shows.

use crate::common::{PROGRAM, driving, err, fails, folder, json, motor_hub, out, printed, write};
use crate::conformance::Hub;
use crate::hub_support::{Hub as FakeHub, Server};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Command lines, and words of the message with which each is refused. `''` is an empty argument.
const REFUSED: &str = r#"
run --period-ms 0 | a control period is a whole number from 1 to 100 ms
run --period-ms 101 | 1 to 100 ms
run --time-s -1 | a duration is a number from 0.001 to 300 s
run --time-s 0.0001 | from 0.001
run --seed -1 | a seed is a whole number from 0 to 4294967295
run --blend 0.5 | give --scheme D
run --time-s 0 | from 0.001
run --time-s nan | from 0.001
run --scheme E | none, A, B, C, D
run --scheme B --blend 0.5 | scheme D only
run --scheme D --blend 2 | 0 (scheme B) to 1 (scheme C)
run --motor AM61A | NeveRest 60, NeveRest 60-B
run --motor AM60A --motor AM60A --motor AM60A --motor AM60A --motor AM60A | 5 times
run --scenario /no/such/file | /no/such/file
run --scenario wrong.toml | wrong.toml:1:8:
run --wrong | --wrong
survey --dump 3 --json | --json
survey --dump 3 --only random | --only
survey --dump 3 --scenarios 5 | --scenarios
survey --dump 3 --worst 5 | --worst
survey --scenarios 0 | how many is a whole number from 1 to 1000000 scenarios
soak --hours 0 | a time is a number from 0.001 to 1000 hours
survey --only reference --seed 3 | --only leaves out
survey --only cells --scenarios 3 | --only leaves out
points --scheme b --motor AM60A --speed-cps 1360 --battery-mv 12 | 1000 to 65535 mV; did you mean 12000?
points --scheme b --motor AM60A --speed-cps 1360 --battery-mv 12.6 | did you mean 12600?
points --scheme b --motor AM60A --speed-cps 1360 --battery-mv 999 | from 1000
points --scheme b --motor AM60A --speed-cps 1360 --battery-mv -12000 | from 1000
completions tcsh | possible values: bash
dashboard --http 0.0.0.0:0 | give --listen 0.0.0.0:0
dashboard --http nowhere | give HOST:PORT
dashboard --http 127.0.0.1:99999 | a port is 0 to 65535
serve | --pty
serve --pty --tcp 127.0.0.1:0 | --tcp
serve --tcp nowhere | 127.0.0.1:7070
serve --tcp '' | give HOST:PORT, such as 127.0.0.1:7070
serve --pty --address 255 | 1 to 254
serve --tcp 127.0.0.1:0 --link here | --link
serve --pty --for-s -1 | more than 0
serve --pty --for-s 0 | more than 0
serve --pty --scenario /no/such/file | /no/such/file
serve --pty --store /no/such/file | /no/such/file:
serve --pty --wire 4,8 | a wire is between two digital pins, 0 to 7, such as 4,5
serve --pty --wire 4,4 | a wire is between two digital pins
client status | --port PATH or --tcp HOST:PORT
client --tcp 127.0.0.1:99999 status | a port is 0 to 65535
client --port a --tcp b:1 status | exclude
client --port '' status | a value is required for '--port
client --tcp 127.0.0.1 status | 127.0.0.1:7070
client --address 0 status | 1 to 254
client --address 255 status | 1 to 254
client --timeout-ms 0 status | a timeout is a whole number from 10 to 60000 ms
client --address 4 power 3:0 0 | --address 4 and a motor of the hub at address 3 exclude
client power 0 1.01 | -1 to 1
client power 0 nan | -1 to 1
client power 4 0 | several motors are given as 0,2, all motors as all
client power 0, 0 | 0 to 3
client power 3:0,4:1 0 | motors belong to different hubs
client current 0 -70 | a current of -70 A is out of range; allowed is -65.535 to 65.535 A
client current 0 much | a current is a number of amperes
client current 0 1 --speed-limit-cps 0 | from 1 to 32767 counts/s
client velocity 0 32768 | 32768
client velocity 0 1.5 | whole number
client velocity 0 30rpm | a turn of the output shaft, which a hub does not know
client velocity 0 30rpm | give --counts-per-turn COUNTS or --type NAME
client velocity 0 30rpm --type AM61 | NeveRest 60
client velocity 0 1 --for-s 0 | more than 0
client velocity 0 1 --for-s -1 | more than 0
client position 0 1 --speed -500 | 1 to 32767
client position 0 1 --speed 0 | 1 to 32767
client position 0 2147483648 | 2147483648
client record | DRIVE
client record -- status | status
client record -- jog 0 | Usage: record -- <power|current|velocity|position>
client record velocity 0 1e9 | whole number
client coefficients 0 velocity --p 32768 | -32768 to 32767
client coefficients 0 velocity --p inf | -32768 to 32767
client coefficients 0 current | velocity, position
client coefficients 0 position --f 1 | a position has no feed-forward
client led 1 2 256 | 256
client identify 4 | 0 to 3
client identify 0 --travel-counts -1 | -1
client together | MOTOR=COUNTS
client together 0 | such as 0=1000
client together 4=0 | 0 to 3
client together 0=x | whole number
client together 0=1 0=2 | motor 0 is given twice
client together 3:0=1 4:1=2 | and so is a group
client together 0=1 --acceleration-cps2 0 | 1 to 4294967295
client together 0=1 --speed-cps 0 | from 1 to 1000000 counts/s
client together 0=1 --on --by | --by
client setup 0 --type AM61 | NeveRest 60
client setup 0 --blend 0.5 | give --scheme D
client setup 0 --current-limit-a 0.0001 | '--current-limit-a <A>': allowed is 0.001 to 65.535 A, or 0 for none
client setup 0 --inductance-mh nan | 0.001 to 65.535 mH
client settings export hub.json | hub.json: settings are exported as TOML; give a name that ends in .toml
client set-address 255 | 1 to 254
client watch --interval-ms 3000 | 10 to 2000 ms
client drive turn=1 --track-mm 300 | --wheel-diameter-mm
client drive left=3 --wheel-diameter-mm 90 --track-mm 300 --counts-per-turn 9,9 | a part is straight=MM or turn=DEGREES
client drive turn=3 --wheel-diameter-mm 90 --track-mm 300 --counts-per-turn 9,9 --wheels 1,1 | two different motors
client drive turn=3 --speed-mm-per-s 0 | allowed is a number from 0.001 to 1000000
client drive turn=3 --wheel-diameter-mm 90 --track-mm 20000 --counts-per-turn 9,9 | a track of 1 mm to 10 m
client drive turn=0.01 straight=-0.05 --wheel-diameter-mm 90 --track-mm 300 --counts-per-turn 1680,1680 | no wheel by a count of its encoder; the least is straight=0.08 or turn=0.03
client servo 6 | a servo output is 0 to 5
client servo 0 0 | a pulse is a whole number from 1 to 65535 us
client servo 0 25000 | a pulse of 25000 us is longer than its period of 20000 us; allowed are 1 to 20000 us
client servo 0 1500 --period-us 1000 | allowed are 1 to 1000 us, or a longer --period-us
client digital 8 | a digital pin is 0 to 7
client servo 0 1500 --json | the argument '[US]' cannot be used with '--json'
client digital 0 high --json | the argument '[LEVEL]' cannot be used with '--json'
client i2c read 4 0x28 | an I2C bus is 0 to 3
client update /dev/zero | /dev/zero: more than 67108864 bytes
eval /dev/zero | /dev/zero: more than 67108864 bytes
client i2c read 0 0x80 | an I2C address is 0 to 127, or 0x00 to 0x7f
client i2c read 0 0x28 101 | a number of bytes is 1 to 100
client i2c write 0 0x28 256 | a byte is 0 to 255, or 0x00 to 0xff
"#;

#[test]
fn wrong_options_are_refused_before_anything_is_written_or_sent() {
    let folder = folder("refused");
    write(&folder, "wrong.toml", "name = 1\n");
    for case in REFUSED.trim().lines() {
        let (words, says) = case.split_once(" | ").unwrap();
        let words = words.split(' ').map(|word| if word == "''" { "" } else { word });
        let output = Command::new(PROGRAM).args(words).current_dir(&folder).output().unwrap();
        fails(&output, 2, says);
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1, "{case}");
    }
}

#[test]
fn a_run_writes_what_it_names_and_the_seed_decides_everything() {
    let folders = ["first", "second", "third"].map(folder);
    let seeds = ["5", "5", "6"];
    let documents: Vec<Value> = folders
        .iter()
        .zip(seeds)
        .map(|(out, seed)| {
            let out = out.to_str().unwrap();
            json(&motor_hub(&["run", "--time-s", "1", "--seed", seed, "--json", "--out", out]))
        })
        .collect();
    assert_eq!(documents[0]["motors"].as_array().unwrap().len(), 4);
    for (document, folder) in documents.iter().zip(&folders) {
        let files = document["files"].as_array().unwrap();
        assert_eq!(files.len(), std::fs::read_dir(folder).unwrap().count());
        assert!(files.iter().all(|file| Path::new(file.as_str().unwrap()).is_file()));
    }
    let read = |folder: &Path| std::fs::read_to_string(folder.join("trace.csv")).unwrap();
    let [first, second, third] = folders.each_ref().map(|folder| read(folder));
    assert_eq!(documents[0]["motors"], documents[1]["motors"]);
    assert!(first == second, "the same seed gives the same trace");
    assert!(first != third, "another seed gives another trace");
}

#[test]
fn proportional_braking_slows_down_more_gently_than_none() {
    let out = folder("gentle");
    let document = json(&motor_hub(&["--json", "--out", out.to_str().unwrap()]));
    let motors = document["motors"].as_array().unwrap();
    let both = |motor: &str, path: &str| {
        let motor = motors.iter().find(|m| m["label"] == motor).unwrap();
        let number = |run: &str| motor[run].pointer(path).and_then(Value::as_f64).unwrap();
        (number("as_set"), number("without_braking_regime"))
    };
    for motor in ["flywheel", "winch", "arm"] {
        let (with, without) = both(motor, "/deceleration_jerk/rms_a");
        // The flywheel is as fast in both directions: at full battery voltage, without oscillation afterwards. With batteries of
        // 12.3 to 13 V the ratio is 0.95 to 1.14.
        let most = if motor == "flywheel" { 1.2 * without } else { without };
        assert!(with < most, "{motor}: {with} A is not gentler than {without} A");
        let (braking, none) = both(motor, "/regimes/braking");
        // The flywheel is slow enough after a few periods.
        assert!(braking > 0.5 && none == 0.0, "{motor}: {braking} % and {none} % braking");
    }
    // A load that drives the motor is held, where forward and reverse alone oscillate.
    let (with, without) = both("winch", "/responses/1/residual_rms");
    assert!(with < 30.0 && without > 3.0 * with, "{with} against {without} counts/s");
    let (with, without) = both("winch", "/energy_to_battery_j");
    assert!(with > 5.0 && without < 0.1, "{with} J against {without} J");
    assert_eq!(document["expectations"], Value::Array(Vec::new()));
}

#[test]
fn a_run_lists_its_expectations_and_fails_if_one_is_not_met() {
    let out = folder("expected");
    let sound = "name = \"s\"\nduration_s = 0.5\nbattery = { emf_v = 12.0, resistance_ohm = 0.05 }\n\
        [[motors]]\nlabel = \"one\"\nmotor = \"AM 20 A\"\nsetpoints = [{ at_s = 0, power = 0.5 }]\n\
        [[expect]]\nspeed_between_cps = [-10, 9000]\n";
    for (more, code, cell) in [("", 0, "met"), ("never = [\"forward\"]\n", 1, "NOT MET")] {
        let scenario = write(&out, "sound.toml", format!("{sound}{more}"));
        let run = ["run", "--scenario", &scenario, "--out", out.to_str().unwrap()];
        let output = motor_hub(&run);
        let tables = printed(&output);
        assert_eq!(output.status.code(), Some(code), "{tables}");
        assert!(tables.contains(cell) && tables.contains("-10 to 9000"), "{tables}");
        let said = if code == 1 { "1 of 2 expectations are not met" } else { "" };
        assert!(err(&output).contains(said));

        let output = motor_hub(&[&run[..], &["--json"]].concat());
        assert_eq!(output.status.code(), Some(code));
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        let verdicts = document["expectations"].as_array().unwrap();
        assert_eq!(verdicts[0]["expected"], "speed_between_cps");
        assert_eq!(verdicts[0]["wanted"], serde_json::json!([-10.0, 9000.0]));
        assert!(verdicts[0]["measured"][1].as_f64().unwrap() > 100.0);
        assert_eq!(verdicts.iter().all(|verdict| verdict["met"] == true), code == 0);
    }
}

#[test]
fn any_motor_of_the_catalogue_can_take_the_place_of_the_first() {
    let folder = folder("motor");
    let folder = folder.to_str().unwrap();
    let arguments = ["--motor", "matrix b", "--scheme", "D", "--time-s", "2", "--out", folder];
    let tables = out(&motor_hub(&arguments));
    assert!(tables.starts_with("flywheel brought to ") && !tables.contains("inf s"), "{tables}");
    assert!(tables.contains("flywheel: Matrix 12 V-B") && tables.contains("scheme D, automatic"), "{tables}");
    assert!(!tables.contains("winch"));
    assert!(tables.contains(folder));
}

const AT: [&str; 6] = ["--motor", "AM 60 A", "--speed-cps", "1360", "--battery-mv", "12000"];

#[test]
fn points_are_those_of_the_firmware() {
    let out = folder("points");
    let plot = ["points", "--scheme", "A", "--json", "--plot", out.to_str().unwrap()];
    let document = json(&motor_hub(&[&plot[..], &AT].concat()));
    let points = document["points"].as_array().unwrap();
    let named: Vec<_> =
        points.iter().map(|p| (p["name"].as_str().unwrap(), p["control"].as_f64().unwrap())).collect();
    assert_eq!(named.iter().map(|p| p.0).collect::<String>(), "STZG");
    assert!((named[2].1 - 14_805.468).abs() < 0.01, "{named:?}");
    assert!(out.join("points.svg").is_file());

    let table = printed(&motor_hub(&[&["points", "--scheme", "B"][..], &AT].concat()));
    assert!(table.contains("-10197.72"), "{table}");
}

#[test]
fn a_control_value_is_mapped_as_the_firmware_maps_it() {
    for (control, regime, mode, duty) in [
        ("16384", "forward", "9/8", 0.5),
        ("-5099", "braking", "5/0", 0.5),
        ("-32767", "reverse", "6/2", 1.0),
    ] {
        let map = ["map", "--scheme", "B", "--json", "--control-steps", control];
        let document = json(&motor_hub(&[&map[..], &AT].concat()));
        assert_eq!((&document["regime"], &document["mode"]), (&regime.into(), &mode.into()));
        assert!((document["duty"].as_f64().unwrap() - duty).abs() < 1e-4, "{document}");
    }
    let map = |control: &[&str]| motor_hub(&[&["map", "--scheme", "B"][..], &AT, control].concat());
    assert_eq!(out(&map(&["--control", "0.5"])), out(&map(&["--control-steps", "16384"])));
    let all_of_it = out(&map(&["--control", "-1"])).replace('\n', " ");
    assert!(all_of_it.contains("control -1.0000 (-32767 steps)"), "{all_of_it}");
    for (control, says) in [
        (&[][..], &["--control <FRACTION>", "--control-steps <STEPS>"][..]),
        (&["--control", "0.5", "--control-steps", "16384"], &["--control <FRACTION>", "--control-steps"]),
        (&["--control-steps", "-32768"], &["-32768", "-32767 to 32767 steps"]),
        (&["--control", "16384"], &["16384", "-1 to 1", "--control-steps"]),
    ] {
        let wrong = map(control);
        says.iter().for_each(|part| fails(&wrong, 2, part));
    }
}

#[test]
fn motors_are_learned_and_drawn_and_one_under_load_is_refused() {
    let out = folder("identify");
    let arguments = ["identify", "--motor", "AM 60 A", "--motor", "AM 3.7 B", "--json", "--out"];
    let learned = json(&motor_hub(&[&arguments[..], &[out.to_str().unwrap()]].concat()));
    for motor in learned["motors"].as_array().unwrap() {
        let [found, is] = ["found", "true"].map(|of| motor[of]["acceleration_per_volt"].as_f64().unwrap());
        assert!((found / is - 1.0).abs() < 0.1, "{motor}");
    }
    assert!(out.join("identify.svg").exists());

    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/scenarios/arm.toml");
    let arguments = ["identify", "--scenario", scenario.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let refused = motor_hub(&arguments);
    assert_eq!(refused.status.code(), Some(1));
    assert!(printed(&refused).contains("refused: the motor was not at rest before the motion"));
}

#[test]
fn the_catalogue_lists_what_motors_are_sold_as_and_how_fast_they_are() {
    let list = out(&motor_hub(&["motors"]));
    assert!(list.lines().all(|line| line.chars().count() <= 80), "{list}");
    for says in ["NeveRest 60", "AM 60 A", "am-3103", "CoreHex A", "REV-41-1300", "rpm", "rad/s", "1680"] {
        assert!(list.contains(says), "{says}: {list}");
    }
    assert!(!list.contains("Tetrix"), "nobody has characterised it: {list}");
    let document = json(&motor_hub(&["motors", "--json"]));
    let motors = document["motors"].as_array().unwrap();
    let motor = motors.iter().find(|motor| motor["name"] == "NeveRest 60").unwrap();
    assert_eq!(motor["aliases"], serde_json::json!(["AM 60 A", "am-3103"]));
    // The data file's own free speed: 610.4 rad/s of the motor, by 60.
    let rad = motor["free_speed_rad_per_s"].as_f64().unwrap();
    assert!((rad - 10.173_73).abs() < 1e-4, "{motor}");
    assert!((motor["free_speed_rpm"].as_f64().unwrap() - 97.152).abs() < 1e-2, "{motor}");
    assert!((motor["free_speed_cps"].as_f64().unwrap() - 1680.0 * 97.152 / 60.0).abs() < 0.1, "{motor}");
}

#[test]
fn an_operating_point_may_be_of_a_motor_that_the_catalogue_lacks() {
    let at = ["points", "--scheme", "B", "--speed-cps", "1000", "--battery-mv", "12000", "--json"];
    let points = |motor: &[&str]| json(&motor_hub(&[&at[..], motor].concat()));
    let named = points(&["--motor", "NeveRest 60"]);
    assert_eq!((&named["motor"], &named), (&"NeveRest 60".into(), &points(&["--motor", "am 60 a"])));
    let ke = ["--ke-v-s-per-rad", "0.017766666666666667", "--counts-per-rev", "28"];
    let given = points(&[&ke[..], &["--resistance-ohm", "3.3", "--inductance-mh", "0.694"]].concat());
    assert_eq!(named["points"], given["points"]);
    fails(&motor_hub(&at), 2, "--resistance-ohm");
}

#[test]
fn files_are_listed_as_people_count() {
    let list = out(&motor_hub(&["figures", "--out", folder("figures").to_str().unwrap()]));
    let at = |name: &str| list.find(&format!("/{name}")).expect(name);
    assert!(at("1-") < at("2-") && at("9-") < at("10-") && at("13-") < at("14-"), "{list}");
}

#[test]
fn a_folder_that_cannot_be_written_to_is_found_before_any_work() {
    let file = folder("in-the-way");
    std::fs::write(&file, "a file").unwrap();
    let out = file.join("out");
    for command in [
        &["run"][..],
        &["compare"],
        &["survey"],
        &["identify"],
        &["figures"],
        #[cfg(feature = "emulated")]
        &["emulate"],
        &["client", "--tcp", "127.0.0.1:1", "record", "--out", out.to_str().unwrap(), "power", "0", "0.1"],
    ] {
        let place = if command[0] == "client" { &[][..] } else { &["--out", out.to_str().unwrap()] };
        let begun = std::time::Instant::now();
        let output = motor_hub(&[command, place].concat());
        fails(&output, 2, "nothing can be written");
        assert!(begun.elapsed().as_secs() < 5, "{command:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_json_document_names_files_also_in_a_folder_that_is_no_unicode() {
    use std::os::unix::ffi::OsStrExt;
    let place = folder("no-unicode").join(std::ffi::OsStr::from_bytes(b"b\xffd"));
    let output =
        Command::new(PROGRAM).args(["run", "--time-s", "0.2", "--json", "--out"]).arg(&place).output();
    let files = json(&output.unwrap())["files"].as_array().unwrap().clone();
    assert!(files.iter().all(|file| file.as_str().unwrap().contains("/b\u{fffd}d/")), "{files:?}");
    assert_eq!(files.len(), std::fs::read_dir(place).unwrap().count());
}

#[cfg(not(feature = "emulated"))]
#[test]
fn without_the_emulated_chips_the_feature_that_brings_them_is_named() {
    for command in [&["emulate"][..], &["serve", "--emulated", "--pty"]] {
        fails(&motor_hub(command), 2, "cargo run --release --features emulated -- ");
    }
}

#[test]
fn a_back_emf_that_the_firmware_cannot_represent_is_refused() {
    let at = ["--scheme", "A", "--motor", "NeveRest 60", "--battery-mv", "12000", "--speed-cps"];
    for command in [&["points"][..], &["map", "--control", "1"]] {
        for speed in ["32876", "-32876"] {
            let refused = motor_hub(&[command, &at, &[speed]].concat());
            fails(&refused, 2, "back EMF must be -131.071 to 131.071 V");
        }
        assert!(motor_hub(&[command, &at, &["32875"]].concat()).status.success(), "{command:?}");
    }
}

#[test]
fn a_closed_standard_output_ends_a_command_silently() {
    let run = |arguments: &[&str]| {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        Command::new(PROGRAM).args(arguments).stdout(writer).output().unwrap()
    };
    let ended = run(&["motors"]);
    assert_eq!((ended.status.code(), err(&ended)), (Some(1), String::new()));
    // A recording prints nothing until it ends.
    let hub = Hub::served();
    let folder = folder("closed-output");
    let record = |place, drive: &[&str]| {
        let record = ["client", "--tcp", place, "record", "--out", folder.to_str().unwrap(), "--"];
        run(&[&record, drive].concat())
    };
    let ended = record(&hub.place, &["power", "0", "0"]);
    assert_eq!((ended.status.code(), err(&ended)), (Some(1), "disabled motor 0\n".to_owned()));
    let mut servo = driving(&hub, &["servo", "0", "1500"]);
    drop(servo.stdout.take());
    assert_eq!(servo.wait().unwrap().code(), Some(1));
    // The failure of a recording is told nevertheless.
    let foreign = Server::start(FakeHub { foreign: true, ..FakeHub::new() });
    fails(&record(&foreign.address, &["current", "0", "1"]), 1, "the hub regulates no current");
}

#[test]
fn tables_and_words_are_no_wider_than_a_terminal_of_80_columns() {
    let folder = folder("narrow");
    let folder = ["--out", folder.to_str().unwrap()];
    for command in [&["run", "--time-s", "0.2"][..], &["compare", "--quick"], &["paper"], &["identify"]] {
        let place = if command[0] == "paper" { &[][..] } else { &folder };
        let tables = out(&motor_hub(&[command, place].concat()));
        // But for the paths of what was written.
        for row in tables.lines().filter(|line| !line.contains(folder[1])) {
            assert!(row.chars().count() <= 80, "{command:?}: {row}");
        }
    }
}

#[test]
fn what_is_recorded_has_a_help_page_of_its_own() {
    let page = out(&motor_hub(&["client", "record", "--", "velocity", "--help"]));
    assert!(page.contains("Usage: velocity [OPTIONS] <MOTOR> <SPEED>"), "{page}");
    assert!(page.lines().all(|line| line.chars().count() <= 80), "{page}");
}

#[test]
fn every_command_has_a_manual_page_and_shells_can_complete_it() {
    let folder = folder("man");
    assert!(motor_hub(&["man", "--out", folder.to_str().unwrap()]).status.success());
    for (page, says) in [
        ("motor-hub.1", "proportional braking"),
        ("motor-hub-run.1", "period\\-ms"),
        ("motor-hub-client-velocity.1", "for\\-s"),
    ] {
        let page = std::fs::read_to_string(folder.join(page)).expect(page);
        assert!(page.starts_with(".ie") && page.contains(says), "{page}");
    }
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(out(&motor_hub(&["completions", shell])).contains("battery-mv"), "{shell}");
    }
}
