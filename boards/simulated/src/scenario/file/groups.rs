//! The tables `[[groups]]`: which motors move in step, and where to.

use super::ranges::{self, FASTEST_CPS, HARDEST_CPS2, Whole, named, timeline, within};
use crate::scenario::definition::{Group, Motor};
use crate::scenario::mistake::{Checked, Mistake, fault};
use motor_hub::group::{Course, DriveBase, GroupCommand, Halt};
use motor_hub::units::{Acceleration, CountsPerSecond, RangeError};
use serde::Deserialize;
use std::ops::RangeInclusive;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GroupTable {
    label: Spanned<String>,
    motors: Spanned<Vec<Spanned<String>>>,
    base: Option<Spanned<BaseTable>>,
    #[serde(default)]
    halt: HaltWord,
    courses: Vec<Spanned<CourseTable>>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum HaltWord {
    #[default]
    Stop,
    Coast,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BaseTable {
    wheel_diameter_mm: Spanned<f64>,
    track_mm: Spanned<f64>,
    counts_per_turn: Option<[Spanned<f64>; 2]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CourseTable {
    at_s: Spanned<f64>,
    by_counts: Option<Spanned<Vec<Spanned<Whole>>>>,
    to_counts: Option<Spanned<Vec<Spanned<Whole>>>>,
    on_cps: Option<Spanned<Vec<Spanned<Whole>>>>,
    straight_mm: Option<Spanned<f64>>,
    turn_degrees: Option<Spanned<f64>>,
    speed_cps: Option<Spanned<Whole>>,
    acceleration_cps2: Spanned<Whole>,
    lag_counts: Option<Spanned<Whole>>,
    tolerance_counts: Option<Spanned<Whole>>,
}

/// A way or a base, in millimetres, or a turn in degrees.
const LARGEST: f64 = 1e6;

/// All groups of these motors.
pub(super) fn check(
    tables: &[Spanned<GroupTable>],
    motors: &[Motor],
    duration_s: f64,
) -> Checked<Vec<Group>> {
    let mut groups: Vec<Group> = Vec::with_capacity(tables.len());
    for table in tables {
        let group = table.get_ref().check(table, motors, duration_s)?;
        if groups.iter().any(|other| other.label == group.label) {
            return Err(fault(&table.get_ref().label, Mistake::LabelTaken(group.label)));
        }
        groups.push(group);
    }
    Ok(groups)
}

impl GroupTable {
    fn check(&self, whole: &Spanned<Self>, all: &[Motor], duration_s: f64) -> Checked<Group> {
        let motors = self.members(all)?;
        let base = self.base.as_ref().map(|base| base.get_ref().check(base, &motors, all)).transpose()?;
        if self.courses.is_empty() {
            return Err(fault(whole, Mistake::NoCourses));
        }
        let halt = match self.halt {
            HaltWord::Stop => Halt::Stop,
            HaltWord::Coast => Halt::Coast,
        };
        let course = |table: &CourseTable, whole: &Spanned<CourseTable>| {
            Ok(GroupCommand { halt, ..table.check(whole, &motors, base.as_ref())? })
        };
        let courses = timeline(&self.courses, duration_s, |course| &course.at_s, course)?;
        Ok(Group { label: named(&self.label, "label")?, motors, base, courses })
    }

    fn members(&self, all: &[Motor]) -> Checked<Vec<usize>> {
        let mut members = Vec::new();
        for label in self.motors.get_ref() {
            let index =
                all.iter().position(|motor| motor.label == label.get_ref().trim()).ok_or_else(|| {
                    let known = all.iter().map(|motor| motor.label.clone()).collect();
                    fault(label, Mistake::NoSuchLabel { label: label.get_ref().clone(), known })
                })?;
            if members.contains(&index) {
                return Err(fault(label, Mistake::GroupMembers));
            }
            members.push(index);
        }
        if members.len() < 2 { Err(fault(&self.motors, Mistake::GroupMembers)) } else { Ok(members) }
    }
}

impl BaseTable {
    fn check(&self, whole: &Spanned<Self>, members: &[usize], all: &[Motor]) -> Checked<DriveBase> {
        let &[left, right] = members else { return Err(fault(whole, Mistake::BaseOfTwo)) };
        // A wheel on the output shaft.
        let of_motor = |index: usize| {
            all.get(index)
                .map_or(f64::NAN, |motor| motor.constants.counts_per_rev_motor * motor.constants.gear_ratio)
        };
        let mut counts_per_turn = [left, right].map(of_motor);
        for (counts, given) in counts_per_turn.iter_mut().zip(self.counts_per_turn.iter().flatten()) {
            *counts = within(given, "counts_per_turn", -LARGEST..=LARGEST)?;
            if counts.abs() < 1.0 {
                return Err(fault(given, Mistake::CountsPerTurn(*counts)));
            }
        }
        Ok(DriveBase {
            wheel_diameter_mm: within(&self.wheel_diameter_mm, "wheel_diameter_mm", 1.0..=LARGEST)?,
            track_mm: within(&self.track_mm, "track_mm", 1.0..=LARGEST)?,
            counts_per_turn,
        })
    }
}

impl CourseTable {
    fn check(
        &self,
        whole: &Spanned<Self>,
        members: &[usize],
        base: Option<&DriveBase>,
    ) -> Checked<GroupCommand> {
        let course = self.course(whole, members, base)?;
        let limit = ranges::whole(&self.acceleration_cps2, "acceleration_cps2", 1..=HARDEST_CPS2)?;
        let too_long = |_: RangeError| fault(whole, Mistake::CourseTooLong);
        let acceleration = Acceleration::new(limit).map_err(too_long)?;
        let usual = GroupCommand::new(course, self.speed(whole, &course)?, acceleration);
        Ok(GroupCommand {
            lag: ranges::whole_or(&self.lag_counts, "lag_counts", 0..=u16::MAX, usual.lag)?,
            tolerance: ranges::whole_or(
                &self.tolerance_counts,
                "tolerance_counts",
                0..=u16::MAX,
                usual.tolerance,
            )?,
            ..usual
        })
    }

    /// Of a course that goes on the largest.
    fn speed(&self, whole: &Spanned<Self>, course: &Course) -> Checked<CountsPerSecond> {
        match (&self.speed_cps, course) {
            (None, Course::On(speeds)) => {
                let largest = speeds.iter().flatten().max_by_key(|speed| speed.to_bits().unsigned_abs());
                Ok(largest.copied().unwrap_or_default())
            }
            (Some(speed), Course::On(_)) => Err(fault(speed, Mistake::CourseSpeeds)),
            (Some(speed), _) => ranges::whole(speed, "speed_cps", 1..=FASTEST_CPS).map(CountsPerSecond::new),
            (None, _) => Err(fault(whole, Mistake::CourseSpeed)),
        }
    }

    fn course(&self, whole: &Spanned<Self>, members: &[usize], base: Option<&DriveBase>) -> Checked<Course> {
        let of_base = self.straight_mm.is_some() || self.turn_degrees.is_some();
        let kinds = [of_base, self.by_counts.is_some(), self.to_counts.is_some(), self.on_cps.is_some()];
        if kinds.into_iter().filter(|&given| given).count() != 1 {
            return Err(fault(whole, Mistake::CourseKind));
        }
        // Members are motors of the hub.
        let known =
            |course: Result<Course, RangeError>| course.map_err(|_| fault(whole, Mistake::CourseTooLong));
        if let Some(counts) = &self.by_counts {
            return known(Course::by(&by_member(counts, "by_counts", members, i32::MIN..=i32::MAX)?));
        }
        if let Some(counts) = &self.to_counts {
            return known(Course::to(&by_member(counts, "to_counts", members, i32::MIN..=i32::MAX)?));
        }
        if let Some(speeds) = &self.on_cps {
            let speeds = by_member(speeds, "on_cps", members, -FASTEST_CPS..=FASTEST_CPS)?;
            let speeds: Vec<_> =
                speeds.into_iter().map(|(motor, cps)| (motor, CountsPerSecond::new(cps))).collect();
            return known(Course::on(&speeds));
        }
        let base = base.ok_or_else(|| fault(whole, Mistake::BaseMissing))?;
        let part = |given: &Option<Spanned<f64>>, key| {
            given.as_ref().map_or(Ok(0.0), |way| within(way, key, -LARGEST..=LARGEST))
        };
        let way =
            base.arc(part(&self.straight_mm, "straight_mm")?, part(&self.turn_degrees, "turn_degrees")?);
        let counts = way.map_err(|_| fault(whole, Mistake::CourseTooLong))?;
        known(Course::by(&members.iter().copied().zip(counts).collect::<Vec<_>>()))
    }
}

/// A number for each member, in the order of the group's motors.
fn by_member(
    numbers: &Spanned<Vec<Spanned<Whole>>>,
    key: &'static str,
    members: &[usize],
    range: RangeInclusive<i32>,
) -> Checked<Vec<(usize, i32)>> {
    let (given, wanted) = (numbers.get_ref().len(), members.len());
    if given != wanted {
        return Err(fault(numbers, Mistake::CourseLength { key, numbers: given, members: wanted }));
    }
    let number =
        |(motor, number): (&usize, &Spanned<Whole>)| Ok((*motor, ranges::whole(number, key, range.clone())?));
    members.iter().zip(numbers.get_ref()).map(number).collect()
}
