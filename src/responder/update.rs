//! Requests of a host about new firmware. [`crate::update`] accepts or refuses each request, and `tasks::update`
//! accesses the flash.

use super::Responder;
use crate::extension::HubFunction;
use crate::extension::state::UpdateReport;
use crate::hub::Snapshot;
use crate::protocol::payload::Text;
use crate::protocol::{Nack, Reply};
use crate::update::{ImageSignature, Slot, SlotReport, Update, UpdateRequest};

/// Longest announced version in bytes that the hub stores. The rest of a longer version is dropped.
const LONGEST_VERSION: usize = 40;

impl<const N: usize> Responder<N> {
    /// Makes the responder accept firmware updates, on a hub whose bootloader starts images from this active slot.
    #[must_use]
    pub fn with_slot(mut self, slot: Slot) -> Self {
        self.update = Some(Update::new(slot));
        self
    }

    /// Executes a request about new firmware.
    ///
    /// # Errors
    /// Returns why the request is refused. [`Nack::UNSUPPORTED`] on a hub without a bootloader.
    pub(super) fn receive_update(
        &mut self,
        function: HubFunction,
        snapshot: &Snapshot<N>,
    ) -> Result<Reply, Nack> {
        let motors_run = !self.is_off(snapshot);
        let (update, version) = (self.update.as_mut().ok_or(Nack::UNSUPPORTED)?, &mut self.announced_version);
        match function {
            HubFunction::Update => return Ok(Reply::data(&report(update, version))),
            HubFunction::BeginUpdate { length, crc, version: announced } => {
                update.begin(length, crc, motors_run)?;
                *version = announced.into_iter().take(LONGEST_VERSION).collect();
            }
            HubFunction::Sign { key, signature } => update.sign(ImageSignature { key, bytes: signature })?,
            HubFunction::Chunk { offset, bytes } => update.chunk(offset, &bytes)?,
            HubFunction::FinishUpdate => update.finish()?,
            HubFunction::Restart => update.restart(motors_run)?,
            HubFunction::AbandonUpdate => update.abandon()?,
            _ => return Err(Nack::UNSUPPORTED),
        }
        Ok(Reply::ACK)
    }

    /// Hands the next request to the task. `None` if no request is pending, while the task is busy, and without a
    /// bootloader. The task must report the result to [`update_done`](Self::update_done).
    pub fn update_request(&mut self) -> Option<UpdateRequest> {
        self.update.as_mut()?.request()
    }

    /// Processes a report of the task `tasks::update`.
    pub fn update_done(&mut self, report: SlotReport) {
        if let Some(update) = &mut self.update {
            update.done(report);
        }
    }
}

fn report(update: &Update, version: &Text) -> UpdateReport {
    let ((received, length), slot) = (update.progress(), update.slot());
    UpdateReport {
        phase: update.phase(),
        outcome: update.outcome(),
        is_busy: update.is_busy(),
        booted: update.booted(),
        received,
        length,
        origin: slot.origin,
        capacity: slot.length,
        version: version.clone(),
    }
}
