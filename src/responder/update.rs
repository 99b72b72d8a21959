//! New firmware: a host's requests, and the accesses to the flash that follow.

use super::Responder;
use crate::extension::HubFunction;
use crate::extension::state::UpdateReport;
use crate::hub::Snapshot;
use crate::protocol::payload::Text;
use crate::protocol::{Nack, Reply};
use crate::update::{Done, Refusal, Seal, Slot, Update, UpdateRequest};

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
        let done = match function {
            HubFunction::Update => return Ok(Reply::data(&report(update, version))),
            HubFunction::BeginUpdate { length, crc, version: announced } => {
                let begun = update.begin(length, crc, runs);
                if begun.is_ok() {
                    let bytes = announced.bytes();
                    *version = Text::new(bytes.get(..VERSION).unwrap_or(bytes)).unwrap_or_default();
                }
                begun
            }
            HubFunction::Sign { key, signature } => update.sign(Seal { key, signature }),
            HubFunction::Chunk { offset, bytes } => update.chunk(offset, bytes.bytes()),
            HubFunction::FinishUpdate => update.finish(),
            HubFunction::Restart => update.restart(runs),
            HubFunction::AbandonUpdate => update.abandon(),
            _ => return Err(Nack::UNSUPPORTED),
        };
        done.map(|()| Reply::ACK).map_err(nack)
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

const fn nack(refusal: Refusal) -> Nack {
    match refusal {
        Refusal::MotorEnabled => Nack::MOTOR_ENABLED,
        Refusal::AtWork => Nack::UPDATE_BUSY,
        Refusal::OnTrial => Nack::UPDATE_ON_TRIAL,
        Refusal::Armed => Nack::UPDATE_ARMED,
        Refusal::Length => Nack::UPDATE_TOO_LONG,
        Refusal::NotBegun => Nack::UPDATE_NOT_BEGUN,
        Refusal::Gap => Nack::UPDATE_GAP,
        Refusal::NotAnImage => Nack::UPDATE_NOT_AN_IMAGE,
        Refusal::NotArmed => Nack::UPDATE_NOT_ARMED,
        Refusal::Unsigned => Nack::UPDATE_UNSIGNED,
        Refusal::OtherKey => Nack::UPDATE_OTHER_KEY,
        Refusal::NoSigner => Nack::UPDATE_NO_SIGNER,
        Refusal::ChunkLength => Nack::parameter(1),
    }
}
