//! Hubs that refuse requests or do not answer, and other makers' hubs with two motors.
#![expect(clippy::unwrap_used, clippy::indexing_slicing, reason = "a failed access is a failed test")]

#[path = "../../client/tests/hub_support/mod.rs"]
mod hub_support;
mod memory;
mod page;

use dashboard::proposal::catalogue_motor;
use dashboard::{Opened, Place};
use hub_support::{Hub, Memory, SLOT, Server, first, responder_at, started};
use memory::Local;
use motor_hub::braking::Winding;
use motor_hub::extension::settings::Group;
use motor_hub::extension::state::StoreReport;
use motor_hub::extension::{HubFunction, Request};
use motor_hub::motor::{Setpoint, Settings};
use motor_hub::protocol::motor::{Loop, LoopCoefficients, Terms, ToMotor};
use motor_hub::protocol::{Address, CHANNELS, Nack, Packet, Reply};
use motor_hub::regulator::Kind;
use motor_hub::regulator::identify::{Identification, Identified};
use motor_hub::store::{Found, Outcome};
use motor_hub::units::{Coefficient, Millivolts};
use motor_hub::update::{Booted, Phase};
use motor_hub_client::Session;
use motor_hub_client::session::TRANSMISSIONS;
use page::Page;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

/// A page of hubs in memory. The relay can open the line once, so a dropped session is never opened again.
fn page_of(hubs: Vec<Hub>) -> Page<Local> {
    let addresses: Vec<Address> = hubs.iter().map(|hub| hub.responder.address()).collect();
    let mut line = Some(Memory::of(hubs));
    let open = move |_| {
        let line = line.take().ok_or("the session was dropped")?;
        let session = Session::new(line, addresses[0], Duration::from_millis(300));
        Ok(Opened { session, hubs: addresses.iter().map(|address| address.get()).collect() })
    };
    memory::page(Place::new("hubs in memory", open))
}

/// A page of a hub that listens at a TCP port, so that a lost hub can be connected again. `address` is that of the hub;
/// `None` for the parent.
fn page_of_server(hub: Hub, address: Option<Address>) -> (Server, Page<Local>) {
    let server = Server::start(hub);
    let place = server.address.clone();
    let open = move |address| dashboard::hub::open(&place, address).map_err(|error| error.to_string());
    (server, memory::page(Place { address, ..Place::new("a hub", open) }))
}

/// Refuses requests for settings of a motor.
fn without_settings(packet: &Packet) -> Option<Reply> {
    Group::ALL.iter().any(|group| group.get_id() == packet.id).then_some(Reply::Nack(Nack::UNSUPPORTED))
}

#[test]
fn the_settings_of_a_hub_with_two_motors_are_exported() {
    let answer = |packet: &Packet| {
        let is_of_a_motor = Group::ALL.iter().any(|group| group.get_id() == packet.id);
        let is_refused = is_of_a_motor && packet.payload.first().is_some_and(|motor| *motor >= 2);
        is_refused.then_some(Reply::Nack(Nack::parameter(0)))
    };
    let mut page = page_of(vec![Hub { answer, ..Hub::new() }]);
    page.order("export", Value::Null);
    let file = page.message("file");
    assert_eq!(file["text"].as_str().unwrap().matches("[[motor]]").count(), 2, "{file}");
}

/// Result of an identification of a NeveRest 60.
fn identified() -> Identified {
    let (_, dynamics) = catalogue_motor(&Settings::new(Winding::NEVEREST_60)).unwrap();
    Identified {
        dynamics,
        emf: Winding::NEVEREST_60.emf,
        emf_is_configured: false,
        gain_error: 1,
        decay_error: 1,
        emf_error: 1,
        friction_error: Millivolts::new(1),
        residual: 1,
    }
}

#[test]
fn a_refusal_at_the_end_of_an_identification_ends_it_and_disables_the_motor() {
    let mut hub = Hub { answer: without_settings, ..Hub::new() };
    hub.snapshot.motors[0].identification = Identification::Found(identified());
    let mut page = page_of(vec![hub]);
    page.order("identify", json!({ "motor": 0 }));
    page.message("frame");
    assert!(page.enabled(0));
    let ended = page.until("a refusal", |_, message| message["state"] == "refused");
    assert!(ended["why"].as_str().unwrap().contains("the hub refuses to"), "{ended}");
    page.message("frame");
    assert!(!page.enabled(0));
}

