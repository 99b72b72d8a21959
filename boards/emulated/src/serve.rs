//! Runs an image in real time, and connects its serial line to a line of this computer.
//!
//! ```no_run
//! use emulated::{Board, serve};
//! let line = simulated::serve::tcp("127.0.0.1:7070")?;
//! serve::run(&serve::scenario(), Board::NucleoF429zi, false, line, &mut |_| true)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::time::Duration;

use motor_hub::model::catalogue::characterised;
use motor_hub::protocol::requests::Standard;
use simulated::scenario::Scenario;
use simulated::serve::{BYTES_A_STEP, Line, Moment, line_on, pace};

use crate::board::Board;
use crate::host_link::HostLink;
use crate::replay::{ReplayError, check, drive, stand};

const STEP: Duration = Duration::from_millis(1);

/// Virtual time from a reset until a motor can be enabled.
const BOOT: Duration = Duration::from_millis(200);

/// An address that the image does not have.
const OTHER: u8 = 254;

/// Time without a byte after which a reply is complete. It is longer than four bytes take.
const PAUSE: Duration = Duration::from_micros(100);

/// Number of waiting bytes above which the bytes are sent without waiting for a pause. It exceeds the length of the
/// longest reply.
const LONGEST: usize = 192;

/// Returns the scenario that is served by default, with the motors that the image is set up for.
#[must_use]
pub fn scenario() -> Scenario {
    let mut scenario = Scenario::to_serve();
    if let Ok(motor) = characterised("AM 60 A") {
        let motor = motor.with_measured_rotor_inertia();
        scenario.motors.iter_mut().for_each(|plan| *plan = plan.with_constants(motor));
    }
    scenario
}

/// Serves a board's image with the motors, loads and battery of a scenario, as [`simulated::serve::run`] serves the
/// simulated board. The battery's voltage, the torques and the encoders change at the times of the scenario. With
/// `bootloader` the board's bootloader starts the image. If the scenario has a wire, digital pins 0 and 1 are
/// connected.
///
/// # Errors
/// Returns an error if the bench lacks a part of the scenario, or if the emulator had a gap.
pub fn run(
    scenario: &Scenario,
    board: Board,
    bootloader: bool,
    mut line: Box<dyn Line>,
    show: &mut dyn FnMut(Moment<'_>) -> bool,
) -> Result<(), ReplayError> {
    check(scenario, scenario.not_emulated().next())?;
    let mut bench = stand(scenario, board, bootloader);
    let mut chunk = [0; BYTES_A_STEP];
    let mut reply: Vec<u8> = Vec::new();
    if scenario.wire.is_some() {
        bench.wire_pins();
    }
    bench.run(BOOT);
    // The emulator takes time to translate code that it executes for the first time. So the firmware receives a packet
    // for another hub before a host waits for an answer.
    bench.send(&HostLink::default().to(OTHER).packet(Standard::KeepAlive.number(), &[]));
    bench.run(BOOT);
    pace(|step, lost| {
        let at_s = step as f64 * STEP.as_secs_f64();
        let length = line.receive(&mut chunk);
        if let Some(bytes @ [_, ..]) = chunk.get(..length) {
            bench.send(bytes);
        }
        let before_s = at_s - STEP.as_secs_f64();
        for (index, motor) in scenario.motors.iter().enumerate() {
            if motor.torque_at(at_s) != motor.torque_at(before_s) || step == 0 {
                bench.set_torque(index, motor.torque_at(at_s));
            }
            if motor.encoder_at(at_s) != motor.encoder_at(before_s) {
                bench.set_encoder(index, motor.encoder_at(at_s));
            }
        }
        if scenario.emf_at(at_s) != scenario.emf_at(before_s) {
            bench.set_battery(scenario.emf_at(at_s).0);
        }
        bench.run(STEP);
        let heard = bench.receive();
        reply.extend(heard.iter().map(|byte| byte.byte));
        // The bytes of a reply are sent together, because some hosts do not wait for the bytes after the first one.
        let ended = heard.last().is_none_or(|last| bench.now() - last.at > PAUSE);
        if !reply.is_empty() && (ended || reply.len() > LONGEST) {
            let sent = line.send(&reply);
            reply.drain(..sent);
        }
        let describe = &mut || {
            let motors: Vec<_> = (0..bench.motors())
                .map(|motor| (bench.look(motor).counts_per_second, drive(&mut bench, motor)))
                .collect();
            line_on(bench.battery().0, motors.into_iter())
        };
        let (taken, rejected_hosts) = (line.is_taken(), line.rejected_hosts());
        Ok(show(Moment { at_s, awake: true, taken, lost, rejected_hosts, describe }))
    })?;
    let gaps = bench.gaps();
    if gaps.is_empty() { Ok(()) } else { Err(ReplayError::Gaps(gaps)) }
}
