//! `motor-hub client` against the served simulated hub, whose motors turn.

use crate::common::{
    BASE, PROGRAM, client, driving, err, fails, folder, json, made_folder, motor_hub, out, printed, scan,
    scenario, signal, start_client, store, wait_for, words, write,
};
use crate::conformance::{Hub, packet};
use crate::hub_support::{Hub as FakeHub, Server};
use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn status(hub: &Hub) -> Value {
    json(&client(hub, &["status", "--json"]))
}

#[test]
fn a_motor_is_identified_beside_the_catalogue_and_settings_are_written_only_when_asked_for() {
    let hub = Hub::served();
    let coefficients =
        |more: &[&str]| out(&client(&hub, &[&["coefficients", "0", "velocity"], more].concat()));
    let in_force = || json(&client(&hub, &["coefficients", "0", "velocity", "--json"]))["in_force"].clone();
    assert!(coefficients(&[]).contains("only suggested: the motor is regulated by its model"));
    assert_eq!(in_force(), false);
    // Coefficients set by a host would override the model.
    assert!(coefficients(&["--p", "1"]).contains("in force: PID regulates the motor"));
    assert_eq!(in_force(), true);
    let identify = |more: &[&str]| client(&hub, &[&["identify", "0"], more].concat());
    let shown = out(&identify(&[]));
    for says in [
        "turns at most",
        " %\n",
        "acceleration per",
        "counts/s²/V",
        "decay, q",
        "back EMF and drag",
        "friction, c",
        "NeveRest 20",
        "off by",
        "times the inertia of a bare NeveRest 20",
        "largest acceleration",
        "--apply puts",
    ] {
        assert!(shown.contains(says), "{says}: {shown}");
    }
    assert!(shown.lines().all(|line| line.chars().count() <= 80), "{shown}");
    let document = json(&identify(&["--json", "--apply"]));
    assert_eq!((&document["outcome"], &document["applied"]), (&"found".into(), &true.into()));
    assert_eq!(document["catalogue"], "NeveRest 20");
    // The first run did not apply its proposal.
    assert_eq!(document["now"]["acceleration_cps2"], Value::Null, "{document}");
    let proposed = &document["proposed"];
    let number = |of: &Value| of.as_f64().unwrap();
    // Half of the battery voltage.
    let share = number(&proposed["acceleration_cps2"]) / number(&proposed["acceleration_per_volt"]);
    assert!((5.5..6.5).contains(&share), "{document}");
    assert_eq!(&json(&client(&hub, &["setup", "0", "--json"]))["motion"], proposed);
    let applied = out(&identify(&["--apply"]));
    assert!(applied.contains("regulates the motor by this result"), "{applied}");
    assert_eq!(in_force(), false);
    assert_eq!(status(&hub)["motors"][0]["enabled"], false);
}

#[test]
fn an_identification_that_fails_names_the_reason_and_disables_the_motor() {
    let hub = Hub::served();
    let refused = client(&hub, &["identify", "1", "--travel-counts", "3"]);
    fails(&refused, 1, "motor 1 was not identified");
    fails(&refused, 1, "travel");
    let says = printed(&refused);
    assert!(says.contains("at most 3 counts"), "{says}");
    assert_eq!(status(&hub)["motors"][1]["enabled"], false);
}

#[test]
fn every_signal_that_a_program_can_catch_stops_the_motors_of_its_command() {
    let hub = Hub::served();
    for (arguments, signals, says) in [
        (&["identify", "0"][..], &["-INT"][..], "stopped by Ctrl-C"),
        (&["velocity", "0", "500"], &["-INT"], "stopped by Ctrl-C"),
        (&["velocity", "0", "500"], &["-TERM"], "stopped by SIGTERM"),
        (&["power", "0", "0.3"], &["-HUP"], "terminal is gone"),
        (&["power", "0", "0.3"], &["-QUIT"], "stopped by SIGQUIT"),
        (&["current", "0", "0.3"], &["-INT"], "stopped by Ctrl-C"),
        // The command ends instead of being suspended.
        (&["power", "0", "0.3"], &["-TSTP"], "stopped by Ctrl-Z"),
        // Terminal and parent process may both send a signal.
        (&["together", "0=300", "--on"], &["-INT", "-INT", "-TERM"], "stopped by"),
    ] {
        let process = driving(&hub, arguments);
        signals.iter().for_each(|name| signal(process.id(), name));
        let output = process.wait_with_output().unwrap();
        fails(&output, 1, says);
        fails(&output, 1, "disabled motor 0");
        // The motor is disabled long before the keep-alive ends, and not by the `status` command.
        let asked = client(&hub, &["status", "--json"]);
        assert_eq!(err(&asked), "", "{arguments:?}");
        assert_eq!(json(&asked)["motors"][0]["enabled"], false);
    }
}

