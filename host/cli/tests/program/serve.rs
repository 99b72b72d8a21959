//! A host uses the served hub over a serial port and over TCP.

use crate::common::{
    PROGRAM, client, fails, made_folder, motor_hub, motor_hub_with_files_of, out, scenario, signal, store,
    wait_for,
};
use crate::conformance::{Data, HUB, Hub, KEEP_ALIVE, conforms, drive, notes, packet};
use std::io::{BufRead, BufReader};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Runs `serve` to its end.
fn serve(arguments: &[&str]) -> Output {
    motor_hub(&[&["serve"], arguments].concat())
}

#[test]
fn a_hub_that_stores_settings_conforms_over_tcp() {
    conforms(&mut Hub::served_with(&["--store", &store("serve-conforms")]).tcp());
}

#[test]
fn a_hub_that_stores_nothing_conforms_over_a_serial_port() {
    conforms(&mut Hub::start(&["--pty"]).serial());
}

#[test]
fn requests_before_the_end_of_a_connection_are_executed() {
    use std::io::Write;
    let hub = Hub::served();
    drive(&mut hub.tcp());
    let mut host = std::net::TcpStream::connect(&hub.place).unwrap();
    signal(hub.id(), "-STOP");
    // More bytes than one read takes; the replies to the first requests have no receiver.
    host.write_all(&packet(HUB, 3, KEEP_ALIVE, &[]).repeat(200)).unwrap();
    host.write_all(&packet(HUB, 4, 0x7F05, &[])).unwrap();
    drop(host);
    signal(hub.id(), "-CONT");
    std::thread::sleep(Duration::from_millis(500));
    assert!(!hub.tcp().enabled());
}

#[test]
fn a_second_host_is_disconnected_and_the_first_goes_on() {
    use std::io::Read;
    let (mut hub, mut says) = Hub::start_heard(&notes());
    let mut first = hub.tcp();
    drive(&mut first);
    let is_rejected = || {
        let mut second = std::net::TcpStream::connect(&hub.place).unwrap();
        second.set_read_timeout(Some(Duration::from_secs(2))).unwrap();
        assert_eq!(second.read(&mut [0; 8]).unwrap(), 0, "nothing comes but the end");
    };
    is_rejected();
    let mut line = String::new();
    says.read_line(&mut line).unwrap();
    assert_eq!(line, "the hub accepts one host at a time: closed 1 further connection\n");
    assert!(first.enabled());
    fails(&client(&hub, &["status"]), 1, "one host at a time: check that no other host uses it");
    // A notice that nobody reads is no failure.
    drop(says);
    is_rejected();
    signal(hub.id(), "-TERM");
    assert!(hub.wait().success());
}

#[cfg(target_os = "linux")]
#[test]
fn a_hub_and_a_drive_that_nohup_starts_outlive_their_terminal() {
    let start = |arguments: &[&str]| {
        let mut command = Command::new("nohup");
        command.arg(PROGRAM).args(arguments).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut process = command.spawn().unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        (process, line)
    };
    let (mut hub, place) = start(&["serve", "--tcp", "127.0.0.1:0"]);
    signal(hub.id(), "-HUP");
    let (mut drive, _) = start(&["client", "--tcp", place.trim(), "power", "0", "0.2", "--for-s", "0.5"]);
    signal(drive.id(), "-HUP");
    assert!(drive.wait().unwrap().success());
    signal(hub.id(), "-TERM");
    assert!(hub.wait().unwrap().success());
}

#[test]
fn a_wire_connects_two_digital_pins() {
    let hub = Hub::served_with(&["--wire", "4,5"]);
    let mut host = hub.tcp();
    let mut level = |order: u16, payload: [u8; 2]| {
        host.order(0x1000 + order, &payload);
        host.ask(0x1005, &[5])
    };
    assert_eq!((level(3, [4, 1]), level(1, [4, 1])), (Data(vec![0]), Data(vec![1])));
    assert_eq!((level(1, [4, 0]), level(3, [4, 0])), (Data(vec![0]), Data(vec![1])));
}

#[test]
fn a_link_names_the_port_until_the_program_ends() {
    use std::fs::{read_link, remove_file};
    let link = made_folder("serve-link").join("link");
    let path = link.to_str().unwrap();
    let refused = |says: &str| {
        let output = serve(&["--pty", "--for-s", "1", "--link", path]);
        fails(&output, 2, path);
        fails(&output, 2, says);
    };
    for end in ["-TERM", "-INT", "-HUP", "-QUIT", "-KILL"] {
        let mut hub = Hub::start(&["--pty", "--link", path]);
        assert_eq!(hub.place, path);
        assert!(!hub.serial().enabled());
        // The link belongs to another program.
        refused("in use");
        signal(hub.id(), end);
        assert_eq!(hub.wait().success(), end != "-KILL", "{end}");
        assert_eq!(read_link(&link).is_ok(), end == "-KILL", "{end}");
    }
    if cfg!(target_os = "linux") {
        let refused = motor_hub(&["client", "--port", path, "status"]);
        fails(&refused, 1, "the served hub has ended; serve the hub again");
    }
    // The link of a killed program is replaced.
    drop(Hub::start(&["--pty", "--link", path]));
    remove_file(&link).unwrap();
    std::fs::write(&link, "somebody's").unwrap();
    refused("not a link");
    assert_eq!(std::fs::read(&link).unwrap(), b"somebody's");
    remove_file(&link).unwrap();
    std::os::unix::fs::symlink("/dev/null", &link).unwrap();
    refused("/dev/null");
}

