//! Implements the command `motor-hub eval`.

use crate::output::{Failure, print_json};
use serde_json::Value;
use simulated::scenario::read_at_most;
use std::fs::File;
use std::io;
use std::path::PathBuf;
use studies::eval::{Answers, answers};

/// Largest document in bytes.
const LARGEST_DOCUMENT: u64 = 64 << 20;

const HELP: &str = "\
The scripting interface: computes cases of a JSON document

The document is an object with `cases`, a list of objects with `id`, `formula` and `inputs`, and \
`motors`, an object of motor constants by name: R, L, N, eta, Ke, Kt, B, J (SI units, before the \
gearbox). Formulas without Jafter do not need N, eta and J. Other motors are of the catalogue, see `motor-hub motors`. \
They have the paper's inertia here, and the measured inertia of their rotors in scenarios. Unknown keys are refused, but \
`meta` of the document and `note` may hold remarks. Standard output gets {\"results\": [{\"id\", \"outputs\"}]} in the order of the cases. A case \
with an unknown formula or bad inputs gets {\"id\", \"error\"} instead of outputs; all others are \
still answered, and the exit code is 1.

Answered by the fixed-point core that the firmware runs (its cMax is 32767, and may be left out):
  bridge_state   state
  scheme_fw      cps, mvBattery, keFw, keFw_q20, R, blend, countsPerRev [, cMax]
  example_duty   S, T, Z, G, control
  regime_duty    scheme, Omega, Vbat, Ke [, blend, cMax] -> a row for each control
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

A table has a row for each value of its first column. The values are a list in the inputs under the \
column's name; else the first column of the case's own outputs.rows; else a default. A null in the \
outputs is an infinite control value of S or T, or a continuity_duty that does not exist. A case whose \
other outputs are not finite gets an error.

Example:
  echo '{\"cases\": [{\"id\": 1, \"formula\": \"keFw\", \"inputs\": {\"Ke\": 0.0178, \"countsPerRev\": 28}}]}' \\
    | motor-hub eval -";

/// Compute the cases of a JSON document: the scripting interface
#[derive(clap::Args)]
#[command(long_about = HELP)]
pub(crate) struct Options {
    /// JSON document, or - for standard input
    #[arg(value_name = "FILE|-")]
    file: PathBuf,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let file = self.file.display();
        let wrong = |why: &dyn std::fmt::Display| Failure::Input(format!("{file}: {why}"));
        let text = self.read().map_err(|e| wrong(&e))?;
        let document: Value = serde_json::from_slice(&text)
            .map_err(|e| Failure::Input(format!("{file}:{}:{}: {e}", e.line(), e.column())))?;
        let Answers { document, cases, failed } = answers(&document).map_err(|e| wrong(&e))?;
        print_json(&document)?;
        match failed {
            0 => Ok(()),
            n => Err(Failure::Work(format!(
                "{n} of {cases} cases were not answered; --help lists the formulas and their inputs"
            ))),
        }
    }

    fn read(&self) -> io::Result<Vec<u8>> {
        if self.file.as_os_str() == "-" {
            return read_at_most(LARGEST_DOCUMENT, io::stdin());
        }
        read_at_most(LARGEST_DOCUMENT, File::open(&self.file)?)
    }
}
