//! Random bytes on the line.

use crate::host::{Event, HUB, frame_to, survive};
use proptest::collection::vec;
use proptest::prelude::*;

/// Packet types: mostly types that exist, and some that do not.
fn id() -> impl Strategy<Value = u16> {
    prop_oneof![0x7F00u16..=0x7F10, 0x1000u16..=0x103F, 0x4D00u16..=0x4D02, 0x4D15u16..=0x4D1B, any::<u16>()]
}

fn frame() -> impl Strategy<Value = Vec<u8>> {
    let destination = prop_oneof![8 => Just(HUB), 1 => Just(255), 1 => any::<u8>()];
    // Small numbers are in range more often.
    let payload = vec(prop_oneof![0u8..4, any::<u8>()], 0..40);
    (destination, any::<u8>(), id(), payload)
        .prop_map(|(to, number, id, payload)| frame_to(to, number, id, &payload))
}

/// A frame with a damaged byte, or cut short.
fn damaged() -> impl Strategy<Value = Vec<u8>> {
    (frame(), any::<prop::sample::Index>(), 1u8.., any::<bool>()).prop_map(|(mut frame, at, flip, cut)| {
        let at = at.index(frame.len());
        if cut {
            frame.truncate(at);
        } else {
            frame[at] ^= flip;
        }
        frame
    })
}

fn noise() -> impl Strategy<Value = Vec<u8>> {
    // Start bytes and short lengths are frequent, because they may mislead the decoder.
    let byte = prop_oneof![2 => Just(0x44), 2 => Just(0x4B), 1 => 0u8..20, 4 => any::<u8>()];
    vec(byte, 0..200)
}

fn event() -> impl Strategy<Value = Event> {
    let bytes = prop_oneof![4 => frame(), 2 => damaged(), 2 => noise()];
    prop_oneof![
        8 => (bytes, 1usize..200).prop_map(|(bytes, piece)| Event::Bytes(bytes, piece)),
        1 => (0u16..3000).prop_map(Event::Pause),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_stream_enables_a_motor_without_set_enable_or_blocks_the_hub(events in vec(event(), 0..30)) {
        survive(&events);
    }
}
