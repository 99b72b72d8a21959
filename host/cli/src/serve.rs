//! `motor-hub serve`: the simulated board, or the flashed image on the emulated chip.

#[cfg(unix)]
mod link;
mod notices;

use crate::client::interrupt::SIGNALS;
#[cfg(unix)]
use crate::output::say;
use crate::output::{Failure, print};
use crate::parse::{address, host_and_port, seconds, wire};
#[cfg(unix)]
use crate::served::Note;
use indicatif::ProgressBar;
use motor_hub::protocol::Address;
use motor_hub::protocol::pins::Pin;
use notices::Notices;
use signal_hook::flag::register;
use simulated::scenario::{Scenario, ScenarioError};
use simulated::serve::{self, Line, LineError, Memory, Moment};
#[cfg(unix)]
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Text of the long help.
pub(crate) const HELP: &str = "\
A simulated hub in real time behind the REV Hub Serial Protocol, for host software to talk to

The first line on standard output is what hosts open: the path of a serial port, or an address and port. \
The motors, their loads and the battery are those of a scenario; its set-points are left to the host, and there need \
not be any. Nothing pulls on the default scenario's motors, all of them are under Scheme A, and dry friction of 6 % of \
the stall torque stops them; the torques of a scenario that is named act from the start. \
`motor-hub client scan` finds it, by a note in a folder of the user (motor-hub in XDG_RUNTIME_DIR, else in the folder \
for temporary files) that is removed in the end. One host at a time: a second one on a TCP port is hung up on, and standard error says so. It also says so whenever this \
machine is too slow for real time. It runs until it is stopped (Ctrl-C).";

/// A hub is up after so many seconds, whatever its battery does.
const AWAKE_S: f64 = 0.5;

/// Where, and which hub.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    serving: Serving,
    /// Address of the hub, 1 to 254
    #[arg(long, value_name = "N", default_value = "2", value_parser = address)]
    address: Address,
    /// File that the hub stores its settings in, so that they outlast the program; made if there is none
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// The flashed image on an emulated chip instead of the simulated board. It is built first if it is not
    /// fresh. Its address is 2
    #[arg(long, conflicts_with_all = ["address", "store"])]
    emulated: bool,
    /// Whose image: nucleo-f429zi or nucleo-h743zi2
    #[arg(long, value_name = "BOARD", default_value = "nucleo-f429zi", requires = "emulated")]
    #[cfg_attr(
        not(feature = "emulated"),
        expect(dead_code, reason = "read only where there is an emulator")
    )]
    board: String,
    /// The board's bootloader comes first, so that new firmware can be sent to it; nucleo-h743zi2 has one
    #[arg(long, requires = "emulated")]
    #[cfg_attr(
        not(feature = "emulated"),
        expect(dead_code, reason = "read only where there is an emulator")
    )]
    bootloader: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        if self.emulated {
            return self.serve_an_image();
        }
        let memory = self.store.as_deref().map(Memory::open).transpose().map_err(Failure::input)?;
        self.serving.execute(Scenario::to_serve, |scenario, line, show| {
            serve::run(scenario, self.address, line, memory, &mut |_| (), show)
        })
    }

    #[cfg(not(feature = "emulated"))]
    fn serve_an_image(self) -> Result<(), Failure> {
        Err(crate::emulate::no_emulator("serve --emulated"))
    }

    #[cfg(feature = "emulated")]
    fn serve_an_image(self) -> Result<(), Failure> {
        use emulated::{Board, elf};

        let board: Board = self.board.parse().map_err(Failure::input)?;
        elf::check_named().map_err(Failure::input)?;
        if self.bootloader && board.bootloader().is_none() {
            return Err(Failure::Input(format!("{board} has no bootloader; nucleo-h743zi2 has")));
        }
        if let Some(pins) = self.serving.wire
            && pins.iter().any(|pin| pin.get() > 1)
        {
            return Err(Failure::Input("--wire: an image has digital pins 0 and 1".to_owned()));
        }
        self.serving.execute(emulated::serve::scenario, |scenario, line, show| {
            emulated::serve::run(scenario, board, self.bootloader, line, show)
        })
    }
}

/// How a hub is served, whatever runs it.
#[derive(clap::Args)]
struct Serving {
    #[command(flatten)]
    place: Place,
    /// A symbolic link to the serial port, so that it has the same name every time; removed in the end
    #[cfg(unix)]
    #[arg(long, value_name = "PATH", conflicts_with = "tcp")]
    link: Option<PathBuf>,
    /// Scenario file (TOML) instead of the default scenario
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// A wire between two of the hub's digital pins, such as 4,5, for host software that tries them out; an image has 0
    /// and 1
    #[arg(long, value_name = "PIN,PIN", value_parser = wire)]
    wire: Option<[Pin; 2]>,
    /// Ends after so many seconds
    #[arg(long = "for-s", alias = "for", value_name = "S", value_parser = seconds)]
    limit_s: Option<f64>,
}

