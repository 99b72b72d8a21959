//! Measures of a run: settling and overshoot of each response, jerk while slowing down, shares of the regimes,
//! energies.

use crate::report::figures::significant;
use crate::settling::{Change, Goal, Settling, changes, settling};
use crate::table;
use motor_hub::braking::Regime;
use motor_hub::bridge::Drive;
use motor_hub::model::plant::Flow;
use motor_hub::model::si::Joules;
use motor_hub::motor::Report;
use serde::Serialize;
use simulated::scenario::Motor;
use simulated::trace::{Point, Sample, Trace};
use std::fmt;
use std::ops::Range;

/// All measures of one motor in one run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measures {
    /// Regulator of the motor at the end: "model", "PID" or "no control tick".
    pub regulator: &'static str,
    /// Responses to changes of a regulated set-point or of the external torque.
    pub responses: Vec<Response>,
    /// Changes of the motor current while the motor slowed down.
    pub deceleration_jerk: Jerk,
    /// Shares of the control ticks by regime, in percent.
    pub regimes: RegimeShares,
    /// Energy taken from the bus by this motor's bridge, in joules.
    pub energy_from_battery_j: f64,
    /// Energy returned to the bus by this motor's bridge, in joules. A one-way battery takes none of it.
    pub energy_to_battery_j: f64,
}

/// The response to one change, up to the next change.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Response {
    /// Time of the change in seconds.
    pub at_s: f64,
    /// The change in words.
    pub change: String,
    /// The motor's task as the end of a sentence, such as "held at its speed".
    #[serde(skip)]
    pub task: String,
    /// Unit of the errors: "counts/s" or "counts".
    pub unit: &'static str,
    /// Seconds until the motor has [settled](crate::settling); null if it never settled, or if `too_short`.
    pub settling_s: Option<f64>,
    /// True if the next change comes too soon to judge whether the motor settled.
    pub too_short: bool,
    /// Largest error beyond the set-point in percent of the step. After a change of torque, the largest error in
    /// percent of the set-point. Null if this step or set-point is 0.
    pub overshoot_percent: Option<f64>,
    /// Root mean square of the error in the second half of the response, in `unit`.
    pub residual_rms: f64,
    /// Root mean square of the error in the whole response, in `unit`.
    pub rms_error: f64,
    /// Integral of the error's size over the response, in `unit` times seconds.
    pub absolute_error_s: f64,
    /// Difference of the highest and the lowest value in the last second of the response, in `unit`. For a settled
    /// motor it is the size of a limit cycle.
    pub swing: f64,
}

impl Response {
    /// The settling time as text.
    pub(crate) fn settling(&self) -> String {
        if self.too_short { "too short".to_owned() } else { table::seconds(self.settling_s) }
    }
}

/// Length of the end of a response in which the swing is measured, in seconds.
const LAST_S: f64 = 1.0;

/// Changes of the mean motor current from one control period to the next while the motor slows down. Torque, and with
/// it the deceleration, is proportional to the current.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Jerk {
    /// Largest change in amperes.
    pub worst_a: f64,
    /// Largest change of the torque on the output shaft in newton metres.
    pub worst_nm: f64,
    /// Root mean square of the changes in amperes.
    pub rms_a: f64,
}

/// Shares of the control ticks by regime, in percent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RegimeShares {
    /// Driven in the direction of motion.
    pub forward: f64,
    /// Proportional braking.
    pub braking: f64,
    /// Driven against the motion.
    pub reverse: f64,
    /// Open bridge: disabled, floating or at fault.
    pub coast: f64,
}

impl fmt::Display for RegimeShares {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { forward, braking, reverse, coast } = self;
        write!(f, "{forward:.0} / {braking:.0} / {reverse:.0} / {coast:.0} %")
    }
}

impl Goal {
    fn unit(self) -> &'static str {
        match self {
            Self::Velocity(_) => "counts/s",
            Self::Position { .. } => "counts",
        }
    }
}

impl Measures {
    /// Measures one motor's part in a run, within a span of time in seconds.
    pub fn new(motor: &Motor, span_s: Range<f64>, trace: &Trace, index: usize) -> Self {
        let all: Vec<(f64, &Sample)> = trace.motor(index).collect();
        let ticks: Vec<_> = all.iter().copied().filter(|(at, _)| span_s.contains(at)).collect();
        // A direct command drives the bridge before the first tick. `sum` of no values is -0, whose sign would be shown.
        let before = trace.before.get(index).filter(|_| span_s.contains(&0.0));
        let energy = |of: fn(&Flow) -> Joules| {
            let flows = before.into_iter().chain(ticks.iter().map(|(_, sample)| &sample.flow));
            flows.fold(0.0, |sum, flow| sum + of(flow).0)
        };
        Self {
            regulator: ticks.last().map_or("no control tick", |(_, sample)| sample.report.regulator.name()),
            responses: responses(motor, &span_s, trace.motion.get(index).map_or(&[], Vec::as_slice)),
            deceleration_jerk: jerk(motor, &span_s, &all),
            regimes: shares(&ticks),
            energy_from_battery_j: energy(|flow| flow.energy_from_battery),
            energy_to_battery_j: energy(|flow| flow.energy_to_battery),
        }
    }
}

