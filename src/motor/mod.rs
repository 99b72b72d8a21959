//! One motor: its settings, its set-point, its state, and one step of control.
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
//! // It comes to 300 counts/s and stays there: the counters are read every millisecond, a tick comes every 50.
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

mod burn_pulses;
mod limits;
mod report;
mod sense_line;
mod setpoint;
mod settled;
mod thermal;
mod watch;

pub use report::{Faults, Report, best_current};
pub use sense_line::SenseLine;
pub use setpoint::Setpoint;
pub use settled::{SettleDetector, within_tolerance};

use crate::braking::{Modulation, Modulator, OperatingPoint, Regime, Returned, Scheme};
use crate::bridge::{BridgeFeedback, Drive};
use crate::motion::Reading;
use crate::motion::guard::{Evidence, Finding, Order};
use crate::regulator::identify::{Identifier, Refusal};
use crate::regulator::{Context, Demand, Effort, Kind, Regulator};
pub use crate::settings::{OnFault, Settings, ThermalLimit, ZeroPower};
use crate::units::{
    Control, CountsPerSecond, Duty, Micros, Milliamperes, Millivolts, Period, Share, Voltage,
};
use burn_pulses::{BurnPulses, Pulse, Voltages};
use core::mem::discriminant;
pub(crate) use limits::SupplyLimits;
use limits::VoltageLimits;
use sense_line::Line;
use thermal::Thermal;
use watch::Watch;

/// Age in us from which on a reading counts as missing: the counters are sampled every millisecond.
pub const ENCODER_STALE_MICROS: u64 = 20_000;

/// Least and largest share of the back EMF by which a pulse of [`Pulse::Drive`] drives a motor beyond it. The least draws from
/// the bus what the winding returns when a short ends.
const BEYOND_EMF: (f32, f32) = (0.1, 0.3);

/// The reading, unless it is too old.
pub(crate) fn fresh(reading: Option<Reading>, now: Micros) -> Option<Reading> {
    reading.filter(|reading| now.since(reading.at) <= ENCODER_STALE_MICROS)
}

/// Settings, set-point and state of one motor.
#[derive(Clone, Debug)]
pub struct Motor {
    settings: Settings,
    /// Maps voltages and control values to commands by the settings.
    modulator: Modulator,
    period: Period,
    setpoint: Setpoint,
    /// Set-point or settings have changed since the last bridge command.
    changed: bool,
    /// Counts at the last tick.
    position: i32,
    regulator: Regulator,
    identifier: Identifier,
    watch: Watch,
    settle_detector: SettleDetector,
    thermal: Thermal,
    supply: SupplyLimits,
    pulses: BurnPulses,
    /// What the last tick requested, and what is left of that now; `None` while the bridge is open.
    command: Option<Command>,
    /// The current-sense line of the bridge.
    line: Line,
    /// Current by the motor's constants at the last tick; `None` if the speed was not known.
    modelled: Option<Milliamperes>,
    /// The bridge has reported a fault; latched.
    bridge_fault: bool,
}

/// What the motor does at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Activity {
    /// The bridge is open.
    Coast,
    /// The bridge shorts the winding.
    Brake,
    /// Open loop at this share of the control range.
    Power(Control),
    /// A constant current, up to a speed.
    Current { current: Milliamperes, speed_limit: CountsPerSecond },
    /// Closed loop.
    Regulate(Demand),
    /// The motion of an identification.
    Identify,
}

/// What a tick requests of the bridge, before limits.
#[derive(Clone, Copy, Debug)]
struct Request {
    /// Speed and battery voltage of the tick.
    at: OperatingPoint,
    modulation: Modulation,
    /// The control value, where the request came as one.
    control: Option<Control>,
    /// The speed that a regulator wants.
    target: Option<CountsPerSecond>,
}

/// A request, and what is left of it.
#[derive(Clone, Copy, Debug)]
struct Command {
    at: OperatingPoint,
    requested: Modulation,
    /// The request within all limits.
    limited: Modulation,
    /// The voltage that `limited` makes.
    voltage: Voltage,
    /// The command of the bridge: `limited`, or the present burn pulse.
    given: Modulation,
}

