//! One motor: its settings, its set-point, its state, and one step of control.
//!
//! A tick ([`Motor::step`]) computes the bridge's command from the newest reading of the encoder:
//!
//! ```text
//! set-point, faults ─▶ Activity ─┬─ Coast ────────────────────────────▶ bridge open
//!                                ├─ Brake, Power ───────────────┐
//!                                ├─ Current ─ winding's equation ┤
//! reading ─▶ regulator ──────────┼─ Regulate ─ encoder check ────┼▶ Request ─▶ limits ─▶ modulator ─▶ bridge
//!            identifier ─────────┴─ Identify ────────────────────┘                         │
//!                ▲                                                                         │
//!                └──────────────────────────── applied voltage ◀───────────────────────────┘
//! ```
//!
//! * *Activity*: what the motor does at a tick. It follows from the set-point, unless a fault ends the set-point.
//! * *Request*: the modulation that an activity asks for, before limits.
//! * *Command*: the request, what the limits leave of the request, and what the bridge does.
//! * *Direct set-point*: a set-point whose command needs no encoder and no tick.
//!
//! ```
//! use motor_hub::braking::{Regime, Winding};
//! use motor_hub::motion::Reading;
//! use motor_hub::motor::{Motor, Setpoint, Settings};
//! use motor_hub::units::{CountsPerSecond, Micros, Millivolts, Period};
//!
//! let settings = Settings::new(Winding::NEVEREST_60);
//! let mut motor = Motor::new(settings, Period::DEFAULT);
//! motor.set(Setpoint::Velocity(CountsPerSecond::new(1_000)));
//!
//! let battery = Some(Millivolts::new(12_000));
//! let reading = |ms: u64, position| {
//!     let at = Micros::new(1_000 * ms);
//!     Reading { position, edge_at: at, at }
//! };
//! let standing = motor.step(Micros::new(50_000), Some(reading(50, 0)), battery);
//! assert_eq!(standing.regime, Some(Regime::Forward));
//! // The motor turns at 300 counts/s. The counters are read every millisecond, and a tick comes every 50 ms.
//! let mut turning = standing;
//! for ms in 51..=550 {
//!     let newest = reading(ms, (ms as i32 - 50) * 3 / 10);
//!     match ms % 50 {
//!         0 => turning = motor.step(newest.at, Some(newest), battery),
//!         _ => motor.sample(newest),
//!     }
//! }
//! assert!((290..310).contains(&turning.velocity.round()), "{:?}", turning.velocity);
//! ```

mod back_emf;
mod burn_pulses;
mod encoder_check;
mod expected;
mod last_motion;
mod limits;
mod report;
mod sense_line;
mod setpoint;
mod settled;
mod thermal;

pub use encoder_check::EncoderFault;
pub use report::{Faults, Report, best_current};
pub use sense_line::SenseLine;
pub use setpoint::Setpoint;
pub use settled::{SettleDetector, within_tolerance};

use crate::braking::{Modulation, Modulator, OperatingPoint, Regime, Returned};
use crate::bridge::{BridgeFeedback, Drive};
use crate::motion::Reading;
use crate::regulator::identify::{Identifier, Refusal};
use crate::regulator::{Context, Demand, Effort, Kind, Regulator};
pub use crate::settings::{OnFault, Settings, ThermalLimit, ZeroPower};
use crate::units::{
    Control, CountsPerSecond, Duty, Micros, Milliamperes, Millivolts, Period, Share, Voltage,
};
use back_emf::Configured;
use burn_pulses::{BurnPulses, Pulse, Voltages};
use core::mem::discriminant;
use encoder_check::{EncoderCheck, Finding, Tick};
pub(crate) use limits::SupplyLimits;
use limits::VoltageLimits;
use sense_line::Line;
use thermal::Thermal;

/// Largest age in us of a reading that is used; an older reading counts as missing. The counters are sampled every
/// millisecond.
pub const ENCODER_STALE_MICROS: u64 = 20_000;

