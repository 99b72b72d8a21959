//! Options of how motors are controlled: scheme, blend, duty rule.

use crate::output::Failure;
use crate::parse::named;
use motor_hub::braking::{Blend, DutyRule, Scheme};
use simulated::scheme::{BlendChoice, SchemeError, SchemeName};

/// Scheme names with their descriptions.
pub(crate) const SCHEMES: [(&str, &str, Scheme); 5] = [
    ("none", "No braking regime: forward and reverse driving only", Scheme::ForwardReverse),
    ("A", "Control is an equivalent voltage", Scheme::A),
    ("B", "Control is a current", Scheme::B),
    ("C", "As B, with braking as steep as driving", Scheme::C),
    ("D", "Between B and C: see --blend", Scheme::D(Blend::Automatic)),
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

pub(crate) fn scheme(scheme: Scheme, blend: Option<BlendChoice>) -> Result<Scheme, Failure> {
    SchemeName(scheme).with_blend(blend).map_err(without_d)
}

fn without_d(error: SchemeError) -> Failure {
    Failure::Input(format!("--blend: {error}; give --scheme D"))
}

/// Scheme, blend and duty rule, each if it is given.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct SchemeOptions {
    /// Scheme: the meaning of control values
    #[arg(long, ignore_case = true, value_parser = named(SCHEMES))]
    scheme: Option<Scheme>,
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
            None if self.blend.is_some() => Err(without_d(SchemeError::NotD)),
            given => given.map(|given| scheme(given, self.blend)).transpose(),
        }
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.scheme.is_none() && self.blend.is_none() && self.duty.is_none()
    }
}
