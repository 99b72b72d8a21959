//! The variants that are compared.

use motor_hub::braking::{Blend, DutyRule, Scheme};
use motor_hub::regulator::Kind;
use serde::{Serialize, Serializer};

/// A scheme, a duty rule and a regulator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Variant {
    /// Name in files and JSON.
    name: &'static str,
    /// Sign in the table of winners.
    pub(super) sign: &'static str,
    /// The scheme, which locates the points.
    pub(super) scheme: Scheme,
    /// The rule for duties between the points.
    pub(super) duty: DutyRule,
    /// The regulator, which gives control values.
    pub(super) regulator: Kind,
}

impl Serialize for Variant {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name)
    }
}

impl Variant {
    /// All variants. With PID: no braking regime, then A to D with either duty. With the model: no braking regime, A
    /// and B.
    pub(super) const ALL: [Self; 12] = {
        use DutyRule::{LinearCurrent, LinearDuty};
        use Kind::{Model, Pid};
        use Scheme::{A, B, C, ForwardReverse};
        const D: Scheme = Scheme::D(Blend::Automatic);
        const fn of(
            name: &'static str,
            sign: &'static str,
            scheme: Scheme,
            duty: DutyRule,
            regulator: Kind,
        ) -> Variant {
            Variant { name, sign, scheme, duty, regulator }
        }
        [
            of("none", "0", ForwardReverse, LinearDuty, Pid),
            of("A, linear duty", "a", A, LinearDuty, Pid),
            of("B, linear duty", "b", B, LinearDuty, Pid),
            of("C, linear duty", "c", C, LinearDuty, Pid),
            of("D, linear duty", "d", D, LinearDuty, Pid),
            of("A, linear current", "A", A, LinearCurrent, Pid),
            of("B, linear current", "B", B, LinearCurrent, Pid),
            of("C, linear current", "C", C, LinearCurrent, Pid),
            of("D, linear current", "D", D, LinearCurrent, Pid),
            of("none, model", "0'", ForwardReverse, LinearCurrent, Model),
            of("A, model", "A'", A, LinearCurrent, Model),
            of("B, model", "B'", B, LinearCurrent, Model),
        ]
    };

    /// False for a variant of the model, which has no coefficients.
    pub(super) fn has_coefficients(self) -> bool {
        self.regulator == Kind::Pid
    }

    /// The name for people: "none" becomes "no braking regime".
    pub(super) fn in_words(self) -> String {
        self.name.replacen("none", "no braking regime", 1)
    }
}
