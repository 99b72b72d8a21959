//! What every kind of line between a served hub and its hosts can do.

use std::fmt::Debug;

/// One kind of line. The methods of [`Line`](super::line::Line) call the methods of the same name.
pub(super) trait HostLine: Debug + Send {
    fn receive(&mut self, bytes: &mut [u8]) -> usize;
    fn send(&mut self, bytes: &[u8]) -> usize;
    fn is_taken(&self) -> bool;
    fn rejected_hosts(&self) -> u32 {
        0
    }
    /// The path or address that hosts open.
    fn address(&self) -> String;
}
