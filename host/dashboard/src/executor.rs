//! Executes orders by requests to the hub. The values of an order are checked before a request changes the hub.

use crate::frame::{configurable, settings_of};
use crate::hub::{RequestError, channel, of_motor, within};
use crate::requests::PageRequest;
use crate::settings_file::{self, raw_of};
use crate::world::World;
use motor_hub::braking::{DutyRule, Scheme};
use motor_hub::extension::Request;
use motor_hub::extension::group::GroupCourse;
use motor_hub::extension::settings::{Field, Group, MotorSettings, Values, Zero};
use motor_hub::group::GroupCommand;
use motor_hub::model::catalogue::characterised;
use motor_hub::motor::{Settings, ThermalLimit, ZeroPower};
use motor_hub::protocol::motor::{Loop, LoopCoefficients, RunMode, Terms};
use motor_hub::protocol::{CHANNELS, Colour};
use motor_hub::regulator::Kind;
use motor_hub::units::{Acceleration, Coefficient, Control, CountsPerSecond};
use motor_hub_client::hub::FASTEST_GROUP_CPS;
use motor_hub_client::kept_settings::KeptSettings;
use motor_hub_client::motor::{
    NO_CURRENT, NO_SPEED_LIMIT_CPS, SPEED_LIMITS_CPS, Setpoint, constant_current_ma,
};
use motor_hub_client::reasons::why_still;
use motor_hub_client::request_text::of_group;
use motor_hub_client::{Error, Session};
use serde_json::{Map, Value};
use simulated::hardware::winding;

/// Default tolerance of a position, in counts.
const USUAL_TOLERANCE: f64 = 10.0;

/// Default speed limit towards a position, in counts/s.
const USUAL_SPEED: f64 = 1_000.0;

/// Highest speed of a group, in counts/s.
const FASTEST_CPS: f64 = FASTEST_GROUP_CPS as f64;

/// Number of changes of a motor's settings that can be undone.
const UNDOABLE: usize = 20;

/// State of one motor that the server keeps.
#[derive(Clone, Debug, Default)]
pub(crate) struct MotorMemory {
    undo: Vec<KeptSettings>,
    /// Settings that the last identification proposes, for a motor with the winding in these settings. `None` before an
    /// identification. A set-up with a motor's name, an import, a load, a reset and a new connection delete the
    /// proposal.
    pub(crate) proposed: Option<Settings>,
}

impl MotorMemory {
    /// Keeps the settings before a change, for undo.
    fn keep(&mut self, kept: KeptSettings) {
        self.undo.push(kept);
        if self.undo.len() > UNDOABLE {
            self.undo.remove(0);
        }
    }
}

/// Executor of orders, with the state of each motor.
#[derive(Debug, Default)]
pub(crate) struct Executor {
    pub(crate) motors: [MotorMemory; CHANNELS],
}

impl Executor {
    /// Executes an order about set-points, groups, settings, the record of faults, the LED or the simulated world. The
    /// relay executes all other orders.
    pub(crate) fn execute(
        &mut self,
        session: &mut Session,
        world: Option<&World>,
        order: &PageRequest,
    ) -> Result<(), RequestError> {
        match *order {
            PageRequest::Drive { motor, mode, value, speed, tolerance, zero, enable } => {
                let motor = channel(motor)?;
                let setpoint = setpoint(mode, value, speed, tolerance.unwrap_or(USUAL_TOLERANCE))?;
                drive(session, motor, setpoint, zero, enable)?;
            }
            PageRequest::Current { motor, amperes, speed, enable } => {
                let motor = channel(motor)?;
                let setpoint = current(session, amperes, speed)?;
                drive(session, motor, setpoint, ZeroPower::Brake, enable)?;
            }
            PageRequest::Enable { motor, on } => session.enable(channel(motor)?, on)?,
            PageRequest::ResetEncoder { motor } => session.reset_encoder(channel(motor)?)?,
            PageRequest::Together { by, speed, acceleration } => together(session, by, speed, acceleration)?,
            PageRequest::Import { ref text } => self.import(session, text)?,
            PageRequest::Turn { at, acceleration } => turn(session, at, acceleration)?,
            PageRequest::ClearFaults => session.forget_record()?,
            PageRequest::Led { colour: [red, green, blue] } => {
                session.set_led(Colour { red, green, blue })?
            }
            PageRequest::World(ref order) => {
                world.ok_or("this hub is not simulated: its world cannot be changed")?.change(order)?;
            }
            _ => self.change(session, order)?,
        }
        Ok(())
    }

