//! The states of a motor's encoder.

use super::ranges;
use super::tables::{EncoderTable, EncoderWord};
use crate::encoder::{Encoder, Wire};
use crate::scenario::mistake::{Checked, Mistake, fault};
use std::num::NonZeroU32;
use toml::Spanned;

/// A glitch lasts for up to 0.5 us.
const MOST_GLITCHES: u32 = 100_000;
const MOST_SLOTS: u32 = 10_000;

/// One of a word, a rate of glitches, a number of slots.
pub(super) fn check(table: &EncoderTable, whole: &Spanned<EncoderTable>) -> Checked<Encoder> {
    let number = |value, key, most| {
        let checked = ranges::whole(value, key, 1..=most)?;
        Ok(NonZeroU32::new(checked).unwrap_or(NonZeroU32::MIN))
    };
    match (table.is, &table.glitches_per_s, &table.slot_missing_of) {
        (Some(word), None, None) => Ok(named(word)),
        (None, Some(rate), None) => {
            number(rate, "glitches_per_s", MOST_GLITCHES).map(|per_second| Encoder::Glitches { per_second })
        }
        (None, None, Some(of)) => {
            number(of, "slot_missing_of", MOST_SLOTS).map(|of| Encoder::MissingSlot { of })
        }
        _ => Err(fault(whole, Mistake::EncoderKind)),
    }
}

fn named(word: EncoderWord) -> Encoder {
    let stuck = |wire, high| Encoder::Stuck { wire, high };
    match word {
        EncoderWord::Sound => Encoder::Sound,
        EncoderWord::Reversed => Encoder::Reversed,
        EncoderWord::Unplugged => Encoder::Unplugged,
        EncoderWord::ALow => stuck(Wire::A, false),
        EncoderWord::AHigh => stuck(Wire::A, true),
        EncoderWord::BLow => stuck(Wire::B, false),
        EncoderWord::BHigh => stuck(Wire::B, true),
        EncoderWord::ALoose => Encoder::Loose { wire: Wire::A },
        EncoderWord::BLoose => Encoder::Loose { wire: Wire::B },
    }
}
