//! One motor with its load on a bench: the physics, and the regulated motor that is configured for them.

use motor_hub::braking::{Scheme, Winding};
use motor_hub::bridge::BridgeConstants;
use motor_hub::model::catalogue::{self, Motor};
use motor_hub::model::load::{Load, Shaft};
use motor_hub::model::plant::{self, Plant};
use motor_hub::model::si::{Hertz, KgM2, NewtonMetres, RadPerSec, Seconds, Volts};
use motor_hub::model::switching::Bridge;
use motor_hub::motion::{Reading, Tracker};
use motor_hub::motor::{Motor as Regulated, Report, Settings};
use motor_hub::regulator::{Coefficients, Dynamics, Mechanics};
use motor_hub::units::{EmfConstant, Inductance, Micros, Millivolts, Period, Resistance};
use std::f64::consts::TAU;

const BRIDGE: BridgeConstants = BridgeConstants::IDEAL;
pub(crate) const BATTERY: f64 = 12.0;
/// Of the load on the output shaft, kg m²: as much again as the rotor's.
const INERTIA_AFTER: f64 = 0.03;

/// What the hub knows of the motor, which decides how the motor is regulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Knowledge {
    /// The dynamics are configured: the model regulates.
    Configured,
    /// Only the winding is configured: the model regulates, and learns the acceleration per volt.
    Unknown,
    /// A host has set coefficients: PID regulates, though the dynamics are configured.
    Coefficients,
}

/// The motor's constants in the encoder's units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constants {
    motor: Motor,
    shaft: Shaft,
    /// Volts per count/s.
    pub(crate) kappa: f64,
    /// Of winding and bridge.
    pub(crate) ohms: f64,
    /// Acceleration in counts/s² per ampere.
    pub(crate) per_ampere: f64,
    /// Of 12 V, in counts/s.
    pub(crate) free_speed: f64,
    /// At 12 V.
    pub(crate) stall_current: f64,
}

impl Constants {
    /// An AM 60 A with a small flywheel.
    pub(crate) fn new() -> Self {
        let entry = catalogue::find("AM 60 A").expect("known");
        let motor = entry.motor.expect("characterised").with_measured_rotor_inertia();
        let shaft = Shaft::new(&motor, &load());
        let kappa = motor.ke.0 * TAU / motor.counts_per_rev_motor;
        let ohms = motor.r.0 + 2e-3 * f64::from(BRIDGE.switch_mohm());
        Self {
            motor,
            shaft,
            kappa,
            ohms,
            per_ampere: motor.kt.0 / shaft.inertia.0 * motor.counts_per_rev_motor / TAU,
            free_speed: BATTERY / kappa,
            stall_current: BATTERY / ohms,
        }
    }

    fn winding(&self) -> Winding {
        Winding {
            emf: EmfConstant::from_ke(self.motor.ke.0, self.motor.counts_per_rev_motor).expect("in range"),
            resistance: Resistance::from_ohms(self.motor.r.0).expect("in range"),
            inductance: Some(Inductance::from_millihenries(1e3 * self.motor.l.0).expect("in range")),
        }
    }

    /// As they are.
    pub(crate) fn dynamics(&self) -> Dynamics {
        let mechanics = Mechanics {
            torque_constant: self.motor.kt.0,
            counts_per_turn: self.motor.counts_per_rev_motor,
            inertia: self.shaft.inertia.0,
            drag: self.shaft.drag.0,
            friction: 0.0,
        };
        Dynamics::from_mechanics(&self.winding(), &BRIDGE, &mechanics).expect("in range")
    }

    /// What a host would send: those for this scheme.
    pub(crate) fn coefficients(&self, scheme: Scheme, period: Period) -> Coefficients {
        Coefficients::guessed(self.winding().emf, scheme, period)
    }

    fn settings(&self, knowledge: Knowledge, scheme: Scheme, period: Period) -> Settings {
        let (dynamics, coefficients) = match knowledge {
            Knowledge::Unknown => (None, None),
            Knowledge::Configured => (Some(self.dynamics()), None),
            Knowledge::Coefficients => (Some(self.dynamics()), Some(self.coefficients(scheme, period))),
        };
        Settings { dynamics, coefficients, ..Settings::for_scheme(self.winding(), scheme) }
    }

    /// The current that balances drag and load at a speed in counts/s; `share` is the load as a share of the
    /// stall current, positive for one that drives clockwise.
    pub(crate) fn need(&self, speed: f64, share: f64) -> f64 {
        let per_rad = self.motor.counts_per_rev_motor / TAU;
        self.shaft.drag.0 * speed / per_rad / self.motor.kt.0 - share * self.stall_current
    }
}

fn load() -> Load {
    Load { inertia_after: KgM2(INERTIA_AFTER), ..Load::NONE }
}

/// What a tick was.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tick {
    /// Mean current of the winding, A.
    pub(crate) current: f64,
    /// In counts/s, before and after.
    pub(crate) speeds: (f64, f64),
    pub(crate) report: Report,
}

