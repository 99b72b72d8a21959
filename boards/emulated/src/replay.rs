//! A scenario of the simulated board, run by the flashed image on the emulated chip. The host link sends the scenario's
//! commands, and the trace has the simulated board's form.
//!
//! Over this link the host first sends the set-up of the motors: constants, scheme, duty rule, coefficients. Set-points should lie
//! between two control ticks, so that they arrive before the next tick: see [`on_a_line`].
//!
//! ```no_run
//! use emulated::{Board, replay};
//! use simulated::scenario::Scenario;
//!
//! let scenario = replay::on_a_line(Scenario::default_one()?);
//! let trace = replay::run(&scenario, Board::NucleoF429zi, &mut |_| ())?;
//! println!("{} control ticks of the image that is flashed", trace.ticks.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::time::Duration;

use motor_hub::braking::Regime;
use motor_hub::bridge::{Drive, Mode};
use motor_hub::extension::settings::{Group, MotorSettings, Values};
use motor_hub::extension::{MotorFunction, Request};
use motor_hub::group::Pose;
use motor_hub::model::switching::Bridge;
use motor_hub::motor::EncoderFault;
use motor_hub::motor::{Faults, Report, Setpoint, Settings, ZeroPower};
use motor_hub::protocol::answers::Reply;
use motor_hub::protocol::motor::{ChannelMode, RunMode, ToMotor};
use motor_hub::units::{Control, CountsPerSecond, Duty, Period};
use simulated::encoder::Encoder;
use simulated::scenario::{Motor, Scenario};
use simulated::sim::{RunError, settings_of};
use simulated::trace::{Sample, Tick, Trace};

use crate::bench::{Bench, Setup};
use crate::board::Board;
use crate::host_link::HostLink;
use crate::pwm::Output;
use crate::rtt::LogLine;
use crate::shafts::{Look, Mounting};

/// Why a scenario could not be replayed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReplayError {
    /// The scenario's control period is not that of the image.
    #[error("control_period_ms = {asked} is not the control period of the image, which is {image} ms")]
    Period {
        /// Period of the scenario, in milliseconds.
        asked: u32,
        /// Period of the image, in milliseconds.
        image: u32,
    },
    /// The scenario has a part that the bench lacks, or whose effect the bench does not observe.
    #[error("the emulated board does not run {0} of a scenario; remove it from the scenario")]
    Part(&'static str),
    /// A motor's constants do not fit the firmware.
    #[error(transparent)]
    Motor(RunError),
    /// The hub refuses a motor's set-up.
    #[error("the hub refuses the configuration of a motor")]
    SetupRefused,
    /// The emulator had gaps: it could not do what the chip would have done.
    #[error("{}", .0.join("\n"))]
    Gaps(Vec<String>),
}

/// Time between two keep-alives of the host, s.
const KEEP_ALIVE_S: f64 = 1.0;

/// Time between two log lines of a motor, s. A line has the motor's faults.
const LOG_S: f64 = 1.0;

/// Time in s after which the chip has started, and the host has set up the motors.
const READY_S: f64 = 0.5;

/// Changes a scenario for a host link: no set-point comes before the hub is ready, and each set-point comes half a control
/// period late. A set-point then arrives before the next tick.
#[must_use]
pub fn on_a_line(mut scenario: Scenario) -> Scenario {
    let half_s = 0.5e-3 * f64::from(scenario.period.as_millis());
    for motor in &mut scenario.motors {
        // Before the hub is ready, only the last set-point counts.
        let early = motor.setpoints.iter().filter(|timed| timed.at_s <= READY_S).count();
        motor.setpoints.drain(..early.saturating_sub(1));
        for timed in &mut motor.setpoints {
            timed.at_s = timed.at_s.max(READY_S) + half_s;
        }
    }
    scenario
}

