//! Commands to the wheels of a drive base for the parts of a course.

use motor_hub::extension::group::GroupCourse;
use motor_hub::group::{BaseSettings, DriveBase};
use motor_hub::units::RangeError;
use motor_hub_client::base::Part;

/// Wheels of 90 mm, 300 mm apart.
fn base(counts_per_turn: [f64; 2]) -> BaseSettings {
    let base = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn };
    BaseSettings::new([0, 1], &base, false).expect("in range")
}

/// Returns the target positions of both wheels after these parts, from the position 0.
fn targets(base: &BaseSettings, parts: &[Part]) -> [i32; 2] {
    let mut at = [0.0; 2];
    let mut last = [0; 2];
    for part in parts {
        let (to, command) = part.command(base, at, 200.0, 400.0).expect("in range");
        at = to;
        let GroupCourse::Position([Some(left), Some(right), None, None]) = command.course else {
            panic!("{command:?}")
        };
        last = [left, right];
    }
    last
}

#[test]
fn many_small_parts_move_a_base_as_far_as_a_large_part() {
    for (counts, degrees, number) in [(44.0, 1.0, 10), (560.0, 90.0, 8), (560.0, -0.1, 900)] {
        let base = base([counts, -counts]);
        let whole = targets(&base, &[Part::Turn(degrees * f64::from(number))]);
        assert_ne!(whole, [0; 2]);
        assert_eq!(targets(&base, &vec![Part::Turn(degrees); number as usize]), whole, "{degrees} degrees");
    }
    // Positions wrap.
    let (_, command) = Part::Straight(100.0)
        .command(&base([1_680.0; 2]), [f64::from(i32::MAX); 2], 200.0, 400.0)
        .expect("in range");
    let near = Some(i32::MAX.wrapping_add(594));
    assert_eq!(command.course, GroupCourse::Position([near, near, None, None]));
}

#[test]
fn speed_and_acceleration_are_those_of_the_wheel_with_more_counts() {
    for counts in [[560.0, -1_680.0], [-1_680.0, 560.0]] {
        let (_, command) =
            Part::Turn(90.0).command(&base(counts), [0.0; 2], 282.743_339, 565.486_678).expect("in range");
        // A turn of a wheel is pi times 90 mm.
        assert_eq!((command.speed.round(), command.acceleration.get()), (1_680, 3_360), "{counts:?}");
    }
}

#[test]
fn an_error_names_what_is_out_of_range() {
    let base = base([2e6; 2]);
    let command =
        |part: Part, speed, acceleration| part.command(&base, [0.0; 2], speed, acceleration).map(drop);
    assert_eq!(command(Part::Turn(1.0), 1e3, 1e5), Ok(()));
    assert_eq!(command(Part::Turn(1.0), 1e6, 1e3), Err(RangeError::Speed));
    assert_eq!(command(Part::Turn(1.0), 1e3, 1e6), Err(RangeError::Acceleration));
    assert_eq!(command(Part::Straight(1e6), 1e3, 1e3), Err(RangeError::Distance));
}
