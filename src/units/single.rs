//! Limits for `f32` values.
//!
//! Each function is one comparison, and returns the limit for NaN. `f32::max` and `f32::min` are not used. An FPU
//! without minimum and maximum instructions, as in a Cortex-M4, needs some 20 instructions for each of these functions.

/// Returns `value`, but not less than `least`. NaN becomes `least`.
pub(crate) const fn at_least(value: f32, least: f32) -> f32 {
    if value > least { value } else { least }
}

/// Returns `value`, but not more than `most`. NaN becomes `most`.
pub(crate) const fn at_most(value: f32, most: f32) -> f32 {
    if value < most { value } else { most }
}
