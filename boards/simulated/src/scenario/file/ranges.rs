//! Numbers, times and names of a scenario file: checked, or refused where they stand.

use crate::scenario::definition::Timed;
use crate::scenario::mistake::{Checked, Mistake, fault};
use serde::de::{Deserialize, Deserializer, Error, Unexpected, Visitor};
use std::fmt::{self, Formatter};
use std::ops::RangeInclusive;
use toml::Spanned;

/// In counts per second, ten times what any known motor does.
pub(super) const FASTEST_CPS: i32 = 1_000_000;
/// In counts/s², which takes a motor to that in a millisecond.
pub(super) const HARDEST_CPS2: u32 = 1_000_000_000;

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
pub(super) fn within(value: &Spanned<f64>, key: &'static str, range: RangeInclusive<f64>) -> Checked<f64> {
    let number = *value.get_ref();
    if range.contains(&number) {
        return Ok(number);
    }
    let (low, high) = range.into_inner();
    Err(fault(value, Mistake::OutOfRange { key, value: number, low, high }))
}

/// A whole number of the file, of any size; [`whole`] says what is allowed.
#[derive(Clone, Copy)]
pub(super) struct Whole(i64);

impl<'de> Deserialize<'de> for Whole {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Number;
        impl Visitor<'_> for Number {
            type Value = Whole;

            fn expecting(&self, f: &mut Formatter<'_>) -> fmt::Result {
                f.write_str("a whole number")
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<Whole, E> {
                Ok(Whole(number))
            }

            /// As 1e3, too; too large ones stay too large.
            fn visit_f64<E: Error>(self, number: f64) -> Result<Whole, E> {
                if number.fract() == 0.0 || number.is_infinite() {
                    Ok(Whole(number as i64))
                } else {
                    Err(E::invalid_type(Unexpected::Float(number), &self))
                }
            }
        }
        deserializer.deserialize_any(Number)
    }
}

/// As [`within`], of a whole number.
pub(super) fn whole<T>(value: &Spanned<Whole>, key: &'static str, range: RangeInclusive<T>) -> Checked<T>
where
    T: Into<i64> + TryFrom<i64>,
{
    let Whole(number) = *value.get_ref();
    let (low, high) = range.into_inner();
    let (low, high): (i64, i64) = (low.into(), high.into());
    let allowed = Some(number).filter(|number| (low..=high).contains(number));
    allowed.and_then(|number| T::try_from(number).ok()).ok_or_else(|| {
        let [number, low, high] = [number, low, high].map(|number| number as f64);
        fault(value, Mistake::OutOfRange { key, value: number, low, high })
    })
}

/// As [`whole`], with a value for when it is absent.
pub(super) fn whole_or<T>(
    value: &Option<Spanned<Whole>>,
    key: &'static str,
    range: RangeInclusive<T>,
    absent: T,
) -> Checked<T>
where
    T: Into<i64> + TryFrom<i64>,
{
    value.as_ref().map_or(Ok(absent), |value| whole(value, key, range))
}

/// As [`within`], 0 when absent.
pub(super) fn optional(
    value: &Option<Spanned<f64>>,
    key: &'static str,
    range: RangeInclusive<f64>,
) -> Checked<f64> {
    value.as_ref().map_or(Ok(0.0), |value| within(value, key, range))
}
