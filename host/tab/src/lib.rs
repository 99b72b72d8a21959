//! The dashboard in a browser tab, without a server. [`Relay`] and a simulated hub run beside the page, as WebAssembly. Instead
//! of the simulated hub a hub on a serial port can be used, by WebSerial. `cargo xtask try` puts all of it into one file.
//!
//! ```text
//! page --order--> relay --requests--> simulated hub, a millisecond a step
//!      <--tell---       --send------> serial port of the page (WebSerial)
//!                       <--receive---
//! ```
//!
//! The page calls [`tick`] before it paints, at most every 15 ms. A browser paints no hidden page, and runs no closed page.
//! Then the hub gets no requests, and its keep-alive disables the motors after 2.5 s.
//!
//! A read of the serial port waits for bytes. The page therefore wraps `receive` in `WebAssembly.Suspending`, and the
//! exported functions in `WebAssembly.promising`: the browser goes on while a call waits. The page starts no second call
//! until the first has returned.
#![allow(unsafe_code, reason = "exported names and imported functions; no operation here is unsafe")]

use dashboard::outbox::{Texts, outbox};
use dashboard::relay::{Event, Relay};
use dashboard::world::World;
use dashboard::{Opened, Place};
use motor_hub::protocol::Address;
use motor_hub_client::{Session, line};
use simulated::scenario::Scenario;
use simulated::serve::{self, Hubs, Wire};
use std::cell::RefCell;
use std::io::{ErrorKind, Read, Result, Write};
use std::pin::Pin;
use std::task::{Context, Waker};
use std::time::Duration;

/// Number of the only page.
const PAGE: u32 = 1;

/// Time-out of answers while a hub is connected.
const TIMEOUT: Duration = Duration::from_secs(1);

/// Largest difference between the simulated time and the time of the page, in milliseconds. If the page was delayed for
/// longer, the hub does not simulate the rest of the delay. If waits for answers have advanced the simulated time by
/// more, the hub stands still afterwards for this difference at most.
const LARGEST_LAG_MS: i64 = 100;

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// Time since the page was loaded, in milliseconds.
    safe fn now_ms() -> f64;
    /// Passes a message of the relay to the page.
    safe fn tell(text: *const u8, length: usize);
    /// Waits for bytes of the serial port, at most `wait_ms`. Returns their number, or -1 if the port is closed.
    safe fn receive(bytes: *mut u8, length: usize, wait_ms: u32) -> isize;
    /// Sends bytes to the serial port. Returns their number, or -1 if the port is closed.
    safe fn send(bytes: *const u8, length: usize) -> isize;
}

thread_local! {
    static INPUT: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    static SERVED: RefCell<Option<(Relay, Texts)>> = const { RefCell::new(None) };
    static SIMULATION: RefCell<Option<Simulation>> = const { RefCell::new(None) };
}

/// Starts with a simulated hub, or with the hub on the page's serial port.
#[unsafe(no_mangle)]
pub extern "C" fn start(serial: bool) {
    motor_hub_client::clock::set(|| Duration::from_secs_f64(now_ms() / 1e3));
    let place = if serial {
        Place::new("a hub on a serial port of this computer", |_| {
            Opened::with_parent(SerialPort, TIMEOUT).map_err(|error| error.to_string())
        })
    } else {
        let world = World::default();
        SIMULATION.set(Some(Simulation::new(world.clone())));
        let open = |_| {
            let mut session = Session::new(SimulatedHub, Address::DEFAULT, TIMEOUT);
            session.keep_alive().map_err(|error| error.to_string())?;
            Ok(session.into())
        };
        Place { world: Some(world), ..Place::new("four motors in this tab", open) }
    };
    let mut relay = Relay::new(place);
    // The relay connects before the page is in control, because a page in control must show new values at least every second.
    relay.tick();
    let (sender, texts) = outbox();
    SERVED.set(Some((relay, texts)));
    with_relay(|relay| relay.handle(Event::Joined(PAGE, sender)));
}

