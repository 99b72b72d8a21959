//! `motor-hub serve`: serves the simulated board, or a board's image on an emulated chip.

#[cfg(unix)]
mod link;
mod notices;

use crate::client::interrupt::{SIGNALS, is_ignored};
use crate::output::{Failure, print, print_error_line};
use crate::parse::{address, host_and_port, seconds, whole, wire};
#[cfg(unix)]
use crate::served_hubs::{self, ServedHubFile};
use clap::ArgGroup;
use indicatif::ProgressBar;
use motor_hub::protocol::Address;
use motor_hub::protocol::pins::Pin;
use notices::Notices;
use signal_hook::flag::register;
use simulated::scenario::Scenario;
use simulated::serve::{self, Hubs, Line, LineError, Memory, Moment};
#[cfg(unix)]
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Time in seconds after which the hub counts as started, even if its battery does not permit enabled motors.
const AWAKE_S: f64 = 0.5;

/// Serve a simulated hub in real time, for host software that speaks the REV Hub Serial Protocol
///
/// The first line on standard output is the place for hosts to open: the path of a serial port, or an address and
/// port. The hub runs until it is stopped by Ctrl-C.
///
/// Motors, loads and battery are those of a scenario. Its set-points are ignored, and may be missing: the host gives
/// set-points. The torques of a scenario act from the start. Without a scenario the motors are a NeveRest 20, 60, 40
/// and again 20, with the inertias of the default scenario and without torques; dry friction is 6 % of the stall
/// torque. All motors use Scheme A.
///
/// The hub accepts one host at a time. The hub closes a second TCP connection, and reports this on standard error. If
/// the first host has been silent for 5 s, the hub serves the second host instead. Standard error also reports when
/// this machine is too slow for real time.
///
/// `motor-hub client scan` finds the hub by a note in a folder of this user: motor-hub in XDG_RUNTIME_DIR, else in
/// the folder for temporary files. The note is removed at the end.
#[derive(clap::Args)]
#[command(group(ArgGroup::new("place").required(true)))]
#[cfg_attr(not(feature = "emulated"), expect(dead_code, reason = "read only where there is an emulator"))]
pub(crate) struct Options {
    /// Serves on a pseudo-terminal, which hosts open as a serial port
    #[arg(long, group = "place")]
    pty: bool,
    /// Serves on a TCP port; port 0 chooses a free port
    #[arg(long, group = "place", value_name = "HOST:PORT", value_parser = host_and_port)]
    tcp: Option<String>,
    /// Symbolic link to the serial port, for a name that stays the same; removed at the end
    #[cfg(unix)]
    #[arg(long, value_name = "PATH", conflicts_with = "tcp")]
    link: Option<PathBuf>,
    /// Scenario file (TOML) instead of the default scenario
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Connects two of the hub's digital pins, such as 4,5, for tests of host software; with --emulated 0,1 only
    #[arg(long, value_name = "PIN,PIN", value_parser = wire)]
    wire: Option<[Pin; 2]>,
    /// Duration in seconds [default: until Ctrl-C]
    #[arg(long = "for-s", alias = "for", value_name = "S", value_parser = seconds)]
    limit_s: Option<f64>,
    /// Address of the hub, 1 to 254
    #[arg(long, value_name = "N", default_value = "2", value_parser = address)]
    address: Address,
    /// Number of hubs in a chain, 1 to 4: the host's hub has the address of --address, and each hub behind it the next one
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole("a number of hubs", 1..=4_u8, ""))]
    hubs: u8,
    /// File for the first hub's stored settings, which outlast the program; created if it does not exist
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// Serves a board's image on an emulated chip instead of the simulated board; in the sources of this program the image
    /// is built first if it is out of date; the hub's address is 2
    #[arg(long, conflicts_with_all = ["address", "hubs", "store"])]
    emulated: bool,
    /// Board of the image: nucleo-f429zi or nucleo-h743zi2
    #[arg(long, value_name = "BOARD", default_value = "nucleo-f429zi", requires = "emulated")]
    board: String,
    /// ELF file of the image, instead of building one
    #[arg(long, value_name = "FILE", requires = "emulated", conflicts_with = "bootloader")]
    image: Option<PathBuf>,
    /// Starts the board's bootloader first, so that `client update` works; nucleo-h743zi2 only
    #[arg(long, requires = "emulated")]
    bootloader: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        if self.emulated {
            return self.serve_an_image();
        }
        let hubs = self.hubs()?;
        let memory = self.store.as_deref().map(Memory::open).transpose().map_err(Failure::input)?;
        self.serve(Scenario::to_serve, |scenario, line, show| {
            serve::run(scenario, &hubs, line, memory, &mut |_| (), show)
        })
    }

    fn hubs(&self) -> Result<Hubs, Failure> {
        let addresses = (0..self.hubs).map(|hub| self.address.get().checked_add(hub).and_then(Address::new));
        addresses.collect::<Option<_>>().map(Hubs::chain).ok_or_else(|| {
            let (hubs, address) = (self.hubs, self.address.get());
            Failure::Input(format!(
                "--hubs: {hubs} hubs from address {address} on go beyond 254; give a smaller --address"
            ))
        })
    }

    #[cfg(not(feature = "emulated"))]
    fn serve_an_image(&self) -> Result<(), Failure> {
        Err(crate::emulate::no_emulator("serve --emulated --pty"))
    }

    #[cfg(feature = "emulated")]
    fn serve_an_image(&self) -> Result<(), Failure> {
        use emulated::{Board, elf};

        let board: Board = self.board.parse().map_err(Failure::input)?;
        elf::choose(self.image.as_deref()).map_err(Failure::input)?;
        if self.bootloader && board.bootloader().is_none() {
            return Err(Failure::Input(format!(
                "--bootloader: {board} has no bootloader; give --board nucleo-h743zi2"
            )));
        }
        if let Some(pins) = self.wire
            && pins.iter().any(|pin| pin.get() > 1)
        {
            return Err(Failure::Input(
                "--wire: an emulated board has digital pins 0 and 1 only; give --wire 0,1".to_owned(),
            ));
        }
        self.serve(emulated::serve::scenario, |scenario, line, show| {
            emulated::serve::run(scenario, board, self.bootloader, line, show)
        })
    }

    /// Serves the hub, and prints the place of the hub once the hub has started.
    fn serve<E: std::error::Error>(
        &self,
        default: fn() -> Scenario,
        run: impl FnOnce(&Scenario, Box<dyn Line>, &mut dyn FnMut(Moment<'_>) -> bool) -> Result<(), E>,
    ) -> Result<(), Failure> {
        let scenario = match &self.scenario {
            Some(file) => Scenario::load_for_a_host(file).map_err(Failure::input)?,
            None => default(),
        };
        let scenario = Scenario { wire: self.wire, ..scenario };
        let line = match &self.tcp {
            Some(address) => serve::tcp(address).map_err(Failure::input)?,
            None => serve::pty().map_err(no_pty)?,
        };
        let mut place = Some(format!("{line}\n"));
        #[cfg(unix)]
        let (port, mut _link) = (line.to_string(), None);
        #[cfg(unix)]
        if let Some(path) = &self.link {
            link::make_room(path, &port)?;
            place = Some(format!("{}\n", path.display()));
        }
        #[cfg(unix)]
        let (absolute_place, mut note) = (self.absolute_place(&*line)?, None::<Option<ServedHubFile>>);
        let stopped = stop_flag()?;
        let (mut notices, mut totals) = (Notices::default(), [0.0; 2]);
        let mut printed = Ok(());
        let bar = ProgressBar::new_spinner();
        let mut shown_s = 0.0;
        let served =
            run(&scenario, line, &mut |Moment { at_s, awake, taken, lost, rejected_hosts, describe }| {
                // The link is created and the place is printed once motors can be enabled, or after AWAKE_S if the battery
                // prevents that. A host that opens the port earlier gets no answer.
                if awake || at_s > AWAKE_S {
                    let place = place.take();
                    #[cfg(unix)]
                    {
                        if place.is_some() {
                            let link =
                                self.link.as_ref().map(|path| link::Link::new(path, &port)).transpose();
                            printed = link.map(|link| _link = link);
                        }
                        let leave = || bar.suspend(|| leave_note(&absolute_place));
                        if let Some(note) = note.get_or_insert_with(leave) {
                            note.set_has_host(taken);
                        }
                    }
                    if let Some(place) = place.filter(|_| printed.is_ok()) {
                        printed = print(&place);
                    }
                }
                if at_s > shown_s && !bar.is_hidden() {
                    shown_s = at_s + 0.2;
                    bar.set_message(format!("{at_s:.0} s, {}", describe()));
                }
                totals = [lost.as_secs_f64(), rejected_hosts.into()];
                for notice in notices.due(at_s, totals) {
                    bar.suspend(|| print_error_line(&notice));
                }
                let goes_on = self.limit_s.is_none_or(|limit_s| at_s < limit_s);
                printed.is_ok() && goes_on && !stopped.load(Ordering::Relaxed)
            });
        bar.finish_and_clear();
        served.map_err(Failure::work)?;
        for notice in notices.due(f64::INFINITY, totals) {
            print_error_line(&notice);
        }
        printed
    }

    /// Returns the place by which hosts on this machine open the hub from any working directory.
    #[cfg(unix)]
    fn absolute_place(&self, line: &dyn Line) -> Result<String, Failure> {
        if let Some(link) = &self.link {
            let path = std::path::absolute(link).map_err(Failure::input)?;
            return Ok(path.display().to_string());
        }
        let place = line.to_string();
        Ok(place.parse().map_or(place, |address: SocketAddr| loopback_if_unspecified(address).to_string()))
    }
}

/// Returns the address, or the loopback address if the address stands for all interfaces of this machine (0.0.0.0 or
/// ::).
#[cfg(unix)]
fn loopback_if_unspecified(mut address: SocketAddr) -> SocketAddr {
    if address.ip().is_unspecified() {
        let is_v4 = address.is_ipv4();
        address.set_ip(if is_v4 { Ipv4Addr::LOCALHOST.into() } else { Ipv6Addr::LOCALHOST.into() });
    }
    address
}

/// Writes a note for `client scan`. If this fails, the hub is served without a note.
#[cfg(unix)]
fn leave_note(place: &str) -> Option<ServedHubFile> {
    let left = ServedHubFile::create(&served_hubs::folder(), place);
    left.map_err(|error| {
        print_error_line(&format!(
            "note: `client scan` will not find this hub unless its place is given: {error}"
        ))
    })
    .ok()
}

/// Returns a flag that each of the [`SIGNALS`] sets. The reader of the flag then ends the program in good order.
pub(crate) fn stop_flag() -> Result<Arc<AtomicBool>, Failure> {
    let stopped = Arc::new(AtomicBool::new(false));
    for (signal, _) in SIGNALS.iter().filter(|(signal, _)| !is_ignored(*signal)) {
        register(*signal, Arc::clone(&stopped))
            .map_err(|error| Failure::Work(format!("no handler for Ctrl-C could be installed: {error}")))?;
    }
    Ok(stopped)
}

fn no_pty(error: LineError) -> Failure {
    match error {
        LineError::NoPtys => Failure::Work(format!("{error}; serve with --tcp instead")),
        error => Failure::work(error),
    }
}
