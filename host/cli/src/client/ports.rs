//! Lists the serial ports of this machine, and explains why a port cannot be opened.

use crate::output::{Failure, print, print_json};
use motor_hub_client::OpenError;
use motor_hub_client::line::{self, Port, is_tcp};
use serde_json::json;
use std::io::ErrorKind;

/// Path of the udev rule that gives access to a port without membership of a group.
const RULE: &str = "boards/nucleo-f429zi/70-motor-hub.rules";

pub(super) fn show(json: bool) -> Result<(), Failure> {
    if json { print_json(&json!({ "ports": all()? })) } else { print(&list()?) }
}

pub(super) fn all() -> Result<Vec<Port>, Failure> {
    line::ports().map_err(|e| Failure::Work(format!("serial ports cannot be listed: {e}")))
}

/// Returns the serial ports of this machine as text.
pub(super) fn list() -> Result<String, Failure> {
    let ports = all()?;
    if ports.is_empty() {
        return Ok("No serial ports found\n".to_owned());
    }
    let lines = ports.iter().map(|port| format!("  {} {}", port.path, port.description));
    let lines: String = lines.map(|line| line.trim_end().to_owned() + "\n").collect();
    Ok(format!("Serial ports found:\n{lines}"))
}

/// Returns the message for a place that cannot be opened: the reason, and what the user can do.
pub(crate) fn unopened(place: &str, error: &OpenError) -> String {
    match error {
        OpenError::Denied => format!("{place}: {error}; {}", hint(group(place).as_deref())),
        OpenError::System(system) if system.kind() == ErrorKind::ConnectionRefused => format!(
            "{place}: {error}; no hub is served there: start one by `motor-hub serve --tcp HOST:PORT`"
        ),
        error => match std::fs::read_link(place) {
            // `serve --link` leaves its link if the program is killed.
            Ok(port) if port.starts_with("/dev/pts") && !port.exists() => format!(
                "{place}: the link leads to {}, which no longer exists, because the served hub has ended; serve the hub again",
                port.display()
            ),
            Err(missing) if missing.kind() == ErrorKind::NotFound && !is_tcp(place) => {
                format!("{place}: {error}\n{}", list().unwrap_or_default().trim_end())
            }
            _ => format!("{place}: {error}"),
        },
    }
}

/// Returns a text that says how a user gets access to a port. `group` is the group that owns the port.
fn hint(group: Option<&str>) -> String {
    let rule = format!("the udev rule {RULE}");
    match group {
        // A user should not join the group root.
        None | Some("root") => {
            format!("only root may open it: install {rule}, or run this command with sudo")
        }
        Some(group) => {
            format!("join its group (sudo usermod -a -G {group} $USER, then log in again), or install {rule}")
        }
    }
}

/// Returns the name of the group that owns a file.
#[cfg(unix)]
fn group(path: &str) -> Option<String> {
    use std::os::unix::fs::MetadataExt;
    let id = std::fs::metadata(path).ok()?.gid();
    named(&std::fs::read_to_string("/etc/group").ok()?, id)
}

#[cfg(not(unix))]
fn group(_: &str) -> Option<String> {
    None
}

/// Returns the name of the group with the number `id` in the text of `/etc/group`.
#[cfg(any(unix, test))]
fn named(groups: &str, id: u32) -> Option<String> {
    let mut rows = groups.lines().map(|line| line.split(':'));
    rows.find_map(|mut row| {
        let name = row.next()?;
        (row.nth(1)?.parse() == Ok(id)).then(|| name.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_for_a_denied_port_names_its_group_and_the_udev_rule() {
        let groups = "root:x:0:\ndialout:x:20:alice,bob\nbroken\n";
        assert_eq!(named(groups, 20).as_deref(), Some("dialout"));
        assert_eq!(named(groups, 21), None);
        assert!(hint(Some("dialout")).contains("usermod -a -G dialout $USER"));
        assert!(!hint(Some("root")).contains("usermod") && hint(None).contains(RULE));
    }
}
