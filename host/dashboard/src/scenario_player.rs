//! Sends a scenario's set-points to the hub at their times.

use crate::executor::drive;
use crate::hub::RequestError;
use motor_hub::hub::Command;
use motor_hub::motor::{self, ZeroPower};
use motor_hub::units::CountsPerSecond;
use motor_hub_client::Session;
use motor_hub_client::clock::Instant;
use motor_hub_client::motor::{NO_SPEED_LIMIT_CPS, Setpoint};
use simulated::scenario::{Scenario, Timed};
use std::time::Duration;

/// Set-points of a scenario, by ascending times.
#[derive(Clone, Debug)]
pub struct Script {
    length: Duration,
    steps: Vec<(Duration, Step)>,
}

#[derive(Clone, Copy, Debug)]
struct Step {
    motor: u8,
    zero: ZeroPower,
    /// `None` disables the motor.
    setpoint: Option<Setpoint>,
}

/// State of a script that is being played.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Playing {
    since: Instant,
    /// Number of steps that were sent.
    done: usize,
}

impl Script {
    /// The script of a scenario; `None` if the scenario has no set-points, or moves motors in step.
    pub fn of(scenario: &Scenario) -> Option<Self> {
        let step = |Timed { at_s, value }: Timed<Command>| {
            let Command::Set { motor, setpoint } = value else { return None };
            let zero = scenario.motors.get(motor)?.zero_power;
            let step = Step { motor: u8::try_from(motor).ok()?, zero, setpoint: for_host(setpoint) };
            Some((Duration::from_secs_f64(at_s), step))
        };
        let steps: Option<Vec<_>> = scenario.commands().into_iter().map(step).collect();
        let steps = steps.filter(|steps| !steps.is_empty())?;
        Some(Self { length: Duration::from_secs_f64(scenario.duration_s), steps })
    }

    /// Starts playing.
    pub(crate) fn begin() -> Playing {
        Playing { since: Instant::now(), done: 0 }
    }

    /// Sends the set-points that are due; true once the scenario is over.
    pub(crate) fn go_on(&self, playing: &mut Playing, session: &mut Session) -> Result<bool, RequestError> {
        let passed = playing.since.elapsed();
        while let Some((_, step)) = self.steps.get(playing.done).filter(|(at, _)| *at <= passed) {
            step.send(session)?;
            playing.done += 1;
        }
        Ok(passed >= self.length)
    }
}

impl Step {
    fn send(&self, session: &mut Session) -> Result<(), RequestError> {
        let Some(setpoint) = self.setpoint else { return Ok(session.enable(self.motor, false)?) };
        Ok(drive(session, self.motor, setpoint, self.zero, true)?)
    }
}

/// Returns the set-point that a host gives for a set-point of a scenario; `None` disables the motor.
fn for_host(setpoint: motor::Setpoint) -> Option<Setpoint> {
    let cps = |speed: CountsPerSecond| speed.round().clamp(i16::MIN.into(), i16::MAX.into()) as i16;
    Some(match setpoint {
        motor::Setpoint::ConstantPower(power) => Setpoint::Power(power),
        motor::Setpoint::Velocity(velocity) => Setpoint::Velocity(cps(velocity)),
        motor::Setpoint::Position { target, tolerance, speed_limit } => {
            Setpoint::Position { counts: target, tolerance, speed_limit: cps(speed_limit) }
        }
        motor::Setpoint::Current { current, speed_limit } => Setpoint::Current {
            ma: current.get(),
            speed_limit: speed_limit.round().unsigned_abs().try_into().unwrap_or(NO_SPEED_LIMIT_CPS),
        },
        // Scenarios have no identifications, and a script has no motion of motors in step.
        motor::Setpoint::Disabled
        | motor::Setpoint::FailSafe
        | motor::Setpoint::Identify { .. }
        | motor::Setpoint::Follow(_) => return None,
    })
}
