//! The tables `[[groups]]`: motors that move in step, and their courses.

use super::{find, timeline};
use crate::scenario::error::Checked;
use crate::scenario::numbers::{
    AccelerationLimit, Counts, Distance, Length, Name, Speed, SpeedLimit, WithinMillion, or,
};
use crate::scenario::types::{Group, Motor};
use motor_hub::group::{BaseSettings, Course, DriveBase, GroupCommand, Halt};
use motor_hub::units::{Acceleration, CountsPerSecond};
use serde::Deserialize;
use std::collections::BTreeSet;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GroupTable {
    pub(super) label: Name,
    motors: Vec<Spanned<String>>,
    base: Option<BaseTable>,
    #[serde(default)]
    halt: Halt,
    courses: Vec<Spanned<CourseTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BaseTable {
    wheel_diameter_mm: Length,
    track_mm: Length,
    counts_per_turn: Option<[WithinMillion; 2]>,
    #[serde(default)]
    use_gyro: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CourseTable {
    at_s: f64,
    by_counts: Option<Vec<Counts>>,
    to_counts: Option<Vec<Counts>>,
    on_cps: Option<Vec<Speed>>,
    straight_mm: Option<WithinMillion>,
    turn_degrees: Option<WithinMillion>,
    speed_cps: Option<SpeedLimit>,
    acceleration_cps2: AccelerationLimit,
    lag_counts: Option<Distance>,
    tolerance_counts: Option<Distance>,
}

const TOO_LONG: &str = "the course is longer than 2147483647 counts";

impl GroupTable {
    pub(super) fn check(&self, all: &[Motor], duration_s: f64) -> Checked<Group> {
        let motors = self.members(all)?;
        let base = self.base.as_ref().map(|base| base.check(&motors, all)).transpose()?;
        let use_gyro = self.base.as_ref().is_some_and(|base| base.use_gyro);
        if use_gyro && motors != [0, 1] {
            return Err("use_gyro needs the first two motors of the file as wheels, left and right: the \
                        simulated gyro stands on their base"
                .into());
        }
        if use_gyro && base.as_ref().is_none_or(|base| BaseSettings::new([0, 1], base, true).is_err()) {
            return Err("a base with use_gyro has wheels and a track of 1 mm to 10 m".into());
        }
        if self.courses.is_empty() {
            return Err("a group needs at least one course".into());
        }
        let courses = timeline(&self.courses, duration_s, |table| {
            let course = table.check(&motors, base.as_ref());
            (table.at_s, course.map(|course| GroupCommand { halt: self.halt, ..course }))
        })?;
        Ok(Group { label: self.label.0.clone(), motors, base, use_gyro, courses })
    }

    fn members(&self, all: &[Motor]) -> Checked<Vec<usize>> {
        let mut members = Vec::new();
        for label in &self.motors {
            members.push(find("motor", label, all.iter().map(|motor| &motor.label))?);
        }
        let different = members.iter().collect::<BTreeSet<_>>().len();
        if different < members.len() || members.len() < 2 {
            return Err("a group needs two motors or more, each named once".into());
        }
        Ok(members)
    }
}

impl BaseTable {
    fn check(&self, members: &[usize], all: &[Motor]) -> Result<DriveBase, String> {
        let &[left, right] = members else {
            return Err("a base needs two motors, left and right".to_owned());
        };
        // By default each wheel is on the output shaft of its motor.
        let of_motor =
            |index: usize| all.get(index).map_or(f64::NAN, |motor| motor.constants.counts_per_rev_output());
        let counts_per_turn =
            self.counts_per_turn.map_or([left, right].map(of_motor), |given| given.map(|n| n.0));
        if let Some(counts) = counts_per_turn.into_iter().find(|counts| counts.abs() < 1.0) {
            return Err(format!(
                "counts_per_turn = {counts} is out of range; allowed is 1 to 1000000, or -1000000 to -1"
            ));
        }
        let (wheel_diameter_mm, track_mm) = (self.wheel_diameter_mm.0, self.track_mm.0);
        Ok(DriveBase { wheel_diameter_mm, track_mm, counts_per_turn })
    }
}

impl CourseTable {
    fn check(&self, members: &[usize], base: Option<&DriveBase>) -> Result<GroupCommand, String> {
        let course = self.course(members, base)?;
        let acceleration = Acceleration::new(self.acceleration_cps2.0).map_err(|error| error.to_string())?;
        let usual = GroupCommand::new(course, self.speed(&course)?, acceleration);
        let (lag, tolerance) = (or(self.lag_counts, usual.lag), or(self.tolerance_counts, usual.tolerance));
        Ok(GroupCommand { lag, tolerance, ..usual })
    }

    /// Returns the speed of the course. A course of `on_cps` has no `speed_cps`; its speed is the largest speed of a
    /// member.
    fn speed(&self, course: &Course) -> Result<CountsPerSecond, String> {
        match (self.speed_cps, course) {
            (None, Course::Velocity(speeds)) => {
                let largest = speeds.iter().flatten().max_by_key(|speed| speed.to_bits().unsigned_abs());
                Ok(largest.copied().unwrap_or_default())
            }
            (Some(_), Course::Velocity(_)) => Err("on_cps has its own speeds; remove speed_cps".to_owned()),
            (Some(speed), _) => Ok(CountsPerSecond::new(speed.0)),
            (None, _) => Err("a course needs speed_cps; only on_cps is without".to_owned()),
        }
    }

    fn course(&self, members: &[usize], base: Option<&DriveBase>) -> Result<Course, String> {
        let of_base = (self.straight_mm.is_some() || self.turn_degrees.is_some()).then_some(());
        // Members are motors of the hub, so only the length of a course can be wrong.
        let course = match (&self.by_counts, &self.to_counts, &self.on_cps, of_base) {
            (Some(counts), None, None, None) => {
                Course::distances(&by_member("by_counts", counts, members, |n| n.0)?)
            }
            (None, Some(counts), None, None) => {
                Course::positions(&by_member("to_counts", counts, members, |n| n.0)?)
            }
            (None, None, Some(speeds), None) => {
                Course::velocities(&by_member("on_cps", speeds, members, |n| CountsPerSecond::new(n.0))?)
            }
            (None, None, None, Some(())) => {
                let base = base.ok_or("straight_mm and turn_degrees need a base in the group")?;
                let counts = base.arc(or(self.straight_mm, 0.0), or(self.turn_degrees, 0.0));
                let counts = counts.map_err(|_| TOO_LONG)?;
                Course::distances(&members.iter().copied().zip(counts).collect::<Vec<_>>())
            }
            _ => {
                return Err(
                    "a course needs exactly one of by_counts, to_counts, on_cps, and straight_mm or \
                            turn_degrees or both"
                        .to_owned(),
                );
            }
        };
        course.map_err(|_| TOO_LONG.to_owned())
    }
}

/// A number for each member, in the order of the group's motors.
fn by_member<N, T>(
    key: &str,
    numbers: &[N],
    members: &[usize],
    value: impl Fn(&N) -> T,
) -> Result<Vec<(usize, T)>, String> {
    let (given, wanted) = (numbers.len(), members.len());
    if given != wanted {
        return Err(format!("{key} has {given} numbers; it needs {wanted}, one for each motor of the group"));
    }
    Ok(members.iter().copied().zip(numbers.iter().map(value)).collect())
}
