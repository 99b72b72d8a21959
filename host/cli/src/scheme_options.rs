//! Options of how motors are controlled: scheme, blend, duty rule.

use crate::output::Failure;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use motor_hub::braking::{DutyRule, Scheme};
use simulated::scheme::{BlendChoice, BlendError, SchemeName};

/// A parser of a scheme's name, in either case.
pub(crate) fn scheme_name() -> impl TypedValueParser<Value = SchemeName> {
    let names = [
        ("none", "No braking regime: forward and reverse driving only"),
        ("A", "Control is an equivalent voltage"),
        ("B", "Control is a current"),
        ("C", "As B, with braking as steep as driving"),
        ("D", "Between B and C: see --blend"),
    ];
    PossibleValuesParser::new(names.map(|(name, help)| PossibleValue::new(name).help(help)))
        .try_map(|name| name.parse())
}

/// The scheme with its blend.
pub(crate) fn scheme(name: SchemeName, blend: Option<BlendChoice>) -> Result<Scheme, Failure> {
    name.with_blend(blend).map_err(without_d)
}

fn without_d(error: BlendError) -> Failure {
    Failure::Input(format!("--blend: {error}; give --scheme D"))
}

/// How the duty is found within a regime.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum DutyOption {
    /// The mean current is linear between the points, by the motor's winding
    LinearCurrent,
    /// The duty is linear between the points, as in the paper
    LinearDuty,
}

/// Scheme, blend and duty rule, each if it is given.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct SchemeOptions {
    /// Scheme: the meaning of control values
    #[arg(long, ignore_case = true, value_parser = scheme_name())]
    scheme: Option<SchemeName>,
    /// Blend of scheme D: 0 (as B) to 1 (as C), or auto
    #[arg(long, value_name = "0..1|auto")]
    blend: Option<BlendChoice>,
    /// Rule for duties within a regime
    #[arg(long, ignore_case = true)]
    duty: Option<DutyOption>,
}

impl SchemeOptions {
    /// The scheme, if it is given.
    pub(crate) fn scheme(&self) -> Result<Option<Scheme>, Failure> {
        match self.scheme {
            None if self.blend.is_some() => Err(without_d(BlendError::NotD)),
            name => name.map(|name| scheme(name, self.blend)).transpose(),
        }
    }

    /// The duty rule, if it is given.
    pub(crate) fn duty(&self) -> Option<DutyRule> {
        self.duty.map(|duty| match duty {
            DutyOption::LinearCurrent => DutyRule::LinearCurrent,
            DutyOption::LinearDuty => DutyRule::LinearDuty,
        })
    }

    /// True if no option is given.
    pub(crate) const fn is_empty(&self) -> bool {
        self.scheme.is_none() && self.blend.is_none() && self.duty.is_none()
    }
}
