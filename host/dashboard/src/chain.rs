//! The hubs on one line: a parent, and the hubs of the chain behind it. One hub is shown in full. The server asks the
//! other hubs in turn which motors are enabled. These requests also reset the keep-alive of a hub, so that its motors
//! stay enabled.
//!
//! A child that does not answer counts as lost. Once a second one of the lost hubs is asked to disable its motors, with
//! a short time-out, so that it hardly delays the other hubs. If the lost hub was shown, the parent is shown instead.
//! If the parent does not answer, no hub can be reached.

use motor_hub::protocol::{Address, CHANNELS};
use motor_hub_client::error::none_if_unsupported;
use motor_hub_client::{Error, Session};
use serde::Serialize;

/// Largest number of hubs of a chain; further hubs on the line are ignored.
const MAX_HUBS: usize = 4;

/// Number of frames between two requests to another hub. The progress of an identification and the result of a save are
/// also asked for at this interval. There are 50 frames in a second, so each of three other hubs is asked every 0.3 s.
pub(crate) const FRAMES_PER_QUERY: u64 = 5;

/// Number of frames between two requests to a lost hub: a second.
const FRAMES_PER_RETRY: u64 = 50;

/// A hub of a chain, for pages.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct HubOfChain {
    /// Address on the line.
    pub(crate) address: u8,
    /// True for the hub that is shown in full.
    shown: bool,
    /// Motors that are enabled.
    running: Vec<u8>,
    /// True if an enabled motor has a fault.
    fault: bool,
    /// True if the hub does not answer.
    lost: bool,
}

/// The hubs on the line.
#[derive(Debug, Default)]
pub(crate) struct Chain {
    hubs: Vec<HubOfChain>,
    /// The hubs that [`changed_hubs`](Self::changed_hubs) has returned last, for pages.
    sent: Vec<HubOfChain>,
}

impl Chain {
    /// Creates the chain of hubs with these addresses. The hub with the address `shown` is shown.
    pub(crate) fn new(addresses: &[u8], shown: u8) -> Self {
        let hub = |&address: &u8| {
            let (running, shown) = (Vec::new(), address == shown);
            HubOfChain { address, shown, running, fault: false, lost: false }
        };
        Self { hubs: addresses.iter().take(MAX_HUBS).map(hub).collect(), sent: Vec::new() }
    }

    /// True if the first hub is shown. In a simulation a page can change motors and battery of the first hub only.
    pub(crate) fn shows_the_first(&self) -> bool {
        self.hubs.first().is_none_or(|hub| hub.shown)
    }

    /// True if a hub that is not shown had an enabled motor when it was last asked.
    pub(crate) fn others_run(&self) -> bool {
        self.hubs.iter().any(|hub| !hub.shown && !hub.running.is_empty())
    }

    /// Notes that a hub does not answer. If the hub was shown, the session continues with the first hub. Returns false
    /// if no child has this address. If the first hub has this address, no hub can be reached.
    pub(crate) fn lose(&mut self, session: &mut Session, address: u8) -> bool {
        let Some((first, children)) = self.hubs.split_first_mut() else { return false };
        let child = children.iter_mut().find(|hub| hub.address == address);
        let (Some(child), Some(parent)) = (child, Address::new(first.address)) else { return false };
        if child.shown {
            session.select_hub(parent);
            first.shown = true;
        }
        // A lost hub is only asked to disable its motors. If it gets no request, its keep-alive disables the motors.
        *child = HubOfChain { address, shown: false, running: Vec::new(), fault: false, lost: true };
        true
    }

    /// Continues the session with another hub of the chain.
    ///
    /// # Errors
    /// The line has no hub with this address.
    pub(crate) fn show(&mut self, session: &mut Session, address: u8) -> Result<(), String> {
        let known = self.hubs.iter().any(|hub| hub.address == address);
        let Some(hub) = Address::new(address).filter(|_| known) else {
            return Err(format!("there is no hub {address} on this line"));
        };
        session.select_hub(hub);
        for hub in &mut self.hubs {
            hub.shown = hub.address == address;
            hub.lost &= !hub.shown;
        }
        Ok(())
    }

    /// True if a hub that is not shown has this address.
    pub(crate) fn has_other(&self, address: u8) -> bool {
        self.hubs.iter().any(|hub| !hub.shown && hub.address == address)
    }

    /// Notes the new address of the shown hub.
    pub(crate) fn rename(&mut self, address: u8) {
        if let Some(hub) = self.hubs.iter_mut().find(|hub| hub.shown) {
            hub.address = address;
        }
    }

