//! Encodes and decodes the ROS messages of a hub, and defines their type names and hashes.
//!
//! A message is encoded as CDR: a header of 4 bytes, then the fields. Here a message is a tuple of its fields in their
//! order. An array is an array of fixed length, and a sequence is a vector or a slice.

use byteorder::LittleEndian;
use serde::{Deserialize, Serialize};

/// Header of little-endian CDR.
const HEADER: [u8; 4] = [0, 1, 0, 0];

fn encode(message: &impl Serialize) -> Vec<u8> {
    let mut bytes = HEADER.to_vec();
    cdr_encoding::to_writer::<_, LittleEndian, _>(&mut bytes, message)
        .expect("every sequence has a known length, and writing to memory does not fail");
    bytes
}

/// Decodes a message. Returns `None` if the message is malformed, or if more than 3 bytes remain. Some writers add up to
/// 3 bytes of padding.
fn decode<'a, T: Deserialize<'a>>(message: &'a [u8]) -> Option<T> {
    let fields = message.strip_prefix(&HEADER)?;
    let (value, read) = cdr_encoding::from_bytes::<T, LittleEndian>(fields).ok()?;
    (fields.len() - read <= 3).then_some(value)
}

/// A ROS type: its name as DDS spells it, and its hash (REP-2016, version 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Type {
    pub(crate) dds: &'static str,
    pub(crate) hash: &'static str,
}

macro_rules! types {
    ($($name:ident $dds:literal $hash:literal,)+) => {
        $(pub(crate) const $name: Type = Type { dds: $dds, hash: concat!("RIHS01_", $hash) };)+
    };
}

types! {
    TWIST "geometry_msgs::msg::dds_::Twist_" "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    TWIST_STAMPED "geometry_msgs::msg::dds_::TwistStamped_" "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    JOINT_STATE "sensor_msgs::msg::dds_::JointState_" "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    ODOMETRY "nav_msgs::msg::dds_::Odometry_" "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    TF "tf2_msgs::msg::dds_::TFMessage_" "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    BATTERY_STATE "sensor_msgs::msg::dds_::BatteryState_" "4bee5dfce981c98faa6828b868307a0a73f992ed0789f374ee96c8f840e69741",
    IMU "sensor_msgs::msg::dds_::Imu_" "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    DIAGNOSTICS "diagnostic_msgs::msg::dds_::DiagnosticArray_" "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    STRING "std_msgs::msg::dds_::String_" "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    TRIGGER "std_srvs::srv::dds_::Trigger_" "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    SET_BOOL "std_srvs::srv::dds_::SetBool_" "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
}

/// Time since 1970 on the wall clock, in nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stamp(pub(crate) i64);

/// Seconds, nanoseconds and frame of a message that is sent.
fn header(stamp: Stamp, frame: &str) -> (u32, u32, &str) {
    (stamp.0.div_euclid(1_000_000_000) as u32, stamp.0.rem_euclid(1_000_000_000) as u32, frame)
}

/// Header of a message that is read. Its stamp is ignored, because the clocks of two machines differ.
type ReadHeader = (u32, u32, String);

/// A twist that is read: linear and angular speeds.
type Twist = [[f64; 3]; 2];

/// Reads the forward speed in m/s and the turning speed in rad/s, positive to the left, of a twist. The other
/// components are ignored, because a base with two wheels cannot move in these directions.
pub(crate) fn read_twist(message: &[u8]) -> Option<(f64, f64)> {
    forward_and_turning(decode(message)?)
}

/// Reads a stamped twist as [`read_twist`] does.
pub(crate) fn read_twist_stamped(message: &[u8]) -> Option<(f64, f64)> {
    let (_, twist) = decode::<(ReadHeader, Twist)>(message)?;
    forward_and_turning(twist)
}

/// Returns `None` if a component is not a finite number.
fn forward_and_turning(twist: Twist) -> Option<(f64, f64)> {
    let [[forward, ..], [.., turning]] = twist;
    twist.as_flattened().iter().all(|value| value.is_finite()).then_some((forward, turning))
}

/// Commands for joints by name. An array has one value for each name, or is empty.
#[derive(Debug, Default, PartialEq, Deserialize)]
pub(crate) struct JointCommands {
    pub(crate) names: Vec<String>,
    /// Positions in rad.
    pub(crate) positions: Vec<f64>,
    /// Velocities in rad/s.
    pub(crate) velocities: Vec<f64>,
    /// Torques in N m.
    pub(crate) efforts: Vec<f64>,
}

/// Reads commands for joints. Returns `None` also if an array has neither one value for each name nor no value.
pub(crate) fn read_joint_commands(message: &[u8]) -> Option<JointCommands> {
    let (_, commands) = decode::<(ReadHeader, JointCommands)>(message)?;
    let JointCommands { names, positions, velocities, efforts } = &commands;
    let fits = |array: &&Vec<f64>| array.is_empty() || array.len() == names.len();
    [positions, velocities, efforts].iter().all(fits).then_some(commands)
}

