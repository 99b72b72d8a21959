//! Reception of an image, step by step.

use motor_hub::protocol::Nack;
use motor_hub::update::{Booted, CHUNK, CRC, Outcome, Phase, Slot, SlotReport, Update, UpdateRequest};
use proptest::collection::vec;
use proptest::prelude::*;

const SLOT: Slot = Slot { origin: 0x0802_0000, length: 4_096, ram: (0x2000_0000, 0x2002_0000), signer: None };

fn confirmed() -> Update {
    let mut update = Update::new(SLOT);
    update.done(SlotReport::Booted(Booted::Confirmed));
    update
}

/// An image of this length. Its vector table is valid; the other bytes count up.
fn image(length: usize) -> Vec<u8> {
    let vectors = [0x2002_0000_u32, SLOT.origin + 0x299].map(u32::to_le_bytes);
    vectors.into_iter().flatten().chain((0..).map(|byte: u32| byte as u8)).take(length).collect()
}

fn crc(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// A slot in memory that executes all orders, and the armed image.
#[derive(Default)]
struct Memory {
    bytes: Vec<u8>,
    armed: Option<Vec<u8>>,
    /// Outcome of the last request; `None` if it is reported, or if no request was carried out.
    outcome: Option<Outcome>,
}

impl Memory {
    /// Carries out the next request, and reports its outcome.
    fn serve(&mut self, update: &mut Update) {
        self.carry_out(update);
        self.report(update);
    }

    /// Carries out the next request.
    fn carry_out(&mut self, update: &mut Update) {
        let Some(order) = update.request() else { return };
        self.outcome = Some(match order {
            UpdateRequest::Write { offset, bytes } => {
                if offset == 0 {
                    // Its page is erased.
                    self.bytes.clear();
                }
                self.bytes.resize(self.bytes.len().max(offset as usize + bytes.len()), 0xFF);
                self.bytes[offset as usize..][..bytes.len()].copy_from_slice(&bytes);
                Outcome::Done
            }
            UpdateRequest::Arm { length, crc: announced, .. } => {
                let image = self.bytes.get(..length as usize).unwrap_or_default();
                if crc(image) == announced {
                    self.armed = Some(image.to_vec());
                    Outcome::Done
                } else {
                    Outcome::Mismatch
                }
            }
            UpdateRequest::Disarm => {
                self.armed = None;
                Outcome::Done
            }
            UpdateRequest::Restart => Outcome::Done,
        });
    }

    /// Reports the outcome of the last request.
    fn report(&mut self, update: &mut Update) {
        if let Some(outcome) = self.outcome.take() {
            update.done(SlotReport::Result(outcome));
        }
    }
}

fn send(update: &mut Update, memory: &mut Memory, image: &[u8]) {
    for (index, bytes) in image.chunks(CHUNK).enumerate() {
        update.chunk((index * CHUNK) as u32, bytes).expect("in order");
        memory.serve(update);
    }
}

#[test]
fn an_image_that_came_whole_is_armed() {
    for length in [8, 95, 96, 97, 1_000, 4_096] {
        let (mut update, mut memory, image) = (confirmed(), Memory::default(), image(length));
        update.begin(length as u32, crc(&image), false).expect("begun");
        send(&mut update, &mut memory, &image);
        update.finish().expect("all is there");
        memory.serve(&mut update);
        assert_eq!((update.phase(), memory.armed.as_ref()), (Phase::Armed, Some(&image)), "{length} bytes");
        assert_eq!(update.restart(true), Err(Nack::MOTOR_ENABLED));
        update.restart(false).expect("armed");
        assert_eq!(update.request(), Some(UpdateRequest::Restart));
    }
}

#[test]
fn nothing_begins_while_it_would_harm() {
    let mut update = Update::new(SLOT);
    assert_eq!(update.begin(1_000, 0, false), Err(Nack::UPDATE_ON_TRIAL), "how it was started is not known");
    update.done(SlotReport::Booted(Booted::OnTrial));
    assert_eq!(update.begin(1_000, 0, false), Err(Nack::UPDATE_ON_TRIAL), "the slot has the firmware before");
    update.done(SlotReport::Booted(Booted::Unconfirmable));
    assert_eq!(update.begin(1_000, 0, false), Err(Nack::UPDATE_ON_TRIAL), "the slot has the firmware before");
    update.done(SlotReport::Booted(Booted::Reverted));
    assert_eq!(update.begin(1_000, 0, true), Err(Nack::MOTOR_ENABLED));
    for length in [0, 7, SLOT.length + 1, u32::MAX] {
        assert_eq!(update.begin(length, 0, false), Err(Nack::UPDATE_TOO_LONG));
    }
    assert_eq!(update.begin(SLOT.length, 0, false), Ok(()));
}

#[test]
fn an_image_for_another_chip_or_address_is_refused_at_its_first_chunk() {
    let words = |stack: u32, reset: u32| {
        let mut image = image(CHUNK);
        image[..4].copy_from_slice(&stack.to_le_bytes());
        image[4..8].copy_from_slice(&reset.to_le_bytes());
        image
    };
    let (top, code) = (SLOT.ram.1, SLOT.origin + 1);
    let cases = [
        (words(top, code), true),
        (words(top, SLOT.origin + SLOT.length - 1), true),
        (words(SLOT.ram.0 + 8, code), true),
        // An STM32F429 has its stack further up; and an image that is linked elsewhere.
        (words(0x2003_0000, code), false),
        (words(SLOT.ram.0, code), false),
        (words(top - 4, code), false),
        (words(top, 0x0800_0299), false),
        (words(top, SLOT.origin), false),
        (words(top, SLOT.origin + SLOT.length + 1), false),
        (vec![0xFF; CHUNK], false),
        (vec![0; CHUNK], false),
    ];
    for (image, taken) in cases {
        let mut update = confirmed();
        update.begin(CHUNK as u32, 0, false).expect("begun");
        let expected = if taken { Ok(()) } else { Err(Nack::UPDATE_NOT_AN_IMAGE) };
        assert_eq!(update.chunk(0, &image), expected, "{:02x?}", &image[..8]);
    }
}

#[test]
fn a_repeated_chunk_changes_nothing_and_a_gap_is_refused() {
    let (mut update, mut memory, image) = (confirmed(), Memory::default(), image(1_000));
    assert_eq!(update.chunk(0, &image[..CHUNK]), Err(Nack::UPDATE_NOT_BEGUN));
    update.begin(1_000, crc(&image), false).expect("begun");
    assert_eq!(update.chunk(96, &image[96..192]), Err(Nack::UPDATE_GAP));
    assert_eq!(update.chunk(0, &image[..95]), Err(Nack::parameter(1)));
    update.chunk(0, &image[..96]).expect("the first");
    assert_eq!(update.chunk(96, &image[96..192]), Err(Nack::UPDATE_BUSY), "the first is not written yet");
    assert_eq!(update.finish(), Err(Nack::UPDATE_GAP));
    memory.serve(&mut update);
    assert_eq!((update.chunk(0, &image[..96]), update.request()), (Ok(()), None));
    assert_eq!(update.chunk(95, &image[95..191]), Err(Nack::UPDATE_GAP));
    assert_eq!(update.progress(), (96, 1_000));
}

#[test]
fn a_flash_that_refuses_a_chunk_ends_the_update() {
    let (mut update, image) = (confirmed(), image(1_000));
    update.begin(1_000, crc(&image), false).expect("begun");
    update.chunk(0, &image[..96]).expect("the first");
    assert!(update.request().is_some());
    update.done(SlotReport::Result(Outcome::Refused));
    assert_eq!((update.phase(), update.outcome()), (Phase::Nothing, Outcome::Refused));
    assert_eq!(update.chunk(96, &image[96..192]), Err(Nack::UPDATE_NOT_BEGUN));
}

#[test]
fn an_armed_image_is_started_or_abandoned_before_there_is_another() {
    let (mut update, mut memory, image) = (confirmed(), Memory::default(), image(100));
    update.begin(100, crc(&image), false).expect("begun");
    send(&mut update, &mut memory, &image);
    update.finish().expect("all is there");
    memory.serve(&mut update);
    assert_eq!(update.begin(100, 0, false), Err(Nack::UPDATE_ARMED), "its slot must not be erased");
    assert_eq!((update.abandon(), update.abandon()), (Ok(()), Ok(())), "a host repeats a request");
    assert_eq!(update.restart(false), Err(Nack::UPDATE_NOT_ARMED));
    memory.serve(&mut update);
    assert_eq!((update.phase(), memory.armed), (Phase::Nothing, None));
}

/// An update whose image is complete and waits for its check.
fn checking(image: &[u8]) -> (Update, Memory) {
    let (mut update, mut memory) = (confirmed(), Memory::default());
    update.begin(image.len() as u32, crc(image), false).expect("begun");
    send(&mut update, &mut memory, image);
    update.finish().expect("all is there");
    (update, memory)
}

#[test]
fn an_image_that_is_abandoned_during_its_check_is_disarmed_after_it() {
    let (mut update, _) = checking(&image(100));
    assert!(matches!(update.request(), Some(UpdateRequest::Arm { .. })), "the check begins");
    assert_eq!((update.abandon(), update.abandon()), (Ok(()), Ok(())), "a host repeats a request");
    assert_eq!((update.restart(false), update.request()), (Err(Nack::UPDATE_NOT_ARMED), None));
    assert_eq!(update.begin(100, 0, false), Err(Nack::UPDATE_BUSY), "the image is still read");
    // The task has armed the image.
    update.done(SlotReport::Result(Outcome::Done));
    assert_eq!(update.phase(), Phase::Disarming);
    assert_eq!(update.request(), Some(UpdateRequest::Disarm));
    update.done(SlotReport::Result(Outcome::Done));
    assert_eq!((update.phase(), update.request()), (Phase::Nothing, None));
}

#[test]
fn an_image_that_is_abandoned_before_its_check_or_that_fails_the_check_needs_no_disarming() {
    let failures = [Outcome::Refused, Outcome::Mismatch, Outcome::WrongSignature, Outcome::Older];
    // Without a failure, the image is abandoned before its check begins.
    for failure in failures.map(Some).into_iter().chain([None]) {
        let (mut update, _) = checking(&image(100));
        assert!(failure.is_none() || update.request().is_some(), "the check begins");
        update.abandon().expect("before or during the check");
        failure.into_iter().for_each(|failure| update.done(SlotReport::Result(failure)));
        assert_eq!((update.phase(), update.request()), (Phase::Nothing, None), "{failure:?}");
        update.begin(100, 0, false).expect("the next image");
    }
}

/// Events of a host and its line.
#[derive(Clone, Copy, Debug)]
enum Step {
    Begin {
        motors_run: bool,
    },
    /// The chunk with this index.
    Chunk(usize),
    Next,
    CarryOut,
    Report,
    Damage(usize),
    Finish,
    Abandon,
    /// The power fails.
    Reset,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        1 => any::<bool>().prop_map(|motors_run| Step::Begin { motors_run }),
        2 => (0..4_usize).prop_map(Step::Chunk),
        12 => Just(Step::Next),
        12 => Just(Step::CarryOut),
        12 => Just(Step::Report),
        1 => (0..300_usize).prop_map(Step::Damage),
        4 => Just(Step::Finish),
        1 => Just(Step::Abandon),
        1 => Just(Step::Reset),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn whatever_a_host_does_nothing_is_armed_but_the_whole_image(steps in vec(step(), 0..200)) {
        let (image, mut update, mut memory) = (image(250), confirmed(), Memory::default());
        let chunk = |update: &mut Update, index: usize| {
            let bytes = image.chunks(CHUNK).nth(index).unwrap_or_default();
            let _ = update.chunk((index * CHUNK) as u32, bytes);
        };
        for step in steps {
            match step {
                Step::Begin { motors_run } => drop(update.begin(250, crc(&image), motors_run)),
                Step::Chunk(index) => chunk(&mut update, index),
                Step::Next => {
                    let next = update.progress().0 as usize / CHUNK;
                    chunk(&mut update, next);
                }
                Step::CarryOut => memory.carry_out(&mut update),
                Step::Report => memory.report(&mut update),
                // From here on the image belongs to the bootloader.
                Step::Damage(at) if memory.armed.is_none() => memory.bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 4),
                Step::Damage(_) => (),
                Step::Finish => drop(update.finish()),
                Step::Abandon => drop(update.abandon()),
                Step::Reset => (update, memory.armed, memory.outcome) = (confirmed(), None, None),
            }
            // The armed image is still in the slot.
            prop_assert!(memory.armed.is_none() || memory.bytes.starts_with(&image));
            prop_assert!(memory.armed.as_ref().is_none_or(|armed| *armed == image));
            prop_assert!(update.phase() != Phase::Armed || memory.armed.is_some());
            // An idle hub reports what the next reset starts.
            prop_assert!(update.is_busy() || (update.phase() == Phase::Armed) == memory.armed.is_some());
        }
    }
}