/// Runs a scenario with a board's image on the emulated chip. `progress` is called at each tick with the virtual time in seconds.
///
/// # Errors
/// Returns an error if the scenario cannot be run on the chip, or if the emulator had a gap.
///
/// # Panics
/// Panics if the firmware refuses a command.
pub fn run(scenario: &Scenario, board: Board, progress: &mut dyn FnMut(f64)) -> Result<Trace, ReplayError> {
    check(scenario, scenario.not_replayed().next())?;
    let mut bench = stand(scenario, board, false);
    let mut host = HostLink::default();
    let mut events = events(scenario).into_iter().peekable();
    let period_s = f64::from(scenario.period.as_millis()) * 1e-3;
    let mut trace = Trace::default();
    let mut heard_s = 0.0;
    let ticks = (scenario.duration_s / period_s).floor() as usize;
    for tick in 1..=ticks {
        let at_s = tick as f64 * f64::from(scenario.period.as_millis()) / 1e3;
        while let Some((event_s, event)) = events.next_if(|&(event_s, _)| event_s < at_s) {
            run_to(&mut bench, event_s);
            carry_out(&mut bench, &mut host, scenario, event)?;
        }
        if at_s - heard_s > KEEP_ALIVE_S {
            heard_s = at_s;
            run_to(&mut bench, at_s - 0.4 * period_s);
            host.keep_alive(&mut bench);
        }
        // The commands of a tick are on the pins within a millisecond.
        run_to(&mut bench, at_s + 1e-3);
        observe(&mut bench, scenario, at_s, &mut trace);
        // The battery voltage changes slowly, so one value for each tick is enough.
        bench.set_battery(scenario.emf_at(at_s).0);
        progress(at_s);
    }
    run_to(&mut bench, (ticks + 1) as f64 * period_s + 1e-3);
    observe(&mut bench, scenario, scenario.duration_s, &mut trace);
    // The last observation only completes the flow of the tick before.
    trace.ticks.pop();
    note_faults(&bench.log(), &mut trace);
    let gaps = bench.gaps();
    if gaps.is_empty() { Ok(trace) } else { Err(ReplayError::Gaps(gaps)) }
}

/// Checks that the image has the control period of a scenario, and that the scenario has no part that the bench lacks.
pub(crate) fn check(scenario: &Scenario, part: Option<&'static str>) -> Result<(), ReplayError> {
    if scenario.period != Period::DEFAULT {
        let (asked, image) = (scenario.period.as_millis(), Period::DEFAULT.as_millis());
        return Err(ReplayError::Period { asked, image });
    }
    part.map_or(Ok(()), |part| Err(ReplayError::Part(part)))
}

/// Powers on a board with the scenario's motors, loads, battery and current-sense lines. With `bootloader` its bootloader starts the
/// image.
pub(crate) fn stand(scenario: &Scenario, board: Board, bootloader: bool) -> Bench {
    let motors = scenario.motors.iter().map(|motor| Mounting {
        motor: motor.constants,
        load: motor.load,
        bridge: Bridge::new(motor.bridge),
        stops: None,
    });
    let setup = Setup { board, battery: scenario.battery, bootloader, ..Setup::new(motors.collect()) };
    let mut bench = Bench::new(setup);
    for (index, motor) in scenario.motors.iter().enumerate() {
        bench.set_current_line(index, motor.current_line);
    }
    bench
}

fn run_to(bench: &mut Bench, at_s: f64) {
    bench.run_until(Duration::from_secs_f64(at_s));
}

