//! Tests that readers with deuteranopia (red-green blindness, without green receptors) can distinguish the colours of charts.

use super::{colour, fill};

/// Converts linear RGB to linear RGB as seen with deuteranopia of severity 1.0 (Machado, Oliveira and Fernandes, "A
/// Physiologically-based Model for Simulation of Color Vision Deficiency", 2009).
const DEUTERANOPIA: [[f64; 3]; 3] = [
    [0.367_322, 0.860_646, -0.227_968],
    [0.280_085, 0.672_501, 0.047_413],
    [-0.011_820, 0.042_940, 0.968_881],
];

/// Converts linear sRGB to CIE XYZ, relative to white (D65).
const XYZ: [[f64; 3]; 3] = [
    [0.4124 / 0.950_47, 0.3576 / 0.950_47, 0.1805 / 0.950_47],
    [0.2126, 0.7152, 0.0722],
    [0.0193 / 1.088_83, 0.1192 / 1.088_83, 0.9505 / 1.088_83],
];

fn times(matrix: [[f64; 3]; 3], of: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row.iter().zip(of).map(|(a, b)| a * b).sum())
}

fn linear(colour: &str) -> [f64; 3] {
    [1, 3, 5].map(|at| {
        let byte = u8::from_str_radix(&colour[at..at + 2], 16).expect("#rrggbb");
        let share = f64::from(byte) / 255.0;
        if share <= 0.040_45 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
    })
}

/// Returns the CIE L*a*b* coordinates of a colour as seen with deuteranopia.
fn seen(colour: &str) -> [f64; 3] {
    let rgb = times(DEUTERANOPIA, linear(colour)).map(|share| share.clamp(0.0, 1.0));
    let root = |t: f64| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
    let [x, y, z] = times(XYZ, rgb).map(root);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Returns the colour difference CIE76 of two colours as seen with deuteranopia.
fn distance(a: &str, b: &str) -> f64 {
    let squares = seen(a).into_iter().zip(seen(b)).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

/// Asserts that each pair of colours differs by at least 20. Colours that differ by less than 5 are hard to distinguish.
fn assert_distinguishable(colours: &[&str]) {
    for (index, a) in colours.iter().enumerate() {
        for b in &colours[index + 1..] {
            assert!(distance(a, b) >= 20.0, "{a} and {b}: {:.1}", distance(a, b));
        }
    }
}

#[test]
fn deuteranopes_can_distinguish_bands() {
    assert_distinguishable(&[fill::FORWARD, fill::BRAKING, fill::REVERSE, "#ffffff"]);
}

#[test]
fn deuteranopes_can_distinguish_lines() {
    assert_distinguishable(&[colour::INK, colour::BLUE, colour::RED, colour::GREEN]);
    assert_distinguishable(&[colour::INK, colour::FORWARD, colour::BRAKING, colour::REVERSE]);
}

#[test]
fn deuteranopes_cannot_distinguish_light_green_and_light_red() {
    assert!(distance("#e2f2de", "#f8dbd7") < 5.0);
}
