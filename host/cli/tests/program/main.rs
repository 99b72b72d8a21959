//! Runs the program motor-hub with arguments. All tests are in one binary, because most of them wait in real time and can run
//! in parallel. They need Unix: signals, pseudo-terminals, and the notes of served hubs.
#![cfg(unix)]

mod browser;
mod client_devices;
mod client_jog;
mod client_program;
mod client_served;
mod client_settings;
mod client_update;
mod command_line;
mod common;
mod compare;
mod conformance;
mod dashboard;
mod dashboard_browser;
mod dashboard_devices;
mod dashboard_looks;
mod dashboard_panels;
mod dashboard_safety;
mod dashboard_tab;
mod eval;
#[path = "../../../client/tests/hub_support/mod.rs"]
mod hub_support;
mod output_page;
mod page;
mod readme;
mod serve;
