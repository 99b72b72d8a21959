//! The configuration file: hubs, their joints, and their drive bases. `docs/guides/ros2.md` has an example.

use motor_hub_client::motor_hub::group::{BaseSettings, DriveBase};
use motor_hub_client::motor_hub::protocol::{Address, CHANNELS};
use motor_hub_client::motor_hub::units::RangeError;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Contents of the configuration file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Config {
    /// Domain of ROS, 0 to 232. Without this value the environment variable `ROS_DOMAIN_ID` applies, or domain 0.
    pub(crate) domain: Option<u32>,
    /// Zenoh endpoint of the router, such as `tcp/localhost:7447`.
    #[serde(default = "local_router")]
    pub(crate) router: String,
    #[serde(default)]
    pub(crate) distribution: Distribution,
    /// Messages per second of joint states, odometry and heading, 1 to 100.
    #[serde(default = "fifty")]
    pub(crate) rate_hz: u32,
    #[serde(rename = "hub")]
    pub(crate) hubs: Vec<Hub>,
}

fn local_router() -> String {
    "tcp/localhost:7447".to_owned()
}

const fn fifty() -> u32 {
    50
}

/// A distribution of ROS 2. The distributions differ in the names on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Distribution {
    Humble,
    #[default]
    Jazzy,
    Kilted,
    Lyrical,
}

/// A hub on a serial port or TCP port. This hub and the hubs behind it on its chain line become one ROS node.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Hub {
    /// Serial port, or HOST:PORT.
    pub(crate) place: String,
    /// Namespace such as `/hub0`; empty for none.
    #[serde(default)]
    pub(crate) namespace: String,
    /// File with a description of the robot (URDF), published on the latched topic `robot_description`.
    pub(crate) robot_description: Option<PathBuf>,
    #[serde(rename = "joint", default)]
    pub(crate) joints: Vec<Joint>,
    pub(crate) base: Option<Base>,
}

/// A joint that a motor drives.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Joint {
    pub(crate) name: String,
    /// Address of the hub that has the motor, if that hub is behind the hub at `place`.
    pub(crate) address: Option<u8>,
    /// Motor 0 to 3.
    pub(crate) motor: u8,
    /// Encoder counts per turn of the joint. A negative number reverses the direction of the joint.
    pub(crate) counts_per_turn: f64,
    /// Torque of the joint in N m per ampere of the motor. Without this value the joint neither reports nor accepts an
    /// effort.
    pub(crate) torque_per_ampere: Option<f64>,
    /// Speed limit in rad/s for commands with a position or an effort.
    pub(crate) speed: f64,
}

impl Joint {
    /// Encoder counts per rad.
    pub(crate) const fn counts_per_radian(&self) -> f64 {
        self.counts_per_turn / TAU
    }
}

/// A drive base with two wheels.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Base {
    /// Name of the joint of the left wheel.
    pub(crate) left: String,
    /// Name of the joint of the right wheel.
    pub(crate) right: String,
    pub(crate) wheel_diameter_m: f64,
    /// Distance between the centres of the wheels in m.
    pub(crate) track_m: f64,
    /// True if the base holds the heading of a BNO055 on I2C bus 0. A hub without this sensor holds the heading by the
    /// encoders.
    #[serde(default = "yes")]
    pub(crate) use_gyro: bool,
    #[serde(default = "odom")]
    pub(crate) odom_frame: String,
    #[serde(default = "base_link")]
    pub(crate) base_frame: String,
}

const fn yes() -> bool {
    true
}

fn odom() -> String {
    "odom".to_owned()
}

fn base_link() -> String {
    "base_link".to_owned()
}

impl Hub {
    /// Returns the addresses of the hubs behind this hub.
    pub(crate) fn children(&self) -> BTreeSet<u8> {
        self.joints.iter().filter_map(|joint| joint.address).collect()
    }

    /// Returns the drive base, and the indices of the joints of its left and its right wheel; `None` without a base.
    pub(crate) fn drive_base(&self) -> Option<(DriveBase, [usize; 2])> {
        let base = self.base.as_ref()?;
        let index = |name: &str| self.joints.iter().position(|joint| joint.name == name);
        let (left, right) = (index(&base.left)?, index(&base.right)?);
        let counts = |at: usize| self.joints.get(at).map(|joint| joint.counts_per_turn);
        let drive = DriveBase {
            wheel_diameter_mm: 1e3 * base.wheel_diameter_m,
            track_mm: 1e3 * base.track_m,
            counts_per_turn: [counts(left)?, counts(right)?],
        };
        Some((drive, [left, right]))
    }