#[test]
fn a_second_identification_a_scenario_and_changes_of_settings_are_refused_while_one_runs() {
    let mut page = page_of(vec![Hub::new()]);
    page.order("identify", json!({ "motor": 1 }));
    for (order, fields) in [
        ("identify", json!({ "motor": 2 })),
        ("acceleration", json!({ "motor": 1, "limit": 500 })),
        ("reset-encoder", json!({ "motor": 1 })),
        ("load", Value::Null),
        ("play", Value::Null),
    ] {
        let why = page.refused(order, fields);
        assert_eq!(why, "motor 1 is being identified: wait for its end, or press STOP", "{order}");
    }
    page.message("frame");
    assert!(page.enabled(1) && !page.enabled(2));
}

#[test]
fn a_hub_that_was_reset_on_an_open_line_is_noticed_and_has_nothing_to_undo() {
    const DAY_MS: u64 = 24 * 60 * 60 * 1_000;
    for ms in [60_000, 40 * DAY_MS] {
        let (server, mut page) = page_of_server(Hub::running_for(ms), None);
        assert_eq!(page.settings("configure", current_limit())["undoable"], 1);
        page.message("frame");
        *server.hub() = Hub::running_for(20);
        let is_of_motor_0 = |message: &Value| message["kind"] == "settings" && message["motor"] == 0;
        let settings = page.until("new settings", |_, message| is_of_motor_0(message));
        assert_eq!(settings["undoable"], 0, "{settings}");
        page.notice("the hub was reset");
    }
}

#[test]
fn a_proposal_is_for_the_winding_that_was_identified_and_comes_into_force_by_apply_only() {
    let mut hub = Hub::new();
    let (found, gain) = (identified(), f64::from(identified().dynamics.gain.to_f32()));
    hub.snapshot.motors[0].identification = Identification::Found(found);
    let mut page = page_of(vec![hub]);
    page.order("identify", json!({ "motor": 0 }));
    page.until("a result", |_, message| message["state"] == "found");
    let mut dynamics = |order: &str, fields: Value| page.settings(order, fields)["dynamics"].clone();
    let [model, pid] = ["model", "pid"].map(|kind| json!({ "motor": 0, "kind": kind }));
    let motor = json!({ "motor": 0 });
    assert_eq!(dynamics("regulator", model.clone()), Value::Null);
    assert_eq!(dynamics("apply", motor.clone())["gain"], gain);
    assert_eq!(dynamics("regulator", pid)["gain"], gain);
    assert_eq!(dynamics("regulator", model)["gain"], gain);
    dynamics("configure", json!({ "motor": 0, "values": { "resistance_ohm": 1.5 } }));
    let why = page.refused("apply", motor.clone());
    assert!(why.contains("not identified yet"), "{why}");
    page.settings("undo", motor.clone());
    assert_eq!(page.settings("apply", motor)["dynamics"]["gain"], gain);
}

#[test]
fn pid_keeps_its_coefficients_when_the_set_up_of_its_motor_changes() {
    let mut hub = Hub::new();
    hub.snapshot.motors[0].regulator = Kind::Pid;
    let mut page = page_of(vec![hub]);
    let pidf = json!([1.5, 0.25, 0.0, 2.0]);
    for (order, fields) in [
        ("coefficients", json!({ "motor": 0, "of": "velocity", "pidf": pidf })),
        ("set-up", json!({ "motor": 0, "scheme": "D", "duty": "linear-duty" })),
        ("configure", json!({ "motor": 0, "values": { "resistance_ohm": 1.5 } })),
    ] {
        assert_eq!(page.settings(order, fields)["velocity"], pidf, "{order}");
    }
}

