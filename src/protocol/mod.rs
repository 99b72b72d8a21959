//! The bytes of the REV Hub Serial Protocol, both ends of them: what a host writes is what a hub reads,
//! from one definition, and the other way round. The protocol is known from published host software
//! only; where that leaves a layout open, the choice made is documented here.
//!
//! ```text
//! host                                                hub
//! [Request] --write--> Packet --encode--> bytes --Decoder--> Packet --read--> [Request]
//! [Reply]  <--read--   Packet <--Decoder-- bytes <--encode-- Packet <--write-- [Reply]
//! ```
//!
//! | room | what is decided there |
//! |---|---|
//! | [`frame`] | packets to bytes and back; synchronisation after garbage |
//! | [`fields`] | values to payloads and back; ranges |
//! | [`requests`] | every request: its number and its fields |
//! | [`motor`], [`pins`], [`setup`], [`group`], [`led`] | the requests to one motor, to pins, to this hub's own interface, of groups among it; the LED's values |
//! | [`bus`], [`record`], [`report`], [`store`], [`update`] | of that interface too: how the bus is; what happened; what all motors do, in one answer; what is stored; new firmware |
//! | [`answers`] | every answer's fields |
//! | [`nack`] | why a request is refused, as a number and in words |
//! | [`address`] | who is meant |
//!
//! What a hub makes of a request is [`crate::responder`]'s to decide. Nothing here knows of a hub, of
//! time or of a line.
//!
//! ```
//! use motor_hub::protocol::motor::ToMotor;
//! use motor_hub::protocol::{Address, CHANNELS, Decoder, Request, frame};
//! use motor_hub::units::Micros;
//!
//! // A host asks the hub at address 2 for 300 counts/s backwards of motor 1.
//! let request = ToMotor::SetVelocity { cps: -300 }.to(1);
//! let bytes = frame::encode(&request.packet(Address::DEFAULT.get(), 7, request.id()));
//! assert_eq!(*bytes, [0x44, 0x4B, 14, 0, 2, 0, 7, 0, 0x11, 0x10, 1, 0xD4, 0xFE, 0x9A]);
//!
//! // The hub reads what was written.
//! let packet = Decoder::new().next(&mut &*bytes, Micros::new(0)).unwrap();
//! assert_eq!(Request::read(&packet, CHANNELS), Ok(request));
//! ```

pub mod address;
pub mod answers;
pub mod bus;
pub mod fields;
pub mod frame;
pub mod group;
pub mod led;
pub mod motor;
pub mod nack;
pub mod pins;
pub mod record;
pub mod report;
pub mod requests;
pub mod setup;
pub mod store;
mod table;
pub mod update;

pub use address::{Address, BROADCAST, HOST};
pub use answers::Reply;
pub use frame::{Decoder, Frame, Packet};
pub use led::Colour;
pub use nack::Nack;
pub use requests::Request;

/// Bits per second on a serial line; 8 data bits, no parity, 1 stop bit, no flow control.
pub const BAUD: u32 = 460_800;

/// Motor channels of the protocol. A hub with fewer motors refuses the others as out of range.
pub const CHANNELS: usize = 4;
