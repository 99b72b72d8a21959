//! What can be wrong with a scenario file, and where.

use crate::hardware::MOTORS;
use crate::scheme::BlendError;
use motor_hub::model::catalogue::UnknownMotor;
use motor_hub::supply::Levels;
use std::ops::Range;
use toml::Spanned;

/// Why there is no scenario.
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
    /// What stands in it cannot be run.
    #[error("{file}:{line}:{column}: {mistake}")]
    Wrong {
        /// Its path.
        file: String,
        /// Where, counted from 1.
        line: usize,
        /// Where in the line, in characters, counted from 1.
        column: usize,
        /// What.
        mistake: Mistake,
    },
}

/// What is wrong with a scenario.
#[derive(Debug, thiserror::Error)]
pub enum Mistake {
    /// Broken TOML, an unknown key or a value of another type, in the parser's words.
    #[error("{0}")]
    Toml(String),
    /// A motor is named and given, or neither.
    #[error("a motor has either motor = \"NAME\" or constants = {{ .. }}")]
    MotorOrConstants,
    /// No such motor.
    #[error(transparent)]
    Motor(UnknownMotor),
    /// A blend out of range, or with another scheme than D.
    #[error(transparent)]
    Blend(BlendError),
    /// A blend without `scheme = "D"`.
    #[error("a blend goes with scheme = \"D\" only")]
    BlendAlone,
    /// A number beyond its range.
    #[error("{key} = {value} is out of range; allowed is {low} to {high}")]
    OutOfRange {
        /// What the file calls it.
        key: &'static str,
        /// As it stands there.
        value: f64,
        /// The least that is allowed.
        low: f64,
        /// The most that is allowed.
        high: f64,
    },
    /// More motors than channels, or none.
    #[error("{0} motors; the hub drives 1 to {MOTORS}")]
    Motors(usize),
    /// Two motors of one label.
    #[error("label {0:?} is taken; every motor needs its own")]
    LabelTaken(String),
    /// A motor that is told nothing.
    #[error("no set-points; a motor needs at least one, or a group")]
    NoSetpoints,
    /// A group of one, or with a member twice.
    #[error("a group is of two motors or more, each named once")]
    GroupMembers,
    /// A group that is told nothing.
    #[error("no courses; a group needs at least one")]
    NoCourses,
    /// None, or several, of the four kinds of course.
    #[error(
        "a course says exactly one of by_counts, to_counts, on_cps, and straight_mm or turn_degrees or both"
    )]
    CourseKind,
    /// More or fewer numbers than members.
    #[error("{key} has {numbers} numbers; the group has {members} motors")]
    CourseLength {
        /// What the file calls them.
        key: &'static str,
        /// How many there are.
        numbers: usize,
        /// How many there should be.
        members: usize,
    },
    /// A course to an end without a speed.
    #[error("a course needs speed_cps, unless it goes on_cps")]
    CourseSpeed,
    /// A course with speeds of two kinds.
    #[error("on_cps has speeds of its own; leave speed_cps out")]
    CourseSpeeds,
    /// A way in mm or degrees, of no wheels.
    #[error("straight_mm and turn_degrees need the group's base")]
    BaseMissing,
    /// A base of another number of wheels.
    #[error("a base is of two motors, left and right")]
    BaseOfTwo,
    /// A wheel without an encoder.
    #[error("counts_per_turn = {0}; allowed is 1 to 1000000 either way")]
    CountsPerTurn(f64),
    /// A course beyond what counts can say.
    #[error("the course is longer than 2147483647 counts")]
    CourseTooLong,
    /// Groups are not run on the chip.
    #[error("groups are not run on the emulated chip; leave emulated out")]
    GroupsEmulated,
    /// Nor is a bus with a capacitor.
    #[error("a bus is not run on the emulated chip; leave emulated out")]
    BusEmulated,
    /// Nor has it a meaning where the hub is not to look.
    #[error("a bus goes with a battery that is not unlimited")]
    BusUnlimited,
    /// Limits that the hub refuses.
    #[error(
        "burn_between_v = [low, high] with low above {} V, below high, and high up to {} V",
        .0.recover.to_volts(), .0.max.to_volts()
    )]
    BurnBetween(Levels),
    /// None, or several, of the four kinds of set-point.
    #[error("a set-point says exactly one of power, velocity_cps, position_counts and disable")]
    SetpointKind,
    /// None, or several, of the three ways to say how an encoder is.
    #[error("an encoder says exactly one of is, glitches_per_s and slot_missing_of")]
    EncoderKind,
    /// A position without its two companions.
    #[error("position_counts needs tolerance_counts and speed_limit_cps beside it")]
    PositionAlone,
    /// The companions of a position without one.
    #[error("tolerance_counts and speed_limit_cps go with position_counts only")]
    PositionMissing,
    /// `disable = false`.
    #[error("disable can only be true; leave it out otherwise")]
    DisableFalse,
    /// Something happens before the run, or after it.
    #[error("at_s = {at_s} is outside the run; it lasts from 0 to {duration_s} s")]
    OutsideRun {
        /// When it is to happen.
        at_s: f64,
        /// How long the run is.
        duration_s: f64,
    },
    /// Something happens before what stands above it.
    #[error("at_s = {at_s} is not after {last_s}; times must ascend")]
    NotAfter {
        /// When it is to happen.
        at_s: f64,
        /// When the one before happens.
        last_s: f64,
    },
    /// An empty name, a very long one, or one with control characters.
    #[error("{0} must be 1 to 80 printable characters")]
    Name(&'static str),
    /// An expectation that any run meets.
    #[error("an expectation says at least one thing of a motor, of a group or of the battery")]
    ExpectsNothing,
    /// A window that ends before it begins, or there and then.
    #[error("from_s must be less than to_s; without them a window is the whole run")]
    EmptyWindow,
    /// An expectation of a motor that is not there.
    #[error("no motor is labelled {label:?}; there are {}", .known.join(", "))]
    NoSuchLabel {
        /// What the file says.
        label: String,
        /// What could be said.
        known: Vec<String>,
    },
    /// An expectation of a group that is not there.
    #[error("no group is labelled {label:?}; there are {}", .known.join(", "))]
    NoSuchGroup {
        /// What the file says.
        label: String,
        /// What could be said.
        known: Vec<String>,
    },
    /// An expectation of two.
    #[error("an expectation is of a motor or of a group, not of both")]
    MotorAndGroup,
    /// Something that only motors have.
    #[error("of a group only settles_within_s and heading_error_below_degrees can be expected")]
    NotOfGroup,
    /// Something that only drive bases have.
    #[error("heading_error_below_degrees is of a group with a base")]
    HeadingOfBase,
    /// The battery is no motor's own.
    #[error("bus_between_v is of the battery; leave motor out")]
    BusOfMotor,
    /// The lower bound is above the upper one.
    #[error("{0} = [low, high] with low above high")]
    LowAboveHigh(&'static str),
}

/// What is wrong, and where in the text.
#[derive(Debug)]
pub(super) struct Fault {
    span: Range<usize>,
    mistake: Mistake,
}

impl Fault {
    /// Of the whole text, in the parser's words.
    pub(super) fn of_toml(error: &toml::de::Error) -> Self {
        // One line.
        let words = error.message().trim_end().replace('\n', "; ");
        Self { span: error.span().unwrap_or(0..0), mistake: Mistake::Toml(words) }
    }

    /// With line and column, counted from 1.
    pub(super) fn in_file(self, file: &str, text: &str) -> ScenarioError {
        let (line, column) = line_and_column(text, self.span.start);
        ScenarioError::Wrong { file: file.to_owned(), line, column, mistake: self.mistake }
    }
}

/// Of a byte of a text, both counted from 1, columns in characters; of its end, if it is not so long.
pub fn line_and_column(text: &str, at: usize) -> (usize, usize) {
    let before = text.get(..at).unwrap_or(text);
    let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
    (before.matches('\n').count() + 1, column)
}

pub(super) fn fault<T>(at: &Spanned<T>, mistake: Mistake) -> Fault {
    Fault { span: at.span(), mistake }
}

pub(super) type Checked<T> = Result<T, Fault>;