#[test]
fn a_set_up_with_scheme_d_keeps_the_blend() {
    let mut page = page_of(vec![Hub::new()]);
    let values = json!({ "motor": 0, "values": { "scheme": "D", "blend": 0.25 } });
    let fixed = page.settings("configure", values)["scheme"].clone();
    assert_eq!(fixed["blend"], 0.25, "{fixed}");
    let mut set_up = |scheme| {
        page.settings("set-up", json!({ "motor": 0, "scheme": scheme, "duty": "linear-duty" }))["scheme"]
            .clone()
    };
    assert_eq!(set_up("D"), fixed);
    set_up("B");
    assert_ne!(set_up("D"), fixed);
}

#[test]
fn a_setting_without_effect_is_refused_with_the_setting_that_it_needs() {
    let mut page = page_of(vec![Hub::new()]);
    for (values, why) in [
        (json!({ "blend": 0.5 }), "blend has no effect without scheme D: set scheme D too"),
        (
            json!({ "thermal.winding_s": 20, "current_limit_ma": 2000 }),
            "thermal.winding_s has no effect without thermal.continuous_current_ma: \
             set thermal.continuous_current_ma too",
        ),
        (
            json!({ "dynamics.decay_per_s": 3 }),
            "dynamics.decay_per_s has no effect without dynamics.acceleration_cps2_per_v: \
             set dynamics.acceleration_cps2_per_v too",
        ),
        (json!({ "current_limit_ma": null }), "no setting has changed"),
    ] {
        assert_eq!(page.refused("configure", json!({ "motor": 0, "values": values })), why);
    }
    let both = json!({ "thermal.winding_s": 20, "thermal.continuous_current_ma": 900 });
    assert_eq!(page.settings("configure", json!({ "motor": 0, "values": both }))["undoable"], 1);
}

/// Fields of an order that gives motor 0 a current limit.
fn current_limit() -> Value {
    json!({ "motor": 0, "values": { "current_limit_ma": 2000 } })
}

/// Reports that the last access to the memory of stored settings has failed.
fn with_failed_access(packet: &Packet) -> Option<Reply> {
    let report = StoreReport { outcome: Outcome::Refused, ..StoreReport::default() };
    match packet.id {
        id if id == HubFunction::Stored.id() => Some(Reply::data(&report)),
        id if [HubFunction::Save, HubFunction::Load, HubFunction::Reset].map(|of| of.id()).contains(&id) => {
            Some(Reply::ACK)
        }
        _ => None,
    }
}

#[test]
fn a_failed_load_or_reset_is_named_and_keeps_the_undo_list() {
    let mut page = page_of(vec![Hub { answer: with_failed_access, ..Hub::new() }]);
    assert_eq!(page.settings("configure", current_limit())["undoable"], 1);
    for (order, failure) in [
        ("load", "the stored settings are not loaded: "),
        ("reset", "the stored settings are not reset: "),
        ("save", "settings are not saved: "),
    ] {
        page.order(order, Value::Null);
        let notice = page.notice("the hub's memory");
        assert!(notice.starts_with(failure), "{notice}");
    }
    assert_eq!(page.settings("undo", json!({ "motor": 0 }))["undoable"], 0);
}

#[test]
fn an_address_of_another_hub_of_the_chain_is_refused() {
    let hub = |address| Hub { responder: responder_at(address), ..Hub::new() };
    let mut page = page_of(vec![hub(2), hub(3)]);
    let why = page.refused("address", json!({ "new": 3 }));
    assert_eq!(why, "another hub of the chain has address 3: choose another address");
}

/// Returns a hub whose replies are lost while `is_silent` is true.
fn hub_that_falls_silent(address: u8, is_silent: &Arc<AtomicBool>) -> Hub {
    let is_silent = Arc::clone(is_silent);
    let loses_reply = Box::new(move |_: &Packet| is_silent.load(Ordering::Relaxed));
    Hub { responder: responder_at(address), loses_reply, ..Hub::new() }
}

