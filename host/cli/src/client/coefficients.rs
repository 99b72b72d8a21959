//! Implements the command `motor-hub client coefficients`.

use super::hub::HubOptions;
use super::settings::not_reset;
use crate::output::{Failure, print_as, print_error_line};
use crate::parse::{MotorName, motor};
use motor_hub::protocol::motor::{Loop, LoopCoefficients, Terms};
use motor_hub::regulator::Kind;
use motor_hub::units::Coefficient;
use motor_hub_client::Session;
use serde_json::json;
use studies::table;

/// Reads a loop's coefficients, or sets the given ones and keeps the others
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Motor 0 to 3
    #[arg(value_parser = motor)]
    motor: MotorName,
    /// Loop to read or set
    #[arg(value_name = "LOOP", ignore_case = true, value_parser = LOOPS)]
    of: String,
    /// Proportional: control steps (full control is 32767) per count/s; for a position, counts/s per count
    #[arg(long, value_name = "X", value_parser = coefficient)]
    p: Option<Coefficient>,
    /// Integral: unit of P, added every 50 ms, independent of the hub's control period
    #[arg(long, value_name = "X", value_parser = coefficient)]
    i: Option<Coefficient>,
    /// Derivative: unit of P, per change in 50 ms
    #[arg(long, value_name = "X", value_parser = coefficient)]
    d: Option<Coefficient>,
    /// Feed-forward: control steps per count/s of the target; full control is then the battery voltage. Velocity only
    #[arg(long, value_name = "X", value_parser = coefficient)]
    f: Option<Coefficient>,
    /// JSON instead of a table
    #[arg(long)]
    json: bool,
}

const POSITION: &str = "position";
const LOOPS: [&str; 2] = ["velocity", POSITION];

/// Number of steps in a coefficient of 1. A step of the protocol is 2^-16.
const STEPS: f64 = 65_536.0;

fn coefficient(text: &str) -> Result<Coefficient, String> {
    let bits = text.parse().ok().map(|value: f64| (value * STEPS).round());
    let bits = bits.filter(|bits| (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(bits));
    let bits = bits.map(|bits| Coefficient::from_bits(bits as i32));
    bits.ok_or_else(|| "a coefficient is -32768 to 32767.9999, in steps of 1/65536".to_owned())
}

fn decimal(coefficient: Coefficient) -> f64 {
    f64::from(coefficient.to_bits()) / STEPS
}

/// Returns true if coefficients that a host has set regulate the motor; `None` if the hub does not report it.
fn in_force(session: &mut Session, motor: u8) -> Result<Option<bool>, Failure> {
    // The regulator in the report may be older than the coefficients.
    session.catch_up()?;
    let report = session.report()?;
    let motor = report.as_ref().and_then(|report| report.motors.get(usize::from(motor)));
    Ok(motor.map(|motor| motor.regulator == Kind::Pid))
}

impl Options {
    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let name = self.of.to_lowercase();
        let of = if name == POSITION { Loop::Position } else { Loop::Velocity };
        if of == Loop::Position && self.f.is_some_and(|f| f != Coefficient::ZERO) {
            let why = "--f: a position has no feed-forward; give --f with velocity only";
            return Err(Failure::input(why));
        }
        let session = &mut hub.open(self.motor.hub)?;
        let mut pidf = session.coefficients(self.motor.number, of)?;
        let sets = [self.p, self.i, self.d, self.f].iter().any(Option::is_some);
        if sets {
            if [self.p, self.i].iter().flatten().any(|coefficient| coefficient.to_bits() < 0) {
                print_error_line("warning: with P or I below 0 the motor runs away from its set-point");
            }
            let wanted = LoopCoefficients {
                p: self.p.unwrap_or(pidf.p),
                i: self.i.unwrap_or(pidf.i),
                d: self.d.unwrap_or(pidf.d),
                f: self.f.unwrap_or(pidf.f),
                terms: Terms::Pidf,
            };
            session.set_coefficients(self.motor.number, of, wanted)?;
            pidf = session.coefficients(self.motor.number, of)?;
            not_reset(session)?;
        }
        let in_force = if sets { Some(true) } else { in_force(session, self.motor.number)? };
        let [p, i, d, f] = [pidf.p, pidf.i, pidf.d, pidf.f].map(decimal);
        let document = json!({
            "motor": self.motor.number,
            "loop": name,
            "p": p,
            "i": i,
            "d": d,
            "f": f,
            "in_force": in_force,
        });
        let mut table = table::new(&["P", "I", "D", "F"], 0);
        table.add_row([p, i, d, f].map(|value| format!("{value:.6}")));
        let state = match in_force {
            Some(true) => "in force: PID regulates the motor with coefficients that a host has set",
            Some(false) => {
                "only suggested: the motor is regulated by its model until a host sets coefficients"
            }
            None => "the hub does not report whether they are in force",
        };
        print_as(self.json, &document, format!("{table}\n{state}"))
    }
}
