//! The motors that R. Atkinson characterised for his paper *On Proportional Braking in H Bridges* (2018).
//!
//! The constants are measurements from his repository `rgatkinson/RobotPhysics`. The header of `motors.csv` explains
//! the columns of the data file. [`CatalogueEntry::caveats`] lists their known weaknesses.
//!
//! The name of a motor is its product name ("NeveRest 60"). [`find`] also accepts the author's name ("AM 60 A") and the
//! part number.
//!
//! ```
//! use motor_hub::model::catalogue::{catalogue, find};
//!
//! let entry = find("NeveRest 60").expect("in the catalogue");
//! assert!(catalogue().contains(entry));
//! assert_eq!(find("AM 60 A"), Some(entry));
//! let motor = entry.motor.expect("characterised");
//! assert_eq!((motor.gear_ratio, motor.counts_per_rev_motor), (60.0, 28.0));
//! ```

use std::sync::LazyLock;

use super::friction::{Cogging, Friction};
use super::si::{Drag, EmfConstant, Henries, KgM2, NewtonMetres, Ohms, RadPerSec, TorqueConstant, Volts};

/// Constants of a geared DC motor. All constants are at the motor shaft, before the gearbox.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Product name, as in [`CatalogueEntry::name`].
    pub name: &'static str,
    /// Winding resistance. It was measured at 1 kHz on a motor at rest, where brush contact dominates. Specimens of one
    /// product differ by a factor of up to 5.
    pub r: Ohms,
    /// Winding inductance.
    pub l: Henries,
    /// Reduction ratio: turns of the motor shaft per turn of the output shaft.
    pub gear_ratio: f64,
    /// Efficiency of the gearbox, above 0 and at most 1: output torque = gear ratio * efficiency * motor torque.
    pub eta: f64,
    /// Back-EMF constant Ke.
    pub ke: EmfConstant,
    /// Torque constant Kt.
    pub kt: TorqueConstant,
    /// Viscous drag of motor and gearbox.
    pub b: Drag,
    /// Dry friction, 0 in the catalogue. Plants include it; the closed forms in [`response`](super::response) do not.
    pub friction: Friction,
    /// Cogging, 0 in the catalogue. Plants include it; the closed forms in [`response`](super::response) do not.
    pub cogging: Cogging,
    /// Inertia that the paper uses: the value of the author's workbook divided by `eta * ratio²`.
    pub j: KgM2,
    /// Inertia that was measured on the bare armature, according to the measurement report.
    pub j_rotor_measured: KgM2,
    /// Encoder counts per turn of the motor shaft.
    pub counts_per_rev_motor: f64,
}

impl Motor {
    /// Returns the motor with the inertia that was measured on its bare armature.
    ///
    /// The paper treats the measured inertia as an inertia after the gearbox, and so gets the much smaller
    /// [`j`](Self::j). With `j` a NeveRest 60 without load has a mechanical time constant of 30 us, and with the
    /// inertia of its armature 98 ms.
    #[must_use]
    pub const fn with_measured_rotor_inertia(self) -> Self {
        Self { j: self.j_rotor_measured, ..self }
    }

    /// Returns the stall torque on the motor shaft at a voltage, `Kt V / R`.
    #[must_use]
    pub fn stall_torque(&self, voltage: Volts) -> NewtonMetres {
        NewtonMetres(self.kt.0 * voltage.0 / self.r.0)
    }

    /// Returns the speed of the motor shaft without load at a voltage, `Kt V / (Kt Ke + B R)`.
    #[must_use]
    pub fn free_speed(&self, voltage: Volts) -> RadPerSec {
        RadPerSec(self.kt.0 * voltage.0 / (self.kt.0 * self.ke.0 + self.b.0 * self.r.0))
    }

    /// Returns the encoder counts per turn of the output shaft.
    #[must_use]
    pub fn counts_per_rev_output(&self) -> f64 {
        self.counts_per_rev_motor * self.gear_ratio
    }

    /// Returns the back EMF per encoder speed in mV s/count: `2000 pi Ke / counts per turn` (paper, revision of 31
    /// August 2018).
    #[must_use]
    pub fn ke_fw(&self) -> f64 {
        2000.0 * core::f64::consts::PI * self.ke.0 / self.counts_per_rev_motor
    }
}

/// One row of the catalogue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CatalogueEntry {
    /// Product name, such as "NeveRest 40". If several specimens were measured, the specimen with the fewest caveats
    /// has the product name alone. The others have a letter after the name, such as "NeveRest 40-A".
    pub name: &'static str,
    /// The author's name: product family, gear ratio, and a letter for the specimen, such as "AM 40 A".
    pub specimen: &'static str,
    /// Part number of the vendor. The text is empty for further specimens of a product.
    pub part_number: &'static str,
    /// Encoder counts per turn of the motor shaft.
    pub counts_per_rev_motor: f64,
    /// Reduction ratio: turns of the motor shaft per turn of the output shaft.
    pub gear_ratio: f64,
    /// Constants of the motor; `None` if the motor was never characterised.
    pub motor: Option<Motor>,
    /// File and place in the author's repository that the row comes from.
    pub source: &'static str,
    /// Doubts about the values of the row; empty if none are known.
    pub caveats: &'static str,
}

