//! Sequence numbers of commands, which count since boot and wrap at 2^32.

/// True if the command `number` is the command `newest` or an older command. Numbers wrap, so `number` counts as older
/// if it is less than 2^31 behind `newest`.
///
/// ```
/// use motor_hub::units::is_included;
///
/// assert!(is_included(7, 7) && is_included(7, 8) && !is_included(8, 7));
/// // The number after 2^32 - 1 is 0.
/// assert!(is_included(u32::MAX, 0) && !is_included(0, u32::MAX));
/// ```
pub const fn is_included(number: u32, newest: u32) -> bool {
    newest.wrapping_sub(number) < 1 << 31
}