    /// Executes an order that changes settings of a motor, and keeps the settings before the change for undo.
    fn change(&mut self, session: &mut Session, order: &PageRequest) -> Result<(), RequestError> {
        let motor = channel(order.changed_motor().ok_or("this order is not for a motor")?)?;
        if let PageRequest::Undo { .. } = order {
            let before = self.of(motor)?.undo.last().cloned().ok_or("there is nothing to undo")?;
            session.restore_settings(motor, &before)?;
            self.of(motor)?.undo.pop();
            return Ok(());
        }
        let before = session.keep_settings(motor)?;
        // These orders send a set-up of the same motor, with which the hub deletes the coefficients.
        let keeps_pid =
            matches!(order, PageRequest::SetUp { name: None, .. } | PageRequest::Configure { .. });
        let mut done = self.change_settings(session, motor, order, before.settings);
        if keeps_pid && done.is_ok() {
            done = session.restore_coefficients(motor, &before).map_err(RequestError::from);
        }
        let changed = match done {
            Ok(()) => true,
            // The hub may have accepted the first requests of a refused order.
            Err(RequestError::Refused(_)) => session.settings(motor)? != before.settings,
            Err(RequestError::Hub(_)) => false,
        };
        if changed {
            self.of(motor)?.keep(before);
        }
        done
    }

    /// Executes an order that changes settings of a motor. `settings` are the settings before the
    /// order.
    fn change_settings(
        &mut self,
        session: &mut Session,
        motor: u8,
        order: &PageRequest,
        mut settings: MotorSettings,
    ) -> Result<(), RequestError> {
        match *order {
            PageRequest::Coefficients { of, pidf, .. } => {
                let pidf = coefficients(pidf)?;
                session.set_coefficients(motor, of, pidf)?;
            }
            // The hub deletes the coefficients, so the model regulates the motor.
            PageRequest::Regulator { kind: Kind::Model, .. } => session.set_up(motor, &settings)?,
            PageRequest::Regulator { kind: Kind::Pid, .. } => {
                let pidf = session.coefficients(motor, Loop::Velocity)?;
                session.set_coefficients(motor, Loop::Velocity, pidf)?;
            }
            PageRequest::SetUp { ref name, scheme, duty, .. } => {
                let settings = set_up(settings, name.as_deref(), scheme.0, duty)?;
                if name.is_some() {
                    // Dynamics and acceleration limit belong to the former motor, so they are not sent again.
                    session.set(motor, Group::SetUp, &settings)?;
                    self.of(motor)?.proposed = None;
                } else {
                    session.set_up(motor, &settings)?;
                }
            }
            PageRequest::Acceleration { limit, .. } => {
                let acceleration = limit.map(acceleration_limit).transpose()?;
                settings.motor.acceleration = acceleration;
                session.set(motor, Group::Motion, &settings)?;
            }
            PageRequest::Configure { ref values, .. } => {
                let requests = configured(motor, &settings, values)?;
                for request in requests {
                    session.command(request)?;
                }
            }
            // The order `Apply`. All other orders that change settings are handled above or by the caller.
            _ => {
                let of_this_winding = |proposed: &Settings| proposed.winding == settings.motor.winding;
                let proposed = self.of(motor)?.proposed.filter(of_this_winding);
                let Settings { dynamics, acceleration, .. } = proposed.ok_or(
                    "with its present constants this motor was not identified yet: run Identify first",
                )?;
                (settings.motor.dynamics, settings.motor.acceleration) = (dynamics, acceleration);
                session.set_up(motor, &settings)?;
            }
        }
        Ok(())
    }

    /// Returns the state that the server keeps of a motor.
    pub(crate) fn of(&mut self, motor: u8) -> Result<&mut MotorMemory, RequestError> {
        of_motor(&mut self.motors, motor)
    }

    /// Puts the settings of a file in force. If the hub refuses a setting, the former settings of the motors are
    /// restored. A later undo restores the former settings of a motor except its mode. An undo does not restore the
    /// drive base.
    fn import(&mut self, session: &mut Session, text: &str) -> Result<(), RequestError> {
        let file = settings_file::read(text)?;
        for (motor, kept) in session.apply_settings(file.motors, file.base)? {
            let of = self.of(motor)?;
            of.keep(kept);
            of.proposed = None;
        }
        Ok(())
    }

    /// Reads the settings of a motor from the hub, and returns these settings as JSON for pages.
    pub(crate) fn settings(&mut self, session: &mut Session, motor: u8) -> Result<Value, Error> {
        let settings = session.settings(motor)?;
        let [velocity, position] = [Loop::Velocity, Loop::Position].map(|of| session.coefficients(motor, of));
        let index = usize::from(motor);
        let undoable = self.motors.get(index).map_or(0, |of| of.undo.len());
        Ok(settings_of(index, &settings, [velocity?, position?], undoable))
    }
}

