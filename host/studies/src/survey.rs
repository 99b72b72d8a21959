//! How well motors are regulated: the tasks of the [`mod@reference`], every motor of the catalogue without a load
//! ([`cells`]), and any number of [`random`] scenarios. The hub is configured exactly, configured with a wrong inertia, or
//! not configured. [`soak`] runs hours of random scenarios and counts false alarms.
//!
//! Responses are judged by the true motion at every millisecond, see [`settling`](crate::settling). Of the random
//! responses those are counted that can be settled by some regulator.
//!
//! ```no_run
//! use studies::survey::reference;
//!
//! let rows = reference::run(&mut |done, of| println!("{done} of {of}"))?;
//! assert!(rows.iter().any(|row| row.name.contains("winch")));
//! # Ok::<(), studies::StudyError>(())
//! ```

pub mod cells;
pub mod chart;
mod fastest;
mod judge;
mod parallel;
pub mod random;
pub mod reference;
mod scenario_file;
pub mod soak;
mod sweep;
pub mod text;

pub use judge::{Kind, Verdict};
pub use scenario_file::toml;

use crate::StudyError;
use crate::settling::Goal;
use fastest::settleable;
use judge::Challenge;
use motor_hub::braking::DutyRule;
use motor_hub::model::catalogue;
use motor_hub::model::load::{Load, Shaft};
use motor_hub::model::si::Volts;
use serde::Serialize;
use simulated::scenario::{Configuration, ConfiguredMotion, Motor, Scenario};
use simulated::scheme::{DutyWord, SchemeWords, describe};

/// How the motion of a motor is configured in the hub.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Knowledge {
    /// The true inertia, drag and friction.
    Exact,
    /// 0.7 times the inertia.
    Lighter,
    /// 1.4 times the inertia.
    Heavier,
    /// Only the winding is configured; the hub learns the acceleration per volt.
    Unknown,
}

impl Knowledge {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Exact, Self::Lighter, Self::Heavier, Self::Unknown];

    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "configured exactly",
            Self::Lighter => "inertia x0.7",
            Self::Heavier => "inertia x1.4",
            Self::Unknown => "not configured",
        }
    }

    fn configured(self) -> Configuration {
        let motion = |inertia| Some(ConfiguredMotion { inertia, drag: 1.0, friction: 1.0 });
        let motion = match self {
            Self::Exact => motion(1.0),
            Self::Lighter => motion(0.7),
            Self::Heavier => motion(1.4),
            Self::Unknown => None,
        };
        Configuration { motion, ..Configuration::EXACT }
    }
}

/// A response that can be settled, and its verdicts.
#[derive(Clone, Debug, Serialize)]
pub struct Response {
    /// The scenario's number.
    pub scenario: u64,
    /// The motor's number in it, from 0.
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
    #[serde(with = "DutyWord")]
    pub duty: DutyRule,
    /// Coulomb friction in percent of the stall torque at 12 V.
    pub friction_percent: f64,
    /// In the order of [`Knowledge::ALL`].
    pub verdicts: Vec<Verdict>,
}

/// The responses of random scenarios.
#[derive(Clone, Debug, Serialize)]
pub struct Survey {
    /// Seed of the random numbers.
    pub seed: u64,
    /// Number of scenarios.
    pub scenarios: u64,
    /// Number of all responses.
    pub asked: usize,
    /// The responses that can be settled.
    pub responses: Vec<Response>,
}

impl Survey {
    /// Draws and runs scenarios; `progress` gets the number of scenarios that are done, and of all.
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
        let (mut asked, mut responses) = (0, Vec::new());
        for result in results {
            let (all, settleable) = result?;
            asked += all;
            responses.extend(settleable);
        }
        Ok(Self { seed, scenarios, asked, responses })
    }
}

/// The number of all responses of a scenario, and the responses that can be settled.
fn responses(seed: u64, number: u64) -> Result<(usize, Vec<Response>), StudyError> {
    let scenario = random::scenario(seed, number);
    let challenges = judge::challenges(&scenario);
    let possible = settleable(&scenario, &challenges)?;
    let mut verdicts: Vec<Vec<Verdict>> = vec![Vec::new(); challenges.len()];
    for knowledge in Knowledge::ALL {
        let mut scenario = scenario.clone();
        scenario.motors.iter_mut().for_each(|motor| motor.configuration = knowledge.configured());
        let tracks = judge::watch(&scenario)?;
        for (challenge, all) in challenges.iter().zip(&mut verdicts) {
            all.push(judge::judge(challenge, tracks.get(challenge.motor).map_or(&[], |track| track)));
        }
    }
    let judged = challenges.iter().zip(possible).zip(verdicts).filter(|((_, possible), _)| *possible);
    let responses = judged
        .filter_map(|((challenge, _), verdicts)| {
            let motor = scenario.motors.get(challenge.motor)?;
            Some(Response {
                scenario: number,
                motor: challenge.motor,
                at_s: challenge.from_ms as f64 / 1e3,
                kind: challenge.kind,
                what: what(challenge),
                circumstances: circumstances(&scenario, challenge.motor),
                period_ms: scenario.period.as_millis(),
                scheme: SchemeWords(motor.scheme),
                duty: motor.duty,
                friction_percent: friction_percent(motor),
                verdicts,
            })
        })
        .collect();
    Ok((challenges.len(), responses))
}

fn what(challenge: &Challenge) -> String {
    let goal = |goal| match goal {
        Goal::Velocity(speed) => format!("{speed:.0} cps"),
        Goal::Position { counts, .. } => format!("count {counts:.0}"),
    };
    let from = challenge.old.map_or("off".to_owned(), goal);
    let length = challenge.length_s();
    if challenge.kind == Kind::Load {
        format!("{from}, {:.3} -> {:.3} N m, {length:.1} s", challenge.old_torque, challenge.torque)
    } else {
        format!("{from} -> {}, {:.3} N m, {length:.1} s", goal(challenge.goal), challenge.torque)
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

/// Mechanical, of a motor with its load, in seconds.
fn time_constant(motor: &catalogue::Motor, load: &Load) -> f64 {
    let shaft = Shaft::new(motor, load);
    shaft.inertia.0 / (motor.ke.0 * motor.kt.0 / motor.r.0 + shaft.drag.0)
}

/// Coulomb friction in percent of the stall torque at 12 V, as scenario files have it.
fn friction_percent(motor: &Motor) -> f64 {
    let share = motor.constants.friction.coulomb.0 / motor.constants.stall_torque(Volts(12.0)).0;
    // Whole steps again, whatever the multiplication by the torque and back has made of them.
    (1e6 * 100.0 * share).round() / 1e6
}
