//! `motor-hub dashboard`: shows a hub in a browser.

use crate::client::ports::unopened;
use crate::output::{Failure, print, print_error_line};
use crate::parse::{address, host_and_port, whole};
use crate::serve::stop_flag;
use dashboard::scenario_player::Script;
use dashboard::world::World;
use dashboard::{Place, PublicUrl, Server};
use motor_hub::protocol::Address;
use qrcodegen::{QrCode, QrCodeEcc};
use simulated::scenario::Scenario;
use simulated::serve::{self, Hubs, Memory};
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Name that the page shows for the default scenario. The scenario's set-points are not used, because users command the
/// motors in the page.
const DEFAULT_NAME: &str = "four motors on a battery";

/// Show a hub in a browser: four motors live, to be moved, tuned and stopped
///
/// The first line on standard output is the URL to open. The URL contains a token: anyone who has the URL can move
/// the motors. Without --port or --tcp the hub is simulated, and its loads, battery and encoders can be changed in
/// the page.
///
/// One page is in control, any number of pages watch, and any page can stop. All motors are disabled when the page in
/// control is closed, is hidden for 10 s, or shows no new values for 1 s. They are also disabled when this program
/// ends.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Serial port of the hub [default without --tcp: a simulated hub]
    #[arg(long, value_name = "PATH", conflicts_with_all = ["tcp", "scenario"])]
    port: Option<String>,
    /// TCP address of the hub
    #[arg(long, value_name = "HOST:PORT", value_parser = host_and_port, conflicts_with = "scenario")]
    tcp: Option<String>,
    /// Address of the hub on its line, such as a child hub's [default: the address of the parent]
    #[arg(long, value_name = "N", value_parser = address)]
    address: Option<Address>,
    /// Scenario file (TOML) with motors, loads and battery of the simulated hub; the page can play its set-points
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Number of simulated hubs in a chain, 1 to 4, with the addresses from 2; the page shows one in full, and what the others do
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with_all = ["port", "tcp"])]
    #[arg(value_parser = whole("a number of hubs", 1..=4_u8, ""))]
    hubs: u8,
    /// File for the simulated hub's stored settings, which outlast the program; created if it does not exist
    #[arg(long, value_name = "FILE", conflicts_with_all = ["port", "tcp"])]
    store: Option<PathBuf>,
    /// Address of the page on this machine; port 0 chooses a free port
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:0", value_parser = host_and_port)]
    http: String,
    /// Address of the page for other machines too, such as a phone, for which the URL is printed as a QR code; anyone on the network who has the URL has access
    #[arg(long, value_name = "ADDR:PORT", conflicts_with = "http", value_parser = host_and_port)]
    listen: Option<String>,
    /// URL by which browsers reach the page, if that is not its address: behind a tunnel (ssh -L), a host name or a proxy
    #[arg(long, value_name = "URL")]
    public_url: Option<PublicUrl>,
    /// Opens the page in this machine's browser
    #[arg(long)]
    open: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let stop = stop_flag()?;
        let server = Server::bind(self.listen.as_ref().unwrap_or(&self.http)).map_err(Failure::input)?;
        if self.listen.is_none() && !server.address().ip().is_loopback() {
            let why = format!(
                "--http {}: other machines could reach this address; to allow that, give --listen {}",
                self.http, self.http
            );
            return Err(Failure::Input(why));
        }
        let server = match self.public_url {
            Some(public) => server.reached_as(public),
            None => server,
        };
        let (place, simulation) = match self.port.as_ref().or(self.tcp.as_ref()) {
            Some(place) => (real(place), None),
            None => {
                let memory = self.store.as_deref().map(Memory::open).transpose().map_err(Failure::input)?;
                let (place, simulation) = simulate(self.scenario.as_deref(), self.hubs, memory, &stop)?;
                (place, Some(simulation))
            }
        };
        let url = server.url();
        print(&format!("{url}\n"))?;
        if self.listen.is_some() {
            print(&code(&url))?;
            print_error_line("warning: anyone on the network who has this URL can move the motors");
        }
        // The destructor removes the file when the program ends.
        let _handover = self.open.then(|| open(&url));
        server.run(Place { address: self.address, ..place }, &stop);
        // The simulated hub ends with the server. If the hub has ended earlier by an error, the error is reported here.
        stop.store(true, Ordering::Relaxed);
        match simulation.map(JoinHandle::join) {
            Some(Ok(Err(error))) => Err(Failure::work(error)),
            Some(Err(_)) => Err(Failure::Work("the simulated hub has panicked".to_owned())),
            _ => Ok(()),
        }
    }
}

