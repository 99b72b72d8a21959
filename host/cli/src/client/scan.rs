//! `motor-hub client scan`: finds hubs.

use super::devices::{equipment_json, equipment_text};
use super::motors_off::disable_left_enabled;
use super::ports;
use crate::output::{Failure, print, print_error_line, print_json};
use crate::served_hubs::{self, ServedHub};
use clap::builder::NonEmptyStringValueParser;
use motor_hub::board::Equipment;
use motor_hub::protocol::Address;
use motor_hub_client::line::{Line, is_tcp};
use motor_hub_client::{Error, OpenError, Session};
use serde_json::{Value, json};
use std::net::ToSocketAddrs;
use std::path::PathBuf;
use std::thread;
use std::time::Duration;
use studies::table;

/// Looks for hubs on all serial ports of this machine and at given places
///
/// Also looks at hubs that this user serves (`motor-hub serve`). Places are paths, such as the --link of a served
/// hub, or HOST:PORT.
///
/// The scan opens every serial port and sends a discovery of 11 bytes at 460800 baud. Give --only if these bytes
/// might disturb another connected device. Motors that are found enabled are disabled. A served hub that has a host
/// is listed as in use, and receives nothing.
///
/// Exit codes: 0 a hub was found; 1 no hub was found.
#[derive(clap::Args)]
pub(super) struct Options {
    /// Serial ports that the system does not list, links to ports, or HOST:PORT
    #[arg(value_name = "PLACE", value_parser = NonEmptyStringValueParser::new())]
    places: Vec<String>,
    /// Skips the serial ports that the system lists: scans only served hubs and the given places
    #[arg(long)]
    only: bool,
    /// JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// A hub at a place.
struct Found {
    address: u8,
    kind: &'static str,
    /// Version text of the hub; empty for several hubs with one address.
    version: String,
    /// Devices of the hub other than motors; `None` if the hub does not report them.
    equipment: Option<Equipment>,
}

/// Returns a text for the kind of a hub: parent, child, or several hubs with one address.
pub(super) const fn kind(hub: &motor_hub_client::session::Found) -> &'static str {
    match hub {
        _ if hub.duplicate => {
            "several hubs with this address: connect each alone, and give it another by set-address"
        }
        _ if hub.parent => "parent",
        _ => "child",
    }
}

/// A place to scan.
struct Place {
    name: String,
    /// True if the place has a served hub with a host, false if the served hub has no host. `None` if no served hub is
    /// known at this place.
    served: Option<bool>,
}

impl From<String> for Place {
    fn from(name: String) -> Self {
        Self { name, served: None }
    }
}

impl Options {
    /// Scans the places of the options and of `named`, the served hubs of this user and, without `--only`, the serial
    /// ports.
    pub(super) fn execute(
        &self,
        named: impl Iterator<Item = String>,
        timeout: Duration,
    ) -> Result<(), Failure> {
        let mut places: Vec<Place> = named.chain(self.places.iter().cloned()).map(Place::from).collect();
        if !self.only {
            places.extend(ports::all()?.into_iter().map(|port| port.path.into()));
        }
        let served = served_hubs::all().unwrap_or_else(|error| {
            print_error_line(&format!("note: served hubs of this machine cannot be listed: {error}"));
            Vec::new()
        });
        for ServedHub { place: name, has_host } in served {
            match places.iter_mut().find(|place| is_same(&place.name, &name)) {
                Some(place) => place.served = Some(has_host),
                None => places.push(Place { name, served: Some(has_host) }),
            }
        }
        // All places are asked at the same time, so that the scan takes no longer than the slowest place.
        let answers: Vec<Answer> = thread::scope(|scope| {
            let threads: Vec<_> =
                places.iter().map(|place| scope.spawn(move || ask(place, timeout))).collect();
            threads
                .into_iter()
                .map(|thread| thread.join().unwrap_or(Answer::Nothing(OpenError::Hub(Error::NoHub))))
                .collect()
        });
        let hubs: usize = answers
            .iter()
            .map(|answer| match answer {
                Answer::Hubs(hubs) => hubs.len(),
                Answer::InUse => 1,
                Answer::Nothing(_) => 0,
            })
            .sum();
        let scanned: Vec<_> = places.iter().map(|place| &*place.name).zip(answers).collect();
        if self.json {
            let places: Vec<Value> =
                scanned.into_iter().map(|(name, answer)| document(name, answer)).collect();
            print_json(&json!({ "places": places }))?;
        } else if !scanned.is_empty() {
            print(&text(scanned))?;
        }
        match (hubs, places.len()) {
            (0, 0) if self.only => {
                Err(Failure::Work("no hub is served on this machine; give a PLACE".to_owned()))
            }
            (0, 0) => Err(Failure::Work(
                "this machine has no serial port, and no hub is served on it; give a PLACE".to_owned(),
            )),
            (0, 1) => Err(Failure::Work("no hub found at 1 place".to_owned())),
            (0, place_count) => Err(Failure::Work(format!("no hub found at {place_count} places"))),
            _ => Ok(()),
        }
    }
}

