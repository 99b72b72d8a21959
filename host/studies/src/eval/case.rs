//! One case of the document, and checked access to its inputs.

use super::CaseError;
use motor_hub::bridge::Mode;
use motor_hub::model::catalogue::{Motor, characterised};
use motor_hub::model::friction::{Cogging, Friction};
use motor_hub::model::si::{Drag, EmfConstant, Henries, KgM2, Ohms, TorqueConstant};
use serde_json::{Value, json};
use simulated::scenario::number_text;
use std::cell::RefCell;
use std::collections::BTreeSet;

/// A case with the document's motors.
pub(super) struct Case<'a> {
    case: &'a Value,
    motors: &'a Value,
    /// The inputs that the formula has read.
    read: RefCell<BTreeSet<String>>,
}

const KEYS: [&str; 4] = ["id", "formula", "inputs", "outputs"];
/// Constants of a motor in a document.
const CONSTANTS: [&str; 8] = ["R", "L", "N", "eta", "Ke", "Kt", "B", "J"];
/// Keys that are remarks: nothing reads them.
const REMARKS: [&str; 2] = ["note", "motor_csv_name"];

impl<'a> Case<'a> {
    pub(super) fn new(case: &'a Value, motors: &'a Value) -> Self {
        Self { case, motors, read: RefCell::default() }
    }

    pub(super) fn formula(&self) -> Result<&'a str, CaseError> {
        only_known("key", Some(self.case), &KEYS)?;
        Ok(self.case.get("formula").and_then(Value::as_str).ok_or("the case has no formula")?)
    }

    fn input(&self, key: &str) -> Result<&'a Value, CaseError> {
        let inputs = self.case.get("inputs").ok_or("the case has no inputs")?;
        self.read.borrow_mut().insert(key.to_owned());
        Ok(inputs.get(key).ok_or_else(|| format!("input {key} is missing"))?)
    }

    /// Fails if there are inputs that the formula does not read.
    pub(super) fn nothing_unread(&self) -> Result<(), CaseError> {
        let read = self.read.borrow();
        let read: Vec<&str> = read.iter().map(String::as_str).collect();
        Ok(only_known("input", self.case.get("inputs"), &read)?)
    }

    /// Reads a number. Numbers in JSON are finite.
    pub(super) fn number(&self, key: &str) -> Result<f64, CaseError> {
        Ok(self.input(key)?.as_f64().ok_or_else(|| format!("input {key} must be a number"))?)
    }

    pub(super) fn positive(&self, key: &str) -> Result<f64, CaseError> {
        above_zero(self.number(key)?, key)
    }

    pub(super) fn not_negative(&self, key: &str) -> Result<f64, CaseError> {
        zero_or_above(self.number(key)?, key)
    }

    pub(super) fn whole(&self, key: &str, low: i64, high: i64) -> Result<i64, CaseError> {
        let value = self.number(key)?;
        let is_allowed = value.fract() == 0.0 && (low as f64..=high as f64).contains(&value);
        let rule = format!("be a whole number from {low} to {high}");
        Ok(allowed(&format!("input {key}"), value, is_allowed, &rule)? as i64)
    }

    pub(super) fn blend(&self) -> Result<f64, CaseError> {
        let blend = self.number("blend")?;
        allowed("input blend", blend, (0.0..=1.0).contains(&blend), "be 0 (scheme B) to 1 (scheme C)")
    }

    pub(super) fn text(&self, key: &str) -> Result<&'a str, CaseError> {
        Ok(self.input(key)?.as_str().ok_or_else(|| format!("input {key} must be a text"))?)
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.input(key).is_ok()
    }

    pub(super) fn mode(&self) -> Result<Mode, CaseError> {
        let name = self.text("mode")?;
        let known = [Mode::Cw98, Mode::Ccw62, Mode::Brake50];
        let mode = known.into_iter().find(|mode| mode.name() == name);
        Ok(mode.ok_or_else(|| format!("input mode = {name:?} must be 9/8, 6/2 or 5/0"))?)
    }

    /// Constants of a motor for a formula without motion. N, eta and J may be absent.
    pub(super) fn motor(&self) -> Result<Motor, CaseError> {
        self.constants(false)
    }

    /// Constants of a motor for a formula of its motion.
    pub(super) fn moving_motor(&self) -> Result<Motor, CaseError> {
        self.constants(true)
    }

    /// Constants of the motor that the inputs name: the document's, else the catalogue's. Without a name the inputs
    /// themselves hold the constants.
    fn constants(&self, moving: bool) -> Result<Motor, CaseError> {
        let named = self.has("motor");
        let constants = if named {
            let key = self.text("motor")?;
            match self.motors.get(key) {
                Some(constants) => {
                    only_known("motor constant", Some(constants), &CONSTANTS)?;
                    constants
                }
                None => return Ok(characterised(key)?),
            }
        } else {
            self.case.get("inputs").unwrap_or(&Value::Null)
        };
        let constant = |key: &str| if named { constants.get(key) } else { self.input(key).ok() };
        let number = |key: &str| {
            let value = constant(key).and_then(Value::as_f64);
            value.ok_or_else(|| format!("motor constant {key} is missing, or is not a number").into())
        };
        let positive = |key: &str| number(key).and_then(|value| above_zero(value, key));
        // The results of a formula without motion do not depend on these constants.
        let of_motion = |key: &str| if moving || constant(key).is_some() { positive(key) } else { Ok(1.0) };
        let inertia = KgM2(of_motion("J")?);
        Ok(Motor {
            name: "",
            r: Ohms(positive("R")?),
            l: Henries(positive("L")?),
            gear_ratio: of_motion("N")?,
            eta: of_motion("eta")?,
            ke: EmfConstant(positive("Ke")?),
            kt: TorqueConstant(positive("Kt")?),
            b: Drag(number("B").and_then(|value| zero_or_above(value, "B"))?),
            friction: Friction::NONE,
            cogging: Cogging::NONE,
            j: inertia,
            j_rotor_measured: inertia,
            counts_per_rev_motor: 1.0,
        })
    }

    /// The values of a table's first column: from the inputs, else from the case's own outputs, else `None`.
    pub(super) fn column(&self, key: &str) -> Result<Option<Vec<f64>>, CaseError> {
        let numbers = |values: Option<Vec<f64>>| {
            values.ok_or_else(|| CaseError::from(format!("{key} must be a list of numbers")))
        };
        if let Ok(given) = self.input(key) {
            let list = given.as_array().map(|list| list.iter().map(Value::as_f64).collect());
            return numbers(list.flatten()).map(Some);
        }
        let rows = self.case.get("outputs").and_then(|outputs| outputs.get("rows")).and_then(Value::as_array);
        let first = |row: &Value| row.get(0).and_then(Value::as_f64);
        rows.map(|rows| numbers(rows.iter().map(first).collect())).transpose()
    }
}

