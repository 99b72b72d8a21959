//! `motor-hub dashboard` in a real browser.
#![expect(clippy::unwrap_used, reason = "a failed access is a failed test")]

mod browser;

use browser::{Browser, Tab, find, wait_for};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// One browser at a time: what is measured in real time must not wait for another.
static ALONE: Mutex<()> = Mutex::new(());

const ESCAPE: u32 = 27;
const SPACE: u32 = 32;

/// The program, and its URL.
struct Dashboard {
    process: Child,
    url: String,
}

impl Dashboard {
    fn start(arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_motor-hub"));
        let mut process = command.arg("dashboard").args(arguments).stdout(Stdio::piped()).spawn().unwrap();
        let mut url = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut url).unwrap();
        Self { process, url: url.trim().to_owned() }
    }
}

impl Drop for Dashboard {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Where pictures go: `target/dashboard`.
fn pictures() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("dashboard");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

const LIVE: &str = "window.dashboard && dashboard.state.frame && dashboard.state.frame.number > 20 && dashboard.state.settings.length === 4";

/// The newest frame's word on motor 0.
fn motor0(what: &str) -> String {
    format!("dashboard.state.frame.motors[0].{what}")
}

/// Motor 0 at a speed, by the page's own fields.
fn drive(tab: &mut Tab<'_>, cps: i32) {
    tab.wait(LIVE);
    tab.fill("#motors .card:nth-child(1) input[type=number]", &cps.to_string());
    tab.click("#motors .card:nth-child(1) .run");
    tab.wait(&format!("Math.abs({} - {cps}) < {}", motor0("velocity"), cps.abs() / 20));
}

#[test]
fn pictures_of_the_page() {
    let Some(program) = find() else { return };
    let _alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let dashboard = Dashboard::start(&[]);
    let mut browser = Browser::start(&program, "pictures");
    let mut tab = browser.open(&dashboard.url, 1280, 1000);
    drive(&mut tab, 1000);
    for nm in ["0.6", "1.2", "0.2"] {
        tab.ask(&format!("dashboard.link.order('world', {{torque: {{motor: 0, nm: {nm}}}}})"));
        std::thread::sleep(Duration::from_secs(3));
    }
    tab.picture(&pictures().join("wide.png"), false);
    tab.ask("document.querySelector('#theme').click(), document.querySelector('#theme').click()");
    for panel in ["tune", "learn", "setup", "group", "record", "world"] {
        tab.click(&format!("#tab-{panel}"));
        std::thread::sleep(Duration::from_millis(200));
        tab.picture(&pictures().join(format!("{panel}.png")), true);
    }
    tab.resize(390, 844);
    std::thread::sleep(Duration::from_millis(500));
    tab.picture(&pictures().join("phone.png"), true);
    println!("{}", tab.ask("(() => { const p = (a) => { const s = [...a].sort((x, y) => x - y); return [s[s.length >> 1], s[Math.floor(0.99 * s.length)], s.length] }; return JSON.stringify([p(dashboard.drawn.took), p(dashboard.drawn.apart)]) })()"));
    println!("{:#?}", tab.complaints());
    println!("{}", tab.ask("new Promise((done) => { const at = []; const step = (now) => { at.push(now); at.length < 301 ? requestAnimationFrame(step) : done(at.slice(1).map((t, i) => t - at[i]).sort((a, b) => a - b).filter((_, i) => i % 20 === 0 || i > 295).join(' ')) }; requestAnimationFrame(step) })"));
    let _ = (ESCAPE, SPACE, Instant::now());
    let _ = wait_for("", || Some(()));
}
