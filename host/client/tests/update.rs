//! Updates of firmware, step by step, against the hub's own side of the protocol with a fake flash.
#![expect(clippy::unwrap_used, reason = "a failed access is a failed test")]

mod hub_support;

use hub_support::{ADDRESS, Hub, Memory, SIGNATURE_OF_OLDER, SLOT, first, started};
use motor_hub::extension::{FIRST_FUNCTION, HubFunction, INTERFACE};
use motor_hub::protocol::answers::Functions;
use motor_hub::protocol::payload::{Field, Payload, Text};
use motor_hub::protocol::{Address, Packet, Reply};
use motor_hub::update::{Booted, CRC, ImageSignature, Phase, Slot};
use motor_hub_client::Session;
use motor_hub_client::session::TRANSMISSIONS;
use motor_hub_client::update::{Image, Progress, UpdateError, Updating};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Public key of the signer.
const KEY: [u8; 32] = [3; 32];

fn hub() -> Hub {
    Hub { responder: started(SLOT, Booted::Confirmed), ..Hub::new() }
}

fn session() -> Session {
    Session::new(Memory::new(hub()), Address::new(ADDRESS).unwrap(), Duration::from_secs(3))
}

/// 500 bytes for the slot.
fn image(version: &str) -> Image {
    let mut bytes = [0x2002_0000_u32, SLOT.origin + 0x199].map(u32::to_le_bytes).concat();
    bytes.resize(500, 0xA5);
    Image { bytes, version: version.to_owned(), origin: None }
}

#[test]
fn an_update_makes_the_hub_forget_an_earlier_image_and_ends_with_confirmed_firmware() {
    let mut session = session();
    // An earlier host has sent an image, and has not restarted the hub.
    let (version, earlier) = (session.version().unwrap(), image("").bytes);
    let (length, crc) = (earlier.len() as u32, CRC.checksum(&earlier));
    session.command(HubFunction::BeginUpdate { length, crc, version: Text::new() }).unwrap();
    for (index, chunk) in (0..).zip(earlier.chunks(96)) {
        let bytes = Text::from_slice(chunk).unwrap();
        session.command(HubFunction::Chunk { offset: 96 * index, bytes }).unwrap();
    }
    session.command(HubFunction::FinishUpdate).unwrap();
    assert_eq!(session.update_state().unwrap().phase, Phase::Armed);

    let mut updating = Updating::begin(&mut session, image(&version), None).unwrap();
    let news: Vec<Progress> = (0..10).filter_map(|_| updating.step(&mut session).unwrap()).take(5).collect();
    let [announced, sent] = [Progress::Sending(0), Progress::Sending(384)];
    assert_eq!(
        news,
        [announced, sent, Progress::Checking, Progress::Restarting, Progress::Confirmed(version)]
    );
}

#[test]
fn after_an_update_the_session_uses_the_functions_of_the_new_firmware() {
    static RESTARTED: AtomicBool = AtomicBool::new(false);
    // The former firmware lacks the functions after `Sign`.
    let answer = |packet: &Packet| {
        RESTARTED.fetch_or(packet.id == HubFunction::Restart.id(), Ordering::Relaxed);
        let mut older = Payload::new();
        Functions { first: FIRST_FUNCTION, count: 28 }.write(&mut older);
        let is_query = packet.id == 0x7F07 && packet.payload.starts_with(INTERFACE);
        (is_query && !RESTARTED.load(Ordering::Relaxed)).then_some(Reply::Data(older))
    };
    let line = Memory::new(Hub { answer, ..hub() });
    let mut session = Session::new(line, Address::new(ADDRESS).unwrap(), Duration::from_secs(3));
    let version = session.version().unwrap();
    assert_eq!(session.equipment().unwrap(), None);
    let mut updating = Updating::begin(&mut session, image(&version), None).unwrap();
    let end = (0..20).filter_map(|_| updating.step(&mut session).unwrap()).nth(3);
    assert_eq!(end, Some(Progress::Confirmed(version)));
    assert!(session.equipment().unwrap().is_some(), "the new firmware has this function");
}

#[test]
fn an_update_goes_on_if_the_acknowledgement_of_the_restart_is_lost() {
    // After the restart the hub refuses a retransmission, or no answer of the hub arrives.
    for lost in [1, TRANSMISSIONS] {
        let is_restart = |packet: &Packet| packet.id == HubFunction::Restart.id();
        let hub = Hub { loses_reply: first(lost, is_restart), ..hub() };
        let timeout = Duration::from_millis(150);
        let mut session = Session::new(Memory::new(hub), Address::new(ADDRESS).unwrap(), timeout);
        let version = session.version().unwrap();
        let mut updating = Updating::begin(&mut session, image(&version), None).unwrap();
        let end = (0..20).filter_map(|_| updating.step(&mut session).unwrap()).nth(3);
        assert_eq!(end, Some(Progress::Confirmed(version)));
    }
}

#[test]
fn an_update_fails_with_the_reason_of_the_check_if_the_acknowledgement_before_is_lost() {
    // The check fails before the retransmission, and the hub has then forgotten the image.
    let is_finish = |packet: &Packet| packet.id == HubFunction::FinishUpdate.id();
    let responder = started(Slot { signer: Some(KEY), ..SLOT }, Booted::Confirmed);
    let hub = Hub { responder, loses_reply: first(1, is_finish), ..hub() };
    let mut session =
        Session::new(Memory::new(hub), Address::new(ADDRESS).unwrap(), Duration::from_millis(150));
    let signature = ImageSignature { key: KEY, bytes: SIGNATURE_OF_OLDER };
    let mut updating = Updating::begin(&mut session, image("mh9.9.9"), Some(signature)).unwrap();
    let failed = (0..10).find_map(|_| updating.step(&mut session).err()).unwrap();
    assert!(failed.to_string().contains("older than the hub's firmware"), "{failed}");
}

#[test]
fn an_image_for_another_hub_is_refused_before_it_is_announced() {
    let mut session = session();
    let other = Image { origin: Some(0x0800_0000), ..image("mh9.9.9") };
    let refused = Updating::begin(&mut session, other, None).unwrap_err();
    assert!(matches!(refused, UpdateError::Unfit(_)), "{refused}");
    assert_eq!(session.update_state().unwrap().phase, Phase::Nothing);
}
