//! Odometry of a drive base. The benchmark of a square is a study: `host/studies/src/square.rs`.

use crate::BASE;
use motor_hub::group::Odometry;

#[test]
fn a_gyro_that_is_lost_and_found_leaves_no_jump() {
    let mut odometry = Odometry::new(BASE, [i32::MAX, i32::MIN]);
    let mut counts = [i32::MAX, i32::MIN];
    for step in 0..360 {
        let [left, right] = BASE.turn(1.0).expect("in range");
        counts = [counts[0].wrapping_add(left), counts[1].wrapping_add(right)];
        // After each start the gyro begins at another angle.
        let gyro = f64::from(step + 170 + 100 * (step / 50)).rem_euclid(360.0);
        let is_lost = step % 50 >= 30;
        if is_lost {
            odometry.lose_gyro();
        }
        let pose = odometry.step(counts, (!is_lost).then_some(gyro));
        assert!((pose.heading_degrees - f64::from(step + 1)).abs() < 5.0, "{step} {pose:?}");
        assert!(pose.x_mm.abs() < 1.0 && pose.y_mm.abs() < 1.0, "{pose:?}");
    }
}

#[test]
fn a_reading_of_the_gyro_replaces_what_the_wheels_have_given_since_the_reading_before() {
    let mut odometry = Odometry::new(BASE, [0, 0]);
    odometry.step([0, 0], Some(10.0));
    // The wheels turn the base by ten steps of 1 degree by their counts. Because of slip the base turns by 8 degrees in
    // all.
    let mut counts = [0, 0];
    for step in 1..=10 {
        let [left, right] = BASE.turn(1.0).expect("in range");
        counts = [counts[0] + left, counts[1] + right];
        let pose = odometry.step(counts, (step == 10).then_some(18.0));
        let expected = if step == 10 { 8.0 } else { BASE.heading(counts) };
        assert!((pose.heading_degrees - expected).abs() < 1e-9, "{step} {pose:?}");
    }
    let slip = BASE.heading(counts) - 8.0;
    assert!((odometry.slip_degrees() - slip).abs() < 1e-9, "{}", odometry.slip_degrees());
}
