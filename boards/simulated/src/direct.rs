//! A scenario's run without tasks and clock: encoders, battery, hub and bridges one after the other, as the
//! tasks of a board do it that is never late. Such runs need nothing of the process, so many may go on at once,
//! each on a thread of its own; what comes of them is what [`sim::run`] gives.
//!
//! ```
//! use simulated::{direct, scenario::Scenario};
//!
//! let mut milliseconds = 0;
//! direct::run(&Scenario::default_one()?, |_| milliseconds += 1)?;
//! assert_eq!(milliseconds, 10_000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::hardware::MOTORS;
use crate::scenario::Scenario;
use crate::sim::{self, RunError, STEP_S};
use embassy_futures::block_on;
use motor_hub::board::{BridgeFaults, Bridges, Encoders, SupplyAdc};
use motor_hub::bridge::Sensed;
use motor_hub::hub::{Hub, Inputs, Snapshot};
use motor_hub::model::si::Seconds;
use motor_hub::motion::Tracker;
use motor_hub::supply::{Limits, Supply};
use motor_hub::tasks::bridges::SENSE_INTERVAL;
use motor_hub::tasks::supply::SUPPLY_INTERVAL;
use motor_hub::units::Micros;

/// Everything at one millisecond.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Milliseconds since the start.
    pub ms: u64,
    /// The newest snapshot.
    pub snapshot: &'a Snapshot<MOTORS>,
    /// Voltage at the battery's terminals.
    pub battery_v: f64,
    /// True speed in counts/s and true position in counts, by motor.
    pub motors: &'a [(f64, i64)],
}

/// Runs a scenario; `each` sees every millisecond, after a tick if there is one then.
///
/// # Errors
/// If a motor's constants do not fit the firmware.
pub fn run(scenario: &Scenario, mut each: impl FnMut(Moment<'_>)) -> Result<(), RunError> {
    let mut board = sim::board(scenario);
    let mut hub = Hub::new(sim::all_settings(&scenario.motors, scenario.period)?, scenario.period);
    let mut supply = Supply::new(Limits::default());
    let mut commands = scenario.commands().into_iter().peekable();
    let mut trackers = [Tracker::default(); MOTORS];
    let (mut battery, mut snapshot) = (None, Snapshot::INITIAL);
    for ms in 0..(scenario.duration_s / STEP_S).round() as u64 {
        let now = Micros::new(1_000 * ms);
        let mut readings = [None; MOTORS];
        for ((reading, tracker), count) in readings.iter_mut().zip(&mut trackers).zip(board.counts()) {
            *reading = count.map(|count| tracker.step(count, now));
        }
        hub.sample(&readings);
        if ms.is_multiple_of(SENSE_INTERVAL.as_millis()) {
            hub.sense(&board.faults().map(|fault| Sensed { current: None, fault }));
        }
        if ms.is_multiple_of(SUPPLY_INTERVAL.as_millis()) {
            battery = supply.step(block_on(board.sample()), now).or(battery);
        }
        if ms > 0 && ms % u64::from(scenario.period.as_millis()) == 0 {
            while let Some(due) = commands.next_if(|command| (command.at_s / STEP_S).round() as u64 <= ms) {
                // Scenarios know their motors.
                let _ = hub.apply(due.value);
            }
            snapshot = hub.step(Inputs { now, readings, battery });
            board.apply(&snapshot.drives());
        }
        let view = board.view();
        each(Moment { ms, snapshot: &snapshot, battery_v: view.battery_v, motors: &view.motors });
        let now_s = ms as f64 * STEP_S;
        sim::change(scenario, &board, now_s);
        board.run(Seconds(STEP_S), &sim::torques(scenario, now_s));
    }
    Ok(())
}

#[cfg(test)]
#[expect(clippy::expect_used, reason = "a failed expectation is a failed test")]
mod tests {
    use super::*;

    #[test]
    fn a_run_without_tasks_is_the_run_with_them() {
        for period_ms in [1, 50] {
            let mut scenario = Scenario::default_one().expect("it is valid");
            scenario.duration_s = 2.0;
            scenario.period = motor_hub::units::Period::from_millis(period_ms).expect("in range");
            // A host that sends several commands in one millisecond needs more than that.
            for (index, motor) in scenario.motors.iter_mut().enumerate() {
                motor.setpoints.iter_mut().for_each(|setpoint| setpoint.at_s += 1e-3 * index as f64);
            }
            let trace = sim::run(&scenario, &mut |_| ()).expect("it runs");
            let mut ticks = trace.ticks.iter().peekable();
            run(&scenario, |moment| {
                let at_s = moment.ms as f64 / 1e3;
                let Some(tick) = ticks.next_if(|tick| tick.at_s <= at_s) else { return };
                assert_eq!((tick.at_s, tick.battery_v), (at_s, moment.battery_v));
                for ((sample, &(speed, counts)), report) in
                    tick.motors.iter().zip(moment.motors).zip(&moment.snapshot.motors)
                {
                    assert_eq!((sample.speed_cps, sample.counts), (speed, counts), "at {at_s} s");
                    assert_eq!(&sample.report, report, "at {at_s} s");
                }
            })
            .expect("it runs");
            assert!(ticks.next().is_none());
        }
    }
}
