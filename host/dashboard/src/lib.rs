//! A hub in a browser: a page that shows four motors live, moves, tunes and stops them, and the server between page and hub.
//! The files of the page are part of the program. The page loads nothing from other servers.
//!
//! ```text
//! page --orders--> viewer --Event--> pilot --requests--> hub
//! page <--frames-- viewer <--text--- pilot <--answers--- hub
//! ```
//!
//! | module | contents |
//! |---|---|
//! | [`gate`] | which requests are admitted |
//! | [`http`], [`assets`] | requests and answers as bytes; the files of the page |
//! | [`server`] | listener, with a thread for each connection |
//! | `viewer` | the socket of one page |
//! | [`desk`] | which page is in control, and whether that page is still open |
//! | `pilot` | the thread that owns the hub: sends 50 frames per second and executes orders |
//! | [`order`], `perform` | orders of pages, and their execution |
//! | `frame` | messages to pages |
//! | [`world`], [`script`] | changes to a simulated hub's motors and battery; a scenario's set-points |
//!
//! One page is in control, any number of pages watch, and any page may stop. A page proves that it is open by returning the
//! numbers of frames that it has shown. All motors are disabled when the page in control is closed, is hidden for 10 s, or
//! returns no new number for 1 s. They are also disabled when the program ends. If the program is killed, the hub receives
//! nothing more and disables them itself.
//!
//! ```no_run
//! use dashboard::{Place, Server};
//! use motor_hub_client::Session;
//! use std::sync::atomic::AtomicBool;
//!
//! let server = Server::bind("127.0.0.1:0")?;
//! println!("{}", server.url());
//! let open = || Session::open("/dev/ttyACM0").map_err(|error| error.to_string());
//! server.run(Place::real("/dev/ttyACM0", open), &AtomicBool::new(false));
//! # Ok::<(), dashboard::BindError>(())
//! ```
#![forbid(unsafe_code)]

pub mod assets;
pub mod desk;
mod frame;
pub mod gate;
pub mod http;
pub mod order;
mod perform;
mod pilot;
pub mod script;
pub mod server;
mod viewer;
pub mod world;

pub use pilot::Place;
pub use server::{BindError, Server};
