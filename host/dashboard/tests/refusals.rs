//! Hubs that refuse requests or do not answer, and other makers' hubs with two motors.
#![expect(
    clippy::unwrap_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "a failed access is a failed test"
)]

#[path = "../../client/tests/hub_support/mod.rs"]
mod hub_support;
mod page;

use dashboard::proposal::catalogue_motor;
use dashboard::{Opened, Place};
use hub_support::{Hub, Memory, SLOT, Server, responder_at, started};
use motor_hub::braking::Winding;
use motor_hub::extension::settings::Group;
use motor_hub::extension::state::StoreReport;
use motor_hub::extension::{HubFunction, Request};
use motor_hub::motor::{Setpoint, Settings};
use motor_hub::protocol::motor::{Loop, LoopCoefficients, Terms, ToMotor};
use motor_hub::protocol::{Address, CHANNELS, Nack, Packet, Reply};
use motor_hub::regulator::Kind;
use motor_hub::regulator::identify::{Identification, Identified};
use motor_hub::store::Outcome;
use motor_hub::units::{Coefficient, Micros, Millivolts};
use motor_hub::update::{Booted, Phase};
use motor_hub_client::Session;
use motor_hub_client::session::TRANSMISSIONS;
use page::Page;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

/// A page of hubs in memory. The relay can open the line once, so a dropped session is never opened again.
fn page_of(hubs: Vec<Hub>) -> Page {
    let addresses: Vec<Address> = hubs.iter().map(|hub| hub.responder.address()).collect();
    let mut line = Some(Memory::of(hubs));
    let open = move |_| {
        let line = line.take().ok_or("the session was dropped")?;
        let session = Session::new(line, addresses[0], Duration::from_millis(300));
        Ok(Opened { session, hubs: addresses.iter().map(|address| address.get()).collect() })
    };
    Page::new(Place::real("hubs in memory", open))
}

/// A page of a hub that listens at a TCP port, so that a lost hub can be connected again. `address` is that of the hub;
/// `None` for the parent.
fn page_of_server(hub: Hub, address: Option<Address>) -> (Server, Page) {
    let server = Server::start(hub);
    let place = server.address.clone();
    let open = move |address| dashboard::hub::open(&place, address).map_err(|error| error.to_string());
    (server, Page::new(Place::real("a hub", open).at(address)))
}

/// Refuses requests for settings of a motor.
fn without_settings(packet: &Packet) -> Option<Reply> {
    Group::ALL.iter().any(|group| group.get_id() == packet.id).then_some(Reply::Nack(Nack::UNSUPPORTED))
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
    page.order(&json!({ "identify": { "motor": 0 } }));
    assert_eq!(page.frame()["motors"][0]["enabled"], true);
    let ended = page.until("a refusal", |message| message["state"] == "refused");
    let why = ended["why"].as_str().unwrap();
    assert!(why.contains("the hub refuses to"), "{ended}");
    assert_eq!(page.frame()["motors"][0]["enabled"], false);
}

#[test]
fn a_second_identification_and_changes_of_settings_are_refused_while_one_runs() {
    let mut page = page_of(vec![Hub::new()]);
    page.order(&json!({ "identify": { "motor": 1 } }));
    page.order(&json!({ "identify": { "motor": 2 } }));
    let refused = |page: &mut Page| {
        let refused = page.until("a refusal", |message| message["kind"] == "refused");
        assert_eq!(refused["why"], "motor 1 is being identified: wait for its end, or press STOP");
    };
    refused(&mut page);
    // Neither may the settings of the motor change.
    for order in [
        json!({ "acceleration": { "motor": 1, "limit": 500 } }),
        json!({ "reset-encoder": { "motor": 1 } }),
        json!("load"),
    ] {
        page.order(&order);
        refused(&mut page);
    }
    let motors = &page.frame()["motors"];
    assert_eq!((&motors[1]["enabled"], &motors[2]["enabled"]), (&json!(true), &json!(false)));
}

