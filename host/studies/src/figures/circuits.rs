//! The bridge of the paper's section 1.2: where the current flows in both states of each mode, by the direction in
//! which the motor turns.

use chart::{Canvas, colour};
use motor_hub::braking::Regime;
use motor_hub::bridge::Mode;

/// Width of one circuit with its words, in pixels.
const WIDTH: f64 = 400.0;
/// Height of one circuit with its words, in pixels.
const HEIGHT: f64 = 410.0;
/// Height of the title above the circuits, in pixels.
const TITLE: f64 = 96.0;
/// The x coordinate of the battery within a circuit, in pixels.
const BATTERY_X: f64 = 50.0;
/// The x coordinate of the left half of the bridge, in pixels.
const LEFT_X: f64 = 160.0;
/// The x coordinate of the right half of the bridge, in pixels.
const RIGHT_X: f64 = 310.0;
/// Distance of a diode from its switch, in pixels.
const DIODE: f64 = 38.0;
/// The y coordinate of the upper rail within a circuit, in pixels.
const TOP: f64 = 70.0;
/// The y coordinate of the middles of the upper switches, in pixels.
const UPPER: f64 = 130.0;
/// The y coordinate of the motor, in pixels.
const MOTOR: f64 = 190.0;
/// The y coordinate of the middles of the lower switches, in pixels.
const LOWER: f64 = 250.0;
/// The y coordinate of the lower rail, in pixels.
const BOTTOM: f64 = 310.0;
/// Distance of coloured paths from the wires.
const BESIDE: f64 = 7.0;

type Points = Vec<(f64, f64)>;

/// Six circuits as an SVG document. The rows are the directions in which the motor turns, and the columns are the
/// regimes.
#[must_use]
pub fn circuits() -> String {
    let mut drawing =
        Canvas::new(3.0 * WIDTH, TITLE + 2.0 * HEIGHT, "Where the current flows in an H bridge");
    drawing.words((40.0, 34.0), 21.0, "Where the current flows, by mode (paper, section 1.2)");
    drawing.path(&[(40.0, 60.0), (76.0, 60.0)], colour::BLUE, false, 9);
    drawing.words((86.0, 64.5), 14.0, "first state, for the duty");
    drawing.path(&[(300.0, 60.0), (336.0, 60.0)], colour::RED, true, 9);
    drawing.words((346.0, 64.5), 14.0, "second state, for as long as a current flows");
    for (row, clockwise) in [true, false].into_iter().enumerate() {
        for (column, regime) in [Regime::Forward, Regime::Braking, Regime::Reverse].into_iter().enumerate() {
            let at = (WIDTH * column as f64, TITLE + HEIGHT * row as f64);
            circuit(&mut drawing, at, regime, clockwise);
        }
    }
    drawing.svg()
}

/// One bridge with the paths of a regime's mode.
fn circuit(drawing: &mut Canvas, (x0, y0): (f64, f64), regime: Regime, clockwise: bool) {
    let mode = regime.mode(!clockwise);
    // The torque of braking and of reverse driving acts against the motion, so the current flows through the motor in
    // the other direction.
    let rightwards = clockwise == (regime == Regime::Forward);
    let turns = if clockwise { "CW" } else { "CCW" };
    let moved = |points: &[(f64, f64)]| -> Points { points.iter().map(|(x, y)| (x + x0, y + y0)).collect() };
    let title = format!("motor turns {turns}: {}, {}", regime.name(), mode.name());
    drawing.words((x0 + 40.0, y0 + 28.0), 16.0, &title);
    let [first, second] = if mode == Mode::Brake50 { braking() } else { driving() };
    let shown = |path: Points| moved(&if rightwards { path } else { mirrored(path) });
    drawing.path(&shown(first), colour::BLUE, false, 1);
    drawing.path(&shown(second), colour::RED, true, 1);
    for wire in wires() {
        drawing.line(&moved(&wire));
    }
    let states = match mode {
        Mode::Cw98 => [9, 8],
        Mode::Brake50 => [5, 0],
        Mode::Ccw62 => [6, 2],
    };
    for (number, (at, weight)) in HALVES.into_iter().zip([8, 4, 2, 1]).enumerate() {
        half(drawing, &moved, number + 1, at, states.map(|state| state & weight != 0));
    }
    let (x, y) = (x0 + f64::midpoint(LEFT_X, RIGHT_X), y0 + MOTOR);
    drawing.ring((x, y), 19.0);
    drawing.centred((x, y + 5.5), 16.0, "M");
    for (line, (state, text)) in states.into_iter().zip(words(regime, rightwards)).enumerate() {
        let y = y0 + BOTTOM + 40.0 + 20.0 * line as f64;
        drawing.words((x0 + 40.0, y), 13.5, &format!("{state}: {text}"));
    }
}

