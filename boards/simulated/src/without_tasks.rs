//! Runs a scenario without tasks and clock. Encoders, battery, hub and bridges take their steps one after the other,
//! like the tasks of a board that are never late. Runs on several threads do not disturb each other. The results are
//! equal to the results of [`sim::run`], with two exceptions. When the voltage of a bus leaves its quiet range, the hub
//! reacts within 0.1 ms, as on a chip. In [`sim::run`] the hub reacts within 1 ms, the step of the time driver. The hub
//! reads no gyro, so a drive base measures its heading by its encoders alone.
//!
//! ```
//! use simulated::{scenario::Scenario, without_tasks};
//!
//! let mut milliseconds = 0;
//! without_tasks::run(&Scenario::default_one()?, |_| milliseconds += 1)?;
//! assert_eq!(milliseconds, 10_000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::hardware::MOTORS;
use crate::scenario::Scenario;
use crate::sim::{self, RunError, STEP_S};
use crate::world::{Board, View};
use embassy_futures::block_on;
use motor_hub::board::{BridgeSensors, Bridges, Encoders, SupplyAdc};
use motor_hub::bridge::Drive;
use motor_hub::hub::{Command, Hub, Snapshot};
use motor_hub::model::si::Seconds;
use motor_hub::motion::Tracker;
use motor_hub::supply::Supply;
use motor_hub::tasks::bridges::SENSE_INTERVAL;
use motor_hub::tasks::supply::{SUPPLY_INTERVAL, WATCH_INTERVAL};
use motor_hub::units::Micros;

/// Parts of a millisecond in which the bus is watched. On a chip the converter's watchdog and the tasks that it wakes
/// take less than one part.
const PARTS: u64 = 10;

/// State of a run at one millisecond.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Milliseconds since the start.
    pub ms: u64,
    /// The newest snapshot.
    pub snapshot: &'a Snapshot<MOTORS>,
    /// Commands of the bridges.
    pub drives: &'a [Drive; MOTORS],
    /// State of the world.
    pub view: &'a View,
}

/// Runs a scenario. `each` is called every millisecond, after the tick if one is due.
///
/// # Errors
/// If a motor's constants do not fit the firmware, or if a group uses the gyro, which only tasks read.
pub fn run(scenario: &Scenario, mut each: impl FnMut(Moment<'_>)) -> Result<(), RunError> {
    if scenario.groups.iter().any(|group| group.use_gyro) {
        return Err(RunError::Gyro);
    }
    let mut board = Board::new(scenario);
    let mut hub = Hub::new(sim::all_settings(&scenario.motors)?, scenario.period);
    let mut supply = Supply::new(scenario.limits());
    let mut commands = scenario.commands().into_iter().peekable();
    let mut waiting = Vec::new();
    let mut trackers = [Tracker::default(); MOTORS];
    let mut look_ms = 0;
    let (mut battery, mut snapshot) = (None, Snapshot::INITIAL);
    let mut drives = snapshot.drives();
    for ms in 0..(scenario.duration_s / STEP_S).round() as u64 {
        let now = Micros::new(1_000 * ms);
        let mut readings = [None; MOTORS];
        for ((reading, tracker), count) in readings.iter_mut().zip(&mut trackers).zip(board.counts()) {
            *reading = count.map(|count| tracker.step(count, now));
        }
        hub.sample(&readings);
        // A direct command is applied a millisecond after it was sent, without waiting for a tick.
        if waiting.iter().any(Command::is_direct) {
            obey(&mut hub, &mut waiting);
            if let Some(changed) = hub.execute_direct(now, battery) {
                drives = changed;
                board.apply(&drives);
            }
        }
        if ms.is_multiple_of(SENSE_INTERVAL.as_millis()) {
            hub.set_bridge_feedback(&block_on(BridgeSensors::sample(&mut board)));
        }
        let alarm = supply.quiet().is_some_and(|quiet| board.has_left(&quiet));
        if alarm || ms >= look_ms {
            let sample = supply.step(block_on(SupplyAdc::sample(&mut board)), now);
            battery = sample.or(battery);
            if let Some(changed) = sample.and_then(|sample| hub.apply_limits(sample)) {
                drives = changed;
                board.apply(&drives);
            }
            let quiet = supply.quiet().is_some() && !alarm;
            look_ms = ms + if quiet { SUPPLY_INTERVAL } else { WATCH_INTERVAL }.as_millis();
        }
        while let Some(due) = commands.next_if(|command| (command.at_s / STEP_S).round() as u64 <= ms) {
            waiting.push(due.value);
        }
        if ms > 0 && ms % u64::from(scenario.period.as_millis()) == 0 {
            obey(&mut hub, &mut waiting);
            snapshot = hub.step(now, &readings, battery);
            drives = snapshot.drives();
            board.apply(&drives);
        }
        each(Moment { ms, snapshot: &snapshot, drives: &drives, view: &board.view() });
        let now_s = ms as f64 * STEP_S;
        board.change(scenario, now_s);
        let torques = sim::torques(scenario, now_s);
        // Without a capacitor the voltage is not watched within a millisecond.
        let parts = if scenario.bus.is_some() { PARTS } else { 1 };
        for part in 1..=parts {
            board.run(Seconds(STEP_S / parts as f64), &torques);
            if part < parts && supply.quiet().is_some_and(|quiet| board.has_left(&quiet)) {
                let now = Micros::new(1_000 * ms + 1_000 * part / parts);
                let sample = supply.step(block_on(SupplyAdc::sample(&mut board)), now);
                battery = sample.or(battery);
                if let Some(changed) = sample.and_then(|sample| hub.apply_limits(sample)) {
                    drives = changed;
                    board.apply(&drives);
                }
                look_ms = ms + 1;
            }
        }
    }
    Ok(())
}

fn obey(hub: &mut Hub<MOTORS>, waiting: &mut Vec<Command>) {
    for command in waiting.drain(..) {
        // No command fails, because the motors of a scenario exist.
        let _ = hub.apply(command);
    }
}
