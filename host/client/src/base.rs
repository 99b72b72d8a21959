//! Commands to a drive base: two wheels whose motors move as a group, with odometry and a gyro.
//!
//! ```
//! use motor_hub_client::motor_hub::group::{BaseSettings, DriveBase, GyroState};
//! use motor_hub_client::motor_hub::hub::BaseState;
//! use motor_hub_client::motor_hub::protocol::Address;
//! use motor_hub_client::{Session, memory::MemoryHub};
//! use std::time::Duration;
//!
//! // The hub in memory does not drive. It reports that the base stands at its start.
//! let mut hub = MemoryHub::default();
//! hub.snapshot.base = Some(BaseState::default());
//! let mut session = Session::new(hub, Address::DEFAULT, Duration::from_secs(1));
//! let refused = session.odometry().unwrap_err().to_string();
//! assert_eq!(refused, "the hub refuses to report where its drive base is: no drive base is configured (NACK 82)");
//!
//! let base = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0, -1680.0] };
//! session.set_base(BaseSettings::new([0, 1], &base, false)?)?;
//! let report = session.odometry()?;
//! assert_eq!((report.x_um, report.gyro), (0, GyroState::Unused));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::{Error, Session};
use motor_hub::extension::HubFunction;
use motor_hub::extension::base::OdometryReport;
use motor_hub::group::BaseSettings;
use std::io::{Read, Write};

impl<L: Read + Write> Session<L> {
    /// Configures the drive base, which then starts at the origin, and waits until the hub has applied the settings. Both motors must be
    /// disabled. Needs this project's firmware.
    ///
    /// # Errors
    /// [`Error::Refused`] if the hub lacks a motor, or an I2C bus for the gyro. See also [`Session::ask`].
    pub fn set_base(&mut self, base: BaseSettings) -> Result<(), Error> {
        self.order(HubFunction::SetBase { base })?;
        self.catch_up()
    }

    /// Where the drive base is, and the state of its gyro. Needs this project's firmware.
    ///
    /// # Errors
    /// [`Error::Refused`] if no base is configured. See also [`Session::ask`].
    pub fn odometry(&mut self) -> Result<OdometryReport, Error> {
        self.ask(HubFunction::Odometry)
    }
}
