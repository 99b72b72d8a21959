//! What can be wrong with a scenario file, and where.

use crate::hardware::MOTORS;
use crate::scheme::BlendError;
use motor_hub::model::catalogue::UnknownMotor;
use motor_hub::supply::Levels;
use std::ops::Range;
use toml::Spanned;

/// Why a scenario file is refused.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("{file}: {source}")]
    Unreadable {
        /// Its path.
        file: String,
        /// Why not.
        source: std::io::Error,
    },
    /// The scenario cannot be run.
    #[error("{file}:{line}:{column}: {mistake}")]
    Wrong {
        /// Its path.
        file: String,
        /// The line, counted from 1.
        line: usize,
        /// The column in characters, counted from 1.
        column: usize,
        /// What is wrong.
        mistake: Mistake,
    },
}

/// What is wrong with a scenario.
#[derive(Debug, thiserror::Error)]
pub enum Mistake {
    /// Broken TOML, an unknown key or a value of another type, in the parser's words.
    #[error("{0}")]
    Toml(String),
    /// A motor has a name and constants, or neither.
    #[error("a motor needs either motor = \"NAME\" or constants = {{ .. }}")]
    MotorOrConstants,
    /// A train without an inertia behind it.
    #[error("a train needs a load with inertia_kg_m2 above 0, which it turns")]
    TrainWithoutLoad,
    /// No such motor.
    #[error(transparent)]
    Motor(UnknownMotor),
    /// A blend out of range, or with another scheme than D.
    #[error(transparent)]
    Blend(BlendError),
    /// A blend without `scheme = "D"`.
    #[error("blend is allowed with scheme = \"D\" only")]
    BlendAlone,
    /// A number beyond its range.
    #[error("{key} = {value} is out of range; allowed is {low} to {high}")]
    OutOfRange {
        /// The key.
        key: &'static str,
        /// The value in the file.
        value: f64,
        /// The least allowed value.
        low: f64,
        /// The largest allowed value.
        high: f64,
    },
    /// More motors than the hub drives, or none.
    #[error("there are {0} motors; allowed are 1 to {MOTORS}")]
    Motors(usize),
    /// Two motors of one label.
    #[error("label {0:?} is used twice; labels must differ")]
    LabelTaken(String),
    /// A motor without set-points.
    #[error("a motor needs at least one set-point, or a group")]
    NoSetpoints,
    /// A group of one, or with a member twice.
    #[error("a group needs two motors or more, each named once")]
    GroupMembers,
    /// A group without courses.
    #[error("a group needs at least one course")]
    NoCourses,
    /// None, or several, of the four kinds of course.
    #[error(
        "a course needs exactly one of by_counts, to_counts, on_cps, and straight_mm or turn_degrees or both"
    )]
    CourseKind,
    /// More or fewer numbers than members.
    #[error("{key} has {numbers} numbers; it needs {members}, one for each motor of the group")]
    CourseLength {
        /// The key.
        key: &'static str,
        /// Numbers in the file.
        numbers: usize,
        /// Motors of the group.
        members: usize,
    },
    /// A course to an end without a speed.
    #[error("a course needs speed_cps; only on_cps is without")]
    CourseSpeed,
    /// A course with speeds of two kinds.
    #[error("on_cps has its own speeds; remove speed_cps")]
    CourseSpeeds,
    /// A distance in mm or degrees without wheels.
    #[error("straight_mm and turn_degrees need a base in the group")]
    BaseMissing,
    /// A base of another number of wheels.
    #[error("a base needs two motors, left and right")]
    BaseOfTwo,
    /// A wheel without an encoder.
    #[error("counts_per_turn = {0} is out of range; allowed is 1 to 1000000, or -1000000 to -1")]
    CountsPerTurn(f64),
    /// A course of more counts than a position has.
    #[error("the course is longer than 2147483647 counts")]
    CourseTooLong,
    /// Groups do not run on the chip.
    #[error("groups do not run on the emulated chip; remove emulated")]
    GroupsEmulated,
    /// A bus with a capacitor does not run on the chip.
    #[error("a bus does not run on the emulated chip; remove emulated")]
    BusEmulated,
    /// A train in a scenario for the emulated chip.
    #[error("a train does not run on the emulated chip; remove emulated")]
    TrainEmulated,
    /// A bus needs the hub's voltage limits.
    #[error("a bus needs a battery with limits; remove unlimited")]
    BusUnlimited,
    /// Limits that the hub refuses.
    #[error(
        "burn_between_v needs [low, high] with low above {} V, below high, and high up to {} V",
        .0.recover.to_volts(), .0.max.to_volts()
    )]
    BurnBetween(Levels),
    /// None, or several, of the five kinds of set-point.
    #[error("a set-point needs exactly one of power, current_a, velocity_cps, position_counts and disable")]
    SetpointKind,
    /// None, or several, of the three descriptions of an encoder.
    #[error("an encoder needs exactly one of is, glitches_per_s and slot_missing_of")]
    EncoderKind,
    /// A position without its two companions.
    #[error("position_counts needs tolerance_counts and speed_limit_cps")]
    PositionAlone,
    /// A tolerance without a position.
    #[error("tolerance_counts is allowed with position_counts only")]
    PositionMissing,
    /// A speed limit without a position or a current.
    #[error("speed_limit_cps is allowed with position_counts and current_a only")]
    SpeedLimitAlone,
    /// `disable = false`.
    #[error("disable = false is not allowed; remove disable")]
    DisableFalse,
    /// A time before or after the run.
    #[error("at_s = {at_s} is outside the run; allowed is 0 to {duration_s}")]
    OutsideRun {
        /// The time in the file.
        at_s: f64,
        /// Length of the run.
        duration_s: f64,
    },
    /// A time before the time of the entry above.
    #[error("at_s = {at_s} is not after {last_s}; times must ascend")]
    NotAfter {
        /// The time in the file.
        at_s: f64,
        /// The time of the entry above.
        last_s: f64,
    },
    /// An empty name, a very long one, or one with control characters.
    #[error("{0} must be 1 to 80 printable characters")]
    Name(&'static str),
    /// An expectation without a quantity.
    #[error("an expectation needs at least one key of a motor, a group or the battery")]
    ExpectsNothing,
    /// A window without length.
    #[error("from_s must be less than to_s; the window without both is the whole run")]
    EmptyWindow,
    /// An expectation of a motor that does not exist.
    #[error("no motor has the label {label:?}; labels are {}", .known.join(", "))]
    NoSuchLabel {
        /// The label in the file.
        label: String,
        /// The labels that exist.
        known: Vec<String>,
    },
    /// An expectation of a group that does not exist.
    #[error("no group has the label {label:?}; labels are {}", .known.join(", "))]
    NoSuchGroup {
        /// The label in the file.
        label: String,
        /// The labels that exist.
        known: Vec<String>,
    },
    /// An expectation of a motor and a group.
    #[error("an expectation has a motor or a group, not both")]
    MotorAndGroup,
    /// A quantity of motors only.
    #[error("an expectation of a group allows settles_within_s and heading_error_below_degrees only")]
    NotOfGroup,
    /// A quantity of drive bases only.
    #[error("heading_error_below_degrees needs a group with a base")]
    HeadingOfBase,
    /// The battery belongs to no motor.
    #[error("bus_between_v is about the battery; remove motor")]
    BusOfMotor,
    /// The lower bound is above the upper one.
    #[error("{0} needs [low, high] with low at most high")]
    LowAboveHigh(&'static str),
}

/// What is wrong, and where in the text.
#[derive(Debug)]
pub(super) struct Fault {
    span: Range<usize>,
    mistake: Mistake,
}

impl Fault {
    /// A fault of the TOML syntax, in the parser's words.
    pub(super) fn of_toml(error: &toml::de::Error) -> Self {
        // One line.
        let words = error.message().trim_end().replace('\n', "; ");
        Self { span: error.span().unwrap_or(0..0), mistake: Mistake::Toml(words) }
    }

    /// The error with line and column, counted from 1.
    pub(super) fn in_file(self, file: &str, text: &str) -> ScenarioError {
        let (line, column) = line_and_column(text, self.span.start);
        ScenarioError::Wrong { file: file.to_owned(), line, column, mistake: self.mistake }
    }
}

/// Line and column of a byte of a text, counted from 1, columns in characters. Past the end, the end counts.
pub fn line_and_column(text: &str, at: usize) -> (usize, usize) {
    let before = text.get(..at).unwrap_or(text);
    let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
    (before.matches('\n').count() + 1, column)
}

pub(super) fn fault<T>(at: &Spanned<T>, mistake: Mistake) -> Fault {
    Fault { span: at.span(), mistake }
}

pub(super) type Checked<T> = Result<T, Fault>;
