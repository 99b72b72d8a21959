//! Implements the command `motor-hub client status`.

use super::drive::ALL;
use super::hub::HubOptions;
use super::readings::{MotorReading, alert_words, motors_of, volts, volts_text};
use crate::output::{Failure, print_as};
use motor_hub::extension::report::{BusReport, Condition};
use motor_hub::motor::{SenseLine, ZeroPower};
use motor_hub::protocol::answers::{Bulk, Status};
use motor_hub::protocol::motor::RunMode;
use motor_hub::protocol::{CHANNELS, Colour};
use motor_hub::units::Millivolts;
use motor_hub_client::motor::{MotorState, NO_SUCH_MOTOR};
use motor_hub_client::reasons::bus_text;
use motor_hub_client::{Error, Session};
use serde_json::{Value, json};
use studies::{table, with_fields};

/// Shows status, version, battery, LED and all motors; disables running motors first
#[derive(clap::Args)]
pub(crate) struct Options {
    /// JSON instead of tables
    #[arg(long)]
    json: bool,
    /// Clears the hub's status word afterwards
    #[arg(long)]
    clear: bool,
}

/// All values that `status` shows.
struct HubStatus {
    address: u8,
    status: Status,
    version: String,
    battery: Millivolts,
    led: Colour,
    motors: Vec<MotorState>,
    bulk: Bulk,
    /// `None` if the hub does not report its bus.
    bus: Option<BusReport>,
    /// Condition of each motor; empty if the hub does not report conditions.
    conditions: Vec<Condition>,
}

impl Options {
    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let shown = HubStatus::read(&mut hub.open(None)?, self.clear)?;
        print_as(self.json, &shown.json(), shown.text())
    }
}

impl HubStatus {
    fn read(session: &mut Session, clear: bool) -> Result<Self, Error> {
        let (version, battery, led) = (session.version()?, session.battery()?, session.led()?);
        let mut motors = Vec::new();
        for motor in (0..).take(CHANNELS) {
            match session.motor(motor) {
                // The hub has fewer motors.
                Err(Error::Refused { reason: NO_SUCH_MOTOR, .. }) => break,
                state => motors.push(state?),
            }
        }
        let bulk = session.bulk()?;
        let bus = session.bus()?;
        let reporting = if bus.is_some() { motors.len() } else { 0 };
        let conditions =
            (0..).take(reporting).map(|motor| session.condition(motor)).collect::<Result<_, _>>()?;
        // The status is read last, so that the hub clears it only after all other values have been read.
        let status = session.status(clear)?;
        Ok(Self { address: session.address(), status, version, battery, led, motors, bulk, bus, conditions })
    }

    fn motors(&self) -> impl Iterator<Item = (&MotorState, MotorReading)> {
        self.motors.iter().zip(motors_of(&self.bulk, &ALL))
    }

    fn condition(&self, motor: u8) -> Option<&Condition> {
        self.conditions.get(usize::from(motor))
    }

    fn text(&self) -> String {
        let or = |words: String, none: &str| if words.is_empty() { none.to_owned() } else { words };
        let Colour { red, green, blue } = self.led;
        let mut head = table::new(&["hub", &self.address.to_string()], 2);
        head.add_row(["status", &or(self.status.words().join(", "), "no alerts")])
            .add_row(["motor alerts", &or(alert_words(self.status).join(", "), "none")])
            .add_row(["version", &self.version])
            .add_row(["battery", &volts_text(volts(self.battery), 3)])
            .add_row(["bus", &self.bus.map_or_else(|| NOT_REPORTED.to_owned(), bus_words)])
            .add_row(["LED", &format!("red {red}, green {green}, blue {blue}")]);
        let row = |heading: &str, value: &dyn Fn(&MotorState, &MotorReading) -> String| -> Vec<String> {
            let values = self.motors().map(|(state, reading)| value(state, &reading));
            std::iter::once(heading.to_owned()).chain(values).collect()
        };
        let condition =
            |motor| self.condition(motor).map_or_else(|| NOT_REPORTED.to_owned(), condition_words);
        let mut motors = table::new(row("motor", &|_, at| at.motor.to_string()), 1);
        motors
            .add_row(row("mode", &|of, _| mode(of.mode).to_owned()))
            .add_row(row("at zero", &|of, _| zero_behaviour(of.zero_power).to_owned()))
            .add_row(row("enabled", &|of, _| yes(of.enabled)))
            .add_row(row("power", &|of, _| format!("{:.4}", of.power.to_f64())))
            .add_row(row("target velocity", &|of, _| of.velocity.to_string()))
            .add_row(row("target position", &|of, _| {
                format!("{} ±{}", of.position.counts, of.position.tolerance)
            }))
            .add_row(row("encoder", &|_, at| at.position.to_string()))
            .add_row(row("velocity", &|_, at| at.velocity.to_string()))
            .add_row(row("within tolerance", &|_, at| yes(at.within_tolerance)))
            .add_row(row("winding, bridge", &|_, at| condition(at.motor)));
        format!("{head}\nVelocities in counts/s, positions in counts\n{motors}")
    }

