//! The plants: up to four motors with their loads on one battery. They are simulated a millisecond ahead, so that each encoder
//! edge is known before the chip reaches its time.
//!
//! A *cell* is a millisecond of whole PWM periods, with a constant battery voltage. The voltage of the next cell follows from
//! the current of all motors. If a bridge changes within a cell, its motor is simulated again from the last change in the cell
//! on. Other motors are not.

use std::collections::VecDeque;

use motor_hub::bridge::BridgeConstants;
use motor_hub::model::battery::Battery;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::load::Load;
use motor_hub::model::plant::{Flow, Plant, PlantInput};
use motor_hub::model::si::{Amps, Hertz, NewtonMetres, RadPerSec, Seconds};
use motor_hub::model::switching::Bridge;

use crate::bridge_lines::Lines;
use crate::pwm::{Grid, Output};

/// Length of a cell, ns.
pub(crate) const CELL: u64 = 1_000_000;

/// Length of a step of the simulation, in ns: two PWM periods. Within a step the angle is interpolated by a cubic. The time
/// between two edges is longer: 127 us at 12 V and without load for the fastest motor of the catalogue, 340 us for a NeveRest.
const STEP: u64 = 100_000;

/// PWM frequency until the chip's timer runs.
const IDLE_PWM: Hertz = Hertz(BridgeConstants::IDEAL.pwm_hz() as f64);

/// A motor behind its bridge.
#[derive(Clone, Debug)]
pub struct Mounting {
    /// The motor.
    pub motor: Motor,
    /// Load on the motor's output shaft.
    pub load: Load,
    /// Losses and switching times of the bridge.
    pub bridge: Bridge,
    /// Hard stops, in encoder counts, between which the shaft can turn.
    pub stops: Option<(i64, i64)>,
}

/// Motion and current of a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Speed in encoder counts per second.
    pub counts_per_second: f64,
    /// Encoder counts since power-on.
    pub counts: i64,
    /// Motor current, A.
    pub current: f64,
    /// Charge and energy that have flowed since power-on.
    pub flow: Flow,
}

#[derive(Clone, Debug)]
struct Shaft {
    mounting: Mounting,
    command: PlantInput,
    /// The plant at the time `base_at`.
    base: Plant,
    /// Time of the last change in the cell, or the cell's beginning, ns.
    base_at: u64,
    /// Flow from the cell's beginning to `base_at`.
    base_flow: Flow,
    /// The plant at the cell's end.
    ahead: Plant,
    /// Flow in the whole cell.
    flow: Flow,
    /// Flow before the cell.
    past: Flow,
    /// The edges of the encoder in the rest of the cell: their times in ns, and the count after each edge.
    edges: VecDeque<(u64, i64)>,
    /// The count that the encoder's lines show.
    shown: i64,
    /// Mean current that the bridge's current sense showed in the last cell, A.
    sensed: f64,
}

impl Shaft {
    fn new(mounting: Mounting) -> Self {
        let plant = Plant::new(mounting.motor, mounting.load, mounting.bridge, IDLE_PWM);
        Self {
            mounting,
            command: PlantInput::COAST,
            base: plant.clone(),
            base_at: 0,
            base_flow: Flow::default(),
            ahead: plant,
            flow: Flow::default(),
            past: Flow::default(),
            edges: VecDeque::new(),
            shown: 0,
            sensed: 0.0,
        }
    }

    /// Simulates from the base to the time `to`, ns. Returns the plant at this time, and the flow since the cell's beginning. Notes
    /// the edges of the encoder.
    fn simulate(&mut self, to: u64, battery: f64, epoch: u64) -> (Plant, Flow) {
        let mut plant = self.base.clone();
        let mut flow = self.base_flow;
        let mut at = self.base_at;
        while at < to {
            let end = (at + STEP - (at.wrapping_sub(epoch)) % STEP).min(to);
            let dt = (end - at) as f64 * 1e-9;
            let before = (plant.angle(), plant.speed().0, plant.counts());
            let volts = motor_hub::model::si::Volts(battery);
            flow.append(&plant.run(Seconds(dt), self.command, volts));
            self.hold_between_stops(&mut plant);
            if plant.counts() != before.2 {
                self.note_edges(before, &plant, at, dt);
            }
            at = end;
        }
        (plant, flow)
    }