/// Voltage of a [`Pulse::Forward`] beyond the back EMF, as a share of the back EMF.
struct ForwardPulse {
    /// Share at a supply that begins to reject energy. With this share the pulse draws from the bus what the winding
    /// returns when a short circuit ends.
    least: f32,
    /// Share at a supply that rejects all energy.
    most: f32,
}

const FORWARD_PULSE: ForwardPulse = ForwardPulse { least: 0.1, most: 0.3 };

/// The reading; `None` if the reading is older than [`ENCODER_STALE_MICROS`].
pub(crate) fn fresh(reading: Option<Reading>, now: Micros) -> Option<Reading> {
    reading.filter(|reading| now.since(reading.at) <= ENCODER_STALE_MICROS)
}

/// Settings, set-point and state of one motor.
#[derive(Clone, Debug)]
pub struct Motor {
    /// Settings in force: as configured, but for a corrected back EMF.
    settings: Settings,
    /// What is configured of the corrected settings.
    configured: Configured,
    /// Maps voltages and control values to commands, by the settings.
    modulator: Modulator,
    /// Time between two ticks.
    period: Period,
    setpoint: Setpoint,
    /// True if set-point or settings have changed since the last request.
    changed: bool,
    /// Counts at the last tick.
    position: i32,
    regulator: Regulator,
    identifier: Identifier,
    check: EncoderCheck,
    settle_detector: SettleDetector,
    thermal: Thermal,
    supply: SupplyLimits,
    pulses: BurnPulses,
    /// Present command; `None` if the last request was an open bridge.
    command: Option<Command>,
    /// Current-sense line of the bridge.
    line: Line,
    /// Current by the motor's constants at the last tick; `None` if the speed was unknown.
    modelled: Option<Milliamperes>,
    /// True if the bridge has reported a fault. The fault is latched until the motor is disabled.
    bridge_fault: bool,
}

/// What the motor does at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Activity {
    /// The bridge is open.
    Coast,
    /// The bridge shorts the winding.
    Brake,
    /// The bridge drives the motor in open loop, at this share of the control range.
    Power(Control),
    /// The motor has a constant current, up to a speed.
    Current { current: Milliamperes, speed_limit: CountsPerSecond },
    /// The regulator drives the motor.
    Regulate(Demand),
    /// The identification drives the motor.
    Identify,
}

/// What a tick requests of the bridge, before limits.
#[derive(Clone, Copy, Debug)]
struct Request {
    /// Back EMF and battery voltage at the tick.
    at: OperatingPoint,
    /// Requested modulation.
    modulation: Modulation,
    /// Control value of the request; `None` if the request is a voltage.
    control: Option<Control>,
    /// Speed that the regulator is to reach; `None` if the motor is not regulated.
    target: Option<CountsPerSecond>,
}

/// A command of the bridge.
#[derive(Clone, Copy, Debug)]
struct Command {
    request: Request,
    /// Modulation within all limits.
    limited: Modulation,
    /// Mean voltage that `limited` applies.
    voltage: Voltage,
    /// Modulation of the bridge: `limited`, or the present burn pulse.
    modulation: Modulation,
}

impl Command {
    /// True if the limits change the request.
    fn is_limited(&self) -> bool {
        self.limited != self.request.modulation
    }

    /// The control value of the command.
    fn control(&self, modulator: &Modulator) -> Control {
        match self.request.control {
            Some(control) if !self.is_limited() => control,
            _ => modulator.control(self.request.at, self.voltage),
        }
    }
}

impl Motor {
    /// Creates a disabled motor that is stepped every `period`.
    pub fn new(settings: Settings, period: Period) -> Self {
        Self {
            settings,
            configured: Configured::new(&settings),
            modulator: settings.modulator(),
            period,
            setpoint: Setpoint::Disabled,
            changed: false,
            position: 0,
            regulator: Regulator::new(&settings, period),
            identifier: Identifier::default(),
            check: EncoderCheck::new(),
            settle_detector: SettleDetector::default(),
            thermal: Thermal::default(),
            supply: SupplyLimits::NONE,
            pulses: BurnPulses::NONE,
            command: None,
            line: Line::default(),
            modelled: None,
            bridge_fault: false,
        }
    }

