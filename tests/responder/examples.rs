//! Packets as they go over the line, byte for byte: a session with a hub at address 3.

use crate::host::{TestHost, bytes_of, decode};
use motor_hub::hub::Command;
use motor_hub::protocol::answers::{Bulk, Reply};
use motor_hub::protocol::frame::encode;
use motor_hub::regulator::Coefficients;

#[test]
fn a_host_finds_the_hub_and_its_interface_and_reads_status_battery_and_an_encoder() {
    let exchanges = [
        ("44 4b 0b 00 ff 00 01 00 0f 7f 28", "44 4b 0c 00 00 03 01 01 0f ff 01 af"),
        ("44 4b 0b 00 03 00 01 00 04 7f 21", "44 4b 0c 00 00 03 02 01 01 7f 01 22"),
        ("44 4b 10 00 03 00 02 00 07 7f 44 45 4b 41 00 3f", "44 4b 0f 00 00 03 03 02 07 ff 00 10 3a 00 f6"),
        ("44 4b 0c 00 03 00 03 00 03 7f 01 24", "44 4b 0d 00 00 03 04 03 03 ff 02 00 aa"),
        ("44 4b 0d 00 03 00 04 00 07 10 0d 00 c7", "44 4b 0d 00 00 03 05 04 07 90 39 30 a8"),
        ("44 4b 0c 00 03 00 0a 00 16 10 01 cf", "44 4b 0f 00 00 03 06 0a 16 90 f9 ff ff ff 4d"),
        // The hub has no fifth motor.
        ("44 4b 0e 00 03 00 0b 00 08 10 04 00 00 c7", "44 4b 0c 00 00 03 07 0b 02 7f 00 31"),
    ];
    let mut host = TestHost::new();
    host.snapshot.motors[1].position = -7;
    for (request, reply) in exchanges {
        assert_eq!(host.send(&bytes_of(request)), [bytes_of(reply)], "{request}");
    }
}

#[test]
fn a_host_sets_pidf_coefficients() {
    let mut host = TestHost::new();
    let request = "44 4b 1e 00 03 00 1b 00 33 10 01 01 8f 42 01 00 42 20 00 00 00 00 00 00 9a 99 0c 00 01 84";
    assert_eq!(decode(&host.send(&bytes_of(request))[0]).id, 0x7F01);
    let commands = host.new_commands();
    let [Command::Configure { motor: 1, settings }] = commands[..] else { panic!("{commands:?}") };
    let coefficients = settings.coefficients.expect("a host's own");
    let velocity = coefficients.velocity;
    assert_eq!(
        [velocity.p, velocity.i, velocity.d, velocity.f].map(|c| c.to_bits()),
        [82_575, 8258, 0, 825_754]
    );
    // The coefficients of the position loop were not set, so the hub uses its suggestion.
    let winding = crate::host::settings().winding;
    let suggested = Coefficients::suggested(winding.emf);
    assert_eq!(coefficients.position, suggested.position);
}

#[test]
fn the_fields_of_a_bulk_answer_are_in_order() {
    let request = decode(&bytes_of("44 4b 0b 00 03 00 0c 00 00 10 b9"));
    let bulk = Bulk {
        digital: 1,
        encoders: [354, -7, 0, 0],
        over_current: [false; 4],
        within_tolerance: [false, true, false, false],
        velocities: [1400, -300, 0, 0],
        analog: [100, 200, 300, 400],
        attention: Some(false),
    };
    let frame = encode(&Reply::data(&bulk).packet(&request, 3, 8));
    let expected = "44 4b 2e 00 00 03 08 0c 00 90 01 62 01 00 00 f9 ff ff ff 00 00 00 00 00 00 00 \
                    00 20 78 05 d4 fe 00 00 00 00 64 00 c8 00 2c 01 90 01 00 17";
    assert_eq!(frame.to_vec(), bytes_of(expected));
}
