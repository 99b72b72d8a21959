//! A hub in a browser: a page that shows four motors live, moves, tunes and stops them, and the server between page and
//! hub. The files of the page are part of the program. The page loads nothing from other servers.
//!
//! ```text
//! page --orders--> page socket --Event--> relay --requests--> hub
//! page <--frames-- page socket <--text--- relay <--answers--- hub
//! ```
//!
//! | module | contents |
//! |---|---|
//! | [`relay`] | owns the hub: sends 50 frames per second and executes orders |
//! | [`hub`] | a session with the hubs on a line, and errors of its requests |
//! | [`place`] | where a hub is, and how to open a session with it |
//! | `chain` | which hub of a chain is shown, and what the others do |
//! | `devices` | servos, analog inputs, digital pins and I2C buses of a hub |
//! | [`pages`] | which page is in control, and whether that page is still open |
//! | `requests`, `executor` | orders of pages, and their execution |
//! | `identification` | a running identification, and its result |
//! | `frame`, [`mod@outbox`] | messages to pages, and messages that wait for a page |
//! | [`world`], [`scenario_player`] | changes to a simulated hub's motors and battery; a scenario's set-points |
//! | [`settings_file`] | settings of a hub as TOML |
//! | [`proposal`] | settings proposed for an identified motor, and the catalogue's motor beside it |
//! | [`assets`] | the files of the page |
//! | [`server`], `page_socket` | listener, with a thread for each connection; the socket of one page |
//! | `admission`, `http` | which requests are admitted; requests and answers as bytes |
//!
//! The modules of the last two rows need the feature `server`. Without this feature the relay runs in the browser of
//! its page.
//!
//! One page is in control, any number of pages watch, and any page may stop. A page proves that it is open by returning
//! the numbers of frames that it has shown. All motors are disabled when the page in control is closed, is hidden for
//! 10 s, or does not return the numbers of frames for 1 s. The motors are also disabled when the program ends. If the program is
//! killed, the hub receives nothing more and disables the motors itself.
//!
//! ```no_run
//! use dashboard::{Place, Server, hub};
//! use std::sync::atomic::AtomicBool;
//!
//! let server = Server::bind("127.0.0.1:0")?;
//! println!("{}", server.url());
//! let open = |address| hub::open("/dev/ttyACM0", address).map_err(|error| error.to_string());
//! server.run(Place::new("/dev/ttyACM0", open), &AtomicBool::new(false));
//! # Ok::<(), dashboard::BindError>(())
//! ```
#![forbid(unsafe_code)]

#[cfg(feature = "server")]
mod admission;
pub mod assets;
mod chain;
mod devices;
mod executor;
mod frame;
#[cfg(feature = "server")]
mod http;
pub mod hub;
mod identification;
pub mod outbox;
#[cfg(feature = "server")]
mod page_socket;
pub mod pages;
pub mod place;
pub mod proposal;
pub mod relay;
mod requests;
pub mod scenario_player;
#[cfg(feature = "server")]
pub mod server;
pub mod settings_file;
mod update;
pub mod world;

#[cfg(feature = "server")]
pub use admission::PublicUrl;
pub use hub::Opened;
pub use place::Place;
#[cfg(feature = "server")]
pub use server::{BindError, Server};
