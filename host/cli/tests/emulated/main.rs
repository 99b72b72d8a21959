//! The program motor-hub with feature `emulated`: images of boards on emulated chips, over lines and in scenarios.
#![cfg(unix)]

mod client_update;
mod command_line;
#[expect(dead_code, reason = "the tests of the program use more of it")]
#[path = "../program/common/mod.rs"]
mod common;
#[expect(dead_code, reason = "the tests of the program use more of it")]
#[path = "../program/conformance/mod.rs"]
mod conformance;
mod image;
#[path = "../../../studies/tests/scenario_files/mod.rs"]
mod scenario_files;
