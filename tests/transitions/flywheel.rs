//! The motor of the transitions: a NeveRest 60 with a flywheel on the common bench.

use crate::common::{self, BATTERY, BRIDGE, Bench, configured, dynamics, inertia, neverest_60, unknown};
use crate::events::Demand;
use motor_hub::braking::Scheme;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::load::{Load, Shaft};
use motor_hub::motor::{Report, Settings};
use motor_hub::regulator::{Coefficients, Dynamics};
use motor_hub::units::Period;
use std::f64::consts::TAU;

/// Configuration of the motor. It selects the regulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Knowledge {
    /// The dynamics are configured: the model regulates.
    Configured,
    /// Only the winding is configured: the model regulates, and learns the acceleration per volt.
    Unknown,
    /// A host has set coefficients: PID regulates, though the dynamics are configured.
    Coefficients,
}

/// The true constants of the motor with its flywheel, in the encoder's units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constants {
    motor: Motor,
    shaft: Shaft,
    /// Back EMF in volts per count/s.
    pub(crate) kappa: f64,
    /// Resistance of winding and bridge.
    pub(crate) ohms: f64,
    /// Speed in counts/s whose back EMF is the battery's voltage.
    pub(crate) free_speed: f64,
    /// Current in A at standstill and full voltage.
    pub(crate) stall_current: f64,
    /// Acceleration in counts/s² by the stall current.
    pub(crate) stall_acceleration: f64,
}

/// A flywheel with about the inertia of the rotor, seen from the output shaft.
fn load() -> Load {
    inertia(0.03)
}

impl Constants {
    pub(crate) fn new() -> Self {
        let motor = neverest_60();
        let kappa = motor.ke.0 * TAU / motor.counts_per_rev_motor;
        let ohms = motor.r.0 + 2e-3 * f64::from(BRIDGE.switch_mohm());
        let shaft = Shaft::new(&motor, &load());
        let stall_current = BATTERY / ohms;
        let per_rad = motor.counts_per_rev_motor / TAU;
        Self {
            motor,
            shaft,
            kappa,
            ohms,
            free_speed: BATTERY / kappa,
            stall_current,
            stall_acceleration: motor.kt.0 * stall_current / shaft.inertia.0 * per_rad,
        }
    }

    pub(crate) fn dynamics(&self) -> Dynamics {
        dynamics(&self.motor, &load())
    }

    /// Usual coefficients of a host for a scheme.
    pub(crate) fn coefficients(&self, scheme: Scheme, period: Period) -> Coefficients {
        Coefficients::guessed(common::winding(&self.motor).emf, scheme, period)
    }
}

/// Measurements of a tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tick {
    /// Mean current of the winding, A.
    pub(crate) current: f64,
    /// Speed at the end, counts/s.
    pub(crate) speed: f64,
    pub(crate) report: Report,
}

/// Milliseconds over which the present current is taken, unless a tick is shorter.
const RECENT: usize = 20;

/// The motor on the bench, and the demand.
#[derive(Clone)]
pub(crate) struct Subject {
    pub(crate) bench: Bench<1>,
    pub(crate) constants: Constants,
    pub(crate) demand: Demand,
    /// External torque as a share of the stall torque; positive drives clockwise.
    load: f64,
    /// Mean currents of the last milliseconds, A, the newest last.
    recent: [f64; RECENT],
}

impl Subject {
    /// A disabled motor that turns at a speed in counts/s under a load.
    pub(crate) fn new(knowledge: Knowledge, scheme: Scheme, period: Period, speed: f64, load: f64) -> Self {
        let constants = Constants::new();
        let Constants { motor, shaft, stall_current, .. } = constants;
        let known = configured(&motor, &self::load());
        let settings = match knowledge {
            Knowledge::Unknown => unknown(&motor),
            Knowledge::Configured => known,
            Knowledge::Coefficients => {
                Settings { coefficients: Some(constants.coefficients(scheme, period)), ..known }
            }
        };
        let plant = common::plant(motor, self::load());
        let mut bench = Bench::one(Settings { scheme, ..settings }, plant, period.as_millis());
        bench.place(0, 0.5, speed);
        bench.axes[0].torque = load * motor.kt.0 * stall_current / shaft.torque_ratio;
        Self { bench, constants, demand: Demand::Coast, load, recent: [0.0; RECENT] }
    }

    pub(crate) fn period_ms(&self) -> u32 {
        self.bench.hub.period().as_millis()
    }

    pub(crate) fn speed(&self) -> f64 {
        self.bench.speed(0)
    }

    /// Position as the hub knows it.
    pub(crate) fn position(&self) -> i32 {
        self.bench.axes[0].reading.map_or(0, |reading| reading.position)
    }

    /// Mean current of the last 20 ms, or of the last tick if that is shorter, A.
    pub(crate) fn current(&self) -> f64 {
        let ms = RECENT.min(self.period_ms() as usize);
        self.recent[RECENT - ms..].iter().sum::<f64>() / ms as f64
    }

    pub(crate) fn configure(&mut self, change: impl FnOnce(&mut Settings)) {
        self.bench.configure(0, change);
    }

    /// The current in A that balances drag and load at the present speed.
    pub(crate) fn need(&self) -> f64 {
        let Constants { motor, shaft, stall_current, .. } = self.constants;
        shaft.drag.0 * self.bench.rig.plants[0].speed().0 / motor.kt.0 - self.load * stall_current
    }

    /// One tick of control, and the physics until the next.
    pub(crate) fn tick(&mut self) -> Tick {
        let mut sum = 0.0;
        for _ in 0..self.period_ms() {
            let [amperes] = self.bench.run_ms(1);
            self.recent.rotate_left(1);
            self.recent[RECENT - 1] = amperes;
            sum += amperes;
        }
        Tick { current: sum / f64::from(self.period_ms()), speed: self.speed(), report: *self.bench.report() }
    }

    /// Runs ticks for at least this time. Returns the last tick.
    pub(crate) fn run(&mut self, ms: u32) -> Tick {
        let mut last = self.tick();
        for _ in 1..ms.div_ceil(self.period_ms()) {
            last = self.tick();
        }
        last
    }

    /// No sample comes for at least 60 ms.
    pub(crate) fn lose_encoder(&mut self) {
        self.bench.axes[0].unread_ms = u64::MAX;
        self.run(60);
        self.bench.axes[0].unread_ms = 0;
        self.bench.sample();
    }

    /// The battery's voltage is not known for at least this time.
    pub(crate) fn lose_battery(&mut self, ms: u32) {
        self.bench.battery_read = false;
        self.run(ms);
        self.bench.battery_read = true;
    }
}
