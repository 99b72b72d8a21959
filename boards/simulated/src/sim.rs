//! Runs the hub's own tasks against the world, in virtual time.
//!
//! All tasks are parts of one future, which is polled after its waker was called. Between polls the clock of the mock
//! time driver and the plants advance together by a millisecond. The hub samples its encoders at the same interval, so
//! no sample falls between two steps.
//!
//! ```
//! use simulated::{scenario::Scenario, sim};
//!
//! let scenario = Scenario { duration_s: 0.5, ..Scenario::default_one()? };
//! let trace = sim::run(&scenario, &mut |_| ())?;
//! // A control tick every 50 ms, the first at 50 ms; the tick of 500 ms would be the next.
//! assert_eq!(trace.ticks.len(), 9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::hardware::MOTORS;
use crate::i2c::SimulatedBus;
use crate::scenario::{Motor, Scenario, Timed};
use crate::trace::{Sample, Tick, Trace};
use crate::world::Board;
use embassy_futures::join::{join, join_array, join3, join5};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, Instant, MockDriver, Timer};
use motor_hub::board::I2C_BUSES;
use motor_hub::hub::{Hub, Snapshot};
use motor_hub::model::si::Seconds;
use motor_hub::motor::Settings;
use motor_hub::supply::Supply;
use motor_hub::tasks::{self, Health};
use motor_hub::units::RangeError;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Wake, Waker};

/// Error of a run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RunError {
    /// A motor's constants do not fit the firmware.
    #[error("{label}: {error}")]
    Motor {
        /// Label of the motor.
        label: String,
        /// The constant that does not fit, and the allowed range.
        error: RangeError,
    },
    /// The scenario has no motor.
    #[error("the scenario has no motor; it needs 1 to 4")]
    NoMotors,
    /// A run without tasks cannot read the gyro of the scenario.
    #[error("a run without tasks has no gyro; run a scenario with use_gyro with tasks")]
    Gyro,
    /// The hub did not feed its watchdog.
    #[error("the hub did not feed its watchdog: a real board would have been reset")]
    Starved,
    /// All receivers of the hub's snapshots are in use.
    #[error("all receivers of the hub's snapshots are in use")]
    Unobserved,
}

/// Step of the clock and of the world in seconds.
pub(crate) const STEP_S: f64 = 1e-3;

/// Channels and signals between the tasks of the hub.
pub(crate) type Wires = tasks::Wires<NoopRawMutex, MOTORS>;

/// Set by a waker: the tasks have something to do.
struct Flag(AtomicBool);

impl Wake for Flag {
    fn wake(self: Arc<Self>) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Polls a future that never ends, whenever its waker was called.
pub(crate) struct Executor {
    flag: Arc<Flag>,
    waker: Waker,
}

impl Executor {
    pub(crate) fn new() -> Self {
        let flag = Arc::new(Flag(AtomicBool::new(true)));
        Self { waker: Waker::from(flag.clone()), flag }
    }

    /// Makes the next call of `run` poll the future, even if the waker was not called.
    pub(crate) fn wake(&self) {
        self.waker.wake_by_ref();
    }

    /// Polls the future until the waker is no longer called.
    pub(crate) fn run<T>(&self, mut future: Pin<&mut (impl Future<Output = T> + ?Sized)>) {
        while self.flag.0.swap(false, Ordering::Relaxed) {
            // The tasks never end, so there is no result to look at.
            let _ = future.as_mut().poll(&mut Context::from_waker(&self.waker));
        }
    }
}

/// Returns the hub's tasks on the simulated board, without the task that commands the motors.
pub(crate) fn tasks<'a>(
    scenario: &Scenario,
    board: &Board,
    wires: &'a Wires,
    health: &'a Health,
) -> Result<impl Future + use<'a>, RunError> {
    let (settings, period, board) = (all_settings(&scenario.motors)?, scenario.period, board.clone());
    let supply = Supply::new(scenario.limits());
    Ok(async move {
        let mut hub = Hub::new(settings, period);
        let bridges = tasks::bridges::run(board.clone(), wires, health);
        let others = join5(
            tasks::capture::run(board.clone(), wires, health),
            tasks::supply::run(board.clone(), supply, wires, health),
            tasks::control::run(&mut hub, wires, health),
            tasks::output::run(board.clone(), period, wires, health),
            tasks::health::run(|| board.feed_watchdog(), health),
        );
        let buses: [usize; I2C_BUSES] = std::array::from_fn(|bus| bus);
        let transfers =
            join_array(buses.map(|bus| tasks::i2c::run(SimulatedBus::new(board.clone(), bus), bus, wires)));
        join3(bridges, others, transfers).await
    })
}

