//! The motor of the transitions: a NeveRest 60 with a flywheel on the common bench.

use crate::common::{self, BATTERY, BRIDGE, Bench, dynamics, free_cps, inertia, neverest_60, unknown};
use crate::events::Demand;
use motor_hub::braking::Scheme;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::load::{Load, Shaft};
use motor_hub::motor::{Report, Settings};
use motor_hub::regulator::Coefficients;
use motor_hub::units::Period;

/// Configuration of the motor. It selects the regulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Knowledge {
    /// The dynamics are configured: the model regulates.
    Configured,
    /// Only the winding is configured: the model regulates, and learns the acceleration per volt.
    Unknown,
    /// A host has set coefficients: PID regulates, though the dynamics are configured.
    Coefficients,
}

/// A flywheel with about the inertia of the rotor, seen from the output shaft.
fn load() -> Load {
    inertia(0.03)
}

/// Milliseconds over which the present current is taken, unless a tick is shorter.
const RECENT: usize = 20;

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The motor on the bench, its true constants in the encoder's units, and the demand.
#[derive(Clone)]
pub(crate) struct Subject {
    pub(crate) bench: Bench<1>,
    motor: Motor,
    shaft: Shaft,
    /// Resistance of winding and bridge.
    pub(crate) ohms: f64,
    /// Speed in counts/s whose back EMF is the battery's voltage.
    pub(crate) free_speed: f64,
    /// Current in A at standstill and full voltage.
    pub(crate) stall_current: f64,
    pub(crate) demand: Demand,
    /// External torque as a share of the stall torque; positive drives clockwise.
    load: f64,
    /// Mean current of the last 20 ms, or of the last tick if that is shorter, A.
    pub(crate) current: f64,
}

impl Subject {
    /// A disabled motor that turns at a speed in counts/s under a load.
    pub(crate) fn new(knowledge: Knowledge, scheme: Scheme, period: Period, speed: f64, load: f64) -> Self {
        let motor = neverest_60();
        let shaft = Shaft::new(&motor, &self::load());
        let ohms = motor.r.0 + 2e-3 * f64::from(BRIDGE.switch_mohm());
        let stall_current = BATTERY / ohms;
        let plant = common::plant(motor, self::load());
        let mut bench = Bench::one(Settings { scheme, ..unknown(&motor) }, plant, period.as_millis());
        bench.place(0, 0.5, speed);
        bench.axes[0].torque = load * motor.kt.0 * stall_current / shaft.torque_ratio;
        let (free_speed, demand) = (free_cps(&motor), Demand::Coast);
        let mut subject =
            Self { bench, motor, shaft, ohms, free_speed, stall_current, demand, load, current: 0.0 };
        if knowledge != Knowledge::Unknown {
            subject.configure_dynamics();
        }
        if knowledge == Knowledge::Coefficients {
            subject.set_coefficients();
        }
        subject
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

    pub(crate) fn configure(&mut self, change: impl FnOnce(&mut Settings)) {
        self.bench.configure(0, change);
    }

    /// Gives the motor the usual coefficients of a host.
    pub(crate) fn set_coefficients(&mut self) {
        self.configure(|settings| {
            settings.coefficients = Some(Coefficients::suggested(settings.winding.emf));
        });
    }

    /// Configures the true dynamics.
    pub(crate) fn configure_dynamics(&mut self) {
        let dynamics = dynamics(&self.motor, &load());
        self.configure(|settings| settings.dynamics = Some(dynamics));
    }

    /// The current in A that balances drag and load at the present speed.
    pub(crate) fn need(&self) -> f64 {
        let drag = self.shaft.drag.0 * self.bench.rig.plants[0].speed().0;
        drag / self.motor.kt.0 - self.load * self.stall_current
    }

    /// One tick of control, and the physics until the next. Returns the mean current of the winding in A.
    pub(crate) fn tick(&mut self) -> f64 {
        let amperes: Vec<f64> = (0..self.period_ms()).map(|_| self.bench.run_ms(1)[0]).collect();
        self.current = mean(&amperes[amperes.len().saturating_sub(RECENT)..]);
        mean(&amperes)
    }

    /// Runs ticks for at least this time. Returns the last report.
    pub(crate) fn run(&mut self, ms: u32) -> &Report {
        for _ in 0..ms.div_ceil(self.period_ms()) {
            self.tick();
        }
        self.bench.report()
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
