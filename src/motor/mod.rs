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

mod portions;
mod report;
mod sense_line;
mod setpoint;
mod settings;
mod settled;
mod supply;
mod thermal;
mod watch;

pub use report::{Faults, Report, best_current};
pub use sense_line::SenseLine;
pub use setpoint::Setpoint;
pub use settings::{OnFault, Settings, ZeroPower};
pub use settled::{SettleDetector, within_tolerance};
pub use thermal::ThermalLimit;

use crate::braking::{DutyRule, OperatingPoint, Placement, Placer, Regime, Returned, Scheme};
use crate::bridge::{Drive, Mode, Sensed, Timing};
use crate::motion::Reading;
use crate::motion::guard::{Evidence, Finding, Order};
use crate::regulator::identify::{Identifier, Refusal};
use crate::regulator::{Demand, Regulator, Stage};
use crate::units::{Control, CountsPerSecond, Micros, Milliamperes, Millivolts, Period, Voltage};
use core::mem::discriminant;
use portions::Portions;
use sense_line::Line;
pub(crate) use supply::Allowed;
use supply::{Bounds, Points};
use thermal::Thermal;
use watch::Watch;

/// A reading older than this is none: the counters are sampled every millisecond.
pub const ENCODER_STALE_MICROS: u64 = 20_000;

/// A reading that is not too old.
pub(crate) fn fresh(reading: Option<Reading>, now: Micros) -> Option<Reading> {
    reading.filter(|reading| now.since(reading.at) <= ENCODER_STALE_MICROS)
}

/// Settings, set-point and state of one motor.
#[derive(Clone, Debug)]
pub struct Motor {
    settings: Settings,
    /// As the settings have it.
    placer: Placer,
    setpoint: Setpoint,
    /// At the last tick.
    position: i32,
    /// The set-point or the settings are others than the bridge has been told by.
    untold: bool,
    regulator: Regulator,
    identifier: Identifier,
    watch: Watch,
    settle_detector: SettleDetector,
    bounds: Bounds,
    /// Speed and battery for which the last tick's placement is.
    at_tick: (CountsPerSecond, Millivolts),
    thermal: Thermal,
    period: Period,
    /// What the bridge was told last.
    mode: Mode,
    /// What shows its current, where the board has it.
    line: Line,
    /// By its constants at the last tick, if it was known how fast it turns.
    modelled: Option<Milliamperes>,
    /// It has said that it is at fault; latched.
    bridge_fault: bool,
}

/// A control value and what the bridge makes of it.
type Output = (Control, Placement);

/// What a bridge is told.
struct Told {
    /// At which it was told so.
    velocity: CountsPerSecond,
    control: Control,
    /// `None` while it is open.
    regime: Option<Regime>,
    drive: Drive,
    /// As a voltage across the motor; `None` while it is open.
    flows: Option<Voltage>,
    /// The current by which it heats, where that is another.
    heats: Option<Milliamperes>,
}

impl Motor {
    /// A disabled motor that is stepped every `period`.
    pub fn new(settings: Settings, period: Period) -> Self {
        Self {
            settings,
            placer: settings.placer(),
            setpoint: Setpoint::Disabled,
            position: 0,
            untold: false,
            regulator: Regulator::new(settings.regulation(), period),
            identifier: Identifier::new(period),
            watch: Watch::new(period),
            settle_detector: SettleDetector::new(period),
            bounds: Bounds::NONE,
            at_tick: (CountsPerSecond::ZERO, Millivolts::new(0)),
            thermal: Thermal::new(period, settings.thermal),
            period,
            mode: Drive::COAST.mode,
            line: Line::default(),
            modelled: None,
            bridge_fault: false,
        }
    }

    /// Takes effect at the next step, as a whole. State is kept, so that a motor may be tuned while it runs.
    pub fn configure(&mut self, settings: Settings) {
        self.settings = settings;
        self.untold = true;
        self.placer = settings.placer();
        self.regulator.configure(settings.regulation());
        self.thermal.configure(settings.thermal);
    }