#[derive(clap::Args)]
#[group(required = true, multiple = false)]
struct Place {
    /// On a pseudo-terminal, which hosts open as a serial port
    #[arg(long)]
    pty: bool,
    /// On a TCP port; port 0 is any that is free
    #[arg(long, value_name = "HOST:PORT", value_parser = host_and_port)]
    tcp: Option<String>,
}

impl Serving {
    /// Says where the hub is as soon as it is awake, and serves it.
    fn execute<E: std::error::Error>(
        self,
        default: impl FnOnce() -> Result<Scenario, ScenarioError>,
        run: impl FnOnce(&Scenario, Line, &mut dyn FnMut(Moment<'_>) -> bool) -> Result<(), E>,
    ) -> Result<(), Failure> {
        let scenario = match &self.scenario {
            Some(file) => Scenario::load_for_a_host(file),
            None => default(),
        };
        let scenario = Scenario { wire: self.wire, ..scenario.map_err(Failure::input)? };
        let line = match &self.place.tcp {
            Some(address) => Line::tcp(address).map_err(Failure::input)?,
            None => Line::pty().map_err(no_pty)?,
        };
        let mut place = Some(format!("{line}\n"));
        #[cfg(unix)]
        let _link = match &self.link {
            Some(path) => {
                place = Some(format!("{}\n", path.display()));
                Some(link::Link::new(path, &line.to_string())?)
            }
            None => None,
        };
        #[cfg(unix)]
        let (named, mut note) = (self.named(&line)?, None::<Option<Note>>);
        let stopped = stop_flag()?;
        let mut notices = Notices::new();
        let mut said_so = Ok(());
        let bar = ProgressBar::new_spinner();
        let mut shown_s = 0.0;
        let served =
            run(&scenario, line, &mut |Moment { at_s, awake, taken, lost, turned_away, describe }| {
                // Not before a motor can be enabled, unless the battery is at fault.
                if awake || at_s > AWAKE_S {
                    said_so = place.take().map_or(Ok(()), |place| print(&place));
                    #[cfg(unix)]
                    if let Some(note) = note.get_or_insert_with(|| bar.suspend(|| leave_note(&named))) {
                        note.tell(taken);
                    }
                }
                if at_s > shown_s && !bar.is_hidden() {
                    shown_s = at_s + 0.2;
                    bar.set_message(format!("{at_s:.0} s, {}", describe()));
                }
                for notice in notices.due(at_s, lost, turned_away) {
                    bar.suspend(|| eprintln!("{notice}"));
                }
                let goes_on = self.limit_s.is_none_or(|limit_s| at_s < limit_s);
                said_so.is_ok() && goes_on && !stopped.load(Ordering::Relaxed)
            });
        bar.finish_and_clear();
        served.map_err(Failure::work)?;
        for notice in notices.rest() {
            eprintln!("{notice}");
        }
        said_so
    }
}

impl Serving {
    /// What hosts on this machine open, wherever they are.
    #[cfg(unix)]
    fn named(&self, line: &Line) -> Result<String, Failure> {
        if let Some(link) = &self.link {
            let path = std::path::absolute(link).map_err(Failure::input)?;
            return Ok(path.display().to_string());
        }
        let place = line.to_string();
        Ok(place.parse().map_or(place, |address: SocketAddr| here(address).to_string()))
    }
}

/// The same address, but for one that stands for all of this machine's.
#[cfg(unix)]
fn here(address: SocketAddr) -> SocketAddr {
    let ip = match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, address.port())
}

/// For `client scan`; a hub without one is served all the same.
#[cfg(unix)]
fn leave_note(place: &str) -> Option<Note> {
    let left = Note::leave(place);
    left.map_err(|error| say(&format!("note: `client scan` will not find this hub unnamed: {error}"))).ok()
}

/// Set when the program is asked to end, which it then does in good order.
pub(crate) fn stop_flag() -> Result<Arc<AtomicBool>, Failure> {
    let stopped = Arc::new(AtomicBool::new(false));
    for (signal, _) in SIGNALS {
        register(*signal, Arc::clone(&stopped))
            .map_err(|error| Failure::Work(format!("Ctrl-C cannot be listened for: {error}")))?;
    }
    Ok(stopped)
}

fn no_pty(error: LineError) -> Failure {
    match error {
        LineError::NoPtys => Failure::Work(format!("{error}; serve with --tcp instead")),
        error => Failure::work(error),
    }
}
