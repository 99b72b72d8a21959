//! Sends random events to the decoder and the responder. The checked property is that of
//! `tests/responder/properties.rs`: no motor is enabled without a request, and the hub still answers.
//!
//! The input is a script of events. An event has a byte for its kind, a byte for its length, and then its bytes. Some
//! kinds make whole frames, because a fuzzer cannot guess a checksum.
#![no_main]

#[path = "../../tests/responder/host.rs"]
mod host;

use libfuzzer_sys::fuzz_target;
use host::{Event, HUB, frame_to, survive};

/// The next event of the script; `None` at its end.
fn event(script: &mut &[u8]) -> Option<Event> {
    let (&[kind, amount], rest) = script.split_first_chunk()?;
    let (bytes, rest) = rest.split_at_checked(amount.into()).unwrap_or((rest, &[]));
    let frame = |destination| {
        let (&[number, family, low], payload) = bytes.split_first_chunk()?;
        let family = [0x10, 0x7F, 0x10, 0x4D][usize::from(family & 3)];
        Some(frame_to(destination, number, u16::from_be_bytes([family, low & 0x3F]), payload))
    };
    let piece = usize::from(kind >> 3) + 1;
    let event = match kind & 7 {
        0 => {
            // A pause has no further bytes, so the bytes after its first two bytes stay in the script.
            *script = script.get(2..)?;
            return Some(Event::Pause(u16::from(amount) * 20));
        }
        1 | 2 => Event::Bytes(bytes.to_vec(), piece),
        3 => Event::Bytes(frame(255)?, piece),
        4 => {
            let mut damaged = frame(HUB)?;
            damaged.truncate(damaged.len() - 1);
            Event::Bytes(damaged, piece)
        }
        _ => Event::Bytes(frame(HUB)?, piece),
    };
    *script = rest;
    Some(event)
}

fuzz_target!(|script: &[u8]| {
    let mut script = script;
    let events: Vec<Event> = std::iter::from_fn(|| event(&mut script)).collect();
    survive(&events);
});
