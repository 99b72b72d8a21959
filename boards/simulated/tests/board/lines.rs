//! Lines between a served hub and hosts that do not read their replies.

use simulated::serve::{self, Line};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Sends until the line takes no more bytes.
fn fill(line: &mut dyn Line) {
    let end = Instant::now() + Duration::from_secs(10);
    let mut full_since = None;
    // The system moves bytes from one buffer to the next, so a full line may take more bytes a moment later.
    while full_since.is_none_or(|since: Instant| since.elapsed() < Duration::from_millis(50)) {
        assert!(Instant::now() < end, "a host that reads nothing leaves the line free");
        if line.send(&[0x5A; 4096]) > 0 {
            full_since = None;
        } else {
            full_since.get_or_insert_with(Instant::now);
        }
    }
}

/// Receives until nothing has come for 50 ms.
fn received(line: &mut dyn Line) -> Vec<u8> {
    let (mut received, mut last, mut bytes) = (Vec::new(), Instant::now(), [0; 4096]);
    while last.elapsed() < Duration::from_millis(50) {
        let length = line.receive(&mut bytes);
        if length > 0 {
            received.extend(&bytes[..length]);
            last = Instant::now();
        }
    }
    received
}

/// Checks that the hub receives what the host sends, and the host what the hub answers.
fn assert_conversation(line: &mut dyn Line, host: &mut (impl Read + Write)) {
    host.write_all(b"new").unwrap();
    assert_eq!(received(line), b"new");
    assert_eq!(line.send(b"answer"), 6);
    let mut bytes = [0; 64];
    let length = host.read(&mut bytes).unwrap();
    assert_eq!(&bytes[..length], b"answer");
}

#[cfg(target_os = "linux")]
#[test]
fn a_host_that_closes_a_full_port_leaves_no_replies_and_no_requests() {
    let mut line = serve::pty().unwrap();
    let path = line.to_string();
    let open = || std::fs::File::options().read(true).write(true).open(&path).unwrap();
    let mut host = open();
    host.write_all(b"first").unwrap();
    assert_eq!(received(&mut *line), b"first");
    fill(&mut *line);
    host.write_all(b"old").unwrap();
    drop(host);
    assert_eq!(line.send(b"reply"), 5, "a reply to a host that has gone is dropped");
    assert_eq!(received(&mut *line), b"");
    let mut next = open();
    assert_eq!(received(&mut *line), b"");
    assert_conversation(&mut *line, &mut next);
}

#[test]
fn a_silent_host_with_unread_replies_gives_way_to_another() {
    let mut line = serve::tcp("127.0.0.1:0").unwrap();
    let mut silent = TcpStream::connect(line.to_string()).unwrap();
    silent.write_all(b"first").unwrap();
    assert_eq!(received(&mut *line), b"first");
    fill(&mut *line);
    let second = TcpStream::connect(line.to_string()).unwrap();
    // The first host is not silent yet, so the second host is disconnected.
    let rejected = Instant::now() + Duration::from_secs(2);
    while line.rejected_hosts() == 0 {
        assert!(Instant::now() < rejected, "the second host is not disconnected");
        line.send(b"reply");
    }
    drop(second);
    silent.write_all(b"old").unwrap();
    line.send(b"reply");
    sleep(Duration::from_millis(5100));
    let mut next = TcpStream::connect(line.to_string()).unwrap();
    let replaced = Instant::now() + Duration::from_secs(2);
    while line.send(b"reply") == 0 {
        assert!(Instant::now() < replaced, "the hub still serves the silent host");
    }
    assert_conversation(&mut *line, &mut next);
}
