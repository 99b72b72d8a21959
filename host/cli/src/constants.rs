//! Options for the constants of a motor that the catalogue lacks.

use crate::output::Failure;
use crate::parse::number;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::friction::{Cogging, Friction};
use motor_hub::model::si::{Drag, EmfConstant as Ke, Henries, KgM2, Ohms, TorqueConstant};
use motor_hub::units::{EmfConstant, Inductance, Resistance};
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// Constants of the motor's own shaft, before the gearbox, as in data sheets.
#[derive(Clone, clap::Args)]
pub(crate) struct Constants {
    /// Back-EMF constant of the motor's shaft; needs --counts-per-rev of the same shaft
    #[arg(long = "ke-v-s-per-rad", alias = "ke", value_name = "V_S_PER_RAD", requires = "counts_per_rev")]
    #[arg(help_heading = CATALOGUE_LACKS, value_parser = number("a back-EMF constant", KE, "V s/rad"))]
    ke: Option<f64>,
    /// Encoder counts in a turn of the shaft of --ke-v-s-per-rad: usually the motor's, before the gearbox
    #[arg(long, value_name = "COUNTS", requires = "ke", help_heading = CATALOGUE_LACKS)]
    #[arg(value_parser = number("an encoder's resolution", COUNTS, "counts in a turn"))]
    counts_per_rev: Option<f64>,
    /// Resistance of the winding
    #[arg(long, value_name = "OHM", help_heading = CATALOGUE_LACKS)]
    #[arg(value_parser = number("a resistance", THOUSANDTHS, "ohm"))]
    resistance_ohm: Option<f64>,
    /// Inductance of the winding
    #[arg(long, value_name = "MH", help_heading = CATALOGUE_LACKS)]
    #[arg(value_parser = number("an inductance", THOUSANDTHS, "mH"))]
    inductance_mh: Option<f64>,
}

/// Upper limit of [`EmfConstant`] in V s/count. The limit itself is not allowed.
const LARGEST_V_S_PER_COUNT: f64 = 0.032;
/// Allowed back-EMF constants in V s/rad. Scenario files have these limits too.
const KE: RangeInclusive<f64> = 1e-5..=10.0;
/// Allowed encoder counts in a turn.
const COUNTS: RangeInclusive<f64> = 1.0..=1e6;
/// Allowed resistances in ohm and inductances in mH: the range of the hub's settings.
const THOUSANDTHS: RangeInclusive<f64> = 0.001..=65.535;

const CATALOGUE_LACKS: &str = "A motor that the catalogue lacks";

impl Constants {
    /// Returns true if neither back EMF nor resistance nor inductance is given.
    pub(crate) const fn is_empty(&self) -> bool {
        self.ke.is_none() && self.resistance_ohm.is_none() && self.inductance_mh.is_none()
    }

    /// Returns the back-EMF constant; `None` if it is not given.
    pub(crate) fn emf(&self) -> Result<Option<EmfConstant>, Failure> {
        let (Some(ke), Some(counts)) = (self.ke, self.counts_per_rev) else { return Ok(None) };
        EmfConstant::from_ke(ke, counts).map(Some).map_err(|_| {
            let most = LARGEST_V_S_PER_COUNT * counts / TAU;
            Failure::Input(format!(
                "--ke-v-s-per-rad {ke} is out of range; with --counts-per-rev {counts} allowed is above 0 and below {most:.4} V s/rad"
            ))
        })
    }

    pub(crate) fn resistance(&self) -> Result<Option<Resistance>, Failure> {
        self.resistance_ohm.map(Resistance::from_ohms).transpose().map_err(Failure::input)
    }

    pub(crate) fn inductance(&self) -> Result<Option<Inductance>, Failure> {
        self.inductance_mh.map(Inductance::from_millihenries).transpose().map_err(Failure::input)
    }

    /// Returns a motor with these constants, without gearbox, drag and inertia.
    pub(crate) fn motor(&self) -> Result<Motor, Failure> {
        // Checks the back EMF. The parsers of the options have checked the other constants.
        self.emf()?;
        let (Some(ke), Some(counts), Some(ohms), Some(mh)) =
            (self.ke, self.counts_per_rev, self.resistance_ohm, self.inductance_mh)
        else {
            let why = "name the motor by --motor, or give --ke-v-s-per-rad, --counts-per-rev, --resistance-ohm and --inductance-mh";
            return Err(Failure::input(why));
        };
        Ok(Motor {
            name: "motor",
            r: Ohms(ohms),
            l: Henries(mh / 1e3),
            gear_ratio: 1.0,
            eta: 1.0,
            ke: Ke(ke),
            kt: TorqueConstant(ke),
            b: Drag(0.0),
            friction: Friction::NONE,
            cogging: Cogging::NONE,
            j: KgM2(0.0),
            j_rotor_measured: KgM2(0.0),
            counts_per_rev_motor: counts,
        })
    }
}
