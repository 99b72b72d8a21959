//! The host as a board: the hub's own async tasks under virtual time against simulated motors.
//!
//! ```text
//!     scenario --> sim: tasks of motor-hub <--> world: plants, battery --> trace
//!                   |
//!     serve: the same in real time, with hosts on its line
//! ```
//!
//! | room | what is decided there |
//! |---|---|
//! | [`hardware`] | what this board is made of, and what the firmware is told of it |
//! | [`current_line`] | what a sound or broken current-sense line says of its bridge |
//! | [`encoder`] | what a sound or broken encoder says of its shaft |
//! | [`world`] | the board's traits over plants on a battery |
//! | [`scheme`] | how people name schemes, blends and duty rules |
//! | [`scenario`] | which motors with which loads are told what, and when |
//! | [`sim`] | a scenario's run in virtual time |
//! | [`direct`] | the same without tasks and clock, for many runs at once |
//! | [`trace`] | what is remembered of it |
//! | [`serve`] | a hub in real time, for host software |
#![forbid(unsafe_code)]

pub mod current_line;
pub mod direct;
pub mod encoder;
pub mod hardware;
pub mod scenario;
pub mod scheme;
pub mod serve;
pub mod sim;
pub mod trace;
pub mod world;
