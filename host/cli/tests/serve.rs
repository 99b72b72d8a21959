//! A host talks to the served hub over a serial port and over TCP.
#![expect(
    clippy::unwrap_used,
    clippy::indexing_slicing,
    clippy::panic,
    reason = "a failed access is a failed test"
)]

mod conformance;

use conformance::{Ack, HUB, Hub, KEEP_ALIVE, conforms, drive, packet};
use std::process::Command;

const PROGRAM: &str = env!("CARGO_BIN_EXE_motor-hub");

#[test]
fn the_hub_conforms_over_tcp() {
    conforms(&mut Hub::start(PROGRAM, &["--tcp", "127.0.0.1:0"]).tcp());
}

#[cfg(unix)]
#[test]
fn the_hub_conforms_over_a_serial_port() {
    conforms(&mut Hub::start(PROGRAM, &["--pty"]).serial());
}

#[test]
fn hosts_come_and_go_while_time_goes_on() {
    let hub = Hub::start(PROGRAM, &["--tcp", "127.0.0.1:0"]);
    drive(&mut hub.tcp());
    // The first host has hung up; its motor turns on until the hub has missed it for 2.5 s.
    let mut second = hub.tcp();
    assert!(second.enabled());
    // A third waits for its turn.
    let mut third = hub.tcp();
    third.is_ignored(&packet(HUB, 1, KEEP_ALIVE, &[]));
    second.order(0x7F05, &[]);
    drop(second);
    third.number = 1;
    assert_eq!(third.reply().map(|reply| reply.1), Some(Ack(true)), "it is answered when it is served");
    assert!(!third.enabled());
}

#[cfg(unix)]
#[test]
fn a_serial_port_may_be_opened_again_and_again() {
    let hub = Hub::start(PROGRAM, &["--pty"]);
    for _ in 0..3 {
        assert!(!hub.serial().enabled());
    }
}

#[cfg(unix)]
#[test]
fn a_host_that_leaves_the_port_as_it_is_gets_bytes_not_lines() {
    use std::io::{Read, Write};
    let hub = Hub::start(PROGRAM, &["--pty"]);
    let mut port = std::fs::File::options().read(true).write(true).open(&hub.place).unwrap();
    port.write_all(&packet(HUB, 3, KEEP_ALIVE, &[])).unwrap();
    let (heard, answer) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let mut bytes = [0; 64];
        let length = port.read(&mut bytes).unwrap();
        let _ = heard.send(bytes[..length].to_vec());
    });
    let answer = answer.recv_timeout(std::time::Duration::from_secs(2)).unwrap();
    // With attention; the hub's own number is not looked at.
    let [start @ .., sum] = answer.as_slice() else { panic!("{answer:02x?}") };
    assert_eq!(start[..6], [0x44, 0x4B, 12, 0, 0, HUB]);
    assert_eq!(*sum, start.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)));
}

#[test]
fn the_hub_is_where_it_is_put() {
    let hub = Hub::start(PROGRAM, &["--tcp", "127.0.0.1:0", "--address", "77"]);
    hub.tcp().is_ignored(&packet(HUB, 1, KEEP_ALIVE, &[]));
    let mut host = hub.tcp();
    host.say(&packet(77, 1, KEEP_ALIVE, &[]));
    assert_eq!(host.hear().get(5), Some(&77));
}

#[test]
fn wrong_options_are_refused() {
    for (arguments, code, says) in [
        (&[][..], 2, "--pty"),
        (&["--pty", "--tcp", "127.0.0.1:0"], 2, "--tcp"),
        (&["--tcp", "nowhere"], 2, "127.0.0.1:7070"),
        (&["--pty", "--address", "255"], 2, "1 to 254"),
        (&["--pty", "--for", "-1"], 2, "more than 0"),
        (&["--pty", "--for", "0"], 2, "more than 0"),
        (&["--pty", "--scenario", "/no/such/file"], 2, "/no/such/file"),
    ] {
        let output = Command::new(PROGRAM).arg("serve").args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(error.contains(says), "{arguments:?}: {error}");
    }
}