#[test]
fn a_reader_that_goes_away_stops_the_motors_too() {
    let hub = Hub::served();
    let mut process = driving(&hub, &["velocity", "0", "500"]);
    drop(process.stdout.take());
    let output = process.wait_with_output().unwrap();
    fails(&output, 1, "disabled motor 0");
}

#[test]
fn questions_disable_the_motor_of_a_killed_host() {
    let hub = Hub::served();
    for question in [
        &["status", "--json"][..],
        &["watch", "--for-s", "0.1"],
        &["discover"],
        &["odometry"],
        &["coefficients", "0", "velocity"],
        &["velocity", "1", "100", "--for-s", "0.1"],
    ] {
        let mut process = driving(&hub, &["velocity", "0", "500"]);
        signal(process.id(), "-KILL");
        process.wait().unwrap();
        let asked = client(&hub, question);
        assert!(err(&asked).contains("disabled motor 0, left running"), "{question:?}: {}", err(&asked));
        assert_eq!(status(&hub)["motors"][0]["enabled"], false, "{question:?}");
    }
}

#[test]
fn a_speed_that_a_motor_cannot_reach_is_warned_of_and_fails() {
    let hub = Hub::served();
    let asked = client(&hub, &["velocity", "0", "30000", "--for-s", "0.6"]);
    for says in ["free speed", "30000 counts/s not reached after 0.6 s: motor 0 at", "\ndisabled motor 0\n"] {
        fails(&asked, 1, says);
    }
    assert!(err(&asked).starts_with("warning: motor 0: 30000 counts/s requested"), "{}", err(&asked));
    let folder = folder("not-reached");
    let recorded = record(&hub, &folder, &["velocity", "0,2", "30000", "--for-s", "0.3"]);
    fails(&recorded, 1, "\ndisabled motors 0, 2\n");
    assert!(!rows(&folder).is_empty() && folder.join("motor-2.svg").exists());
    let rpm = ["velocity", "0", "20rpm", "--type", "AM 60 A", "--for-s", "1.5"];
    let reached = client(&hub, &rpm);
    assert!(out(&reached).contains(" rpm, 2."), "{}", out(&reached));
    assert_eq!(err(&reached), "");
}

#[test]
fn motors_move_in_step_to_their_targets() {
    let hub = Hub::served();
    let positions = |hub: &Hub| {
        let motors = status(hub)["motors"].clone();
        [0, 2].map(|motor: usize| motors[motor]["position"].as_i64().unwrap())
    };
    let shown = out(&client(&hub, &["together", "0=800", "2=-400", "--speed-cps", "1600"]));
    assert!(shown.ends_with("all motors settled\n"), "{shown}");
    let [first, second] = positions(&hub);
    // Disabled motors may roll on.
    assert!((first - 800).abs() < 50 && (second + 400).abs() < 50, "{first} {second}");
    assert_eq!(status(&hub)["motors"][0]["enabled"], false);
    out(&client(&hub, &["together", "0=-800", "2=400", "--by", "--speed-cps", "1600"]));
    let [first, second] = positions(&hub);
    assert!(first.abs() < 100 && second.abs() < 100, "{first} {second}");
    out(&client(&hub, &["together", "0=300", "2=300", "--on", "--for-s", "0.5"]));
    let late = client(&hub, &["together", "0=90000", "--for-s", "0.3"]);
    fails(&late, 1, "disabled motor 0\n");
    assert!(err(&late).contains("targets not reached after 0.3 s"), "{}", err(&late));
}

/// A served hub whose motor 1 is jammed by friction as large as its stall torque.
fn hub_with_a_jammed_motor(test: &str) -> Hub {
    let text = "[[motors]]\nlabel = \"good\"\nmotor = \"NeveRest 60\"\n\
        [[motors]]\nlabel = \"jammed\"\nmotor = \"NeveRest 60\"\nfriction.coulomb_percent = 100\n";
    Hub::served_with(&["--scenario", &scenario(test, text)])
}

