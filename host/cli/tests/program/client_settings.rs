//! `motor-hub client settings` against a served hub that keeps its settings in a file.

use crate::common::{
    client, fails, json, motor_hub, motor_hub_with_files_of, out, printed, start_client, store, wait_for,
    write,
};
use crate::conformance::Hub;
use crate::hub_support::{Hub as FakeHub, Server};
use motor_hub::extension::HubFunction;
use motor_hub::store::Found;
use serde_json::Value;
use std::fs::Permissions;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::sync::atomic::Ordering;

/// A hub that keeps its settings in this file.
fn served(store: &str) -> Hub {
    Hub::served_with(&["--store", store])
}

fn settings(hub: &Hub, arguments: &[&str]) -> String {
    out(&client(hub, &[&["settings"], arguments].concat()))
}

fn shown(hub: &Hub) -> Value {
    json(&client(hub, &["settings", "show", "--json"]))
}

/// Changes a setting of every kind from its default. A file gives motor 0 its dynamics, as an identification does in some seconds.
fn set_much(hub: &Hub, file: &str) {
    for arguments in [
        &["setup", "0", "--type", "AM 60 A", "--scheme", "D", "--blend", "0.25", "--on-fault", "brake"][..],
        &["setup", "1", "--scheme", "none", "--duty", "linear-duty", "--bridge", "vnh5019"],
        &["setup", "3", "--scheme", "D", "--continuous-current-a", "1.234", "--current-limit-a", "0.9"],
        &["coefficients", "2", "velocity", "--p", "1.5", "--i", "-0.001", "--f", "7"],
        &[
            &["drive", "straight=1", "--wheel-diameter-mm", "90.5", "--track-mm", "301.25"][..],
            &["--counts-per-turn", "1680,-1680.5", "--wheels", "1,3", "--use-gyro"],
        ]
        .concat(),
    ] {
        out(&client(hub, arguments));
    }
    let second = "\n[[motor]]\nnumber = 1\n";
    let dynamics = "\n[motor.dynamics]\nacceleration_cps2_per_v = 2000\ndecay_per_s = 8\nfriction_mv = 300\n";
    let exported = settings(hub, &["export"]);
    std::fs::write(file, exported.replace(second, &[dynamics, second].concat())).unwrap();
    settings(hub, &["import", file]);
    assert!(settings(hub, &["export"]).contains("acceleration_cps2_per_v = 2000"));
}

#[test]
fn what_is_saved_outlasts_the_hub_and_what_is_not_does_not() {
    let store = store("settings-outlast");
    let file = format!("{store}.toml");
    let hub = served(&store);
    let factory = settings(&hub, &["export"]);
    assert_eq!((&shown(&hub)["stored"], &shown(&hub)["differs"]), (&"nothing".into(), &false.into()));
    set_much(&hub, &file);
    assert_eq!(shown(&hub)["differs"], true);
    assert!(settings(&hub, &["show"]).contains("other settings, until the next reset"));
    assert_eq!(settings(&hub, &["save"]), "stored: save 1\n");
    let saved = settings(&hub, &["export"]);
    assert_ne!(saved, factory);
    out(&client(&hub, &["setup", "2", "--scheme", "B"]));
    drop(hub);

    let hub = served(&store);
    assert_eq!(settings(&hub, &["export"]), saved);
    assert_eq!((&shown(&hub)["number"], &shown(&hub)["differs"]), (&1.into(), &false.into()));
    out(&client(&hub, &["setup", "2", "--scheme", "B"]));
    assert!(settings(&hub, &["load"]).contains("save 1"));
    assert_eq!(settings(&hub, &["export"]), saved);
    // The address is stored immediately, without a save.
    out(&client(&hub, &["set-address", "9"]));
    // The address is written after the hub has answered.
    let written = (0..20).any(|_| shown(&hub)["number"] == 2);
    assert!(written, "{}", shown(&hub));
    drop(hub);

    let hub = served(&store);
    assert!(out(&client(&hub, &["discover"])).contains('9'));
    assert_eq!(settings(&hub, &["export"]), saved);
    settings(&hub, &["reset"]);
    assert_eq!(settings(&hub, &["export"]), factory);
    drop(hub);
    let hub = served(&store);
    assert_eq!(settings(&hub, &["export"]), factory);
    assert!(out(&client(&hub, &["discover"])).contains('2'));
}

#[test]
fn exported_settings_are_imported_bit_by_bit() {
    let store = store("settings-round");
    let file = format!("{store}.toml");
    let hub = served(&store);
    set_much(&hub, &file);
    let exported = settings(&hub, &["export"]);
    assert_eq!(settings(&hub, &["export", &file]), format!("wrote {file}\n"));
    // A dash is standard output, and no file.
    assert_eq!(settings(&hub, &["export", "-"]), exported);
    assert!(!Path::new("-").exists());
    drop(hub);

    let hub = Hub::served_with(&["--store", &format!("{store}-2")]);
    assert_ne!(settings(&hub, &["export"]), exported);
    assert!(settings(&hub, &["import", &file, "--save"]).contains("stored: save 1"));
    assert_eq!(settings(&hub, &["export"]), exported);
    // A file may have one motor only, without the optional keys.
    let one = exported.split("[[motor]]").take(2).collect::<Vec<_>>().join("[[motor]]");
    assert!(one.contains("number = 0") && !one.contains("number = 1"), "{one}");
    std::fs::write(&file, one + "\n# end\n").unwrap();
    settings(&hub, &["import", &file]);
    assert_eq!(settings(&hub, &["export"]), exported);
}

