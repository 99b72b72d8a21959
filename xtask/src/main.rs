//! The project's own tasks: `cargo xtask` lists them. A task is a few calls of cargo and of the program
//! motor-hub. The packages have the tests.
#![forbid(unsafe_code)]

mod board;
mod build_time;
mod check;
mod dist;
mod figures;
mod flash;
mod fuzz;
mod generated;
mod python;
mod results;
mod ros;
mod second;
mod sign;
mod size;
mod tool;
mod try_page;

use std::process::ExitCode;
use tool::{Failed, REPORTS, cargo, cargo_command, run};

/// A task: its name, its arguments, its description, its function.
struct Task {
    name: &'static str,
    arguments: &'static str,
    does: &'static str,
    start: fn(&[String]) -> Result<(), Failed>,
}

/// Tests of images on emulated chips. Both packages are in one command, so that shared crates are built once.
pub(crate) const IMAGES: [&str; 11] = [
    "test",
    "--release",
    "--package",
    "emulated",
    "--package",
    "motor-hub-cli",
    "--features",
    "motor-hub-cli/emulated",
    "--test",
    "image",
    "--test=emulated",
];

const TASKS: [Task; 18] = [
    Task {
        name: "check",
        arguments: "",
        does: "format, lints of host, chips and core, documentation",
        start: check::task,
    },
    Task {
        name: "test",
        arguments: "[emulated|BOARD]",
        does: "`cargo test`; or the short tests of images; or all tests of a board's image",
        start: test,
    },
    Task {
        name: "long",
        arguments: "",
        does: "the tests that `cargo test` leaves out because they take minutes",
        start: long,
    },
    Task {
        name: "figures",
        arguments: "[--check]",
        does: "draws docs/pictures, or says which are stale",
        start: figures::task,
    },
    Task {
        name: "results",
        arguments: "[--check]",
        does: "writes docs/results, or says which are stale",
        start: results::task,
    },
    Task {
        name: "python",
        arguments: "",
        does: "builds the Python package and tests it as installed",
        start: python::task,
    },
    Task {
        name: "ros",
        arguments: "[measure]",
        does: "checks and builds the ROS 2 package and tests it against programs of others; or measures what fleets cost",
        start: ros::task,
    },
    Task {
        name: "second",
        arguments: "",
        does: "boots the image of the NUCLEO-F429ZI on a second emulator, if it can be installed",
        start: second::task,
    },
    Task {
        name: "try",
        arguments: "[--check]",
        does: "makes docs/try/index.html, the dashboard without a server, or says whether it is stale",
        start: try_page::task,
    },
    Task {
        name: "build-time",
        arguments: "",
        does: "crates of the default build; seconds that the README's commands build",
        start: build_time::task,
    },
    Task {
        name: "size",
        arguments: "[BOARD]",
        does: "builds an image, or all: flash and static RAM against their limits",
        start: size::task,
    },
    Task {
        name: "image",
        arguments: "[BOARD]",
        does: "builds an image as the USB drive of a NUCLEO takes it",
        start: board::image,
    },
    Task {
        name: "sign",
        arguments: "ELF SECRET [VERSION]",
        does: "raw bytes of an image with a rollback version, and their signature by OpenSSL",
        start: sign::task,
    },
    Task {
        name: "flash",
        arguments: "[BOARD]",
        does: "builds an image, flashes it with probe-rs and shows its log",
        start: flash::task,
    },
    Task {
        name: "dist",
        arguments: "",
        does: "the files that a release carries, in target/dist",
        start: dist::task,
    },
    Task {
        name: "package",
        arguments: "",
        does: "the two published packages, built as their users build them",
        start: package,
    },
    Task {
        name: "fuzz",
        arguments: "",
        does: "random bytes into the host link for a minute; needs a C++ compiler",
        start: fuzz::task,
    },
    Task { name: "ci", arguments: "", does: "everything that must hold: .ci/run", start: ci },
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((name, rest)) = arguments.split_first() else {
        print!("{}", list());
        return ExitCode::SUCCESS;
    };
    let Some(task) = TASKS.iter().find(|task| task.name == name) else {
        eprintln!("error: there is no task {name}\n\n{}", list().trim_end());
        return ExitCode::from(2);
    };
    match (task.start)(rest) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failed(why)) => {
            eprintln!("error: {why}");
            ExitCode::FAILURE
        }
    }
}

fn list() -> String {
    let row = |task: &Task| {
        let call = format!("{} {}", task.name, task.arguments);
        format!("  {call:24}{}\n", task.does)
    };
    let boards: Vec<&str> = board::ALL.iter().map(|board| board.name).collect();
    let tasks: String = TASKS.iter().map(row).collect();
    format!(
        "cargo xtask TASK, where TASK is\n\n{tasks}\nBOARD is {}; flash takes the first if none is named.\n",
        boards.join(", ")
    )
}

fn test(arguments: &[String]) -> Result<(), Failed> {
    match arguments {
        [] => cargo(&["test"]),
        [emulated] if emulated == "emulated" => {
            cargo(&IMAGES)?;
            let [packages @ .., _, _, _] = &IMAGES;
            cargo(&[&packages[..], &["--doc"]].concat())
        }
        _ => {
            let board = board::named(arguments)?;
            let all = ["--", "--nocapture", "--include-ignored", "--skip", REPORTS];
            run(cargo_command(&[&IMAGES[..], &all].concat()).env("MOTOR_HUB_BOARD", board.name))
        }
    }
}

fn long(arguments: &[String]) -> Result<(), Failed> {
    tool::none(arguments)?;
    cargo(&["test", "--tests", "--", "--ignored", "--skip", REPORTS])
}

fn package(arguments: &[String]) -> Result<(), Failed> {
    tool::none(arguments)?;
    // Each run has its own folder. In the same folder cargo would reuse the unpacked sources of a package with the same
    // version.
    let place = format!("target/package-{}", std::process::id());
    // One command, because the client is built with the library that is packed beside it.
    let packed = cargo(&[
        "package",
        "--package",
        "motor-hub",
        "--package",
        "motor-hub-client",
        "--target-dir",
        &place,
    ]);
    let _ = std::fs::remove_dir_all(tool::root().join(&place));
    packed
}

fn ci(arguments: &[String]) -> Result<(), Failed> {
    tool::none(arguments)?;
    run(&mut tool::command(".ci/run"))
}
