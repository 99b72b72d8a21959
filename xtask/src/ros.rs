//! `cargo xtask ros`: checks and builds the ROS 2 package, and tests it against programs of others.

use crate::python;
use crate::tool::{Failed, cargo, none, root, run};
use std::process::Command;

/// The package, which is a workspace of its own.
const MANIFEST: &str = "host/ros/Cargo.toml";

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    none(arguments)?;
    let target = root().join("target");
    let folder = target.join("ros");
    let cargo_ros = |task: &[&str], rest: &[&str]| {
        let folder = folder.to_string_lossy();
        cargo(&[task, &["--manifest-path", MANIFEST, "--target-dir", &folder], rest].concat())
    };
    cargo(&["fmt", "--check", "--manifest-path", MANIFEST])?;
    cargo_ros(&["clippy", "--all-targets"], &["--", "-D", "warnings"])?;
    cargo_ros(&["test"], &[])?;
    cargo_ros(&["build"], &[])?;
    // The tests serve a simulated hub by the program.
    cargo(&["build", "--package", "motor-hub-cli"])?;
    let packages = ["eclipse-zenoh==1.10.2", "rosbags==0.11.9", "zenoh-ros2-sdk==0.1.8", "xxhash", "numpy"];
    let python = python::environment("ros-python", &packages)?;
    run(Command::new(python)
        .arg(root().join("host/ros/tests/test_peers.py"))
        .env("MOTOR_HUB", target.join("debug/motor-hub"))
        .env("MOTOR_HUB_ROS", folder.join("debug/motor-hub-ros")))
}
