//! Messages of `motor-hub client update` about the result of an update, against the hub's protocol code with a fake flash.

use crate::client_program::client;
use crate::common::{err, fails, folder, motor_hub, out, signal, start_client, wait_for, write};
use crate::hub_support::{Hub, SIGNATURE, SIGNATURE_OF_OLDER, SLOT, Server, started};
use motor_hub::extension::HubFunction;
use motor_hub::protocol::Packet;
use motor_hub::update::{Booted, Slot, public_key};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;

/// Public key as OpenSSL writes it.
pub(crate) const KEY: &[u8] = include_bytes!("../../../../tests/update/signed/public.der");

/// A hub with this slot for new firmware.
pub(crate) fn with_slot(slot: Slot) -> Hub {
    Hub { responder: started(slot, Booted::Confirmed), ..Hub::new() }
}

/// Raw bytes for the slot, with this version text.
pub(crate) fn image(version: &str) -> Vec<u8> {
    let mut bytes = [0x2002_0000_u32, SLOT.origin + 0x199].map(u32::to_le_bytes).concat();
    bytes.extend(format!("HW: 20, Maj: 1, Min: 8, Eng: 2, {version}\0").bytes());
    bytes
}

pub(crate) const RUNS: &str = concat!("mh", env!("CARGO_PKG_VERSION"));

#[test]
fn an_update_that_was_rolled_back_fails_with_both_versions() {
    let file = write(&folder("client-update-back"), "newer.bin", image("mh9.9.9"));
    let server = Server::start(Hub { restarts: Booted::Reverted, ..with_slot(SLOT) });
    let output = client(&server, &["update", &file]);
    assert_eq!(output.status.code(), Some(1));
    let (new, old) = ("Eng: 2, mh9.9.9", format!("Eng: 2, {RUNS}"));
    let why = err(&output);
    let says = why.split_once(" did not confirm itself, and the hub returned to ");
    assert!(says.is_some_and(|(before, after)| before.contains(new) && after.contains(&old)), "{why}");
    // An image that the bootloader refuses is no update, although it has the version of the firmware.
    let same = write(&folder("client-update-refused"), "same.bin", image(RUNS));
    fails(
        &client(&server, &["update", &same]),
        1,
        "did not confirm itself, and the hub returned to the former firmware",
    );
    // It also fails if the hub confirms, but runs the former firmware.
    let server = Server::start(with_slot(SLOT));
    let output = client(&server, &["update", &file]);
    assert!(err(&output).contains(&format!("{RUNS}, but the image sent is HW")), "{}", err(&output));
}

#[test]
fn ctrl_c_while_the_hub_exchanges_the_images_says_that_the_update_goes_on() {
    let file = write(&folder("client-update-ctrl-c"), "newer.bin", image("mh9.9.9"));
    let restarts = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&restarts);
    // From the restart on the hub is silent.
    let loses_reply = Box::new(move |packet: &Packet| {
        seen.fetch_or(packet.id == HubFunction::Restart.id(), Relaxed) || seen.load(Relaxed)
    });
    let server = Server::start(Hub { loses_reply, ..with_slot(SLOT) });
    let update = ["--address", "3", "--timeout-ms", "200", "update", &file];
    let process = start_client(&server.address, &update);
    wait_for("restart", || restarts.load(Relaxed).then_some(()));
    signal(process.id(), "-INT");
    let output = process.wait_with_output().unwrap();
    fails(&output, 1, "stopped by Ctrl-C: the update goes on");
    fails(&output, 1, "or tries the new firmware");
    fails(&output, 1, "answers again after some 20 s");
}

#[test]
fn a_hub_with_a_key_refuses_unsigned_firmware_and_one_without_refuses_signatures() {
    let folder = folder("client-update-signed");
    let file = write(&folder, "same.bin", image(RUNS));
    let signature = write(&folder, "same.sig", SIGNATURE);
    let wrong = write(&folder, "wrong.sig", [8; 64]);
    let key = write(&folder, "public.der", KEY);
    let mut other = KEY.to_vec();
    other.iter_mut().skip(12).for_each(|byte| *byte ^= 1);
    let other = write(&folder, "other.der", other);
    let server = Server::start(with_slot(Slot { signer: public_key(KEY), ..SLOT }));
    let refused = |arguments: &[&str], why: &str| {
        fails(&client(&server, &[&["update", &*file], arguments].concat()), 1, why);
    };
    refused(&[], "new firmware for this hub must be signed, and is not (NACK 78)");
    refused(
        &["--signature", &signature, "--key", &other],
        "the signature is by another key than the hub's (NACK 79)",
    );
    refused(&["--signature", &wrong, "--key", &key], "the signature is not of this file by the hub's key");
    let older = write(&folder, "older.sig", SIGNATURE_OF_OLDER);
    refused(
        &["--signature", &older, "--key", &key],
        "older than the hub's firmware: its rollback version is lower",
    );
    let output = out(&client(&server, &["update", &file, "--signature", &signature, "--key", &key]));
    assert!(output.contains(&format!("Eng: 2, {RUNS}, confirmed")), "{output}");
    let server = Server::start(with_slot(SLOT));
    let output = client(&server, &["update", &file, "--signature", &signature, "--key", &key]);
    fails(&output, 1, "built without a key, and checks no signatures (NACK 80)");
}

#[test]
fn a_hub_without_a_bootloader_refuses_an_update() {
    let file = write(&folder("client-update-none"), "same.bin", image(RUNS));
    fails(&client(&Server::start(Hub::new()), &["update", &file]), 1, "the hub has no bootloader");
}

#[test]
fn files_that_are_no_firmware_no_signature_and_no_key_are_refused_before_a_hub_is_asked() {
    let folder = folder("client-update-files");
    let nothing = write(&folder, "nothing.bin", b"nothing");
    for (file, why) in [(&*nothing, "not a motor-hub firmware"), ("/does/not/exist", "No such file")] {
        fails(&motor_hub(&["client", "--port", "nowhere", "update", file]), 2, why);
    }
    let file = write(&folder, "same.bin", image(RUNS));
    let signature = write(&folder, "same.sig", SIGNATURE);
    let short = write(&folder, "short.sig", [7; 63]);
    let key = write(&folder, "public.der", KEY);
    let pem = write(&folder, "public.pem", b"-----BEGIN PUBLIC KEY-----\nMCowBQYDK2VwAyEA");
    for (signature, key, why) in [
        (&short, &key, "has 63 bytes; an Ed25519 signature has 64"),
        (&signature, &pem, "is not an Ed25519 public key in DER"),
    ] {
        let update = ["client", "--port", "nowhere", "update", &file, "--signature", signature, "--key", key];
        fails(&motor_hub(&update), 2, why);
    }
}
