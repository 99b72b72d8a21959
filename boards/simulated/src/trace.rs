//! The record of a run: the state at each control tick, charge and energy until the next tick, and the true motion.
//!
//! ```
//! use simulated::{scenario::Scenario, sim};
//!
//! let scenario = Scenario { duration_s: 1.0, ..Scenario::default_one()? };
//! let trace = sim::run(&scenario, &mut |_| ())?;
//! let fastest = trace.motor(0).map(|(_, sample)| sample.speed_cps).fold(0.0, f64::max);
//! assert!(fastest > 100.0, "{fastest} counts/s");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use motor_hub::group::Pose;
use motor_hub::hub::BaseState;
use motor_hub::model::plant::Flow;
use motor_hub::motor::Report;
use motor_hub::units::Control;

/// A whole run.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Charge and energy of each motor before the first control tick.
    pub before: Vec<Flow>,
    /// Control ticks by time.
    pub ticks: Vec<Tick>,
    /// True motion of each motor by time: at every millisecond on the simulated board, at every control tick on an
    /// emulated chip.
    pub motion: Vec<Vec<Point>>,
}

/// The true motion of a motor at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Seconds since the start.
    pub at_s: f64,
    /// Speed in counts per second.
    pub speed_cps: f64,
    /// Position in counts.
    pub counts: i64,
}

/// One control tick.
#[derive(Clone, Debug)]
pub struct Tick {
    /// Seconds since the start.
    pub at_s: f64,
    /// True voltage at the battery's terminals.
    pub battery_v: f64,
    /// Voltage that the hub has measured; `None` without a measurement.
    pub measured_v: Option<f64>,
    /// State of the drive base in the hub; `None` without a drive base, and on an emulated chip.
    pub base: Option<BaseState>,
    /// True position and heading of the drive base; the origin on an emulated chip.
    pub pose: Pose,
    /// Samples of the motors.
    pub motors: Vec<Sample>,
}

/// One motor at one control tick.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Report of the hub.
    pub report: Report,
    /// Control value of the hub's command.
    pub control: Control,
    /// True speed in counts per second.
    pub speed_cps: f64,
    /// True position in counts.
    pub counts: i64,
    /// External torque on the output shaft in newton metres.
    pub torque_nm: f64,
    /// Charge and energy from this tick to the next.
    pub flow: Flow,
}

impl Trace {
    /// One motor's ticks: time in seconds and sample.
    pub fn motor(&self, index: usize) -> impl Iterator<Item = (f64, &Sample)> {
        self.ticks.iter().filter_map(move |tick| Some((tick.at_s, tick.motors.get(index)?)))
    }

    /// Adds the charge and energy of every motor in a step after the last tick.
    pub fn push_flows(&mut self, flows: &[Flow]) {
        let Some(tick) = self.ticks.last_mut() else {
            self.before.resize(flows.len(), Flow::default());
            return self.before.iter_mut().zip(flows).for_each(|(before, flow)| before.append(flow));
        };
        tick.motors.iter_mut().zip(flows).for_each(|(sample, flow)| sample.flow.append(flow));
    }

    /// Adds the speed and the position of every motor at a time in seconds.
    pub fn push_motion(&mut self, at_s: f64, motors: impl IntoIterator<Item = (f64, i64)>) {
        for (index, (speed_cps, counts)) in motors.into_iter().enumerate() {
            if index == self.motion.len() {
                self.motion.push(Vec::new());
            }
            if let Some(points) = self.motion.get_mut(index) {
                points.push(Point { at_s, speed_cps, counts });
            }
        }
    }
}