    fn hold_between_stops(&self, plant: &mut Plant) {
        let Some((low, high)) = self.mounting.stops else {
            return;
        };
        // A stop is in the middle of a count, so that a shaft at the stop does not move across an edge again and again.
        let per_count = core::f64::consts::TAU / self.mounting.motor.counts_per_rev_motor;
        let angle = plant.angle().clamp((low as f64 + 0.5) * per_count, (high as f64 + 0.5) * per_count);
        if angle != plant.angle() {
            plant.set_state(plant.current(), RadPerSec(0.0), angle);
        }
    }

    /// Notes the edges of the encoder within `dt` seconds from the time `start` (ns). Their times follow from the cubic that has the
    /// angles and speeds of both ends.
    fn note_edges(&mut self, before: (f64, f64, i64), after: &Plant, start: u64, dt: f64) {
        let (angle, speed, count) = before;
        let per_count = core::f64::consts::TAU / self.mounting.motor.counts_per_rev_motor;
        let cubic = |s: f64| {
            let (s2, s3) = (s * s, s * s * s);
            (2.0 * s3 - 3.0 * s2 + 1.0) * angle
                + (s3 - 2.0 * s2 + s) * dt * speed
                + (3.0 * s2 - 2.0 * s3) * after.angle()
                + (s3 - s2) * dt * after.speed().0
        };
        let up = after.counts() > count;
        let mut next = count;
        let mut from = 0.0;
        while next != after.counts() {
            // An upward count reaches n at the angle n. A downward count reaches n - 1 just below the angle n.
            let edge = if up { (next + 1) as f64 } else { next as f64 } * per_count;
            next += if up { 1 } else { -1 };
            let (mut low, mut high) = (from, 1.0);
            for _ in 0..30 {
                let middle = f64::midpoint(low, high);
                if (cubic(middle) < edge) == up {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            from = high;
            self.edges.push_back((start + (high * dt * 1e9).round() as u64, next));
        }
    }
}

/// All motors and their battery.
#[derive(Clone, Debug)]
pub(crate) struct Shafts {
    /// The battery. A change counts from the next cell on.
    pub(crate) battery: Battery,
    shafts: Vec<Shaft>,
    /// Voltage at the battery's terminals in the present cell.
    pub(crate) voltage: f64,
    /// Smoothed current that left the battery in the last cells, A.
    pub(crate) current: f64,
    cell_from: u64,
    pub(crate) cell_end: u64,
    grid: Option<Grid>,
}

impl Shafts {
    pub(crate) fn new(battery: Battery, mountings: Vec<Mounting>) -> Self {
        let shafts = mountings.into_iter().map(Shaft::new).collect();
        let voltage = battery.emf.0;
        let mut new =
            Self { battery, shafts, voltage, current: 0.0, cell_from: 0, cell_end: CELL, grid: None };
        new.look_ahead();
        new
    }

    /// Returns the mean current that the current sense of a bridge showed in the last cell, A.
    pub(crate) fn sensed(&self, index: usize) -> f64 {
        self.shafts[index].sensed
    }

    fn epoch(&self) -> u64 {
        self.grid.map_or(0, |grid| grid.epoch)
    }

    /// Simulates all motors to the end of the cell.
    fn look_ahead(&mut self) {
        let (end, battery, epoch) = (self.cell_end, self.voltage, self.epoch());
        for shaft in &mut self.shafts {
            (shaft.ahead, shaft.flow) = shaft.simulate(end, battery, epoch);
        }
    }

    /// Ends the cell, and begins the next one.
    pub(crate) fn next_cell(&mut self) {
        let drawn: f64 = self.shafts.iter().map(|shaft| shaft.flow.battery_charge()).sum();
        let length = (self.cell_end - self.cell_from) as f64 * 1e-9;
        if length > 0.0 {
            // The current is averaged with its last value, as if the capacitors of a supply smoothed it.
            self.current = f64::midpoint(self.current, drawn / length);
        }
        self.voltage = self.battery.voltage(Amps(self.current)).0;
        self.cell_from = self.cell_end;
        self.cell_end += CELL;
        for shaft in &mut self.shafts {
            debug_assert!(shaft.edges.is_empty(), "an edge was left over");
            if length > 0.0 {
                shaft.sensed = shaft.flow.charge_shown.0 / length;
            }
            shaft.base = shaft.ahead.clone();
            shaft.base_at = self.cell_from;
            shaft.base_flow = Flow::default();
            shaft.past.append(&shaft.flow);
        }
        self.look_ahead();
    }

    /// Makes the time `at` the base of motor `index`, because its inputs change then.
    fn rebase(&mut self, index: usize, at: u64) {
        let (battery, epoch) = (self.voltage, self.epoch());
        let shaft = &mut self.shafts[index];
        shaft.edges.clear();
        let (plant, flow) = shaft.simulate(at, battery, epoch);
        shaft.edges.clear();
        shaft.base = plant;
        shaft.base_at = at;
        shaft.base_flow = flow;
    }

    /// Simulates motor `index` again from its base to the end of the cell.
    fn simulate_again(&mut self, index: usize) {
        let (end, battery, epoch) = (self.cell_end, self.voltage, self.epoch());
        let shaft = &mut self.shafts[index];
        shaft.edges.clear();
        // Rounding may have moved an edge across the base. The edge then comes at the base.
        let mut shown = shaft.shown;
        while shown != shaft.base.counts() {
            shown += (shaft.base.counts() - shown).signum();
            shaft.edges.push_back((shaft.base_at, shown));
        }
        (shaft.ahead, shaft.flow) = shaft.simulate(end, battery, epoch);
    }

    /// Changes the lines of the bridge of motor `index` at the time `at`, ns.
    pub(crate) fn command(&mut self, index: usize, at: u64, lines: Lines) {
        self.rebase(index, at);
        let ticks = self.grid.map_or(1, |grid| grid.ticks);
        let [on, off] = [true, false].map(|high| lines.state(high));
        let (on, off, duty) = match lines.pwm {
            Output::Level(true) => (on, on, 1.0),
            Output::Level(false) => (off, off, 0.0),
            Output::Pulse(high) => (on, off, f64::from(high) / f64::from(ticks)),
        };
        let command = &mut self.shafts[index].command;
        *command = PlantInput { on, off, duty, ..*command };
        self.simulate_again(index);
    }

    /// Sets the external torque on the output shaft of motor `index` from the time `at` (ns) on, N m.
    pub(crate) fn set_torque(&mut self, index: usize, at: u64, torque: f64) {
        self.rebase(index, at);
        self.shafts[index].command.torque_after = NewtonMetres(torque);
        self.simulate_again(index);
    }

    /// Starts a PWM period of all plants at the time `at` (ns), because the PWM timer starts one.
    pub(crate) fn set_grid(&mut self, at: u64, grid: Grid) {
        for index in 0..self.shafts.len() {
            self.rebase(index, at);
            let shaft = &mut self.shafts[index];
            let mounting = &shaft.mounting;
            let mut plant =
                Plant::new(mounting.motor, mounting.load, mounting.bridge, Hertz(1.0 / grid.seconds()));
            plant.set_state(shaft.base.current(), shaft.base.speed(), shaft.base.angle());
            shaft.base = plant;
        }
        self.grid = Some(grid);
        // From here on each cell has whole periods.
        self.cell_end = at + CELL;
        for index in 0..self.shafts.len() {
            self.simulate_again(index);
        }
    }

    /// Returns the time of the next edge of any encoder, ns.
    pub(crate) fn next_edge(&self) -> Option<u64> {
        self.shafts.iter().filter_map(|shaft| shaft.edges.front()).map(|&(at, _)| at).min()
    }

    /// Removes an edge whose time is at most `now` (ns), and shows the count after the edge. Returns its motor.
    pub(crate) fn take_edge(&mut self, now: u64) -> Option<usize> {
        self.shafts.iter_mut().position(|shaft| {
            let edge = shaft.edges.pop_front_if(|(at, _)| *at <= now);
            edge.inspect(|(_, count)| shaft.shown = *count).is_some()
        })
    }

    /// Returns the count that the lines of an encoder show.
    pub(crate) fn shown(&self, index: usize) -> i64 {
        self.shafts[index].shown
    }

    /// Returns motion and current of motor `index` at the time `at` (ns), which must be in the cell.
    pub(crate) fn look(&self, index: usize, at: u64) -> Look {
        let mut shaft = self.shafts[index].clone();
        let (plant, flow) = shaft.simulate(at.min(self.cell_end), self.voltage, self.epoch());
        shaft.past.append(&flow);
        let per_rad = shaft.mounting.motor.counts_per_rev_motor / core::f64::consts::TAU;
        Look {
            counts_per_second: plant.speed().0 * per_rad,
            counts: plant.counts(),
            current: plant.current().0,
            flow: shaft.past,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.shafts.len()
    }
}
