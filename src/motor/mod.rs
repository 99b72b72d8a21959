//! One motor: its settings, its set-point, its state, and one step of control.
//!
//! A tick ([`Motor::step`]) computes the bridge's command from the newest reading of the encoder:
//!
//! ```text
//! set-point ─▶ faults ─┬─ disabled ───────────────────────────▶ bridge open
//!                      ├─ fail-safe, constant power ─────┐
//!                      ├─ current ─ winding's equation ──┤
//! reading ─▶ regulator ┼─ regulated ─ encoder check ─────┼▶ Request ─▶ limits ─▶ modulator ─▶ bridge
//!            identifier┴─ identify ──────────────────────┘                         │
//!                ▲                                                                 │
//!                └──────────────────────── applied voltage ◀───────────────────────┘
//! ```
//!
//! * *State* (`MotorState`): what drives the motor. The state owns the encoder check or the identification.
//! * *Request*: the command that a set-point asks for, before limits. A fault replaces the set-point first.
//! * *Command*: the request, the request within all limits, and what the bridge executes.
//! * *Direct set-point*: a set-point that needs no encoder. It commands the bridge without waiting for the next tick.
//! * *Burn pulses*: braking that returns no energy to the bus (see `burn_pulses`).
//!
//! ```
//! use motor_hub::braking::{Regime, Winding};
//! use motor_hub::motion::Reading;
//! use motor_hub::motor::{Motor, Setpoint, Settings};
//! use motor_hub::supply::Battery;
//! use motor_hub::units::{CountsPerSecond, Micros, Millivolts, Period};
//!
//! let settings = Settings::new(Winding::NEVEREST_60);
//! let mut motor = Motor::new(settings, Period::DEFAULT);
//! motor.set(Setpoint::Velocity(CountsPerSecond::new(1_000)));
//!
//! let battery = |at| Some(Battery::unlimited(Millivolts::new(12_000), at));
//! let reading = |ms: u64, position| {
//!     let at = Micros::new(1_000 * ms);
//!     Reading { position, edge_at: at, at }
//! };
//! let newest = reading(50, 0);
//! let standing = motor.step(newest.at, Some(newest), battery(newest.at));
//! assert_eq!(standing.regime, Some(Regime::Forward));
//! // The motor turns at 300 counts/s. The counters are read every millisecond, and a tick comes every 50 ms.
//! let mut turning = standing;
//! for ms in 51..=550 {
//!     let newest = reading(ms, (ms as i32 - 50) * 3 / 10);
//!     match ms % 50 {
//!         0 => turning = motor.step(newest.at, Some(newest), battery(newest.at)),
//!         _ => motor.sample(&newest),
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

use crate::braking::{BrakingPower, Modulation, Modulator, OperatingPoint};
use crate::bridge::{BridgeFeedback, Drive, Mode};
use crate::motion::Reading;
use crate::regulator::identify::{Identification, Identifier, Refusal};
use crate::regulator::{Context, Demand, Effort, Kind, Regulator, Transition};
pub use crate::settings::{OnFault, Settings, ThermalLimit, ZeroPower};
use crate::supply::Battery;
use crate::units::{Control, CountsPerSecond, Duty, Micros, Milliamperes, Period, Share, Voltage};
use back_emf::Configured;
use burn_pulses::BurnPulses;
use core::mem::discriminant;
use encoder_check::EncoderCheck;
use expected::Tick;
use last_motion::LastMotion;
use limits::VoltageLimits;
use sense_line::SenseLineMonitor;
use thermal::Thermal;

/// Largest age in us of a reading that is used; an older reading is treated as missing. The counters are sampled
/// every millisecond.
pub const ENCODER_STALE_MICROS: u64 = 20_000;

/// The reading; `None` if the reading is older than [`ENCODER_STALE_MICROS`].
pub(crate) fn fresh(reading: Option<Reading>, now: Micros) -> Option<Reading> {
    reading.filter(|reading| now.since(reading.at) <= ENCODER_STALE_MICROS)
}

