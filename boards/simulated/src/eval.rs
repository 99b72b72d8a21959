//! `motor-hub eval`: the scripting interface. Cases in as JSON, results out as JSON.
//!
//! What the firmware decides is answered by the fixed-point core that the firmware runs
//! (`firmware`), what physics decides by the model (`physics`).

mod case;
mod firmware;
pub(crate) mod paper;
mod physics;

use crate::cli::{Failure, print_json};
use case::Case;
use serde_json::{Value, json};
use std::io::Read;

/// The long help of the command.
pub const HELP: &str = "\
The scripting interface: computes cases of a JSON document

The document is an object with `cases`, a list of objects with `id`, `formula` and `inputs`, and
`motors`, an object of motor constants by name: R, L, N, eta, Ke, Kt, B, J (SI units, before the
gearbox). Standard output gets {\"results\": [{\"id\", \"outputs\"}]} in the order of the cases. A case
with an unknown formula or bad inputs gets {\"id\", \"error\"} instead of outputs; all others are
still answered, and the exit code is 1.

Answered by the fixed-point core that the firmware runs:
  bridge_state   state
  scheme_fw      cps, mvBattery, keFw, keFw_q20, R, blend, countsPerRev [, cMax = 32767]
  example_duty   S, T, Z, G, control
  regime_duty    scheme, Omega, Vbat, Ke [, blend, cMax = 32767] -> a row for each control
  keFw           Ke, countsPerRev

Answered by the model in double precision:
  scheme_points      scheme, Omega, Vbat, Ke, R, cMax [, blend]
  plant              motor, Jafter, Bafter
  step_response      motor, Jafter, Bafter, vapp0, dv, tau_app0, dtau -> a row for each t_s
  pid_period         motor, Jafter, Bafter, P, Omega_motor
  mean_current       motor, Jafter, Bafter, P, i0, Omega0 -> a row for each v
  bridge_pwm         motor, mode, f_Hz, Omega, Vbat, Vd, Ron -> a row for each duty
  duty_for_current   motor, f_Hz, Omega, Vbat, Vd, Ron -> a row for each I_target
  steady_speed_pwm   R, L, Ke, Kt, B, mode, f_Hz, Vbat, Vd, Ron -> a row for each duty
  reverse0           motor, Vbat, Vd, Omega, cMax
  paper_printed      name

The values for which a table has rows are a list in the case's inputs under the name of the first
column; else the first column of the case's own outputs.rows, if it has any; else a default.
A null among the outputs stands for infinity.

Example:
  echo '{\"cases\": [{\"id\": 1, \"formula\": \"keFw\", \"inputs\": {\"Ke\": 0.0178, \"countsPerRev\": 28}}]}' \\
    | motor-hub eval -";

/// Options of `eval`.
#[derive(clap::Args)]
pub struct Options {
    /// JSON document, or - for standard input
    #[arg(value_name = "FILE|-")]
    file: String,
}

impl Options {
    /// Reads, computes, prints.
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let text = self.read().map_err(|e| Failure::Input(format!("{}: {e}", self.file)))?;
        let document: Value = serde_json::from_str(&text)
            .map_err(|e| Failure::Input(format!("{}:{}:{}: {e}", self.file, e.line(), e.column())))?;
        let cases = document.get("cases").and_then(Value::as_array).ok_or_else(|| {
            Failure::Input(format!("{}: the document needs `cases`, a list of objects", self.file))
        })?;
        let none = Value::Null;
        let motors = document.get("motors").unwrap_or(&none);
        let mut failed = 0;
        let results = cases.iter().map(|case| {
            let id = case.get("id").unwrap_or(&none);
            match answer(&Case::new(case, motors)) {
                Ok(outputs) => json!({ "id": id, "outputs": outputs }),
                Err(error) => {
                    failed += 1;
                    json!({ "id": id, "error": error })
                }
            }
        });
        let results: Vec<Value> = results.collect();
        print_json(&json!({ "results": results }))?;
        match failed {
            0 => Ok(()),
            n => Err(Failure::Work(format!("{n} of {} cases could not be answered", results.len()))),
        }
    }

    fn read(&self) -> std::io::Result<String> {
        if self.file != "-" {
            return std::fs::read_to_string(&self.file);
        }
        let mut text = String::new();
        std::io::stdin().read_to_string(&mut text)?;
        Ok(text)
    }
}

fn answer(case: &Case) -> Result<Value, String> {
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
        "paper_printed" => paper::printed(case),
        other => Err(format!("unknown formula {other:?}; `motor-hub eval --help` lists those there are")),
    }
}