    /// Replaces all settings immediately. The bridge's command changes at the next step. The state is kept, so that a
    /// motor may be tuned while it runs.
    pub fn configure(&mut self, mut settings: Settings) {
        if Configured::new(&settings) == self.configured {
            // The same motor: a correction of its back EMF stays.
            settings.winding.emf = self.settings.winding.emf;
            settings.dynamics = self.settings.dynamics;
        } else {
            self.configured = Configured::new(&settings);
        }
        self.regulator.configure(&self.settings, &settings, self.period);
        self.settings = settings;
        self.changed = true;
        self.modulator = settings.modulator();
        if settings.thermal.is_none() {
            self.thermal.clear(None);
        }
    }

    /// Replaces the set-point immediately. The bridge's command changes at the next step. The set-points
    /// [`Disabled`](Setpoint::Disabled) and [`FailSafe`](Setpoint::FailSafe) clear latched faults. An overheated motor
    /// keeps its fault until the winding has cooled down.
    pub fn set(&mut self, setpoint: Setpoint) {
        self.changed |= setpoint != self.setpoint;
        let follows = matches!((self.setpoint, setpoint), (Setpoint::Together(_), Setpoint::Together(_)));
        if setpoint != self.setpoint && !follows {
            self.settle_detector.reset();
        }
        if setpoint != self.setpoint && !self.setpoint.continues_as(setpoint, self.position) {
            self.regulator.retarget();
            if discriminant(&setpoint) != discriminant(&self.setpoint) {
                self.regulator.change_mode();
            }
            if self.check.interrupt() {
                self.regulator.leave_stop();
            } else if self.setpoint == Setpoint::ConstantPower(Control::ZERO) {
                // The current of the brake is not continued.
                self.regulator.start_at_zero_current();
            } else if !self.setpoint.is_regulated() {
                self.regulator.resume();
            }
        }
        if matches!(setpoint, Setpoint::Disabled | Setpoint::FailSafe) {
            self.check.clear();
            self.thermal.clear(self.settings.thermal);
            self.bridge_fault = false;
        }
        match setpoint {
            Setpoint::Identify { .. } if setpoint == self.setpoint && self.identifier.is_running() => (),
            Setpoint::Identify { travel_limit } => self.identifier.start(travel_limit),
            _ => self.identifier.stop(Refusal::Stopped),
        }
        self.setpoint = setpoint;
    }

    /// Counts at the last tick.
    pub(crate) const fn position(&self) -> i32 {
        self.position
    }

    /// The estimated speed.
    pub(crate) fn velocity(&self) -> CountsPerSecond {
        self.regulator.velocity()
    }

    /// The settings in force.
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Takes a sample of the encoder between two ticks, best every millisecond. With more samples the estimate is better.
    pub fn sample(&mut self, reading: Reading) {
        self.identifier.sample(&reading);
        self.regulator.sample(reading);
        let Self { check, command, regulator, .. } = self;
        let drive_volts = || command.as_ref().map_or(0.0, |command| command.voltage.to_volts());
        check.sample(&reading, regulator, drive_volts);
    }

    /// Takes the feedback of the bridge, on a board that can read the feedback.
    pub fn sense(&mut self, sensed: BridgeFeedback) {
        self.bridge_fault |= sensed.fault;
        let mode = (!self.pulses.are_active()).then_some(self.drive().mode);
        self.line.step(sensed.current, mode, self.modelled);
    }

    /// Takes one control tick: estimate, decide, limit, modulate, report.
    ///
    /// `reading` is the newest reading of the encoder; [`sample`](Self::sample) may have taken the same reading before.
    /// Without a reading or a `battery` voltage the report has a fault.
    pub fn step(&mut self, now: Micros, reading: Option<Reading>, battery: Option<Millivolts>) -> Report {
        let moved = fresh(reading, now).map(|reading| self.take_reading(reading));
        self.regulator.predict_until(now);
        let request = self.request(battery, moved);
        let (control, voltage) = self.apply(request);
        self.report(battery, moved, control, voltage)
    }