/// Settings, set-point and state of one motor.
#[derive(Clone, Debug)]
pub struct Motor {
    /// Settings in force. They differ from the configured settings if `configured` has corrected winding and dynamics.
    settings: Settings,
    /// Configured constants, and their corrections for a warm motor and for a speed that hunts.
    configured: Configured,
    /// Converts voltages and control values to commands of the bridge, with the constants in force.
    modulator: Modulator,
    /// Time between two ticks.
    period: Period,
    setpoint: Setpoint,
    /// True if set-point or settings have changed since a request was last computed.
    changed: bool,
    /// Position at the last tick with a fresh reading, in counts.
    position: i32,
    regulator: Regulator,
    state: MotorState,
    /// State or result of the last identification.
    identification: Identification,
    /// Last motion of the shaft. The encoder check reads this state.
    last_motion: LastMotion,
    /// Fault that the encoder check has found. The fault is latched until the set-point is [`Setpoint::Disabled`] or
    /// [`Setpoint::FailSafe`].
    encoder_fault: Option<EncoderFault>,
    settle_detector: SettleDetector,
    thermal: Thermal,
    pulses: BurnPulses,
    /// Present command; `None` while the motor coasts, because its set-point or a fault opens the bridge.
    command: Option<Command>,
    /// State of the bridge's current-sense line.
    line: SenseLineMonitor,
    /// True if the last tick had a fresh reading of an encoder without a fault. Only then is the modelled current
    /// compared with the current-sense line.
    speed_known: bool,
    /// True if the bridge has reported a fault. The fault is latched until the set-point is
    /// [`Setpoint::Disabled`] or [`Setpoint::FailSafe`].
    bridge_fault: bool,
}

/// State of a motor, with the data that only this state needs.
///
/// ```text
/// OpenLoop ◀── set-point ──▶ Regulated ◀── set-point ──▶ Identifying
///    ▲ ▲                                                    ▲  │
///    │ └──────────────────── set-point ─────────────────────┘  │
///    └────────────────── the identification has ended ─────────┘
/// ```
///
/// A fault is not a state. A motor coasts if it is disabled, if the battery voltage is unknown, or if the bridge has a
/// fault. The setting [`Settings::on_fault`] says whether a motor coasts or brakes in fail-safe, while overheated, and
/// with a set-point whose encoder is missing or at fault. Encoder, bridge and thermal faults are latched. A missing
/// reading or battery voltage is a fault only while it is missing.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "there is no heap; the lint fires on 64-bit targets only")]
enum MotorState {
    /// Nothing is regulated: the motor is disabled, in fail-safe, in open loop or at constant current. Also the state
    /// after an identification.
    OpenLoop,
    /// The set-point is a speed, a position or a reference of a group. The regulator drives the motor, or the
    /// encoder check during an examination. A fault, and [`ZeroPower::Float`] at speed 0, open the bridge or brake.
    Regulated(EncoderCheck),
    /// An identification drives the motor. The identification checks the encoder itself.
    Identifying(Identifier),
}

/// What a tick requests of the bridge, before limits.
#[derive(Clone, Copy, Debug)]
struct Request {
    /// Back EMF and battery voltage at the tick.
    at: OperatingPoint,
    /// Requested command.
    modulation: Modulation,
    /// Control value of the request; `None` if the request is a voltage.
    control: Option<Control>,
    /// Speed that the regulator should reach; `None` if the motor is not regulated.
    target: Option<CountsPerSecond>,
}

impl Request {
    /// The bridge shorts the winding.
    const fn braking(at: OperatingPoint) -> Self {
        Self { at, modulation: Modulation::BRAKE, control: Some(Control::ZERO), target: None }
    }

    /// The bridge drives the motor in open loop, at this share of the control range.
    fn open_loop(at: OperatingPoint, power: Control, modulator: &Modulator) -> Self {
        Self { at, modulation: modulator.open_loop(at, power), control: Some(power), target: None }
    }

    /// The bridge drives against the motion with duty 1, also in a scheme whose control range ends at less. Only the
    /// encoder check requests full reverse.
    fn full_reverse(at: OperatingPoint, modulator: &Modulator) -> Self {
        let end = if at.counter_clockwise() { Control::MAX } else { Control::MIN };
        let modulation = modulator.modulation(at, at.full_reverse());
        Self { at, modulation, control: Some(end), target: None }
    }
}

/// A request, and the commands that follow from it.
#[derive(Clone, Copy, Debug)]
struct Command {
    request: Request,
    /// Request within all limits.
    limited: Modulation,
    /// What the bridge executes: `limited`, or the present burn pulse. The bridge is open for a short time when its
    /// mode changes. The voltage is a mean that includes this time.
    bridge: Modulation,
}

