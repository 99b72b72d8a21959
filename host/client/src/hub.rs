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

use crate::clock::Instant;
use crate::error::none_if_unsupported;
use crate::reasons::stored_text;
use crate::{Error, Session};
use motor_hub::chain::ChainReport;
use motor_hub::extension::group::{GroupCourse, GroupState};
use motor_hub::extension::record::{Entries, Ticks};
use motor_hub::extension::report::{BusReport, HubReport};
use motor_hub::extension::state::StoreReport;
use motor_hub::extension::{HubFunction, MotorFunction};
use motor_hub::group::GroupCommand;
use motor_hub::protocol::answers::{Bulk, Status};
use motor_hub::protocol::payload::Text;
use motor_hub::protocol::requests::{AdcChannel, BATTERY, FIRST_CURRENT, Standard, ToHub};
use motor_hub::protocol::{Address, Colour, Nack};
use motor_hub::record::{Head, Tick};
use motor_hub::store::Stored;
use motor_hub::units::{Milliamperes, Millivolts};
use std::time::Duration;

/// Highest speed of a group in counts per second that this crate's users may request. The protocol's fields have 24
/// bits before the binary point, so their range is larger.
pub const FASTEST_GROUP_CPS: i32 = 1_000_000;

/// Time-out of a save, load or reset of settings. A save takes several seconds if the hub must erase flash.
const STORE_TIMEOUT: Duration = Duration::from_secs(10);

/// Time-out of [`Session::catch_up`]: three of the longest control periods, which are 100 ms.
const CATCHING_UP: Duration = Duration::from_millis(300);

/// Time-out of [`Session::fail_safe_lost`]. A hub of a chain that runs answers within this time.
const LOST_TIMEOUT: Duration = Duration::from_millis(20);

/// Interval between two requests to a hub that has not finished.
const POLL: Duration = Duration::from_millis(20);

/// A save, load or reset of settings that a hub has begun.
#[derive(Clone, Copy, Debug)]
pub struct StoreAccess {
    /// Time at which the hub counts as failed.
    end: Instant,
}

impl StoreAccess {
    /// Asks the hub for the result. `None` while the hub has not finished, for 10 s at most.
    /// [`why_unsaved`](crate::reasons::why_unsaved) says whether the access has succeeded.
    pub fn result(self, session: &mut Session) -> Result<Option<StoreReport>, Error> {
        let report = session.stored()?;
        Ok((!report.is_busy || Instant::now() > self.end).then_some(report))
    }
}

impl Session {
    /// State of the bus between battery and bridges; `None` if the hub does not report it (another maker's, or older
    /// firmware).
    pub fn bus(&mut self) -> Result<Option<BusReport>, Error> {
        none_if_unsupported(self.request(HubFunction::Bus))
    }

    /// Addresses of the hubs behind this hub, and whether the hub is still discovering hubs; `None` if the hub does not
    /// report its chain line (another maker's, or older firmware).
    ///
    /// # Errors
    /// [`Error::Refused`] if the hub has no chain line. See also [`Session::request`].
    pub fn chain(&mut self) -> Result<Option<ChainReport>, Error> {
        match self.request(HubFunction::Chain) {
            Err(error @ Error::Refused { reason: Nack::UNSUPPORTED, .. }) => Err(error),
            answer => none_if_unsupported(answer),
        }
    }

    /// Number of the hub's present run, and the recorded faults and resets, newest first. A run lasts from one reset to
    /// the next. `None` if the hub keeps no record.
    pub fn recorded(&mut self) -> Result<Option<(u32, Vec<Head>)>, Error> {
        let mut heads = Vec::new();
        loop {
            // A record has at most eight entries.
            let entries = HubFunction::Entries { from: heads.len() as u8, clear: false };
            let some: Option<Entries> = none_if_unsupported(self.request(entries))?;
            let Some(some) = some.filter(|some| some.run != 0) else { return Ok(None) };
            heads.extend(&some.heads);
            if some.heads.is_empty() || heads.len() >= usize::from(some.count) {
                return Ok(Some((some.run, heads)));
            }
        }
    }

