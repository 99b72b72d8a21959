//! Requests of a host about new firmware.

use crate::host::{Answer, SLOT, TestHost};
use motor_hub::extension::HubFunction;
use motor_hub::extension::state::UpdateReport;
use motor_hub::protocol::payload::Text;
use motor_hub::update::{Booted, CHUNK, ImageSignature, Outcome, Phase, Slot, SlotReport, UpdateRequest};

fn begin(host: &mut TestHost, length: u32) -> Answer {
    let version = Text::from_slice(b"mh9.9.9").expect("short");
    host.request(HubFunction::BeginUpdate { length, crc: 7, version })
}

fn chunk(host: &mut TestHost, offset: u32) -> Answer {
    let mut bytes = [0; CHUNK];
    bytes[..8].copy_from_slice(&[0, 0, 2, 0x20, 0x41, 0, 2, 8]);
    host.request(HubFunction::Chunk { offset, bytes: Text::from_slice(&bytes).expect("short") })
}

/// A hub with a bootloader. With a key it accepts only images that the owner of the key has signed.
fn hub(signer: Option<[u8; 32]>) -> TestHost {
    let mut host = TestHost::settled();
    host.responder = host.responder.with_slot(Slot { signer, ..SLOT });
    host.responder.update_done(SlotReport::Booted(Booted::Confirmed));
    host.ask(0x7F03, &[1]);
    host
}

const ACK: Answer = Answer::Ack(0);

#[test]
fn a_hub_without_a_bootloader_has_no_updates() {
    let mut host = TestHost::settled();
    assert_eq!(
        (begin(&mut host, 96), host.request(HubFunction::Update)),
        (Answer::Nack(253), Answer::Nack(253))
    );
}

#[test]
fn a_host_sends_an_image_and_has_it_started() {
    let mut host = hub(None);
    assert_eq!(begin(&mut host, 192), ACK);
    for offset in [0, 96] {
        assert_eq!(chunk(&mut host, offset), ACK);
        assert!(
            matches!(host.responder.update_request(), Some(UpdateRequest::Write { offset: to, .. }) if to == offset)
        );
        assert_eq!(chunk(&mut host, offset + 96), Answer::Nack(if offset == 0 { 70 } else { 1 }));
        host.responder.update_done(SlotReport::Result(Outcome::Done));
    }
    assert_eq!(host.request(HubFunction::Restart), Answer::Nack(77));
    assert_eq!(host.request(HubFunction::FinishUpdate), ACK);
    assert_eq!(
        host.responder.update_request(),
        Some(UpdateRequest::Arm { length: 192, crc: 7, signature: None })
    );
    host.responder.update_done(SlotReport::Result(Outcome::Done));
    let progress: UpdateReport = host.read(HubFunction::Update);
    let version = Text::from_slice(b"mh9.9.9").expect("short");
    assert_eq!(
        (progress.phase, progress.received, progress.length, progress.version),
        (Phase::Armed, 192, 192, version)
    );
    assert_eq!((progress.origin, progress.capacity), (SLOT.origin, SLOT.length));
    assert_eq!(host.request(HubFunction::Restart), ACK);
    assert_eq!(host.responder.update_request(), Some(UpdateRequest::Restart));
}

#[test]
fn each_refusal_has_its_own_number() {
    let mut host = hub(None);
    assert_eq!(chunk(&mut host, 0), Answer::Nack(74));
    assert_eq!(begin(&mut host, 512 * 1024 + 1), Answer::Nack(73));
    host.responder.update_done(SlotReport::Booted(Booted::OnTrial));
    assert_eq!(begin(&mut host, 96), Answer::Nack(71));
    host.responder.update_done(SlotReport::Booted(Booted::Confirmed));
    host.do_all(&[(15, &[0, 0, 0]), (10, &[0, 1])]);
    assert_eq!(begin(&mut host, 96), Answer::Nack(60), "a motor is enabled");
    host.do_all(&[(10, &[0, 0])]);
    host.new_commands();
    assert_eq!(begin(&mut host, 96), ACK);
    assert_eq!(chunk(&mut host, 96), Answer::Nack(75));
    let blank = Text::from_slice(&[0xFF; CHUNK]).expect("short");
    assert_eq!(host.request(HubFunction::Chunk { offset: 0, bytes: blank }), Answer::Nack(76));
    assert_eq!(host.request(HubFunction::AbandonUpdate), ACK);
    assert_eq!(chunk(&mut host, 0), Answer::Nack(74));
}

#[test]
fn signatures_are_required_with_a_key_and_refused_without_one() {
    let sign =
        |host: &mut TestHost, key| host.request(HubFunction::Sign { key: [key; 32], signature: [9; 64] });
    let mut host = hub(None);
    begin(&mut host, 96);
    assert_eq!(sign(&mut host, 5), Answer::Nack(80));
    let mut host = hub(Some([5; 32]));
    assert_eq!(sign(&mut host, 5), Answer::Nack(74));
    assert_eq!(begin(&mut host, 96), ACK);
    assert_eq!(chunk(&mut host, 0), Answer::Nack(78));
    assert_eq!(sign(&mut host, 6), Answer::Nack(79));
    assert_eq!(chunk(&mut host, 0), Answer::Nack(78));
    assert_eq!(sign(&mut host, 5), ACK);
    assert_eq!(chunk(&mut host, 0), ACK);
    host.responder.update_request().expect("a chunk to write");
    host.responder.update_done(SlotReport::Result(Outcome::Done));
    assert_eq!(host.request(HubFunction::FinishUpdate), ACK);
    let signature = Some(ImageSignature { key: [5; 32], bytes: [9; 64] });
    assert_eq!(host.responder.update_request(), Some(UpdateRequest::Arm { length: 96, crc: 7, signature }));
    host.responder.update_done(SlotReport::Result(Outcome::WrongSignature));
    let progress: UpdateReport = host.read(HubFunction::Update);
    assert_eq!((progress.phase, progress.outcome), (Phase::Nothing, Outcome::WrongSignature));
    assert_eq!(host.request(HubFunction::Restart), Answer::Nack(77));
    // A signature is valid only for the image that was announced before it.
    assert_eq!(begin(&mut host, 96), ACK);
    assert_eq!(chunk(&mut host, 0), Answer::Nack(78));
}
