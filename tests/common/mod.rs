//! The bench of every test that drives motors: a hub, its motors on one battery, and their encoders, in steps of 1 ms.
//!
//! A test sets a [`Bench`] up, acts on it (set-points, settings, loads, faults), lets time pass, and looks at the last
//! snapshot of the hub or at the physics.
//!
//! Each millisecond: a tick of the hub if one is due, then the physics, then a sample of the encoders.
#![allow(dead_code, reason = "each test uses its own part of the bench")]

use motor_hub::braking::{Scheme, Winding};
use motor_hub::bridge::{BridgeConstants, Drive};
use motor_hub::group::GroupCommand;
use motor_hub::hub::{Command, Hub, Snapshot};
use motor_hub::model::battery::Battery as Source;
use motor_hub::model::catalogue::{self, Motor};
use motor_hub::model::friction::Friction;
use motor_hub::model::load::{Load, Shaft};
use motor_hub::model::plant::{Plant, PlantInput};
use motor_hub::model::rig::Rig;
use motor_hub::model::si::{Hertz, KgM2, NewtonMetres, Ohms, RadPerSec, Seconds, Volts};
use motor_hub::model::switching::Bridge;
use motor_hub::motion::{Reading, Tracker};
use motor_hub::motor::{Motor as Controlled, Report, Setpoint, Settings};
use motor_hub::regulator::{Dynamics, Mechanics};
use motor_hub::supply::Battery;
use motor_hub::units::{
    Control, CountsPerSecond, EmfConstant, Inductance, Micros, Millivolts, Period, Resistance, Share,
};
use std::f64::consts::TAU;

/// Voltage of the bench's battery, in volts. It has no inner resistance.
pub(crate) const BATTERY: f64 = 12.0;
/// The bridge of each plant that `plant` makes. A test may give the bench a plant with another bridge.
pub(crate) const BRIDGE: BridgeConstants = BridgeConstants::IDEAL;

/// Returns a motor of the catalogue with the inertia that was measured at its rotor.
pub(crate) fn motor(name: &str) -> Motor {
    catalogue::characterised(name).expect("in the catalogue").with_measured_rotor_inertia()
}

/// Returns the motor whose winding is [`Winding::NEVEREST_60`].
pub(crate) fn neverest_60() -> Motor {
    motor("AM 60 A")
}

/// Returns a load with an inertia in kg m² on the output shaft.
pub(crate) fn inertia(kg_m2: f64) -> Load {
    Load::inertia(KgM2(kg_m2))
}

/// Returns a load with which the rotor of a motor seems `times` as heavy.
pub(crate) fn rotors(motor: &Motor, times: f64) -> Load {
    inertia((times - 1.0) * motor.j.0 * motor.eta * motor.gear_ratio.powi(2))
}

/// Returns the motor with a dry friction that takes this voltage.
pub(crate) fn rough(motor: Motor, volts: f64) -> Motor {
    let ohms = motor.r.0 + 2e-3 * f64::from(BRIDGE.switch_mohm());
    Motor { friction: Friction::with_coulomb(NewtonMetres(volts * motor.kt.0 / ohms)), ..motor }
}

/// Returns the speed at which a motor's back EMF equals the voltage of the bench's battery, in counts/s. Drag is left out, so
/// the motor's free speed is lower.
pub(crate) fn free_cps(motor: &Motor) -> f64 {
    BATTERY / motor.ke.0 / TAU * motor.counts_per_rev_motor
}

/// Returns the stall torque of a motor at the voltage of the bench's battery, on the output shaft in N m.
pub(crate) fn stall_torque(motor: &Motor) -> f64 {
    motor.stall_torque(Volts(BATTERY)).0 * motor.gear_ratio * motor.eta
}