    /// Takes effect at the next step, or with `act`. Disabling the motor ends a latched fault, and so does
    /// fail-safe.
    pub fn set(&mut self, setpoint: Setpoint) {
        self.untold |= setpoint != self.setpoint;
        let follows = matches!((self.setpoint, setpoint), (Setpoint::Together(_), Setpoint::Together(_)));
        if setpoint != self.setpoint && !follows {
            self.regulator.retarget();
            self.settle_detector.reset();
            if discriminant(&setpoint) != discriminant(&self.setpoint) {
                self.regulator.change_mode();
            }
            if self.watch.retarget() {
                self.regulator.let_go();
            } else if self.setpoint == Setpoint::ConstantPower(Control::ZERO) {
                // A brake stops a motor with a current that nothing else needs.
                self.regulator.start_afresh();
            } else if !self.setpoint.is_regulated() {
                self.regulator.take_over();
            }
        }
        if matches!(setpoint, Setpoint::Disabled | Setpoint::FailSafe) {
            self.watch.clear();
            self.thermal.clear();
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

    /// Its group is sent elsewhere.
    pub(crate) fn retarget(&mut self) {
        self.regulator.retarget();
        if self.watch.retarget() {
            self.regulator.let_go();
        }
    }

    /// The speed that it is thought to have.
    pub(crate) fn velocity(&self) -> CountsPerSecond {
        self.regulator.velocity()
    }

    /// The settings in force.
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Takes a sample of the encoder between two ticks, best every millisecond: the more of them, the better
    /// the motion is known.
    pub fn sample(&mut self, reading: Reading) {
        self.identifier.sample(&reading);
        self.regulator.sample(reading);
        let Self { watch, regulator, .. } = self;
        watch.sample(&reading, || regulator.disturbance());
    }

    /// Takes what the bridge says of itself, on a board that hears it.
    pub fn sense(&mut self, sensed: Sensed) {
        self.bridge_fault |= sensed.fault;
        let mode = self.bounds.portions().is_none().then_some(self.drive().mode);
        self.line.step(sensed.current, mode, self.modelled);
    }

    /// One control tick. `reading` is the newest, whether or not it was a sample before.
    pub fn step(&mut self, now: Micros, reading: Option<Reading>, battery: Option<Millivolts>) -> Report {
        let moved = fresh(reading, now).map(|reading| self.follow(reading));
        self.regulator.wait(now);
        let Told { velocity, control, regime, drive, flows, heats } = self.tell(battery, moved);
        let current = flows.map_or(Milliamperes::ZERO, |voltage| self.current(voltage, velocity));
        let counts = moved.is_some() && self.watch.fault().is_none();
        self.modelled = counts.then_some(current);
        let measured = self.line.measured(drive.mode);
        self.thermal.step(measured.or(heats).unwrap_or(current));
        let within_tolerance = self.setpoint.is_within_tolerance(self.position);
        Report {
            setpoint: self.setpoint,
            position: self.position,
            velocity,
            regulator: self.regulator.kind(),
            current,
            measured,
            sense_line: self.line.is(),
            heat: (1000.0 * self.thermal.heat()) as u16,
            derated: self.thermal.ceiling().is_some(),
            load: self.regulator.load().map(|voltage| self.current(voltage, CountsPerSecond::ZERO)),
            control,
            regime,
            drive,
            settled: self.settle_detector.step(within_tolerance, velocity),
            stalled: self.watch.stalled(),
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

    /// Does between two ticks what was asked for since, where no regulator comes between: an open bridge and an open
    /// loop wait for no tick. True if the bridge is told otherwise for it.
    pub(crate) fn act(&mut self, battery: Option<Millivolts>) -> bool {
        if !self.untold || !self.setpoint.is_direct() {
            return false;
        }
        let before = self.drive();
        self.tell(battery, None);
        self.drive() != before
    }

    /// What the bridge is told from now on. `moved` is the counts since the last tick, if the encoder gives any.
    fn tell(&mut self, battery: Option<Millivolts>, moved: Option<i32>) -> Told {
        self.untold = false;
        let velocity = self.regulator.velocity();
        // A bridge that is at fault cannot brake either.
        let at = battery.filter(|_| !self.bridge_fault).and_then(|battery| {
            Some((OperatingPoint::new(self.settings.winding.emf.emf(velocity), battery)?, battery))
        });
        let wanted = at.and_then(|(at, battery)| self.output(at, battery, moved));
        if !self.setpoint.is_regulated() {
            self.watch.pause();
        } else if wanted.is_none() {
            self.watch.interrupt();
        }
        let output = wanted.or_else(|| at.and_then(|(at, _)| self.fall_back(at, moved)));
        let (flows, drive) = match (at, output) {
            (Some((at, battery)), Some((_, placement))) => {
                self.at_tick = (velocity, battery);
                let Self { bounds, settings, placer, .. } = self;
                let bounded = bounds.place(placer, |bus| points(settings, at, velocity, bus), placement);
                (self.effect(at, bounded), bounded.drive)
            }
            _ => {
                self.bounds.let_go();
                (None, Drive::COAST)
            }
        };
        let flows = flows.map(|flows| self.after_change(flows, drive, velocity));
        self.regulator.drive(flows);
        // Of a bridge that is open for want of current, the back EMF.
        let emf = || Voltage::from_volts(self.settings.winding.emf.emf(velocity).to_volts());
        self.identifier.drive(output.map(|_| flows.unwrap_or_else(emf)));
        let (control, regime) =
            output.map_or((Control::ZERO, None), |(control, placement)| (control, Some(placement.regime)));
        self.mode = drive.mode;
        let (flows, heats) = match self.bounds.portions() {
            // On the mean what was asked for.
            Some(portions) => (output.map(|(_, placement)| placement.asked), Some(self.heating(portions))),
            None => (flows, None),
        };
        Told { velocity, control, regime, drive, flows, heats }
    }

    /// Takes a reading; returns the counts since the last tick.
    fn follow(&mut self, reading: Reading) -> i32 {
        let moved = reading.position.wrapping_sub(self.position);
        self.position = reading.position;
        self.sample(reading);
        self.regulator.tick();
        moved
    }

    /// The voltage that a drive makes of the motor; `None` if the bridge is open.
    fn effect(&self, at: OperatingPoint, placement: Placement) -> Option<Voltage> {
        if placement.drive == Drive::COAST {
            return None;
        }
        if let Some(flows) = self.portion() {
            return Some(flows);
        }
        // By linear current, of which the bridge has not to be spared any, the one asked for.
        let as_asked = self.setpoint.is_regulated()
            && !self.bounds.intervenes()
            && self.settings.duty == DutyRule::LinearCurrent
            && (self.placer.is_as_asked(placement) || self.settings.bridge.timing() == Timing::IDEAL);
        Some(if as_asked { placement.asked } else { self.placer.flows(at, placement) })
    }

    /// What is left of it in a period at whose beginning the bridge is open because its mode changes.
    fn after_change(&self, flows: Voltage, drive: Drive, velocity: CountsPerSecond) -> Voltage {
        let change_us = self.settings.bridge.timing().change_us;
        if drive.mode == self.mode || change_us == 0 {
            return flows;
        }
        let emf = self.settings.winding.emf.emf(velocity).to_volts();
        // Of portions observers are told anew every millisecond.
        let lasts = if self.bounds.portions().is_some() { 1_000.0 } else { self.period.as_micros() as f32 };
        let left = (1.0 - f32::from(change_us) / lasts).max(0.0);
        Voltage::from_volts(emf + left * (flows.to_volts() - emf))
    }

    /// What the supply allows from now on. True if the bridge is told otherwise for it. Of motors that brake in portions one
    /// at a time may end its short, for then its winding's energy returns; it has had its turn then.
    pub(crate) fn allow(&mut self, allowed: Allowed, turn: &mut bool) -> bool {
        let before = self.drive();
        let velocity = self.regulator.velocity();
        let at = self.at_tick().map(|placed| points(&self.settings, placed, velocity, allowed.bus));
        let Some(placement) = self.bounds.renew(&self.placer, at, allowed, turn) else { return false };
        // What is known of the motion must know of it too.
        if let Some(at) = at.filter(|_| placement.drive != Drive::COAST) {
            let flows = self.portion().unwrap_or_else(|| self.placer.flows(at.placed, placement));
            let flows = self.after_change(flows, placement.drive, velocity);
            self.regulator.drive(Some(flows));
            self.identifier.drive(Some(flows));
        }
        self.mode = placement.drive.mode;
        placement.drive != before
    }

    /// Across a motor that brakes in portions.
    fn portion(&self) -> Option<Voltage> {
        self.bounds.portions().map(|portions| Voltage::from_volts(portions.given()))
    }

    /// What the bridge is told now.
    pub(crate) const fn drive(&self) -> Drive {
        self.bounds.drive()
    }

    /// Where the motor's energy goes while it brakes, as the bridge is told now.
    pub(crate) fn returned(&self) -> Returned {
        let placement = self.bounds.bounded().filter(|placement| placement.drive != Drive::COAST);
        let returned = placement.zip(self.at_tick()).map(|(placement, at)| {
            let flows = self.placer.flows(at, placement);
            self.placer.returned(at, placement, flows, self.settings.ohms())
        });
        returned.unwrap_or(Returned::NONE)
    }

    /// For which the last tick's placement is.
    fn at_tick(&self) -> Option<OperatingPoint> {
        let (velocity, battery) = self.at_tick;
        OperatingPoint::new(self.settings.winding.emf.emf(velocity), battery)
    }

    /// The current by which portions of braking heat a winding.
    fn heating(&self, portions: &Portions) -> Milliamperes {
        Milliamperes::from_amperes(portions.heating() / self.settings.ohms())
    }

    /// What a voltage drives through winding and bridge against the back EMF of a speed.
    fn current(&self, voltage: Voltage, speed: CountsPerSecond) -> Milliamperes {
        let emf = self.settings.winding.emf.emf(speed).to_volts();
        Milliamperes::from_amperes((voltage.to_volts() - emf) / self.settings.ohms())
    }

    /// What the set-point asks for, or `None` to coast. `moved` is the counts since the last tick, if the
    /// encoder gives any.
    fn output(&mut self, at: OperatingPoint, battery: Millivolts, moved: Option<i32>) -> Option<Output> {
        if self.thermal.is_cut() {
            return None;
        }
        let demand = match self.setpoint {
            Setpoint::Disabled | Setpoint::FailSafe => return None,
            Setpoint::ConstantPower(power) => return self.open_loop(at, power),
            Setpoint::Velocity(target) if target == CountsPerSecond::ZERO && self.floats() => return None,
            Setpoint::Velocity(target) => Demand::Velocity(target),
            Setpoint::Position { target, speed_limit, .. } => Demand::Position { target, speed_limit },
            Setpoint::Identify { .. } => return moved.and_then(|_| self.identify(at, battery)),
            Setpoint::Together(reference) => Demand::Follow(reference),
        };
        if self.watch.fault().is_some() {
            return None;
        }
        self.regulate(demand, at, battery, moved?)
    }

    /// What is left to do for a motor that cannot do what it is asked: brake, if that is wanted of it. Nobody gets
    /// here without a battery.
    fn fall_back(&self, at: OperatingPoint, moved: Option<i32>) -> Option<Output> {
        let needs_encoder =
            self.setpoint.is_regulated() || matches!(self.setpoint, Setpoint::Identify { .. });
        let at_fault = match self.setpoint {
            Setpoint::FailSafe => true,
            Setpoint::Disabled => false,
            _ if self.thermal.is_cut() => true,
            _ => needs_encoder && (moved.is_none() || self.watch.fault().is_some()),
        };
        let brakes = at_fault && self.settings.on_fault == OnFault::Brake;
        brakes.then(|| (Control::ZERO, Placement::full_braking(at)))
    }

    /// A host that sets a power means the duty of 9/8 or 6/2, so no scheme comes between.
    fn open_loop(&self, at: OperatingPoint, power: Control) -> Option<Output> {
        if power != Control::ZERO {
            Some(self.drawing(
                at,
                self.spare(at, (power, self.placer.place_duty(Scheme::ForwardReverse, at, power))),
            ))
        } else if self.floats() {
            None
        } else {
            Some((power, Placement::full_braking(at)))
        }
    }

    /// What a control value of the regulator's makes the bridge do.
    fn place(&self, at: OperatingPoint, control: Control) -> Output {
        self.spare(at, (control, self.placer.place(at, control)))
    }

    /// The same, or what drives no more current than a hot winding may have. Braking is left as it is: a load that is
    /// let go of does more harm, and a motor that gets too hot by it is cut.
    fn spare(&self, at: OperatingPoint, output: Output) -> Output {
        match self.thermal.ceiling() {
            Some(ceiling) => self.at_most(ceiling, at, output),
            None => output,
        }
    }

    /// Driven by no more than so many amperes.
    #[inline(never)]
    fn at_most(&self, ceiling: f32, at: OperatingPoint, output: Output) -> Output {
        let emf = self.settings.winding.emf.emf(self.regulator.velocity()).to_volts();
        let most = ceiling * self.settings.ohms();
        let allowed = Voltage::from_volts((emf - most).min(0.0))..=Voltage::from_volts((emf + most).max(0.0));
        let flows = self.placer.flows(at, output.1);
        if allowed.contains(&flows) {
            return output;
        }
        let voltage = if flows < *allowed.start() { *allowed.start() } else { *allowed.end() };
        let control = self.placer.control(at, voltage);
        (control, self.placer.place(at, control))
    }

    /// What the identification asks for. It watches the encoder itself: of an unknown motor nobody can say
    /// when counts are due, only how far it may go without any.
    fn identify(&mut self, at: OperatingPoint, battery: Millivolts) -> Option<Output> {
        let voltage = self.identifier.step(self.settings.winding.emf, battery)?;
        let control = self.placer.control(at, voltage);
        Some(self.drawing(at, (control, self.placer.place(at, control))))
    }

    /// What the supply can give of it. (The control value then is the one that asks for that.)
    fn drawing(&self, at: OperatingPoint, (control, placement): Output) -> Output {
        if self.bounds.are_none() {
            return (control, placement);
        }
        let drawing = self.placer.drawing_at_most(placement, self.bounds.draw(), at);
        if drawing.drive == placement.drive {
            return (control, placement);
        }
        let asked = self.placer.flows(at, drawing);
        (self.placer.control(at, asked), Placement { asked, ..drawing })
    }

    /// The regulator's output, unless the encoder is in doubt.
    fn regulate(
        &mut self,
        demand: Demand,
        at: OperatingPoint,
        battery: Millivolts,
        moved: i32,
    ) -> Option<Output> {
        let velocity = self.regulator.velocity();
        let stage = Stage::new(&self.placer, at, battery);
        let evidence = self.watch.ordered().map(|order| Evidence {
            order,
            moved,
            velocity,
            battery: battery.to_volts(),
            gain: self.regulator.least_gain(),
            volt: self.regulator.gain(),
            emf: self.settings.winding.emf,
            gentle: matches!(self.settings.scheme, Scheme::C | Scheme::D(_)),
            probing: self.settings.probing,
        });
        let finding = evidence.map_or(Finding::Sound, |evidence| self.watch.step(&evidence));
        let mut speed = self.regulator.wanted(demand);
        let (mut control, mut placement) = match finding {
            Finding::Fault(_) => return None,
            Finding::Insist(control) => (control, Placement::full_reverse(at)),
            Finding::Release => (Control::ZERO, Placement::full_braking(at)),
            // At whatever speed: how fast it turns is what is in doubt.
            Finding::Probe(control) => {
                self.spare(at, (control, self.placer.place_duty(Scheme::ForwardReverse, at, control)))
            }
            Finding::Sound | Finding::Stalled => {
                let request = self.regulator.step(demand, moved, &stage);
                speed = request.speed;
                self.place(at, request.control)
            }
        };
        if !self.bounds.are_none() {
            (control, placement) = self.drawing(at, (control, placement));
        }
        let push = placement.asked;
        self.watch.note(Order { target: speed, control, regime: placement.regime, push, velocity });
        Some((control, placement))
    }

    fn floats(&self) -> bool {
        self.settings.zero_power == ZeroPower::Float
    }
}

/// What was placed for one speed and voltage acts at these.
fn points(settings: &Settings, placed: OperatingPoint, velocity: CountsPerSecond, bus: Millivolts) -> Points {
    let now = OperatingPoint::new(settings.winding.emf.emf(velocity), bus).unwrap_or(placed);
    Points { placed, now, change_us: settings.bridge.timing().change_us }
}
