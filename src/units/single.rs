//! Numbers in single precision, within bounds.
//!
//! Comparisons, where `f32::max` and `f32::min` are calls of some 20 instructions each on an FPU that has neither; and
//! what comes of no number is the bound.

/// The greater one.
pub(crate) const fn at_least(value: f32, least: f32) -> f32 {
    if value > least { value } else { least }
}

/// The smaller one.
pub(crate) const fn at_most(value: f32, most: f32) -> f32 {
    if value < most { value } else { most }
}