    /// Commands the bridge between two ticks, if the set-point is new and direct. Returns true if the bridge's command has
    /// changed.
    pub(crate) fn step_direct(&mut self, battery: Option<Millivolts>) -> bool {
        if !self.changed || !self.setpoint.is_direct() {
            return false;
        }
        let before = self.drive();
        let request = self.request(battery, None);
        self.apply(request);
        self.drive() != before
    }

    /// Limits the present command to what the supply allows from now on. Returns true if the bridge's command has changed.
    ///
    /// When a burn pulse ends a short circuit, the energy of the winding returns to the bus. So only one motor at a time
    /// may end a short circuit. `may_end_short` says whether this motor may, and becomes false if the motor did.
    pub(crate) fn limit_supply(&mut self, limits: SupplyLimits, may_end_short: &mut bool) -> bool {
        self.supply = limits;
        let Some(Command { request, .. }) = self.command else { return false };
        let (before, was_forward) = (self.drive(), self.pulses.is_forward());
        let (command, voltage) = self.modulate(request, *may_end_short);
        self.command = Some(command);
        *may_end_short &= was_forward || !self.pulses.is_forward();
        let changed = self.drive() != before;
        if changed || self.pulses.are_active() {
            self.note_voltage(voltage, before);
        }
        changed
    }

    /// The bridge's command.
    pub(crate) const fn drive(&self) -> Drive {
        match &self.command {
            Some(command) => command.modulation.drive,
            None => Drive::COAST,
        }
    }

    /// What the motor returns to the bus, and what its winding dissipates, while it brakes by the present command.
    pub(crate) fn returned(&self) -> Returned {
        match &self.command {
            Some(Command { request: Request { at, .. }, modulation, .. })
                if modulation.drive != Drive::COAST =>
            {
                let applied = self.modulator.applied(*at, *modulation);
                self.modulator.returned(*at, *modulation, applied, self.settings.ohms())
            }
            _ => Returned::NONE,
        }
    }

    /// Takes the reading of a tick. Returns the counts since the last tick.
    fn take_reading(&mut self, reading: Reading) -> i32 {
        let moved = reading.position.wrapping_sub(self.position);
        self.position = reading.position;
        self.sample(reading);
        self.regulator.tick();
        // An identification compares voltages, so the estimated gain does not change meanwhile.
        if !matches!(self.setpoint, Setpoint::Identify { .. }) {
            self.regulator.update_gain(&self.settings, self.period);
        }
        moved
    }

    /// Chooses the activity of this tick. `moved` is the counts since the last tick; `None` without a reading.
    ///
    /// With a fault of the motor, its encoder or its host, the setting [`OnFault`] chooses the activity instead of the
    /// set-point. The caller has already excluded a missing battery voltage and a bridge at fault, with which every motor
    /// coasts.
    fn activity(&self, moved: Option<i32>) -> Activity {
        let floats = self.settings.zero_power == ZeroPower::Float;
        let needs_encoder = !self.setpoint.is_direct();
        let no_encoder = moved.is_none() || self.check.fault().is_some();
        match self.setpoint {
            Setpoint::Disabled => Activity::Coast,
            Setpoint::FailSafe => self.on_fault(),
            _ if self.thermal.is_cut() || needs_encoder && no_encoder => self.on_fault(),
            Setpoint::ConstantPower(Control::ZERO) if floats => Activity::Coast,
            Setpoint::ConstantPower(Control::ZERO) => Activity::Brake,
            Setpoint::ConstantPower(power) => Activity::Power(power),
            Setpoint::Current { current, speed_limit } => Activity::Current { current, speed_limit },
            Setpoint::Velocity(target) if target == CountsPerSecond::ZERO && floats => Activity::Coast,
            Setpoint::Velocity(target) => Activity::Regulate(Demand::Velocity(target)),
            Setpoint::Position { target, speed_limit, .. } => {
                Activity::Regulate(Demand::Position { target, speed_limit })
            }
            Setpoint::Together(reference) => Activity::Regulate(Demand::Follow(reference)),
            Setpoint::Identify { .. } => Activity::Identify,
        }
    }

