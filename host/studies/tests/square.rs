//! A drive base comes back from the square of UMBmark. The long test writes the table of `docs/results/square.md`.

use std::path::Path;
use studies::square::{self, End};

#[test]
#[ignore = "long: cargo xtask long"]
fn a_gyro_brings_a_base_back_from_both_squares_and_encoders_do_not() {
    let [encoders, calibrated, gyro, worse, scaled] = square::run().expect("the simulation runs");
    let text = square::page(&[encoders, calibrated, gyro, worse, scaled]).markdown();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/results");
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join("square.md"), &text).expect("a file");
    let worst = |ends: [End; 2], of: fn(End) -> f64| ends.map(of).into_iter().fold(0.0, f64::max);
    let heading = |ends| worst(ends, |end| end.heading_degrees.abs());
    let distance = |ends| worst(ends, |end| end.distance_mm);
    assert!(heading(gyro.ends) <= 0.5, "{text}");
    // The scale error is 1 % of a whole turn, 3.6 degrees. The drift adds about half a degree.
    assert!((3.0..5.0).contains(&heading(worse.ends)), "{text}");
    assert!(heading(scaled.ends) <= 1.0, "{text}");
    assert!(distance(worse.ends) < 0.2 * distance(encoders.ends), "{text}");
    assert!(distance(gyro.ends) < 0.05 * distance(encoders.ends), "{text}");
    assert!(gyro.ends.iter().all(|end| end.odometry_mm.is_some_and(|mm| mm < 100.0)), "{text}");
    assert!(heading(encoders.ends) > 20.0, "the floor is hard enough: {text}");
    assert!(heading(calibrated.ends) < 0.1 * heading(encoders.ends), "{text}");
}
