//! The image in real time, its serial line on this machine: a host elsewhere finds it and runs a motor.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

struct Chip(Child);

impl Drop for Chip {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Says something and takes the whole answer's payload.
fn ask(line: &mut TcpStream, to: u8, kind: u16, payload: &[u8]) -> Vec<u8> {
    let [low, high] = kind.to_le_bytes();
    let mut packet = vec![0x44, 0x4B, 11 + payload.len() as u8, 0, to, 0, 1, 0, low, high];
    packet.extend(payload);
    packet.push(packet.iter().fold(0, |sum: u8, &byte| sum.wrapping_add(byte)));
    line.write_all(&packet).expect("a line");
    let mut answer = [0; 128];
    // A reply is one burst.
    let length = line.read(&mut answer).expect("an answer");
    assert_eq!((answer[..2].to_vec(), usize::from(answer[2])), (vec![0x44, 0x4B], length));
    answer[10..length - 1].to_vec()
}

#[test]
fn a_host_finds_the_image_on_a_socket_and_runs_a_motor_in_real_time() {
    let mut process = Command::new(env!("CARGO_BIN_EXE_emulate"))
        .args(["serve", "--tcp", "127.0.0.1:0"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("it starts");
    let mut place = String::new();
    let out = process.stdout.take().expect("its output");
    let _chip = Chip(process);
    BufReader::new(out).read_line(&mut place).expect("its place");
    let mut line = TcpStream::connect(place.trim()).expect("it listens");
    line.set_nodelay(true).expect("a socket");
    line.set_read_timeout(Some(Duration::from_secs(5))).expect("a socket");

    assert_eq!(ask(&mut line, 255, 0x7F0F, &[]), [1]);
    for (function, payload) in [(8, &[0, 1, 0][..]), (17, &[0, 0xE8, 3]), (10, &[0, 1])] {
        assert_eq!(ask(&mut line, 2, 0x1000 + function, payload), [1]);
    }
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(2) {
        assert_eq!(ask(&mut line, 2, 0x1000, &[]).len(), 35);
    }
    let bulk = ask(&mut line, 2, 0x1000, &[]);
    let counts = i32::from_le_bytes([bulk[1], bulk[2], bulk[3], bulk[4]]);
    // 1000 counts/s for two seconds, less the start; more on a machine that catches up.
    assert!((1_000..2_500).contains(&counts), "{counts}");
}
