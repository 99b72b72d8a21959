//! Messages to pages: JSON objects with a `kind`. Control values and duties are shares of full control and of full
//! duty, from -1 to 1. All other fields have their unit in the name, or are in counts and seconds.

use crate::chain::HubOfChain;
use crate::devices::Transfer;
use crate::hub::{RequestError, within};
use crate::identification::{Progress as Identification, dynamics_json};
use crate::proposal::catalogue_motor;
use crate::settings_file::word_or_number;
use crate::update::Progress;
use motor_hub::braking::{OperatingPoint, Points, Scheme, Winding};
use motor_hub::extension::report::{HubReport, MotorReport, ReportedSetpoint};
use motor_hub::extension::settings::{Field, Form, Group, MotorSettings, Zero};
use motor_hub::model::catalogue::{Motor, motors};
use motor_hub::model::paper;
use motor_hub::model::si::{Ohms, Volts};
use motor_hub::model::switching::Conditions;
use motor_hub::protocol::motor::{LoopCoefficients, RunMode};
use motor_hub::protocol::{CHANNELS, Colour};
use motor_hub::record::Head;
use motor_hub::units::{Acceleration, Control, CountsPerSecond, Millivolts};
use motor_hub_client::devices::Servo;
use motor_hub_client::error::none_if_unsupported;
use motor_hub_client::explanations::explanation;
use motor_hub_client::motor_values::MotorValues;
use motor_hub_client::reasons::{bus_text, stored_text, why_still};
use motor_hub_client::{Error, Session};
use serde::Serialize;
use serde_json::{Value, json};
use simulated::scheme::SchemeWords;
use std::sync::Arc;

/// Highest speed for which points are computed, in counts/s. No motor of the catalogue reaches this speed.
const MOST_CPS: f64 = 1e6;

/// Lowest battery voltage for which points are computed, in volts.
const LEAST_VOLTS: f64 = 1.0;

/// Highest battery voltage for which points are computed, in volts: the range of [`Millivolts`] is 65.5 V.
const MOST_VOLTS: f64 = 60.0;

/// Groups of settings that a page changes by the names of their fields. Run mode and coefficients have their own
/// orders.
pub(crate) fn configurable() -> impl Iterator<Item = Group> {
    let by_order = [Group::Mode, Group::VelocityLoop, Group::PositionLoop];
    Group::ALL.into_iter().filter(move |group| !by_order.contains(group))
}

/// All messages to pages.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub(crate) enum Message {
    /// Sent once to a new page.
    Welcome {
        /// Number of this page.
        you: u32,
        /// Name of the hub's port or address.
        place: String,
        /// True for a simulated hub.
        simulated: bool,
        /// True if the hub's scenario can be played.
        playable: bool,
        /// All motors of the catalogue.
        catalogue: Vec<Value>,
    },
    /// Sent 50 times per second.
    Frame(Frame),
    /// Sent when the settings of a motor have changed.
    Settings(Value),
    /// Sent when one of these has changed: the number of the page in control, the number of pages, and the number of the
    /// page that asks for control.
    Control { controller: Option<u32>, pages: usize, asks: Option<u32> },
    /// Sent when the hub has been connected or lost.
    Line {
        /// True if the hub answers.
        connected: bool,
        /// Why the hub does not answer; empty if the hub answers.
        why: String,
        /// True if the hub answers [`HubReport`] requests.
        reports: bool,
        /// True if the hub can store its settings.
        stores: bool,
        /// What the hub has besides motors; `None` if the hub does not report it.
        has: Option<Value>,
    },
    /// Sent when the hubs of a chain, or what they do, have changed. The parent is the first hub.
    Hubs { hubs: Vec<HubOfChain> },
    /// States of the servo outputs, by the number of the servo.
    Servos { servos: Vec<Servo> },
    /// Values of all channels that the hub measures.
    Analog { channels: Vec<Value> },
    /// States of the digital pins that the hub has.
    Pins { pins: Vec<Value> },
    /// Result of a transfer on an I2C bus.
    Transfer(Transfer),
    /// A notice for the user.
    Notice {
        text: String,
        /// True if motors were disabled, or if the shown hub was lost: a page then ends what it drives.
        motors_disabled: bool,
    },
    /// Sent to a page whose order was not executed: why it was not.
    Refused { why: String },
    /// Progress or result of an identification.
    Identification {
        motor: u8,
        #[serde(flatten)]
        progress: Identification,
    },
    /// Answer to a page that has asked for points.
    Points(Value),
    /// Answer to a page that has asked for the hub's record of faults, newest first.
    Faults { entries: Vec<Value> },
    /// Answer to a page that has asked for a file: name and contents of the file.
    File { name: &'static str, text: String },
    /// Answer to a page that has asked for the hub's status.
    Status(Value),
    /// Sent while new firmware is sent to the hub, and at its end.
    Update(Progress),
    /// Sent when a simulated hub's world has changed.
    World(Value),
}

