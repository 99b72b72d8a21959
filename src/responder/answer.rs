//! What a request that is not refused is answered.

use crate::protocol::fields::{Field, Payload};

/// What a request that is not refused is answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Done.
    Ack,
    /// What was asked for.
    Data(Payload),
}

impl Answer {
    pub(super) fn data(of: &impl Field) -> Self {
        let mut payload = Payload::new();
        of.write(&mut payload);
        Self::Data(payload)
    }
}
