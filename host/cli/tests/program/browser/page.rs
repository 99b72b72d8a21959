//! The page of `motor-hub dashboard` in a browser: opens it for a test, and does what many tests do on it.

use super::{Browser, Tab, find};
use crate::common::{PATIENCE, alone, wait_for};
use crate::page::Dashboard;
use serde_json::json;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Keys, as [`Tab::press`] takes them.
pub(crate) const ESCAPE: (&str, u32) = ("Escape", 27);
pub(crate) const SPACE: (&str, u32) = (" ", 32);
pub(crate) const ENTER: (&str, u32) = ("Enter", 13);

/// Names of all panels.
pub(crate) const PANELS: [&str; 9] =
    ["tune", "learn", "setup", "group", "record", "regimes", "devices", "hub", "world"];

/// Number of attempts of a test whose page showed nothing for 1 s.
const ATTEMPTS: u32 = 3;

/// Runs a test with a page of a simulated hub, in desktop size. The browser's console must have no errors at the end.
pub(crate) fn with_page(test: impl Fn(&mut Tab<'_>)) {
    with_page_of(&[], |_, tab| {
        test(tab);
        assert_eq!(tab.complaints(), Vec::<String>::new());
    });
}

/// Runs a test with a page of a dashboard that is started with these arguments, in desktop size. On a busy machine a page
/// may show nothing for 1 s, and then its motors are disabled. A test that fails on such a page runs again with a new one.
pub(crate) fn with_page_of(arguments: &[&str], test: impl Fn(&mut Dashboard, &mut Tab<'_>)) {
    let Some(program) = find() else { return };
    let _alone = alone();
    for attempt in 1.. {
        let mut dashboard = Dashboard::start(arguments);
        let mut browser = Browser::start(&program);
        let mut tab = browser.open(&dashboard.url, 1280, 1000);
        let done = catch_unwind(AssertUnwindSafe(|| {
            live(&mut tab);
            test(&mut dashboard, &mut tab);
        }));
        let Err(failure) = done else { return };
        if attempt == ATTEMPTS || !tab.was_starved() {
            resume_unwind(failure);
        }
        println!("the page showed nothing for 1 s: attempt {attempt} of {ATTEMPTS} does not count");
    }
}

/// Runs a test with two pages of one hub, each in its own browser. The first page drives motor 0 at 900 counts/s.
pub(crate) fn with_driver_and_viewer(test: impl FnOnce(Tab<'_>, Tab<'_>)) {
    let Some(program) = find() else { return };
    let _alone = alone();
    let dashboard = Dashboard::start(&[]);
    let (mut first, mut second) = (Browser::start(&program), Browser::start(&program));
    let mut driver = first.open(&dashboard.url, 1280, 1000);
    live(&mut driver);
    let mut viewer = second.open(&dashboard.url, 1280, 1000);
    live(&mut viewer);
    drive(&mut driver, 0, 900);
    test(driver, viewer);
}

/// Ends the page that drives a motor, and checks in a second page that the motors are disabled.
pub(crate) fn with_two_pages(name: &str, end: impl FnOnce(Tab<'_>), says_one_of: &[&str], most: Duration) {
    with_driver_and_viewer(|driver, mut viewer| {
        assert_eq!(viewer.text("#control"), "Another page is in control");
        let since = Instant::now();
        end(driver);
        let took = wait_for("a motor that is off", || {
            (viewer.ask(&motor(0, "enabled")) == false).then(|| since.elapsed())
        });
        println!("{name}: off after {:.0} ms", took.as_secs_f64() * 1e3);
        assert!(took < most, "{took:?}");
        viewer.wait(&format!(
            "{says_one_of:?}.some(says => document.querySelector('#notice').textContent.includes(says))"
        ));
        // A coasting motor has control 0 and current 0.
        viewer.wait(&format!("{} === 0 && {} === 0", motor(0, "control"), motor(0, "current_a")));
        viewer.wait("document.querySelector('#take').checkVisibility()");
        viewer.click("#take");
        viewer.says("#control", "You are in control");
        assert_eq!(viewer.complaints(), Vec::<String>::new());
    });
}

/// The folder of pictures: `target/dashboard`.
pub(crate) fn pictures() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("dashboard");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// A value of a motor in the newest frame, as an expression.
pub(crate) fn motor(motor: usize, what: &str) -> String {
    format!("dashboard.state.frame.motors[{motor}].{what}")
}

/// A part of a motor's card, as a selector.
pub(crate) fn card(motor: usize, part: &str) -> String {
    format!("#motors .card:nth-child({}) {part}", motor + 1)
}

/// A point in an element, scrolled into view; `x` and `y` are expressions of its box `b`, from its left upper corner.
pub(crate) fn point(tab: &mut Tab<'_>, selector: &str, x: &str, y: &str) -> (f64, f64) {
    let at = tab.ask(&format!(
        "(() => {{ const e = document.querySelector('{selector}'); e.scrollIntoView({{block: 'nearest'}}); const b = e.getBoundingClientRect(); return [b.x + {x}, b.y + {y}] }})()"
    ));
    (at[0].as_f64().unwrap_or_default(), at[1].as_f64().unwrap_or_default())
}

/// An event of the mouse's left button.
pub(crate) fn mouse(tab: &mut Tab<'_>, kind: &str, (x, y): (f64, f64)) {
    let buttons = i32::from(kind != "mouseReleased");
    tab.call(
        "Input.dispatchMouseEvent",
        json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1 }),
    );
}

/// Gives an element the focus.
pub(crate) fn focus(tab: &mut Tab<'_>, selector: &str) {
    tab.ask(&format!("document.querySelector('{selector}').focus()"));
}

/// The number in a field.
pub(crate) fn number(tab: &mut Tab<'_>, selector: &str) -> f64 {
    tab.ask(&format!("Number(document.querySelector('{selector}').value)")).as_f64().unwrap()
}

/// Waits until motor 0 is disabled, and returns the time since `since`.
pub(crate) fn off(tab: &mut Tab<'_>, since: Instant) -> Duration {
    tab.wait(&format!("{} === false", motor(0, "enabled")));
    since.elapsed()
}

/// Waits until frames with a good battery come, and the settings of all motors are known.
pub(crate) fn live(tab: &mut Tab<'_>) {
    tab.wait(
        "window.dashboard?.state.frame?.number > 4 && dashboard.state.frame.battery_v > 11 && dashboard.state.settings.length === 4",
    );
}

/// Takes control if no page has it. A page loses control when it shows no new values for 1 s, which a busy machine and
/// axe-core can cause.
pub(crate) fn take_control(tab: &mut Tab<'_>) {
    let end = Instant::now() + PATIENCE;
    while tab.ask("dashboard.state.controller === null") == true {
        assert!(Instant::now() < end, "the page never got control; {:#?}", tab.complaints());
        tab.click("#take");
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Takes a motor to a speed, by the page's own fields.
pub(crate) fn drive(tab: &mut Tab<'_>, index: usize, cps: i32) {
    let is_reached = format!("Math.abs({} - {cps}) < {}", motor(index, "velocity"), cps.abs() / 20);
    drive_until(tab, index, &cps.to_string(), &is_reached);
}

/// Enters a set-point in the card of a motor, enables the motor, and waits until an expression is true. The motor is
/// started again if the page has lost control meanwhile. A motor that still runs is not clicked: the click would stop it.
pub(crate) fn drive_until(tab: &mut Tab<'_>, index: usize, set_point: &str, is_reached: &str) {
    let end = Instant::now() + PATIENCE;
    while Instant::now() < end {
        take_control(tab);
        tab.fill(&card(index, "input[type=number]"), set_point);
        if tab.ask(&motor(index, "enabled")) == false {
            tab.click(&card(index, ".run"));
        }
        if tab.becomes(is_reached, Duration::from_secs(4)) {
            return;
        }
    }
    panic!("motor {index} was never at {set_point}: {is_reached}; {:#?}", tab.complaints());
}

/// Opens a part of the panel in use.
pub(crate) fn open(tab: &mut Tab<'_>, words: &str) {
    tab.ask(&format!(
        "[...document.querySelectorAll('#panel summary')].find((one) => one.checkVisibility() && one.textContent === '{words}').click(); 0"
    ));
}

/// Opens all parts of all panels, of which a user opens one at a time.
pub(crate) fn open_all(tab: &mut Tab<'_>) {
    tab.ask(
        "document.querySelectorAll('#panel details').forEach((one) => { one.removeAttribute('name'); one.open = true; })",
    );
}

/// Clicks the button with these words.
pub(crate) fn press(tab: &mut Tab<'_>, words: &str) {
    tab.ask(&format!(
        "document.querySelectorAll('[data-test]').forEach((one) => delete one.dataset.test); \
         [...document.querySelectorAll('#panel button, #curves button')].find((one) => one.checkVisibility() && one.textContent === '{words}').dataset.test = ''; 0"
    ));
    tab.click("[data-test]");
}

/// Keeps the next file that the page saves in `window.saved`, as a blob.
pub(crate) const CATCH: &str = "(() => { const make = URL.createObjectURL; \
     URL.createObjectURL = (blob) => { window.saved = blob; URL.createObjectURL = make; return make.call(URL, new Blob([])); }; })()";

/// Chooses a file in a file field.
pub(crate) fn choose(tab: &mut Tab<'_>, field: &str, name: &str, bytes: impl AsRef<[u8]>) {
    let bytes = bytes.as_ref();
    tab.ask(&format!(
        "(() => {{ const field = document.querySelector('{field}'); const kept = new DataTransfer(); \
         kept.items.add(new File([new Uint8Array({bytes:?})], '{name}')); field.files = kept.files; field.dispatchEvent(new Event('change')); }})()"
    ));
}

/// The text of a saved file.
pub(crate) fn saved(tab: &mut Tab<'_>) -> String {
    tab.wait("window.saved");
    tab.ask("window.saved.text()").as_str().unwrap().to_owned()
}

/// Chooses a theme with the page's own button.
pub(crate) fn theme(tab: &mut Tab<'_>, wanted: &str) {
    for _ in 0..3 {
        if tab.ask("document.querySelector('#theme').dataset.chosen") == wanted {
            return;
        }
        tab.click("#theme");
    }
}

/// Elements that are cut off, lie over another element, or are too small to be hit, by their boxes.
pub(crate) fn unobstructed(tab: &mut Tab<'_>) -> Vec<String> {
    let found = tab.ask(LOOK);
    found.as_array().unwrap().iter().map(|found| found.as_str().unwrap_or_default().to_owned()).collect()
}

/// Finds visible controls and texts that are wider than the page, cut off by their box, smaller than 44 px where they can
/// be tapped, or over each other. Elements that float over the page on a phone are checked separately.
const LOOK: &str = r"(() => {
  const wrong = [];
  const seen = [...document.querySelectorAll('button, select, input, h1, h2, h3, p, b, small, label, .pill, .fact, .badge, .chart, th, td, output')].filter((e) => e.checkVisibility({ visibilityProperty: true }) && e.type !== 'file');
  const name = (e) => `${e.tagName.toLowerCase()}${e.id ? '#' + e.id : ''} `.concat((e.getAttribute('aria-label') ?? e.textContent).slice(0, 40));
  const floats = (e) => getComputedStyle(e).position === 'fixed';
  const boxes = seen.map((e) => [e, e.getBoundingClientRect()]).filter(([, b]) => b.width && b.height);
  for (const [e, b] of boxes) {
    if (b.left < 0 || b.right > document.documentElement.clientWidth + 0.5) wrong.push(`beyond the edge: ${name(e)}`);
    if (!e.matches('input, select, .chart') && (e.scrollWidth > e.clientWidth + 1 && e.clientWidth)) wrong.push(`cut off: ${name(e)}`);
    if (e.matches('button, select, input') && b.height < 43.5 && !e.matches('.choose')) wrong.push(`too low at ${b.height}: ${name(e)}`);
    if (e.matches('button, select, input') && b.width < 43.5) wrong.push(`too narrow at ${b.width}: ${name(e)}`);
  }
  for (let i = 0; i < boxes.length; i += 1) for (let k = i + 1; k < boxes.length; k += 1) {
    const [[a, p], [b, q]] = [boxes[i], boxes[k]];
    if (a.contains(b) || b.contains(a) || floats(a) || floats(b)) continue;
    const [width, height] = [Math.min(p.right, q.right) - Math.max(p.left, q.left), Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top)];
    const top = document.querySelector('#top');
    if (top.contains(a) !== top.contains(b)) continue;
    if (width > 1 && height > 1) wrong.push(`over each other: ${name(a)} | ${name(b)}`);
  }
  if (document.querySelector('#top').offsetHeight > innerHeight / 4) wrong.push('the head takes more than a quarter of the window');
  if (document.documentElement.scrollWidth > document.documentElement.clientWidth) wrong.push('the page is wider than the window');
  return wrong;
})()";