/// Sends the set-up of a motor to the hub.
fn set_up(
    bench: &mut Bench,
    host: &mut HostLink,
    channel: u8,
    scenario: &Scenario,
) -> Result<(), ReplayError> {
    let motor = &scenario.motors[usize::from(channel)];
    let settings = MotorSettings::new(settings_of(motor).map_err(ReplayError::Motor)?);
    let request = |group| Request::Set(channel, Values::of(group, &settings));
    let default = MotorSettings::new(Settings::new(settings.motor.winding));
    // An image that the user has chosen may lack this hub's own protocol.
    if !matches!(host.request(bench, request(Group::SetUp)), Reply::Ack { .. }) {
        return Err(ReplayError::SetupRefused);
    }
    host.command(bench, request(Group::Timing));
    if Values::of(Group::Protection, &settings) != Values::of(Group::Protection, &default) {
        host.command(bench, request(Group::Protection));
    }
    host.command(bench, request(Group::Motion));
    for group in [Group::CurrentLimit, Group::VelocityLoop, Group::PositionLoop] {
        if group.is_configured(&settings) {
            host.command(bench, request(group));
        }
    }
    Ok(())
}

#[derive(Clone, Copy)]
enum ScenarioEvent {
    SetUp(usize),
    Setpoint(usize, Setpoint),
    Torque(usize, f64),
    Encoder(usize, Encoder),
}

/// Returns all commands and changes of the scenario with their times in s, in ascending order.
fn events(scenario: &Scenario) -> Vec<(f64, ScenarioEvent)> {
    let mut events = Vec::new();
    for (index, motor) in scenario.motors.iter().enumerate() {
        events.push((0.6 * READY_S, ScenarioEvent::SetUp(index)));
        events.extend(motor.torques.iter().map(|t| (t.at_s, ScenarioEvent::Torque(index, t.value))));
        events.extend(motor.encoder.iter().map(|t| (t.at_s, ScenarioEvent::Encoder(index, t.value))));
        events.extend(motor.setpoints.iter().map(|t| (t.at_s, ScenarioEvent::Setpoint(index, t.value))));
    }
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    events
}

fn carry_out(
    bench: &mut Bench,
    host: &mut HostLink,
    scenario: &Scenario,
    event: ScenarioEvent,
) -> Result<(), ReplayError> {
    match event {
        ScenarioEvent::SetUp(index) => return set_up(bench, host, index as u8, scenario),
        ScenarioEvent::Torque(motor, torque) => bench.set_torque(motor, torque),
        ScenarioEvent::Encoder(motor, encoder) => bench.set_encoder(motor, encoder),
        ScenarioEvent::Setpoint(motor, setpoint) => {
            let floats = scenario.motors[motor].zero_power == ZeroPower::Float;
            let motor = motor as u8;
            let whole = |speed: CountsPerSecond| speed.round() as i16;
            match setpoint {
                // A set-point in a scenario is never a reference of a group.
                Setpoint::Disabled | Setpoint::FailSafe | Setpoint::Follow(_) => {
                    host.enable(bench, motor, false)
                }
                Setpoint::ConstantPower(power) => host.power(bench, motor, power.get()),
                Setpoint::Current { current, speed_limit } => {
                    host.power(bench, motor, 0);
                    let speed_limit_cps = u16::try_from(speed_limit.round()).unwrap_or(u16::MAX);
                    let current = MotorFunction::Current { current_ma: current.get(), speed_limit_cps };
                    host.command(bench, current.to(motor));
                }
                Setpoint::Velocity(target) => host.velocity(bench, motor, whole(target)),
                Setpoint::Position { target, tolerance, speed_limit } => {
                    host.position(bench, motor, target, tolerance, whole(speed_limit));
                }
                Setpoint::Identify { travel_limit } => {
                    host.power(bench, motor, 0);
                    host.request(bench, MotorFunction::Identify { travel_limit }.to(motor));
                }
            }
            // Identification and constant current end when a mode is set.
            if floats && !matches!(setpoint, Setpoint::Identify { .. } | Setpoint::Current { .. }) {
                let mode = match setpoint {
                    Setpoint::Velocity(_) => RunMode::Velocity,
                    Setpoint::Position { .. } => RunMode::Position,
                    _ => RunMode::Power,
                };
                host.command(bench, ToMotor::SetMode { mode: ChannelMode { mode, floats: true } }.to(motor));
            }
        }
    }
    Ok(())
}

