//! The simulated board: the hub's own async tasks run on this computer in virtual time, with simulated motors.
//!
//! ```text
//!     scenario --> sim: tasks of motor-hub <--> world: plants, battery --> trace
//!                   |
//!     serve: the same in real time, with hosts on its line
//! ```
//!
//! | room | contents |
//! |---|---|
//! | [`hardware`] | bridges and motor constants of this board, as the firmware is configured for them |
//! | [`current_line`] | sound and broken current-sense lines |
//! | [`encoder`] | sound and broken encoders |
//! | [`world`] | the board's traits over plants on a battery |
//! | [`ground`] | true position and heading of a drive base |
//! | [`i2c`], [`bno055`] | I2C buses with their devices and faults |
//! | [`scheme`] | names of schemes, blends and duty rules |
//! | [`scenario`] | motors with their loads, commands and expectations over time |
//! | [`sim`] | a scenario's run in virtual time |
//! | [`without_tasks`] | a scenario's run without tasks and clock, for many threads |
//! | [`trace`] | the record of a run |
//! | [`serve`] | a hub in real time, for host software |
#![forbid(unsafe_code)]

pub mod bno055;
pub mod current_line;
pub mod encoder;
pub mod ground;
pub mod hardware;
pub mod i2c;
pub mod scenario;
pub mod scheme;
pub mod serve;
pub mod sim;
pub mod trace;
pub mod without_tasks;
pub mod world;