#[test]
fn a_motor_is_enabled_by_a_set_point_only_if_the_set_point_is_accepted() {
    let mut page = page_of(vec![Hub::new()]);
    page.enable(0);
    page.stop();
    for (order, fields) in [
        ("drive", json!({ "motor": 0, "mode": "velocity", "value": 0, "tolerance": 70_000, "enable": true })),
        ("drive", json!({ "motor": 0, "mode": "position", "value": 0, "speed": 0, "enable": true })),
        ("current", json!({ "motor": 0, "amperes": 0, "speed": 0, "enable": true })),
    ] {
        let why = page.refused(order, fields);
        page.message("frame");
        assert!(!page.enabled(0), "{why}");
    }
    for speed in [0, -300] {
        let fields = json!({ "motor": 0, "mode": "position", "value": 0, "speed": speed });
        assert!(page.refused("drive", fields).contains("allowed is 1 to 32767 counts/s"));
    }
    page.order("drive", json!({ "motor": 0, "mode": "velocity", "value": 0, "enable": true }));
    page.order("current", json!({ "motor": 1, "amperes": 0.5, "enable": true }));
    page.until("two enabled motors", |page, _| page.enabled(0) && page.enabled(1));
}

#[test]
fn motors_do_not_move_in_step_with_a_motor_that_has_a_fault() {
    let mut hub = Hub::new();
    hub.snapshot.motors[1].faults.bridge = true;
    hub.snapshot.motors[2].faults.encoder_stale = true;
    let setpoints = Arc::clone(&hub.setpoints);
    let mut page = page_of(vec![hub]);
    page.enable(1);
    setpoints.lock().unwrap().clear();
    for (order, fields) in [
        ("together", json!({ "by": [100, 100, null, null], "speed": 500, "acceleration": 1000 })),
        ("turn", json!({ "at": [100, 100, null, null], "acceleration": 1000 })),
    ] {
        let why = page.refused(order, fields);
        let fault = "motor 1: the bridge switched itself off: disable the motor, then enable it again";
        assert_eq!(why, fault, "{order}");
    }
    let without_encoder = json!({ "at": [null, null, 100, null], "acceleration": 1000 });
    assert_eq!(page.refused("turn", without_encoder), "motor 2: the hub gets no reading from its encoder");
    page.message("frame");
    assert!(!page.enabled(0));
    assert_eq!(*setpoints.lock().unwrap(), []);
}

#[test]
fn a_file_is_refused_if_the_order_before_has_enabled_a_motor() {
    for foreign in [false, true] {
        let mut page = page_of(vec![Hub { foreign, ..Hub::new() }]);
        page.message("frame");
        page.order("drive", json!({ "motor": 0, "mode": "power", "value": 0.3, "enable": true }));
        // There was no frame since the order before.
        let why = page.refused("import", json!({ "text": "" }));
        assert!(why.starts_with("a motor is enabled"), "{why}");
    }
}

#[test]
fn a_stop_disables_the_motors_of_all_hubs_although_a_child_does_not_answer() {
    let [silent_child, child] = [Arc::new(AtomicBool::new(false)), Arc::default()];
    let hubs = vec![
        hub_that_falls_silent(2, &child),
        hub_that_falls_silent(3, &silent_child),
        hub_that_falls_silent(4, &child),
    ];
    let mut page = page_of(hubs);
    page.enable(0);
    page.order("hub", json!({ "address": 4 }));
    page.shows(2);
    page.enable(0);
    silent_child.store(true, Ordering::Relaxed);
    let text = page.stop();
    assert!(text.starts_with("not all motors could be disabled (stopped): hub 3 does not answer"), "{text}");
    let hubs = page.until("a lost hub", |_, message| message["hubs"][1]["lost"] == true);
    assert_eq!((&hubs["hubs"][0]["running"], &hubs["hubs"][2]["running"]), (&json!([]), &json!([])));
    assert_eq!(page.stop(), "all motors are disabled: stopped");
}