    /// Reads the control ticks of the entry `number` of [`recorded`](Self::recorded), oldest first.
    pub fn recorded_ticks(&mut self, number: u16) -> Result<Vec<Tick>, Error> {
        let mut ticks = Vec::new();
        loop {
            let some: Ticks = self.request(HubFunction::Ticks { number, from: ticks.len() as u8 })?;
            ticks.extend(&some.ticks);
            if some.ticks.is_empty() || ticks.len() >= usize::from(some.count) {
                return Ok(ticks);
            }
        }
    }

    /// Clears the hub's record of faults and resets.
    pub fn forget_record(&mut self) -> Result<(), Error> {
        self.request(HubFunction::Entries { from: 0, clear: true }).map(|_: Entries| ())
    }

    /// State of the stored settings, and result of the last save, load or reset of settings. Needs this project's
    /// firmware on a board that stores settings.
    pub fn stored(&mut self) -> Result<StoreReport, Error> {
        self.request(HubFunction::Stored)
    }

    /// State of the stored settings, as from [`stored`](Self::stored); `None` if the hub does not report this state
    /// (another maker's, or a board that stores nothing).
    pub fn stored_if_reported(&mut self) -> Result<Option<StoreReport>, Error> {
        none_if_unsupported(self.stored())
    }

    /// Stores, loads or resets the hub's settings, and waits until the hub has finished, for 10 s at most. The report
    /// contains the result.
    pub fn store(&mut self, what: HubFunction) -> Result<StoreReport, Error> {
        let access = self.begin_store(what)?;
        loop {
            if let Some(report) = access.result(self)? {
                return Ok(report);
            }
            std::thread::sleep(POLL);
        }
    }

    /// Starts to store, load or reset the hub's settings. [`StoreAccess::result`] returns the result.
    pub fn begin_store(&mut self, what: HubFunction) -> Result<StoreAccess, Error> {
        // The hub takes from its last control tick whether motors are disabled.
        self.catch_up()?;
        let was_idle = self.stored_if_reported()?.is_some_and(|report| !report.is_busy);
        match self.command(what) {
            // The hub was idle before, so it is busy with this request. The acknowledgement of the first transmission
            // was lost, and the hub has refused a retransmission.
            Err(Error::Refused { reason: Nack::STORE_BUSY, .. }) if was_idle => (),
            done => done?,
        }
        Ok(StoreAccess { end: Instant::now() + STORE_TIMEOUT })
    }

    /// State of all motors in one exchange; `None` if the hub does not report it (another maker's, or older firmware).
    pub fn report(&mut self) -> Result<Option<HubReport>, Error> {
        if self.reporting_nothing.contains(&self.address) {
            return Ok(None);
        }
        let asked = Instant::now();
        let report: Option<HubReport> = none_if_unsupported(self.request(HubFunction::Report))?;
        match &report {
            Some(report) => self.note_clock(asked, report.at_ms),
            None => drop(self.reporting_nothing.insert(self.address)),
        }
        Ok(report)
    }

    /// Waits until the hub's report includes all commands of earlier requests, such as disabling a motor, for 300 ms at
    /// most. Returns immediately for a hub that does not report its commands.
    pub fn catch_up(&mut self) -> Result<(), Error> {
        let end = Instant::now() + CATCHING_UP;
        while self.report()?.is_some_and(|report| !report.is_up_to_date()) && Instant::now() < end {
            std::thread::sleep(POLL);
        }
        Ok(())
    }

    /// Module status. If `clear` is true, the hub clears its status word after it has put the word into the answer.
    pub fn status(&mut self, clear: bool) -> Result<Status, Error> {
        self.request(Standard::Status { clear })
    }

    /// Resets the hub's keep-alive timer and has no other effect. Every other request resets the timer too.
    pub fn keep_alive(&mut self) -> Result<(), Error> {
        self.command(Standard::KeepAlive)
    }

    /// Disables all motors; modes, targets and encoder positions are kept.
    pub fn fail_safe(&mut self) -> Result<(), Error> {
        self.command(Standard::FailSafe)
    }

    /// Disables all motors of a hub of a chain that has not answered before, with a time-out of 20 ms, so that this request
    /// hardly delays the requests to the other hubs of the chain.
    ///
    /// # Errors
    /// [`Error::Silent`] for a hub that still does not answer.
    pub fn fail_safe_lost(&mut self) -> Result<(), Error> {
        let before = std::mem::replace(&mut self.timeout, LOST_TIMEOUT);
        let done = self.fail_safe();
        self.timeout = before;
        done
    }