impl Command {
    /// True if the bridge is open all the time.
    fn is_open(&self) -> bool {
        self.bridge.drive == Drive::COAST
    }

    /// Current in A that a voltage in V drives through this resistance of winding and bridge, at the back EMF of the
    /// command.
    fn amperes(&self, volts: f32, ohms: f32) -> f32 {
        (volts - self.request.at.emf_volts()) / ohms
    }

    /// True if the limits change the request.
    fn is_limited(&self) -> bool {
        self.limited.drive != self.request.modulation.drive
    }

    /// Control value of the request; `None` if the request is a voltage, or if the limits change the request.
    fn requested_control(&self) -> Option<Control> {
        self.request.control.filter(|_| !self.is_limited())
    }

    /// The control value of the command.
    fn control(&self, modulator: &Modulator) -> Control {
        self.requested_control().unwrap_or_else(|| modulator.control(self.request.at, self.limited.voltage))
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
            state: MotorState::OpenLoop,
            identification: Identification::None,
            last_motion: LastMotion::default(),
            encoder_fault: None,
            settle_detector: SettleDetector::default(),
            thermal: Thermal::default(),
            pulses: BurnPulses::NONE,
            command: None,
            line: SenseLineMonitor::default(),
            speed_known: false,
            bridge_fault: false,
        }
    }

    /// Replaces all settings. Set-point, state and the estimates of position and speed are kept, so a motor may be
    /// tuned while it runs. Settings without a thermal limit clear a thermal fault.
    ///
    /// The regulator and the limits use the new settings immediately. The request of the motor follows at the next
    /// tick, or between ticks with a direct set-point. A back EMF constant that was lowered because the speed hunted
    /// stays in force if the new settings have the same back EMF constant and the same dynamics as the old settings.
    pub fn configure(&mut self, settings: Settings) {
        // New dynamics are valid at the present temperatures, which are computed with the new thermal limit.
        self.follow_temperatures(settings.thermal);
        self.configured.configure(&settings);
        let settings = self.configured.in_force(&settings);
        self.regulator.configure(&self.settings, &settings, self.period);
        self.settings = settings;
        self.changed = true;
        self.modulator = self.configured.modulator(&settings);
        if settings.thermal.is_none() {
            self.thermal.clear(None);
        }
    }

    /// Replaces the set-point. The bridge's command changes at the next tick, or between ticks with a direct
    /// set-point.
    ///
    /// The set-points [`Disabled`](Setpoint::Disabled) and [`FailSafe`](Setpoint::FailSafe) clear latched faults. They
    /// clear a thermal fault only if the heat is at most 1000 (see [`Report::heat`]). A host must set one of them again
    /// after the winding has cooled to this heat.
    pub fn set(&mut self, setpoint: Setpoint) {
        self.changed |= setpoint != self.setpoint;
        self.transition(setpoint);
        if matches!(setpoint, Setpoint::Disabled | Setpoint::FailSafe) {
            self.encoder_fault = None;
            self.thermal.clear(self.settings.thermal);
            self.bridge_fault = false;
        }
        self.setpoint = setpoint;
    }

    /// Enters the state for the set-point `to`, and passes the transition to the regulator.
    fn transition(&mut self, to: Setpoint) {
        let from = self.setpoint;
        let follows = matches!((from, to), (Setpoint::Follow(_), Setpoint::Follow(_)));
        if to != from && !follows {
            self.settle_detector.reset();
            self.regulator.end_swings();
        }
        if to != from && !from.continues_as(to, self.position) {
            let transition = if self.end_examination() {
                Transition::FromStop
            } else if from == Setpoint::ConstantPower(Control::ZERO) {
                Transition::FromBrake
            } else if from.is_regulated() {
                if discriminant(&to) == discriminant(&from) { Transition::Target } else { Transition::Mode }
            } else if to.is_regulated() && self.regulator.is_blocked() {
                Transition::FromStop
            } else {
                Transition::FromOpenLoop
            };
            self.regulator.transition(transition);
            if let Setpoint::Current { .. } = from {
                self.regulator.discard_untrusted();
            }
        }
        match (&self.state, to) {
            (MotorState::Regulated(_), to) if to.is_regulated() => (),
            (MotorState::Identifying(_), Setpoint::Identify { .. }) if to == from => (),
            (_, Setpoint::Identify { travel_limit }) => {
                let identifier = Identifier::new(travel_limit);
                self.identification = identifier.progress();
                self.state = MotorState::Identifying(identifier);
            }
            (_, to) => {
                let check = MotorState::Regulated(EncoderCheck::new());
                self.end_identification(Identification::Refused(Refusal::Stopped));
                self.state = if to.is_regulated() { check } else { MotorState::OpenLoop };
            }
        }
    }

    /// Ends an examination of the encoder. Returns true if the motor may press against a stop, see
    /// [`EncoderCheck::end_examination`].
    const fn end_examination(&mut self) -> bool {
        match &mut self.state {
            MotorState::Regulated(check) => check.end_examination(&mut self.last_motion),
            _ => false,
        }
    }

    /// Ends an identification that runs, with this outcome.
    fn end_identification(&mut self, outcome: Identification) {
        if let MotorState::Identifying(_) = self.state {
            self.identification = outcome;
            self.state = MotorState::OpenLoop;
        }
    }

    /// Position at the last tick with a fresh reading, in counts.
    pub(crate) const fn position(&self) -> i32 {
        self.position
    }

    /// The estimated speed.
    pub(crate) fn velocity(&self) -> CountsPerSecond {
        self.regulator.velocity()
    }

    /// True if the motor has a fault that only [`Setpoint::Disabled`] or [`Setpoint::FailSafe`] clears.
    pub(crate) const fn has_latched_fault(&self) -> bool {
        self.encoder_fault.is_some() || self.thermal.is_tripped() || self.bridge_fault
    }

    /// The settings in force.
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Takes a sample of the encoder between two ticks. The estimates are best with a sample every millisecond.
    pub fn sample(&mut self, reading: &Reading) {
        if let MotorState::Identifying(identifier) = &mut self.state {
            identifier.sample(reading);
        }
        self.regulator.sample(*reading);
        self.last_motion.sample(reading, &self.regulator, self.command.as_ref());
    }

    /// Takes the feedback of the bridge, on a board that can read the feedback.
    pub fn sense(&mut self, sensed: BridgeFeedback) {
        self.bridge_fault |= sensed.fault;
        let mode = (!self.pulses.is_active()).then_some(self.drive().mode);
        let modelled = self.speed_known.then(|| self.modelled_current());
        self.line.step(sensed.current, mode, modelled);
    }

    /// Executes one control tick: estimate, decide, limit, modulate, report.
    ///
    /// `reading` is the newest reading of the encoder; [`sample`](Self::sample) may have taken the same reading before.
    /// `battery` is the state of the bus; `None` if the state is unknown or [stale](Battery::is_fresh). Without a
    /// reading or a battery the report has a fault.
    pub fn step(&mut self, now: Micros, reading: Option<Reading>, battery: Option<Battery>) -> Report {
        // Estimate position, speed and load.
        let moved = fresh(reading, now).map(|reading| self.take_reading(reading));
        self.regulator.predict_until(now);
        self.follow_temperatures(self.settings.thermal);
        // Decide.
        let request = self.request(battery.as_ref(), moved);
        // Limit and modulate.
        self.execute(request, now, battery.as_ref());
        self.report(battery.as_ref(), moved)
    }

    /// Commands the bridge between two ticks, if set-point or settings are new and the set-point is direct. Returns
    /// true if the bridge's command has changed.
    pub(crate) fn step_direct(&mut self, now: Micros, battery: Option<&Battery>) -> bool {
        if !self.changed || !self.setpoint.is_direct() {
            return false;
        }
        let before = self.drive();
        let request = self.request(battery, None);
        self.execute(request, now, battery);
        self.drive() != before
    }

    /// Limits the present command to what the state of the bus allows. Returns true if the bridge's command has
    /// changed.
    ///
    /// When a burn pulse ends a short circuit, the energy of the winding returns to the bus. So only one motor at a
    /// time may end a short circuit. `may_end_short` is true if this motor may end a short circuit. This function sets
    /// `may_end_short` to false if the motor has ended one.
    pub(crate) fn limit_supply(&mut self, now: Micros, battery: &Battery, may_end_short: &mut bool) -> bool {
        let Some(Command { request, .. }) = self.command else { return false };
        let (before, was_forward) = (self.drive(), self.pulses.is_forward());
        let command = self.modulate(request, now, battery, *may_end_short);
        *may_end_short &= was_forward || !self.pulses.is_forward();
        let changed = command.bridge.drive != before;
        if changed || self.pulses.is_active() {
            self.command_bridge(command);
        } else {
            self.command = Some(command);
        }
        changed
    }

    /// The bridge's command.
    pub(crate) const fn drive(&self) -> Drive {
        match &self.command {
            Some(command) => command.bridge.drive,
            None => Drive::COAST,
        }
    }

    /// Power that the braking motor returns to the bus, and power that winding and bridge dissipate. Both are 0 while
    /// the bridge is open.
    pub(crate) fn braking_power(&self) -> BrakingPower {
        match &self.command {
            Some(Command { request, bridge, .. }) if bridge.drive != Drive::COAST => {
                self.modulator.braking_power(request.at, *bridge, self.settings.ohms())
            }
            _ => BrakingPower::NONE,
        }
    }

    /// Takes the reading of a tick. Returns the counts since the last tick with a fresh reading.
    fn take_reading(&mut self, reading: Reading) -> i32 {
        let moved = reading.position.wrapping_sub(self.position);
        self.position = reading.position;
        self.sample(&reading);
        self.regulator.tick();
        // A new gain changes the estimated speed, and with it the duty of a constant voltage. This would disturb an
        // identification, so the gain stays while the set-point is an identification, also after its end.
        if !matches!(self.setpoint, Setpoint::Identify { .. }) {
            self.regulator.update_gain(&self.settings, self.period);
        }
        moved
    }

    /// The set-point of this tick. `moved` is the counts since the last tick with a fresh reading; `None` without a
    /// fresh reading.
    ///
    /// Fail-safe replaces the set-point if the motor is overheated, or if the set-point needs an encoder that is
    /// missing or at fault. With [`ZeroPower::Float`], constant power 0 and velocity 0 count as disabled.
    fn permitted_setpoint(&self, moved: Option<i32>) -> Setpoint {
        let no_encoder = moved.is_none() || self.encoder_fault.is_some();
        let needs_encoder = !self.setpoint.is_direct();
        let floats = self.settings.zero_power == ZeroPower::Float;
        match self.setpoint {
            Setpoint::Disabled => Setpoint::Disabled,
            _ if self.thermal.is_tripped() || needs_encoder && no_encoder => Setpoint::FailSafe,
            Setpoint::ConstantPower(Control::ZERO) if floats => Setpoint::Disabled,
            Setpoint::Velocity(target) if floats && target == CountsPerSecond::ZERO => Setpoint::Disabled,
            setpoint => setpoint,
        }
    }

    /// Computes the request of this tick; `None` for an open bridge. At a tick without regulation, ends the examination
    /// of the encoder. A fault ends an identification. `moved` is as in
    /// [`permitted_setpoint`](Self::permitted_setpoint).
    fn request(&mut self, battery: Option<&Battery>, moved: Option<i32>) -> Option<Request> {
        let emf = self.settings.winding.emf.emf(self.regulator.velocity());
        // Without a battery voltage, or with a fault of the bridge, every motor coasts.
        let battery = battery.filter(|_| !self.bridge_fault);
        let at = battery.and_then(|battery| OperatingPoint::new(emf, battery.voltage));
        let setpoint = if at.is_some() { self.permitted_setpoint(moved) } else { Setpoint::Disabled };
        if let MotorState::Identifying(_) = self.state
            && !matches!(setpoint, Setpoint::Identify { .. })
        {
            self.end_identification(Identification::Refused(Refusal::Interrupted));
        }
        if !self.setpoint.is_regulated() {
            self.last_motion.forget();
        } else if !setpoint.is_regulated() {
            self.end_examination();
            // The motor should stand. With `ZeroPower::Float` the check is not stepped then, and cannot end the stall.
            if self.setpoint == Setpoint::Velocity(CountsPerSecond::ZERO)
                && let MotorState::Regulated(check) = &mut self.state
            {
                check.end_stall();
            }
        }
        let at = at?;
        let battery = battery?;
        match setpoint {
            Setpoint::Disabled => None,
            Setpoint::FailSafe => self.on_fault(at),
            Setpoint::ConstantPower(Control::ZERO) => Some(Request::braking(at)),
            Setpoint::ConstantPower(power) => Some(Request::open_loop(at, power, &self.modulator)),
            Setpoint::Current { current, speed_limit } => {
                let volts = at.emf_volts() + current.to_amperes() * self.settings.ohms();
                let voltage = self.regulator.limit_speed(Voltage::from_volts(volts), speed_limit, at);
                Some(self.for_voltage(at, voltage))
            }
            Setpoint::Velocity(target) => self.regulate(Demand::Velocity(target), at, battery, moved?),
            Setpoint::Position { target, speed_limit, .. } => {
                self.regulate(Demand::Position { target, speed_limit }, at, battery, moved?)
            }
            Setpoint::Follow(reference) => self.regulate(Demand::Follow(reference), at, battery, moved?),
            Setpoint::Identify { .. } => {
                let voltage = self.identify(at)?;
                Some(self.for_voltage(at, voltage))
            }
        }
    }

    /// The request of a motor at fault, by the setting [`OnFault`]; `None` for an open bridge. After a brake the
    /// regulator begins with a current of zero.
    fn on_fault(&mut self, at: OperatingPoint) -> Option<Request> {
        // Repeated at every tick of the fault, because a new set-point during the fault replaces this transition.
        self.regulator.transition(Transition::FromBrake);
        if self.encoder_fault.is_some() {
            self.regulator.distrust_encoder();
        }
        (self.settings.on_fault == OnFault::Brake).then_some(Request::braking(at))
    }

    /// The request for a mean voltage across the motor.
    fn for_voltage(&self, at: OperatingPoint, voltage: Voltage) -> Request {
        Request { at, modulation: self.modulator.for_voltage(at, voltage), control: None, target: None }
    }

    /// Computes the request of a regulated motor. The encoder check is stepped first. If the check requests a command
    /// or finds a fault, the regulator is not stepped. Lowers the back EMF constant in force if the speed hunts because
    /// this constant is too high.
    fn regulate(
        &mut self,
        demand: Demand,
        at: OperatingPoint,
        battery: &Battery,
        moved: i32,
    ) -> Option<Request> {
        let standstill_volts = self.limits(0.0, at.battery_volts(), battery.draw).most();
        let Self { settings, modulator, regulator, .. } = self;
        let dissipates = battery.dissipate != Share::NONE;
        let context = Context { settings, modulator, period: self.period, at, standstill_volts, dissipates };
        if let MotorState::Regulated(check) = &mut self.state
            && let Some(command) = &self.command
            && let Some(target) = command.request.target
        {
            let tick = Tick { context: &context, regulator, command, target, moved };
            match check.step(&mut self.last_motion, &tick) {
                Ok(None) => (),
                Ok(Some(request)) => {
                    return Some(Request { target: Some(regulator.demanded_speed(demand)), ..request });
                }
                Err(fault) => {
                    self.encoder_fault = Some(fault);
                    return self.on_fault(at);
                }
            }
        }
        let output = regulator.step(demand, moved, &context);
        let (control, modulation) = match output.effort {
            Effort::Voltage(voltage) => (None, modulator.for_voltage(at, voltage)),
            Effort::Control(control) => (Some(control), modulator.for_control(at, control)),
        };
        if output.hunts && self.configured.lower_emf_constant() {
            self.correct_constants();
        }
        Some(Request { at, modulation, control, target: Some(output.speed) })
    }

    /// Steps an identification. Returns the voltage that the identification requests; `None` for an open bridge. The
    /// bridge also opens when the identification ends.
    fn identify(&mut self, at: OperatingPoint) -> Option<Voltage> {
        let MotorState::Identifying(identifier) = &mut self.state else { return None };
        let voltage = identifier.step(self.settings.winding.emf, at.battery_volts(), self.period);
        self.identification = identifier.progress();
        voltage.unwrap_or_else(|outcome| {
            self.end_identification(outcome);
            None
        })
    }

    /// Corrects the constants in force for the present temperatures by this thermal limit. During an identification the
    /// constants stay, because another back EMF constant would change the duty of a constant voltage.
    fn follow_temperatures(&mut self, limit: Option<ThermalLimit>) {
        let temperatures = self.thermal.temperatures(limit);
        if !matches!(self.state, MotorState::Identifying(_)) && self.configured.set_temperatures(temperatures)
        {
            self.correct_constants();
        }
    }

    /// Passes the corrected constants to modulator and regulator.
    fn correct_constants(&mut self) {
        self.settings = self.configured.in_force(&self.settings);
        self.modulator = self.configured.modulator(&self.settings);
        self.regulator.correct_constants(&self.settings, self.period);
    }

    /// Commands the bridge to a request within all limits, or opens the bridge without a request.
    fn execute(&mut self, request: Option<Request>, now: Micros, battery: Option<&Battery>) {
        self.changed = false;
        if let (Some(request), Some(battery)) = (request, battery) {
            let command = self.modulate(request, now, battery, false);
            let [requested, allowed] =
                [command.request.modulation, command.limited].map(|modulation| modulation.voltage.to_volts());
            self.regulator.set_excess(requested - allowed);
            self.command_bridge(command);
        } else {
            self.command = None;
            self.pulses.stop();
            self.regulator.drive(None, false);
        }
    }

    /// Commands the bridge, and passes the applied voltage to the estimators.
    fn command_bridge(&mut self, mut command: Command) {
        let open = command.is_open();
        if !open {
            command.bridge.voltage = self.after_change(command.bridge);
        }
        let Request { target, control, .. } = command.request;
        // The request of a constant current is a voltage. At a fault the motor may brake instead, by a control value.
        let is_current = control.is_none() && matches!(self.setpoint, Setpoint::Current { .. });
        let uses_speed = target.is_some() || is_current;
        self.regulator.drive((!open).then_some(command.bridge), uses_speed);
        // While a limit opens the bridge, the applied voltage is the back EMF, and the identification continues with
        // this voltage.
        if let MotorState::Identifying(identifier) = &mut self.state {
            identifier.drive(command.bridge.voltage);
        }
        self.command = Some(command);
    }

    /// Limits a request, and steps the burn pulses. The voltage of the returned [`Command::bridge`] does not yet
    /// include the time for which the bridge is open when its mode changes: see [`after_change`](Self::after_change).
    fn modulate(&mut self, request: Request, now: Micros, battery: &Battery, may_end_short: bool) -> Command {
        let Request { at, modulation, .. } = request;
        let limited = self.within_limits(modulation, at, battery.draw);
        let mut command = Command { request, limited, bridge: limited };
        let Drive { mode, duty } = limited.drive;
        let returns = mode == Mode::Brake50 && duty != Duty::ZERO && duty != Duty::ONE;
        if !returns {
            self.pulses.stop();
        } else if battery.dissipate == Share::NONE {
            self.pulses.pause(now);
        } else {
            self.dissipate(&mut command, now, battery, may_end_short);
        }
        command
    }

    /// The modulation whose voltage is within all limits and nearest to the voltage of `modulation`.
    fn within_limits(&self, modulation: Modulation, at: OperatingPoint, draw: Share) -> Modulation {
        let volts = modulation.voltage.to_volts();
        let allowed = self.limits(at.emf_volts(), at.battery_volts(), draw).clamp(volts);
        if allowed.to_bits() == volts.to_bits() {
            modulation
        } else {
            // A limit may permit less than full braking. The motor then brakes as much as the limit permits, also with
            // a scheme that has no braking regime.
            self.modulator.limited(at, Voltage::from_volts(allowed))
        }
    }

    /// The voltages that are within all limits, at a back EMF and a battery voltage.
    fn limits(&self, emf: f32, battery: f32, draw: Share) -> VoltageLimits {
        let ohms = self.settings.ohms();
        let mut limits = VoltageLimits::by_draw(emf, battery, draw);
        if let Some(amperes) = self.thermal.driving_current_limit_amperes(self.settings.thermal) {
            limits = limits.and(VoltageLimits::by_driving_current(emf, amperes, ohms));
        }
        if let Some(amperes) = self.settings.current_limit_amperes() {
            limits = limits.and(VoltageLimits::by_current(emf, amperes, ohms));
        }
        limits
    }

    /// True if a limit has changed the request, and the motor has the largest current that its current limit allows.
    fn is_current_limited(&self) -> bool {
        let (Some(command), Some(limit)) = (&self.command, self.settings.current_limit_amperes()) else {
            return false;
        };
        let Command { request: Request { at, modulation, .. }, limited, .. } = command;
        let emf = at.emf_volts();
        let most = (limit * self.settings.ohms()).copysign(modulation.voltage.to_volts() - emf);
        command.is_limited()
            && limited.drive == self.modulator.limited(*at, Voltage::from_volts(emf + most)).drive
    }

    /// The mean voltage that a new command applies. If the mode differs from the mode of the present command, the
    /// bridge is open for the time that the change takes.
    fn after_change(&self, Modulation { drive, voltage, .. }: Modulation) -> Voltage {
        let change_us = self.settings.bridge.timing.change_us;
        if drive.mode == self.drive().mode || change_us == 0 {
            return voltage;
        }
        let emf = self.settings.winding.emf.emf(self.regulator.velocity()).to_volts();
        // Time in us for which the command stays. A burn pulse is chosen every millisecond, any other command every
        // control period.
        let period_us = if self.pulses.is_active() { 1_000.0 } else { self.period.as_micros() as f32 };
        let left = (1.0 - f32::from(change_us) / period_us).max(0.0);
        Voltage::from_volts(emf + left * (voltage.to_volts() - emf))
    }

    /// The mean current of the winding by the motor's constants; 0 while the bridge is open.
    fn modelled_current(&self) -> Milliamperes {
        match &self.command {
            Some(command) if !command.is_open() => {
                let mean_volts = if self.pulses.is_active() {
                    self.pulses.mean_volts()
                } else {
                    command.bridge.voltage.to_volts()
                };
                Milliamperes::from_amperes(command.amperes(mean_volts, self.settings.ohms()))
            }
            _ => Milliamperes::ZERO,
        }
    }

    /// True if the encoder check has found a stall.
    const fn is_stalled(&self) -> bool {
        matches!(&self.state, MotorState::Regulated(check) if check.is_stalled())
    }

    /// Steps thermal model and settle detector, and reports.
    fn report(&mut self, battery: Option<&Battery>, moved: Option<i32>) -> Report {
        let (drive, velocity) = (self.drive(), self.regulator.velocity());
        let current = self.modelled_current();
        self.speed_known = moved.is_some() && self.encoder_fault.is_none();
        let measured = self.line.measured(drive.mode);
        let heating = if self.pulses.is_active() {
            Milliamperes::from_amperes(self.pulses.heating_volts() / self.settings.ohms())
        } else {
            current
        };
        self.thermal.step(self.settings.thermal, self.period, measured.unwrap_or(heating));
        let current_limited = self.is_current_limited();
        let command = self.command.as_ref();
        // During a fault the command has no target, and the motor is not regulated.
        let is_regulated = command.is_some_and(|command| command.request.target.is_some());
        let within_tolerance = is_regulated && self.setpoint.is_within_tolerance(self.position);
        Report {
            setpoint: self.setpoint,
            position: self.position,
            velocity,
            regulator: Kind::of(&self.settings),
            current,
            measured,
            sense_line: self.line.condition(),
            heat: (1000.0 * self.thermal.heat(self.settings.thermal)) as u16,
            derated: self.thermal.driving_current_limit_amperes(self.settings.thermal).is_some(),
            current_limited,
            load: self
                .regulator
                .load()
                .map(|voltage| Milliamperes::from_amperes(voltage.to_volts() / self.settings.ohms())),
            operating_point: command.map(|command| command.request.at),
            voltage: command.map_or(Voltage::ZERO, |command| command.limited.voltage),
            requested: command.and_then(Command::requested_control),
            regime: command.map(|command| command.request.at.regime(command.limited.drive)),
            drive,
            settled: self.settle_detector.step(within_tolerance, velocity, self.period),
            // At its current limit a motor may not reach the drive voltage from which the encoder check works. A motor
            // without counts is then reported as stalled.
            stalled: is_regulated
                && (self.is_stalled() || current_limited && self.regulator.is_stalled(self.period)),
            emf_constant: Some(self.settings.winding.emf),
            identification: self.identification,
            faults: Faults {
                battery_unknown: battery.is_none(),
                encoder_stale: moved.is_none(),
                encoder: self.encoder_fault,
                overheated: self.thermal.is_tripped(),
                bridge: self.bridge_fault,
            },
        }
    }
}
