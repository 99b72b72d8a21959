//! Commands to the hub as a whole.
//!
//! ```
//! use motor_hub_client::motor_hub::protocol::{Address, Colour};
//! use motor_hub_client::{Session, memory::MemoryHub};
//! use std::time::Duration;
//!
//! let mut session = Session::new(MemoryHub::default(), Address::DEFAULT, Duration::from_secs(1));
//! let blue = Colour { red: 0, green: 0, blue: 255 };
//! session.set_led(blue)?;
//! assert_eq!(session.led()?, blue);
//! session.fail_safe()?;
//! # Ok::<(), motor_hub_client::Error>(())
//! ```

use crate::{Error, Session};
use motor_hub::protocol::Request;
use motor_hub::protocol::answers::{Bulk, Status};
use motor_hub::protocol::bus::BusReport;
use motor_hub::protocol::fields::Text;
use motor_hub::protocol::group::{GroupMove, GroupState, ToGroup};
use motor_hub::protocol::report::HubReport;
use motor_hub::protocol::requests::{AdcChannel, BATTERY, FIRST_CURRENT, Standard, ToHub};
use motor_hub::protocol::{Address, Colour};
use motor_hub::units::{Milliamperes, Millivolts};
use std::io::{Read, Write};

impl<L: Read + Write> Session<L> {
    /// How the bus of battery and bridges is; `None` of a hub that has no words for it: another maker's, or older than this.
    ///
    /// # Errors
    /// See [`Session::ask`], as for all commands.
    pub fn bus(&mut self) -> Result<Option<BusReport>, Error> {
        match self.ask(Request::Bus) {
            Ok(report) => Ok(Some(report)),
            Err(Error::Refused { .. } | Error::TooOld { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// What all motors do, in one exchange; `None` of a hub that has no words for it: another maker's, or older than this.
    ///
    /// # Errors
    /// See [`Session::ask`], as for all commands.
    pub fn report(&mut self) -> Result<Option<HubReport>, Error> {
        if self.reports_nothing {
            return Ok(None);
        }
        match self.ask(Request::Report) {
            Ok(report) => Ok(Some(report)),
            Err(Error::Refused { .. } | Error::TooOld { .. }) => {
                self.reports_nothing = true;
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Module status; `clear` makes the hub forget what it says.
    ///
    /// # Errors
    /// See [`Session::ask`], as for all commands.
    pub fn status(&mut self, clear: bool) -> Result<Status, Error> {
        self.ask(Standard::Status { clear })
    }

    /// Says that the host is there, which any other command says too.
    pub fn keep_alive(&mut self) -> Result<(), Error> {
        self.order(Standard::KeepAlive)
    }

    /// All motors off; modes, targets and encoders are kept.
    pub fn fail_safe(&mut self) -> Result<(), Error> {
        self.order(Standard::FailSafe)
    }

    /// Gives the hub another address, at which this session goes on.
    pub fn set_address(&mut self, address: Address) -> Result<(), Error> {
        let before = self.address;
        let done = self.order(Standard::SetAddress { address });
        self.address = address.get();
        match done {
            // The answer may be lost, or come from the new address: then the hub is there by now.
            Err(Error::Silent { .. }) if self.status(false).is_ok() => Ok(()),
            Err(error) => {
                self.address = before;
                Err(error)
            }
            Ok(()) => Ok(()),
        }
    }

    /// The colour last set for the status LED.
    pub fn led(&mut self) -> Result<Colour, Error> {
        self.ask(Standard::LedColour)
    }

    /// Sets the colour of the status LED.
    pub fn set_led(&mut self, colour: Colour) -> Result<(), Error> {
        self.order(Standard::SetLedColour { colour })
    }

    /// Everything that changes while motors run.
    pub fn bulk(&mut self) -> Result<Bulk, Error> {
        self.ask(ToHub::Bulk)
    }

    /// Battery voltage; 0 if the hub does not know it.
    pub fn battery(&mut self) -> Result<Millivolts, Error> {
        let mv: i16 = self.ask(ToHub::Adc { channel: BATTERY, raw: false })?;
        Ok(Millivolts::new(u16::try_from(mv).unwrap_or_default()))
    }

    /// Magnitude of a motor's current, of hubs that measure or model it.
    pub fn current(&mut self, motor: u8) -> Result<Milliamperes, Error> {
        let channel = AdcChannel::new(FIRST_CURRENT.get().saturating_add(motor)).unwrap_or(FIRST_CURRENT);
        let ma: i16 = self.ask(ToHub::Adc { channel, raw: false })?;
        Ok(Milliamperes::new(ma.into()))
    }

    /// Sends motors off in step, of which `motor` is one, instead of whatever each of them was to do. All of them
    /// must be enabled. This project's own firmware does that.
    pub fn move_together(&mut self, motor: u8, wanted: GroupMove) -> Result<(), Error> {
        self.order(ToGroup::Move { wanted }.to(motor))
    }

    /// How far the group is in which a motor moves; this project's own firmware tells.
    pub fn group_state(&mut self, motor: u8) -> Result<GroupState, Error> {
        self.ask(ToGroup::State.to(motor))
    }

    /// Hardware and firmware, in the hub's own words.
    pub fn version(&mut self) -> Result<String, Error> {
        let text: Text = self.ask(ToHub::VersionText)?;
        // What a hub says may end in zeros, and goes to a terminal.
        let text = String::from_utf8_lossy(text.bytes());
        Ok(text.chars().filter(|c| !c.is_control()).collect())
    }
}
