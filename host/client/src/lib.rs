//! Host side of the REV Hub Serial Protocol: a [`Session`] with one hub, real or simulated, over a
//! serial port, a TCP connection or any line of bytes.
//!
//! ```text
//! motors, hub --Request--> [Session] --bytes--> line
//!             <--answer--            <--bytes--
//! ```
//!
//! [`motor_hub::protocol`] and [`motor_hub::extension`] define the bytes, for host and hub. A hub that receives no
//! packet for 2.5 s disables its motors. A host that keeps motors running must therefore keep sending requests.
//!
//! # Features
//! `serial` (on by default): serial ports.
//!
//! # Example
//! ```
//! use motor_hub_client::Session;
//! use motor_hub_client::memory::MemoryHub;
//! use motor_hub_client::motor_hub::protocol::Address;
//! use std::time::Duration;
//!
//! // For a real or served hub: Session::open("/dev/ttyACM0")? or Session::open("127.0.0.1:7070")?.
//! let line = MemoryHub::default();
//! let mut session = Session::with_parent(line, Duration::from_secs(1))?;
//! assert_eq!(session.address(), Address::DEFAULT.get());
//!
//! // A motor without a target is not enabled.
//! let refused = session.enable(0, true).unwrap_err().to_string();
//! assert_eq!(refused, "the hub refuses to enable motor 0: no target set for this mode (NACK 50)");
//! # Ok::<(), motor_hub_client::Error>(())
//! ```
#![forbid(unsafe_code)]

/// Compiles the example of the README.
#[cfg(all(doctest, feature = "serial"))]
#[doc = include_str!("../README.md")]
pub struct Readme;

pub mod base;
pub mod clock;
pub mod devices;
pub mod error;
pub mod explanations;
pub mod hub;
pub mod identification;
pub mod kept_settings;
pub mod line;
pub mod memory;
pub mod motor;
pub mod motor_values;
pub mod reasons;
pub mod request_text;
pub mod session;
pub mod update;

pub use error::{Error, OpenError};
pub use line::Line;
pub use session::Session;

/// Time without a packet after which a hub disables all motors.
pub const KEEP_ALIVE: std::time::Duration =
    std::time::Duration::from_micros(motor_hub::responder::keep_alive::TIMEOUT_MICROS);

/// The firmware's library, whose types the commands use.
pub use motor_hub;
