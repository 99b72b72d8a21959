//! New firmware: what a host asks for, and what of it whoever has the slot is to do.

use super::{Answer, Responder};
use crate::hub::Snapshot;
use crate::protocol::Nack;
use crate::protocol::fields::Text;
use crate::protocol::update::{ToUpdate, UpdateReport};
use crate::update::{Done, Order, Refusal, Seal, Slot, Update};

/// An update, and the version that was announced.
#[derive(Clone, Debug)]
pub(super) struct Updating {
    update: Update,
    version: Text,
}

/// The most bytes of a version that are kept.
const VERSION: usize = 40;

impl<const N: usize> Responder<N> {
    /// There is a bootloader, which starts images from this slot.
    #[must_use]
    pub fn with_slot(self, slot: Slot) -> Self {
        Self { updating: Some(Updating { update: Update::new(slot), version: Text::default() }), ..self }
    }

    /// Does what a request says.
    pub(super) fn receive_update(
        &mut self,
        request: ToUpdate,
        snapshot: &Snapshot<N>,
    ) -> Result<Answer, Nack> {
        let runs = !self.is_off(snapshot);
        let Updating { update, version } = self.updating.as_mut().ok_or(Nack::UNSUPPORTED)?;
        let done = match request {
            ToUpdate::State => return Ok(Answer::data(&report(update, version))),
            ToUpdate::Begin { length, crc, version: announced } => {
                let begun = update.begin(length, crc, runs);
                if begun.is_ok() {
                    let bytes = announced.bytes();
                    *version = Text::new(bytes.get(..VERSION).unwrap_or(bytes)).unwrap_or_default();
                }
                begun
            }
            ToUpdate::Sign { key, signature } => update.sign(Seal { key, signature }),
            ToUpdate::Chunk { offset, bytes } => update.chunk(offset, bytes.bytes()),
            ToUpdate::Finish => update.finish(),
            ToUpdate::Restart => update.restart(runs),
            ToUpdate::Abandon => update.abandon(),
        };
        done.map(|()| Answer::Ack).map_err(nack)
    }

    /// What whoever has the slot is to do, if anything; [`update_done`](Self::update_done) when that has been.
    pub fn update_order(&mut self) -> Option<Order> {
        self.updating.as_mut()?.update.order()
    }

    /// Whoever has the slot says something.
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
        Refusal::AtWork => Nack::UPDATE_AT_WORK,
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