    /// Returns the settings with which the drive base is configured in the hub; `None` without a base.
    pub(crate) fn base_settings(&self) -> Option<Result<BaseSettings, RangeError>> {
        let (drive, joints) = self.drive_base()?;
        let [left, right] = joints.map(|joint| self.joints.get(joint).map(|joint| joint.motor));
        Some(BaseSettings::new([left?, right?], &drive, self.base.as_ref()?.use_gyro))
    }

    fn check(&self) -> Result<(), String> {
        let at = &self.place;
        if at.is_empty() {
            return Err("a hub has an empty place; give a serial port or HOST:PORT".to_owned());
        }
        let named = |name: &str| {
            name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
                && name.starts_with(|c: char| !c.is_ascii_digit())
        };
        let parts = self.namespace.strip_prefix('/').map(|rest| rest.split('/').all(named));
        if !self.namespace.is_empty() && parts != Some(true) {
            return Err(format!(
                "hub {at}: namespace is {:?}; allowed is / and letters, digits and _, such as /hub0",
                self.namespace
            ));
        }
        let (mut motors, mut names) = (BTreeSet::new(), BTreeSet::new());
        for Joint { name, address, motor, counts_per_turn, torque_per_ampere, speed } in &self.joints {
            let wrong = if let Some(address) = address.filter(|&address| Address::new(address).is_none()) {
                format!("address is {address}; allowed are 1 to 254")
            } else if usize::from(*motor) >= CHANNELS {
                format!("motor is {motor}; allowed are 0 to {}", CHANNELS - 1)
            } else if !motors.insert((address, motor)) {
                format!("motor {motor} has another joint already; give each motor one joint")
            } else if name.is_empty() || !names.insert(name) {
                "the name is empty or used twice; give each joint a name of its own".to_owned()
            } else if name.contains(char::is_control) {
                "the name has a control character, such as a tab or NUL; give a name without one".to_owned()
            } else if !counts_per_turn.is_finite() || *counts_per_turn == 0.0 {
                format!("counts_per_turn is {counts_per_turn}; allowed is every number but 0")
            } else if !speed.is_finite() || *speed <= 0.0 {
                format!("speed is {speed}; allowed is more than 0 rad/s")
            } else if torque_per_ampere.is_some_and(|torque| !torque.is_finite() || torque <= 0.0) {
                "torque_per_ampere must be more than 0 N m/A".to_owned()
            } else {
                continue;
            };
            return Err(format!("hub {at}: joint {name:?}: {wrong}"));
        }
        if let Some(base) = &self.base {
            let sizes = [("wheel_diameter_m", base.wheel_diameter_m), ("track_m", base.track_m)];
            if let Some((name, size)) = sizes.into_iter().find(|(_, size)| !size.is_finite() || *size <= 0.0)
            {
                return Err(format!("hub {at}: base: {name} is {size}; allowed is more than 0 m"));
            }
            if base.left == base.right || self.drive_base().is_none() {
                return Err(format!(
                    "hub {at}: base: left is {:?} and right is {:?}; both must be names of joints, and differ",
                    base.left, base.right
                ));
            }
            let is_behind =
                |joint: &Joint| [&base.left, &base.right].contains(&&joint.name) && joint.address.is_some();
            if self.joints.iter().any(is_behind) {
                return Err(format!(
                    "hub {at}: base: both wheels must be motors of the hub at this place; give their joints no address"
                ));
            }
            if let Some(Err(error)) = self.base_settings() {
                return Err(format!("hub {at}: base: {error}"));
            }
        }
        Ok(())
    }
}

impl Config {
    /// Reads and checks a configuration.
    ///
    /// # Errors
    /// A text that says what is wrong, where, and what is allowed.
    pub(crate) fn read(text: &str) -> Result<Self, String> {
        let config: Self = toml::from_str(text).map_err(|error| error.to_string().trim_end().to_owned())?;
        if !(1..=100).contains(&config.rate_hz) {
            return Err(format!("rate_hz is {}; allowed are 1 to 100", config.rate_hz));
        }
        // This program has Zenoh's transport over TCP only, and would wait for a router of another one without an end.
        if config.router.strip_prefix("tcp/").is_none_or(|address| !address.contains(':')) {
            return Err(format!("router is {:?}; allowed is tcp/HOST:PORT", config.router));
        }
        if config.hubs.is_empty() {
            return Err("there is no hub; give at least one table [[hub]]".to_owned());
        }
        let (mut places, mut namespaces) = (BTreeSet::new(), BTreeSet::new());
        for hub in &config.hubs {
            hub.check()?;
            if !places.insert(&hub.place) {
                return Err(format!(
                    "two hubs have the place {:?}; give the joints of a hub behind another hub its address",
                    hub.place
                ));
            }
            if !namespaces.insert(&hub.namespace) {
                return Err(format!(
                    "two hubs have the namespace {:?}; give each hub one of its own",
                    hub.namespace
                ));
            }
        }
        config.domain()?;
        Ok(config)
    }

