//! The result of a run in a sentence: where the runs with and without a braking regime differ most.

use super::RunReport;
use crate::measures::{Measures, Response};
use motor_hub::braking::Scheme;

/// One response in both runs.
struct Pair<'a> {
    label: &'a str,
    as_set: &'a Response,
    without: &'a Response,
}

impl Pair<'_> {
    /// Seconds between the two settling times; infinite if only one of the runs settled.
    fn difference(&self) -> f64 {
        match (self.as_set.settling_s, self.without.settling_s) {
            (Some(a), Some(b)) => (a - b).abs(),
            (None, None) => 0.0,
            _ => f64::INFINITY,
        }
    }

    /// The two settling times in words; `None` if their texts are equal.
    fn times(&self) -> Option<String> {
        let [as_set, without] = [self.as_set, self.without].map(Response::settling);
        (as_set != without).then(|| format!("{as_set} with braking, {without} without"))
    }
}

impl RunReport {
    /// The result in a sentence: the response whose settling time differs most with and without braking, or the energies
    /// if no set-point is regulated. A second sentence says whether the expectations are met.
    pub fn headline(&self) -> String {
        let result = result(self);
        let all = self.verdicts.len();
        let met = self.verdicts.iter().filter(|verdict| verdict.met()).count();
        match all {
            0 => result,
            1 if met == 1 => format!("{result} The expectation is met."),
            _ if met == all => format!("{result} All {all} expectations are met."),
            _ => format!("{result} {} of {all} expectations are not met.", all - met),
        }
    }
}

fn result(report: &RunReport) -> String {
    let motors = report.scenario.motors.iter().zip(&report.measures);
    let pairs: Vec<Pair> = motors
        .flat_map(|(motor, [as_set, without])| {
            let responses = as_set.responses.iter().zip(&without.responses);
            let judged = responses.filter(|(as_set, _)| !as_set.too_short);
            judged.map(|(as_set, without)| Pair { label: &motor.label, as_set, without })
        })
        .collect();
    let largest = pairs.iter().reduce(|a, b| if b.difference() > a.difference() { b } else { a });
    let Some(largest) = largest else { return energies(report) };
    let all = pairs.len();
    let settled = |of: fn(&Pair) -> Option<f64>| pairs.iter().filter(|pair| of(pair).is_some()).count();
    let (as_set, without) = (settled(|pair| pair.as_set.settling_s), settled(|pair| pair.without.settling_s));
    let Pair { label, as_set: response, .. } = largest;
    if report.scenario.motors.iter().all(|motor| motor.scheme == Scheme::ForwardReverse) {
        format!("{as_set} of {all} responses settle without a braking regime.")
    } else if report.scenario.motors.len() == 1 {
        let times =
            largest.times().unwrap_or_else(|| format!("{} with and without braking", response.settling()));
        format!("{label} {}: {times}.", response.task)
    } else {
        let times = largest
            .times()
            .map(|times| format!("; the largest difference: {label} {}, {times}", response.task));
        let times = times.unwrap_or_default();
        format!("{as_set} of {all} responses settle with braking, {without} without{times}.")
    }
}

/// A sentence about the energies that the battery gave and got back, in joules. To a one-way battery no energy returns,
/// so the sentence is then about the bus.
fn energies(report: &RunReport) -> String {
    let sum = |run: usize, of: fn(&Measures) -> f64| -> f64 {
        report.measures.iter().filter_map(|runs| runs.get(run)).map(of).sum()
    };
    let [with, without] =
        [0, 1].map(|run| [sum(run, |m| m.energy_from_battery_j), sum(run, |m| m.energy_to_battery_j)]);
    let one_way = report.scenario.bus.is_some_and(|bus| bus.one_way);
    let [gave, got_back, end] = if one_way {
        ["The motors took", "from the bus and returned", " The one-way battery got nothing back."]
    } else {
        ["The battery gave", "and got back", ""]
    };
    format!(
        "{gave} {:.2} J {got_back} {:.2} J with braking; without, {:.2} J and {:.2} J.{end}",
        with[0], with[1], without[0], without[1]
    )
}