    /// Gives the hub another address, which this session then uses.
    pub fn set_address(&mut self, address: Address) -> Result<(), Error> {
        let before = self.address;
        let done = self.command(Standard::SetAddress { address });
        self.address = address.get();
        self.forget(before);
        self.forget(self.address);
        match done {
            // The answer may be lost, or may come from the new address. If the hub answers at the new address and no
            // longer at the former one, the change has succeeded. If a hub answers at both, another hub has the new
            // address.
            Err(Error::Silent { .. }) if self.status(false).is_ok() && !self.answers_at(before) => Ok(()),
            Err(error) => {
                self.address = before;
                Err(error)
            }
            Ok(()) => Ok(()),
        }
    }

    /// Text that says why the next reset may end the address that [`set_address`](Self::set_address) has given. `None` if
    /// the hub stores the address.
    pub fn why_address_is_lost(&mut self) -> Result<Option<String>, Error> {
        Ok(match self.stored() {
            Ok(report) => matches!(report.stored, Stored::Later | Stored::Damaged)
                .then(|| format!("until the next reset: the memory has {}", stored_text(&report))),
            Err(Error::Refused { reason: Nack::UNSUPPORTED, .. }) => {
                Some("until the next reset: the hub stores no settings".to_owned())
            }
            // A hub of another maker, or older firmware.
            answer => none_if_unsupported(answer)?.is_none().then(|| {
                "at least until the next reset: the hub does not report whether it stores its address"
                    .to_owned()
            }),
        })
    }

    /// True if a hub answers at `former`, the address before [`set_address`](Self::set_address).
    fn answers_at(&mut self, former: u8) -> bool {
        let present = std::mem::replace(&mut self.address, former);
        let answers = present != former && self.status(false).is_ok();
        self.address = present;
        answers
    }

    /// The colour last set for the status LED.
    pub fn led(&mut self) -> Result<Colour, Error> {
        self.request(Standard::LedColour)
    }

    /// Sets the colour of the status LED.
    pub fn set_led(&mut self, colour: Colour) -> Result<(), Error> {
        self.command(Standard::SetLedColour { colour })
    }

    /// Digital and analog inputs, and the positions, velocities and alerts of all motors, in one answer.
    pub fn bulk(&mut self) -> Result<Bulk, Error> {
        self.request(ToHub::Bulk)
    }

    /// Battery voltage in mV; 0 if unknown.
    pub fn battery(&mut self) -> Result<Millivolts, Error> {
        let mv: i16 = self.request(ToHub::Adc { channel: BATTERY, raw: false })?;
        Ok(Millivolts::new(u16::try_from(mv).unwrap_or_default()))
    }

    /// Magnitude of a motor's current in mA. Hubs that neither measure nor model current refuse.
    pub fn current(&mut self, motor: u8) -> Result<Milliamperes, Error> {
        let channel = AdcChannel::new(FIRST_CURRENT.get().saturating_add(motor)).unwrap_or(FIRST_CURRENT);
        let ma: i16 = self.request(ToHub::Adc { channel, raw: false })?;
        Ok(Milliamperes::new(ma.into()))
    }

    /// Moves a group of motors in step; `motor` is a member of the group. The move replaces each motor's set-point. All
    /// members must be enabled. Needs this project's firmware.
    pub fn move_together(&mut self, motor: u8, wanted: GroupCommand<GroupCourse>) -> Result<(), Error> {
        self.command(MotorFunction::Move { wanted }.to(motor))
    }

    /// State of the group in which a motor moves. Needs this project's firmware.
    pub fn group_state(&mut self, motor: u8) -> Result<GroupState, Error> {
        self.request(MotorFunction::Group.to(motor))
    }

    /// The hub's version text: hardware and firmware.
    pub fn version(&mut self) -> Result<String, Error> {
        let text: Text = self.request(ToHub::VersionText)?;
        // The text may end in zeros. Control characters must not reach a terminal.
        let text = String::from_utf8_lossy(&text);
        Ok(text.chars().filter(|c| !c.is_control()).collect())
    }
}