#[test]
fn a_child_that_was_lost_is_found_again_with_its_motors_disabled() {
    let is_silent = Arc::new(AtomicBool::new(false));
    let parent = Hub { responder: responder_at(2), ..Hub::new() };
    let mut page = page_of(vec![parent, hub_that_falls_silent(3, &is_silent)]);
    page.order("hub", json!({ "address": 3 }));
    page.shows(1);
    page.enable(0);
    page.order("hub", json!({ "address": 2 }));
    page.shows(0);
    is_silent.store(true, Ordering::Relaxed);
    page.until("a lost hub", |_, message| message["hubs"][1]["lost"] == true);
    is_silent.store(false, Ordering::Relaxed);
    page.notice("hub 3 answers again, with its motors disabled");
    page.order("hub", json!({ "address": 3 }));
    let hubs = page.shows(1);
    assert_eq!(hubs["hubs"][1]["lost"], false, "{hubs}");
    page.message("frame");
    assert!(!page.enabled(0));
}

#[test]
fn an_order_to_a_child_that_does_not_answer_shows_the_parent() {
    for (order, fields) in [
        ("led", json!({ "colour": [0, 0, 255] })),
        ("identify", json!({ "motor": 0 })),
        ("save", Value::Null),
        ("configure", current_limit()),
    ] {
        let is_silent = Arc::new(AtomicBool::new(false));
        let parent = Hub { responder: responder_at(2), ..Hub::new() };
        let mut page = page_of(vec![parent, hub_that_falls_silent(3, &is_silent)]);
        page.order("hub", json!({ "address": 3 }));
        page.shows(1);
        is_silent.store(true, Ordering::Relaxed);
        page.order(order, fields);
        let hubs = page.shows(0);
        assert_eq!(hubs["hubs"][1]["lost"], true, "{order}: {hubs}");
    }
}

#[test]
fn an_order_that_was_given_for_a_lost_child_does_not_drive_the_parent() {
    let is_silent = Arc::new(AtomicBool::new(false));
    let parent = Hub { responder: responder_at(2), ..Hub::new() };
    let setpoints = Arc::clone(&parent.setpoints);
    let mut page = page_of(vec![parent, hub_that_falls_silent(3, &is_silent)]);
    page.enable(0);
    page.order("hub", json!({ "address": 3 }));
    page.shows(1);
    page.message("frame");
    is_silent.store(true, Ordering::Relaxed);
    setpoints.lock().unwrap().clear();
    let drive = || json!({ "motor": 0, "mode": "velocity", "value": 800 });
    // The first order finds that the child is lost. The page gives the second one before it is told.
    page.order("drive", drive());
    page.order("drive", drive());
    // A held button or a gamepad must end its motion, as after a stop.
    let told = page.until("a notice", |_, message| message["kind"] == "notice");
    assert_eq!(told["motors_disabled"], true, "{told}");
    page.until("the refusal of the second order", |_, message| {
        message["why"].as_str().is_some_and(|why| why.contains("replaced a lost hub"))
    });
    page.message("frame");
    assert_eq!(*setpoints.lock().unwrap(), []);
    page.order("drive", drive());
    page.message("frame");
    assert_eq!(setpoints.lock().unwrap().len(), 1);
}

#[test]
fn a_hub_that_was_lost_has_no_motor_enabled() {
    let (server, mut page) = page_of_server(Hub::new(), None);
    page.enable(0);
    // The hub loses all three transmissions of one request.
    server.hub().deaf_for = 3;
    page.line(false);
    let text = page.stop();
    assert!(text.starts_with("motors could not be disabled"), "{text}");
    page.line(true);
    assert_eq!(server.hub().responder.enabled(), [false; 4]);
    page.until("a disabled motor", |_, message| message["motors"][0]["enabled"] == false);
}

#[test]
fn an_order_that_was_given_while_the_hub_was_lost_moves_nothing_once_the_hub_is_back() {
    let (server, mut page) = page_of_server(Hub::new(), None);
    // The hub loses all three transmissions of one request.
    server.hub().deaf_for = 3;
    page.line(false);
    page.line(true);
    // The order was under way while the relay connected to the hub.
    page.order("drive", json!({ "motor": 0, "mode": "power", "value": 0.3, "enable": true }));
    page.until("a refusal", |_, message| {
        message["why"].as_str().is_some_and(|why| why.contains("repeat the order"))
    });
    assert_eq!(server.hub().responder.enabled(), [false; 4]);
    page.message("frame");
    page.enable(0);
}

