//! New firmware, as a host hears of it.

use crate::host::{SLOT, Said, TestHost};
use motor_hub::hub::Snapshot;
use motor_hub::protocol::Request;
use motor_hub::protocol::fields::{Field, Fields, Text};
use motor_hub::protocol::update::{ToUpdate, UpdateReport};
use motor_hub::update::{Booted, CHUNK, Done, Order, Outcome, Phase};

fn say(host: &mut TestHost, request: ToUpdate) -> Said {
    let request = Request::from(request);
    host.ask(request.id(), &request.payload())
}

fn begin(host: &mut TestHost, length: u32) -> Said {
    let version = Text::new(b"mh9.9.9").expect("short");
    say(host, ToUpdate::Begin { length, crc: 7, version })
}

fn chunk(host: &mut TestHost, offset: u32) -> Said {
    let mut bytes = [0; CHUNK];
    bytes[..8].copy_from_slice(&[0, 0, 2, 0x20, 0x41, 0, 2, 8]);
    say(host, ToUpdate::Chunk { offset, bytes: Text::new(&bytes).expect("short") })
}

fn report(host: &mut TestHost) -> UpdateReport {
    let Said::Data(payload) = say(host, ToUpdate::State) else { panic!("no report") };
    UpdateReport::read(&mut Fields::new(&payload)).expect("a report")
}

/// A hub with a bootloader.
fn hub() -> TestHost {
    let mut host = TestHost::settled();
    host.responder = host.responder.with_slot(SLOT);
    host.responder.update_done(Done::Booted(Booted::Confirmed));
    host.ask(0x7F03, &[1]);
    host
}

const ACK: Said = Said::Ack(0);

#[test]
fn a_hub_without_a_bootloader_has_no_updates() {
    let mut host = TestHost::settled();
    assert_eq!((begin(&mut host, 96), say(&mut host, ToUpdate::State)), (Said::Nack(253), Said::Nack(253)));
}

#[test]
fn a_host_sends_an_image_and_has_it_started() {
    let mut host = hub();
    assert_eq!(begin(&mut host, 192), ACK);
    for offset in [0, 96] {
        assert_eq!(chunk(&mut host, offset), ACK);
        assert!(
            matches!(host.responder.update_order(), Some(Order::Write { offset: to, .. }) if to == offset)
        );
        assert_eq!(chunk(&mut host, offset + 96), Said::Nack(if offset == 0 { 70 } else { 1 }));
        host.responder.update_done(Done::Carried(Outcome::Done));
    }
    assert_eq!(say(&mut host, ToUpdate::Restart), Said::Nack(77));
    assert_eq!(say(&mut host, ToUpdate::Finish), ACK);
    assert_eq!(host.responder.update_order(), Some(Order::Arm { length: 192, crc: 7 }));
    host.responder.update_done(Done::Carried(Outcome::Done));
    let told = report(&mut host);
    let version = Text::new(b"mh9.9.9").expect("short");
    assert_eq!((told.phase, told.received, told.length, told.version), (Phase::Armed, 192, 192, version));
    assert_eq!((told.origin, told.capacity), (SLOT.origin, SLOT.length));
    assert_eq!(say(&mut host, ToUpdate::Restart), ACK);
    assert_eq!(host.responder.update_order(), Some(Order::Restart));
}

#[test]
fn each_refusal_has_a_number_of_its_own() {
    let mut host = hub();
    assert_eq!(chunk(&mut host, 0), Said::Nack(74));
    assert_eq!(begin(&mut host, 512 * 1024 + 1), Said::Nack(73));
    host.responder.update_done(Done::Booted(Booted::OnTrial));
    assert_eq!(begin(&mut host, 96), Said::Nack(71));
    host.responder.update_done(Done::Booted(Booted::Confirmed));
    assert_eq!(begin(&mut host, 96), ACK);
    assert_eq!(chunk(&mut host, 96), Said::Nack(75));
    let blank = Text::new(&[0xFF; CHUNK]).expect("short");
    assert_eq!(say(&mut host, ToUpdate::Chunk { offset: 0, bytes: blank }), Said::Nack(76));
    assert_eq!(say(&mut host, ToUpdate::Abandon), ACK);
    assert_eq!(chunk(&mut host, 0), Said::Nack(74));
}

#[test]
fn nothing_begins_while_a_motor_is_enabled() {
    let mut host = hub();
    // Constant power of 0, enabled.
    host.do_all(&[(8, &[0, 0, 0]), (15, &[0, 0, 0]), (10, &[0, 1])]);
    assert_eq!(begin(&mut host, 96), Said::Nack(60));
    host.do_all(&[(10, &[0, 0])]);
    host.told();
    host.snapshot = Snapshot { motors: Snapshot::INITIAL.motors, ..host.snapshot };
    assert_eq!(begin(&mut host, 96), ACK);
}