/// A place for the bytes of the next order.
#[unsafe(no_mangle)]
pub extern "C" fn input(length: usize) -> *mut u8 {
    INPUT.with_borrow_mut(|input| {
        input.clear();
        input.resize(length, 0);
        input.as_mut_ptr()
    })
}

/// Executes the order in [`input`].
#[unsafe(no_mangle)]
pub extern "C" fn order() {
    let order = String::from_utf8_lossy(&INPUT.take()).into_owned();
    with_relay(|relay| relay.handle(Event::Ordered(PAGE, order)));
}

/// Reads the hub's state, and passes it to the page.
#[unsafe(no_mangle)]
pub extern "C" fn tick() {
    SIMULATION.with_borrow_mut(|simulation| {
        if let Some(simulation) = simulation {
            simulation.catch_up();
        }
    });
    with_relay(Relay::tick);
}

/// Calls the relay, and passes its messages to the page.
fn with_relay(call: impl FnOnce(&mut Relay)) {
    SERVED.with_borrow_mut(|served| {
        if let Some((relay, _)) = served {
            call(relay);
        }
    });
    SERVED.with_borrow(|served| {
        while let Some((_, texts)) = served
            && let Ok(text) = texts.next()
        {
            tell(text.as_ptr(), text.len());
        }
    });
}

/// The simulated hub, and the host's end of its line.
struct Simulation {
    hub: Pin<Box<dyn Future<Output = ()>>>,
    host: Wire,
    /// Time of the page at which the simulated time is 0, in milliseconds.
    begun_ms: i64,
    /// Milliseconds that the hub has run.
    steps: i64,
}

impl Simulation {
    fn new(world: World) -> Self {
        let (line, host) = serve::within_process();
        let hub = async move {
            let scenario = Scenario::to_serve();
            let mut change = |now: &mut _| *now = world.interventions();
            let hubs = Hubs::chain(vec![Address::DEFAULT]);
            let _ = serve::steps(&scenario, &hubs, line, None, &mut change, &mut |_| true).await;
        };
        Self { hub: Box::pin(hub), host, begun_ms: now_ms() as i64, steps: 0 }
    }

    /// Lets the hub run for a millisecond.
    fn step(&mut self) {
        self.steps += 1;
        // The hub never ends, so there is no result to look at.
        let _ = self.hub.as_mut().poll(&mut Context::from_waker(Waker::noop()));
    }

    /// Lets the hub run until its time is the page's.
    fn catch_up(&mut self) {
        let now = now_ms() as i64;
        let lag = now - self.begun_ms - self.steps;
        self.begun_ms += lag - lag.clamp(-LARGEST_LAG_MS, LARGEST_LAG_MS);
        while self.begun_ms + self.steps < now {
            self.step();
        }
    }
}

/// The line to the simulated hub. The hub runs while its host waits for an answer.
#[derive(Debug)]
struct SimulatedHub;

impl SimulatedHub {
    fn with<T>(act: impl FnOnce(&mut Simulation) -> Result<T>) -> Result<T> {
        SIMULATION.with_borrow_mut(|simulation| act(simulation.as_mut().ok_or(ErrorKind::NotConnected)?))
    }
}

impl Read for SimulatedHub {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        Self::with(|simulation| {
            for _ in 0..line::POLL.as_millis() {
                match simulation.host.read(bytes) {
                    Err(error) if error.kind() == ErrorKind::WouldBlock => simulation.step(),
                    read => return read,
                }
            }
            simulation.host.read(bytes)
        })
    }
}

impl Write for SimulatedHub {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        Self::with(|simulation| simulation.host.write(bytes))
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

/// The serial port that the page has opened.
#[derive(Debug)]
struct SerialPort;

/// The number of bytes that an imported function has returned.
fn count(returned: isize) -> Result<usize> {
    usize::try_from(returned).map_err(|_| ErrorKind::NotConnected.into())
}

impl Read for SerialPort {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        match count(receive(bytes.as_mut_ptr(), bytes.len(), line::POLL.as_millis() as u32))? {
            0 => Err(ErrorKind::WouldBlock.into()),
            read => Ok(read),
        }
    }
}

impl Write for SerialPort {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        count(send(bytes.as_ptr(), bytes.len()))
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}
