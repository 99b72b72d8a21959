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
//! let mut step = |ms: u64, position| {
//!     let at = Micros::new(1_000 * ms);
//!     motor.step(at, Some(Reading { position, edge_at: at, at }), Some(Millivolts::new(12_000)))
//! };
//! let standing = step(50, 0);
//! assert_eq!(standing.regime, Some(Regime::Forward));
//! // 15 counts in 50 ms are 300 counts/s: less is missing.
//! let turning = step(100, 15);
//! assert_eq!(turning.velocity.round(), 300);
//! assert!(turning.control < standing.control);
//! ```

mod loops;
mod report;
mod setpoint;
mod settings;
mod watch;

pub use report::{Faults, Report};
pub use setpoint::Setpoint;
pub use settings::{Settings, ZeroPower};

use crate::braking::{self, OperatingPoint, Placement, Placer, Regime, Scheme};
use crate::bridge::Drive;
use crate::motion::guard::Finding;
use crate::motion::{Reading, VelocityEstimator};
use crate::units::{Control, CountsPerSecond, Micros, Millivolts, Period};
use loops::Loops;
use setpoint::Regulation;
use watch::{Order, Watch};

/// A reading older than this is none: the counters are sampled every millisecond.
pub const ENCODER_STALE_MICROS: u64 = 20_000;

/// Settings, set-point and state of one motor.
#[derive(Clone, Debug)]
pub struct Motor {
    settings: Settings,
    /// As the settings have it.
    placer: Placer,
    setpoint: Setpoint,
    position: i32,
    velocity: VelocityEstimator,
    loops: Loops,
    watch: Watch,
    /// The last control value had no effect, because the bridge was open.
    coasting: bool,
}

/// A control value and what the bridge makes of it.
type Output = (Control, Placement);

impl Motor {
    /// A disabled motor that is stepped every `period`.
    pub fn new(settings: Settings, period: Period) -> Self {
        Self {
            settings,
            placer: settings.placer(),
            setpoint: Setpoint::Disabled,
            position: 0,
            velocity: VelocityEstimator::new(period),
            loops: Loops::new(period),
            watch: Watch::new(period),
            coasting: true,
        }
    }

    /// Takes effect at the next step, as a whole. State is kept, so coefficients may be tuned while
    /// the motor runs.
    pub fn configure(&mut self, settings: Settings) {
        self.settings = settings;
        self.placer = settings.placer();
    }

    /// Takes effect at the next step. A change of run mode starts its loops afresh; disabling the
    /// motor ends a latched fault.
    pub fn set(&mut self, setpoint: Setpoint) {
        if setpoint.regulation() != self.setpoint.regulation() {
            self.loops.reset();
        }
        if setpoint == Setpoint::Disabled {
            self.watch.clear();
        }
        self.setpoint = setpoint;
    }

    /// The settings in force.
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// One control tick.
    pub fn step(&mut self, now: Micros, reading: Option<Reading>, battery: Option<Millivolts>) -> Report {
        let moved = reading
            .filter(|reading| now.since(reading.at) <= ENCODER_STALE_MICROS)
            .map(|reading| self.follow(reading));
        let velocity = self.velocity.get();
        let output = battery
            .and_then(|battery| OperatingPoint::new(self.settings.winding.emf.emf(velocity), battery))
            .and_then(|at| self.output(at, moved));

        self.coasting = output.is_none();
        if self.coasting || self.setpoint.regulation() == Regulation::None {
            self.watch.pause();
        }
        let (control, regime, drive) = match output {
            Some((control, Placement { regime, drive })) => (control, Some(regime), drive),
            None => (Control::ZERO, None, Drive::COAST),
        };
        Report {
            setpoint: self.setpoint,
            position: self.position,
            velocity,
            control,
            regime,
            drive,
            at_target: self.setpoint.reached(self.position),
            stalled: self.watch.stalled(),
            faults: Faults {
                battery_unknown: battery.is_none(),
                encoder_stale: moved.is_none(),
                encoder: self.watch.fault(),
            },
        }
    }

    /// Takes a reading; returns the counts since the last one.
    fn follow(&mut self, reading: Reading) -> i32 {
        let moved = reading.position.wrapping_sub(self.position);
        self.position = reading.position;
        self.velocity.step(reading);
        moved
    }

    /// What the set-point asks for, or `None` to coast. `moved` is the counts since the last tick, if the
    /// encoder gives any.
    fn output(&mut self, at: OperatingPoint, moved: Option<i32>) -> Option<Output> {
        let target = match self.setpoint {
            Setpoint::Disabled => return None,
            Setpoint::ConstantPower(power) => return self.open_loop(at, power),
            _ if moved.is_none() || self.watch.fault().is_some() => return None,
            Setpoint::Velocity(target) if target == CountsPerSecond::ZERO && self.floats() => {
                self.loops.reset_velocity();
                return None;
            }
            Setpoint::Velocity(target) => target,
            Setpoint::Position { target, speed_limit, .. } => self.loops.position(
                &self.settings.position,
                target,
                self.position,
                speed_limit,
                self.coasting,
            ),
        };
        self.regulate(at, target, moved?)
    }

    /// A host that sets a power means the duty of 9/8 or 6/2, so no scheme comes between.
    fn open_loop(&self, at: OperatingPoint, power: Control) -> Option<Output> {
        if power != Control::ZERO {
            Some((power, braking::place(Scheme::ForwardReverse, at, power)))
        } else if self.floats() {
            None
        } else {
            Some((power, Placement { regime: Regime::Braking, drive: Drive::BRAKE }))
        }
    }

    /// The velocity loop's output, unless the encoder is in doubt.
    fn regulate(&mut self, at: OperatingPoint, target: CountsPerSecond, moved: i32) -> Option<Output> {
        let velocity = self.velocity.get();
        let gentle = matches!(self.settings.scheme, Scheme::C | Scheme::D(_));
        let place = |control| (control, self.placer.place(at, control));
        let (control, placement) = match self.watch.step(moved, velocity, gentle) {
            Finding::Fault(_) => return None,
            Finding::Insist(control) => (control, braking::full_reverse(at)),
            Finding::Probe(control) => place(control),
            Finding::Sound | Finding::Stalled => {
                place(self.loops.velocity(&self.settings.velocity, target, velocity, self.coasting))
            }
        };
        self.watch.note(Order { target, control, regime: placement.regime });
        Some((control, placement))
    }

    fn floats(&self) -> bool {
        self.settings.zero_power == ZeroPower::Float
    }
}
