//! The host's end of the REV Hub Serial Protocol: a [`Session`] with one hub, real or simulated, over a
//! serial port, a TCP connection or any line of bytes.
//!
//! ```text
//! motors, hub --Request--> [Session] --bytes--> line
//!             <--answer--            <--bytes--
//! ```
//!
//! | room | what is decided there |
//! |---|---|
//! | [`mod@line`] | serial port or TCP connection, as bytes with timeouts |
//! | [`session`] | one request at a time: waiting, trying again, discovery |
//! | [`hub`], [`motor`] | the protocol's commands, as methods of [`Session`] |
//! | [`error`] | what can go wrong |
//!
//! What the bytes are, [`motor_hub::protocol`] says, which a hub reads by the same definitions. A hub lets
//! its motors go when it has heard nothing for 2.5 s: a host that keeps them running goes on asking.
//!
//! # Features
//! `serial` (on by default): serial ports.
//!
//! # Example
//! A line of one's own, with a hub of this project at its other end:
//!
//! ```
//! use motor_hub::braking::Winding;
//! use motor_hub::hub::Snapshot;
//! use motor_hub::motor::Settings;
//! use motor_hub::protocol::{Address, Decoder, frame};
//! use motor_hub::responder::Responder;
//! use motor_hub::units::{Micros, Millivolts};
//! use motor_hub_client::Session;
//! use std::collections::VecDeque;
//! use std::io::{self, Read, Write};
//! use std::time::Duration;
//!
//! struct Memory {
//!     hub: Responder<4>,
//!     replies: VecDeque<u8>,
//! }
//!
//! impl Write for Memory {
//!     fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
//!         let snapshot = Snapshot { battery: Some(Millivolts::new(12_345)), ..Snapshot::INITIAL };
//!         let packet = Decoder::new().next(&mut &*bytes, Micros::new(0)).expect("a whole request");
//!         let reply = self.hub.receive(&packet, Micros::new(0), &snapshot).expect("an answer");
//!         self.replies.extend(&frame::encode(&reply));
//!         Ok(bytes.len())
//!     }
//!
//!     fn flush(&mut self) -> io::Result<()> {
//!         Ok(())
//!     }
//! }
//!
//! impl Read for Memory {
//!     fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
//!         if self.replies.is_empty() { Err(io::ErrorKind::WouldBlock.into()) } else { self.replies.read(bytes) }
//!     }
//! }
//!
//! let settings = Settings::new(Winding::NEVEREST_60);
//! let hub = Responder::new(Address::DEFAULT, [settings; 4]);
//! let line = Memory { hub, replies: VecDeque::new() };
//! let mut session = Session::new(line, Address::DEFAULT, Duration::from_secs(1));
//! assert_eq!(session.battery()?, Millivolts::new(12_345));
//!
//! // A motor without a target is not enabled.
//! let refused = session.enable(0, true).unwrap_err().to_string();
//! assert_eq!(refused, "the hub refuses to enable motor 0: no target set for this mode (NACK 50)");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

/// The README, whose example is compiled.
#[cfg(all(doctest, feature = "serial"))]
#[doc = include_str!("../README.md")]
pub struct Readme;

pub mod error;
pub mod hub;
pub mod line;
pub mod motor;
pub mod session;
mod words;

pub use error::{Error, OpenError};
pub use line::Line;
pub use session::Session;

/// Whose types the commands take and give.
pub use motor_hub;