/// What the two states of a regime's mode do.
fn words(regime: Regime, rightwards: bool) -> [&'static str; 2] {
    use Regime::{Braking, Forward, Reverse};
    match (regime, rightwards) {
        (Forward, true) => ["the battery drives the motor", "flows on through S1 and D3, then stops"],
        (Forward, false) => ["the battery drives the motor", "flows on through S3 and D1, then stops"],
        (Braking, true) => ["the back EMF is shorted by S2 and S4", "charges the battery through D3 and D2"],
        (Braking, false) => ["the back EMF is shorted by S2 and S4", "charges the battery through D1 and D4"],
        (Reverse, true) => ["battery and back EMF both brake", "the back EMF is shorted by S1 and D3"],
        (Reverse, false) => ["battery and back EMF both brake", "the back EMF is shorted by S3 and D1"],
    }
}

/// Paths of two currents: to the right through S1 and S4, and freewheeling through S1 and D3.
fn driving() -> [Points; 2] {
    let [left, right] = [LEFT_X + BESIDE, RIGHT_X - BESIDE];
    let battery = BATTERY_X + BESIDE;
    let first = vec![
        (battery, MOTOR - 25.0),
        (battery, TOP + BESIDE),
        (left, TOP + BESIDE),
        (left, MOTOR - BESIDE),
        (right, MOTOR - BESIDE),
        (right, BOTTOM - BESIDE),
        (battery, BOTTOM - BESIDE),
        (battery, MOTOR + 25.0),
    ];
    let left = LEFT_X - BESIDE;
    let second = [
        (RIGHT_X + BESIDE, TOP - BESIDE),
        (left, TOP - BESIDE),
        (left, MOTOR + BESIDE),
        (RIGHT_X + BESIDE, MOTOR + BESIDE),
    ];
    [first, through_upper_diode(&second)]
}

/// Paths of two currents: to the right through S4 and S2, and through D3, battery and D2.
fn braking() -> [Points; 2] {
    let [left, right] = [LEFT_X + BESIDE, RIGHT_X - BESIDE];
    let (row, rail) = (MOTOR + BESIDE, BOTTOM - BESIDE);
    let first = vec![(right, row), (right, rail), (left, rail), (left, row), (right, row)];
    let battery = BATTERY_X - BESIDE;
    let [inner, outer] = [LEFT_X - BESIDE, LEFT_X - DIODE - BESIDE];
    let second = [
        (RIGHT_X + BESIDE, TOP - BESIDE),
        (battery, TOP - BESIDE),
        (battery, BOTTOM + BESIDE),
        (inner, BOTTOM + BESIDE),
        (inner, LOWER + LEAD + BESIDE),
        (outer, LOWER + LEAD + BESIDE),
        (outer, LOWER - LEAD - BESIDE),
        (inner, LOWER - LEAD - BESIDE),
        (inner, MOTOR - BESIDE),
        (RIGHT_X + BESIDE, MOTOR - BESIDE),
    ];
    [first, through_upper_diode(&second)]
}

/// A path that begins above D3, and ends there after it has come up through D3.
fn through_upper_diode(path: &[(f64, f64)]) -> Points {
    let [inner, outer] = [RIGHT_X + BESIDE, RIGHT_X + DIODE + BESIDE];
    let [low, high] = [UPPER + LEAD + BESIDE, UPPER - LEAD - BESIDE];
    let diode = [(inner, low), (outer, low), (outer, high), (inner, high)];
    [&[(inner, high)], path, &diode].concat()
}

/// The path in the other half of the bridge. Points at the battery stay.
fn mirrored(path: Points) -> Points {
    let bridge = LEFT_X - 2.0 * DIODE..=RIGHT_X + 2.0 * DIODE;
    let other = |x: f64| if bridge.contains(&x) { LEFT_X + RIGHT_X - x } else { x };
    path.into_iter().map(|(x, y)| (other(x), y)).collect()
}