#[test]
fn a_group_that_loses_any_of_its_motors_fails_and_names_the_motor_and_its_fault() {
    let hub = hub_with_a_jammed_motor("lost-member");
    let driven = [&["drive", "straight=1000", "straight=-1000"][..], &BASE].concat();
    for arguments in [
        &["together", "0=1000", "1=1000"][..],
        &["together", "0=1000", "1=1000", "--coast"],
        &["together", "0=300", "1=300", "--on", "--for-s", "6"],
        &driven,
    ] {
        let failed = client(&hub, arguments);
        fails(&failed, 1, "left the group");
        fails(&failed, 1, "; motor 1: no counts although driven: the shaft is held");
        assert!(!err(&failed).contains("hub status"), "{}", err(&failed));
        let shown = printed(&failed);
        assert!(!shown.contains("all motors settled") && !shown.contains("heading"), "{shown}");
        // The command ends as soon as the other motor stands. A line is printed each second.
        assert!(shown.matches("no counts although driven").count() < 3, "{shown}");
        // The second part of a course does not begin.
        assert_eq!(shown.matches("0.0 s").count(), 1, "{shown}");
    }
    fails(
        &client(&hub, &[&["drive", "turn=1000", "--for-s", "0.2"], &BASE[..]].concat()),
        1,
        "turn=1000 not finished after 0.2 s",
    );
}

#[test]
fn a_motion_to_positions_without_progress_fails_and_names_each_motor_and_where_it_stands() {
    // Motor 1 is held: its current limit is too small for its friction.
    let motor = "motor = \"NeveRest 60\"";
    let text = format!(
        "[[motors]]\nlabel = \"good\"\n{motor}\n\
        [[motors]]\nlabel = \"held\"\n{motor}\nfriction.coulomb_percent = 50\ncurrent_limit_a = 0.2\n"
    );
    let scenario = scenario("no-progress", &text);
    let driven = [&["drive", "turn=90"][..], &BASE].concat();
    std::thread::scope(|scope| {
        for (arguments, error) in [
            (
                &["together", "0=1000", "1=-500"][..],
                "targets not reached: no progress for 5 s; motor 0 stands at",
            ),
            (&driven, "turn=90 not finished: no progress for 5 s; motor 0 stands at"),
            (
                &["position", "0,1", "300"],
                "error: no progress for 5 s; motor 1 stands at 0 counts instead of 300",
            ),
        ] {
            let scenario = &scenario;
            scope.spawn(move || {
                let hub = Hub::served_with(&["--scenario", scenario]);
                let failed = client(&hub, arguments);
                fails(&failed, 1, error);
                fails(&failed, 1, "; motor 1 stands at 0 counts instead of ");
                fails(&failed, 1, " (held by its current limit: the load needs more current)");
            });
        }
    });
}

#[test]
fn a_motor_that_does_not_turn_has_its_reason_in_errors_and_in_lines() {
    let hub = hub_with_a_jammed_motor("reasons");
    for (arguments, error) in [
        (&["velocity", "0,1", "300", "--for-s", "2"][..], "300 counts/s not reached after 2 s: motor 1 at"),
        (&["position", "0,1", "300", "--for-s", "2"], "target not reached after 2 s; motor 1: "),
    ] {
        let failed = client(&hub, arguments);
        fails(&failed, 1, error);
        fails(&failed, 1, "; motor 1: no counts although driven: the shaft is held");
        assert!(!err(&failed).contains("motor 0: "), "{}", err(&failed));
        let shown = printed(&failed);
        assert!(
            shown.contains("motor 1: 0 counts, 0 counts/s, 0.00 A, no counts although driven"),
            "{shown}"
        );
    }
}

#[test]
fn a_scan_finds_hubs_on_ports_and_gives_the_reason_where_it_finds_none() {
    let (tcp, pty) = (Hub::served(), Hub::start(&["--pty", "--address", "9"]));
    let link = made_folder("hub-of-a-scan").join("link");
    std::os::unix::fs::symlink(&pty.place, &link).unwrap();
    let link = link.to_str().unwrap();
    let notes = made_folder("no-notes");
    let found = out(&scan(&notes, &[&tcp.place, link, "/no/such/port"]));
    let row = |place: &str| words(found.lines().find(|line| line.contains(place)).unwrap_or_default());
    assert!(row(&tcp.place).contains("2 ┆ parent"), "{found}");
    assert!(row(link).contains("9 ┆ parent"), "{found}");
    assert!(row("/no/such/port").contains("No such file"), "{found}");
    fails(&scan(&notes, &["/no/such/port"]), 1, "no hub found at 1 place\n");
}