/// Returns the winding as a user would configure it.
pub(crate) fn winding(motor: &Motor) -> Winding {
    Winding {
        emf: EmfConstant::from_ke(motor.ke.0, motor.counts_per_rev_motor).expect("in range"),
        resistance: Resistance::from_ohms(motor.r.0).expect("in range"),
        inductance: Inductance::from_millihenries(1e3 * motor.l.0).ok(),
    }
}

/// Returns the true dynamics of a motor with a load, without dry friction.
pub(crate) fn dynamics(motor: &Motor, load: &Load) -> Dynamics {
    let shaft = Shaft::new(motor, load);
    let mechanics = Mechanics {
        torque_constant: motor.kt.0,
        counts_per_turn: motor.counts_per_rev_motor,
        inertia: shaft.inertia.0,
        drag: shaft.drag.0,
        friction: 0.0,
    };
    Dynamics::from_mechanics(&winding(motor), &BRIDGE, &mechanics).expect("in range")
}

/// Returns the settings of a motor whose dynamics are not configured, in Scheme A.
pub(crate) fn unknown(motor: &Motor) -> Settings {
    Settings::for_scheme(winding(motor), Scheme::A)
}

/// Returns the settings of a motor whose dynamics are configured for a load, in Scheme A.
pub(crate) fn configured(motor: &Motor, load: &Load) -> Settings {
    Settings { dynamics: Some(dynamics(motor, load)), ..unknown(motor) }
}

/// Returns the settings of a motor whose dynamics are configured for a load, and of one whose dynamics are not configured.
pub(crate) fn configured_and_unknown(motor: &Motor, load: &Load) -> [Settings; 2] {
    [configured(motor, load), unknown(motor)]
}

/// Returns the plant of a motor on [`BRIDGE`].
pub(crate) fn plant(motor: Motor, load: Load) -> Plant {
    Plant::new(motor, load, Bridge::new(BRIDGE), Hertz(f64::from(BRIDGE.pwm_hz())))
}

pub(crate) fn velocity(cps: i32) -> Setpoint {
    Setpoint::Velocity(CountsPerSecond::new(cps))
}

pub(crate) fn position(target: i32, tolerance: u16, cps: i32) -> Setpoint {
    Setpoint::Position { target, tolerance, speed_limit: CountsPerSecond::new(cps) }
}

/// Condition of an encoder's cable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cable {
    Plugged,
    /// The counter stays where it is.
    Unplugged,
    /// The counter counts in the other direction.
    Reversed,
    /// One of the two wires is broken: the counter goes up and down by one.
    OneWire,
}

/// No mechanical stops.
pub(crate) const NO_STOPS: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// The surroundings of one motor, which a test changes while time passes.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    /// External torque on the output shaft in N m, positive clockwise.
    pub(crate) torque: f64,
    /// Lowest and highest position of the motor shaft, in counts. Springy stops begin there, and let the shaft turn further.
    pub(crate) stops: (f64, f64),
    /// Stiffness of the stops at the output shaft in N m/rad; `None` for hard stops.
    pub(crate) stiffness: Option<f64>,
    /// Speed in counts/s at which a machine turns the shaft, whatever the motor does; `None` leaves it to the physics.
    pub(crate) turned: Option<f64>,
    pub(crate) cable: Cable,
    /// Time in ms for which the encoder's counter is not read.
    pub(crate) unread_ms: u64,
    /// The newest reading.
    pub(crate) reading: Option<Reading>,
    tracker: Tracker,
    counter: i64,
    /// Whole counts of the shaft at the last sample.
    sampled: i64,
    /// Charge in C through the winding in the last millisecond.
    charge: f64,
}

impl Axis {
    fn new() -> Self {
        Self {
            torque: 0.0,
            stops: NO_STOPS,
            stiffness: None,
            turned: None,
            cable: Cable::Plugged,
            unread_ms: 0,
            reading: None,
            tracker: Tracker::default(),
            counter: 0,
            sampled: 0,
            charge: 0.0,
        }
    }