#[test]
fn a_file_that_cannot_be_replaced_stays_as_it_was() {
    let store = store("settings-full-disk");
    let hub = served(&store);
    let folder = Path::new(&store).parent().unwrap();
    let file = write(folder, "kept.toml", "kept");
    let link = folder.join("link.toml");
    std::os::unix::fs::symlink(&file, &link).unwrap();
    let export = ["client", "--tcp", &hub.place, "settings", "export", link.to_str().unwrap()];
    fails(&motor_hub_with_files_of(1, &export), 1, "link.toml: File too large");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "kept");
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), 3, "store, file and link");
    // On success the link and the permissions stay.
    std::fs::set_permissions(&file, Permissions::from_mode(0o640)).unwrap();
    out(&motor_hub(&export));
    assert_eq!(std::fs::read_to_string(&file).unwrap(), settings(&hub, &["export"]));
    assert_eq!(std::fs::metadata(&file).unwrap().mode() & 0o777, 0o640);
    assert_eq!(std::fs::read_link(&link).unwrap(), Path::new(&file));
    // A device is written, and not replaced.
    fails(&client(&hub, &["settings", "export", "/dev/full"]), 1, "/dev/full: No space left on device");
}

#[test]
fn a_file_that_was_cut_or_has_no_end_is_refused() {
    let store = store("settings-cut");
    let file = format!("{store}.toml");
    let hub = served(&store);
    let exported = settings(&hub, &["export"]);
    for (cut, _) in exported.match_indices("\n[") {
        std::fs::write(&file, &exported[..cut + 1]).unwrap();
        fails(&client(&hub, &["settings", "import", &file]), 2, "is missing");
    }
    fails(&client(&hub, &["settings", "import", "/dev/zero"]), 2, "more than 1048576 bytes");
}

#[test]
fn settings_of_which_a_reset_has_deleted_a_part_are_not_exported() {
    let mut hub = FakeHub::running_for(60_000);
    hub.responder.restore(Found::default());
    let reading = hub.lose_replies(|packet| packet.id == HubFunction::Base.id());
    let server = Server::start(hub);
    let file = format!("{}.toml", store("settings-export-reset"));
    let process = start_client(&server.address, &["settings", "export", &file]);
    wait_for("the export", || reading.load(Ordering::Relaxed).then_some(()));
    *server.hub() = FakeHub::running_for(20);
    fails(&process.wait_with_output().unwrap(), 1, "the hub was reset meanwhile");
    assert!(!Path::new(&file).exists());
}

#[test]
fn settings_that_a_reset_has_deleted_are_not_reported_as_stored() {
    let running_for = |ms: u64| {
        let mut hub = FakeHub::running_for(ms);
        hub.responder.restore(Found::default());
        hub
    };
    let mut hub = running_for(60_000);
    let saving = hub.lose_replies(|packet| packet.id == HubFunction::Save.id());
    let server = Server::start(hub);
    let file = format!("{}.toml", store("settings-reset"));
    out(&motor_hub(&["client", "--tcp", &server.address, "settings", "export", &file]));
    let process = start_client(&server.address, &["settings", "import", &file, "--save"]);
    wait_for("the save", || saving.load(Ordering::Relaxed).then_some(()));
    *server.hub() = running_for(20);
    fails(&process.wait_with_output().unwrap(), 1, "the hub was reset meanwhile");
}

