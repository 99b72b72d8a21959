//! Limits for `f32` values.
//!
//! These functions are comparisons. `f32::max` and `f32::min` are calls of some 20 instructions on an FPU without
//! instructions for them. Here NaN becomes the limit.

/// Returns `value`, but not less than `least`. NaN becomes `least`.
pub(crate) const fn at_least(value: f32, least: f32) -> f32 {
    if value > least { value } else { least }
}

/// Returns `value`, but not more than `most`. NaN becomes `most`.
pub(crate) const fn at_most(value: f32, most: f32) -> f32 {
    if value < most { value } else { most }
}
