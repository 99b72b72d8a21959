//! Numbers, times and names of a scenario file: checked, or refused where they stand.

use crate::scenario::definition::Timed;
use crate::scenario::mistake::{Checked, Mistake, fault};
use std::ops::RangeInclusive;
use toml::Spanned;

/// In counts per second, ten times what any known motor does.
pub(super) const FASTEST_CPS: i64 = 1_000_000;
/// In counts/s², which takes a motor to that in a millisecond.
pub(super) const HARDEST_CPS2: i64 = 1_000_000_000;

/// Checks a list of things that happen: each after the one before, within the run.
pub(super) fn timeline<F, T>(
    entries: &[Spanned<F>],
    duration_s: f64,
    at: impl Fn(&F) -> &Spanned<f64>,
    check: impl Fn(&F, &Spanned<F>) -> Checked<T>,
) -> Checked<Vec<Timed<T>>> {
    let mut timed: Vec<Timed<T>> = Vec::with_capacity(entries.len());
    for entry in entries {
        let time = at(entry.get_ref());
        let at_s = *time.get_ref();
        // Written so that a value that is not a number fails too.
        if !(0.0..=duration_s).contains(&at_s) {
            return Err(fault(time, Mistake::OutsideRun { at_s, duration_s }));
        }
        if let Some(last) = timed.last().filter(|last| last.at_s >= at_s) {
            return Err(fault(time, Mistake::NotAfter { at_s, last_s: last.at_s }));
        }
        timed.push(Timed { at_s, value: check(entry.get_ref(), entry)? });
    }
    Ok(timed)
}

pub(super) fn named(text: &Spanned<String>, key: &'static str) -> Checked<String> {
    let name = text.get_ref().trim();
    let printable = !name.is_empty() && name.len() <= 80 && !name.chars().any(char::is_control);
    if printable { Ok(name.to_owned()) } else { Err(fault(text, Mistake::Name(key))) }
}

/// Not a number is in no range.
pub(super) fn within<T>(value: &Spanned<T>, key: &'static str, range: RangeInclusive<T>) -> Checked<T>
where
    T: Copy + PartialOrd + ToFloat,
{
    let number = *value.get_ref();
    if range.contains(&number) {
        return Ok(number);
    }
    let [value_as, low, high] = [number, *range.start(), *range.end()].map(ToFloat::to_float);
    Err(fault(value, Mistake::OutOfRange { key, value: value_as, low, high }))
}

/// A number of the file, for messages.
pub(super) trait ToFloat {
    fn to_float(self) -> f64;
}

impl ToFloat for f64 {
    fn to_float(self) -> f64 {
        self
    }
}

impl ToFloat for i64 {
    fn to_float(self) -> f64 {
        self as f64
    }
}

/// As [`within`], 0 when absent.
pub(super) fn optional(
    value: &Option<Spanned<f64>>,
    key: &'static str,
    range: RangeInclusive<f64>,
) -> Checked<f64> {
    value.as_ref().map_or(Ok(0.0), |value| within(value, key, range))
}