    /// The activity of a motor at fault.
    const fn on_fault(&self) -> Activity {
        match self.settings.on_fault {
            OnFault::Coast => Activity::Coast,
            OnFault::Brake => Activity::Brake,
        }
    }

    /// Computes the request of this tick; `None` for an open bridge. `moved` is the counts since the last tick; `None`
    /// without a reading.
    fn request(&mut self, battery: Option<Millivolts>, moved: Option<i32>) -> Option<Request> {
        self.changed = false;
        let velocity = self.regulator.velocity();
        // A bridge at fault can neither drive nor brake.
        let battery = battery.filter(|_| !self.bridge_fault);
        let at =
            battery.and_then(|battery| OperatingPoint::new(self.settings.winding.emf.emf(velocity), battery));
        let mut activity = if at.is_some() { self.activity(moved) } else { Activity::Coast };
        let mut request = at.and_then(|at| self.request_of(activity, at, moved));
        if let (Activity::Regulate(_), Some(at), true) = (activity, at, self.check.fault().is_some()) {
            // This tick has found the fault.
            activity = self.on_fault();
            request = self.request_of(activity, at, moved);
        }
        if !self.setpoint.is_regulated() {
            self.check.pause();
        } else if !matches!(activity, Activity::Regulate(_)) {
            self.check.interrupt();
        }
        request
    }

    /// Computes the request of an activity; `None` for an open bridge.
    fn request_of(&mut self, activity: Activity, at: OperatingPoint, moved: Option<i32>) -> Option<Request> {
        let (control, modulation) = match activity {
            Activity::Coast => return None,
            Activity::Brake => (Some(Control::ZERO), Modulation::full_braking(at)),
            Activity::Power(power) => (Some(power), self.modulator.open_loop(at, power)),
            Activity::Current { current, speed_limit } => {
                let volts = at.emf_volts() + current.to_amperes() * self.settings.ohms();
                let voltage = self.regulator.limit_speed(Voltage::from_volts(volts), speed_limit, at);
                (None, self.modulator.for_voltage(at, voltage))
            }
            Activity::Regulate(demand) => return self.regulate(demand, at, moved?),
            // The identification has its own check of the encoder: an unknown motor may only travel so far without
            // counts.
            Activity::Identify => {
                let voltage =
                    self.identifier.step(self.settings.winding.emf, at.battery_volts(), self.period)?;
                (None, self.modulator.for_voltage(at, voltage))
            }
        };
        Some(Request { at, modulation, control, target: None })
    }

    /// Computes the request of the regulator, or of the encoder check if the encoder is in doubt. `None` for an open
    /// bridge, because this tick has found a fault of the encoder.
    fn regulate(&mut self, demand: Demand, at: OperatingPoint, moved: i32) -> Option<Request> {
        let context =
            Context { settings: &self.settings, modulator: &self.modulator, period: self.period, at };
        let regulated = self.command.as_ref().and_then(|command| Some((command, command.request.target?)));
        let finding = regulated.map_or(Finding::Sound, |(command, target)| {
            let (context, regulator, position) = (&context, &self.regulator, self.position);
            self.check.step(&Tick { context, regulator, command, target, position, moved })
        });
        let (mut speed, mut hunts) = (self.regulator.demanded_speed(demand), false);
        let (control, modulation) = match finding {
            Finding::Fault => return None,
            Finding::FullReverse(control) => (Some(control), Modulation::full_reverse(at)),
            Finding::Release => (Some(Control::ZERO), Modulation::full_braking(at)),
            // The speed is in doubt, so the probe is in open loop.
            Finding::Probe(control) => (Some(control), self.modulator.open_loop(at, control)),
            Finding::Sound => {
                let output = self.regulator.step(demand, moved, &context);
                (speed, hunts) = (output.speed, output.hunts);
                match output.effort {
                    Effort::Voltage(voltage) => (None, self.modulator.for_voltage(at, voltage)),
                    Effort::Control(control) => (Some(control), self.modulator.for_control(at, control)),
                }
            }
        };
        if hunts && let Some(settings) = self.configured.lowered(&self.settings) {
            self.settings = settings;
            self.regulator.correct_emf(&self.settings, self.period);
        }
        Some(Request { at, modulation, control, target: Some(speed) })
    }

