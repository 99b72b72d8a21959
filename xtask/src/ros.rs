//! `cargo xtask ros`: checks and builds the ROS 2 package, and tests it against third-party programs. `measure` instead measures
//! the processor time and memory of fleets.

use crate::python;
use crate::tool::{Failed, cargo, none, root, run, tested_program};
use std::process::Command;

/// The package, which is a workspace of its own.
const MANIFEST: &str = "host/ros/Cargo.toml";

/// The picture of the course of a simulated robot that drives along a square.
const PICTURE: &str = "docs/pictures/odom.svg";

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    let measures = arguments == ["measure"];
    if !measures {
        none(arguments)?;
    }
    let target = root().join("target");
    let folder = target.join("ros");
    let cargo_ros = |task: &[&str], rest: &[&str]| {
        let folder = folder.to_string_lossy();
        cargo(&[task, &["--manifest-path", MANIFEST, "--target-dir", &folder], rest].concat())
    };
    // The tests start the program motor-hub, which serves simulated hubs.
    let (profile, served) = if measures {
        cargo_ros(&["build", "--release"], &[])?;
        cargo(&["build", "--release", "--package", "motor-hub-cli"])?;
        ("release", target.join("release/motor-hub"))
    } else {
        cargo(&["fmt", "--check", "--manifest-path", MANIFEST])?;
        cargo_ros(&["clippy", "--all-targets"], &["--", "-D", "warnings"])?;
        cargo_ros(&["test"], &[])?;
        cargo_ros(&["build"], &[])?;
        ("debug", tested_program()?)
    };
    let packages = ["eclipse-zenoh==1.10.2", "rosbags==0.11.9", "zenoh-ros2-sdk==0.1.8", "xxhash", "numpy"];
    let python = python::environment("ros-python", &packages)?;
    let program = |script: &str| {
        let mut command = Command::new(&python);
        command
            .arg(root().join("host/ros/tests").join(script))
            .env("MOTOR_HUB", &served)
            .env("MOTOR_HUB_ROS", folder.join(profile).join("motor-hub-ros"));
        command
    };
    if measures {
        run(&mut program("measure.py"))?;
        run(program("measure.py").arg("square").arg(root().join(PICTURE)))
    } else {
        run(&mut program("test_peers.py"))
    }
}