#[derive(Clone)]
pub(crate) struct Bench {
    pub(crate) constants: Constants,
    pub(crate) period: Period,
    pub(crate) settings: Settings,
    pub(crate) motor: Regulated,
    plant: Plant,
    /// External, as a share of the stall torque; positive drives clockwise.
    pub(crate) load: f64,
    /// Beyond this count the shaft cannot turn.
    pub(crate) stop: Option<i64>,
    /// The encoder's plug is in.
    pub(crate) plugged: bool,
    /// Its counter is read.
    pub(crate) read: bool,
    /// The battery's voltage is known.
    pub(crate) battery: bool,
    /// For so many milliseconds more no sample comes.
    pub(crate) blind_ms: u32,
    tracker: Tracker,
    /// What the plug let through, of what the shaft did.
    count: i64,
    shaft: i64,
    reading: Option<Reading>,
    ms: u64,
    /// Charge of the last milliseconds, C.
    charges: [f64; RECENT],
}

/// Milliseconds over which the present current is taken.
const RECENT: usize = 20;

impl Bench {
    /// A disabled motor that turns at a speed in counts/s.
    pub(crate) fn new(knowledge: Knowledge, scheme: Scheme, period: Period, speed: f64) -> Self {
        let constants = Constants::new();
        let settings = constants.settings(knowledge, scheme, period);
        let pwm = Hertz(f64::from(BRIDGE.pwm_hz()));
        let mut plant = Plant::new(constants.motor, load(), Bridge::new(BRIDGE), pwm);
        let per_rad = constants.motor.counts_per_rev_motor / TAU;
        plant.place(plant.current(), RadPerSec(speed / per_rad), 0.0);
        let mut bench = Self {
            constants,
            period,
            settings,
            motor: Regulated::new(settings, period),
            plant,
            load: 0.0,
            stop: None,
            plugged: true,
            read: true,
            battery: true,
            blind_ms: 0,
            tracker: Tracker::default(),
            count: 0,
            shaft: 0,
            reading: None,
            ms: 0,
            charges: [0.0; RECENT],
        };
        bench.sample();
        bench
    }

    /// In counts/s.
    pub(crate) fn speed(&self) -> f64 {
        self.plant.speed().0 * self.constants.motor.counts_per_rev_motor / TAU
    }

    /// Mean of the last 20 ms, or of the last tick if that is shorter, A.
    pub(crate) fn current(&self) -> f64 {
        let ms = RECENT.min(self.period.as_millis() as usize).max(1);
        let recent = (1..=ms).map(|back| self.charges[(self.ms as usize + RECENT - back) % RECENT]);
        1e3 * recent.sum::<f64>() / ms as f64
    }

    /// What the motor believes.
    pub(crate) fn position(&self) -> i32 {
        self.reading.map_or(0, |reading| reading.position)
    }

    /// Changes settings while the motor runs.
    pub(crate) fn configure(&mut self, change: impl FnOnce(&mut Settings)) {
        change(&mut self.settings);
        self.motor.configure(self.settings);
    }

    /// What balances drag and load now, A.
    pub(crate) fn need(&self, speed: f64) -> f64 {
        self.constants.need(speed, self.load)
    }

    /// One tick of control, and the physics until the next.
    pub(crate) fn tick(&mut self) -> Tick {
        let before = self.speed();
        let battery = self.battery.then(|| Millivolts::new((1e3 * BATTERY) as u16));
        let report = self.motor.step(Micros::new(1_000 * self.ms), self.reading, battery);
        let mut charge = 0.0;
        for _ in 0..self.period.as_millis() {
            charge += self.run_ms(&report);
        }
        let seconds = f64::from(self.period.as_millis()) / 1e3;
        Tick { current: charge / seconds, speeds: (before, self.speed()), report }
    }

    /// So many ticks that take at least this time; returns the last one.
    pub(crate) fn run(&mut self, ms: u32) -> Tick {
        let mut last = self.tick();
        for _ in 1..ms.div_ceil(self.period.as_millis()) {
            last = self.tick();
        }
        last
    }

    fn run_ms(&mut self, report: &Report) -> f64 {
        let mut influence = plant::PlantInput::pwm(report.drive.mode, report.drive.duty.to_f64());
        let stall_torque = self.constants.motor.kt.0 * self.constants.stall_current;
        influence.torque_after = NewtonMetres(self.load * stall_torque / self.constants.shaft.torque_ratio);
        let flow = self.plant.run(Seconds(1e-3), influence, Volts(BATTERY));
        if let Some(stop) = self.stop {
            // In the middle of a count, so that a shaft at the stop does not tremble across an edge.
            let angle = (stop as f64 + 0.5) * TAU / self.constants.motor.counts_per_rev_motor;
            if self.plant.angle() > angle {
                self.plant.place(self.plant.current(), RadPerSec(0.0), angle);
            }
        }
        self.charges[self.ms as usize % RECENT] = flow.charge.0;
        self.ms += 1;
        self.sample();
        flow.charge.0
    }

    /// The capture task's millisecond.
    pub(crate) fn sample(&mut self) {
        let moved = self.plant.counts() - std::mem::replace(&mut self.shaft, self.plant.counts());
        if self.plugged {
            self.count += moved;
        }
        if self.blind_ms > 0 {
            self.blind_ms -= 1;
        } else if self.read {
            let reading = self.tracker.step(self.count as u16, Micros::new(1_000 * self.ms));
            self.motor.sample(reading);
            self.reading = Some(reading);
        }
    }
}