/// Returns the set-point of the order [`PageRequest::Drive`].
fn setpoint(mode: RunMode, value: f64, speed: Option<f64>, tolerance: f64) -> Result<Setpoint, RequestError> {
    let tolerance = within("a tolerance", tolerance.round(), 0.0..=u16::MAX.into(), "counts")? as u16;
    Ok(match mode {
        RunMode::Power => {
            let share = within("a power", value, -1.0..=1.0, "")?;
            Setpoint::Power(Control::saturating((share * f64::from(Control::MAX.get())).round() as i64))
        }
        RunMode::Velocity => Setpoint::Velocity(cps(value)?),
        RunMode::Position => {
            let counts = counts("a position", value)?;
            let speed_limit = speed_limit(speed.unwrap_or(USUAL_SPEED))?;
            Setpoint::Position { counts, tolerance, speed_limit: speed_limit as i16 }
        }
    })
}

/// Returns the set-point of the order [`PageRequest::Current`].
fn current(session: &mut Session, amperes: f64, speed: Option<f64>) -> Result<Setpoint, RequestError> {
    let ma = constant_current_ma(amperes).map_err(|error| error.to_string())?;
    let speed_limit = speed_limit(speed.unwrap_or(NO_SPEED_LIMIT_CPS.into()))?;
    if session.report()?.is_none() {
        return Err(NO_CURRENT.into());
    }
    Ok(Setpoint::Current { ma, speed_limit })
}

/// Gives a motor a set-point, and enables the motor if `enable` is true.
pub(crate) fn drive(
    session: &mut Session,
    motor: u8,
    setpoint: Setpoint,
    zero: ZeroPower,
    enable: bool,
) -> Result<(), Error> {
    session.set_setpoint(motor, setpoint, zero)?;
    // A hub takes a constant current for enabled motors only.
    let is_current = matches!(setpoint, Setpoint::Current { .. });
    if enable && !(is_current && session.enabled(motor)?) {
        session.enable(motor, true)?;
        if is_current {
            session.set_setpoint(motor, setpoint, zero)?;
        }
    }
    Ok(())
}

fn counts(what: &str, value: f64) -> Result<i32, RequestError> {
    Ok(within(what, value, i32::MIN.into()..=i32::MAX.into(), "counts")?.round() as i32)
}

fn speed_limit(value: f64) -> Result<u16, RequestError> {
    let [least, most] = [SPEED_LIMITS_CPS.start(), SPEED_LIMITS_CPS.end()].map(|cps| f64::from(*cps));
    Ok(within("a speed limit", value, least..=most, "counts/s")?.round() as u16)
}

fn cps(value: f64) -> Result<i16, RequestError> {
    Ok(within("a velocity", value, i16::MIN.into()..=i16::MAX.into(), "counts/s")?.round() as i16)
}

fn acceleration_limit(limit: f64) -> Result<Acceleration, RequestError> {
    let limit = within("an acceleration", limit.round(), 1.0..=u32::MAX.into(), "counts/s²")?;
    Acceleration::new(limit as u32).map_err(|error| error.to_string().into())
}

fn coefficients(pidf: [f64; 4]) -> Result<LoopCoefficients, RequestError> {
    let mut bits = [Coefficient::ZERO; 4];
    for (slot, value) in bits.iter_mut().zip(pidf) {
        let value = within("a coefficient", value, -32_768.0..=32_767.999, "")?;
        *slot = Coefficient::from_bits((value * 65_536.0).round() as i32);
    }
    let [p, i, d, f] = bits;
    Ok(LoopCoefficients { p, i, d, f, terms: Terms::Pidf })
}

fn set_up(
    mut settings: MotorSettings,
    name: Option<&str>,
    scheme: Scheme,
    duty: DutyRule,
) -> Result<MotorSettings, RequestError> {
    if let Some(name) = name {
        let motor = characterised(name).map_err(|error| error.to_string())?;
        settings.motor.winding = winding(&motor).map_err(|error| error.to_string())?;
    }
    // A scheme D that stays keeps its blend.
    if !matches!((scheme, settings.motor.scheme), (Scheme::D(_), Scheme::D(_))) {
        settings.motor.scheme = scheme;
    }
    settings.motor.duty = duty;
    Ok(settings)
}