/// Text of the data file.
const TABLE: &str = include_str!("motors.csv");

/// Returns the text of a row in the column with this heading. `headings` are the headings of all columns in their
/// order.
fn text<'r>(headings: &[&str], row: &[&'r str], heading: &str) -> Option<&'r str> {
    row.get(headings.iter().position(|&known| known == heading)?).copied()
}

/// Returns the number of a row in the column with this heading.
fn number(headings: &[&str], row: &[&str], heading: &str) -> Option<f64> {
    text(headings, row, heading)?.parse().ok()
}

/// Splits a line of comma-separated values. A field in double quotes may contain commas. The data file has no doubled
/// quotes inside a field.
fn fields(line: &str) -> Vec<&str> {
    let mut out = Vec::new();
    let mut rest = Some(line);
    while let Some(text) = rest {
        let quoted = text.strip_prefix('"').and_then(|inner| inner.split_once('"'));
        let (field, tail) = match quoted {
            Some((field, tail)) => (field, tail.strip_prefix(',')),
            None => match text.split_once(',') {
                Some((field, tail)) => (field, Some(tail)),
                None => (text, None),
            },
        };
        out.push(field);
        rest = tail;
    }
    out
}

/// Reads the constants of a motor from a row. `None` if a value is missing.
fn motor(headings: &[&str], row: &[&'static str]) -> Option<Motor> {
    let number = |heading| number(headings, row, heading);
    Some(Motor {
        name: text(headings, row, "sold_as")?,
        r: Ohms(number("R_ohm")?),
        l: Henries(number("L_H")?),
        gear_ratio: number("N_gear_ratio")?,
        eta: number("eta")?,
        ke: EmfConstant(number("Ke_V_s_per_rad")?),
        kt: TorqueConstant(number("Kt_Nm_per_A")?),
        b: Drag(number("B_Nms_per_rad")?),
        friction: Friction::NONE,
        cogging: Cogging::NONE,
        j: KgM2(number("J_kg_m2")?),
        j_rotor_measured: KgM2(number("J_rotor_measured_kg_m2")?),
        counts_per_rev_motor: number("encoder_counts_per_rev_motor")?,
    })
}

/// Reads an entry from a row. `None` if a value is missing, except for the constants of the motor.
fn entry(headings: &[&str], row: &[&'static str]) -> Option<CatalogueEntry> {
    Some(CatalogueEntry {
        name: text(headings, row, "sold_as")?,
        specimen: text(headings, row, "name")?,
        part_number: text(headings, row, "model")?,
        counts_per_rev_motor: number(headings, row, "encoder_counts_per_rev_motor")?,
        gear_ratio: number(headings, row, "N_gear_ratio")?,
        motor: motor(headings, row),
        source: text(headings, row, "source")?,
        caveats: text(headings, row, "notes")?,
    })
}

/// Returns the headings of the data file, and its rows.
fn headings_and_rows() -> (Vec<&'static str>, impl Iterator<Item = Vec<&'static str>>) {
    let mut lines = TABLE.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).map(fields);
    (lines.next().unwrap_or_default(), lines)
}

/// Returns all entries, in the order of the data file.
#[must_use]
pub fn catalogue() -> &'static [CatalogueEntry] {
    static ENTRIES: LazyLock<Vec<CatalogueEntry>> = LazyLock::new(|| {
        let (headings, rows) = headings_and_rows();
        rows.filter_map(|row| entry(&headings, &row)).collect()
    });
    &ENTRIES
}

/// Further names of products, each with the name of its entry.
const ALIASES: [(&str, &str); 1] = [("REV Core Hex", "Core Hex")];

impl CatalogueEntry {
    /// Iterates over the other names that [`find`] accepts: author's name, further product names, part number.
    pub fn aliases(&self) -> impl Iterator<Item = &'static str> {
        let &Self { name, specimen, part_number, .. } = self;
        let products = ALIASES.iter().filter(move |(_, row)| *row == name).map(|(alias, _)| *alias);
        let author = (specimen != name).then_some(specimen);
        author.into_iter().chain(products).chain((!part_number.is_empty()).then_some(part_number))
    }
}

/// Iterates over the motors that have constants.
pub fn motors() -> impl Iterator<Item = Motor> {
    catalogue().iter().filter_map(|entry| entry.motor)
}

/// Finds the entry with this name, alias or part number. `None` if the catalogue has no such entry.
///
/// Only letters and digits are compared, in upper or lower case: "neverest60" and "am60a" both find "NeveRest 60".
#[must_use]
pub fn find(name: &str) -> Option<&'static CatalogueEntry> {
    let key = |text: &str| -> String {
        text.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect()
    };
    let wanted = key(name);
    let mut rows = catalogue().iter();
    rows.clone()
        .find(|entry| key(entry.name) == wanted)
        .or_else(|| rows.find(|entry| entry.aliases().any(|alias| key(alias) == wanted)))
}