    fn json(&self) -> Value {
        let motors: Vec<Value> = self
            .motors()
            .map(|(state, reading)| {
                let condition = self.condition(reading.motor);
                let more = json!({
                    "mode": mode(state.mode),
                    "zero_behaviour": zero_behaviour(state.zero_power),
                    "enabled": state.enabled,
                    "power": state.power.to_f64(),
                    "target_velocity": state.velocity,
                    "target_position": state.position.counts,
                    "tolerance": state.position.tolerance,
                    "heat_percent": condition.map(|is| f64::from(is.heat) / 10.0),
                    "condition": condition.map(condition_words),
                });
                with_fields(json!(reading), more)
            })
            .collect();
        let Colour { red, green, blue } = self.led;
        json!({
            "address": self.address,
            "status": &*self.status.words(),
            "motor_alerts": alert_words(self.status),
            "attention": self.bulk.attention,
            "version": self.version,
            "battery_v": volts(self.battery),
            "bus": self.bus.map(bus_json),
            "led": { "red": red, "green": green, "blue": blue },
            "motors": motors,
        })
    }
}

/// Text for a value that the hub does not report.
const NOT_REPORTED: &str = "not reported";

fn bus_words(bus: BusReport) -> String {
    let meaning = bus_text(bus.state);
    let [returned, dissipated] = [bus.returned_mj, bus.dissipated_mj].map(|mj| f64::from(mj) / 1e3);
    let volts = volts_text(bus.measured.map(|mv| f64::from(mv.get()) / 1e3), 3);
    format!("{volts}: {meaning}\n{returned:.1} J returned by braking motors, {dissipated:.1} J dissipated")
}

fn bus_json(bus: BusReport) -> Value {
    json!({
        "state": bus.state.name(),
        "measured_v": bus.measured.map(|mv| f64::from(mv.get()) / 1e3),
        "dissipated_percent": f64::from(bus.dissipate) / 10.0,
        "returned_j": f64::from(bus.returned_mj) / 1e3,
        "dissipated_j": f64::from(bus.dissipated_mj) / 1e3,
    })
}

/// Returns the state of a winding and its bridge as text.
pub(super) const fn state_text(is: &Condition) -> &'static str {
    match is {
        Condition { bridge_fault: true, .. } => "off: bridge fault",
        Condition { overheated: true, .. } => "off: too hot",
        Condition { derated: true, .. } => "derated: hot",
        _ => "normal",
    }
}

fn condition_words(is: &Condition) -> String {
    let heat =
        if is.heat == 0 { String::new() } else { format!(", heat {:.1} %", f64::from(is.heat) / 10.0) };
    let state = state_text(is);
    let line = match is.sense_line {
        SenseLine::Absent | SenseLine::Sound => "",
        SenseLine::NoCurrent => ", current-sense line or motor lead broken",
        SenseLine::Stuck => ", current-sense line stuck",
        SenseLine::Excessive => ", more current than the configured motor can draw",
    };
    format!("{state}{heat}{line}")
}

const fn mode(mode: RunMode) -> &'static str {
    match mode {
        RunMode::Power => "power",
        RunMode::Velocity => "velocity",
        RunMode::Position => "position",
    }
}

const fn zero_behaviour(zero_power: ZeroPower) -> &'static str {
    match zero_power {
        ZeroPower::Brake => "brake",
        ZeroPower::Float => "float",
    }
}

fn yes(yes: bool) -> String {
    if yes { "yes" } else { "no" }.to_owned()
}