#[test]
fn a_scan_draws_children_below_their_parent_and_reports_two_hubs_with_one_address() {
    let hub = Hub::served_with(&["--hubs", "3"]);
    let found = words(&out(&scan(&made_folder("chain-notes"), &[&hub.place])));
    for row in ["2 ┆ parent, ", "3 ┆ └ child, ", "4 ┆ └ child, "] {
        assert!(found.contains(row), "{row}: {found}");
    }
    let refused = client(&hub, &["together", "3:0=100", "4:0=100"]);
    fails(&refused, 2, "the motors belong to different hubs; a command is for motors of one hub");
    let refused = client(&hub, &["set-address", "3"]);
    fails(&refused, 1, "another hub on the line has address 3: choose another address");
    // Another program gives the parent the address of a child.
    let mut other = hub.tcp();
    other.send(&packet(2, 1, 0x7F06, &[3]));
    assert!(!other.receive_all().is_empty());
    drop(other);
    // The hub refuses a host until it notices that the other program is gone.
    let found = wait_for("a hub without a host", || {
        let found = client(&hub, &["discover"]);
        found.status.success().then(|| out(&found))
    });
    assert!(found.contains("several hubs with this address"), "{found}");
    out(&client(&hub, &["set-address", "9"]));
    let found = out(&client(&hub, &["discover"]));
    assert!(!found.contains("several hubs") && found.contains('9') && found.contains('3'), "{found}");
}

#[test]
fn a_scan_lists_the_other_hubs_of_a_chain_although_children_fail() {
    fn as_child(reply: &[u8], address: u8) -> Vec<u8> {
        let mut child = reply.to_vec();
        child.pop();
        (child[5], child[10]) = (address, 0);
        child.push(child.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)));
        child
    }
    // Children at the addresses 9 and 12 answer a discovery and nothing else.
    let before = |reply: &[u8]| match reply[8..10] {
        [0x0F, 0xFF] => [as_child(reply, 9), as_child(reply, 12)].concat(),
        _ => Vec::new(),
    };
    let server = Server::start(FakeHub { before, ..FakeHub::new() });
    let notes = made_folder("failing-children");
    let found = words(&out(&scan(&notes, &[&server.address])));
    for row in
        ["3 ┆ parent, HW: 20", "9 ┆ └ child: hub 9 does not answer", "12 ┆ └ child: hub 12 does not answer"]
    {
        assert!(found.contains(row), "{row}: {found}");
    }
    let document = json(&scan(&notes, &[&server.address, "--json"]));
    let hubs = &document["places"][0]["hubs"];
    assert_eq!(hubs[0]["reason"], Value::Null, "{document}");
    assert!(hubs[1]["reason"].as_str().unwrap().starts_with("hub 9 does not answer"), "{document}");
    // A discovery lists all hubs, and fails because motors of a silent hub may run.
    let output = motor_hub(&["client", "--tcp", &server.address, "--timeout-ms", "300", "discover"]);
    fails(&output, 1, "hub 9 does not answer");
    let listed = words(&printed(&output));
    for row in ["3 ┆ parent", "9 ┆ child", "12 ┆ child"] {
        assert!(listed.contains(row), "{row}: {listed}");
    }
}

#[test]
fn a_scan_opens_a_place_that_is_named_twice_once() {
    let server = Server::start(FakeHub::new());
    let localhost = server.address.replace("127.0.0.1", "localhost");
    let found = out(&scan(&made_folder("named-twice"), &[&server.address, &localhost, &server.address]));
    assert_eq!(found.matches("parent").count(), 1, "{found}");
    assert!(!found.contains("localhost"), "{found}");
}

