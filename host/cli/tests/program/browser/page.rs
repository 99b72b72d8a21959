//! The page of `motor-hub dashboard` in a browser: what its tests do again and again.

use super::Tab;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Where pictures go: `target/dashboard`.
pub(crate) fn pictures() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("dashboard");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// What the newest frame says of a motor, as an expression.
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

/// Waits until motor 0 is disabled, and returns the time since `since`.
pub(crate) fn off(tab: &mut Tab<'_>, since: Instant) -> Duration {
    tab.wait(&format!("{} === false", motor(0, "enabled")));
    since.elapsed()
}

/// Until frames come, and everything is known.
pub(crate) fn live(tab: &mut Tab<'_>) {
    tab.wait("window.dashboard?.state.frame?.number > 20 && dashboard.state.settings.length === 4");
    tab.wait("dashboard.state.frame.battery_v > 11");
}

/// Takes a motor to a speed, by the page's own fields.
pub(crate) fn drive(tab: &mut Tab<'_>, index: usize, cps: i32) {
    tab.fill(&card(index, "input[type=number]"), &cps.to_string());
    tab.click(&card(index, ".run"));
    tab.wait(&format!("Math.abs({} - {cps}) < {}", motor(index, "velocity"), cps.abs() / 20));
}

/// What is cut off, lies over something else, or is too small to be hit, by the boxes that are drawn.
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
