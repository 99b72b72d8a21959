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

/// A task of `cargo xtask`.
struct Task {
    /// Name of the task, with its arguments.
    call: &'static str,
    start: fn(&[String]) -> Result<(), Failed>,
    /// Description for the list of tasks.
    does: &'static str,
}

/// Arguments of cargo that run the tests of images on emulated chips. Both packages are in one command, so that shared crates are
/// built once.
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

/// Modules of tests that run on the H743, whatever the board. They are left out of the tests of another board.
const ON_THE_H743: [&str; 4] = ["flash::", "h743::", "store::", "update::"];

/// Modules of tests that are left out of the tests of the H743: what repeats these tests within those of another board, and
/// what counts one motor's step, which runs by itself on a core that is no board's.
const NOT_ON_THE_H743: [&str; 2] = ["h743::repeated::", "budget::"];

const TASKS: [Task; 18] = [
    task("check", check::task, "format, lints of host, chips and core, documentation"),
    task(
        "test [emulated|BOARD]",
        test,
        "`cargo test`; or the short tests of images on emulated chips; or all tests of a board's image",
    ),
    task("long", long, "the tests that `cargo test` leaves out because they take minutes"),
    task("figures [--check]", figures::task, "draws docs/pictures, or says which are stale"),
    task(
        "results [--check] [--measured]",
        results::task,
        "writes docs/results; --check says which are stale, --measured takes tables that earlier tests have written",
    ),
    task("python", python::task, "builds the Python package and tests it as installed"),
    task(
        "ros [measure]",
        ros::task,
        "checks, builds and tests the ROS 2 package with third-party programs; or measures the load by fleets",
    ),
    task(
        "second",
        second::task,
        "boots the image of the NUCLEO-F429ZI on a second emulator, if it can be installed",
    ),
    task(
        "try [--check]",
        try_page::task,
        "makes docs/try/index.html, the dashboard without a server, or says whether it is stale",
    ),
    task(
        "build-time",
        build_time::task,
        "counts the crates of the default build, and measures how long the README's two commands build",
    ),
    task("size [BOARD]", size::task, "builds an image, or all: flash and static RAM against their limits"),
    task("image [BOARD]", board::image, "builds an image in the format for the USB drive of a NUCLEO"),
    task(
        "sign ELF SECRET [VERSION]",
        sign::task,
        "makes the raw bytes of an image and their signature, with a rollback version if one is given",
    ),
    task("flash [BOARD]", flash::task, "builds an image, flashes it with probe-rs and shows its log"),
    task("dist", dist::task, "builds the files that a release carries, into target/dist"),
    task("package", package, "builds the two published packages as their users build them"),
    task(
        "fuzz",
        fuzz::task,
        "sends random bytes to host link and store, a minute each; needs a C++ compiler",
    ),
    task("ci", ci, "runs what the build server runs: .ci/run"),
];

const fn task(call: &'static str, start: fn(&[String]) -> Result<(), Failed>, does: &'static str) -> Task {
    Task { call, start, does }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((name, rest)) = arguments.split_first() else {
        print!("{}", list());
        return ExitCode::SUCCESS;
    };
    let Some(task) = TASKS.iter().find(|task| task.call.split(' ').next() == Some(name)) else {
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
    let row = |task: &Task| format!("  {:32}{}\n", task.call, task.does);
    let boards: Vec<&str> = board::ALL.iter().map(|board| board.name).collect();
    let tasks: String = TASKS.iter().map(row).collect();
    format!(
        "cargo xtask TASK, where TASK is\n\n{tasks}\nBOARD is {}; image and flash take the first if none is named.\n",
        boards.join(", ")
    )
}

fn test(arguments: &[String]) -> Result<(), Failed> {
    match arguments {
        [] => cargo(&["test"]),
        [emulated] if emulated == "emulated" => {
            cargo(&IMAGES)?;
            documented()
        }
        _ => {
            let board = board::named(arguments)?;
            let is_h743 = board.name == "nucleo-h743zi2";
            let left_out: &[&str] = if is_h743 { &NOT_ON_THE_H743 } else { &ON_THE_H743 };
            let skipped = left_out.iter().chain([&REPORTS]).flat_map(|tests| ["--skip", tests]);
            let all: Vec<&str> =
                IMAGES.into_iter().chain(["--", "--nocapture", "--include-ignored"]).chain(skipped).collect();
            run(cargo_command(&all).env("MOTOR_HUB_BOARD", board.name))?;
            // The examples do not depend on the board, so one board runs them.
            if is_h743 { documented() } else { Ok(()) }
        }
    }
}

/// Runs the examples in the documentation of the packages of [`IMAGES`].
fn documented() -> Result<(), Failed> {
    let [packages @ .., _, _, _] = &IMAGES;
    cargo(&[&packages[..], &["--doc"]].concat())
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
    // Both packages are in one command, because the client is built with the packed library.
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