#[test]
fn a_scan_finds_served_hubs_unnamed_and_leaves_those_alone_that_have_a_host() {
    use std::io::Read;
    let notes = made_folder("scan-notes");
    let left = || std::fs::read_dir(notes.join("motor-hub")).unwrap().count();
    let link = notes.join("hub");
    let link = link.to_str().unwrap();
    let (tcp, mut says) = Hub::start_heard(&notes);
    let place = tcp.place.clone();
    assert_eq!(left(), 1, "a hub whose place is printed is found");
    let mut pty = Hub::start_in(&notes, &["--pty", "--link", link], Stdio::inherit());
    let rows = |place: &str, more: &[&str]| -> Vec<String> {
        let found = out(&scan(&notes, more));
        found.lines().filter(|line| line.contains(place)).map(words).collect()
    };
    let row = |place: &str| rows(place, &[]).concat();
    // A hub notices after a moment that its host is gone, and the scan before was a host too.
    let is_found =
        |place: &str| wait_for("a free hub in a scan", || row(place).contains("2 ┆ parent").then_some(()));
    is_found(&tcp.place);
    is_found(link);
    // Two names of one hub are asked once.
    let port = tcp.place.strip_prefix("127.0.0.1").unwrap();
    wait_for("one row of a free hub", || {
        let both = rows(port, &[&format!("localhost{port}")]);
        assert_eq!(both.len(), 1, "{both:?}");
        both.concat().contains("2 ┆ parent").then_some(())
    });

    let (mut of_tcp, mut of_pty) = (tcp.tcp(), pty.serial());
    assert!(!of_tcp.enabled() && !of_pty.enabled());
    for place in [&*tcp.place, link] {
        assert!(row(place).contains("┆ in use by another host"), "{}", row(place));
    }
    assert!(!of_tcp.enabled() && !of_pty.enabled());
    drop((of_tcp, of_pty));
    is_found(link);
    is_found(&tcp.place);

    assert_eq!(left(), 2);
    // A killed program cannot remove its note.
    drop(tcp);
    let mut said = String::new();
    says.read_to_string(&mut said).unwrap();
    assert_eq!(said, "", "nobody was turned away");
    assert!(left() == 2 && row(&place).is_empty());
    is_found(link);
    assert_eq!(left(), 1);
    signal(pty.id(), "-TERM");
    assert!(pty.wait().success());
    assert_eq!(left(), 0);
    let none = scan(&notes, &[]);
    fails(&none, 1, "no hub is served on this machine; give a PLACE");
}

#[test]
fn a_port_may_be_a_tcp_address_whose_port_is_in_range() {
    let hub = Hub::served();
    out(&motor_hub(&["client", "--port", &hub.place, "status"]));
    let range = "a TCP port is a whole number from 1 to 65535";
    for place in ["127.0.0.1:99999", "localhost:0"] {
        fails(&motor_hub(&["client", "--port", place, "status"]), 1, &format!("error: {place}: {range}\n"));
    }
    let found = printed(&scan(&made_folder("port-out-of-range"), &["127.0.0.1:70000"]));
    assert!(found.contains(range), "{found}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_place_without_a_hub_says_what_to_do() {
    let ports = out(&motor_hub(&["client", "ports"]));
    let missing = format!("/dev/ttyNone: No such file or directory\n{ports}");
    fails(&motor_hub(&["client", "--port", "/dev/ttyNone", "status"]), 1, &missing);
    // Nothing listens on port 1.
    fails(
        &motor_hub(&["client", "--tcp", "127.0.0.1:1", "status"]),
        1,
        "start one by `motor-hub serve --tcp HOST:PORT`",
    );
}

#[cfg(target_os = "linux")]
#[test]
fn a_port_that_is_not_permitted_hints_at_group_and_udev_rule() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let port = write(&folder("locked"), "port", "");
    std::fs::set_permissions(&port, std::fs::Permissions::from_mode(0o0)).unwrap();
    let root = std::fs::metadata("/proc/self").unwrap().uid() == 0;
    for command in ["status", "scan"] {
        // Root may open any file, so the program runs as the user with id 65534.
        let mut denied = if root {
            let mut denied = Command::new("setpriv");
            denied.args(["--reuid=65534", "--clear-groups", PROGRAM]);
            denied
        } else {
            Command::new(PROGRAM)
        };
        let denied = denied.args(["client", "--port", &port, command]).output().unwrap();
        let says = err(&denied);
        assert!(says.contains("permission denied") && says.contains("70-motor-hub.rules"), "{says}");
    }
}

/// Records a drive to a folder.
fn record(hub: &Hub, folder: &Path, drive: &[&str]) -> Output {
    client(hub, &[&["record", "--out", folder.to_str().unwrap()], drive].concat())
}

