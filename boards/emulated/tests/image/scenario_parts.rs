//! Parts of a scenario that the emulated board runs, and parts that it refuses.

use std::io::{Read, Write};

use crate::common::board;
use emulated::host_link::HostLink;
use emulated::{Encoder, replay, serve};
use motor_hub::extension::Request;
use motor_hub::protocol::Reply;
use motor_hub::protocol::answers::Bulk;
use motor_hub::protocol::frame::Decoder;
use motor_hub::protocol::payload::{Field, Fields};
use motor_hub::protocol::requests::ToHub;
use motor_hub::units::{Micros, Period};
use simulated::scenario::{Scenario, Timed};
use simulated::serve::within_process;

/// Returns a scenario of a motor without a load. `parts` are lines of the table `motors`, and further tables.
fn scenario(parts: &str) -> Scenario {
    let text = format!(
        "name = \"parts\"\nduration_s = 2\nbattery = {{ emf_v = 12, resistance_ohm = 0.05 }}\n\
         [[motors]]\nlabel = \"one\"\nmotor = \"AM 60 A\"\nload = {{ inertia_kg_m2 = 0.01 }}\n\
         setpoints = [{{ at_s = 0.5, velocity_cps = 500 }}]\n{parts}"
    );
    Scenario::parse("parts.toml", &text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Returns the text with which a scenario is refused when it is served.
fn refused_when_served(scenario: &Scenario) -> String {
    let (line, _) = within_process();
    let result = serve::run(scenario, board(), false, line, &mut |_| false);
    result.err().map(|error| error.to_string()).unwrap_or_default()
}

fn expect_refusal(scenario: &Scenario, name: &str) {
    let replayed = replay::run(scenario, board(), &mut |_| ()).expect_err(name).to_string();
    assert!(replayed.contains(name), "{name}: {replayed}");
    assert_eq!(refused_when_served(scenario), replayed);
}

#[test]
fn a_part_that_the_emulated_board_lacks_is_refused_by_name() {
    for (parts, name) in [
        ("[bus]\ncapacitance_f = 0.001", "[bus]"),
        ("[attached]\nanalog_v = [1.0]", "[attached]"),
        ("[attached]\nover_time = [{ at_s = 1, low_pins = [0] }]", "[attached]"),
        ("[floor]\nslip_in_turns = 0.05", "[floor]"),
        ("[gyro]\nscale_error = 0.01", "[gyro]"),
        ("train = { stiffness_nm_per_rad = 10 }", "motors.train"),
        ("heat = [{ at_s = 1, winding_k = 20, magnets_k = 10 }]", "motors.heat"),
    ] {
        expect_refusal(&scenario(parts), name);
    }
    expect_refusal(&Scenario { unlimited: true, ..scenario("") }, "battery.unlimited");
}

#[test]
fn a_scenario_with_another_control_period_is_refused() {
    let mut scenario = scenario("");
    scenario.period = Period::from_millis(10).expect("in range");
    let text = refused_when_served(&scenario);
    assert!(text.contains("control_period_ms = 10"), "{text}");
}

/// Serves a scenario for 0.9 s. Returns the battery's voltage, and the answer to a bulk read after 0.7 s.
fn serve_for_a_bulk_read(scenario: &Scenario) -> (String, Bulk) {
    let (line, mut host) = within_process();
    let bulk = Request::from(ToHub::Bulk);
    let (mut battery, mut is_asked) = (String::new(), false);
    let served = serve::run(scenario, board(), false, line, &mut |moment| {
        if moment.at_s > 0.7 && !is_asked {
            is_asked = true;
            let packet = HostLink::default().packet(bulk.id(), &bulk.payload());
            host.write_all(&packet).expect("the line takes all bytes");
        }
        battery = (moment.describe)();
        moment.at_s < 0.9
    });
    served.expect("the image runs");
    let mut bytes = [0; 256];
    let length = host.read(&mut bytes).expect("an answer");
    let packet = Decoder::new().next(&mut &bytes[..length], Micros::new(0)).expect("a packet");
    let Some(Reply::Data(payload)) = Reply::read(&packet, bulk.id()) else { panic!("{packet:02x?}") };
    (battery, Bulk::read(&mut Fields::new(&payload)).expect("a bulk answer"))
}

#[test]
fn a_served_board_follows_the_battery_and_the_encoders_of_a_scenario() {
    let mut scenario = scenario("torques = [{ at_s = 0.0, torque_nm = 0.1 }]");
    let (battery, bulk) = serve_for_a_bulk_read(&scenario);
    assert!(battery.starts_with("12.00 V"), "{battery}");
    assert!(bulk.encoders[0] > 100, "the torque turns the motor: {:?}", bulk.encoders);
    scenario.emf_over_time = vec![Timed { at_s: 0.2, value: 12.0 }, Timed { at_s: 0.4, value: 10.0 }];
    scenario.motors[0].encoder = vec![Timed { at_s: 0.0, value: Encoder::Unplugged }];
    let (battery, bulk) = serve_for_a_bulk_read(&scenario);
    assert!(battery.starts_with("10.00 V"), "{battery}");
    // A wire that is unplugged may change its level once, and each of the two wires then adds a count.
    assert!(bulk.encoders[0].abs() <= 2, "an encoder without wires does not count: {:?}", bulk.encoders);
}
