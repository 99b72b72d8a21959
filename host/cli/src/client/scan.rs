//! `motor-hub client scan`: finds hubs.

use super::devices::{equipment_json, equipment_text};
use super::motors_off::disable_left_enabled;
use super::ports;
use crate::output::{Failure, print, print_error_line, print_json};
#[cfg(unix)]
use crate::served_hubs::{self, ServedHub};
use clap::builder::NonEmptyStringValueParser;
use motor_hub::board::Equipment;
use motor_hub::protocol::Address;
use motor_hub_client::line::{Line, is_tcp};
use motor_hub_client::{Error, OpenError, Session};
use serde::Serialize;
use serde_json::json;
use std::net::ToSocketAddrs;
use std::panic::resume_unwind;
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

/// A hub that was found at a place. The JSON document has these fields.
#[derive(Serialize)]
struct Found {
    address: u8,
    kind: &'static str,
    /// Version text of the hub; empty for several hubs with one address, and if a request to the hub failed.
    version: String,
    /// Devices of the hub other than motors; `None` if the hub does not report them.
    #[serde(serialize_with = "equipment_json")]
    has: Option<Equipment>,
    /// Why a request to the hub failed; `None` if all requests succeeded.
    reason: Option<String>,
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
    /// Network addresses or path to which the name resolves; empty if the name does not resolve.
    resolved: Vec<PathBuf>,
    /// True if the place has a served hub with a host, false if the served hub has no host. `None` if no served hub is
    /// known at this place.
    served: Option<bool>,
}

impl Place {
    fn new(name: String, served: Option<bool>) -> Self {
        let resolved = if is_tcp(&name) {
            let addresses = name.to_socket_addrs().into_iter().flatten();
            addresses.map(|address| address.to_string().into()).collect()
        } else {
            std::fs::canonicalize(&name).into_iter().collect()
        };
        Self { name, resolved, served }
    }

    /// True for two names of one place. A place accepts one host at a time, so a place must not be scanned twice.
    fn is_same(&self, other: &Self) -> bool {
        self.name == other.name || self.resolved.iter().any(|place| other.resolved.contains(place))
    }
}

/// Result of the scan of one place. The JSON document has these fields.
#[derive(Serialize)]
struct Scanned {
    place: String,
    hubs: Vec<Found>,
    /// True if another host uses the hub.
    in_use: bool,
    /// Why the place has no hub in the table; `None` for a place with hubs.
    reason: Option<String>,
}

impl Options {
    /// Scans the places in `named`, the places of the options, and the served hubs of this user. Without `--only` also
    /// scans the serial ports.
    pub(super) fn execute(
        &self,
        named: impl Iterator<Item = String>,
        timeout: Duration,
    ) -> Result<(), Failure> {
        let ports = if self.only { Vec::new() } else { ports::all()? };
        let names = named.chain(self.places.iter().cloned()).chain(ports.into_iter().map(|port| port.path));
        let mut places: Vec<Place> = Vec::new();
        for name in names {
            let place = Place::new(name, None);
            if !places.iter().any(|other| other.is_same(&place)) {
                places.push(place);
            }
        }
        #[cfg(unix)]
        for ServedHub { place: name, has_host } in served_hubs() {
            let served = Place::new(name, Some(has_host));
            match places.iter_mut().find(|place| place.is_same(&served)) {
                Some(place) => place.served = served.served,
                None => places.push(served),
            }
        }
        // All places are scanned at the same time, so that the scan takes no longer than the slowest place.
        let scanned: Vec<Scanned> = thread::scope(|scope| {
            let threads: Vec<_> =
                places.iter().map(|place| scope.spawn(move || scan(place, timeout))).collect();
            threads
                .into_iter()
                .map(|thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic)))
                .collect()
        });
        let hubs: usize = scanned.iter().map(|place| place.hubs.len() + usize::from(place.in_use)).sum();
        if self.json {
            print_json(&json!({ "places": scanned }))?;
        } else if !scanned.is_empty() {
            print(&text(&scanned))?;
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

/// Returns the hubs that this user serves on this machine.
#[cfg(unix)]
fn served_hubs() -> Vec<ServedHub> {
    served_hubs::all(&served_hubs::folder()).unwrap_or_else(|error| {
        print_error_line(&format!("note: served hubs of this machine cannot be listed: {error}"));
        Vec::new()
    })
}

/// Returns a table of the places and their hubs.
fn text(scanned: &[Scanned]) -> String {
    let mut table = table::new(&["place", "address", "hub", "has"], 4);
    for Scanned { place, hubs, reason, .. } in scanned {
        if let Some(reason) = reason {
            table.add_row([place, "", reason, ""]);
        }
        for Found { address, kind, version, has, reason } in hubs {
            // A child is connected to its parent, whose row is above.
            let branch = if *kind == "parent" { "" } else { "└ " };
            let version = if version.is_empty() { String::new() } else { format!(", {version}") };
            let reason = reason.as_ref().map_or_else(String::new, |why| format!(": {why}"));
            let hub = format!("{branch}{kind}{version}{reason}");
            let has = has.map(equipment_text).unwrap_or_default();
            table.add_row([place, &*address.to_string(), &hub, &has]);
        }
    }
    format!("{table}\n")
}

/// Scans a place. A served hub that has a host receives nothing.
fn scan(Place { name, served, .. }: &Place, timeout: Duration) -> Scanned {
    let found = if *served == Some(true) { Err(OpenError::InUse) } else { hubs_at(name, timeout) };
    let in_use = match &found {
        // A served hub closes the connection only if it has another host.
        Err(OpenError::Hub(error)) => served.is_some() && error.is_hung_up(),
        Err(OpenError::InUse) => served.is_some(),
        _ => false,
    };
    let reason = found.as_ref().err().map(|error| match error {
        _ if in_use => "in use by another host".to_owned(),
        error => reason(name, error),
    });
    Scanned { place: name.clone(), hubs: found.unwrap_or_default(), in_use, reason }
}

/// Returns a short text that says why a place has no hub in the table. If the user has no permission to open the place,
/// also prints advice on standard error.
fn reason(place: &str, error: &OpenError) -> String {
    match error {
        OpenError::Hub(Error::NoHub) => "no answer".to_owned(),
        OpenError::Hub(error) if error.is_hung_up() => {
            "the hub closes the connection: check that no other host uses the hub".to_owned()
        }
        error => {
            if matches!(error, OpenError::Denied) {
                print_error_line(&format!("note: {}", ports::unopened(place, error)));
            }
            error.to_string()
        }
    }
}

fn hubs_at(place: &str, timeout: Duration) -> Result<Vec<Found>, OpenError> {
    let line = Line::open(place, timeout)?;
    let mut session = Session::new(line, Address::DEFAULT, timeout);
    let mut found = Vec::new();
    for hub in session.discover()? {
        let Some(address) = Address::new(hub.address) else { continue };
        let mut new =
            Found { address: hub.address, kind: kind(&hub), version: String::new(), has: None, reason: None };
        if !hub.duplicate {
            session.select_hub(address);
            match stop_and_identify(&mut session) {
                Ok(answers) => (new.version, new.has) = answers,
                // No further hub of this line can answer.
                Err(error) if error.is_hung_up() => return Err(error.into()),
                Err(error) => new.reason = Some(error.to_string()),
            }
        }
        found.push(new);
    }
    Ok(found)
}

/// Disables the enabled motors of a hub, and returns the version and the devices of the hub.
fn stop_and_identify(session: &mut Session) -> Result<(String, Option<Equipment>), Error> {
    disable_left_enabled(session)?;
    Ok((session.version()?, session.equipment()?))
}