/// Address, version, colour of the lamp and stored settings of a hub, as JSON. `stored` is `null` for a hub that stores
/// nothing.
pub(crate) fn status(session: &mut Session) -> Result<Value, Error> {
    let Colour { red, green, blue } = session.led()?;
    let report = session.stored_if_reported()?;
    Ok(json!({
        "address": session.address(),
        "version": session.version()?,
        "led": [red, green, blue],
        "stored": report.as_ref().map(stored_text),
        "differs": report.is_some_and(|report| report.differs),
    }))
}

/// A setting of a motor, as a form shows it: a number with a range, or one of some words. The value is `null` if the
/// setting is not configured. Only an optional setting can be not configured.
fn field_of(field: &'static Field, settings: &MotorSettings) -> Value {
    let raw = field.get(settings);
    let words = if let Form::Words(words) = field.form { words } else { &[] };
    let optional = field.zero == Zero::NotConfigured;
    let value = (!(optional && raw == 0)).then(|| word_or_number::<Value>(field, raw));
    json!({ "name": field.name, "value": value, "words": words, "range": field.range(), "optional": optional })
}

/// An entry of the hub's record of faults. The explanation has paragraphs: meaning, reaction of the hub, what to check.
pub(crate) fn fault_entry(head: &Head) -> Value {
    json!({
        "fault": head.fault.number(),
        "name": head.fault.name(),
        "motor": head.motor,
        "run": head.run,
        "after_s": f64::from(head.uptime_ms) / 1e3,
        "times": u16::from(head.times),
        "explanation": explanation(head.fault).sentences(),
    })
}

/// State of the hub at one instant.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Frame {
    /// Number of the frame, from 1. A page returns the number when it has shown the frame.
    pub(crate) number: u64,
    /// Time since the server's start.
    pub(crate) at_s: f64,
    /// Time of the hub's control tick, since the hub's start.
    pub(crate) tick_ms: u32,
    /// Battery voltage; `None` if unknown.
    pub(crate) battery_v: Option<f64>,
    /// What the state of the bus means for the motors; `None` if the hub does not report it.
    pub(crate) bus: Option<&'static str>,
    /// Share of the braking energy that is dissipated instead of returned, 0 to 1.
    pub(crate) dissipated_share: f64,
    /// States of the motors, by the number of the motor.
    pub(crate) motors: Vec<MotorState>,
}

/// State of a motor. Values that the hub does not report are left out.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct MotorState {
    /// Kind of the set-point.
    pub(crate) setpoint: &'static str,
    /// Set-point as a share of full power, in amperes, in counts/s or in counts. `None` without a set-point, and for an
    /// identification.
    pub(crate) target: Option<f64>,
    /// Position in counts.
    pub(crate) position: i32,
    /// Speed in counts per second.
    pub(crate) velocity: i16,
    /// True if the motor is enabled.
    pub(crate) enabled: bool,
    /// True if the motor is within tolerance of its target. `None` for hubs of this project, which report instead
    /// whether the motor has settled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) within_tolerance: Option<bool>,
    /// Why the motor does not turn; `None` if the motor turns or if no reason is known.
    pub(crate) why: Option<&'static str>,
    /// True if the motor is enabled and has a fault. `None` for hubs of other makers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) fault: Option<bool>,
    /// Values that only hubs of this project report.
    #[serde(flatten)]
    pub(crate) values: Option<MotorValues>,
}

