//! Measures how well motors are regulated: at the tasks of the [`mod@reference`], for every motor of the catalogue
//! without a load ([`bare_motors`]), and in any number of [`random`] scenarios. The hub is configured exactly, with
//! wrong constants, or not at all (see [`Knowledge`]). [`soak`] runs hours of random scenarios and counts false alarms.
//!
//! Responses are judged by the true motion at every millisecond, see [`settling`](crate::settling). A random response
//! counts only if some regulator can settle it.
//!
//! ```
//! use studies::survey::{Results, Survey};
//!
//! let survey = Survey::new(1, 1, &mut |_, _| ())?;
//! let results = Results { survey: Some(survey), ..Results::default() };
//! let [(name, figure)] = results.figures().try_into().expect("one part, one figure");
//! assert_eq!((name.as_str(), figure.panels.len()), ("survey", 2));
//! # Ok::<(), studies::StudyError>(())
//! ```

pub mod bare_motors;
mod chart;
mod fastest;
mod parallel;
pub mod random;
pub mod reference;
mod responses;
pub mod soak;
pub mod sweep;
mod text;

pub use responses::{Kind, Verdict};

use crate::settling::{Change, Goal, changes};
use crate::{NamedFigure, StudyError};
use motor_hub::braking::DutyRule;
use motor_hub::model::catalogue;
use motor_hub::model::load::{Load, Shaft};
use motor_hub::model::si::Volts;
use motor_hub::units::Period;
use serde::{Serialize, Serializer};
use simulated::scenario::{Configuration, Motor, Scenario};
use simulated::scheme::{SchemeWords, describe};

/// How a motor is configured in the hub.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knowledge {
    /// Name in JSON.
    key: &'static str,
    /// Name in tables.
    pub name: &'static str,
    /// Factors of the true constants.
    factors: Configuration,
    /// True if the constants are those of another specimen of the same product.
    of_sibling: bool,
}

impl Serialize for Knowledge {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.key)
    }
}

impl Knowledge {
    /// The true constants are configured.
    pub const EXACT: Self = Self::new("exact", "configured exactly", Configuration::EXACT);
    /// Only the winding is configured; the hub learns the acceleration per volt.
    pub const UNKNOWN: Self = Self::new(
        "unknown",
        "not configured",
        Configuration { is_motion_known: false, ..Configuration::EXACT },
    );

    /// The configurations of the survey. A verdict of a response is found by its place in this list.
    pub const ALL: [Self; 10] = [
        Self::EXACT,
        Self::inertia("lighter", "inertia x0.7", 0.7),
        Self::inertia("heavier", "inertia x1.4", 1.4),
        Self::UNKNOWN,
        // The constants of the cold motor are configured, but the motor is hot: its magnets are 10 % weaker, and its
        // copper has 24 % more resistance. The winding is then 62 K warmer, and ferrite magnets are 50 K warmer.
        Self::winding("hot", "configured cold, motor hot", 1.0 / 1.24, 1.0 / 0.9),
        Self::winding("resistance-low", "R x0.8", 0.8, 1.0),
        Self::winding("resistance-high", "R x1.2", 1.2, 1.0),
        Self::winding("emf-low", "Ke x0.9", 1.0, 0.9),
        Self::winding("emf-high", "Ke x1.1", 1.0, 1.1),
        Self { of_sibling: true, ..Self::new("sibling", "sibling configured", Configuration::EXACT) },
    ];

    /// The configurations that differ in the motion alone. [`soak`] and the tables by property use them.
    pub const OF_MOTION: [Self; 4] = [Self::ALL[0], Self::ALL[1], Self::ALL[2], Self::ALL[3]];

    const fn new(key: &'static str, name: &'static str, factors: Configuration) -> Self {
        Self { key, name, factors, of_sibling: false }
    }

    const fn inertia(key: &'static str, name: &'static str, inertia: f64) -> Self {
        Self::new(key, name, Configuration { inertia, ..Configuration::EXACT })
    }

    const fn winding(key: &'static str, name: &'static str, resistance: f64, emf: f64) -> Self {
        Self::new(key, name, Configuration { resistance, emf, ..Configuration::EXACT })
    }

    /// The scenario at this control period, with its motors configured like this.
    fn at_period(self, scenario: &Scenario, period_ms: u32) -> Result<Scenario, StudyError> {
        let mut scenario = Scenario { period: Period::from_millis(period_ms)?, ..scenario.clone() };
        self.configure(&mut scenario.motors);
        Ok(scenario)
    }

    fn configure(self, motors: &mut [Motor]) {
        for motor in motors {
            let of = self.of_sibling.then(|| sibling(&motor.constants)).flatten();
            motor.configuration = Configuration { of, ..self.factors };
        }
    }
}