    fn sample(&mut self, counts: i64, now: Micros) -> Option<Reading> {
        let moved = counts - std::mem::replace(&mut self.sampled, counts);
        match self.cable {
            Cable::Plugged => self.counter += moved,
            Cable::Reversed => self.counter -= moved,
            Cable::Unplugged => {}
            // The wire that still works changes its level once in two counts of the shaft. The counter follows this level: up
            // by one, then down by one.
            Cable::OneWire => self.counter += counts.div_euclid(2).rem_euclid(2) - self.counter.rem_euclid(2),
        }
        if self.unread_ms > 0 {
            self.unread_ms -= 1;
            return None;
        }
        self.reading = Some(self.tracker.step(self.counter as u16, now));
        self.reading
    }
}

/// A hub with its motors, which stand still at first.
#[derive(Clone, Debug)]
pub(crate) struct Bench<const N: usize> {
    pub(crate) hub: Hub<N>,
    pub(crate) settings: [Settings; N],
    /// The physics, one plant for each motor.
    pub(crate) rig: Rig,
    pub(crate) axes: [Axis; N],
    /// True if the hub measures the battery's voltage.
    pub(crate) battery_read: bool,
    /// Shares of the energy that the supply can give, and of the returned energy that motors must dissipate.
    pub(crate) supply: (Share, Share),
    /// Time since the start.
    pub(crate) ms: u64,
    /// The newest snapshot.
    pub(crate) snapshot: Snapshot<N>,
}

impl Bench<1> {
    /// Sets up one motor.
    pub(crate) fn one(settings: Settings, plant: Plant, period_ms: u32) -> Self {
        Self::new([settings], [plant], period_ms)
    }
}

impl<const N: usize> Bench<N> {
    pub(crate) fn new(settings: [Settings; N], plants: [Plant; N], period_ms: u32) -> Self {
        let source = Source { emf: Volts(BATTERY), resistance: Ohms(0.0) };
        let mut bench = Self {
            hub: Hub::new(settings, Period::from_millis(period_ms).expect("in range")),
            settings,
            rig: Rig::new(source, plants.into()),
            axes: std::array::from_fn(|_| Axis::new()),
            battery_read: true,
            supply: (Share::ALL, Share::NONE),
            ms: 0,
            snapshot: Snapshot::INITIAL,
        };
        // Each shaft starts in the middle of a count, so that a shaft at rest does not move across an edge again and
        // again.
        (0..N).for_each(|motor| bench.place(motor, 0.5, 0.0));
        bench.sample();
        bench
    }

    /// Sets up NeveRest 60 that machines turn at these speeds in counts/s, at a period of 50 ms.
    pub(crate) fn turned(settings: Settings, cps: [f64; N]) -> Self {
        let plants = std::array::from_fn(|_| plant(neverest_60(), Load::NONE));
        let mut bench = Self::new([settings; N], plants, 50);
        for (axis, cps) in bench.axes.iter_mut().zip(cps) {
            axis.turned = Some(cps);
        }
        bench
    }

    /// Puts the shaft of a motor at a position in counts, turning at a speed in counts/s.
    pub(crate) fn place(&mut self, motor: usize, counts: f64, cps: f64) {
        let plant = &mut self.rig.plants[motor];
        let rad = TAU / plant.motor().counts_per_rev_motor;
        plant.set_state(plant.current(), RadPerSec(cps * rad), counts * rad);
    }

    pub(crate) fn set(&mut self, motor: usize, setpoint: Setpoint) {
        self.hub.apply(Command::Set { motor, setpoint }).expect("a motor of the hub");
    }

    /// Moves motors together.
    pub(crate) fn move_group(&mut self, command: GroupCommand) {
        self.hub.apply(Command::MoveGroup(command)).expect("motors of the hub");
    }