impl Message {
    /// The message as JSON.
    pub(crate) fn text(&self) -> Arc<str> {
        // Serializing plain data cannot fail.
        serde_json::to_string(self).unwrap_or_default().into()
    }
}

/// All motors of the catalogue. The free speeds are those at 12 V.
pub(crate) fn catalogue() -> Vec<Value> {
    let motor = |motor: Motor| {
        json!({
            "name": motor.name,
            "counts_per_turn": motor.counts_per_rev_output(),
            "free_cps": 12_000.0 / motor.ke_fw(),
            "emf_mv_s_per_count": motor.ke_fw(),
            "resistance_ohm": motor.r.0,
        })
    };
    motors().map(motor).collect()
}

impl Frame {
    /// True if a motor is regulated to a position, alone or in a group.
    pub(crate) fn holds_position(&self, motor: u8) -> bool {
        let motor = self.motors.get(usize::from(motor));
        motor.is_some_and(|motor| motor.enabled && ["position", "together"].contains(&motor.setpoint))
    }

    /// Converts a hub's report to a frame.
    pub(crate) fn of(report: &HubReport) -> Self {
        let motors = report.motors.iter().enumerate();
        Self {
            tick_ms: report.at_ms,
            battery_v: report.battery.map(|mv| f64::from(mv.get()) / 1e3),
            bus: Some(bus_text(report.bus)),
            dissipated_share: f64::from(report.dissipate) / 1e3,
            motors: motors.map(|(index, motor)| MotorState::of(motor, why_still(report, index))).collect(),
            ..Self::default()
        }
    }

    /// Reads the frame of another maker's hub from the values that all hubs report. If `look` is false, set-points and
    /// enabled motors are copied from `before`, because reading them takes several requests per motor. A hub with fewer
    /// motors refuses the first motor that it lacks.
    pub(crate) fn of_other_maker(
        session: &mut Session,
        before: Vec<MotorState>,
        look: bool,
    ) -> Result<Self, Error> {
        let (bulk, battery) = (session.bulk()?, session.battery()?);
        let mut motors = Vec::with_capacity(CHANNELS);
        let look = look || before.is_empty();
        for (index, motor) in (0..).zip(0..CHANNELS) {
            let state = if look {
                none_if_unsupported(MotorState::of_other_maker(session, index))?
            } else {
                before.get(motor).cloned()
            };
            let Some(state) = state else { break };
            motors.push(MotorState {
                position: bulk.encoders.get(motor).copied().unwrap_or_default(),
                velocity: bulk.velocities.get(motor).copied().unwrap_or_default(),
                within_tolerance: bulk.within_tolerance.get(motor).copied(),
                ..state
            });
        }
        let battery_v = Some(f64::from(battery.get()) / 1e3).filter(|volts| *volts > 0.0);
        Ok(Self { battery_v, motors, ..Self::default() })
    }
}

impl MotorState {
    /// State of a motor, as another maker's hub reports it.
    fn of_other_maker(session: &mut Session, motor: u8) -> Result<Self, Error> {
        let state = session.motor(motor)?;
        let (setpoint, target) = match (state.enabled, state.mode) {
            (false, _) => ("off", None),
            (true, RunMode::Power) => ("power", Some(state.power.to_f64())),
            (true, RunMode::Velocity) => ("velocity", Some(state.velocity.into())),
            (true, RunMode::Position) => ("position", Some(state.position.counts.into())),
        };
        let why = (!state.enabled).then_some("disabled");
        Ok(Self { setpoint, target, enabled: state.enabled, why, ..Self::default() })
    }

