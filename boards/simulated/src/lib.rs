//! The host as a board: the hub's own async tasks under virtual time against simulated motors.
//!
//! ```text
//!     scenario --> sim: tasks of motor-hub <--> world: plants, battery --> trace
//!                                                                            |
//!     tables, charts, CSV, JSON <-- report <-- measures <--------------------+
//! ```
//!
//! [`cli`] is the command line `motor-hub`; `points`, `map` and `eval` ask the firmware's core
//! directly, without a run; [`compare`] makes many runs of a few tasks to tell schemes apart. `client` talks to any hub,
//! real or simulated, through motor-hub-client.
#![forbid(unsafe_code)]

pub mod catalogue;
pub mod chart;
pub mod cli;
pub mod compare;
pub mod eval;
pub mod measures;
pub mod operating;
pub mod points_chart;
pub mod report;
pub mod scenario;
pub mod scheme;
pub mod serve;
pub mod sim;
pub mod table;
pub mod trace;
pub mod world;
