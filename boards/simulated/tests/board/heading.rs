//! A drive base that holds the heading of its gyro, on the simulated ground, with faults of the gyro's bus.

use crate::host::Served;
use crate::run_tasks;
use motor_hub::extension::HubFunction;
use motor_hub::extension::base::OdometryReport;
use motor_hub::group::{BaseSettings, GyroState};
use motor_hub::protocol::answers::I2cRead;
use motor_hub::protocol::pins::{I2cAddress, I2cBus, I2cCount, ToPin};
use simulated::i2c::IMU_ADDRESS;
use simulated::scenario::Scenario;
use simulated::serve::interventions::Interventions;
use simulated::trace::Trace;

/// A base that turns by 90 degrees at 3 s, at 6 s and at 10 s, on a floor on which it loses 5 % of each turn.
fn turns(base: &str, attached: &str) -> Scenario {
    let motor = |label| {
        format!("[[motors]]\nlabel = \"{label}\"\nmotor = \"AM 60 A\"\nload = {{ inertia_kg_m2 = 0.006 }}\n")
    };
    let course =
        |at_s| format!("{{ at_s = {at_s}, turn_degrees = 90, speed_cps = 1500, acceleration_cps2 = 5000 }}");
    let text = format!(
        "name = \"turns\"\nduration_s = 13\nbattery = {{ emf_v = 12, resistance_ohm = 0.05 }}\n\
         [floor]\nslip_in_turns = 0.05\n{attached}\n{}{}\
         [[groups]]\nlabel = \"base\"\nmotors = [\"left\", \"right\"]\n\
         base = {{ wheel_diameter_mm = 90, track_mm = 300{base} }}\ncourses = [{}, {}, {}]\n",
        motor("left"),
        motor("right"),
        course(3),
        course(6),
        course(10)
    );
    Scenario::parse("turns.toml", &text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// True heading at the end in degrees, at rest.
fn end_degrees(trace: &Trace) -> f64 {
    trace.ticks.last().expect("a tick").pose.heading_degrees
}

/// State of the gyro at the last tick before a time.
fn gyro_at(trace: &Trace, at_s: f64) -> GyroState {
    let tick = trace.ticks.iter().take_while(|tick| tick.at_s < at_s).last();
    tick.and_then(|tick| tick.base).expect("a base").gyro
}

#[test]
fn a_base_turns_by_its_gyros_drift_and_scale_error() {
    let trace =
        run_tasks(&turns(", use_gyro = true", "[gyro]\ndrift_degrees_per_min = 30.0\nscale_error = 0.01"));
    // The sensor answers 650 ms after its supply is on, and is then configured.
    assert_eq!([gyro_at(&trace, 0.6), gyro_at(&trace, 2.0)], [GyroState::Waiting, GyroState::Good]);
    // The gyro drifts by 0.5 degrees a second. From its first turn at 3 s to 13 s the base turns back by that angle.
    let expected = (270.0 - 0.5 * 10.0) / 1.01;
    assert!((end_degrees(&trace) - expected).abs() < 0.6, "{} {expected}", end_degrees(&trace));
    // The hub cannot measure these errors of the gyro. The sensor measures from 0.7 s on.
    let measured = end_degrees(&trace) * 1.01 + 0.5 * 12.3;
    let base = trace.ticks.last().and_then(|tick| tick.base).expect("a base");
    assert!((f64::from(base.heading_millidegrees) / 1e3 - measured).abs() < 0.5, "{measured} {base:?}");
}

#[test]
fn faults_of_the_gyros_bus_stop_neither_motors_nor_ticks() {
    for (fault, is_lost) in [
        ("no-acknowledge", true),
        ("stuck-clock", true),
        // The hub frees the line.
        ("stuck-data", false),
        ("interrupted", false),
        // A reading takes 30 ms.
        ("stretching", false),
    ] {
        let changes = format!(
            "[attached]\nover_time = [{{ at_s = 5, i2c_faults = [\"{fault}\"] }}, {{ at_s = 8, i2c_faults = [\"none\"] }}]"
        );
        let trace = run_tasks(&turns(", use_gyro = true", &changes));
        let during = if is_lost { GyroState::Lost } else { GyroState::Good };
        assert_eq!([gyro_at(&trace, 5.7), gyro_at(&trace, 8.0)], [during; 2], "{fault}");
        assert_eq!(gyro_at(&trace, 9.9), GyroState::Good, "{fault}");
        // If the gyro is lost, the turn at 6 s uses the encoders.
        let expected = if is_lost { 270.0 - 0.05 * 90.0 } else { 270.0 };
        assert!((end_degrees(&trace) - expected).abs() < 1.0, "{fault} {}", end_degrees(&trace));
        let losses = trace.ticks.last().and_then(|tick| tick.base).map(|base| base.losses);
        assert_eq!(losses, Some(is_lost.into()), "{fault}");
        assert_eq!(trace.ticks.len(), 259, "{fault}: no tick is left out");
        assert!(trace.ticks.iter().all(|tick| !tick.motors[0].report.faults.any()), "{fault}");
    }
}

#[test]
fn a_host_reads_the_register_that_it_has_written_whenever_the_hub_reads_the_gyro() {
    let mut hub = Served::new(Scenario::to_serve(), &[2], |_| Interventions::default());
    let base = BaseSettings {
        wheels: [0, 1],
        wheel_diameter_um: 90_000,
        track_um: 300_000,
        counts_per_turn_thousandths: [1_680_000; 2],
        use_gyro: true,
    };
    assert!(hub.obeys(HubFunction::SetBase { base }, 2));
    hub.pass(1_000);
    let bus = I2cBus::new(0).expect("a bus");
    let address = I2cAddress::new(IMU_ADDRESS).expect("an address");
    let read = |hub: &mut Served, count| {
        let count = I2cCount::new(count).expect("1 to 100");
        assert!(hub.obeys(ToPin::ReadI2c { bus, address, count }, 2));
        hub.pass(5);
        let I2cRead { bytes, .. } = hub.value(ToPin::PollI2cRead { bus }, 2);
        bytes.to_vec()
    };
    // The sensor begins a read at the register of the last write (data sheet 1.4, section 4.6).
    for (register, expected) in [(0x00, [0xA0, 0xFB]), (0x01, [0xFB, 0x32])] {
        for pause_ms in 0..25 {
            assert!(hub.obeys(ToPin::WriteI2cByte { bus, address, byte: register }, 2));
            hub.pass(pause_ms);
            assert_eq!([read(&mut hub, 2), read(&mut hub, 2)], [expected; 2], "after {pause_ms} ms");
        }
    }
    // The hub reads its angles, also if the host never reads what it has chosen.
    assert!(hub.obeys(ToPin::WriteI2cByte { bus, address, byte: 0x08 }, 2));
    for _ in 0..20 {
        hub.pass(50);
        let state: OdometryReport = hub.value(HubFunction::Odometry, 2);
        assert_eq!((state.gyro, state.losses), (GyroState::Good, 0));
    }
}