    fn of(motor: &MotorReport, why: Option<&'static str>) -> Self {
        // Pages draw the target. The value of an identification's set-point is its travel limit, which is not a target.
        let target = match motor.setpoint {
            ReportedSetpoint::Identify(_) => None,
            setpoint => setpoint.value(),
        };
        let MotorReport { position, velocity, enabled, .. } = *motor;
        Self {
            setpoint: motor.setpoint.name(),
            target,
            position,
            velocity,
            enabled,
            within_tolerance: None,
            why,
            fault: Some(motor.faults.any() && enabled),
            values: Some(MotorValues::of(motor)),
        }
    }
}

/// The settings of a motor as the hub reports them. `name` and `counts_per_turn` are `null` for a motor that is not in
/// the catalogue.
pub(crate) fn settings_of(
    motor: usize,
    settings: &MotorSettings,
    loops: [LoopCoefficients; 2],
    undoable: usize,
) -> Value {
    let number = |name| Field::named(name).map_or(0.0, |field| field.number_of(field.get(settings)));
    let known = catalogue_motor(&settings.motor).map(|(known, _)| known);
    let [velocity, position] = loops.map(|LoopCoefficients { p, i, d, f, .. }| {
        [p, i, d, f].map(|coefficient| f64::from(coefficient.to_bits()) / f64::from(1 << 16))
    });
    let duty = Field::named("duty").and_then(|field| field.word_of(field.get(settings)));
    let fields = configurable().flat_map(|group| group.fields()).map(|field| field_of(field, settings));
    json!({
        "motor": motor,
        "name": known.map(|known| known.name),
        "counts_per_turn": known.map(|known| known.counts_per_rev_output()),
        "emf_mv_s_per_count": number("emf_mv_s_per_count"),
        "resistance_ohm": number("resistance_ohm"),
        "scheme": SchemeWords(settings.motor.scheme),
        "duty": duty,
        "dynamics": settings.motor.dynamics.as_ref().map(dynamics_json),
        "acceleration": settings.motor.acceleration.map(Acceleration::get),
        "velocity": velocity,
        "position": position,
        "fields": fields.collect::<Vec<_>>(),
        "undoable": undoable,
    })
}

/// The points S, T, Z and G of a motor with this winding, at a speed and a battery voltage. `firmware` has the control
/// values that the firmware computes, as shares of full control. `paper` has the control values of the paper's
/// formulas; a value is `null` where a formula is infinite or not defined. `values` has the voltages in V (Scheme A) or
/// currents in A (other schemes) of the paper's formulas.
pub(crate) fn points(winding: &Winding, scheme: Scheme, cps: f64, volts: f64) -> Result<Value, RequestError> {
    let cps = within("a speed", cps, 0.0..=MOST_CPS, "counts/s")?;
    let volts = within("a battery", volts, LEAST_VOLTS..=MOST_VOLTS, "V")?;
    let speed = CountsPerSecond::new(cps.round() as i32);
    let emf = winding.emf.emf_within_range(speed).map_err(|error| error.to_string())?;
    let battery = Millivolts::new((1e3 * volts).round() as u16);
    let at = OperatingPoint::new(emf, battery).ok_or("points need a battery voltage above 0")?;
    let Points { s, t, z, g } = Points::new(scheme, at);
    let (emf_v, ohms) = (emf.to_f64() / 1e3, f64::from(winding.resistance.as_milliohms()) / 1e3);
    let of_paper = match scheme {
        Scheme::A => paper::Scheme::A,
        Scheme::B => paper::Scheme::B,
        Scheme::C => paper::Scheme::C,
        Scheme::D(_) => paper::Scheme::D { blend: paper::blend_keeping_t_in_range(emf_v / volts) },
        Scheme::ForwardReverse => return Err("without braking regime there are no points".into()),
    };
    let conditions = Conditions { battery: Volts(volts), emf: Volts(emf_v) };
    let points = of_paper.points(1.0, Ohms(ohms), conditions);
    let by_paper = [points.s, points.t, points.z, points.g];
    let firmware = [s, t, z, g].map(|point| point.to_f64() / f64::from(Control::MAX.get()));
    Ok(json!({
        "emf_v": emf_v,
        "firmware": firmware,
        "paper": by_paper.map(|point| Some(point.x).filter(|x| points.valid && x.is_finite())),
        "values": by_paper.map(|point| point.y),
    }))
}