#[test]
fn a_hub_that_was_reset_on_an_open_line_is_noticed_and_has_nothing_to_undo() {
    let running_for = |ms: u64| {
        let mut hub = Hub::new();
        hub.snapshot.at = Micros::new(1_000 * ms);
        hub
    };
    let (server, mut page) = page_of_server(running_for(60_000), None);
    page.order(&json!({ "configure": { "motor": 0, "values": { "current_limit_ma": 2000 } } }));
    page.until("an undo", |message| message["kind"] == "settings" && message["undoable"] == 1);
    page.frame();
    *server.hub() = running_for(20);
    let settings =
        page.until("new settings", |message| message["kind"] == "settings" && message["motor"] == 0);
    assert_eq!(settings["undoable"], 0, "{settings}");
    let notice = page.until("a notice", |message| message["kind"] == "notice");
    assert!(notice["text"].as_str().unwrap().starts_with("the hub was reset"), "{notice}");
}

#[test]
fn a_proposal_is_for_the_winding_that_was_identified_and_comes_into_force_by_apply_only() {
    let mut hub = Hub::new();
    let (found, gain) = (identified(), f64::from(identified().dynamics.gain.to_f32()));
    hub.snapshot.motors[0].identification = Identification::Found(found);
    let mut page = page_of(vec![hub]);
    page.order(&json!({ "identify": { "motor": 0 } }));
    page.until("a result", |message| message["state"] == "found");
    let dynamics = |page: &mut Page, order: Value| {
        page.order(&order);
        let settings = page.until("settings", |of| of["kind"] == "settings" && of["motor"] == 0);
        settings["dynamics"].clone()
    };
    page.frame();
    assert_eq!(dynamics(&mut page, json!({ "regulator": { "motor": 0, "kind": "model" } })), Value::Null);
    assert_eq!(dynamics(&mut page, json!({ "apply": { "motor": 0 } }))["gain"], gain);
    assert_eq!(dynamics(&mut page, json!({ "regulator": { "motor": 0, "kind": "pid" } }))["gain"], gain);
    assert_eq!(dynamics(&mut page, json!({ "regulator": { "motor": 0, "kind": "model" } }))["gain"], gain);
    let other = json!({ "configure": { "motor": 0, "values": { "resistance_ohm": 1.5 } } });
    dynamics(&mut page, other);
    page.order(&json!({ "apply": { "motor": 0 } }));
    let refused = page.until("a refusal", |message| message["kind"] == "refused");
    assert!(refused["why"].as_str().unwrap().contains("not identified yet"), "{refused}");
    dynamics(&mut page, json!({ "undo": { "motor": 0 } }));
    assert_eq!(dynamics(&mut page, json!({ "apply": { "motor": 0 } }))["gain"], gain);
}

#[test]
fn pid_keeps_its_coefficients_when_the_set_up_of_its_motor_changes() {
    let mut hub = Hub::new();
    hub.snapshot.motors[0].regulator = Kind::Pid;
    let mut page = page_of(vec![hub]);
    page.frame();
    let pidf = json!([1.5, 0.25, 0.0, 2.0]);
    for order in [
        json!({ "coefficients": { "motor": 0, "of": "velocity", "pidf": pidf } }),
        json!({ "set-up": { "motor": 0, "scheme": "D", "duty": "linear-duty" } }),
        json!({ "configure": { "motor": 0, "values": { "resistance_ohm": 1.5 } } }),
    ] {
        page.order(&order);
        let settings = page.until("settings", |of| of["kind"] == "settings" && of["motor"] == 0);
        assert_eq!(settings["velocity"], pidf, "{order}");
    }
}

#[test]
fn a_set_up_with_scheme_d_keeps_the_blend() {
    let mut page = page_of(vec![Hub::new()]);
    page.frame();
    let mut scheme_after = |order: Value| {
        page.order(&order);
        page.until("settings", |of| of["kind"] == "settings" && of["motor"] == 0)["scheme"].clone()
    };
    let fixed =
        scheme_after(json!({ "configure": { "motor": 0, "values": { "scheme": "D", "blend": 0.25 } } }));
    assert_eq!(fixed["blend"], 0.25, "{fixed}");
    let set_up = |scheme| json!({ "set-up": { "motor": 0, "scheme": scheme, "duty": "linear-duty" } });
    assert_eq!(scheme_after(set_up("D")), fixed);
    scheme_after(set_up("B"));
    assert_ne!(scheme_after(set_up("D")), fixed);
}

