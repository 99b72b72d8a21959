//! A hub in a browser: one page that shows four motors live, moves, tunes and stops them, and the server between it and
//! the hub. What the page is made of is within the program; nothing is fetched from elsewhere.
//!
//! ```text
//! page --orders--> viewer --Event--> pilot --requests--> hub
//! page <--frames-- viewer <--text--- pilot <--answers--- hub
//! ```
//!
//! | room | what is decided there |
//! |---|---|
//! | [`gate`] | which requests are let in |
//! | [`http`], [`assets`] | requests as bytes, and the files of the page |
//! | [`server`] | who listens; a thread a connection |
//! | `viewer` | one page: its socket |
//! | [`desk`] | who is in control, and whether they are still there |
//! | `pilot` | the thread that has the hub: fifty frames a second, orders as they come |
//! | [`order`], `perform` | what a page may ask for, and what is done about it |
//! | `frame` | what pages are told |
//! | [`world`], [`script`] | what a page may do to a simulated hub's motors and battery; a scenario's set-points |
//!
//! One page is in control, any number look on, and anyone may stop. A page proves that it is there by returning the numbers
//! of frames that it has shown: when the one in control is closed, is hidden for long or returns nothing for a second,
//! all motors are switched off. So they are when the program ends; and if it is killed, the hub hears nothing and does
//! so by itself.
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
