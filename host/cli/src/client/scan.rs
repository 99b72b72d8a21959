//! `motor-hub client scan`: where hubs are.

use super::driven::stop_abandoned;
use super::ports;
use crate::output::{Failure, print, say};
use motor_hub::protocol::Address;
use motor_hub_client::line::{self, Line};
use motor_hub_client::{Error, OpenError, Session};
use std::thread;
use std::time::Duration;
use studies::table;

/// Text of the long help.
pub(super) const HELP: &str = "\
Looks for hubs on all serial ports of this machine, and at places that are named: paths, such as a link that a
served hub keeps, or HOST:PORT

Every port is opened and asked by a discovery, 11 bytes at 460800 baud: name --only where something else that is
connected might not like that. Motors of a hub that are found enabled are disabled.

Exit codes: 0 a hub was found; 1 none was.";

/// Where to look.
#[derive(clap::Args)]
pub(super) struct Options {
    /// Serial ports that the system does not list, links to ports, or HOST:PORT
    #[arg(value_name = "PLACE")]
    places: Vec<String>,
    /// Not on the serial ports that the system lists
    #[arg(long, requires = "places")]
    only: bool,
}

impl Options {
    /// Looks at these places too.
    pub(super) fn execute(
        &self,
        named: impl Iterator<Item = String>,
        timeout: Duration,
    ) -> Result<(), Failure> {
        let mut places: Vec<String> = named.chain(self.places.iter().cloned()).collect();
        if !self.only {
            let ports = line::ports();
            let ports = ports.map_err(|e| Failure::Work(format!("the serial ports of this machine: {e}")))?;
            places.extend(ports.into_iter().map(|port| port.path));
        }
        // Together they take no longer than the slowest.
        let asked: Vec<_> = thread::scope(|scope| {
            let threads: Vec<_> =
                places.iter().map(|place| scope.spawn(move || ask(place, timeout))).collect();
            threads
                .into_iter()
                .map(|thread| thread.join().unwrap_or_else(|_| Err(Silence::NoAnswer)))
                .collect()
        });
        let mut table = table::new(&["place", "address", "hub"], 3);
        let mut hubs = 0;
        for (place, asked) in places.iter().zip(asked) {
            let rows = asked.unwrap_or_else(|silence| vec![[String::new(), silence.words(place)]]);
            for [address, words] in rows {
                hubs += usize::from(!address.is_empty());
                table.add_row([place, &address, &words]);
            }
        }
        if !places.is_empty() {
            print(&format!("{table}\n"))?;
        }
        match (hubs, places.len()) {
            (0, 0) => Err(Failure::Work("this machine has no serial port; name a PLACE".to_owned())),
            (0, 1) => Err(Failure::Work("no hub at 1 place".to_owned())),
            (0, looked) => Err(Failure::Work(format!("no hub at {looked} places"))),
            _ => Ok(()),
        }
    }
}

/// Why a place has no hub to show.
enum Silence {
    Unopened(OpenError),
    NoAnswer,
    Failed(Error),
}

impl From<Error> for Silence {
    fn from(error: Error) -> Self {
        match error {
            Error::NoHub | Error::HungUp => Self::NoAnswer,
            error => Self::Failed(error),
        }
    }
}

impl Silence {
    /// In a few words; what helps goes to standard error.
    fn words(self, place: &str) -> String {
        match self {
            Self::NoAnswer => "none answers".to_owned(),
            Self::Failed(error) => error.to_string(),
            Self::Unopened(error) => {
                if matches!(error, OpenError::Denied) {
                    say(&format!("note: {}", ports::unopened(place, &error)));
                }
                error.to_string()
            }
        }
    }
}

/// The hubs at a place: address, and which kind and version.
fn ask(place: &str, timeout: Duration) -> Result<Vec<[String; 2]>, Silence> {
    let line = Line::open(place, timeout).map_err(Silence::Unopened)?;
    let mut session = Session::new(line, Address::DEFAULT, timeout);
    let mut rows = Vec::new();
    for hub in session.discover()? {
        let Some(address) = Address::new(hub.address) else { continue };
        session.talk_to(address);
        stop_abandoned(&mut session)?;
        let kind = if hub.parent { "parent" } else { "child" };
        rows.push([hub.address.to_string(), format!("{kind}, {}", session.version()?)]);
    }
    Ok(rows)
}
