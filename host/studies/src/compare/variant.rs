//! The variants that are compared.

use motor_hub::braking::{Blend, DutyRule, Scheme};
use motor_hub::regulator::Kind;
use serde::{Serialize, Serializer};
use simulated::scheme::SchemeWords;

/// A scheme, a duty rule and a regulator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Variant {
    /// The scheme, which locates the points.
    #[serde(flatten, serialize_with = "scheme_words")]
    pub(super) scheme: Scheme,
    /// The rule for duties between the points.
    pub(super) duty: DutyRule,
    /// The regulator, which gives control values.
    #[serde(serialize_with = "regulator_word")]
    pub(super) regulator: Kind,
}

impl Variant {
    /// False for a variant of the model, which has no coefficients.
    pub(super) fn has_coefficients(self) -> bool {
        self.regulator == Kind::Pid
    }

    /// All variants. With PID: no braking regime, then A to D with either duty. With the model: no braking regime, A
    /// and B.
    pub(super) const ALL: [Self; 12] = {
        const fn of(scheme: Scheme, duty: DutyRule) -> Variant {
            Variant { scheme, duty, regulator: Kind::Pid }
        }
        const fn model(scheme: Scheme) -> Variant {
            Variant { scheme, duty: DutyRule::LinearCurrent, regulator: Kind::Model }
        }
        const D: Scheme = Scheme::D(Blend::Automatic);
        [
            of(Scheme::ForwardReverse, DutyRule::LinearDuty),
            of(Scheme::A, DutyRule::LinearDuty),
            of(Scheme::B, DutyRule::LinearDuty),
            of(Scheme::C, DutyRule::LinearDuty),
            of(D, DutyRule::LinearDuty),
            of(Scheme::A, DutyRule::LinearCurrent),
            of(Scheme::B, DutyRule::LinearCurrent),
            of(Scheme::C, DutyRule::LinearCurrent),
            of(D, DutyRule::LinearCurrent),
            model(Scheme::ForwardReverse),
            model(Scheme::A),
            model(Scheme::B),
        ]
    };

    /// The variant's name in files and JSON.
    pub(super) fn name(self) -> String {
        match (self.scheme, self.duty) {
            (scheme, _) if self.regulator == Kind::Model => format!("{}, model", letter(scheme)),
            (Scheme::ForwardReverse, _) => "none".to_owned(),
            (scheme, DutyRule::LinearDuty) => format!("{}, linear duty", letter(scheme)),
            (scheme, DutyRule::LinearCurrent) => format!("{}, linear current", letter(scheme)),
        }
    }
}

/// A variant's name for people: "none" becomes "no braking regime".
pub(super) fn in_words(name: &str) -> String {
    name.strip_prefix("none").map_or_else(|| name.to_owned(), |rest| format!("no braking regime{rest}"))
}

fn scheme_words<S: Serializer>(scheme: &Scheme, to: S) -> Result<S::Ok, S::Error> {
    SchemeWords(*scheme).serialize(to)
}

fn regulator_word<S: Serializer>(regulator: &Kind, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(regulator.name())
}

fn letter(scheme: Scheme) -> &'static str {
    match scheme {
        Scheme::ForwardReverse => "none",
        Scheme::A => "A",
        Scheme::B => "B",
        Scheme::C => "C",
        Scheme::D(_) => "D",
    }
}