impl Motor {
    /// Creates a disabled motor that is stepped every `period`.
    pub fn new(settings: Settings, period: Period) -> Self {
        Self {
            settings,
            modulator: settings.modulator(),
            period,
            setpoint: Setpoint::Disabled,
            changed: false,
            position: 0,
            regulator: Regulator::new(&settings, period),
            identifier: Identifier::default(),
            watch: Watch::new(period),
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

    /// Replaces all settings at the next step. State is kept, so that a motor may be tuned while it runs.
    pub fn configure(&mut self, settings: Settings) {
        self.regulator.configure(&self.settings, &settings, self.period);
        self.settings = settings;
        self.changed = true;
        self.modulator = settings.modulator();
        if settings.thermal.is_none() {
            self.thermal.clear(None);
        }
    }

    /// Replaces the set-point at the next step, or with `act`. Disabling the motor ends a latched fault, and so does
    /// fail-safe.
    pub fn set(&mut self, setpoint: Setpoint) {
        self.changed |= setpoint != self.setpoint;
        let follows = matches!((self.setpoint, setpoint), (Setpoint::Together(_), Setpoint::Together(_)));
        if setpoint != self.setpoint && !follows {
            self.regulator.retarget();
            self.settle_detector.reset();
            if discriminant(&setpoint) != discriminant(&self.setpoint) {
                self.regulator.change_mode();
            }
            if self.watch.retarget() {
                self.regulator.leave_stop();
            } else if self.setpoint == Setpoint::ConstantPower(Control::ZERO) {
                // The current of a brake is of no use for what comes.
                self.regulator.start_at_zero_current();
            } else if !self.setpoint.is_regulated() {
                self.regulator.resume();
            }
        }
        if matches!(setpoint, Setpoint::Disabled | Setpoint::FailSafe) {
            self.watch.clear();
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

    /// The motor's group has another target.
    pub(crate) fn retarget(&mut self) {
        self.regulator.retarget();
        if self.watch.retarget() {
            self.regulator.leave_stop();
        }
    }

    /// The estimated speed.
    pub(crate) fn velocity(&self) -> CountsPerSecond {
        self.regulator.velocity()
    }

    /// The settings in force.
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Takes a sample of the encoder between two ticks, best every millisecond: the more samples, the better the estimate.
    pub fn sample(&mut self, reading: Reading) {
        self.identifier.sample(&reading);
        self.regulator.sample(reading);
        let Self { watch, regulator, .. } = self;
        watch.sample(&reading, || regulator.disturbance());
    }

    /// Takes what the bridge reports, on a board that can read it.
    pub fn sense(&mut self, sensed: BridgeFeedback) {
        self.bridge_fault |= sensed.fault;
        let mode = (!self.pulses.are_active()).then_some(self.drive().mode);
        self.line.step(sensed.current, mode, self.modelled);
    }

    /// One control tick: estimate, decide, limit, modulate, report. `reading` is the newest, whether or not it was a sample
    /// before.
    pub fn step(&mut self, now: Micros, reading: Option<Reading>, battery: Option<Millivolts>) -> Report {
        let moved = fresh(reading, now).map(|reading| self.follow(reading));
        self.regulator.predict_until(now);
        let request = self.request(battery, moved);
        let (control, voltage) = self.apply(request);
        self.report(battery, moved, control, voltage)
    }

    /// Executes between two ticks a command that no regulator stands behind: an open bridge and open-loop power need no
    /// tick. Returns true if the bridge's command has changed.
    pub(crate) fn act(&mut self, battery: Option<Millivolts>) -> bool {
        if !self.changed || !self.setpoint.is_direct() {
            return false;
        }
        let before = self.drive();
        let request = self.request(battery, None);
        self.apply(request);
        self.drive() != before
    }

    /// Limits the present command to what the supply allows from now on. Returns true if the bridge's command has changed.
    /// One motor at a time may end a short of its burn pulses, because the energy of its winding then returns; `turn` says
    /// whether this motor may, and becomes false if it did.
    pub(crate) fn limit_supply(&mut self, limits: SupplyLimits, turn: &mut bool) -> bool {
        self.supply = limits;
        let Some(Command { at, requested, .. }) = self.command else { return false };
        let (before, drove) = (self.drive(), self.pulses.drives());
        let (command, voltage) = self.modulate(at, requested, *turn);
        self.command = Some(command);
        *turn &= drove || !self.pulses.drives();
        let changed = self.drive() != before;
        if changed || self.pulses.are_active() {
            self.note_voltage(voltage, before);
        }
        changed
    }

    /// The bridge's command.
    pub(crate) const fn drive(&self) -> Drive {
        match &self.command {
            Some(command) => command.given.drive,
            None => Drive::COAST,
        }
    }

    /// Where the motor's energy goes while it brakes by the present command.
    pub(crate) fn returned(&self) -> Returned {
        match &self.command {
            Some(Command { at, given, .. }) if given.drive != Drive::COAST => {
                let applied = self.modulator.applied(*at, *given);
                self.modulator.returned(*at, *given, applied, self.settings.ohms())
            }
            _ => Returned::NONE,
        }
    }

    /// Takes a reading; returns the counts since the last tick.
    fn follow(&mut self, reading: Reading) -> i32 {
        let moved = reading.position.wrapping_sub(self.position);
        self.position = reading.position;
        self.sample(reading);
        self.regulator.tick();
        // An identification keeps an account of voltages, for which the constants must not change meanwhile.
        if !matches!(self.setpoint, Setpoint::Identify { .. }) {
            self.regulator.update_gain(&self.settings, self.period);
        }
        moved
    }

    /// What the motor does at this tick. `moved` is the counts since the last tick; `None` without an encoder.
    ///
    /// A fault of the motor, its encoder or its host ends what the set-point requests, and the motor does as
    /// [`OnFault`] says. (Without a battery or with a bridge at fault every motor coasts.)
    fn activity(&self, moved: Option<i32>) -> Activity {
        let floats = self.settings.zero_power == ZeroPower::Float;
        let needs_encoder = !self.setpoint.is_direct();
        let no_encoder = moved.is_none() || self.watch.fault().is_some();
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

    const fn on_fault(&self) -> Activity {
        match self.settings.on_fault {
            OnFault::Coast => Activity::Coast,
            OnFault::Brake => Activity::Brake,
        }
    }

    /// What this tick requests of the bridge; `None` for an open bridge.
    fn request(&mut self, battery: Option<Millivolts>, moved: Option<i32>) -> Option<Request> {
        self.changed = false;
        let velocity = self.regulator.velocity();
        // A bridge at fault cannot brake either.
        let battery = battery.filter(|_| !self.bridge_fault);
        let at =
            battery.and_then(|battery| OperatingPoint::new(self.settings.winding.emf.emf(velocity), battery));
        let mut activity = if at.is_some() { self.activity(moved) } else { Activity::Coast };
        let mut request = at.and_then(|at| self.perform(activity, at, moved));
        if let (Activity::Regulate(_), Some(at), true) = (activity, at, self.watch.fault().is_some()) {
            // This tick has found the fault.
            activity = self.on_fault();
            request = self.perform(activity, at, moved);
        }
        if !self.setpoint.is_regulated() {
            self.watch.pause();
        } else if !matches!(activity, Activity::Regulate(_)) {
            self.watch.interrupt();
        }
        request
    }

    fn perform(&mut self, activity: Activity, at: OperatingPoint, moved: Option<i32>) -> Option<Request> {
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
            // The identification watches the encoder itself: of an unknown motor nobody can say when counts are due, only
            // how far it may go without any.
            Activity::Identify => {
                let voltage =
                    self.identifier.step(self.settings.winding.emf, at.battery_volts(), self.period)?;
                (None, self.modulator.for_voltage(at, voltage))
            }
        };
        Some(Request { at, modulation, control, target: None })
    }

    /// The regulator's request, unless the encoder is in doubt.
    fn regulate(&mut self, demand: Demand, at: OperatingPoint, moved: i32) -> Option<Request> {
        let evidence = self.watch.ordered().map(|order| Evidence {
            order,
            moved,
            velocity: self.regulator.velocity(),
            battery: at.battery_volts(),
            gain: self.regulator.least_gain(),
            volt: self.regulator.gain(),
            emf: self.settings.winding.emf,
            // By PID the end of the control range may be less than full reverse.
            gentle: matches!(self.settings.scheme, Scheme::C | Scheme::D(_)),
            probing: self.settings.probing,
        });
        let mut speed = self.regulator.demanded_speed(demand);
        let (control, modulation) = match evidence
            .map_or(Finding::Sound, |evidence| self.watch.step(&evidence))
        {
            Finding::Fault(_) => return None,
            Finding::Insist(control) => (Some(control), Modulation::full_reverse(at)),
            Finding::Release => (Some(Control::ZERO), Modulation::full_braking(at)),
            // The speed is in doubt, so this is open loop.
            Finding::Probe(control) => (Some(control), self.modulator.open_loop(at, control)),
            Finding::Sound | Finding::Stalled => {
                let context =
                    Context { settings: &self.settings, modulator: &self.modulator, period: self.period, at };
                let output = self.regulator.step(demand, moved, &context);
                speed = output.speed;
                match output.effort {
                    Effort::Voltage(voltage) => (None, self.modulator.for_voltage(at, voltage)),
                    Effort::Control(control) => (Some(control), self.modulator.for_control(at, control)),
                }
            }
        };
        Some(Request { at, modulation, control, target: Some(speed) })
    }

    /// Limits a request, commands the bridge, and notes what the motor now has. Returns the control value and the voltage;
    /// no voltage while the bridge is open.
    fn apply(&mut self, request: Option<Request>) -> (Control, Option<Voltage>) {
        let before = self.drive();
        let Some(Request { at, modulation, control, target }) = request else {
            self.command = None;
            self.pulses.stop();
            self.regulator.drive(None);
            self.identifier.drive(None);
            return (Control::ZERO, None);
        };
        let (command, voltage) = self.modulate(at, modulation, false);
        self.command = Some(command);
        let Command { requested, limited, voltage: mean, .. } = command;
        let control = match control {
            Some(control) if limited == requested => control,
            _ => self.modulator.control(at, mean),
        };
        if let Some(target) = target {
            let velocity = self.regulator.velocity();
            let regime = limited.regime;
            self.watch.note(Order { target, control, regime, push: mean, velocity });
        }
        let voltage = self.note_voltage(voltage, before);
        (control, voltage.map(|voltage| if self.pulses.are_active() { mean } else { voltage }))
    }

    /// Passes the voltage that the new command applies to the estimators, and returns this voltage; `None` if the bridge
    /// is open. `before` is the command that was replaced.
    fn note_voltage(&mut self, voltage: Voltage, before: Drive) -> Option<Voltage> {
        let closed = self.drive() != Drive::COAST;
        let voltage = if closed { self.after_change(voltage, before) } else { voltage };
        self.regulator.drive(closed.then_some(voltage));
        // A limit may open the bridge for a moment, which does not end an identification.
        self.identifier.drive(Some(voltage));
        closed.then_some(voltage)
    }

    /// The command for what was requested, within all limits, and the voltage that the bridge then makes.
    fn modulate(&mut self, at: OperatingPoint, requested: Modulation, turn: bool) -> (Command, Voltage) {
        let mut limited = requested;
        let mut voltage = self.modulator.applied(at, requested);
        let allowed = self.limits(at).clamp(voltage.to_volts());
        if allowed.to_bits() != voltage.to_volts().to_bits() {
            limited = self.modulator.for_voltage(at, Voltage::from_volts(allowed));
            voltage = self.modulator.applied(at, limited);
        }
        let duty = limited.drive.duty;
        let returns = limited.regime == Regime::Braking && duty != Duty::ZERO && duty != Duty::ONE;
        let (given, applied) = if !returns {
            self.pulses.stop();
            (limited, voltage)
        } else if self.supply.dissipate == Share::NONE {
            self.pulses.pause(self.supply.from);
            (limited, voltage)
        } else {
            self.burn(at, voltage, turn)
        };
        (Command { at, requested, limited, voltage, given }, applied)
    }

    /// The voltages that the motor may have at this tick.
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

    /// True if the current limit is in force at this moment.
    fn is_current_limited(&self) -> bool {
        let (Some(command), Some(limit)) = (&self.command, self.settings.current_limit_amperes()) else {
            return false;
        };
        let current = (command.voltage.to_volts() - command.at.emf_volts()) / self.settings.ohms();
        command.limited != command.requested && current.abs() > 0.98 * limit
    }

    /// The burn pulse of a motor that is to have a braking voltage on the mean, and the voltage of the pulse.
    fn burn(&mut self, at: OperatingPoint, mean: Voltage, turn: bool) -> (Modulation, Voltage) {
        let SupplyLimits { draw, dissipate, bus, from } = self.supply;
        let now =
            OperatingPoint::new(self.settings.winding.emf.emf(self.regulator.velocity()), bus).unwrap_or(at);
        let emf = now.emf_volts();
        let (least, most) = BEYOND_EMF;
        let beyond = least + (most - least) * dissipate.to_f32();
        let room = now.battery_volts() - emf.abs();
        self.pulses.account(from);
        let (pulse, modulation) = match self.pulses.next(emf, turn) {
            Pulse::Drive if draw == Share::ALL && room > least * emf.abs() => {
                let volts = emf + (beyond * emf.abs()).min(room).copysign(emf);
                (Pulse::Drive, self.modulator.for_voltage(now, Voltage::from_volts(volts)))
            }
            _ => (Pulse::Short, Modulation::full_braking(now)),
        };
        let applied = self.modulator.applied(now, modulation);
        let voltages = Voltages { requested: mean.to_volts(), applied: applied.to_volts(), emf };
        self.pulses.apply(pulse, voltages, self.settings.bridge.timing().change_us);
        (modulation, applied)
    }

    /// The mean voltage of a period at whose beginning the bridge is open because its mode changes.
    fn after_change(&self, voltage: Voltage, before: Drive) -> Voltage {
        let change_us = self.settings.bridge.timing().change_us;
        if self.drive().mode == before.mode || change_us == 0 {
            return voltage;
        }
        let emf = self.settings.winding.emf.emf(self.regulator.velocity()).to_volts();
        // Burn pulses are chosen every millisecond.
        let lasts = if self.pulses.are_active() { 1_000.0 } else { self.period.as_micros() as f32 };
        let left = (1.0 - f32::from(change_us) / lasts).max(0.0);
        Voltage::from_volts(emf + left * (voltage.to_volts() - emf))
    }

    /// The current that a voltage drives through winding and bridge against the back EMF of a speed.
    fn current(&self, voltage: Voltage, speed: CountsPerSecond) -> Milliamperes {
        let emf = self.settings.winding.emf.emf(speed).to_volts();
        Milliamperes::from_amperes((voltage.to_volts() - emf) / self.settings.ohms())
    }

    /// Steps what follows from the motor's current, and reports.
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
        let speed_known = moved.is_some() && self.watch.fault().is_none();
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
            sense_line: self.line.is(),
            heat: (1000.0 * self.thermal.heat(self.settings.thermal)) as u16,
            derated: self.thermal.ceiling(self.settings.thermal).is_some(),
            current_limited,
            load: self.regulator.load().map(|voltage| self.current(voltage, CountsPerSecond::ZERO)),
            control,
            regime: self.command.map(|command| command.limited.regime),
            drive,
            settled: self.settle_detector.step(within_tolerance, velocity, self.period),
            // With little current nothing can be said of the encoder: a motor without counts counts as stalled.
            stalled: self.watch.stalled() || current_limited && self.regulator.is_stalled(),
            identification: self.identifier.state(),
            faults: Faults {
                battery_unknown: battery.is_none(),
                encoder_stale: moved.is_none(),
                encoder: self.watch.fault(),
                overheated: self.thermal.is_cut(),
                bridge: self.bridge_fault,
            },
        }
    }
}