/// Error of [`characterised`]: no motor with this name has constants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UnknownMotor {
    /// The catalogue has no motor with this name.
    NotListed(String),
    /// The catalogue lists the motor without constants.
    NeverCharacterised(String),
}

impl core::fmt::Display for UnknownMotor {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotListed(name) => write!(f, "the catalogue has no motor {name:?}")?,
            Self::NeverCharacterised(name) => write!(f, "motor {name:?} was never characterised")?,
        }
        let names: Vec<_> = motors().map(|motor| motor.name).collect();
        write!(f, "; use one of: {}", names.join(", "))
    }
}

impl core::error::Error for UnknownMotor {}

/// Returns the constants of the motor that [`find`] finds for this name.
///
/// ```
/// use motor_hub::model::catalogue::characterised;
///
/// assert_eq!(characterised("neverest 60")?.gear_ratio, 60.0);
/// # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
/// ```
///
/// # Errors
/// Returns [`UnknownMotor`] if no motor has this name, or if the motor has no constants. The message lists all names.
pub fn characterised(name: &str) -> Result<Motor, UnknownMotor> {
    let entry = find(name).ok_or_else(|| UnknownMotor::NotListed(name.to_owned()))?;
    entry.motor.ok_or_else(|| UnknownMotor::NeverCharacterised(name.to_owned()))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;

    #[test]
    fn catalogue_has_all_rows_and_only_tetrix_lacks_constants() {
        let rows = TABLE.lines().filter(|line| !line.starts_with('#')).count() - 1;
        assert_eq!(catalogue().len(), rows);
        let without: Vec<_> = catalogue().iter().filter(|e| e.motor.is_none()).map(|e| e.name).collect();
        assert_eq!(without, ["Tetrix"]);
    }

    #[test]
    fn names_are_unique_and_every_spelling_finds_its_row() {
        let mut names: Vec<_> = catalogue().iter().map(|entry| entry.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), catalogue().len(), "{names:?}");
        for entry in catalogue() {
            assert_eq!(entry.motor.map_or(entry.name, |motor| motor.name), entry.name);
            for spelling in [entry.name, entry.specimen].into_iter().chain(entry.aliases()) {
                assert_eq!(find(spelling), Some(entry), "{spelling}");
            }
        }
    }

    #[test]
    fn find_accepts_product_names_author_names_and_part_numbers() {
        for (typed, name) in [
            ("neverest 60", "NeveRest 60"),
            ("am60a", "NeveRest 60"),
            ("am37b", "NeveRest 3.7"),
            ("AM 40 A", "NeveRest 40-A"),
            ("am-2964a", "NeveRest 40-A"),
            ("Matrix B", "Matrix 12 V-B"),
            ("REV Core Hex", "Core Hex"),
            ("CoreHex A", "Core Hex"),
            ("REV-41-1300", "Core Hex"),
        ] {
            assert_eq!(find(typed).map(|e| e.name), Some(name), "{typed}");
        }
        assert!(find("am 60").is_none());
    }

    #[test]
    fn every_row_has_the_free_speed_and_the_stall_values_of_its_constants() {
        let (headings, rows) = headings_and_rows();
        for row in rows {
            let Some(motor) = motor(&headings, &row) else { continue };
            let volts = Volts(12.0);
            let (current, torque) = (volts.0 / motor.r.0, motor.stall_torque(volts).0);
            for (heading, expected) in [
                ("model_free_speed_motor_rad_s_12V", motor.free_speed(volts).0),
                ("model_stall_current_A_12V", current),
                ("model_stall_torque_output_Nm_12V", torque * motor.gear_ratio * motor.eta),
            ] {
                let value = number(&headings, &row, heading);
                assert!(
                    value.is_some_and(|value| (value / expected - 1.0).abs() < 1e-6),
                    "{}: {heading} is {value:?} and not {expected}",
                    motor.name
                );
            }
        }
    }

    #[test]
    fn quoted_caveats_keep_their_commas() {
        let caveats = find("CoreHex A").map(|e| e.caveats).unwrap_or_default();
        assert!(caveats.starts_with("N: 72 in v2 workbook (used by"));
        assert!(caveats.contains("output), 36.25 in"));
        assert!(caveats.ends_with("ambiguous"));
    }

    #[test]
    fn am_60_a_has_the_published_constants() {
        let motor = find("AM 60 A").and_then(|e| e.motor).unwrap();
        assert_eq!((motor.r.0, motor.l.0, motor.gear_ratio), (3.3, 0.000694, 60.0));
        assert!((motor.ke_fw() - 3.98683).abs() < 5e-6);
        assert_eq!(motor.with_measured_rotor_inertia().j.0, 1.04e-5);
    }
}
