//! Colours as a deuteranope sees them: readers who see no green can distinguish the bands.

use super::{colour, fill};

/// Machado, Oliveira and Fernandes, "A Physiologically-based Model for Simulation of Color Vision Deficiency"
/// (2009), deuteranopia: severity 1.0, on linear RGB.
const DEUTERANOPIA: [[f64; 3]; 3] = [
    [0.367_322, 0.860_646, -0.227_968],
    [0.280_085, 0.672_501, 0.047_413],
    [-0.011_820, 0.042_940, 0.968_881],
];

/// Linear sRGB to CIE XYZ, relative to white (D65).
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

/// CIE L*a*b* of a colour as a deuteranope sees it.
fn seen(colour: &str) -> [f64; 3] {
    let rgb = times(DEUTERANOPIA, linear(colour)).map(|share| share.clamp(0.0, 1.0));
    let root = |t: f64| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
    let [x, y, z] = times(XYZ, rgb).map(root);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// CIE76.
fn distance(a: &str, b: &str) -> f64 {
    let squares = seen(a).into_iter().zip(seen(b)).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

fn assert_told_apart(colours: &[&str]) {
    for (index, a) in colours.iter().enumerate() {
        for b in &colours[index + 1..] {
            assert!(distance(a, b) >= 20.0, "{a} and {b}: {:.1}", distance(a, b));
        }
    }
}

#[test]
fn bands_are_told_apart_by_deuteranopes() {
    assert_told_apart(&[fill::FORWARD, fill::BRAKING, fill::REVERSE, "#ffffff"]);
}

#[test]
fn lines_are_told_apart_by_deuteranopes() {
    assert_told_apart(&[colour::INK, colour::BLUE, colour::RED, colour::GREEN]);
    assert_told_apart(&[colour::INK, colour::FORWARD, colour::BRAKING, colour::REVERSE]);
}

#[test]
fn light_green_and_light_red_are_not() {
    assert!(distance("#e2f2de", "#f8dbd7") < 5.0);
}
