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
mod sweep;
mod text;

pub use responses::{Kind, Verdict};

use crate::page::Page;
use crate::settling::{Change, Goal, changes};
use crate::{NamedFigure, StudyError};
use motor_hub::braking::DutyRule;
use motor_hub::model::catalogue;
use motor_hub::model::load::{Load, Shaft};
use motor_hub::model::si::Volts;
use serde::Serialize;
use simulated::scenario::{Configuration, Motor, Scenario};
use simulated::scheme::{SchemeWords, describe};

/// How a motor is configured in the hub.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Knowledge {
    /// The true inertia, drag and friction are configured.
    Exact,
    /// 0.7 times the true inertia is configured.
    Lighter,
    /// 1.4 times the true inertia is configured.
    Heavier,
    /// Only the winding is configured; the hub learns the acceleration per volt.
    Unknown,
    /// The constants of the cold motor are configured, but the motor is hot: its magnets are 10 % weaker, and its
    /// copper has 24 % more resistance. The winding is then 62 K warmer, and ferrite magnets are 50 K warmer.
    Hot,
    /// 0.8 times the true winding resistance is configured.
    ResistanceLow,
    /// 1.2 times the true winding resistance is configured.
    ResistanceHigh,
    /// 0.9 times the true back-EMF constant is configured.
    EmfLow,
    /// 1.1 times the true back-EMF constant is configured.
    EmfHigh,
    /// The constants of another specimen of the same product are configured.
    Sibling,
    /// Half of the true inertia is configured. Only the long sweep uses this configuration.
    HalfInertia,
    /// Twice the true inertia is configured. Only the long sweep uses this configuration.
    DoubleInertia,
}

impl Knowledge {
    /// All configurations except those of the long sweep, in the order of the variants.
    pub const ALL: [Self; 10] = [
        Self::Exact,
        Self::Lighter,
        Self::Heavier,
        Self::Unknown,
        Self::Hot,
        Self::ResistanceLow,
        Self::ResistanceHigh,
        Self::EmfLow,
        Self::EmfHigh,
        Self::Sibling,
    ];

    /// The configurations that differ in the motion alone. They are the first four of [`Self::ALL`]. [`soak`] and the
    /// tables by property use them.
    pub const OF_MOTION: [Self; 4] = [Self::Exact, Self::Lighter, Self::Heavier, Self::Unknown];

    /// Name of the configuration in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "configured exactly",
            Self::Lighter => "inertia x0.7",
            Self::Heavier => "inertia x1.4",
            Self::HalfInertia => "inertia x0.5",
            Self::DoubleInertia => "inertia x2",
            Self::Unknown => "not configured",
            Self::Hot => "configured cold, motor hot",
            Self::ResistanceLow => "R x0.8",
            Self::ResistanceHigh => "R x1.2",
            Self::EmfLow => "Ke x0.9",
            Self::EmfHigh => "Ke x1.1",
            Self::Sibling => "sibling configured",
        }
    }

    /// Configures the motors of a scenario.
    fn configure(self, scenario: &mut Scenario) {
        for motor in &mut scenario.motors {
            motor.configuration = self.configured(&motor.constants);
        }
    }

    /// The configuration of a motor.
    fn configured(self, motor: &catalogue::Motor) -> Configuration {
        let inertia = |inertia| Configuration { inertia, ..Configuration::EXACT };
        let winding = |resistance, emf| Configuration { resistance, emf, ..Configuration::EXACT };
        match self {
            Self::Exact => Configuration::EXACT,
            Self::Lighter => inertia(0.7),
            Self::Heavier => inertia(1.4),
            Self::HalfInertia => inertia(0.5),
            Self::DoubleInertia => inertia(2.0),
            Self::Unknown => Configuration { is_motion_known: false, ..Configuration::EXACT },
            Self::Hot => winding(1.0 / 1.24, 1.0 / 0.9),
            Self::ResistanceLow => winding(0.8, 1.0),
            Self::ResistanceHigh => winding(1.2, 1.0),
            Self::EmfLow => winding(1.0, 0.9),
            Self::EmfHigh => winding(1.0, 1.1),
            Self::Sibling => Configuration { of: sibling(motor), ..Configuration::EXACT },
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
    /// The verdict for a configuration; `None` for one of the long sweep.
    pub fn verdict(&self, knowledge: Knowledge) -> Option<&Verdict> {
        self.verdicts.get(knowledge as usize)
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
    /// The result in a sentence, then the tables of every part with this many of the worst responses.
    #[must_use]
    pub fn page(&self, worst: usize) -> Page {
        text::page(self, worst)
    }

    /// A chart of every part.
    #[must_use]
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
    ///
    /// # Errors
    /// If a run fails.
    pub fn new(
        seed: u64,
        scenarios: u64,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<Self, StudyError> {
        let numbers: Vec<u64> = (0..scenarios).collect();
        let results =
            parallel::map(&numbers, |&number| responses(seed, number), |done| progress(done, numbers.len()));
        let (mut total_responses, mut responses) = (0, Vec::new());
        for result in results {
            let (all, settleable) = result?;
            total_responses += all;
            responses.extend(settleable);
        }
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
        knowledge.configure(&mut scenario);
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
    fn verdicts_are_in_the_order_of_the_configurations() {
        assert_eq!(Knowledge::ALL.map(|knowledge| knowledge as usize), [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    }

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
            let mut motor = Motor::new(constants, Load::NONE);
            motor.configuration = knowledge.configured(&constants);
            let dynamics = motor.settings().expect("it fits").dynamics.expect("configured");
            f64::from(dynamics.gain.to_bits())
        };
        // The acceleration per volt is Kt / (R J).
        let ratio = gain(Knowledge::Hot) / gain(Knowledge::Exact);
        assert!((ratio - 1.24 / 0.9).abs() < 0.03, "{ratio}");
    }
}
