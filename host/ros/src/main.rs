//! `motor-hub-ros CONFIG.toml`: makes motor hubs nodes of ROS 2. The program uses Zenoh, and needs no ROS installation.
//!
//! ```text
//!  ROS nodes <--> router (rmw_zenohd, zenohd) <--> [this program] <--> hubs, by serial port or TCP
//! ```
//!
//! The wire format is that of rmw_zenoh. `docs/guides/ros2.md` explains topics, services, and what stops motors.
#![forbid(unsafe_code)]

/// Prints a line on standard output. A line that nobody reads is dropped, because the robot must outlive its readers.
macro_rules! print_line {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}

/// Prints a line on standard error, as [`print_line`] does on standard output.
macro_rules! print_error_line {
    ($($text:tt)*) => {{
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}

mod config;
mod hub;
mod messages;
mod names;
mod node;
mod robot;

use config::Config;
use hub::HubThread;
use node::Graph;
use robot::Robot;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::time::{Duration, Instant};
use zenoh::Wait;

/// Largest configuration and largest robot description in bytes. A description with all details has some 100 kB.
const LARGEST_FILE: u64 = 16 << 20;

fn main() -> ExitCode {
    let mut arguments = std::env::args_os().skip(1);
    let outcome = match (arguments.next(), arguments.next()) {
        (Some(option), None) if option == "--help" || option == "-h" => {
            print_line!(
                "Usage: motor-hub-ros CONFIG.toml\n\nMakes motor hubs nodes of ROS 2; see docs/guides/ros2.md\n\n\
                 Options:\n  -h, --help     Print help\n  -V, --version  Print version"
            );
            Ok(())
        }
        (Some(option), None) if option == "--version" || option == "-V" => {
            print_line!("motor-hub-ros {}", env!("CARGO_PKG_VERSION"));
            Ok(())
        }
        (Some(path), None) => run(Path::new(&path)),
        _ => Err("give one argument: the configuration file".to_owned()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            print_error_line!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs until Ctrl-C, then disables all motors.
fn run(path: &Path) -> Result<(), String> {
    let config = Config::read(&read(path)?).map_err(|error| format!("{}: {error}", path.display()))?;
    let domain = config.domain()?;
    let description = |hub: &config::Hub| hub.robot_description.as_deref().map(read).transpose();
    let descriptions = config.hubs.iter().map(description).collect::<Result<Vec<_>, _>>()?;
    print_line!("waits for the router at {}", config.router);
    let session = zenoh::open(settings(&config.router)?).wait().map_err(|error| error.to_string())?;
    // Until here no hub is open, and the first signal ends the program immediately.
    let ends = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // A second signal ends the program immediately.
        signal_hook::flag::register_conditional_default(signal, ends.clone())
            .map_err(|error| error.to_string())?;
        signal_hook::flag::register(signal, ends.clone()).map_err(|error| error.to_string())?;
    }
    print_line!("domain {domain}, session {}", session.zid());

    let mut graph = Graph::new(&session, domain, config.distribution);
    let mut threads = Vec::new();
    for (hub, description) in config.hubs.into_iter().zip(descriptions) {
        let (sender, events) = std::sync::mpsc::channel();
        let malformed = Arc::new(AtomicU64::new(0));
        let topics = graph
            .join(&hub, description.as_deref(), &sender, &malformed)
            .map_err(|error| format!("hub {}: {error}", hub.place))?;
        let thread = HubThread {
            robot: Robot::new(hub, graph.publishers()),
            topics,
            events,
            malformed,
            ends: ends.clone(),
            interval: Duration::from_secs(1) / config.rate_hz,
            start: Instant::now(),
        };
        threads.push(std::thread::spawn(|| thread.run()));
    }
    for thread in threads {
        thread.join().map_err(|_| "the thread of a hub has failed".to_owned())?;
    }
    session.close().wait().map_err(|error| error.to_string())
}

/// Reads a text file of [`LARGEST_FILE`] bytes at most. A device such as `/dev/zero` has no end.
fn read(path: &Path) -> Result<String, String> {
    let mut text = String::new();
    let length = File::open(path).and_then(|file| file.take(LARGEST_FILE + 1).read_to_string(&mut text));
    match length {
        Ok(length) if length as u64 <= LARGEST_FILE => Ok(text),
        Ok(_) => Err(format!("{}: more than {LARGEST_FILE} bytes, the largest size allowed", path.display())),
        Err(error) => Err(format!("{}: {error}", path.display())),
    }
}

/// Returns the settings of a Zenoh client. The client waits for the router without a time-out, also after the router
/// has been restarted.
fn settings(router: &str) -> Result<zenoh::Config, String> {
    let mut settings = zenoh::Config::default();
    let endpoint = format!("[{router:?}]");
    for (key, value) in [
        ("mode", "\"client\""),
        ("connect/endpoints", &endpoint),
        ("connect/timeout_ms", "-1"),
        ("scouting/multicast/enabled", "false"),
        ("timestamping/enabled", "true"),
    ] {
        settings.insert_json5(key, value).map_err(|error| format!("router {router:?}: {error}"))?;
    }
    Ok(settings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_without_an_end_is_refused() {
        let error = read(Path::new("/dev/zero")).unwrap_err();
        assert_eq!(error, "/dev/zero: more than 16777216 bytes, the largest size allowed");
    }
}