/// A table with a row for each value of its first column.
pub(super) fn table(
    columns: &[&str],
    rows: impl Iterator<Item = Result<Value, CaseError>>,
) -> Result<Value, CaseError> {
    let rows: Vec<Value> = rows.collect::<Result<_, _>>()?;
    Ok(json!({ "columns": columns, "rows": rows }))
}

/// Fails if an object has other keys than the allowed ones and [`REMARKS`]. `what` names a key of the object.
pub(super) fn only_known(what: &str, object: Option<&Value>, allowed: &[&str]) -> Result<(), String> {
    let keys = object.and_then(Value::as_object).into_iter().flat_map(|all| all.keys()).map(String::as_str);
    let unknown: Vec<&str> = keys.filter(|key| !allowed.contains(key) && !REMARKS.contains(key)).collect();
    if unknown.is_empty() {
        return Ok(());
    }
    Err(format!("unknown {what} {}; allowed: {}", unknown.join(", "), allowed.join(", ")))
}

/// The value if it is allowed, else an error that names the value and ends with the rule for it.
fn allowed(name: &str, value: f64, is_allowed: bool, rule: &str) -> Result<f64, CaseError> {
    if is_allowed { Ok(value) } else { Err(format!("{name} = {} must {rule}", number_text(value)).into()) }
}

fn zero_or_above(value: f64, key: &str) -> Result<f64, CaseError> {
    allowed(key, value, value >= 0.0, "not be negative")
}

fn above_zero(value: f64, key: &str) -> Result<f64, CaseError> {
    allowed(key, value, value > 0.0, "be above 0")
}