#[test]
fn a_setting_without_effect_is_refused_with_the_setting_that_it_needs() {
    let mut page = page_of(vec![Hub::new()]);
    page.frame();
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
        page.order(&json!({ "configure": { "motor": 0, "values": values } }));
        let refused = page.until("a refusal", |message| message["kind"] == "refused");
        assert_eq!(refused["why"], why);
    }
    page.order(
        &json!({ "configure": { "motor": 0, "values": { "thermal.winding_s": 20, "thermal.continuous_current_ma": 900 } } }),
    );
    page.until("new settings", |message| message["kind"] == "settings" && message["undoable"] == 1);
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
    page.order(&json!({ "configure": { "motor": 0, "values": { "current_limit_ma": 2000 } } }));
    page.until("an undo", |message| message["kind"] == "settings" && message["undoable"] == 1);
    for (order, failure) in [
        ("load", "the stored settings are not loaded: "),
        ("reset", "the stored settings are not reset: "),
        ("save", "settings are not saved: "),
    ] {
        page.order(&json!(order));
        let notice = page.until("a notice", |message| {
            message["text"].as_str().is_some_and(|text| text.contains("the hub's memory"))
        });
        assert!(notice["text"].as_str().unwrap().starts_with(failure), "{notice}");
    }
    page.order(&json!({ "undo": { "motor": 0 } }));
    page.until("no undo", |message| message["kind"] == "settings" && message["undoable"] == 0);
}

#[test]
fn an_address_of_another_hub_of_the_chain_is_refused() {
    let hub = |address| Hub { responder: responder_at(address), ..Hub::new() };
    let mut page = page_of(vec![hub(2), hub(3)]);
    page.frame();
    page.order(&json!({ "address": { "new": 3 } }));
    let answer = page.until("an answer", |message| {
        message["kind"] == "refused" || message["text"].as_str().is_some_and(|text| text.contains("address"))
    });
    assert_eq!(answer["why"], "another hub of the chain has address 3: choose another address");
}

/// Returns a hub whose replies are lost while `is_silent` is true.
fn hub_that_falls_silent(address: u8, is_silent: &Arc<AtomicBool>) -> Hub {
    let is_silent = Arc::clone(is_silent);
    let loses_reply = Box::new(move |_: &Packet| is_silent.load(Ordering::Relaxed));
    Hub { responder: responder_at(address), loses_reply, ..Hub::new() }
}

/// Enables motor 0 of the hub that is shown, with a power of 0.2.
fn run_motor_0(page: &mut Page) {
    page.order(&json!({ "drive": { "motor": 0, "mode": "power", "value": 0.2 } }));
    page.order(&json!({ "enable": { "motor": 0, "on": true } }));
    page.until("an enabled motor", |message| message["motors"][0]["enabled"] == true);
}