#[test]
fn a_link_exists_once_the_hub_has_started() {
    let link = made_folder("serve-link-late").join("link");
    // With this battery no motor can be enabled, so the hub counts as started after 0.5 s.
    let battery =
        "battery = { emf_v = 1, resistance_ohm = 0.1 }\nmotors = [{ label = \"a\", motor = \"AM 60 A\" }]";
    let file = scenario("serve-link-late-scenario", battery);
    let start = Instant::now();
    let mut process = Command::new(PROGRAM)
        .args(["serve", "--pty", "--scenario", &file, "--link"])
        .arg(&link)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    wait_for("the link", || link.exists().then_some(()));
    let took = start.elapsed();
    signal(process.id(), "-TERM");
    assert!(process.wait().unwrap().success());
    assert!(took > Duration::from_millis(400), "{took:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_port_is_opened_again_and_again_and_what_one_host_leaves_unread_is_not_for_the_next() {
    use std::io::Write;
    let hub = Hub::start(&["--pty"]);
    for linger_ms in [0, 50] {
        let mut port = std::fs::File::options().read(true).write(true).open(&hub.place).unwrap();
        port.write_all(&packet(HUB, 3, KEEP_ALIVE, &[]).repeat(5)).unwrap();
        std::thread::sleep(Duration::from_millis(linger_ms));
        drop(port);
        std::thread::sleep(Duration::from_millis(50));
        let mut next = hub.serial();
        assert_eq!(next.receive_all(), Vec::<u8>::new(), "{linger_ms} ms");
        assert!(!next.enabled());
    }
}

#[test]
fn a_host_that_does_not_configure_the_port_gets_bytes_not_lines() {
    use std::io::{Read, Write};
    let hub = Hub::start(&["--pty"]);
    let mut port = std::fs::File::options().read(true).write(true).open(&hub.place).unwrap();
    port.write_all(&packet(HUB, 3, KEEP_ALIVE, &[])).unwrap();
    let (heard, answer) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let mut bytes = [0; 64];
        let length = port.read(&mut bytes).unwrap();
        let _ = heard.send(bytes[..length].to_vec());
    });
    let answer = answer.recv_timeout(std::time::Duration::from_secs(2)).unwrap();
    // The attention bit is set; the hub's message number is ignored.
    let [start @ .., sum] = answer.as_slice() else { panic!("{answer:02x?}") };
    assert_eq!(start[..6], [0x44, 0x4B, 12, 0, 0, HUB]);
    assert_eq!(*sum, start.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)));
}

#[test]
fn noise_as_fast_as_a_host_can_send_does_not_keep_the_hub_from_its_work() {
    use std::io::Write;
    let hub = Hub::served();
    let mut host = hub.tcp();
    drive(&mut host);
    drop(host);
    let mut noisy = std::net::TcpStream::connect(&hub.place).unwrap();
    noisy.set_write_timeout(Some(Duration::from_millis(100))).unwrap();
    // Longer than the keep-alive of 2.5 s.
    let end = Instant::now() + Duration::from_secs(3);
    while Instant::now() < end {
        let _ = noisy.write(&[0x5A; 65_536]);
    }
    drop(noisy);
    std::thread::sleep(Duration::from_secs(1));
    assert!(!hub.tcp().enabled(), "the keep-alive has ended");
}

#[test]
fn a_store_is_one_hubs_alone() {
    let store = store("store-of-one");
    let options = ["--tcp", "127.0.0.1:0", "--for-s", "0.1", "--store", &store];
    let first = Hub::served_with(&["--store", &store]);
    fails(&serve(&options), 2, "another served hub");
    drop(first);
    out(&serve(&options));
}

#[test]
fn a_store_that_a_full_disk_has_cut_short_is_completed_later() {
    let store = store("store-cut-short");
    let arguments = ["serve", "--tcp", "127.0.0.1:0", "--for-s", "0.1", "--store", &store];
    fails(&motor_hub_with_files_of(8, &arguments), 2, "File too large");
    assert_eq!(std::fs::metadata(&store).unwrap().len(), 8192);
    out(&motor_hub(&arguments));
    assert_eq!(std::fs::read(&store).unwrap(), [0xFF; 32 * 1024]);
    // A file of this length with other bytes is not a store.
    std::fs::write(&store, [0x00; 8192]).unwrap();
    fails(&motor_hub(&arguments), 2, "not a store");
    assert_eq!(std::fs::read(&store).unwrap(), [0; 8192]);
}