/// External torques on the output shafts in newton metres.
pub(crate) fn torques(scenario: &Scenario, now_s: f64) -> Vec<f64> {
    scenario.motors.iter().map(|m| m.torque_at(now_s)).collect()
}

/// Runs a scenario. `progress` is called from time to time with the virtual time in seconds.
///
/// All runs of a process share its only time driver. So a process can do only one run at a time.
///
/// # Errors
/// If a motor's constants do not fit the firmware, or if the hub's watchdog was not fed.
pub fn run(scenario: &Scenario, progress: &mut dyn FnMut(f64)) -> Result<Trace, RunError> {
    MockDriver::get().reset();
    let settings = all_settings(&scenario.motors)?;
    let (board, wires, health) = (Board::new(scenario), Wires::new(), Health::new());
    let mut snapshots = wires.snapshot.receiver().ok_or(RunError::Unobserved)?;
    let tasks = tasks(scenario, &board, &wires, &health)?;
    let mut everything = pin!(join(tasks, operate(scenario, &wires)));

    let executor = Executor::new();
    let mut trace = Trace::default();
    for step in 0..(scenario.duration_s / STEP_S).round() as u64 {
        let now_s = step as f64 * STEP_S;
        executor.run(everything.as_mut());
        let torques = torques(scenario, now_s);
        if let Some(snapshot) = snapshots.try_changed() {
            trace.ticks.push(observe(&board, &settings, &snapshot, &torques));
        }
        // Division gives exactly the number to which a decimal in a scenario file is parsed. Multiplication may differ
        // in the last bit.
        trace.push_motion(step as f64 / 1e3, board.view().motors);
        board.change(scenario, now_s);
        let flows = board.run(Seconds(STEP_S), &torques);
        MockDriver::get().advance(Duration::from_millis(1));
        trace.push_flows(&flows);
        if step % 256 == 0 {
            progress(now_s);
        }
    }
    if board.starved() { Err(RunError::Starved) } else { Ok(trace) }
}

/// Returns the settings of every channel. A channel without a motor has the settings of the first motor, and is never
/// enabled.
pub(crate) fn all_settings(motors: &[Motor]) -> Result<[Settings; MOTORS], RunError> {
    let spare = motors.first().ok_or(RunError::NoMotors)?;
    let mut settings = [settings_of(spare)?; MOTORS];
    for (slot, motor) in settings.iter_mut().zip(motors) {
        *slot = settings_of(motor)?;
    }
    Ok(settings)
}

/// Returns the hub's settings for a motor.
///
/// # Errors
/// If a constant of the motor does not fit the firmware.
pub fn settings_of(motor: &Motor) -> Result<Settings, RunError> {
    motor.settings().map_err(|error| RunError::Motor { label: motor.label.clone(), error })
}

/// The host, which sends the scenario's commands at their times.
async fn operate(scenario: &Scenario, wires: &Wires) {
    for Timed { at_s, value: command } in scenario.commands() {
        Timer::at(Instant::from_micros((at_s * 1e6).round() as u64)).await;
        wires.send(command).await;
    }
}

fn observe(
    board: &Board,
    settings: &[Settings; MOTORS],
    snapshot: &Snapshot<MOTORS>,
    torques: &[f64],
) -> Tick {
    let view = board.view();
    let motors = view.motors.into_iter().zip(&snapshot.motors).zip(settings).zip(torques);
    Tick {
        // Division gives exactly the number to which a decimal in a scenario file is parsed. Multiplication may differ
        // in the last bit.
        at_s: snapshot.at.get() as f64 / 1e6,
        battery_v: view.battery_v,
        measured_v: snapshot.battery.map(|mv| f64::from(mv.get()) * 1e-3),
        base: snapshot.base,
        pose: board.pose(),
        motors: motors
            .map(|((((speed_cps, counts), report), settings), &torque_nm)| Sample {
                report: *report,
                control: report.control(settings),
                speed_cps,
                counts,
                torque_nm,
                flow: Default::default(),
            })
            .collect(),
    }
}
