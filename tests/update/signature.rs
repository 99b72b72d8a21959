//! Signed images are armed if the signature is valid. Signatures are made by OpenSSL and by our own code.

use crate::power::{Chip, Code, slots};
use embassy_futures::block_on;
use motor_hub::update::{Booted, CHUNK, CRC, Outcome, Seal, public_key};
use proptest::prelude::*;
use salty::{Keypair, Sha512};
use std::cell::Cell;
use std::future::{Future, poll_fn, ready};
use std::pin::pin;
use std::task::{Context, Poll, Waker};

/// Made by OpenSSL 3.0 as the client's help says, of the bytes below.
const KEY: &[u8] = include_bytes!("signed/public.der");
const SIGNATURE: &[u8; 64] = include_bytes!("signed/image.sig");

/// 1000 bytes: 0, 1, 2, ... 255, 0, ...
fn image() -> Vec<u8> {
    (0..1000_u32).map(|byte| byte as u8).collect()
}

/// Sends an image with a seal. Returns the outcome, and what the bootloader would start.
fn sent(image: &[u8], seal: Option<Seal>) -> (Outcome, Booted) {
    let chip = Chip::new(Code::Detects);
    let mut slots = slots(&chip);
    for (at, bytes) in (0..).step_by(CHUNK).zip(image.chunks(CHUNK)) {
        assert_eq!(block_on(slots.write(at, bytes)), Outcome::Done);
    }
    let outcome = block_on(slots.arm(image.len() as u32, CRC.checksum(image), seal, ready(())));
    // An armed image is on trial after a reset.
    (outcome, block_on(slots.booted()))
}

fn seal(signature: [u8; 64]) -> Seal {
    Seal { key: public_key(KEY).expect("a key"), signature }
}

const ARMED: (Outcome, Booted) = (Outcome::Done, Booted::OnTrial);
const REFUSED: (Outcome, Booted) = (Outcome::WrongSignature, Booted::Confirmed);

#[test]
fn an_image_that_openssl_has_signed_is_armed() {
    assert_eq!(sent(&image(), Some(seal(*SIGNATURE))), ARMED);
}

#[test]
fn an_image_or_signature_with_a_bit_turned_is_not_armed() {
    for bit in 0..512 {
        let mut signature = *SIGNATURE;
        signature[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(sent(&image(), Some(seal(signature))), REFUSED, "bit {bit} of the signature");
    }
    for at in [0, 95, 96, 500, 999] {
        let mut image = image();
        image[at] ^= 0x10;
        assert_eq!(sent(&image, Some(seal(*SIGNATURE))), REFUSED, "byte {at} of the image");
    }
    // A shortened image is refused.
    assert_eq!(sent(&image()[..999], Some(seal(*SIGNATURE))), REFUSED);
}

#[test]
fn another_key_signs_nothing() {
    let other = Keypair::from(&[3; 32]);
    let mut hash = Sha512::new();
    hash.update(&image());
    let signature = other.sign(&hash.finalize()).to_bytes();
    assert_eq!(sent(&image(), Some(seal(signature))), REFUSED);
    let key = other.public.to_bytes();
    assert_eq!(sent(&image(), Some(Seal { key, signature })), ARMED, "it is that one's own");
    // The key is no point of the curve.
    assert_eq!(sent(&image(), Some(Seal { key: [2; 32], signature })), REFUSED);
}

#[test]
fn nothing_is_armed_before_it_is_calm() {
    let chip = Chip::new(Code::Detects);
    let mut slots = slots(&chip);
    for (at, bytes) in (0..).step_by(CHUNK).zip(image().chunks(CHUNK)) {
        assert_eq!(block_on(slots.write(at, bytes)), Outcome::Done);
    }
    let (seal, calm) = (Some(seal(*SIGNATURE)), Cell::new(false));
    let until_calm = poll_fn(|_| if calm.get() { Poll::Ready(()) } else { Poll::Pending });
    {
        let mut arm = pin!(slots.arm(1000, CRC.checksum(&image()), seal, until_calm));
        let mut context = Context::from_waker(Waker::noop());
        // Each chunk gives other tasks a turn.
        assert!((0..100).all(|_| arm.as_mut().poll(&mut context).is_pending()));
        calm.set(true);
        assert_eq!(block_on(arm), Outcome::Done);
    }
    assert_eq!(block_on(slots.booted()), Booted::OnTrial);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_bytes_are_no_signature_and_do_no_harm(key: [u8; 32], halves: [[u8; 32]; 2]) {
        let signature = halves.concat().try_into().expect("64 bytes");
        prop_assert_eq!(sent(&image(), Some(Seal { key, signature })), REFUSED);
        prop_assert_eq!(sent(&image(), Some(seal(signature))), REFUSED);
    }
}
