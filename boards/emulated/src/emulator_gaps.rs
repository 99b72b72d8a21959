//! Where the emulator did less than the chip would: a run with an entry here proves nothing.

use rigless::session::Session;

use crate::chip::Nucleo;

/// Everything that the emulator noted, in words.
pub(crate) fn gaps(session: &Session<Nucleo>) -> Vec<String> {
    let mut gaps = Vec::new();
    gaps.extend(session.unmapped().iter().map(ToString::to_string));
    gaps.extend(session.refused().iter().map(|(at, fault)| format!("refused {at:#x}: {fault}")));
    gaps.extend(session.unimplemented().iter().map(|(at, what)| format!("unimplemented {at:#x}: {what:?}")));
    gaps.extend(session.undefined().iter().map(|(at, what)| format!("undefined {at:#x}: {what:?}")));
    gaps.extend(session.unrouted().iter().map(|what| format!("unrouted {what:?}")));
    gaps.extend(session.told().map(|told| format!("told {told:?}")));
    gaps
}
