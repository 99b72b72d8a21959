//! References of a group's members, without motors.

use crate::{by as distances, numbered, on, to};
use motor_hub::group::{Course, DriveBase, Group, GroupCommand, Halt, MOTORS};
use motor_hub::regulator::Reference;
use motor_hub::units::{Acceleration, CountsPerSecond, Period, RangeError};
use proptest::prelude::*;

fn together(course: Course, speed: i32, acceleration: u32) -> GroupCommand {
    GroupCommand {
        course,
        speed: CountsPerSecond::new(speed),
        acceleration: Acceleration::new(acceleration).expect("above 0"),
        lag: u16::MAX,
        tolerance: 0,
        halt: Halt::Stop,
    }
}

fn period(ms: u32) -> Period {
    Period::from_millis(ms).expect("in range")
}

/// Motors that follow their references exactly, but one tick late.
struct Perfect<const N: usize> {
    group: Group<N>,
    last: [Reference; N],
    /// Counts since the start, also after positions have wrapped.
    moved: [f64; N],
}

impl<const N: usize> Perfect<N> {
    fn new(together: GroupCommand, positions: [i32; N], ms: u32) -> Self {
        let group = Group::new(together, positions, [CountsPerSecond::ZERO; N], period(ms));
        let last = positions.map(|position| Reference { position, ..Reference::default() });
        Self { group, last, moved: [0.0; N] }
    }

    fn positions(&self) -> [i32; N] {
        self.last.map(|reference| reference.position)
    }

    fn step(&mut self) -> [Reference; N] {
        let references = self.group.step(&self.positions()).map(|reference| reference.expect("a member"));
        for ((moved, last), new) in self.moved.iter_mut().zip(self.last).zip(references) {
            let part = (f64::from(new.fraction) - f64::from(last.fraction)) / 65_536.0;
            *moved += f64::from(new.position.wrapping_sub(last.position)) + part;
        }
        self.last = references;
        references
    }
}

fn counts(most: i32) -> impl Strategy<Value = [i32; 4]> {
    [-most..=most, -most..=most, -most..=most, -most..=most]
}

fn course() -> impl Strategy<Value = Course> {
    prop_oneof![counts(20_000).prop_map(distances), counts(20_000).prop_map(to), counts(3_000).prop_map(on),]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn references_are_in_proportion_to_a_count_at_any_time(
        start in any::<[i32; 4]>(),
        by in prop_oneof![counts(3_000), counts(2_000_000), counts(i32::MAX)],
        speed in 100..1_000_000i32,
        acceleration in 100..10_000_000u32,
        ms in 1..=100u32,
    ) {
        let mut motors = Perfect::new(together(distances(by), speed, acceleration), start, ms);
        let longest = by.iter().map(|by| f64::from(by.abs())).fold(1.0, f64::max);
        for _ in 0..500 {
            motors.step();
            let along = motors.moved.iter().zip(by).find(|(_, by)| f64::from(by.abs()) == longest);
            let share = along.map_or(0.0, |(moved, by)| moved / f64::from(by));
            for (moved, by) in motors.moved.iter().zip(by) {
                prop_assert!((moved - share * f64::from(by)).abs() < 0.01, "{:?} of {by:?}", motors.moved);
            }
        }
    }

    #[test]
    fn it_ends_where_it_should_without_going_too_fast(
        start in any::<[i32; 4]>(),
        by in counts(20_000),
        speed in 500..5_000i32,
        acceleration in 1_000..50_000u32,
        ms in 1..=100u32,
    ) {
        let mut motors = Perfect::new(together(distances(by), speed, acceleration), start, ms);
        let longest = by.iter().map(|by| f64::from(by.abs())).fold(0.0, f64::max);
        let (speed, acceleration) = (f64::from(speed), f64::from(acceleration));
        let seconds = longest / speed + 2.0 * speed / acceleration + 0.5;
        for _ in 0..(seconds * 1e3 / f64::from(ms)) as u32 + 3 {
            for reference in motors.step() {
                prop_assert!(reference.next.to_f64().abs() <= speed + 0.01);
            }
        }
        let ends: Vec<i32> = start.iter().zip(by).map(|(start, by)| start.wrapping_add(by)).collect();
        prop_assert_eq!(motors.positions().to_vec(), ends);
        prop_assert!(motors.group.is_within_tolerance(&motors.positions()));
    }

    #[test]
    fn speeds_never_step_whatever_course_follows_another(
        courses in proptest::collection::vec((course(), 1..60usize), 1..8),
        acceleration in 1_000..50_000u32,
        ms in 1..=100u32,
    ) {
        let mut motors = Perfect::new(together(courses[0].0, 2_000, acceleration), [0; 4], ms);
        let seconds = f64::from(ms) / 1e3;
        let gained = f64::from(acceleration) * seconds;
        let mut before = [Reference::default(); 4];
        for (course, ticks) in courses {
            motors.group.redirect(together(course, 2_000, acceleration));
            for _ in 0..ticks {
                let moved = motors.moved;
                for (new, old) in motors.step().iter().zip(before) {
                    let step = new.speed.to_f64() - old.next.to_f64();
                    prop_assert!(step.abs() <= 0.51 * gained + 1.0, "{step} of {gained}");
                    let change = new.next.to_f64() - new.speed.to_f64();
                    prop_assert!(change.abs() <= 1.01 * gained + 1.0, "{change} of {gained}");
                }
                // Each change of position is the integral of the speed.
                for ((new, old), reference) in motors.moved.iter().zip(moved).zip(before) {
                    let mean = (reference.speed.to_f64() + reference.next.to_f64()) / 2.0;
                    let off = new - old - mean * seconds;
                    prop_assert!(off.abs() <= 0.26 * gained * seconds + 1.0, "{off}");
                }
                before = motors.last;
            }
        }
    }
}