    /// Returns the domain of the file, otherwise of the environment variable `ROS_DOMAIN_ID`, otherwise 0.
    pub(crate) fn domain(&self) -> Result<u32, String> {
        let domain = match (self.domain, std::env::var("ROS_DOMAIN_ID")) {
            (Some(domain), _) => domain,
            (None, Ok(text)) if !text.is_empty() => {
                text.parse().map_err(|_| format!("ROS_DOMAIN_ID is {text:?}; allowed are 0 to 232"))?
            }
            (None, _) => 0,
        };
        if domain <= 232 { Ok(domain) } else { Err(format!("domain is {domain}; allowed are 0 to 232")) }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) const EXAMPLE: &str = r#"
        [[hub]]
        place = "127.0.0.1:7070"
        namespace = "/hub0"
        joint = [
            { name = "left", motor = 0, counts_per_turn = 1680, torque_per_ampere = 0.6, speed = 6 },
            { name = "right", motor = 1, counts_per_turn = -1680, speed = 6 },
        ]
        base = { left = "left", right = "right", wheel_diameter_m = 0.09, track_m = 0.3 }
    "#;

    #[test]
    fn a_file_gives_hubs_joints_and_base() {
        let config = Config::read(EXAMPLE).unwrap();
        assert_eq!((config.router.as_str(), config.rate_hz), ("tcp/localhost:7447", 50));
        let (base, joints) = config.hubs[0].drive_base().unwrap();
        assert_eq!((base.counts_per_turn, joints), ([1680.0, -1680.0], [0, 1]));
    }

    #[test]
    fn what_is_wrong_is_named_with_what_is_allowed() {
        for (from, to, message) in [
            ("motor = 1", "motor = 4", "motor is 4; allowed are 0 to 3"),
            ("motor = 1", "motor = 0", "motor 0 has another joint already"),
            ("motor = 1", "address = 255, motor = 1", "address is 255; allowed are 1 to 254"),
            ("motor = 1", "address = 3, motor = 0", "both wheels must be motors of the hub at this place"),
            ("\"right\", motor", "\"left\", motor", "empty or used twice"),
            ("\"right\", motor", "\"a\\u0000b\", motor", "the name has a control character"),
            ("\"right\", motor", "\"a\\nb\", motor", "the name has a control character"),
            ("1680, torque", "0, torque", "counts_per_turn is 0; allowed is every number but 0"),
            (
                "speed = 6 },\n        ]",
                "speed = -1 },\n        ]",
                "speed is -1; allowed is more than 0 rad/s",
            ),
            ("track_m = 0.3", "track_m = 0", "track_m is 0; allowed is more than 0 m"),
            ("track_m = 0.3", "track_m = 30", "a track of 1 mm to 10 m"),
            ("right = \"right\"", "right = \"arm\"", "both must be names of joints, and differ"),
            ("/hub0", "hub0", "namespace is \"hub0\"; allowed is / and letters"),
            ("/hub0", "/0hub", "namespace is \"/0hub\""),
            ("[[hub]]", "rate_hz = 0\n[[hub]]", "rate_hz is 0; allowed are 1 to 100"),
            (
                "[[hub]]",
                "router = \"localhost:7447\"\n[[hub]]",
                "router is \"localhost:7447\"; allowed is tcp/HOST:PORT",
            ),
            ("[[hub]]", "router = \"udp/localhost:7447\"\n[[hub]]", "allowed is tcp/HOST:PORT"),
            ("127.0.0.1:7070", "", "a hub has an empty place"),
            ("[[hub]]", "domain = 233\n[[hub]]", "domain is 233; allowed are 0 to 232"),
            ("[[hub]]", "distribution = \"foxy\"\n[[hub]]", "expected one of `humble`, `jazzy`"),
            ("[[hub]]", "rates = 1\n[[hub]]", "unknown field `rates`"),
        ] {
            let error = Config::read(&EXAMPLE.replace(from, to)).unwrap_err();
            assert!(error.contains(message), "{message}: {error}");
        }
        let twice = |other: &str| Config::read(&format!("{EXAMPLE}{other}")).unwrap_err();
        assert!(twice(EXAMPLE).contains("two hubs have the place"));
        assert!(twice(&EXAMPLE.replace("7070", "7071")).contains("two hubs have the namespace"));
    }
}