    /// Limits a request, commands the bridge, and passes the applied voltage to the estimators. Returns the control value
    /// and the mean voltage; no voltage while the bridge is open.
    fn apply(&mut self, request: Option<Request>) -> (Control, Option<Voltage>) {
        let before = self.drive();
        let Some(request) = request else {
            self.command = None;
            self.pulses.stop();
            self.regulator.drive(None);
            self.identifier.drive(None);
            return (Control::ZERO, None);
        };
        let (command, voltage) = self.modulate(request, false);
        let (control, mean) = (command.control(&self.modulator), command.voltage);
        self.command = Some(command);
        let voltage = self.note_voltage(voltage, before);
        (control, voltage.map(|voltage| if self.pulses.are_active() { mean } else { voltage }))
    }

    /// Passes the voltage that the new command applies to the estimators, and returns this voltage; `None` if the bridge
    /// is open. `before` is the command that was replaced.
    fn note_voltage(&mut self, voltage: Voltage, before: Drive) -> Option<Voltage> {
        let closed = self.drive() != Drive::COAST;
        let voltage = if closed { self.after_change(voltage, before) } else { voltage };
        self.regulator.drive(closed.then_some(voltage));
        // A limit that opens the bridge for a moment does not end an identification.
        self.identifier.drive(Some(voltage));
        closed.then_some(voltage)
    }

    /// Computes the command for a request within all limits, and the voltage that the bridge applies.
    fn modulate(&mut self, request: Request, may_end_short: bool) -> (Command, Voltage) {
        let Request { at, modulation: mut limited, .. } = request;
        let mut voltage = self.modulator.applied(at, limited);
        let allowed = self.limits(at).clamp(voltage.to_volts());
        if allowed.to_bits() != voltage.to_volts().to_bits() {
            limited = self.modulator.for_voltage(at, Voltage::from_volts(allowed));
            voltage = self.modulator.applied(at, limited);
        }
        let duty = limited.drive.duty;
        let returns = limited.regime == Regime::Braking && duty != Duty::ZERO && duty != Duty::ONE;
        let (modulation, applied) = if !returns {
            self.pulses.stop();
            (limited, voltage)
        } else if self.supply.dissipate == Share::NONE {
            self.pulses.pause(self.supply.from);
            (limited, voltage)
        } else {
            self.burn(at, voltage, may_end_short)
        };
        (Command { request, limited, voltage, modulation }, applied)
    }

    /// The voltages that all limits together allow.
    fn limits(&self, at: OperatingPoint) -> VoltageLimits {
        let (emf, ohms) = (at.emf_volts(), self.settings.ohms());
        let mut limits = VoltageLimits::by_draw(emf, at.battery_volts(), self.supply.draw);
        if let Some(amperes) = self.thermal.ceiling(self.settings.thermal) {
            limits = limits.and(VoltageLimits::by_driving_current(emf, amperes, ohms));
        }
        if let Some(amperes) = self.settings.current_limit_amperes() {
            limits = limits.and(VoltageLimits::by_current(emf, amperes, ohms));
        }
        limits
    }

    /// True if the current limit holds the current below the requested one.
    fn is_current_limited(&self) -> bool {
        let (Some(command), Some(limit)) = (&self.command, self.settings.current_limit_amperes()) else {
            return false;
        };
        let current = (command.voltage.to_volts() - command.request.at.emf_volts()) / self.settings.ohms();
        command.is_limited() && current.abs() > 0.98 * limit
    }

