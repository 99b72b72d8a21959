//! `motor-hub client jog` on a pseudo-terminal, against the served simulated hub.

use crate::common::{PROGRAM, client, err, fails, json, signal, wait_for};
use crate::conformance::Hub;
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, tcgetattr};
use std::fs::File;
use std::io::{Read, Write};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A pseudo-terminal on which the program runs.
struct Terminal {
    master: File,
    slave: File,
    process: Child,
}

impl Terminal {
    fn jog(hub: &Hub, arguments: &[&str]) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let path = ptsname(&master, Vec::new()).unwrap();
        let slave = rustix::fs::open(path, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
        let (master, slave) = (File::from(master), File::from(slave));
        let mut command = Command::new(PROGRAM);
        command.args(["client", "--tcp", &hub.place, "jog"]).args(arguments);
        command.stdin(slave.try_clone().unwrap()).stdout(slave.try_clone().unwrap()).stderr(Stdio::piped());
        let process = command.spawn().unwrap();
        // The output must be read, or the program would block.
        let mut shown = master.try_clone().unwrap();
        std::thread::spawn(move || while let Ok(1..) = shown.read(&mut [0; 1024]) {});
        let terminal = Self { master, slave, process };
        wait_for("a program that reads keys", || (!terminal.has_lines()).then_some(()));
        terminal
    }

    /// True if the terminal is in line mode, as shells need it.
    fn has_lines(&self) -> bool {
        tcgetattr(&self.slave)
            .unwrap()
            .local_modes
            .contains(LocalModes::ICANON | LocalModes::ECHO | LocalModes::ISIG)
    }

    fn keys(&mut self, keys: &str) {
        self.master.write_all(keys.as_bytes()).unwrap();
    }

    /// Waits for the end of the program, which must restore the terminal.
    fn end(mut self) -> (ExitStatus, String) {
        let errors = std::io::read_to_string(self.process.stderr.take().unwrap()).unwrap();
        let status = self.process.wait().unwrap();
        assert!(self.has_lines());
        (status, errors)
    }
}

fn motors(hub: &Hub) -> Vec<(i64, bool)> {
    let asked = client(hub, &["status", "--json"]);
    assert_eq!(err(&asked), "", "every motor was off");
    let status = json(&asked);
    let motors = status["motors"].as_array().unwrap();
    motors.iter().map(|m| (m["position"].as_i64().unwrap(), m["enabled"].as_bool().unwrap())).collect()
}

#[test]
fn a_key_drives_a_motor_while_it_is_held_and_not_longer() {
    let hub = Hub::served();
    let mut terminal = Terminal::jog(&hub, &["--speed-cps", "400", "--hold-s", "0.3"]);
    let begin = Instant::now();
    for _ in 0..10 {
        terminal.keys("\x1b[A");
        sleep(Duration::from_millis(100));
    }
    let pressed = begin.elapsed().as_secs_f64();
    // Without a key the motor stops long before this pause is over.
    sleep(Duration::from_millis(1500));
    // Another motor turns backward, and is disabled while it turns.
    for _ in 0..5 {
        terminal.keys("2j");
        sleep(Duration::from_millis(100));
    }
    terminal.keys(" q");
    assert!(terminal.end().0.success());
    let motors = motors(&hub);
    let (held, other) = (motors[0].0, motors[2].0);
    // The motor turns at 400 counts/s from the first key until 0.3 s after the last one, plus the time to stop. If it were
    // driven for the 1.5 s that follow, it would be 500 counts farther.
    let longest = 400.0 * (pressed + 0.3 + 0.4);
    assert!((300.0..longest).contains(&(held as f64)), "{pressed} s: {motors:?}");
    assert!(other < -10, "{motors:?}");
    assert_eq!((motors[1].0, motors[3].0), (0, 0));
}

#[test]
fn the_terminal_is_put_back_and_motors_stopped_however_it_ends() {
    let hub = Hub::served();
    for end in ["-TERM", "-HUP", "Ctrl-C"] {
        let mut terminal = Terminal::jog(&hub, &["--power", "0.3", "--hold-s", "5"]);
        terminal.keys("k");
        sleep(Duration::from_millis(300));
        if end == "Ctrl-C" {
            terminal.keys("\x03");
        } else {
            signal(terminal.process.id(), end);
        }
        let (status, errors) = terminal.end();
        assert_eq!(status.code(), Some(i32::from(end != "Ctrl-C")), "{end}: {errors}");
        assert!(motors(&hub).iter().all(|(_, enabled)| !enabled), "{end}");
    }
}

#[test]
fn without_a_terminal_nothing_is_driven() {
    let hub = Hub::served();
    let mut command = Command::new(PROGRAM);
    let output = command.args(["client", "--tcp", &hub.place, "jog"]).stdin(Stdio::null()).output().unwrap();
    fails(&output, 1, "not a terminal");
}