#[test]
fn a_hub_that_was_chosen_by_its_address_is_found_again_at_its_new_address() {
    let hub = Hub::new();
    let former = hub.responder.address();
    let (server, mut page) = page_of_server(hub, Some(former));
    page.order("address", json!({ "new": 7 }));
    page.notice("the hub has address 7");
    // The hub loses all three transmissions of one request.
    server.hub().deaf_for = 3;
    page.line(false);
    page.line(true);
    page.message("frame");
}

#[test]
fn a_hub_that_is_lost_just_after_its_address_has_changed_is_found_at_its_new_address() {
    let hub = Hub::new();
    let former = hub.responder.address();
    let (server, mut page) = page_of_server(hub, Some(former));
    page.message("frame");
    server.hub().loses_reply = first(TRANSMISSIONS, |packet| packet.id == HubFunction::Stored.id());
    page.order("address", json!({ "new": 7 }));
    page.line(false);
    page.line(true);
}

#[test]
fn a_save_just_after_a_load_is_refused_until_the_loaded_settings_are_shown() {
    let mut hub = Hub::new();
    hub.responder.restore(Found::default());
    let mut page = page_of(vec![hub]);
    let changed = page.settings("acceleration", json!({ "motor": 0, "limit": 500 }));
    assert_eq!(changed["acceleration"], 500);
    page.order("load", Value::Null);
    assert_eq!(page.refused("save", Value::Null), "a save, load or reset is running: wait for its end");
    page.until("loaded settings", |_, message| {
        message["kind"] == "settings" && message["acceleration"].is_null()
    });
    page.notice("the stored settings are in force");
    page.order("save", Value::Null);
    page.notice("settings are saved");
}

#[test]
fn a_hub_that_does_not_answer_is_not_asked_for_the_settings_of_the_next_motor() {
    let requests = Arc::new(AtomicU32::new(0));
    let counted = Arc::clone(&requests);
    let loses_reply = Box::new(move |packet: &Packet| {
        let is_of_settings = Group::ALL.iter().any(|group| group.get_id() == packet.id);
        counted.fetch_add(is_of_settings.into(), Ordering::Relaxed);
        is_of_settings
    });
    let _page = page_of(vec![Hub { loses_reply, ..Hub::new() }]);
    assert_eq!(requests.load(Ordering::Relaxed), TRANSMISSIONS);
}

#[test]
fn motors_that_turn_together_get_another_speed_without_a_stop() {
    let hub = Hub::new();
    let setpoints = Arc::clone(&hub.setpoints);
    let mut page = page_of(vec![hub]);
    page.message("frame");
    let mut stops = |cps: i32| {
        page.order("turn", json!({ "at": [cps, -300, null, null], "acceleration": 2000 }));
        let setpoints = std::mem::take(&mut *setpoints.lock().unwrap());
        setpoints.iter().filter(|(_, setpoint)| matches!(setpoint, Setpoint::ConstantPower(_))).count()
    };
    assert!(stops(600) > 0, "the motors brake until they turn");
    assert_eq!(stops(700), 0);
}

#[test]
fn a_save_whose_report_is_refused_ends_with_a_notice() {
    let answer = |packet: &Packet| match packet.id {
        id if id == HubFunction::Save.id() => Some(Reply::ACK),
        id if id == HubFunction::Stored.id() => Some(Reply::Nack(Nack::UNSUPPORTED)),
        _ => None,
    };
    let mut page = page_of(vec![Hub { answer, ..Hub::new() }]);
    page.order("save", Value::Null);
    page.notice("whether settings");
    // While a save runs, no other hub can be shown.
    assert_eq!(page.refused("hub", json!({ "address": 9 })), "there is no hub 9 on this line");
}

#[test]
fn a_save_whose_hub_is_lost_ends_with_a_notice() {
    let mut hub = Hub { ends_accesses: false, ..Hub::new() };
    hub.responder.restore(Found::default());
    let (server, mut page) = page_of_server(hub, None);
    page.order("save", Value::Null);
    // The hub loses all three transmissions of one request.
    server.hub().deaf_for = 3;
    page.notice("whether settings are saved is unknown: hub 3 does not answer");
}