/// The rows of a recording, by heading.
fn rows(folder: &Path) -> Vec<HashMap<String, String>> {
    let text = std::fs::read_to_string(folder.join("record.csv")).unwrap();
    assert!(text.ends_with('\n'), "the last row is whole");
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let headings = lines.next().unwrap();
    lines
        .map(|row| {
            assert_eq!(row.len(), headings.len(), "{row:?}");
            headings.iter().cloned().zip(row).collect()
        })
        .collect()
}

#[test]
fn a_drive_of_four_motors_is_recorded_fifty_times_a_second() {
    let hub = Hub::served();
    let folder = folder("record");
    let shown = out(&record(&hub, &folder, &["velocity", "all", "400", "--for-s", "2"]));
    let rows = rows(&folder);
    assert!(rows.len() > 4 * 90, "{} rows: {shown}", rows.len());
    let last = &rows[rows.len() - 4];
    assert_eq!((last["motor"].as_str(), last["setpoint"].as_str()), ("0", "velocity"));
    assert_eq!(last["setpoint_value"], "400");
    let number = |key: &str| last[key].parse::<f64>().unwrap();
    assert!((1_000.0..32_767.0).contains(&number("control")), "the hub tells it: {last:?}");
    assert!(
        (number("speed_estimate_cps") - 400.0).abs() < 40.0 && number("position_counts") > 300.0,
        "{last:?}"
    );
    assert!(number("battery_measured_v") > 11.0);
    for motor in 0..4 {
        let svg = std::fs::read_to_string(folder.join(format!("motor-{motor}.svg"))).unwrap();
        assert!(svg.contains("set-point") && svg.contains("battery, V"), "{motor}");
    }
    assert_eq!(status(&hub)["motors"][0]["enabled"], false);
}

#[test]
fn a_speed_is_judged_by_its_last_half_second_at_any_rate_of_a_recording() {
    let hub = Hub::served();
    let folder = folder("record-slow");
    let drive = ["--rate-hz", "1", "--", "velocity", "0", "400", "--for-s", "1.9"];
    let shown = out(&record(&hub, &folder, &drive));
    assert!(shown.contains(" readings, ") && shown.ends_with(" and 1 chart\n"), "{shown}");
    assert_eq!(rows(&folder).len(), 2);
}

#[test]
fn a_battery_voltage_that_the_hub_does_not_know_is_unknown() {
    let text =
        "battery = { emf_v = 1, resistance_ohm = 0 }\n[[motors]]\nlabel = \"one\"\nmotor = \"AM 60 A\"\n";
    let hub = Hub::served_with(&["--scenario", &scenario("no-battery", text)]);
    let document = status(&hub);
    assert_eq!(document["battery_v"], Value::Null);
    // Three channels have no motor.
    assert_eq!(document["motor_alerts"], serde_json::json!([]));
    let shown = out(&client(&hub, &["status"]));
    assert!(shown.lines().any(|line| line.contains("battery") && line.contains("unknown")), "{shown}");
}

#[test]
fn a_motor_runs_with_a_constant_current_up_to_its_speed_limit() {
    let hub = Hub::served();
    let folder = folder("constant-current");
    let drive = ["current", "0", "-0.6", "--speed-limit-cps", "500", "--for-s", "1.5"];
    out(&record(&hub, &folder, &drive));
    let rows = rows(&folder);
    assert!(rows.iter().all(|row| row["setpoint"] == "current" && row["setpoint_value"] == "-0.6"));
    let number = |row: &HashMap<String, String>, key: &str| row[key].parse::<f64>().unwrap();
    // The motor accelerates with the current until it is as fast as its limit.
    let largest = rows.iter().map(|row| number(row, "current_a")).fold(0.0, f64::max);
    assert!((largest - 0.6).abs() < 0.05, "{largest} A");
    let last = number(rows.last().unwrap(), "speed_estimate_cps");
    assert!((last + 500.0).abs() < 40.0, "{last} counts/s");
    let shown = out(&client(&hub, &["current", "0", "0.2", "--for-s", "0.3"]));
    assert!(shown.contains("motor 0: ") && shown.contains(" A\n"), "{shown}");
    assert_eq!(status(&hub)["motors"][0]["enabled"], false);
}

