//! The protocol's bytes, at both ends.

mod frame;
#[path = "../responder/host.rs"]
mod host;
#[path = "../common/random.rs"]
mod random;
mod round_trip;