/// Returns the requests that change settings of a motor, which `given` has by name. A set-up deletes the settings of
/// [`Group::Motion`], so these settings are sent again. A set-up also deletes coefficients that a host has set. The
/// caller restores these coefficients.
fn configured(
    motor: u8,
    before: &MotorSettings,
    given: &Map<String, Value>,
) -> Result<Vec<Request>, RequestError> {
    let known =
        |name: &String| configurable().any(|group| group.fields().iter().any(|field| field.name == name));
    if let Some(name) = given.keys().find(|name| !known(name)) {
        return Err(format!("{name} is no setting").into());
    }
    let mut requests = Vec::new();
    let mut set_up = false;
    let requested = |field: &Field| match given.get(field.name) {
        None => Ok(field.get(before)),
        // `null` removes the value of an optional setting.
        Some(Value::Null) if field.zero == Zero::NotConfigured => Ok(0),
        Some(Value::Null) => Err(format!("{} must have a value, not null", field.name)),
        Some(value) => raw_of(field, value.as_str(), value.as_f64(), value),
    };
    for group in configurable() {
        let values = Values::collect(group, |field| {
            let raw = requested(field)?;
            // A thermal limit needs time constants. A time constant that is not configured gets its usual value.
            Ok::<_, String>(Some(match (field.name, raw) {
                ("thermal.winding_s", 0) => ThermalLimit::USUAL_WINDING_S.into(),
                ("thermal.case_s", 0) => ThermalLimit::USUAL_CASE_S.into(),
                _ => raw,
            }))
        })?;
        let after = values
            .apply_to(before)
            .map_err(|nack| format!("the values of the {}: {nack}", of_group(group)))?;
        for field in group.fields().iter().filter(|field| given.contains_key(field.name)) {
            if field.get(&after) == 0 && requested(field)? != 0 {
                let needed = needed_by(field);
                return Err(format!("{} has no effect without {needed}: set {needed} too", field.name).into());
            }
        }
        let changes = Values::of(group, &after) != Values::of(group, before);
        set_up |= changes && group == Group::SetUp;
        if changes || (set_up && group == Group::Motion) {
            requests.push(Request::Set(motor, values));
        }
    }
    if requests.is_empty() { Err("no setting has changed".into()) } else { Ok(requests) }
}

/// Returns the setting without which a setting has no effect.
fn needed_by(field: &Field) -> &'static str {
    match field.name.split_once('.') {
        Some(("thermal", _)) => "thermal.continuous_current_ma",
        Some(_) => "dynamics.acceleration_cps2_per_v",
        None => "scheme D",
    }
}

/// Turns motors in step, each at its own speed. The speed of the group is the highest of these speeds.
fn turn(session: &mut Session, at: [Option<f64>; CHANNELS], acceleration: f64) -> Result<(), RequestError> {
    let mut fastest = 0.0_f64;
    for cps in at.into_iter().flatten() {
        let cps = within("a group's speed", cps.round(), -FASTEST_CPS..=FASTEST_CPS, "counts/s")?;
        fastest = fastest.max(cps.abs());
    }
    let course = GroupCourse::Velocity(at.map(|cps| cps.map(|cps| CountsPerSecond::new(cps.round() as i32))));
    begin_group(session, course, at.map(|cps| cps.is_some()), fastest, acceleration)
}

/// Moves motors in step by distances.
fn together(
    session: &mut Session,
    by: [Option<f64>; CHANNELS],
    speed: f64,
    acceleration: f64,
) -> Result<(), RequestError> {
    let speed = within("a group's speed", speed.round(), 1.0..=FASTEST_CPS, "counts/s")?;
    let members = by.map(|by| by.is_some());
    let mut targets = [None; CHANNELS];
    for ((target, by), from) in targets.iter_mut().zip(by).zip(session.group_positions(members)?) {
        *target = by.map(|by| counts("a distance", by)).transpose()?.map(|by| from.wrapping_add(by));
    }
    begin_group(session, GroupCourse::Position(targets), members, speed, acceleration)
}

/// Enables the members of a group, and starts the group.
fn begin_group(
    session: &mut Session,
    course: GroupCourse,
    takes_part: [bool; CHANNELS],
    speed_cps: f64,
    acceleration: f64,
) -> Result<(), RequestError> {
    let speed = CountsPerSecond::new(speed_cps as i32);
    let members: Vec<u8> = (0..).zip(takes_part).filter_map(|(motor, is)| is.then_some(motor)).collect();
    let first = *members.first().ok_or("a group needs at least one motor: enter a distance or a speed")?;
    let limit = acceleration_limit(acceleration)?;
    session.catch_up()?;
    if let Some(report) = session.report()? {
        for &motor in &members {
            let Some(of) = report.motors.get(usize::from(motor)) else { continue };
            // The hub would wait for the end of the fault without a word, and then move the motors. While the battery
            // voltage is unknown, the hub refuses to enable a motor, and says why.
            if of.faults.any() && (of.enabled || !of.faults.battery_unknown) {
                let known = if of.faults.encoder_stale { None } else { why_still(&report, motor.into()) };
                let why = known.unwrap_or("the hub gets no reading from its encoder");
                return Err(format!("motor {motor}: {why}").into());
            }
        }
    }
    for &motor in &members {
        // A motor that turns already goes on until the group moves. Any other motor brakes with power 0.
        if !session.enabled(motor)? {
            session.brake(motor)?;
            session.enable(motor, true)?;
        }
    }
    Ok(session.move_together(first, GroupCommand::new(course, speed, limit))?)
}
