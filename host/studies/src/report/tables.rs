//! A table of each motor and each group with both runs.

use super::{RunReport, WITHOUT};
use crate::expectations::Verdict;
use crate::groups::GroupMeasures;
use crate::measures::{Measures, Response};
use crate::settling;
use crate::table::{self, Table};
use simulated::scenario::expectation::Expectation;
use simulated::scenario::{Group, Motor};
use simulated::scheme;

/// Least width of a column in characters, so that the tables line up.
const NARROWEST: usize = 18;

/// Explains the other measures below the tables.
const DEFINITIONS: &str = "\
Residual: rms error in the second half of the time to the next change. Swing: difference of the highest and the
lowest value in the last second before the next change. Deceleration jerk: change of the mean motor current from one
control period to the next while the motor slows down (N m: at the output shaft). Energies are of the motor's own
bridge. A one-way battery takes none of the energy that goes back.";

/// Explains the measures of groups.
const OF_GROUPS: &str = "
A group settles when all its motors have settled. Out of step: largest difference between the distances of two of its
motors to their references at the same time.";

impl RunReport {
    /// The headline and the tables.
    pub fn tables(&self) -> String {
        let Self { scenario, measures, groups, verdicts, .. } = self;
        let mut out = format!(
            "{}\n\n{}: {} s, control period {} ms, seed {}\n\n",
            table::paragraph(&self.headline()),
            scenario.name,
            scenario.duration_s,
            scenario.period.as_millis(),
            scenario.seed
        );
        for (motor, measures) in scenario.motors.iter().zip(measures) {
            let runs = [&scheme::describe(motor.scheme), WITHOUT];
            out += &format!("{}\n", side_by_side(motor, runs, measures));
        }
        for (group, measures) in scenario.groups.iter().zip(groups) {
            out += &format!("{}\n", of_group(group, &scenario.motors, measures));
        }
        let of_groups = if groups.is_empty() { "" } else { OF_GROUPS };
        let definitions = format!("{} {DEFINITIONS}{of_groups}", settling::definitions());
        out += &format!("{}\n", table::paragraph(&definitions));
        if !verdicts.is_empty() {
            out += &format!("\n{}\n", expectations(verdicts));
        }
        out
    }
}

fn expectations(verdicts: &[Verdict]) -> Table {
    let mut table = table::new(&["expected of", "time, s", "expected", "measured", ""], 2);
    for verdict in verdicts {
        let Verdict { subject, expectation, .. } = verdict;
        let Expectation { window_s, expected, .. } = expectation;
        let window = format!("{} to {}", window_s.start, window_s.end);
        let met = if verdict.met() { "met" } else { "NOT MET" };
        table.add_row([
            subject.clone(),
            window,
            expected.to_string(),
            verdict.measured_text(),
            met.to_owned(),
        ]);
    }
    table
}

fn of_group(group: &Group, motors: &[Motor], measures: &[GroupMeasures; 2]) -> Table {
    let members = group.motors.iter().filter_map(|motor| motors.get(*motor)).map(|motor| &*motor.label);
    let title = format!("{}: {} in step", group.label, members.collect::<Vec<_>>().join(", "));
    let mut table = table::new(&[&title, "as set", WITHOUT], 1).at_least(NARROWEST);
    let [first, second] = measures;
    for (a, b) in first.courses.iter().zip(&second.courses) {
        let name = format!("settling of the course at {} s", a.at_s);
        table.add_row([name, table::seconds(a.settling_s), table::seconds(b.settling_s)]);
    }
    let mut add = |name: &str, unit: &str, decimals: usize, of: fn(&GroupMeasures) -> Option<f64>| {
        if let Some((a, b)) = of(first).zip(of(second)) {
            table.add_row([
                name.to_owned(),
                format!("{a:.decimals$} {unit}"),
                format!("{b:.decimals$} {unit}"),
            ]);
        }
    };
    add("out of step, at most", "counts", 1, |measures| measures.out_of_step_counts);
    add("heading error, at most", "degrees", 2, |measures| measures.heading_error_degrees);
    table
}

/// A table of a motor's measures in two runs with these names.
pub(crate) fn side_by_side(motor: &Motor, runs: [&str; 2], measures: &[Measures; 2]) -> Table {
    let title = format!("{}: {}", motor.label, motor.constants.name);
    let mut table = table::new(&[&title, runs[0], runs[1]], 1).at_least(NARROWEST);
    let [first, second] = measures;
    for (a, b) in first.responses.iter().zip(&second.responses) {
        let name = format!("{} s: {}\n  settling\n  overshoot\n  residual\n  swing", a.at_s, a.change);
        table.add_row([name, response(a), response(b)]);
    }
    let mut add = |name: &str, cell: &dyn Fn(&Measures) -> String| {
        table.add_row([name.to_owned(), cell(first), cell(second)]);
    };
    add("deceleration jerk, worst\n  rms", &|m| {
        let jerk = m.deceleration_jerk;
        format!("{:.2} A = {:.2} N m\n{:.2} A", jerk.worst_a, jerk.worst_nm, jerk.rms_a)
    });
    add("regulated by", &|m| m.regulator.to_owned());
    add("forward/braking/reverse/coast", &|m| m.regimes.to_string());
    add("energy from the battery\n  back into it", &|m| {
        format!("{:.2} J\n{:.2} J", m.energy_from_battery_j, m.energy_to_battery_j)
    });
    table
}

/// The measures of a response, a line each below an empty line for the name of the change.
fn response(r: &Response) -> String {
    format!(
        "\n{}\n{}\n{:.1} {unit}\n{:.1} {unit}",
        r.settling(),
        table::percent(r.overshoot_percent),
        r.residual_rms,
        r.swing,
        unit = r.unit
    )
}