#[test]
fn firmware_with_half_a_byte_is_refused() {
    let mut page = page_of(vec![Hub::new()]);
    for hex in ["abc", "+f", "xy"] {
        let why = page.refused("firmware", json!({ "offset": 0, "hex": hex }));
        assert_eq!(why, "the part has other signs than pairs of hexadecimal digits");
    }
}

#[test]
fn a_dashboard_that_ends_while_the_hub_checks_new_firmware_leaves_no_armed_image() {
    let hub = Hub { responder: started(SLOT, Booted::Confirmed), ..Hub::new() };
    let (server, mut page) = page_of_server(hub, None);
    // Stack pointer and reset vector.
    page.order("firmware", json!({ "offset": 0, "hex": "0000022099010208" }));
    page.order("update", json!({ "version": "new" }));
    page.notice("The hub checks the firmware.");
    let why = page.refused("update", json!({ "version": "second" }));
    assert_eq!(why, "an update is running: wait for its end, then send the file again");
    page.connection.relay.end("the server has ended");
    drop(page);
    let report = Session::open(&server.address).unwrap().update_state().unwrap();
    assert_eq!((report.phase, report.received), (Phase::Nothing, 8));
}

/// Refuses requests to the motors 2 and 3, as a hub with two motors.
fn two_motors(packet: &Packet) -> Option<Reply> {
    let of_motor = matches!(Request::read(packet, CHANNELS), Ok(Request::ToMotor(2.., _)));
    of_motor.then_some(Reply::Nack(Nack::parameter(0)))
}

#[test]
fn hubs_with_two_motors_are_shown_and_asked_for_both() {
    let hub =
        |address| Hub { responder: responder_at(address), answer: two_motors, foreign: true, ..Hub::new() };
    let mut page = page_of(vec![hub(2), hub(3)]);
    assert_eq!(page.message("frame")["motors"].as_array().map(Vec::len), Some(2));
    page.order("hub", json!({ "address": 3 }));
    page.shows(1);
    page.enable(1);
    page.order("hub", json!({ "address": 2 }));
    let hubs = page.shows(0);
    assert_eq!(hubs["hubs"][1]["running"], json!([1]));
    // The other hub is asked in every fifth frame.
    for _ in 0..20 {
        page.message("frame");
    }
}

/// Refuses coefficients and the group of the acceleration limit.
fn without_changes(packet: &Packet) -> Option<Reply> {
    let bits = Coefficient::ZERO;
    let coefficients = LoopCoefficients { p: bits, i: bits, d: bits, f: bits, terms: Terms::Pidf };
    let coefficients = ToMotor::SetPidf { of: Loop::Velocity, coefficients }.id();
    [coefficients, Group::Motion.set_id()].contains(&packet.id).then_some(Reply::Nack(Nack::UNSUPPORTED))
}

#[test]
fn a_refused_order_adds_no_undo_and_a_refused_undo_is_kept() {
    let mut page = page_of(vec![Hub { answer: without_changes, ..Hub::new() }]);
    page.message("frame");
    let pidf = [1.0, 0.0, 0.0, 0.0];
    for (order, fields, answered) in [
        ("coefficients", json!({ "motor": 0, "of": "velocity", "pidf": pidf }), "refused"),
        ("acceleration", json!({ "motor": 0, "limit": 1000 }), "refused"),
        ("configure", current_limit(), "settings"),
        // An undo also sends the group of the acceleration limit, which the hub refuses after it has changed others.
        ("undo", json!({ "motor": 0 }), "settings"),
    ] {
        page.order(order, fields);
        // Unchanged settings are not sent: pages would replace what their users have typed.
        let is_answer = |message: &Value| message["kind"] == "settings" || message["kind"] == "refused";
        let answer = page.until("an answer", |_, message| is_answer(message));
        assert_eq!(answer["kind"], answered, "{order}");
        assert!(answered == "refused" || answer["undoable"] == 1, "{order}: {answer}");
    }
}