/// Returns a table of the places and their hubs.
fn text(scanned: Vec<(&str, Answer)>) -> String {
    let mut table = table::new(&["place", "address", "hub", "has"], 4);
    for (name, answer) in scanned {
        let reason = answer.reason(name);
        if let Some(reason) = reason {
            table.add_row([name, "", &reason, ""]);
        }
        for Found { address, kind, version, equipment } in answer.hubs() {
            // A child is connected to its parent, whose row is above.
            let branch = if kind == "parent" { "" } else { "└ " };
            let version = if version.is_empty() { version } else { format!(", {version}") };
            let hub = format!("{branch}{kind}{version}");
            let has = equipment.map(equipment_text).unwrap_or_default();
            table.add_row([name, &address.to_string(), &hub, &has]);
        }
    }
    format!("{table}\n")
}

/// Returns a JSON document of a place and its hubs.
fn document(name: &str, answer: Answer) -> Value {
    let (in_use, reason) = (matches!(answer, Answer::InUse), answer.reason(name));
    let hubs = answer.hubs().into_iter().map(|Found { address, kind, version, equipment }| {
        let has = equipment.map(equipment_json);
        json!({ "address": address, "kind": kind, "version": version, "has": has })
    });
    json!({ "place": name, "hubs": hubs.collect::<Vec<_>>(), "in_use": in_use, "reason": reason })
}

/// Returns true for two names of one place. A place accepts one host at a time, so it must not be scanned twice.
fn is_same(one: &str, other: &str) -> bool {
    let (of_one, of_other) = (resolved_place(one), resolved_place(other));
    one == other || of_one.is_some() && of_one == of_other
}

/// Returns the network address or the path to which a name resolves; `None` if the name does not resolve.
fn resolved_place(name: &str) -> Option<PathBuf> {
    if is_tcp(name) {
        return name.to_socket_addrs().ok()?.next().map(|address| address.to_string().into());
    }
    std::fs::canonicalize(name).ok()
}

/// Result of the scan of one place.
enum Answer {
    Hubs(Vec<Found>),
    /// Another host uses the hub.
    InUse,
    /// No hub answers.
    Nothing(OpenError),
}

impl Answer {
    fn hubs(self) -> Vec<Found> {
        if let Self::Hubs(hubs) = self { hubs } else { Vec::new() }
    }

    /// Returns a short text that says why the place has no hub in the table; `None` for a place with hubs. Prints
    /// advice on standard error.
    fn reason(&self, place: &str) -> Option<String> {
        Some(match self {
            Self::Hubs(_) => return None,
            Self::InUse => "in use by another host".to_owned(),
            Self::Nothing(OpenError::Hub(Error::NoHub)) => "no answer".to_owned(),
            Self::Nothing(OpenError::Hub(error)) if error.is_hung_up() => {
                "closes the connection: check that no other host uses it".to_owned()
            }
            Self::Nothing(error) => {
                if matches!(error, OpenError::Denied) {
                    print_error_line(&format!("note: {}", ports::unopened(place, error)));
                }
                error.to_string()
            }
        })
    }
}

fn ask(place: &Place, timeout: Duration) -> Answer {
    if place.served == Some(true) {
        return Answer::InUse;
    }
    match hubs_at(&place.name, timeout) {
        Ok(hubs) => Answer::Hubs(hubs),
        // A served hub closes the connection only if it has another host.
        Err(OpenError::InUse) if place.served.is_some() => Answer::InUse,
        Err(OpenError::Hub(error)) if place.served.is_some() && error.is_hung_up() => Answer::InUse,
        Err(error) => Answer::Nothing(error),
    }
}

fn hubs_at(place: &str, timeout: Duration) -> Result<Vec<Found>, OpenError> {
    let line = Line::open(place, timeout)?;
    let mut session = Session::new(line, Address::DEFAULT, timeout);
    let mut found = Vec::new();
    for hub in session.discover()? {
        let Some(address) = Address::new(hub.address) else { continue };
        let (mut version, mut equipment) = (String::new(), None);
        if !hub.duplicate {
            session.select_hub(address);
            disable_left_enabled(&mut session)?;
            (version, equipment) = (session.version()?, session.equipment()?);
        }
        found.push(Found { address: hub.address, kind: kind(&hub), version, equipment });
    }
    Ok(found)
}