#[test]
fn a_motor_is_enabled_by_a_set_point_only_if_the_set_point_is_accepted() {
    let mut page = page_of(vec![Hub::new()]);
    run_motor_0(&mut page);
    page.order(&json!("stop"));
    page.until("a stop", |message| message["motors_disabled"] == true);
    for order in [
        json!({ "drive": { "motor": 0, "mode": "velocity", "value": 0, "tolerance": 70_000, "enable": true } }),
        json!({ "drive": { "motor": 0, "mode": "position", "value": 0, "speed": 0, "enable": true } }),
        json!({ "current": { "motor": 0, "amperes": 0, "speed": 0, "enable": true } }),
    ] {
        page.order(&order);
        page.until("a refusal", |message| message["kind"] == "refused");
        assert_eq!(page.frame()["motors"][0]["enabled"], false, "{order}");
    }
    for speed in [0, -300] {
        page.order(&json!({ "drive": { "motor": 0, "mode": "position", "value": 0, "speed": speed } }));
        page.until("the allowed speeds", |message| {
            message["why"].as_str().is_some_and(|why| why.contains("allowed is 1 to 32767 counts/s"))
        });
    }
    page.order(&json!({ "drive": { "motor": 0, "mode": "velocity", "value": 0, "enable": true } }));
    page.order(&json!({ "current": { "motor": 1, "amperes": 0.5, "enable": true } }));
    page.until("two enabled motors", |message| {
        message["motors"][0]["enabled"] == true && message["motors"][1]["enabled"] == true
    });
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
    run_motor_0(&mut page);
    page.order(&json!({ "hub": { "address": 4 } }));
    page.until("hub 4", |message| message["hubs"][2]["shown"] == true);
    run_motor_0(&mut page);
    silent_child.store(true, Ordering::Relaxed);
    page.order(&json!("stop"));
    let notice = page.until("a notice", |message| message["motors_disabled"] == true);
    let text = notice["text"].as_str().unwrap();
    assert!(text.starts_with("not all motors could be disabled (stopped): hub 3 does not answer"), "{text}");
    let hubs = page.until("a lost hub", |message| message["hubs"][1]["lost"] == true);
    assert_eq!((&hubs["hubs"][0]["running"], &hubs["hubs"][2]["running"]), (&json!([]), &json!([])));
    page.order(&json!("stop"));
    let notice = page.until("a notice", |message| message["motors_disabled"] == true);
    assert_eq!(notice["text"], "all motors are disabled: stopped");
}

#[test]
fn an_order_to_a_child_that_does_not_answer_shows_the_parent() {
    for order in [
        json!({ "led": { "colour": [0, 0, 255] } }),
        json!({ "identify": { "motor": 0 } }),
        json!("save"),
        json!({ "configure": { "motor": 0, "values": { "current_limit_ma": 2000 } } }),
    ] {
        let is_silent = Arc::new(AtomicBool::new(false));
        let mut page = page_of(vec![
            Hub { responder: responder_at(2), ..Hub::new() },
            hub_that_falls_silent(3, &is_silent),
        ]);
        page.order(&json!({ "hub": { "address": 3 } }));
        page.until("hub 3", |message| message["hubs"][1]["shown"] == true);
        is_silent.store(true, Ordering::Relaxed);
        page.order(&order);
        let hubs = page.until("hub 2", |message| message["hubs"][0]["shown"] == true);
        assert_eq!(hubs["hubs"][1]["lost"], true, "{order}: {hubs}");
    }
}

#[test]
fn a_hub_that_was_lost_has_no_motor_enabled() {
    let (server, mut page) = page_of_server(Hub::new(), None);
    run_motor_0(&mut page);
    // The hub loses all three transmissions of one request.
    server.hub().deaf_for = 3;
    page.until("a lost hub", |message| message["connected"] == false);
    page.order(&json!("stop"));
    let notice = page.until("a notice", |message| message["motors_disabled"] == true);
    assert!(notice["text"].as_str().unwrap().starts_with("motors could not be disabled"), "{notice}");
    page.until("a new session", |message| message["connected"] == true);
    assert_eq!(server.hub().responder.enabled(), [false; 4]);
    page.until("a disabled motor", |message| message["motors"][0]["enabled"] == false);
}

#[test]
fn a_hub_that_was_chosen_by_its_address_is_found_again_at_its_new_address() {
    let hub = Hub::new();
    let former = hub.responder.address();
    let (server, mut page) = page_of_server(hub, Some(former));
    page.order(&json!({ "address": { "new": 7 } }));
    page.until("a new address", |message| {
        message["text"].as_str().is_some_and(|text| text.starts_with("the hub has address 7"))
    });
    // The hub loses all three transmissions of one request.
    server.hub().deaf_for = 3;
    page.until("a lost hub", |message| message["connected"] == false);
    page.until("a new session", |message| message["connected"] == true);
    page.frame();
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
    page.frame();
    let turn = |cps: i32| json!({ "turn": { "at": [cps, -300, null, null], "acceleration": 2000 } });
    let stops = || {
        let setpoints = std::mem::take(&mut *setpoints.lock().unwrap());
        setpoints.iter().filter(|(_, setpoint)| matches!(setpoint, Setpoint::ConstantPower(_))).count()
    };
    page.order(&turn(600));
    assert!(stops() > 0, "the motors brake until they turn");
    page.order(&turn(700));
    assert_eq!(stops(), 0);
}

