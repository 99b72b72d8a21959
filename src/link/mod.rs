//! The host link: the hub's side of the REV Hub Serial Protocol, so that host software written for a
//! REV Expansion Hub runs motors of this hub. The protocol is known from published host software
//! only; where that leaves a behaviour open, the choice made is documented here.
//!
//! ```text
//! bytes --> [Decoder] --Packet--> +------+ --Reply--> bytes
//!                                 | Link | --hub::Command--> control
//! Snapshot ---------------------> +------+ --Colour--> status LED
//! ```
//!
//! Pure: no clock, no await, no hardware. [`crate::tasks::link`] is the shell.
//!
//! | room | what is decided there |
//! |---|---|
//! | [`frame`] | bytes to packets and back; synchronisation after garbage |
//! | [`fields`] | reading a payload; what a refused command is answered |
//! | [`command`] | packet to typed request, every parameter checked |
//! | [`reply`] | layouts of answers |
//! | [`channel`] | what the hub remembers of one motor, and what that makes the motor do |
//! | [`setup`] | an interface of this hub's own: which motor, which scheme |
//! | [`pins`] | digital pins, PWM and servo outputs, which this hub only remembers |
//! | [`led`] | the status LED |
//! | [`alive`] | keep-alive timer, status word, attention |
//! | [`state`] | all of these together: the hub as the host sees it |
//!
//! A refused command changes nothing. No packet enables a motor but a valid *set enable*.

pub mod alive;
pub mod channel;
pub mod command;
pub mod fields;
pub mod frame;
pub mod led;
pub mod pins;
pub mod reply;
pub mod setup;
pub mod state;

pub use command::{Address, Request};
pub use fields::Nack;
pub use frame::{Decoder, Frame, Packet};
pub use led::Colour;
pub use reply::Reply;
pub use state::Link;

/// Motor channels of the protocol. A hub with fewer motors refuses the others as out of range.
pub const CHANNELS: usize = 4;

/// Address of the host.
pub const HOST: u8 = 0;

/// Destination of a packet for every hub.
pub const BROADCAST: u8 = 255;
