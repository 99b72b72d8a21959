//! Scripting interface: reads cases as JSON and answers them as JSON.
//!
//! The core that the firmware runs answers formulas of the firmware (`firmware`). The model answers formulas of motor,
//! load and bridge (`physics`).
//!
//! ```
//! use serde_json::json;
//!
//! let case = json!({ "id": 1, "formula": "keFw", "inputs": { "motor": "AM 60 A" } });
//! let answers = studies::eval::answers(&json!({ "cases": [case] }))?;
//! assert_eq!((answers.cases, answers.failed), (1, 1));
//! # Ok::<(), studies::eval::DocumentError>(())
//! ```

mod case;
mod firmware;
mod physics;

use crate::paper::printed::numbers;
use case::{Case, only_known};
use motor_hub::model::catalogue::characterised;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::error::Error;

/// Why a case could not be answered. The document of results contains the text of the error.
type CaseError = Box<dyn Error>;

/// The answers to a document.
#[derive(Clone, Debug, PartialEq)]
pub struct Answers {
    /// `{"results": [...]}`, in the order of the cases.
    pub document: Value,
    /// Number of cases.
    pub cases: usize,
    /// Number of cases that could not be answered.
    pub failed: usize,
}

/// What is wrong with a whole document.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DocumentError {
    /// The document has no list of cases.
    #[error("the document needs `cases`, a list of objects")]
    NoCases,
    /// The document has unknown keys.
    #[error("{0}")]
    UnknownKeys(String),
}

/// Keys of a document. Nothing reads `meta`.
const KEYS: [&str; 3] = ["cases", "motors", "meta"];

/// Answers every case of a document.
///
/// # Errors
/// [`DocumentError`]. The error of a single case is put in the place of its answer.
pub fn answers(document: &Value) -> Result<Answers, DocumentError> {
    only_known("key", Some(document), &KEYS).map_err(DocumentError::UnknownKeys)?;
    let cases = document.get("cases").and_then(Value::as_array).ok_or(DocumentError::NoCases)?;
    let none = Value::Null;
    let motors = document.get("motors").unwrap_or(&none);
    let mut failed = 0;
    let mut ids = BTreeSet::new();
    let results = cases.iter().map(|case| {
        let id = case.get("id").unwrap_or(&none);
        // Programs find an answer by its id.
        let unique = id.is_null() || ids.insert(id.to_string());
        let answered =
            if unique { answer(&Case::new(case, motors)) } else { Err("an earlier case has this id".into()) };
        match answered {
            Ok(outputs) => json!({ "id": id, "outputs": outputs }),
            Err(error) => {
                failed += 1;
                json!({ "id": id, "error": error.to_string() })
            }
        }
    });
    let results: Vec<Value> = results.collect();
    Ok(Answers { document: json!({ "results": results }), cases: cases.len(), failed })
}

/// Outputs that are null where a formula gives no finite number: control values of S and T, which may be infinite, and
/// the duty from which on the current is continuous, if there is one.
const MAY_BE_NULL: [&str; 6] = ["xS", "xT", "C_xT", "D_xS", "D_xT", "continuity_duty"];

fn answer(case: &Case) -> Result<Value, CaseError> {
    let outputs = computed(case)?;
    case.nothing_unread()?;
    let mut fields = outputs.as_object().into_iter().flatten();
    match fields.find(|(key, value)| !MAY_BE_NULL.contains(&key.as_str()) && has_null(value)) {
        Some((key, _)) => {
            Err(format!("output {key} is no finite number: an input is too large or too small").into())
        }
        None => Ok(outputs),
    }
}

fn has_null(value: &Value) -> bool {
    value.is_null() || value.as_array().is_some_and(|values| values.iter().any(has_null))
}

fn computed(case: &Case) -> Result<Value, CaseError> {
    match case.formula()? {
        "bridge_state" => firmware::bridge_state(case),
        "keFw" => firmware::emf_constant(case),
        "scheme_fw" => firmware::points(case),
        "example_duty" => firmware::example_duty(case),
        "regime_duty" => firmware::regime_duty(case),
        "scheme_points" => physics::scheme_points(case),
        "plant" => physics::plant(case),
        "step_response" => physics::step_response(case),
        "pid_period" => physics::pid_period(case),
        "mean_current" => physics::mean_current(case),
        "bridge_pwm" => physics::bridge_pwm(case),
        "duty_for_current" => physics::duty_for_current(case),
        "steady_speed_pwm" => physics::steady_speed(case),
        "reverse0" => physics::reverse0(case),
        "paper_printed" => printed(case),
        other => Err(format!("unknown formula {other:?}").into()),
    }
}

/// Answers with a number of the paper, which is found by its name: as printed, and as computed here.
fn printed(case: &Case) -> Result<Value, CaseError> {
    let name = case.text("name")?;
    let motor = characterised("AM 60 A")?;
    let number = numbers(&motor).into_iter().find(|number| number.name == name);
    let number = number.ok_or_else(|| format!("the paper prints no number with the name {name:?}"))?;
    Ok(json!({ "printed": number.printed, "computed": number.ours }))
}
