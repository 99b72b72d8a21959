//! The REV Hub Serial Protocol as bytes. One definition serves both ends: hosts write what hubs read, and hubs write
//! what hosts read. REV has not published the protocol, so the protocol is known from published host software. Where
//! this software leaves a layout open, the documentation of the type states the layout of this project.
//!
//! ```text
//! host                                             hub
//! Request --write--> Packet --encode--> bytes --Decoder--> Packet --read--> Request
//! Reply  <--read--   Packet <--Decoder-- bytes <--encode-- Packet <--write-- Reply
//! ```
//!
//! This module neither executes requests nor accesses a link. [`crate::responder`] executes requests.
//! [`crate::extension`] has the requests that REV's protocol lacks, and [`Request`](crate::extension::Request), which
//! is a request of either protocol.
//!
//! ```
//! use motor_hub::extension::Request;
//! use motor_hub::protocol::motor::ToMotor;
//! use motor_hub::protocol::{Address, CHANNELS, Decoder, frame};
//! use motor_hub::units::Micros;
//!
//! // A host sets motor 1 of the hub at address 2 to 300 counts/s backwards.
//! let request = ToMotor::SetVelocity { cps: -300 }.to(1);
//! let bytes = frame::encode(&request.packet(Address::DEFAULT.get(), 7, request.id()));
//! assert_eq!(*bytes, [0x44, 0x4B, 14, 0, 2, 0, 7, 0, 0x11, 0x10, 1, 0xD4, 0xFE, 0x9A]);
//!
//! // The hub reads the same request.
//! let packet = Decoder::new().next(&mut &*bytes, Micros::new(0)).unwrap();
//! assert_eq!(Request::read(&packet, CHANNELS), Ok(request));
//! ```

pub mod address;
pub mod answers;
pub mod frame;
pub mod led;
pub mod motor;
pub mod payload;
pub mod pins;
pub mod refusal;
pub(crate) mod request_table;
pub mod requests;

pub use address::{Address, BROADCAST, HOST};
pub use answers::Reply;
pub use frame::{Decoder, Frame, Packet};
pub use led::Colour;
pub use refusal::Nack;

/// Speed of a serial line in bits per second; 8 data bits, no parity, 1 stop bit, no flow control.
pub const BAUD: u32 = 460_800;

/// Number of motor channels in the protocol. A hub with fewer motors refuses the other channels as out of range.
pub const CHANNELS: usize = 4;
