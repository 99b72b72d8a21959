//! Gaps of the emulator: actions of a real chip that the emulator does not model. A run with a gap proves nothing.

use rigless::session::Session;

use crate::chip::Nucleo;

/// Returns a text for each gap that the emulator has noted.
pub(crate) fn gaps(session: &Session<Nucleo>) -> Vec<String> {
    let mut gaps = Vec::new();
    gaps.extend(session.unmapped().iter().map(ToString::to_string));
    gaps.extend(session.refused().iter().map(|(at, fault)| format!("refused {at:#x}: {fault}")));
    gaps.extend(session.unimplemented().iter().map(|(at, what)| format!("unimplemented {at:#x}: {what:?}")));
    gaps.extend(session.undefined().iter().map(|(at, what)| format!("undefined {at:#x}: {what:?}")));
    gaps.extend(session.unrouted().iter().map(|what| format!("unrouted {what:?}")));
    gaps.extend(session.told().map(|told| format!("reported by a model {told:?}")));
    gaps
}
