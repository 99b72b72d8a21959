//! The drive base: its configuration by a host, and the report of its odometry.

use crate::host::{Answer, N, TestHost};
use motor_hub::devices::Equipment;
use motor_hub::extension::base::OdometryReport;
use motor_hub::extension::{HubFunction, Request};
use motor_hub::group::{BaseSettings, DriveBase, GyroState};
use motor_hub::hub::{BaseState, Command};

const GEOMETRY: DriveBase =
    DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0, -1680.0] };

fn base(wheels: [u8; 2], use_gyro: bool) -> BaseSettings {
    BaseSettings::new(wheels, &GEOMETRY, use_gyro).expect("in range")
}

fn set(host: &mut TestHost, base: BaseSettings) -> Answer {
    host.request(HubFunction::SetBase { base })
}

fn odometry(host: &mut TestHost) -> Answer {
    host.request(HubFunction::Odometry)
}

#[test]
fn a_base_is_sent_to_control_once_and_its_odometry_is_reported_in_the_hosts_counts() {
    let mut host = TestHost::settled();
    for question in [HubFunction::Base, HubFunction::Odometry] {
        assert_eq!(host.request(question), Answer::Nack(82), "no base yet");
    }
    host.snapshot.motors[2].position = 70;
    host.do_all(&[(14, &[2])]);
    host.new_commands();
    let wanted = base([0, 2], true);
    assert_eq!(set(&mut host, wanted), Answer::Ack(0));
    assert_eq!(odometry(&mut host), Answer::Nack(81), "not sent yet");
    assert_eq!(host.read::<BaseSettings>(HubFunction::Base), wanted);
    assert_eq!(host.new_commands(), [Command::SetBase(Some(wanted))]);
    assert_eq!(host.new_commands(), []);
    assert_eq!(odometry(&mut host), Answer::Nack(81), "in no snapshot yet");
    host.tick();
    let gyro = GyroState::Lost;
    host.snapshot.base = Some(BaseState {
        x_um: 1_000_000,
        y_um: -2,
        heading_millidegrees: 90_000,
        correction: [5, -5],
        gyro,
        losses: 1,
    });
    (host.snapshot.motors[0].position, host.snapshot.motors[2].position) = (100, 200);
    let report = OdometryReport {
        x_um: 1_000_000,
        y_um: -2,
        heading_millidegrees: 90_000,
        counts: [95, 135],
        gyro,
        losses: 1,
    };
    assert_eq!(host.read::<OdometryReport>(HubFunction::Odometry), report);
}

#[test]
fn a_base_is_refused_if_it_does_not_fit() {
    let mut host = TestHost::settled();
    let request = Request::from(HubFunction::SetBase { base: base([0, 1], true) });
    let (id, mut payload) = (request.id(), request.payload());
    assert_eq!(set(&mut host, base([N as u8, 1], true)), Answer::Nack(0));
    assert_eq!(set(&mut host, base([1, N as u8], true)), Answer::Nack(1));
    payload[1] = 0;
    assert_eq!(host.ask(id, &payload), Answer::Nack(1), "one motor for both wheels");
    payload[1] = 1;
    // Each of these fields must not be 0.
    for (field, bytes) in [(2, 2..6), (3, 6..10), (4, 10..14), (5, 14..18)] {
        let mut wrong = payload.clone();
        wrong[bytes].fill(0);
        assert_eq!(host.ask(id, &wrong), Answer::Nack(field));
    }
    payload[18] = 2;
    assert_eq!(host.ask(id, &payload), Answer::Nack(6));
    host.do_all(&[(15, &[1, 0, 0]), (10, &[1, 1])]);
    assert_eq!(set(&mut host, base([0, 1], true)), Answer::Nack(60), "motor 1 is enabled");
    assert_eq!(set(&mut host, base([0, 2], true)), Answer::Ack(0));
    host.responder.outputs.equipment = Equipment::default();
    assert_eq!(set(&mut host, base([0, 2], true)), Answer::Nack(253), "no bus for a gyro");
    assert_eq!(set(&mut host, base([0, 2], false)), Answer::Ack(0));
}

#[test]
fn a_base_is_not_replaced_while_one_of_its_wheels_is_enabled() {
    let mut host = TestHost::settled();
    assert_eq!(set(&mut host, base([0, 1], true)), Answer::Ack(0));
    host.do_all(&[(15, &[1, 0, 0]), (10, &[1, 1])]);
    assert_eq!(set(&mut host, base([2, 3], true)), Answer::Nack(60));
    host.do_all(&[(10, &[1, 0])]);
    assert_eq!(set(&mut host, base([2, 3], true)), Answer::Ack(0));
}