fn responses(motor: &Motor, span_s: &Range<f64>, motion: &[Point]) -> Vec<Response> {
    let mut changes = changes(motor, span_s.end);
    changes.retain(|change| span_s.contains(&change.span_s.start));
    changes.into_iter().filter_map(|change| response(change, motion)).collect()
}

fn response(change: Change, motion: &[Point]) -> Option<Response> {
    let Change { span_s, old: before, goal, torque, .. } = change;
    let Range { start: from_s, end: to_s } = span_s;
    let within = motion.get(motion.partition_point(|point| point.at_s < from_s)..).unwrap_or_default();
    let within = within.get(..within.partition_point(|point| point.at_s < to_s)).unwrap_or_default();
    let old = match before {
        // After a change of run mode, the step begins at the motor's present speed or position.
        Some(before) if before.unit() == goal.unit() => before.target(),
        _ => goal.value(within.first()?),
    };
    let new = goal.target();
    let stepped = before != Some(goal);
    let settling = settling(goal, Goal::speed_before(before, within), span_s, within);

    let errors: Vec<f64> = within.iter().map(|point| goal.value(point) - new).collect();
    let errors_since =
        |since_s: f64| errors.get(within.partition_point(|point| point.at_s < since_s)..).unwrap_or_default();
    let beyond = |error: f64| if stepped { error * (new - old).signum() } else { error.abs() };
    let scale = if stepped { (new - old).abs() } else { new.abs() };
    let farthest = errors.iter().map(|&error| beyond(error)).fold(0.0, f64::max);
    let step_s = (to_s - from_s) / errors.len().max(1) as f64;
    let last = errors_since(to_s - LAST_S).iter().copied();
    Some(Response {
        at_s: from_s,
        change: if stepped {
            format!("{:.0} to {new:.0} {}", old + 0.0, goal.unit())
        } else {
            format!("torque to {} N m", significant(torque))
        },
        task: task(goal, stepped),
        unit: goal.unit(),
        settling_s: settling.seconds(),
        too_short: settling == Settling::TooShort,
        overshoot_percent: (scale > 0.0).then(|| 100.0 * farthest / scale + 0.0),
        residual_rms: rms(errors_since(f64::midpoint(from_s, to_s))),
        rms_error: rms(&errors),
        absolute_error_s: step_s * errors.iter().map(|error| error.abs()).sum::<f64>(),
        swing: extent(last).map_or(0.0, |(low, high)| high - low),
    })
}

/// The motor's task after a change of its set-point, or of the torque on its shaft.
fn task(goal: Goal, stepped: bool) -> String {
    match goal {
        Goal::Velocity(0.0) if stepped => "brought to standstill".to_owned(),
        Goal::Velocity(0.0) => "held at standstill".to_owned(),
        Goal::Velocity(speed) if stepped => format!("brought to {speed:.0} counts/s"),
        Goal::Velocity(_) => "held at its speed".to_owned(),
        Goal::Position { counts, .. } if stepped => format!("moved to {counts:.0} counts"),
        Goal::Position { .. } => "held at its position".to_owned(),
    }
}

fn jerk(motor: &Motor, span_s: &Range<f64>, ticks: &[(f64, &Sample)]) -> Jerk {
    let mut changes = Vec::new();
    for triple in ticks.windows(3) {
        let &[(_, before), (at_s, now), (_, next)] = triple else { continue };
        if span_s.contains(&at_s) && next.speed_cps.abs() < now.speed_cps.abs() {
            changes.push(now.flow.mean_current().0 - before.flow.mean_current().0);
        }
    }
    let worst_a = changes.iter().map(|change| change.abs()).fold(0.0, f64::max);
    let constants = &motor.constants;
    let torque_per_amp = constants.kt.0 * constants.gear_ratio * constants.eta;
    Jerk { worst_a, worst_nm: worst_a * torque_per_amp, rms_a: rms(&changes) }
}

/// The regime of a bridge; `None` if the bridge is open. Braking with a duty of 0 is an open bridge.
pub(crate) fn regime_of(report: &Report) -> Option<Regime> {
    report.regime.filter(|_| report.drive != Drive::COAST)
}

fn shares(ticks: &[(f64, &Sample)]) -> RegimeShares {
    let share = |regime: Option<Regime>| {
        let count = ticks.iter().filter(|(_, sample)| regime_of(&sample.report) == regime).count();
        100.0 * count as f64 / ticks.len().max(1) as f64
    };
    RegimeShares {
        forward: share(Some(Regime::Forward)),
        braking: share(Some(Regime::Braking)),
        reverse: share(Some(Regime::Reverse)),
        coast: share(None),
    }
}

/// Lowest and highest value; `None` without values.
pub(crate) fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.map(|value| (value, value)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// Root mean square; 0 without values.
pub(crate) fn rms(values: &[f64]) -> f64 {
    // `sum` of no values is -0, whose sign would be shown.
    let sum = values.iter().fold(0.0, |sum, value| sum + value * value);
    (sum / values.len().max(1) as f64).sqrt()
}
