//! Options of how motors are controlled: scheme, blend, duty rule.

use crate::output::Failure;
use crate::parse::named;
use motor_hub::braking::{DutyRule, Scheme};
use simulated::scheme::{BlendChoice, BlendError, SchemeName};

/// Scheme names with their descriptions.
pub(crate) const SCHEMES: [(&str, &str, SchemeName); 5] = [
    ("none", "No braking regime: forward and reverse driving only", SchemeName::None),
    ("A", "Control is an equivalent voltage", SchemeName::A),
    ("B", "Control is a current", SchemeName::B),
    ("C", "As B, with braking as steep as driving", SchemeName::C),
    ("D", "Between B and C: see --blend", SchemeName::D),
];

/// Duty rules with their descriptions.
const DUTY_RULES: [(&str, &str, DutyRule); 2] = [
    (
        "linear-current",
        "The mean current is linear between the points, by the motor's winding",
        DutyRule::LinearCurrent,
    ),
    ("linear-duty", "The duty is linear between the points, as in the paper", DutyRule::LinearDuty),
];

pub(crate) fn scheme(name: SchemeName, blend: Option<BlendChoice>) -> Result<Scheme, Failure> {
    name.with_blend(blend).map_err(without_d)
}

fn without_d(error: BlendError) -> Failure {
    Failure::Input(format!("--blend: {error}; give --scheme D"))
}

/// Scheme, blend and duty rule, each if it is given.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct SchemeOptions {
    /// Scheme: the meaning of control values
    #[arg(long, ignore_case = true, value_parser = named(SCHEMES))]
    scheme: Option<SchemeName>,
    /// Blend of scheme D: 0 (as B) to 1 (as C), or auto
    #[arg(long, value_name = "0..1|auto")]
    blend: Option<BlendChoice>,
    /// Rule for duties within a regime
    #[arg(long, ignore_case = true, value_parser = named(DUTY_RULES))]
    pub(crate) duty: Option<DutyRule>,
}

impl SchemeOptions {
    /// Returns the scheme; `None` if it is not given.
    pub(crate) fn scheme(&self) -> Result<Option<Scheme>, Failure> {
        match self.scheme {
            None if self.blend.is_some() => Err(without_d(BlendError::NotD)),
            name => name.map(|name| scheme(name, self.blend)).transpose(),
        }
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.scheme.is_none() && self.blend.is_none() && self.duty.is_none()
    }
}