    /// Changes settings of a motor while it runs.
    pub(crate) fn configure(&mut self, motor: usize, change: impl FnOnce(&mut Settings)) {
        change(&mut self.settings[motor]);
        let settings = self.settings[motor];
        self.hub.apply(Command::Configure { motor, settings }).expect("a motor of the hub");
    }

    /// Newest report of the first motor.
    pub(crate) fn report(&self) -> &Report {
        &self.snapshot.motors[0]
    }

    /// Control value of a motor's command at the newest tick.
    pub(crate) fn control(&self, motor: usize) -> Control {
        self.snapshot.motors[motor].control(&self.settings[motor])
    }

    /// Position of a motor shaft in counts, to parts of a count.
    pub(crate) fn counts(&self, motor: usize) -> f64 {
        let plant = &self.rig.plants[motor];
        plant.angle() / TAU * plant.motor().counts_per_rev_motor
    }

    /// Speed of a motor shaft in counts/s.
    pub(crate) fn speed(&self, motor: usize) -> f64 {
        let plant = &self.rig.plants[motor];
        plant.speed().0 / TAU * plant.motor().counts_per_rev_motor
    }

    /// Lets time pass. Returns the mean current of each winding in A.
    pub(crate) fn run_ms(&mut self, ms: u64) -> [f64; N] {
        let mut charges = [0.0; N];
        for _ in 0..ms {
            if self.ms.is_multiple_of(self.hub.period().as_millis().into()) {
                self.step_hub();
            } else {
                self.apply_limits();
            }
            self.step_physics();
            self.ms += 1;
            self.sample();
            for (sum, axis) in charges.iter_mut().zip(&self.axes) {
                *sum += axis.charge;
            }
        }
        charges.map(|charge| 1e3 * charge / ms as f64)
    }

    /// Lets time pass. Returns the highest of the values after each millisecond.
    pub(crate) fn highest(&mut self, ms: u64, value: impl Fn(&Self) -> f64) -> f64 {
        (0..ms).fold(f64::NEG_INFINITY, |highest, _| {
            self.run_ms(1);
            highest.max(value(self))
        })
    }

    /// Lets time pass until the bench is in a state. Returns the time in ms; `None` if it is longer than `most_ms`.
    pub(crate) fn wait_until(&mut self, most_ms: u64, is_in_state: impl Fn(&Self) -> bool) -> Option<u64> {
        let start = self.ms;
        while !is_in_state(self) {
            if self.ms - start >= most_ms {
                return None;
            }
            self.run_ms(1);
        }
        Some(self.ms - start)
    }

    /// Takes a tick that is due now, and lets time pass until the next. Returns the tick's snapshot.
    pub(crate) fn tick(&mut self) -> Snapshot<N> {
        self.run_ms(self.hub.period().as_millis().into());
        self.snapshot
    }

    fn now(&self) -> Micros {
        Micros::new(1_000 * self.ms)
    }

    fn battery(&self) -> Option<Battery> {
        let voltage = Millivolts::from_volts(self.rig.voltage().0).ok().filter(|_| self.battery_read)?;
        let (draw, dissipate) = self.supply;
        Some(Battery { draw, dissipate, ..Battery::unlimited(voltage, self.now()) })
    }

    fn step_hub(&mut self) {
        let readings = self.axes.each_ref().map(|axis| axis.reading);
        self.snapshot = self.hub.step(self.now(), &readings, self.battery());
    }

    /// Limits the motors by the state of the supply, as the hub does every millisecond between two ticks.
    fn apply_limits(&mut self) {
        let drives = self.battery().and_then(|battery| self.hub.apply_limits(battery));
        for (report, drive) in self.snapshot.motors.iter_mut().zip(drives.into_iter().flatten()) {
            report.drive = drive;
        }
    }