#[test]
fn targets_that_change_by_some_counts_while_the_group_brakes_are_reached_soon_and_not_overshot() {
    for ms in [1, 10, 50] {
        for targets in [[1_001, 500], [999, 500], [998, 499], [1_000, 490], [990, 505]] {
            let mut motors = Perfect::new(together(to([1_000, 500]), 2_000, 4_000), [0, 0], ms);
            while motors.positions()[0] < 600 {
                motors.step();
            }
            motors.group.redirect(together(to(targets), 2_000, 4_000));
            // Braking over 400 counts takes 0.45 s. Ten counts from standstill to standstill take 0.1 s.
            for _ in 0..600 / ms {
                let [left, right] = motors.step().map(|reference| reference.position);
                assert!(left <= 1_001 && right <= 505, "{targets:?}, {ms} ms: {left}, {right}");
            }
            assert_eq!(motors.positions(), targets, "{ms} ms");
        }
    }
}

#[test]
fn a_course_without_an_end_adds_nothing_up() {
    let rates = [1_000_000, 333_333, -7, 65_537].map(CountsPerSecond::from_bits);
    let course = Course::velocities(&numbered(rates)).expect("four");
    let mut motors = Perfect::new(together(course, 0, 4_000_000), [i32::MAX; 4], 100);
    for _ in 0..3_000_000 {
        motors.step();
    }
    let [most, ..] = motors.moved;
    // After 3.5 days the positions have wrapped.
    assert!(most > 1e9, "{most}");
    for (moved, rate) in motors.moved.iter().zip(rates) {
        let right = most * f64::from(rate.to_bits()) / 1e6;
        assert!((moved - right).abs() < 0.1, "{moved} for {right}");
    }
}

#[test]
fn a_member_that_lags_slows_and_stops_the_group() {
    for (lag, pace) in [(0, 1.0), (50, 1.0), (75, 0.5), (100, 0.0), (1_000, 0.0)] {
        for sign in [1, -1] {
            let course = on([sign * 1_000, sign * 500]);
            let together = GroupCommand { lag: 100, ..together(course, 0, 1_000_000) };
            let mut motors = Perfect::new(together, [0; 2], 10);
            for _ in 0..10 {
                motors.step();
            }
            let mut positions = motors.positions();
            motors.step();
            let [_, second] = motors.positions();
            positions[1] = second - sign * lag;
            // The other wheels do not wait for a wheel that is ahead.
            positions[0] += sign * 5_000;
            let [_, slow] = motors.group.step(&positions).map(|reference| reference.expect("a member"));
            // Positions are rounded to counts: half a count per tick is 50 counts/s.
            assert!((slow.next.to_f64() - f64::from(sign) * 500.0 * pace).abs() < 55.0, "{lag}: {slow:?}");
        }
    }
}

#[test]
fn a_motor_that_has_left_does_not_prolong_the_stop_of_the_others() {
    let mut motors = Perfect::new(together(on([200, 100, 4_000]), 0, 2_000), [0; 3], 10);
    for _ in 0..300 {
        motors.step();
    }
    motors.group.remove(2);
    motors.group.stop();
    let mut positions = motors.positions();
    let mut ticks = 0;
    let mut is_still = false;
    while !is_still {
        let references = motors.group.step(&positions);
        assert_eq!(references[2], None);
        for (position, reference) in positions.iter_mut().zip(references) {
            *position = reference.map_or(*position, |reference| reference.position);
        }
        is_still = references.into_iter().flatten().all(|reference| reference.next == CountsPerSecond::ZERO);
        ticks += 1;
    }
    // From 200 counts/s with 2000 counts/s2.
    assert!((10..=11).contains(&ticks), "{ticks} ticks of 10 ms");
}

#[test]
fn a_course_names_its_members() {
    assert_eq!(Course::distances(&[(MOTORS, 1)]), Err(RangeError::Motor));
    let members = Course::positions(&[(1, 5), (3, 0)]).expect("in range").members();
    assert_eq!(members, [false, true, false, true, false, false, false, false]);
}

#[test]
fn distances_and_headings_are_counts_and_counts_are_them() {
    let base = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1_680.0, -1_120.0] };
    // A turn of a wheel is pi times 90 mm.
    assert_eq!(base.straight(282.743_339), Ok([1_680, -1_120]));
    // A wheel goes 300 pi / 4 mm.
    assert_eq!(base.turn(90.0), Ok([-1_400, -933]));
    // The base turns about its left wheel.
    let [left, right] = base.arc(150.0 * std::f64::consts::PI / 2.0, 90.0).expect("in range");
    assert_eq!((left, right), (0, -1_867));
    for (mm, degrees) in [(1_000.0, 0.0), (-200.0, 45.0), (0.0, -720.0)] {
        let counts = base.arc(mm, degrees).expect("in range");
        assert!((base.distance(counts) - mm).abs() < 0.3);
        assert!((base.heading(counts) - degrees).abs() < 0.1);
    }
    assert_eq!(base.straight(1e9), Err(RangeError::Distance));
    assert_eq!(base.turn(f64::NAN), Err(RangeError::Distance));
    assert_eq!(base.speeds(1e8, 0.0), Err(RangeError::Speed));
}
