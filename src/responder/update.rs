//! New firmware: a host's requests, and the accesses to the flash that follow.

use super::Responder;
use crate::extension::HubFunction;
use crate::extension::state::UpdateReport;
use crate::hub::Snapshot;
use crate::protocol::payload::Text;
use crate::protocol::{Nack, Reply};
use crate::update::{Done, Seal, Slot, Update, UpdateRequest};

/// An update, and the announced version.
#[derive(Clone, Debug)]
pub(super) struct Updating {
    update: Update,
    version: Text,
}

/// The most bytes of a version that the hub reports.
const VERSION: usize = 40;

impl<const N: usize> Responder<N> {
    /// A responder of a hub with a bootloader that starts images from this slot.
    #[must_use]
    pub fn with_slot(self, slot: Slot) -> Self {
        Self { updating: Some(Updating { update: Update::new(slot), version: Text::default() }), ..self }
    }

    /// Executes a request about new firmware.
    pub(super) fn receive_update(
        &mut self,
        function: HubFunction,
        snapshot: &Snapshot<N>,
    ) -> Result<Reply, Nack> {
        let runs = !self.is_off(snapshot);
        let Updating { update, version } = self.updating.as_mut().ok_or(Nack::UNSUPPORTED)?;
        match function {
            HubFunction::Update => return Ok(Reply::data(&report(update, version))),
            HubFunction::BeginUpdate { length, crc, version: announced } => {
                update.begin(length, crc, runs)?;
                *version = announced.into_iter().take(VERSION).collect();
            }
            HubFunction::Sign { key, signature } => update.sign(Seal { key, signature })?,
            HubFunction::Chunk { offset, bytes } => update.chunk(offset, &bytes)?,
            HubFunction::FinishUpdate => update.finish()?,
            HubFunction::Restart => update.restart(runs)?,
            HubFunction::AbandonUpdate => update.abandon()?,
            _ => return Err(Nack::UNSUPPORTED),
        }
        Ok(Reply::ACK)
    }

    /// The next access to the slot, if there is one; [`update_done`](Self::update_done) reports its result.
    pub fn update_request(&mut self) -> Option<UpdateRequest> {
        self.updating.as_mut()?.update.request()
    }

    /// Takes the result of an access to the slot.
    pub fn update_done(&mut self, done: Done) {
        if let Some(Updating { update, .. }) = &mut self.updating {
            update.done(done);
        }
    }
}

fn report(update: &Update, version: &Text) -> UpdateReport {
    let ((received, length), slot) = (update.progress(), update.slot());
    UpdateReport {
        phase: update.phase(),
        outcome: update.outcome(),
        at_work: update.at_work(),
        booted: update.booted(),
        received,
        length,
        origin: slot.origin,
        capacity: slot.length,
        version: version.clone(),
    }
}
