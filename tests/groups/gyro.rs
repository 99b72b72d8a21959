//! Tests the driver of the gyro with a simulated sensor that has only the registers that the driver uses.

use motor_hub::devices::I2cTransfer;
use motor_hub::devices::bno055::Bno055;
use motor_hub::units::Micros;

/// The registers that the driver uses. The sensor is in the configuration mode at first.
struct Sensor {
    id: u8,
    mode: u8,
    quaternion: [i16; 4],
    /// True if no access is acknowledged.
    is_absent: bool,
    /// All writes so far.
    writes: Vec<Vec<u8>>,
}

const UPRIGHT: [i16; 4] = [16_384, 0, 0, 0];

impl Sensor {
    fn new() -> Self {
        Self { id: 0xA0, mode: 0, quaternion: UPRIGHT, is_absent: false, writes: Vec::new() }
    }

    fn access(&mut self, I2cTransfer { write, read, .. }: I2cTransfer) -> Option<Vec<u8>> {
        if self.is_absent {
            return None;
        }
        match *write {
            [0x3D, mode] => self.mode = mode,
            [0x07 | 0x3E, 0] => (),
            [0x00] => return Some(vec![self.id]),
            [0x3D] => return Some(vec![self.mode]),
            [0x20] => {
                let quaternion = if self.mode == 8 { self.quaternion } else { [0; 4] };
                return Some(quaternion.iter().flat_map(|part| part.to_le_bytes()).collect());
            }
            ref other => panic!("{other:?}"),
        }
        assert_eq!(read, 0);
        self.writes.push(write.to_vec());
        Some(Vec::new())
    }
}

/// The driver and its sensor, accessed every 10 ms.
struct Bus {
    driver: Bno055,
    sensor: Sensor,
    ms: u64,
}

impl Bus {
    fn new() -> Self {
        Self { driver: Bno055::default(), sensor: Sensor::new(), ms: 0 }
    }

    /// Accesses the sensor for some time. Returns the newest heading.
    fn run_ms(&mut self, ms: u64) -> Option<f32> {
        let mut heading = None;
        for _ in 0..ms / 10 {
            self.ms += 10;
            let now = Micros::new(1_000 * self.ms);
            let Some(access) = self.driver.next(now) else { continue };
            let answer = self.sensor.access(access);
            heading = self.driver.receive(now, answer.as_deref()).or(heading);
        }
        heading
    }
}

#[test]
fn a_sensor_in_the_configuration_mode_is_set_to_the_imu_mode_and_one_in_this_mode_is_left_alone() {
    let mut bus = Bus::new();
    assert_eq!(bus.run_ms(200), Some(0.0));
    assert_eq!(bus.sensor.writes, [[0x07, 0], [0x3D, 0], [0x3E, 0], [0x3D, 8]]);
    let mut bus = Bus::new();
    bus.sensor.mode = 8;
    assert_eq!(bus.run_ms(50), Some(0.0));
    assert_eq!(bus.sensor.writes, [[0x07, 0]]);
}

#[test]
fn the_heading_is_the_angle_to_the_left_also_on_a_slope() {
    let mut bus = Bus::new();
    bus.run_ms(200);
    for degrees in [-179.0_f64, -90.0, -0.5, 0.0, 0.02, 45.0, 90.0, 179.9] {
        for pitch_degrees in [0.0_f64, 10.0, -20.0] {
            let (turn, pitch) = (degrees.to_radians() / 2.0, pitch_degrees.to_radians() / 2.0);
            // First the turn about the vertical, then the pitch about the axis of the wheels.
            let parts = [
                turn.cos() * pitch.cos(),
                -turn.sin() * pitch.sin(),
                turn.cos() * pitch.sin(),
                turn.sin() * pitch.cos(),
            ];
            bus.sensor.quaternion = parts.map(|part| (16_384.0 * part).round() as i16);
            let heading = bus.run_ms(10).expect("measured");
            assert!((f64::from(heading) - degrees).abs() < 0.01, "{degrees} {pitch_degrees}: {heading}");
        }
    }
}

#[test]
fn single_errors_are_passed_over_and_five_in_a_row_begin_again_after_a_second() {
    let mut bus = Bus::new();
    bus.run_ms(200);
    bus.sensor.is_absent = true;
    assert_eq!(bus.run_ms(40), None);
    assert!(bus.driver.is_measuring(), "after four errors");
    bus.sensor.is_absent = false;
    assert_eq!(bus.run_ms(10), Some(0.0));
    bus.sensor.is_absent = true;
    bus.run_ms(50);
    assert!(!bus.driver.is_measuring(), "after five errors");
    bus.sensor.is_absent = false;
    assert_eq!(bus.run_ms(990), None);
    assert_eq!(bus.run_ms(100), Some(0.0));
}

#[test]
fn a_sensor_that_lost_its_supply_and_a_wrong_chip_give_no_heading() {
    let mut bus = Bus::new();
    bus.run_ms(200);
    bus.sensor.mode = 0;
    assert_eq!(bus.run_ms(10), None);
    assert!(!bus.driver.is_measuring());
    assert_eq!(bus.run_ms(1_200), Some(0.0), "configured again");
    let mut bus = Bus::new();
    bus.sensor.id = 0xEA;
    assert_eq!(bus.run_ms(5_000), None);
    assert!(bus.sensor.writes.iter().all(|write| *write == [0x07, 0]), "{:?}", bus.sensor.writes);
    // The sensor answers with a quaternion that is not a rotation.
    let mut bus = Bus::new();
    bus.sensor.quaternion = [16_384, 16_384, 0, 0];
    assert_eq!(bus.run_ms(3_000), None);
}