    /// Notes which motors of the shown hub are enabled, and whether one of them has a fault.
    pub(crate) fn note(&mut self, running: Vec<u8>, fault: bool) {
        if let Some(hub) = self.hubs.iter_mut().find(|hub| hub.shown) {
            (hub.running, hub.fault) = (running, fault);
        }
    }

    /// In every fifth frame, asks one hub that is neither shown nor lost which motors are enabled, and whether one of
    /// them has a fault.
    ///
    /// # Errors
    /// The line fails, or the other hub does not answer.
    pub(crate) fn ask_another(&mut self, session: &mut Session, frame: u64) -> Result<(), Error> {
        let is_other = |hub: &HubOfChain| !hub.shown && !hub.lost;
        if let Some((hub, answer)) = self.ask_next(session, frame, FRAMES_PER_QUERY, is_other, query_running)
        {
            (hub.running, hub.fault) = answer?;
        }
        Ok(())
    }

    /// In every fiftieth frame, sends one of the lost hubs a request to disable its motors. Returns the address of a
    /// hub that answers, which is no longer lost.
    ///
    /// # Errors
    /// The line fails.
    pub(crate) fn ask_lost(&mut self, session: &mut Session, frame: u64) -> Result<Option<u8>, Error> {
        match self.ask_next(session, frame, FRAMES_PER_RETRY, |hub| hub.lost, Session::fail_safe_lost) {
            Some((_, Err(error @ (Error::Line(_) | Error::HungUp)))) => Err(error),
            None | Some((_, Err(_))) => Ok(None),
            Some((hub, Ok(()))) => {
                hub.lost = false;
                Ok(Some(hub.address))
            }
        }
    }

    /// In each frame whose number is a multiple of `interval`, asks one of these hubs, in turn. Returns the hub and its
    /// answer; `None` if no hub was asked.
    fn ask_next<T>(
        &mut self,
        session: &mut Session,
        frame: u64,
        interval: u64,
        of_these: impl Fn(&HubOfChain) -> bool,
        ask: impl FnOnce(&mut Session) -> Result<T, Error>,
    ) -> Option<(&mut HubOfChain, Result<T, Error>)> {
        if !frame.is_multiple_of(interval) {
            return None;
        }
        let shown = Address::new(session.address())?;
        let count = self.hubs.iter().filter(|hub| of_these(hub)).count();
        let next = ((frame / interval) as usize).checked_rem(count)?;
        let hub = self.hubs.iter_mut().filter(|hub| of_these(hub)).nth(next)?;
        session.select_hub(Address::new(hub.address)?);
        let answer = ask(session);
        session.select_hub(shown);
        Some((hub, answer))
    }

    /// Disables the motors of all hubs, and waits until the hubs that are not lost have confirmed.
    ///
    /// # Errors
    /// The first error, such as [`Error::Silent`] for a hub that does not confirm. The other hubs are asked
    /// nevertheless.
    pub(crate) fn stop(&mut self, session: &mut Session) -> Result<(), Error> {
        if self.hubs.len() < 2 {
            return session.fail_safe();
        }
        let known: Vec<u8> = self.hubs.iter().filter(|hub| !hub.lost).map(|hub| hub.address).collect();
        self.hubs.iter_mut().for_each(|hub| hub.running.clear());
        session.stop_hubs(&known)
    }

    /// Returns the hubs; `None` if there are fewer than two.
    pub(crate) fn several(&self) -> Option<&[HubOfChain]> {
        (self.hubs.len() > 1).then_some(&self.hubs)
    }

    /// Returns the hubs; `None` if there are fewer than two, or if they are as they were last returned.
    pub(crate) fn changed_hubs(&mut self) -> Option<Vec<HubOfChain>> {
        if self.several().is_none() || self.sent == self.hubs {
            return None;
        }
        self.sent.clone_from(&self.hubs);
        Some(self.hubs.clone())
    }
}

/// The enabled motors of a hub, and whether one of them has a fault. The faults of a hub of another maker are not asked
/// for.
fn query_running(session: &mut Session) -> Result<(Vec<u8>, bool), Error> {
    if let Some(report) = session.report()? {
        let motors = || (0..).zip(&report.motors).filter(|(_, motor)| motor.enabled);
        return Ok((
            motors().map(|(motor, _)| motor).collect(),
            motors().any(|(_, motor)| motor.faults.any()),
        ));
    }
    // A hub of another maker has no report, so each motor is asked for.
    let mut running = Vec::new();
    for motor in 0..CHANNELS as u8 {
        // A hub with fewer motors refuses the request.
        let Some(enabled) = none_if_unsupported(session.enabled(motor))? else { break };
        if enabled {
            running.push(motor);
        }
    }
    Ok((running, false))
}