/// The rails, the wire through the motor, and the battery with its poles.
fn wires() -> [Points; 7] {
    [
        vec![(BATTERY_X, MOTOR - 6.0), (BATTERY_X, TOP), (RIGHT_X, TOP)],
        vec![(BATTERY_X, MOTOR + 6.0), (BATTERY_X, BOTTOM), (RIGHT_X, BOTTOM)],
        vec![(LEFT_X, MOTOR), (RIGHT_X, MOTOR)],
        vec![(BATTERY_X - 18.0, MOTOR - 6.0), (BATTERY_X + 18.0, MOTOR - 6.0)],
        vec![(BATTERY_X - 9.0, MOTOR + 6.0), (BATTERY_X + 9.0, MOTOR + 6.0)],
        vec![(BATTERY_X + 20.0, MOTOR - 16.0), (BATTERY_X + 30.0, MOTOR - 16.0)],
        vec![(BATTERY_X + 25.0, MOTOR - 21.0), (BATTERY_X + 25.0, MOTOR - 11.0)],
    ]
}

/// Distance from the middle of a switch to the wires of its diode.
const LEAD: f64 = 26.0;

/// Middles of the switches S1 to S4.
const HALVES: [(f64, f64); 4] = [(LEFT_X, UPPER), (LEFT_X, LOWER), (RIGHT_X, UPPER), (RIGHT_X, LOWER)];

/// Draws a switch with its diode, which conducts upwards. `closed` says whether the switch is closed in the mode's
/// first and in its second state.
fn half(
    drawing: &mut Canvas,
    moved: &impl Fn(&[(f64, f64)]) -> Points,
    number: usize,
    (x, y): (f64, f64),
    closed: [bool; 2],
) {
    let outwards = if x < f64::midpoint(LEFT_X, RIGHT_X) { -1.0 } else { 1.0 };
    let end = if y < MOTOR { TOP } else { BOTTOM };
    let (near, far) = if y < MOTOR { (y - LEAD, y + LEAD) } else { (y + LEAD, y - LEAD) };
    drawing.line(&moved(&[(x, end), (x, near)]));
    drawing.line(&moved(&[(x, far), (x, MOTOR)]));
    drawing.line(&moved(&[(x, y - LEAD), (x, y - 11.0)]));
    drawing.line(&moved(&[(x, y + 11.0), (x, y + LEAD)]));
    let lever = if closed[0] { 0.0 } else { -11.0 * outwards };
    drawing.line(&moved(&[(x, y + 11.0), (x + lever, y - 11.0)]));
    let diode = x + DIODE * outwards;
    drawing.line(&moved(&[(x, y - LEAD), (diode, y - LEAD), (diode, y + LEAD), (x, y + LEAD)]));
    drawing.polygon(&moved(&[(diode, y - 8.0), (diode - 8.0, y + 6.0), (diode + 8.0, y + 6.0)]), colour::INK);
    drawing.line(&moved(&[(diode - 8.0, y - 8.0), (diode + 8.0, y - 8.0)]));
    let is = match closed {
        [true, true] => "on",
        [true, false] => "PWM",
        [false, _] => "off",
    };
    let inside = moved(&[(x - 34.0 * outwards, y - 3.0), (x - 34.0 * outwards, y + 13.0)]);
    let beside = moved(&[(diode + 24.0 * outwards, y + 4.5)]);
    for (at, words) in
        inside.iter().chain(&beside).zip([format!("S{number}"), is.into(), format!("D{number}")])
    {
        drawing.centred(*at, 13.5, &words);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stretches of a path that run through the motor, as directions along x.
    fn through_motor(path: &[(f64, f64)]) -> Vec<f64> {
        let near = |y: f64| (y - MOTOR).abs() <= BESIDE;
        let stretches = path.windows(2).filter(|pair| near(pair[0].1) && near(pair[1].1));
        stretches.map(|pair| (pair[1].0 - pair[0].0).signum()).collect()
    }

    #[test]
    fn both_states_of_a_mode_push_the_current_through_the_motor_the_same_way() {
        for path in driving().into_iter().chain(braking()) {
            assert_eq!(through_motor(&path), [1.0]);
            assert_eq!(through_motor(&mirrored(path)), [-1.0]);
        }
    }

    #[test]
    fn only_braking_returns_a_current_to_the_positive_pole() {
        let to_the_battery = |path: &[(f64, f64)]| {
            let rail = path.windows(2).find(|pair| pair[1].0 < BATTERY_X + 20.0 && pair[0].1 < UPPER);
            rail.is_some_and(|pair| pair[1].0 < pair[0].0)
        };
        assert!(to_the_battery(&braking()[1]));
        assert!(!to_the_battery(&driving()[0]) && !to_the_battery(&driving()[1]));
    }
}