#[test]
fn a_save_whose_report_is_refused_ends_with_a_notice() {
    let answer = |packet: &Packet| match packet.id {
        id if id == HubFunction::Save.id() => Some(Reply::ACK),
        id if id == HubFunction::Stored.id() => Some(Reply::Nack(Nack::UNSUPPORTED)),
        _ => None,
    };
    let mut page = page_of(vec![Hub { answer, ..Hub::new() }]);
    page.order(&json!("save"));
    let is_of_save =
        |message: &Value| message["text"].as_str().is_some_and(|text| text.starts_with("whether settings"));
    page.until("a notice", is_of_save);
    // While a save runs, no other hub can be shown.
    page.order(&json!({ "hub": { "address": 9 } }));
    let refused = page.until("a refusal", |message| message["kind"] == "refused");
    assert_eq!(refused["why"], "there is no hub 9 on this line");
}

#[test]
fn firmware_with_half_a_byte_is_refused() {
    let mut page = page_of(vec![Hub::new()]);
    page.frame();
    for hex in ["abc", "+f", "xy"] {
        page.order(&json!({ "firmware": { "offset": 0, "hex": hex } }));
        let refused = page.until("a refusal", |message| message["kind"] == "refused");
        assert_eq!(refused["why"], "the part has other signs than pairs of hexadecimal digits");
    }
}

#[test]
fn a_dashboard_that_ends_while_the_hub_checks_new_firmware_leaves_no_armed_image() {
    let hub = Hub { responder: started(SLOT, Booted::Confirmed), ..Hub::new() };
    let (server, mut page) = page_of_server(hub, None);
    // Stack pointer and reset vector.
    page.order(&json!({ "firmware": { "offset": 0, "hex": "0000022099010208" } }));
    page.order(&json!({ "update": { "version": "new" } }));
    page.until("a check", |message| message["text"] == "The hub checks the firmware.");
    page.end();
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
    assert_eq!(page.frame()["motors"].as_array().map(Vec::len), Some(2));
    page.order(&json!({ "hub": { "address": 3 } }));
    page.until("hub 3", |message| message["hubs"][1]["shown"] == true);
    page.order(&json!({ "drive": { "motor": 1, "mode": "power", "value": 0.2 } }));
    page.order(&json!({ "enable": { "motor": 1, "on": true } }));
    page.until("an enabled motor", |message| message["motors"][1]["enabled"] == true);
    page.order(&json!({ "hub": { "address": 2 } }));
    let hubs = page.until("hub 2", |message| message["hubs"][0]["shown"] == true);
    assert_eq!(hubs["hubs"][1]["running"], json!([1]));
    // The other hub is asked in every fifth frame.
    for _ in 0..20 {
        page.frame();
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
    page.frame();
    // Unchanged settings are not sent: pages would replace what their users have typed.
    let mut answers = |order: Value| {
        page.order(&order);
        let answers = |message: &Value| message["kind"] == "settings" || message["kind"] == "refused";
        let answer = page.until("an answer", answers);
        (answer["kind"].as_str().map(str::to_owned), answer["undoable"].as_u64())
    };
    let refused = (Some("refused".to_owned()), None);
    let pidf = json!({ "coefficients": { "motor": 0, "of": "velocity", "pidf": [1.0, 0.0, 0.0, 0.0] } });
    assert_eq!(answers(pidf), refused);
    assert_eq!(answers(json!({ "acceleration": { "motor": 0, "limit": 1000 } })), refused);
    let limit = json!({ "configure": { "motor": 0, "values": { "current_limit_ma": 2000 } } });
    assert_eq!(answers(limit), (Some("settings".to_owned()), Some(1)));
    // An undo also sends the group of the acceleration limit, which the hub refuses after it has changed others.
    assert_eq!(answers(json!({ "undo": { "motor": 0 } })), (Some("settings".to_owned()), Some(1)));
}