    fn step_physics(&mut self) {
        let influences: [PlantInput; N] = std::array::from_fn(|motor| {
            let Drive { mode, duty } = self.snapshot.motors[motor].drive;
            let torque_after = NewtonMetres(self.axes[motor].torque + self.stop_torque(motor));
            PlantInput { torque_after, ..PlantInput::pwm(mode, duty.to_f64()) }
        });
        let before: [f64; N] = std::array::from_fn(|motor| self.counts(motor));
        if self.axes.iter().any(|axis| axis.turned.is_none()) {
            let flows = self.rig.run(Seconds(1e-3), &influences);
            for (axis, flow) in self.axes.iter_mut().zip(flows) {
                axis.charge = flow.charge.0;
            }
        }
        for (motor, before) in before.into_iter().enumerate() {
            let Axis { stiffness, turned, .. } = self.axes[motor];
            let beyond = self.beyond_stop(motor);
            if let Some(cps) = turned {
                self.place(motor, before + 1e-3 * cps, cps);
            } else if stiffness.is_none() && beyond != 0.0 {
                self.place(motor, self.counts(motor) - beyond, 0.0);
            }
        }
    }

    /// Distance in counts by which a motor is beyond one of its stops.
    fn beyond_stop(&self, motor: usize) -> f64 {
        let (counts, (low, high)) = (self.counts(motor), self.axes[motor].stops);
        counts - counts.clamp(low, high)
    }

    /// Torque of springy stops on the output shaft in N m.
    fn stop_torque(&self, motor: usize) -> f64 {
        let counts_per_rad = self.rig.plants[motor].motor().counts_per_rev_output() / TAU;
        -self.axes[motor].stiffness.unwrap_or(0.0) * self.beyond_stop(motor) / counts_per_rad
    }

    /// Samples all encoders, as the capture task does every millisecond.
    pub(crate) fn sample(&mut self) {
        let now = self.now();
        let mut readings = [None; N];
        for ((axis, plant), reading) in self.axes.iter_mut().zip(&self.rig.plants).zip(&mut readings) {
            *reading = axis.sample(plant.counts(), now);
        }
        self.hub.sample(&readings);
    }
}

/// A motor without physics: its encoder reads what the test says, whatever the bridge does.
pub(crate) struct ScriptedMotor {
    motor: Controlled,
    at: Micros,
    reading: Option<Reading>,
}

impl ScriptedMotor {
    pub(crate) fn new(settings: Settings, period: Period) -> Self {
        Self { motor: Controlled::new(settings, period), at: Micros::new(0), reading: None }
    }

    pub(crate) fn settings(&self) -> &Settings {
        self.motor.settings()
    }

    pub(crate) fn set(&mut self, setpoint: Setpoint) {
        self.motor.set(setpoint);
    }

    pub(crate) fn configure(&mut self, settings: Settings) {
        self.motor.configure(settings);
    }

    /// Lets `ms` pass. Then reads the encoder, whose position has changed by `counts`.
    pub(crate) fn sample(&mut self, ms: u64, counts: i32) {
        let position = self.reading.map_or(0, |last| last.position).wrapping_add(counts);
        self.sample_at(Micros::new(self.at.get() + 1_000 * ms), position);
    }

    /// Reads the encoder at this time.
    pub(crate) fn sample_at(&mut self, at: Micros, position: i32) {
        let unmoved = self.reading.filter(|last| last.position == position);
        let reading = Reading { position, edge_at: unmoved.map_or(at, |last| last.edge_at), at };
        (self.at, self.reading) = (at, Some(reading));
        self.motor.sample(&reading);
    }

    /// Takes a tick at the time of the last sample. The battery's voltage is in mV.
    pub(crate) fn step(&mut self, battery: Option<u16>) -> Report {
        let battery = battery.map(|voltage| Battery::unlimited(Millivolts::new(voltage), self.at));
        self.motor.step(self.at, self.reading, battery)
    }

    /// Takes a tick as [`step`](Self::step) does. Returns the control value of the command.
    pub(crate) fn control(&mut self, battery: Option<u16>) -> Control {
        self.step(battery).control(self.settings())
    }
}
