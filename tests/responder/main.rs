//! The hub's end of the protocol, as hosts find it.

mod base;
mod commands;
mod devices;
mod examples;
mod groups;
mod host;
mod properties;
mod record;
mod setup;
mod state;
mod store;
mod task;
mod update;
