//! The protocol's bytes, at both ends.

mod frame;
#[path = "../responder/host.rs"]
mod host;
mod round_trip;