    /// Chooses the burn pulse of a motor that should have the mean voltage `mean`. Returns the modulation of the pulse and
    /// its voltage.
    fn burn(&mut self, at: OperatingPoint, mean: Voltage, may_end_short: bool) -> (Modulation, Voltage) {
        let SupplyLimits { draw, dissipate, bus, from } = self.supply;
        let now =
            OperatingPoint::new(self.settings.winding.emf.emf(self.regulator.velocity()), bus).unwrap_or(at);
        let emf = now.emf_volts();
        let ForwardPulse { least, most } = FORWARD_PULSE;
        let beyond = least + (most - least) * dissipate.to_f32();
        let room = now.battery_volts() - emf.abs();
        self.pulses.integrate(from);
        let (pulse, modulation) = match self.pulses.next(emf, may_end_short) {
            Pulse::Forward if draw == Share::ALL && room > least * emf.abs() => {
                let volts = emf + (beyond * emf.abs()).min(room).copysign(emf);
                (Pulse::Forward, self.modulator.for_voltage(now, Voltage::from_volts(volts)))
            }
            _ => (Pulse::Short, Modulation::full_braking(now)),
        };
        let applied = self.modulator.applied(now, modulation);
        let voltages = Voltages { requested: mean.to_volts(), applied: applied.to_volts(), emf };
        self.pulses.apply(pulse, voltages, self.settings.bridge.timing().change_us);
        (modulation, applied)
    }

    /// The mean voltage of a period that begins with a change of the bridge's mode. The bridge is open during the change.
    fn after_change(&self, voltage: Voltage, before: Drive) -> Voltage {
        let change_us = self.settings.bridge.timing().change_us;
        if self.drive().mode == before.mode || change_us == 0 {
            return voltage;
        }
        let emf = self.settings.winding.emf.emf(self.regulator.velocity()).to_volts();
        // A burn pulse is chosen every millisecond, in us.
        let period_us = if self.pulses.are_active() { 1_000.0 } else { self.period.as_micros() as f32 };
        let left = (1.0 - f32::from(change_us) / period_us).max(0.0);
        Voltage::from_volts(emf + left * (voltage.to_volts() - emf))
    }

    /// The current that a voltage drives through winding and bridge against the back EMF of a speed.
    fn current(&self, voltage: Voltage, speed: CountsPerSecond) -> Milliamperes {
        let emf = self.settings.winding.emf.emf(speed).to_volts();
        Milliamperes::from_amperes((voltage.to_volts() - emf) / self.settings.ohms())
    }

    /// Steps thermal model and settle detector, and reports. `voltage` is the mean voltage; `None` while the bridge is
    /// open.
    fn report(
        &mut self,
        battery: Option<Millivolts>,
        moved: Option<i32>,
        control: Control,
        voltage: Option<Voltage>,
    ) -> Report {
        let velocity = self.regulator.velocity();
        let drive = self.drive();
        let current = voltage.map_or(Milliamperes::ZERO, |voltage| self.current(voltage, velocity));
        let speed_known = moved.is_some() && self.check.fault().is_none();
        self.modelled = speed_known.then_some(current);
        let measured = self.line.measured(drive.mode);
        let heating = if self.pulses.are_active() {
            Milliamperes::from_amperes(self.pulses.heating() / self.settings.ohms())
        } else {
            current
        };
        self.thermal.step(self.settings.thermal, self.period, measured.unwrap_or(heating));
        let current_limited = self.is_current_limited();
        let within_tolerance = self.setpoint.is_within_tolerance(self.position);
        Report {
            setpoint: self.setpoint,
            position: self.position,
            velocity,
            regulator: Kind::of(&self.settings),
            current,
            measured,
            sense_line: self.line.condition(),
            heat: (1000.0 * self.thermal.heat(self.settings.thermal)) as u16,
            derated: self.thermal.ceiling(self.settings.thermal).is_some(),
            current_limited,
            load: self.regulator.load().map(|voltage| self.current(voltage, CountsPerSecond::ZERO)),
            control,
            regime: self.command.map(|command| command.limited.regime),
            drive,
            settled: self.settle_detector.step(within_tolerance, velocity, self.period),
            // A small current limit leaves no evidence of the encoder, so a motor without counts counts as stalled.
            stalled: self.check.is_stalled() || current_limited && self.regulator.is_stalled(),
            identification: self.identifier.state(),
            faults: Faults {
                battery_unknown: battery.is_none(),
                encoder_stale: moved.is_none(),
                encoder: self.check.fault(),
                overheated: self.thermal.is_cut(),
                bridge: self.bridge_fault,
            },
        }
    }
}