/// Returns a URL as a QR code for terminals with a dark background. One line of text shows two rows of the code.
fn code(url: &str) -> String {
    // Width of the light margin around a QR code in modules (ISO/IEC 18004).
    const MARGIN: i32 = 4;
    let Ok(code) = QrCode::encode_text(url, QrCodeEcc::Low) else { return String::new() };
    let all = -MARGIN..code.size() + MARGIN;
    let line = |y: i32| {
        let module = |x| match (code.get_module(x, y), code.get_module(x, y + 1)) {
            (false, false) => '█',
            (false, true) => '▀',
            (true, false) => '▄',
            (true, true) => ' ',
        };
        all.clone().map(module).chain(['\n']).collect::<String>()
    };
    all.clone().step_by(2).map(line).collect()
}

fn real(name: &str) -> Place {
    let (place, mut printed) = (name.to_owned(), None);
    Place::new(name, move |address| match dashboard::hub::open(&place, address) {
        Ok(session) => {
            printed = None;
            Ok(session)
        }
        Err(error) => {
            let why = error.to_string();
            // The server opens the line repeatedly. An error that repeats is printed once.
            if printed.as_ref() != Some(&why) {
                print_error_line(&format!("{}\ntrying again every second", unopened(&place, &error)));
                printed = Some(why.clone());
            }
            Err(why)
        }
    })
}

type Simulation = JoinHandle<Result<(), simulated::sim::RunError>>;

/// Starts a thread that serves a simulated hub on a TCP port of this machine.
fn simulate(
    file: Option<&Path>,
    hubs: u8,
    memory: Option<Memory>,
    stop: &Arc<AtomicBool>,
) -> Result<(Place, Simulation), Failure> {
    let scenario = match file {
        Some(file) => Scenario::load_for_a_host(file).map_err(Failure::input)?,
        None => Scenario::to_serve(),
    };
    // The served default scenario has no set-points to play.
    let script = file.and_then(|_| Script::of(&scenario));
    let line = serve::tcp("127.0.0.1:0").map_err(Failure::work)?;
    let place = line.to_string();
    let world = World::default();
    let (changes, stop) = (world.clone(), Arc::clone(stop));
    let name = if file.is_some() { scenario.name.clone() } else { DEFAULT_NAME.to_owned() };
    let simulation = std::thread::spawn(move || {
        let addresses = (Address::DEFAULT.get()..).take(hubs.into()).filter_map(Address::new);
        serve::run(
            &scenario,
            &Hubs::chain(addresses.collect()),
            line,
            memory,
            &mut |now| *now = changes.interventions(),
            &mut |_| !stop.load(Ordering::Relaxed),
        )
    });
    let open = move |address| dashboard::hub::open(&place, address).map_err(|error| error.to_string());
    Ok((Place { world: Some(world), script, ..Place::new(&name, open) }, simulation))
}

/// An HTML file that redirects a browser to the page. Only this user can read the file. The URL has a token and must
/// not be an argument of a program, because every user of the machine can read arguments.
struct Handover(PathBuf);

impl Handover {
    fn write(url: &str) -> std::io::Result<Self> {
        let folder = std::env::var_os("XDG_RUNTIME_DIR").map_or_else(std::env::temp_dir, PathBuf::from);
        let path = folder.join(format!("motor-hub-dashboard-{}.html", std::process::id()));
        let mut options = OpenOptions::new();
        // If the file exists, opening fails, because another user may own the file.
        options.write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let mut file = options.open(&path)?;
        let handover = Self(path);
        writeln!(file, "<!doctype html><meta http-equiv=\"refresh\" content=\"0;url={url}\">")?;
        Ok(handover)
    }
}

impl Drop for Handover {
    fn drop(&mut self) {
        // A file that cannot be removed does no harm, because its page no longer exists.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// Opens the URL in the default browser. If no browser starts, a message asks the user to open the printed URL.
fn open(url: &str) -> Option<Handover> {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        "xdg-open"
    };
    let started = Handover::write(url).and_then(|handover| {
        Command::new(program).arg(&handover.0).stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
        Ok(handover)
    });
    if started.is_err() {
        print_error_line("no browser could be started: open the URL above");
    }
    started.ok()
}