/// The next specimen of the same product, with the friction and the kind of inertia of `motor`. After the last specimen
/// comes the first. `None` for a motor that the catalogue lacks.
fn sibling(motor: &catalogue::Motor) -> Option<catalogue::Motor> {
    // A specimen has the name of its product, with its letter after a hyphen.
    let product = |name: &'static str| match name.rsplit_once('-') {
        Some((product, letter)) if letter.len() == 1 => product,
        _ => name,
    };
    let specimens: Vec<_> =
        catalogue::motors().filter(|other| product(other.name) == product(motor.name)).collect();
    let own = specimens.iter().position(|other| other.name == motor.name)?;
    let next = specimens.iter().cycle().nth(own + 1)?;
    let next = if motor.j == motor.j_rotor_measured { next.with_measured_rotor_inertia() } else { *next };
    Some(catalogue::Motor { friction: motor.friction, ..next })
}

/// A response that can be settled, and its verdicts.
#[derive(Clone, Debug, Serialize)]
pub struct Response {
    /// The scenario's number.
    pub scenario: u64,
    /// Number of the motor in the scenario, from 0.
    pub motor: usize,
    /// Seconds from the scenario's start.
    pub at_s: f64,
    /// The kind of change.
    pub kind: Kind,
    /// The change in words.
    pub what: String,
    /// The motor, its load, battery, period and scheme in words.
    pub circumstances: String,
    /// Control period in milliseconds.
    pub period_ms: u32,
    /// The scheme.
    #[serde(flatten)]
    pub scheme: SchemeWords,
    /// The duty rule.
    pub duty: DutyRule,
    /// Coulomb friction in percent of the stall torque at 12 V.
    pub friction_percent: f64,
    /// One verdict for each configuration, in the order of [`Knowledge::ALL`].
    pub verdicts: Vec<Verdict>,
}

impl Response {
    /// The verdict for a configuration; `None` for a configuration of the long sweep.
    pub fn verdict(&self, knowledge: Knowledge) -> Option<&Verdict> {
        self.verdicts.get(Knowledge::ALL.iter().position(|other| *other == knowledge)?)
    }
}

/// The responses of random scenarios.
#[derive(Clone, Debug, Serialize)]
pub struct Survey {
    /// Seed of the random numbers.
    pub seed: u64,
    /// Number of scenarios.
    pub scenarios: u64,
    /// Number of all responses.
    #[serde(rename = "asked")]
    pub total_responses: usize,
    /// The responses that can be settled.
    pub responses: Vec<Response>,
}

/// Results of the parts of the survey; `None` for a part that was left out.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Results {
    /// The reference tasks.
    pub reference: Option<Vec<reference::Row>>,
    /// The motors without a load.
    pub cells: Option<Vec<bare_motors::BareMotor>>,
    /// The random scenarios.
    pub survey: Option<Survey>,
}

impl Results {
    /// A chart of every part.
    pub fn figures(&self) -> Vec<NamedFigure> {
        let Self { reference, cells, survey } = self;
        let figures = [
            reference.as_deref().map(chart::reference),
            cells.as_deref().map(chart::cells),
            survey.as_ref().map(chart::survey),
        ];
        figures.into_iter().flatten().collect()
    }
}