/// Encodes the state of the joints. Empty `efforts` mean that the effort of every joint is unknown.
pub(crate) fn joint_state(
    stamp: Stamp,
    names: &[&str],
    positions: &[f64],
    velocities: &[f64],
    efforts: &[f64],
) -> Vec<u8> {
    encode(&(header(stamp, ""), names, positions, velocities, efforts))
}

/// Position and heading of a drive base in its frame `odom`: x and y in m, heading in rad, positive to the left.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Pose {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) heading: f64,
}

impl Pose {
    /// Returns the pose in `odom` of `next`, which is given relative to this pose.
    pub(crate) fn then(self, next: Self) -> Self {
        let (sine, cosine) = self.heading.sin_cos();
        Self {
            x: self.x + next.x * cosine - next.y * sine,
            y: self.y + next.x * sine + next.y * cosine,
            heading: self.heading + next.heading,
        }
    }

    /// Returns the heading, a rotation about z, as a quaternion x, y, z, w.
    fn quaternion(self) -> [f64; 4] {
        let (z, w) = (self.heading / 2.0).sin_cos();
        [0.0, 0.0, z, w]
    }
}

/// Covariances that are unknown.
const UNKNOWN: [[f64; 6]; 6] = [[0.0; 6]; 6];

/// Encodes odometry. `twist` is the forward speed in m/s and the turning speed in rad/s.
pub(crate) fn odometry(stamp: Stamp, frames: [&str; 2], pose: Pose, twist: (f64, f64)) -> Vec<u8> {
    let twist = [twist.0, 0.0, 0.0, 0.0, 0.0, twist.1];
    let header = header(stamp, frames[0]);
    encode(&(header, frames[1], [pose.x, pose.y, 0.0], pose.quaternion(), UNKNOWN, twist, UNKNOWN))
}

/// Encodes one transform from the first frame to the second.
pub(crate) fn transform(stamp: Stamp, frames: [&str; 2], pose: Pose) -> Vec<u8> {
    encode(&vec![(header(stamp, frames[0]), frames[1], [pose.x, pose.y, 0.0], pose.quaternion())])
}

/// Encodes the heading of an inertial sensor in rad. Angular velocity and linear acceleration are unknown. ROS marks an
/// unknown value by the covariance -1 in its first element.
pub(crate) fn imu(stamp: Stamp, frame: &str, heading: f64) -> Vec<u8> {
    let mut absent = [0.0; 9];
    absent[0] = -1.0;
    let orientation = (Pose { heading, ..Pose::default() }.quaternion(), [0.0; 9]);
    let unknown = ([0.0; 3], absent);
    encode(&(header(stamp, frame), orientation, unknown, unknown))
}

/// Encodes the state of the battery. `amperes` is negative while the battery supplies current. All other values are
/// unknown.
pub(crate) fn battery_state(stamp: Stamp, volts: Option<f32>, amperes: f32) -> Vec<u8> {
    let (volts, present) = (volts.unwrap_or(f32::NAN), volts.is_some());
    // Charge, capacity, design capacity and percentage.
    let unknown = [f32::NAN; 4];
    // Status, health and technology are 0, which means unknown.
    let state = ([0u8; 3], present);
    let (voltages_of_cells, temperatures_of_cells): (&[f32], &[f32]) = (&[], &[]);
    let (location, serial_number) = ("", "");
    let cells = (voltages_of_cells, temperatures_of_cells);
    encode(&(header(stamp, ""), [volts, f32::NAN, amperes], unknown, state, cells, location, serial_number))
}

/// Level of a diagnostic status.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    Ok = 0,
    Warn = 1,
    Error = 2,
    /// No new values arrive.
    Stale = 3,
}

/// Diagnostic status of a hub or of one of its joints.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Status {
    pub(crate) level: Level,
    pub(crate) name: String,
    pub(crate) message: String,
    pub(crate) values: Vec<(&'static str, String)>,
}

pub(crate) fn diagnostics(stamp: Stamp, hardware: &str, all: &[Status]) -> Vec<u8> {
    let status = |Status { level, name, message, values }| (level as u8, name, message, hardware, values);
    encode(&(header(stamp, ""), all.iter().cloned().map(status).collect::<Vec<_>>()))
}

pub(crate) fn string(text: &str) -> Vec<u8> {
    encode(&text)
}

/// Reads an empty request, which is one byte.
pub(crate) fn read_trigger(message: &[u8]) -> Option<()> {
    decode::<u8>(message).map(|_| ())
}

pub(crate) fn read_set_bool(message: &[u8]) -> Option<bool> {
    decode(message)
}

