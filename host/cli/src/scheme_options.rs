//! Options that choose how motors are controlled: scheme, blend, duty rule.

use crate::output::Failure;
use motor_hub::braking::{DutyRule, Scheme};
use simulated::scheme::{BlendChoice, BlendError, SchemeName};

/// A scheme's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum SchemeOption {
    /// No braking regime: forward and reverse driving only
    None,
    /// Control is an equivalent voltage
    #[value(name = "A")]
    A,
    /// Control is a current
    #[value(name = "B")]
    B,
    /// As B, with braking as steep as driving
    #[value(name = "C")]
    C,
    /// Between B and C: see --blend
    #[value(name = "D")]
    D,
}

impl SchemeOption {
    /// The scheme that the firmware is set to.
    pub(crate) fn with_blend(self, blend: Option<BlendChoice>) -> Result<Scheme, Failure> {
        let name = match self {
            Self::None => SchemeName::None,
            Self::A => SchemeName::A,
            Self::B => SchemeName::B,
            Self::C => SchemeName::C,
            Self::D => SchemeName::D,
        };
        name.with_blend(blend).map_err(without_d)
    }
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

/// What is chosen.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct SchemeOptions {
    /// Scheme: the meaning of control values
    #[arg(long, ignore_case = true)]
    scheme: Option<SchemeOption>,
    /// Blend of scheme D: 0 (as B) to 1 (as C), or auto
    #[arg(long, value_name = "0..1|auto")]
    blend: Option<BlendChoice>,
    /// Rule for duties within a regime
    #[arg(long, ignore_case = true)]
    duty: Option<DutyOption>,
}

impl SchemeOptions {
    /// The scheme, if one is chosen.
    pub(crate) fn scheme(&self) -> Result<Option<Scheme>, Failure> {
        match self.scheme {
            None if self.blend.is_some() => Err(without_d(BlendError::NotD)),
            name => name.map(|name| name.with_blend(self.blend)).transpose(),
        }
    }

    /// The duty rule, if one is chosen.
    pub(crate) fn duty(&self) -> Option<DutyRule> {
        self.duty.map(|duty| match duty {
            DutyOption::LinearCurrent => DutyRule::LinearCurrent,
            DutyOption::LinearDuty => DutyRule::LinearDuty,
        })
    }

    /// True if nothing is chosen.
    pub(crate) const fn is_empty(&self) -> bool {
        self.scheme.is_none() && self.blend.is_none() && self.duty.is_none()
    }
}