#[test]
fn all_of_a_file_is_checked_before_anything_is_written() {
    let store = store("settings-checked");
    let file = format!("{store}.toml");
    let hub = served(&store);
    set_much(&hub, &file);
    let exported = settings(&hub, &["export"]);
    settings(&hub, &["reset"]);
    let factory = settings(&hub, &["export"]);
    let line =
        |key: &str| -> String { exported.lines().rfind(|line| line.starts_with(key)).unwrap().to_owned() };
    let (resistance, mode, emf) = (line("resistance_ohm"), line("mode"), line("emf_mv_s_per_count"));
    for (from, to, says) in [
        (resistance.as_str(), "resistance_ohm = 0.0", "resistance"),
        (&resistance, "resistance_ohm = 900.0", "resistance"),
        (&emf, "emf_mv_s_per_count = 40.0", "emf_mv_s_per_count is 40.0; allowed is 0.000001 to 31.999999"),
        (&mode, "mode = \"sideways\"", "sideways"),
        (&mode, "mood = \"power\"", "mood is no setting; allowed are emf_mv_s_per_count, resistance_ohm, "),
        (
            "continuous_current_ma",
            "continuos_ma",
            "thermal.continuos_ma is no setting; allowed are thermal.continuous_current_ma, thermal.winding_s",
        ),
        ("motor.thermal", "motor.heat", "heat.case_s is no setting; allowed are emf_mv_s_per_count, "),
        ("schema_version = 1", "version = 1", "schema_version is missing; write schema_version = 1"),
        (
            "schema_version = 1",
            "schema_version = 1\nmotors = 4",
            "motors is no key of a settings file; allowed are schema_version, ",
        ),
        ("number = 3", "number = 4", "the number of a motor is 4; a number is 0 to 3"),
        ("number = 3", "", "a [[motor]] has no number"),
        ("number = 3", "number = ", "line "),
        ("number = 3", "number = 0", "occurs once"),
        ("schema_version = 1", "schema_version = 2", "schema_version is 2"),
        ("continuous_current_ma = 1234", "continuous_current_ma = 0", "thermal"),
        (
            "current_limit_ma = 900",
            "current_limit_ma = 65536",
            "current_limit_ma is 65536; allowed is 1 to 65535",
        ),
        ("p = 1.5", "p = 1e9", "velocity_loop.p is 1000000000.0; allowed is -32768 to 32767.9999847"),
        ("blend = 0.25", "blend = 1.5", "blend"),
        ("track_mm = 301.25", "track_mm = 20000.0", "track of 1 mm to 10 m"),
        ("wheels = [1, 3]", "wheels = [1, 4]", "allowed are motors of 0 to 3"),
        ("use_gyro = true", "use_gyro = 1", "base: "),
        ("use_gyro = true", "use_gyros = true", "base: "),
    ] {
        assert!(exported.contains(from), "{from}: {exported}");
        // The last occurrence is changed, so that all settings before it would have been written.
        let at = exported.rfind(from).unwrap();
        let text = format!("{}{to}{}", &exported[..at], &exported[at + from.len()..]);
        std::fs::write(&file, text).unwrap();
        let refused = client(&hub, &["settings", "import", &file]);
        fails(&refused, 2, says);
        fails(&refused, 2, &file);
    }
    assert_eq!(settings(&hub, &["export"]), factory);
    fails(&client(&hub, &["settings", "import", "/nowhere/at-all.toml"]), 2, "/nowhere/at-all.toml");
}

#[test]
fn commands_for_stored_settings_fail_at_a_hub_without_a_store() {
    let hub = Hub::served();
    let file = format!("{}.toml", store("settings-none"));
    let with_store = served(&store("settings-of-another"));
    settings(&with_store, &["export", &file]);
    for what in ["show", "save", "load", "reset"] {
        fails(
            &client(&hub, &["settings", what]),
            1,
            "this hub does not have it (NACK 253); a simulated hub stores",
        );
    }
    fails(&client(&hub, &["settings", "export"]), 1, "export needs a hub that stores settings");
    let imported = client(&hub, &["settings", "import", &file, "--save"]);
    fails(&imported, 1, "this hub does not have it");
    assert_eq!(printed(&imported), format!("the settings of {file} are in force\n"));
    let said = out(&client(&hub, &["set-address", "9"]));
    assert_eq!(said, "the hub's address is 9 until the next reset: the hub stores no settings\n");
}

#[test]
fn a_store_with_unreadable_data_counts_as_empty_and_can_be_written() {
    let store = store("settings-nonsense");
    // Both pages are in use, and hold unreadable data.
    let mut bytes = vec![0xFF; 32 * 1024];
    bytes[..4].fill(0);
    bytes[4..12].copy_from_slice(&[1, 2, 3, 4, 0xF0, 0x30, 0, 0]);
    std::fs::write(&store, bytes).unwrap();
    let hub = served(&store);
    assert_eq!(shown(&hub)["stored"], "nothing");
    assert_eq!(settings(&hub, &["save"]), "stored: save 1\n");
}

#[test]
fn an_address_that_settings_of_a_later_firmware_keep_from_being_stored_lasts_until_the_next_reset() {
    let store = store("settings-later");
    // The mark of the first page, then an item of sequential-storage: check sums and length, key 1, and a record of
    // version 2 with one byte.
    let begin = [
        0, 0, 0, 0, 0x9F, 0xB7, 0x89, 0x23, 0x07, 0x00, 0x31, 0xF5, 0x01, 0x02, 0x01, 0x00, 0x00, 0x00, 0x2A,
    ];
    let mut bytes = vec![0xFF; 32 * 1024];
    bytes[..begin.len()].copy_from_slice(&begin);
    std::fs::write(&store, bytes).unwrap();
    let hub = served(&store);
    assert_eq!(shown(&hub)["stored"], "later");
    let said = out(&client(&hub, &["set-address", "9"]));
    assert!(said.contains("the hub's address is 9 until the next reset: "), "{said}");
    assert!(said.contains("settings of a later firmware (version 2)"), "{said}");
}