impl Survey {
    /// Draws and runs scenarios. `progress` gets the number of finished scenarios and the number of all scenarios.
    pub fn new(
        seed: u64,
        scenarios: u64,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<Self, StudyError> {
        let numbers: Vec<u64> = (0..scenarios).collect();
        let results = parallel::map(&numbers, |&number| responses(seed, number), progress)?;
        let total_responses = results.iter().map(|(all, _)| all).sum();
        let responses = results.into_iter().flat_map(|(_, settleable)| settleable).collect();
        Ok(Self { seed, scenarios, total_responses, responses })
    }
}

/// The number of all responses of a scenario, and the responses that can be settled.
fn responses(seed: u64, number: u64) -> Result<(usize, Vec<Response>), StudyError> {
    let mut scenario = random::scenario(seed, number);
    let (mut all, mut settleable, mut responses) = (0, Vec::new(), Vec::new());
    for (index, motor) in scenario.motors.iter().enumerate() {
        all += changes(motor, scenario.duration_s).len();
        for change in fastest::settleable(&scenario, motor)? {
            responses.push(Response {
                scenario: number,
                motor: index,
                at_s: change.span_ms().start as f64 / 1e3,
                kind: change.kind(),
                what: what(&change),
                circumstances: circumstances(&scenario, index),
                period_ms: scenario.period.as_millis(),
                scheme: SchemeWords(motor.scheme),
                duty: motor.duty,
                friction_percent: friction_percent(motor),
                verdicts: Vec::new(),
            });
            settleable.push(change);
        }
    }
    // Runs end with the last response that can be settled.
    let Some(end_ms) = settleable.iter().map(|change| change.span_ms().end).max() else {
        return Ok((all, responses));
    };
    scenario.duration_s = end_ms as f64 / 1e3;
    for knowledge in Knowledge::ALL {
        knowledge.configure(&mut scenario.motors);
        let tracks = responses::watch(&scenario)?;
        for (change, response) in settleable.iter().zip(&mut responses) {
            let track = tracks.get(response.motor).map_or(&[][..], Vec::as_slice);
            response.verdicts.push(responses::judge(change, track));
        }
    }
    Ok((all, responses))
}

fn what(change: &Change) -> String {
    let goal = |goal| match goal {
        Goal::Velocity(speed) => format!("{speed:.0} cps"),
        Goal::Position { counts, .. } => format!("count {counts:.0}"),
    };
    let &Change { old, goal: new, old_torque, torque, .. } = change;
    let from = old.map_or("off".to_owned(), goal);
    let length = change.length_s();
    if change.kind() == Kind::Load {
        format!("{from}, {old_torque:.3} -> {torque:.3} N m, {length:.1} s")
    } else {
        format!("{from} -> {}, {torque:.3} N m, {length:.1} s", goal(new))
    }
}

fn circumstances(scenario: &Scenario, index: usize) -> String {
    let Some(motor) = scenario.motors.get(index) else { return String::new() };
    let shaft = Shaft::new(&motor.constants, &motor.load);
    format!(
        "{}, tau {:.2} s ({:.1} times the rotor's inertia), {:.1} V, {} ms, {}{}{}",
        motor.constants.name,
        time_constant(&motor.constants, &motor.load),
        shaft.inertia.0 / motor.constants.j.0,
        scenario.battery.emf.0,
        scenario.period.as_millis(),
        describe(motor.scheme),
        if motor.duty == DutyRule::LinearDuty { ", linear duty" } else { "" },
        match friction_percent(motor) {
            0.0 => String::new(),
            percent => format!(", friction {percent} %"),
        },
    )
}

/// Mechanical time constant of a motor with its load, in seconds.
fn time_constant(motor: &catalogue::Motor, load: &Load) -> f64 {
    let shaft = Shaft::new(motor, load);
    shaft.inertia.0 / (motor.ke.0 * motor.kt.0 / motor.r.0 + shaft.drag.0)
}

/// Free speed of a motor without load at a voltage, in counts/s.
fn free_cps(motor: &catalogue::Motor, volts: f64) -> f64 {
    motor.counts_per_rev_motor / core::f64::consts::TAU * motor.free_speed(Volts(volts)).0
}

/// Coulomb friction in percent of the stall torque at 12 V, as scenario files have it.
fn friction_percent(motor: &Motor) -> f64 {
    let share = motor.constants.friction.coulomb.0 / motor.constants.stall_torque(Volts(12.0)).0;
    // Removes the rounding errors of the multiplication by the torque and of the division.
    (1e6 * 100.0 * share).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;
    use motor_hub::model::catalogue::characterised;

    #[test]
    fn a_sibling_is_the_next_specimen_of_the_product_with_the_friction_of_the_motor() {
        for (name, next) in [
            ("AM 20 A", "NeveRest 20-B"),
            ("AM 20 C", "NeveRest 20"),
            ("AM 3.7 A", "NeveRest 3.7"),
            ("Matrix C", "Matrix 12 V"),
        ] {
            let motor = characterised(name).expect("in the catalogue").with_measured_rotor_inertia();
            let sibling = sibling(&motor).expect("the product has three specimens");
            assert_eq!((sibling.name, sibling.j), (next, sibling.j_rotor_measured));
        }
    }

    #[test]
    fn a_hub_that_knows_the_cold_motor_takes_the_hot_one_for_stronger() {
        let constants = characterised("AM 60 A").expect("in the catalogue").with_measured_rotor_inertia();
        let gain = |knowledge: Knowledge| {
            let mut motors = [Motor::new(constants, Load::NONE)];
            knowledge.configure(&mut motors);
            let dynamics = motors[0].settings().expect("it fits").dynamics.expect("configured");
            f64::from(dynamics.gain.to_bits())
        };
        // The acceleration per volt is Kt / (R J).
        let [exact, _, _, _, hot, ..] = Knowledge::ALL;
        let ratio = gain(hot) / gain(exact);
        assert!((ratio - 1.24 / 0.9).abs() < 0.03, "{ratio}");
    }
}