fn observe(bench: &mut Bench, scenario: &Scenario, at_s: f64, trace: &mut Trace) {
    let mut motors = Vec::new();
    for (index, motor) in scenario.motors.iter().enumerate() {
        let (look, drive) = (bench.look(index), drive(bench, index));
        // The sample first has the flow since power-on. The next observation replaces it by the flow until the next
        // tick.
        motors.push(Sample {
            report: report(motor, at_s, look, drive),
            control: Control::ZERO,
            speed_cps: look.counts_per_second,
            counts: look.counts,
            torque_nm: motor.torque_at(at_s),
            flow: look.flow,
        });
    }
    match trace.ticks.last_mut() {
        Some(last) => {
            for (sample, now) in last.motors.iter_mut().zip(&motors) {
                sample.flow = now.flow - sample.flow;
            }
        }
        None => trace.before = motors.iter().map(|sample| sample.flow).collect(),
    }
    let (battery_v, _) = bench.battery();
    trace.push_motion(at_s, motors.iter().map(|sample| (sample.speed_cps, sample.counts)));
    trace.ticks.push(Tick { at_s, battery_v, measured_v: None, base: None, pose: Pose::default(), motors });
}

/// Puts the faults of the log into the trace. The log has a line each second, so a fault counts for the second after its line.
fn note_faults(log: &[LogLine], trace: &mut Trace) {
    for line in log {
        let named = line.text.strip_prefix("motor ").and_then(|text| text.split_once(": Faults "));
        let Some((Ok(motor), faults)) = named.map(|(motor, faults)| (motor.parse::<usize>(), faults)) else {
            continue;
        };
        let from_s = line.at.as_secs_f64();
        let held = trace.ticks.iter_mut().filter(|tick| (from_s..from_s + LOG_S).contains(&tick.at_s));
        for sample in held.filter_map(|tick| tick.motors.get_mut(motor)) {
            sample.report.faults = Faults {
                battery_unknown: faults.contains("battery_unknown: true"),
                encoder_stale: faults.contains("encoder_stale: true"),
                encoder: match faults {
                    text if text.contains("Stuck") => Some(EncoderFault::Stuck),
                    text if text.contains("Reversed") => Some(EncoderFault::Reversed),
                    _ => None,
                },
                overheated: faults.contains("overheated: true"),
                bridge: faults.contains("bridge: true"),
            };
        }
    }
}

/// Returns the command of a bridge, from its lines.
pub(crate) fn drive(bench: &mut Bench, motor: usize) -> Drive {
    let ticks = bench.pwm_grid().map_or(1, |grid| grid.ticks);
    let lines = bench.lines(motor);
    let mode = match (lines.ina, lines.inb) {
        (true, _) => Mode::Cw98,
        (_, true) => Mode::Ccw62,
        _ => Mode::Brake50,
    };
    let duty = match lines.pwm {
        Output::Level(true) => Duty::ONE,
        Output::Level(false) => Duty::ZERO,
        Output::Pulse(high) => Duty::ratio(high.into(), ticks.into()),
    };
    Drive { mode, duty }
}

/// Returns a report of a motor, from its bridge command and the motion of its shaft.
fn report(motor: &Motor, at_s: f64, look: Look, drive: Drive) -> Report {
    let Drive { mode, duty } = drive;
    let regime = match mode {
        Mode::Brake50 if duty == Duty::ZERO => None,
        Mode::Brake50 => Some(Regime::Braking),
        mode if (mode == Mode::Cw98) == (look.counts_per_second >= 0.0) => Some(Regime::Forward),
        _ => Some(Regime::Reverse),
    };
    Report {
        setpoint: motor.setpoint_at(at_s),
        position: look.counts as i32,
        velocity: CountsPerSecond::new(look.counts_per_second.round() as i32),
        regime,
        drive,
        ..Report::INITIAL
    }
}