/// Encodes the answer of a `Trigger` or a `SetBool` service.
pub(crate) fn answer(success: bool, message: &str) -> Vec<u8> {
    encode(&(success, message))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Converts a hexadecimal text to bytes. `0*9` means nine zero bytes.
    fn bytes(text: &str) -> Vec<u8> {
        let hex: String = text
            .split_whitespace()
            .map(|part| match part.strip_prefix("0*") {
                Some(count) => "00".repeat(count.parse().unwrap()),
                None => part.to_owned(),
            })
            .collect();
        hex.as_bytes()
            .chunks(2)
            .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
            .collect()
    }

    const AT: Stamp = Stamp(1_000_000_002);
    /// Stamped twist with the stamp 1 s and 2 ns, the frame `base_link`, 0.5 m/s and -1 rad/s.
    const STAMPED: &str = "0001000001000000020000000a000000626173655f6c696e6b 0*9 e03f 0*38 f0bf";

    // The bytes below were made by rosbags 0.11.9.

    #[test]
    fn what_a_hub_sends_is_what_ros_writes_byte_for_byte() {
        let names = ["left", "right"];
        assert_eq!(
            joint_state(AT, &names, &[1.0, 2.0], &[0.5, -0.5], &[]),
            bytes(
                "000100000100000002000000010000000000000002000000050000006c6566740000000006000000726967687400000002 0*9 \
                 f03f000000000000004002 0*13 e03f000000000000e0bf00000000"
            )
        );
        let frames = ["odom", "base_link"];
        assert_eq!(
            odometry(AT, frames, Pose::default(), (0.5, -1.0)),
            bytes(
                "000100000100000002000000050000006f646f6d000000000a000000626173655f6c696e6b 0*61 f03f 0*294 e03f 0*38 f0bf 0*288"
            )
        );
        assert_eq!(
            transform(AT, frames, Pose { x: 0.5, ..Pose::default() }),
            bytes(
                "00010000010000000100000002000000050000006f646f6d000000000a000000626173655f6c696e6b 0*9 e03f 0*46 f03f"
            )
        );
        assert_eq!(
            imu(AT, "base_link", 0.0),
            bytes("0001000001000000020000000a000000626173655f6c696e6b 0*33 f03f 0*102 f0bf 0*94 f0bf 0*64")
        );
        assert_eq!(
            battery_state(AT, Some(12.5), -1.5),
            bytes(
                "00010000010000000200000001 0*9 48410000c07f0000c0bf0000c07f0000c07f0000c07f0000c07f00000001 0*8 \
                 01000000000000000100000000"
            )
        );
        let status = Status {
            level: Level::Warn,
            name: "hub: motor 0".to_owned(),
            message: "stall".to_owned(),
            values: vec![("temp", "40".to_owned())],
        };
        assert_eq!(
            diagnostics(AT, "hub", &[status]),
            bytes(
                "000100000100000002000000010000000000000001000000010000000d0000006875623a206d6f746f72203000000000060000007374616c6c\
                 0000000400000068756200010000000500000074656d700000000003000000343000"
            )
        );
        assert_eq!(answer(true, "ok"), bytes("0001000001000000030000006f6b00"));
        assert_eq!(string("<robot/>"), bytes("00010000 09000000 3c726f626f742f3e 00"));
    }

    #[test]
    fn what_ros_writes_is_read() {
        assert_eq!(read_twist(&bytes("0001 0*8 e03f 0*38 f0bf")), Some((0.5, -1.0)));
        assert_eq!(read_twist_stamped(&bytes(STAMPED)), Some((0.5, -1.0)));
        assert_eq!(read_trigger(&bytes("0001000000")), Some(()));
        assert_eq!(read_set_bool(&bytes("0001000001")), Some(true));
        let names = ["left", "right"];
        let commands = read_joint_commands(&joint_state(AT, &names, &[1.0, 2.0], &[], &[3.0, 4.0])).unwrap();
        assert_eq!(commands.names, names);
        assert_eq!(
            (commands.positions, commands.velocities, commands.efforts),
            (vec![1.0, 2.0], vec![], vec![3.0, 4.0])
        );
    }

    #[test]
    fn an_array_that_has_not_one_value_for_each_name_is_refused() {
        for positions in [&[1.0][..], &[1.0, 2.0, 3.0]] {
            let message = joint_state(AT, &["left", "right"], positions, &[0.5, 0.5], &[]);
            assert_eq!(read_joint_commands(&message), None);
        }
    }

    #[test]
    fn a_message_cut_anywhere_or_too_long_is_refused() {
        let twist = bytes(STAMPED);
        assert!((0..twist.len()).all(|end| read_twist_stamped(&twist[..end]).is_none()));
        assert!(read_twist_stamped(&[&twist[..], &[0; 3]].concat()).is_some());
        assert!(read_twist_stamped(&[&twist[..], &[0; 4]].concat()).is_none());
        let joints = joint_state(AT, &["left", "right"], &[1.0, 2.0], &[0.5, -0.5], &[1.0, 1.0]);
        assert!((0..joints.len()).all(|end| read_joint_commands(&joints[..end]).is_none()));
        // The first message is big-endian CDR. The second has a sequence with a count of 2^32 - 1.
        assert!(read_set_bool(&[0, 0, 0, 0, 1]).is_none());
        assert!(read_joint_commands(&bytes("00010000 0*8 01000000 00 0*3 ffffffff")).is_none());
    }

    #[test]
    fn a_twist_that_is_not_a_number_is_refused() {
        let mut twist = bytes("0001 0*8 e03f 0*38 f0bf");
        twist[4..12].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(read_twist(&twist).is_none());
    }
}