#[test]
fn a_recording_that_is_interrupted_is_whole_and_drawn() {
    let hub = Hub::served();
    let folder = folder("interrupted");
    let record = ["record", "--out", folder.to_str().unwrap(), "power", "1", "0.3"];
    let process = start_client(&hub.place, &record);
    let csv = folder.join("record.csv");
    // Rows are written while the motor runs.
    let lines = || std::fs::read_to_string(&csv).map_or(0, |text| text.lines().count());
    wait_for("20 lines", || (lines() >= 20).then_some(()));
    signal(process.id(), "-INT");
    let output = process.wait_with_output().unwrap();
    fails(&output, 1, "disabled motor 1");
    let rows = rows(&folder);
    assert!(rows.iter().all(|row| row["setpoint_value"] == "9830"), "{:?}", rows.last());
    // The control value is 0 until the first control tick.
    assert!(rows.iter().rev().take(10).all(|row| row["control"] == "9830"), "{:?}", rows.last());
    assert!(folder.join("motor-1.svg").exists());
}

#[test]
fn tune_configures_identifies_and_stores_a_motor() {
    let hub = Hub::served_with(&["--store", &store("tune-store")]);
    fails(&client(&hub, &["tune", "1", "--type", "Nope"]), 2, "Nope");
    // A refused identification keeps the set-up and stores nothing.
    let refused = client(&hub, &["tune", "1", "--type", "NeveRest 20", "--travel-counts", "3", "--save"]);
    fails(&refused, 1, "motor 1 was not identified: refused: the travel");
    fails(&refused, 1, "its set-up is in force");
    let stored = |hub: &Hub| json(&client(hub, &["settings", "show", "--json"]))["stored"].clone();
    assert_eq!(stored(&hub), "nothing");
    let set_up = json(&client(&hub, &["setup", "1", "--json"]));
    assert!(set_up["continuous_current_a"].as_f64().unwrap() > 1.0, "{set_up}");
    assert_eq!(set_up["motion"]["decay_per_s"], Value::Null);

    let begun = std::time::Instant::now();
    let tuned = json(&client(&hub, &["tune", "1", "--type", "NeveRest 20", "--save", "--json"]));
    assert!(begun.elapsed().as_secs() < 10);
    assert_eq!((&tuned["catalogue"], &tuned["outcome"]), (&"NeveRest 20".into(), &"found".into()));
    // Without --gentle the motor takes what the battery gives.
    assert_eq!((&tuned["motion"]["acceleration_cps2"], &tuned["saved"]), (&Value::Null, &true.into()));
    assert_eq!(stored(&hub), "whole");
    assert_eq!(json(&client(&hub, &["setup", "1", "--json"]))["motion"], tuned["motion"]);
    assert_eq!(status(&hub)["motors"][1]["enabled"], false);
}

#[test]
fn tune_warns_of_a_wrong_type_and_says_what_a_hub_assumes_without_a_type() {
    let text = "[[motors]]\nlabel = \"a\"\nmotor = \"NeveRest 60\"\nconfigured = \"nothing\"\n";
    let hub = Hub::served_with(&["--scenario", &scenario("tune-type", text)]);
    let tuned = client(&hub, &["tune", "0", "--gentle"]);
    assert_eq!(err(&tuned), "note: no --type given, and a hub that was never set up assumes a NeveRest 60\n");
    // The back EMF found is shown beside that of the catalogue, with its standard error.
    let shown = out(&tuned);
    for says in ["turns at most", "back EMF and drag", "off by", "inertia", "in force until the hub's reset"]
    {
        assert!(shown.contains(says), "{says}: {shown}");
    }
    // With --gentle the acceleration has a limit.
    assert!(!shown.contains("no limit") && !shown.contains("not configured"), "{shown}");
    assert!(shown.lines().all(|line| line.chars().count() <= 80), "{shown}");
    let refused = client(&hub, &["tune", "0", "--travel-counts", "300"]);
    fails(&refused, 1, "allow more travel, at least 7");
    fails(&refused, 1, "acceleration per volt, decay and friction that were configured before stay in force");
    let other = client(&hub, &["tune", "0", "--type", "Matrix 12 V", "--json"]);
    let warning = json(&other)["warning"].as_str().expect("a warning").to_owned();
    assert!(warning.starts_with("probably not a Matrix 12 V: "), "{warning}");
    assert_eq!(err(&other), format!("warning: {warning}\n"));
}
