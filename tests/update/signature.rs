//! Signed images are armed if the signature is valid. Signatures are made by OpenSSL and by our own code.

use crate::power::{ACTIVE, Chip, DOWNLOAD, Part, STATE, WORD, new_chip, send, slots};
use crate::torn_flash::Code;
use embassy_futures::block_on;
use motor_hub::tasks::update::{StateFlash, discard_refused_swap};
use motor_hub::update::{Booted, CRC, ImageSignature, Outcome, ROLLBACK_VERSION_AT, public_key};
use proptest::prelude::*;
use salty::{Keypair, Sha512};
use std::cell::{Cell, RefCell};
use std::future::{Future, poll_fn, ready};
use std::pin::pin;
use std::task::{Context, Poll, Waker};

/// A public key, and a signature of the bytes of [`image`]. Both were made by OpenSSL 3.0 as the client's help says.
const KEY: &[u8] = include_bytes!("signed/public.der");
const SIGNATURE: &[u8; 64] = include_bytes!("signed/image.sig");

/// 1000 bytes: 0, 1, 2, ... 255, 0, ...
fn image() -> Vec<u8> {
    (0..1000_u32).map(|byte| byte as u8).collect()
}

/// A chip whose firmware has this rollback version.
fn chip(version: u32) -> RefCell<Chip> {
    let chip = new_chip(Code::Detects);
    chip.borrow_mut().put(ACTIVE.start + ROLLBACK_VERSION_AT as usize, &version.to_le_bytes());
    chip
}

/// Sends an image with a seal. Returns the outcome, and what the bootloader would start.
fn sent_to(chip: &RefCell<Chip>, image: &[u8], seal: Option<ImageSignature>) -> (Outcome, Booted) {
    let mut slots = slots(chip);
    assert_eq!(send(&mut slots, image), Outcome::Done);
    let outcome = block_on(slots.arm(image.len() as u32, CRC.checksum(image), seal, ready(())));
    // An armed image is on trial after a reset.
    (outcome, block_on(slots.booted()))
}

/// Sends an image to a chip whose firmware is not newer.
fn sent(image: &[u8], seal: Option<ImageSignature>) -> (Outcome, Booted) {
    sent_to(&chip(0), image, seal)
}

fn seal(signature: [u8; 64]) -> ImageSignature {
    ImageSignature { key: public_key(KEY).expect("a key"), bytes: signature }
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
    let ImageSignature { key, bytes: signature } = sealed(&image());
    assert_eq!(sent(&image(), Some(seal(signature))), REFUSED);
    assert_eq!(
        sent(&image(), Some(ImageSignature { key, bytes: signature })),
        ARMED,
        "the key of its own seal"
    );
    // The key is no point of the curve.
    assert_eq!(sent(&image(), Some(ImageSignature { key: [2; 32], bytes: signature })), REFUSED);
}

#[test]
fn nothing_is_armed_before_it_is_calm() {
    let chip = chip(0);
    let mut slots = slots(&chip);
    assert_eq!(send(&mut slots, &image()), Outcome::Done);
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

/// Signs an image by a key of our own.
fn sealed(image: &[u8]) -> ImageSignature {
    let keys = Keypair::from(&[3; 32]);
    let mut hash = Sha512::new();
    hash.update(image);
    ImageSignature { key: keys.public.to_bytes(), bytes: keys.sign(&hash.finalize()).to_bytes() }
}

/// A signed image with this rollback version.
fn versioned(version: u32) -> (Vec<u8>, ImageSignature) {
    let mut image = image();
    image[ROLLBACK_VERSION_AT as usize..][..4].copy_from_slice(&version.to_le_bytes());
    let seal = sealed(&image);
    (image, seal)
}

/// What a bootloader with this key would start.
fn checked(chip: &RefCell<Chip>, key: [u8; 32]) -> Booted {
    let [mut active, mut download] = [ACTIVE, DOWNLOAD].map(|part| Part(chip, part));
    let mut state = StateFlash(Part(chip, STATE));
    block_on(discard_refused_swap(&mut active, &mut download, &mut state, key)).expect("a flash");
    block_on(slots(chip).booted())
}

#[test]
fn a_signed_image_that_is_older_than_the_firmware_is_not_armed() {
    for (present, new, armed) in
        [(0, 0, true), (0, 7, true), (7, 7, true), (7, 6, false), (u32::MAX, 0, false)]
    {
        let (image, seal) = versioned(new);
        let expected = if armed { ARMED } else { (Outcome::Older, Booted::Confirmed) };
        assert_eq!(sent_to(&chip(present), &image, Some(seal)), expected, "{new} over {present}");
    }
    // The bytes after the signed bytes are not used as a version.
    let short = &image()[..32];
    assert_eq!(sent_to(&chip(1), short, Some(sealed(short))), (Outcome::Older, Booted::Confirmed));
    // Bytes with a wrong signature have no version.
    let (image, _) = versioned(6);
    assert_eq!(sent_to(&chip(7), &image, Some(seal(*SIGNATURE))), REFUSED);
}

#[test]
fn a_bootloader_with_a_key_swaps_in_only_what_the_key_has_signed() {
    let (image, seal) = versioned(7);
    let armed = || {
        let chip = chip(7);
        assert_eq!(sent_to(&chip, &image, Some(seal)), ARMED);
        chip
    };
    assert_eq!(checked(&chip(7), seal.key), Booted::Confirmed, "nothing is armed");
    assert_eq!(checked(&armed(), seal.key), Booted::OnTrial);
    assert_eq!(checked(&armed(), public_key(KEY).expect("a key")), Booted::Reverted, "another key");
    // A hub without a key has armed an image without a signature.
    let unsigned = chip(7);
    assert_eq!(sent_to(&unsigned, &image, None), ARMED);
    assert_eq!(checked(&unsigned, seal.key), Booted::Reverted);
    // The bootloader refuses an armed image that has changed since, and one that is older than the present firmware.
    for at in [0, 40, 999] {
        let turned = armed();
        turned.borrow_mut().bytes[DOWNLOAD.start + at] ^= 1;
        assert_eq!(checked(&turned, seal.key), Booted::Reverted, "byte {at}");
    }
    let newer = armed();
    newer.borrow_mut().put(ACTIVE.start + ROLLBACK_VERSION_AT as usize, &8_u32.to_le_bytes());
    assert_eq!(checked(&newer, seal.key), Booted::Reverted);
}

#[test]
fn a_swap_that_has_begun_is_not_checked_again() {
    let (image, seal) = versioned(7);
    let chip = chip(7);
    assert_eq!(sent_to(&chip, &image, Some(seal)), ARMED);
    // The first step is done, and the next ones overwrite the new firmware in the slot that it was written to.
    chip.borrow_mut().put(STATE.start + 2 * WORD, &[0; WORD]);
    chip.borrow_mut().bytes[DOWNLOAD.start + 40] ^= 1;
    assert_eq!(checked(&chip, seal.key), Booted::OnTrial);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_bytes_are_no_signature_and_do_no_harm(key: [u8; 32], halves: [[u8; 32]; 2]) {
        let signature = halves.concat().try_into().expect("64 bytes");
        prop_assert_eq!(sent(&image(), Some(ImageSignature { key, bytes: signature })), REFUSED);
        prop_assert_eq!(sent(&image(), Some(seal(signature))), REFUSED);
    }
}
