//! Runs the hub's own tasks against the world, in virtual time.
//!
//! The tasks are one future, polled when its waker says so. Between polls the clock of the mock time
//! driver and the plants advance together, a millisecond at a time: the interval at which the
//! encoders are sampled, so nothing the hub could notice falls between.

use crate::scenario::{MOTORS, Motor, Scenario, emf_constant};
use crate::trace::{Sample, Tick, Trace};
use crate::world::Board;
use embassy_futures::join::{join, join5};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, Instant, MockDriver, Timer};
use motor_hub::hub::{Action, Command, Hub, Snapshot};
use motor_hub::model::si::Seconds;
use motor_hub::motor::Settings;
use motor_hub::supply::{Limits, Supply};
use motor_hub::tasks::{self, Health, Links};
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Wake, Waker};

const STEP_S: f64 = 1e-3;

/// Set by a waker: the tasks have something to do.
struct Flag(AtomicBool);

impl Wake for Flag {
    fn wake(self: Arc<Self>) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Runs a scenario; `progress` is told the virtual time in seconds now and then.
///
/// The time driver is one for the whole process, so only one run at a time is possible in it.
///
/// # Errors
/// If a motor's constants do not fit the firmware, or if the hub's watchdog was not fed.
pub fn run(scenario: &Scenario, progress: &mut dyn FnMut(f64)) -> Result<Trace, String> {
    let driver = MockDriver::get();
    driver.reset();
    let board = Board::new(scenario);
    let links = Links::<NoopRawMutex, MOTORS>::new();
    let health = Health::new();
    let mut snapshots = links.snapshot.receiver().ok_or("the hub has no receiver to spare")?;

    let mut hub = Hub::new(all_settings(&scenario.motors)?, scenario.period);
    let scale = Board::scale().map_err(|e| e.to_string())?;
    let supply = Supply::new(scale, Limits::default());
    let tasks = join5(
        tasks::capture::run(board.clone(), &links, &health),
        tasks::supply::run(board.clone(), supply, &links, &health),
        tasks::control::run(&mut hub, &links, &health),
        tasks::output::run(board.clone(), scenario.period, &links, &health),
        tasks::health::run(board.clone(), &health),
    );
    let mut everything = pin!(join(tasks, operate(scenario, &links)));

    let flag = Arc::new(Flag(AtomicBool::new(true)));
    let waker = Waker::from(flag.clone());
    let mut context = Context::from_waker(&waker);
    let mut trace = Trace::default();
    for step in 0..(scenario.duration_s / STEP_S).round() as u64 {
        let now_s = step as f64 * STEP_S;
        while flag.0.swap(false, Ordering::Relaxed) {
            // The tasks never end, so there is no result to look at.
            let _ = everything.as_mut().poll(&mut context);
        }
        let torques: Vec<f64> = scenario.motors.iter().map(|m| m.torque_at(now_s)).collect();
        if let Some(snapshot) = snapshots.try_changed() {
            trace.ticks.push(observe(&board, &snapshot, &torques));
        }
        board.set_emf(scenario.emf_at(now_s));
        let flows = board.run(Seconds(STEP_S), &torques);
        for (sample, flow) in
            trace.ticks.iter_mut().last().map(|t| &mut t.motors).into_iter().flatten().zip(&flows)
        {
            sample.flow.append(flow);
        }
        driver.advance(Duration::from_millis(1));
        if step % 256 == 0 {
            progress(now_s);
        }
    }
    if board.starved() {
        return Err("the hub did not feed its watchdog: a real board would have been reset".into());
    }
    Ok(trace)
}

/// Settings of every channel; those without a motor stay disabled, whatever their settings.
fn all_settings(motors: &[Motor]) -> Result<[Settings; MOTORS], String> {
    let first = motors.first().ok_or("a scenario without a motor")?;
    let spare = Settings::new(emf_constant(&first.constants).map_err(|e| e.to_string())?);
    let mut settings = [spare; MOTORS];
    for (slot, motor) in settings.iter_mut().zip(motors) {
        *slot = motor.settings().map_err(|e| format!("{}: {e}", motor.label))?;
    }
    Ok(settings)
}

/// The host that tells the hub what to do, when the scenario says so.
async fn operate(scenario: &Scenario, links: &Links<NoopRawMutex, MOTORS>) {
    let mut commands: Vec<(f64, Command)> = Vec::new();
    for (motor, plan) in scenario.motors.iter().enumerate() {
        let set = |value| Command { motor, action: Action::Set(value) };
        commands.extend(plan.setpoints.iter().map(|timed| (timed.at_s, set(timed.value))));
    }
    commands.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (at_s, command) in commands {
        Timer::at(Instant::from_micros((at_s * 1e6).round() as u64)).await;
        links.commands.send(command).await;
    }
}

fn observe(board: &Board, snapshot: &Snapshot<MOTORS>, torques: &[f64]) -> Tick {
    let view = board.view();
    let motors = view.motors.into_iter().zip(&snapshot.motors).zip(torques);
    Tick {
        at_s: snapshot.at.0 as f64 * 1e-6,
        battery_v: view.battery_v,
        measured_v: snapshot.battery.map(|mv| f64::from(mv.0) * 1e-3),
        motors: motors
            .map(|(((speed_cps, counts), report), &torque_nm)| Sample {
                report: *report,
                speed_cps,
                counts,
                torque_nm,
                flow: Default::default(),
            })
            .collect(),
    }
}
