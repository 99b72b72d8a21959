//! Packets are found among any other bytes on the line.

use crate::host::{TestHost, bytes_of, decode, frame_to};
use motor_hub::protocol::frame::{LONGEST, TIMEOUT_MICROS};
use motor_hub::protocol::payload::PAYLOAD_KEPT;
use motor_hub::protocol::{Decoder, Packet};
use motor_hub::units::Micros;

const KEEP_ALIVE: u16 = 0x7F04;
const NONE: [u8; 0] = [];

fn keep_alive(number: u8) -> Vec<u8> {
    frame_to(3, number, KEEP_ALIVE, &[])
}

/// Message numbers of the packets found.
fn found(decoder: &mut Decoder, mut bytes: &[u8], at: u64) -> Vec<u8> {
    std::iter::from_fn(|| decoder.next(&mut bytes, Micros::new(at))).map(|packet| packet.number).collect()
}

#[test]
fn a_packet_may_come_byte_by_byte_and_several_at_once() {
    let mut decoder = Decoder::new();
    for (index, byte) in keep_alive(7).iter().enumerate() {
        let expected: &[u8] = if index == 10 { &[7] } else { &[] };
        assert_eq!(found(&mut decoder, &[*byte], index as u64 * 1000), expected);
    }
    let many: Vec<u8> = (1..=20).flat_map(keep_alive).collect();
    for split in 0..many.len() {
        let mut decoder = Decoder::new();
        let mut numbers = found(&mut decoder, &many[..split], 0);
        numbers.extend(found(&mut decoder, &many[split..], 10));
        assert_eq!(numbers, (1..=20).collect::<Vec<_>>());
    }
}

#[test]
fn a_packet_with_any_damaged_byte_is_ignored() {
    let good = bytes_of("44 4b 0d 00 03 00 07 00 0a 10 00 01 c1");
    for index in 0..good.len() {
        for bit in 0..8 {
            let mut bad = good.clone();
            bad[index] ^= 1 << bit;
            let mut host = TestHost::new();
            assert!(host.send(&bad).is_empty(), "byte {index} bit {bit}");
            // If the damage has enlarged the length, the decoder still waits for the rest of the frame.
            host.wait_ms(51);
            assert!(host.send(&[]).is_empty());
            assert_eq!(host.send(&keep_alive(1)).len(), 1);
        }
    }
}

#[test]
fn stray_start_bytes_and_impossible_lengths_and_a_bad_frame_do_not_hide_or_delay_a_packet() {
    let strays = ["44", "44 44", "44 44 44 44", "4b", "44 4b", "44 4b 44", "44 4b 44 4b", "4b 44 44"];
    let lengths = [0, 1, 10, LONGEST as u16 + 1, 0x4B44, u16::MAX].map(u16::to_le_bytes);
    let frames = lengths.map(|length| [[0x44, 0x4B], length].concat());
    for mut bytes in strays.map(bytes_of).into_iter().chain(frames) {
        bytes.extend(keep_alive(5));
        assert_eq!(found(&mut Decoder::new(), &bytes, 0), [5], "{bytes:x?}");
    }
    // The packets are within a bad frame.
    let bytes = [bytes_of("44 4b 30 00 03 00 01"), keep_alive(1), keep_alive(2), vec![0xEE; 19]].concat();
    assert_eq!(found(&mut Decoder::new(), &bytes, 0), [1, 2]);
}

#[test]
fn a_packet_within_an_unfinished_frame_is_found_after_the_time_out() {
    let mut bytes = bytes_of("44 4b 00 02 03");
    bytes.extend(keep_alive(1));
    let mut decoder = Decoder::new();
    assert_eq!(found(&mut decoder, &bytes, 0), NONE);
    assert_eq!(decoder.deadline(), Some(Micros::new(TIMEOUT_MICROS)));
    assert_eq!(found(&mut decoder, &[], TIMEOUT_MICROS - 1), NONE);
    assert_eq!(found(&mut decoder, &[], TIMEOUT_MICROS), [1]);
    assert_eq!(decoder.deadline(), None);
}

#[test]
fn an_unfinished_frame_is_dropped_50_ms_after_its_first_byte() {
    let packet = keep_alive(1);
    for (gap, expected) in [(TIMEOUT_MICROS - 1, &[1u8][..]), (TIMEOUT_MICROS, &[])] {
        let mut decoder = Decoder::new();
        assert_eq!(found(&mut decoder, &packet[..2], 0), NONE);
        assert_eq!(found(&mut decoder, &packet[2..8], 40_000), NONE);
        assert_eq!(found(&mut decoder, &packet[8..], gap), expected, "{gap}");
        assert_eq!(found(&mut decoder, &keep_alive(2), gap + TIMEOUT_MICROS), [2]);
    }
}

#[test]
fn after_a_pause_no_older_bytes_delay_a_packet() {
    // Several valid beginnings of frames. The length of each frame is larger than the number of bytes that follow.
    let beginnings: Vec<u8> = bytes_of("44 4b 00 01 03 00 44").repeat(30);
    let mut decoder = Decoder::new();
    assert_eq!(found(&mut decoder, &beginnings, 0), NONE);
    assert_eq!(found(&mut decoder, &keep_alive(9), TIMEOUT_MICROS), [9]);
}

#[test]
fn a_full_buffer_of_unfinished_frames_is_dropped() {
    let mut bytes = bytes_of("44 4b 58 02 03 00 01 00").repeat(400);
    bytes.extend(keep_alive(3));
    let mut decoder = Decoder::new();
    let mut numbers = found(&mut decoder, &bytes, 0);
    numbers.extend(found(&mut decoder, &[], TIMEOUT_MICROS));
    assert_eq!(numbers, [3]);
}

#[test]
fn the_longest_payloads_of_hosts_are_read_without_their_ends() {
    let payload: Vec<u8> = (0..512).map(|byte| byte as u8).collect();
    let Packet { payload: kept, number, .. } = decode(&frame_to(3, 8, 0x1000, &payload));
    assert_eq!((number, kept.as_slice()), (8, &payload[..PAYLOAD_KEPT]));
    let longest = frame_to(3, 9, 0x1000, &vec![0x44; LONGEST - 11]);
    assert_eq!(found(&mut Decoder::new(), &longest, 0), [9]);
}
