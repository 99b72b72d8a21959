//! The thread of one hub: passes commands to the hub and its reports to the topics, and connects again after a loss.

use crate::messages::{battery_state, diagnostics, joint_state, odometry, transform};
use crate::node::{Answer, Arrived, Call, Event, Topics, now};
use crate::robot::{Robot, Setpoint, VALID};
use motor_hub_client::line::Line;
use motor_hub_client::motor_hub::extension::HubFunction;
use motor_hub_client::motor_hub::extension::base::OdometryReport;
use motor_hub_client::motor_hub::extension::report::HubReport;
use motor_hub_client::motor_hub::group::BaseSettings;
use motor_hub_client::motor_hub::motor::ZeroPower;
use motor_hub_client::motor_hub::protocol::CHANNELS;
use motor_hub_client::motor_hub::protocol::motor::RunMode;
use motor_hub_client::motor_hub::regulator::identify::Identification;
use motor_hub_client::motor_hub::units::Control;
use motor_hub_client::{Error, Session, reasons};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Interval between two tries to reach a lost hub.
const AGAIN: Duration = Duration::from_secs(1);
/// Longest time in which a hub that has just started makes its first ticks.
const FIRST_TICKS: Duration = Duration::from_millis(500);
/// Interval of battery and diagnostics.
const SLOW: Duration = Duration::from_secs(1);

/// The most that a hub's clock can seem to run ahead of this machine's without a reset. A control tick and the line's delay are
/// far below.
const AHEAD: Duration = Duration::from_secs(1);
/// Why motors are off after a call of `stop`.
const STOPPED: &str = "stop was called; call enable";

/// What the thread of a hub works with.
pub(crate) struct HubThread {
    pub(crate) robot: Robot,
    pub(crate) topics: Topics,
    pub(crate) events: Receiver<Arrived>,
    pub(crate) malformed: Arc<AtomicU64>,
    /// True once the program should end.
    pub(crate) ends: Arc<AtomicBool>,
    /// Interval of joint states and odometry.
    pub(crate) interval: Duration,
    pub(crate) start: Instant,
}

/// What the hub's motors are set to, so that only changes are sent.
#[derive(Clone, Copy, Default)]
struct Sent {
    enabled: bool,
    mode: Option<RunMode>,
}

/// A connected hub.
struct Connected {
    session: Session<Line>,
    sent: [Sent; CHANNELS],
    identification: Option<Identifying>,
    /// True if the hub has taken the configuration of the drive base.
    has_base: bool,
    /// When the last report was asked for, and the hub's time in this report.
    clock: Option<(Instant, u32)>,
}

/// An identification of all joints, one after the other.
struct Identifying {
    answer: Answer,
    /// The motor under way, and motors that follow.
    motors: VecDeque<u8>,
    started: bool,
}

impl HubThread {
    /// Runs until the program ends.
    pub(crate) fn run(mut self) {
        let place = self.robot.config().place.clone();
        let mut reached = false;
        while !self.ends.load(Ordering::Relaxed) {
            let lost = match Session::open(&place) {
                Ok(session) => {
                    println!("{place}: connected");
                    reached = true;
                    let mut hub = Connected {
                        session,
                        sent: [Sent::default(); CHANNELS],
                        identification: None,
                        has_base: false,
                        clock: None,
                    };
                    let ended = self.serve(&mut hub);
                    hub.give_up_identification("the hub was lost");
                    match ended {
                        Ok(()) => return hub.stop(),
                        Err(error) => error.to_string(),
                    }
                }
                Err(error) => error.to_string(),
            };
            eprintln!("warning: {place}: {lost}; the next try follows in {} s", AGAIN.as_secs());
            if reached {
                self.robot.lose();
            }
            self.wait_for_hub();
        }
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    /// Answers calls and publishes diagnostics while there is no hub.
    fn wait_for_hub(&mut self) {
        self.publish_diagnostics();
        let end = Instant::now() + AGAIN;
        while !self.ends.load(Ordering::Relaxed) {
            match self.events.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok((_, Event::Call(Call::Stop | Call::Enable(false), answer))) => {
                    self.robot.stop(STOPPED);
                    let text =
                        "the hub cannot be reached; once it is, its motors are off until enable is called";
                    answer.send(Err(text.to_owned()));
                }
                Ok((_, Event::Call(_, answer))) => answer.send(Err("the hub cannot be reached".to_owned())),
                Ok(_) => (),
                Err(_) => return,
            }
        }
    }

    /// Serves a connected hub until the program ends, or until the hub is lost.
    fn serve(&mut self, hub: &mut Connected) -> Result<(), Error> {
        // A former host may have left motors enabled: every packet prolongs their motion.
        hub.disable()?;
        hub.await_battery()?;
        hub.start_base(&mut self.robot)?;
        let (mut next, mut slow) = (Instant::now(), Instant::now());
        while !self.ends.load(Ordering::Relaxed) {
            let wait = next.saturating_duration_since(Instant::now());
            let wait = self.robot.next_stop(self.now()).map_or(wait, |stop| wait.min(stop));
            let mut event = match self.events.recv_timeout(wait) {
                Ok(event) => Some(event),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            };
            // Of several commands that have arrived, the last one counts.
            while let Some(one) = event {
                self.take(hub, one)?;
                event = self.events.try_recv().ok();
            }
            for (motor, setpoint) in self.robot.due(self.now()) {
                match hub.set(motor, setpoint) {
                    Err(error @ (Error::Refused { .. } | Error::TooOld { .. })) => {
                        self.robot.refuse(motor, &error.to_string());
                    }
                    done => done?,
                }
            }
            if Instant::now() >= next {
                next = (next + self.interval).max(Instant::now());
                self.report(hub)?;
            }
            if Instant::now() >= slow {
                slow += SLOW;
                self.publish_diagnostics();
                self.publish_battery();
            }
        }
        Ok(())
    }

    fn take(&mut self, hub: &mut Connected, (arrived, event): Arrived) -> Result<(), Error> {
        let at = arrived.saturating_duration_since(self.start);
        match event {
            Event::Call(call, answer) => self.call(hub, call, answer)?,
            // Another set-point would end the identification. A command that has waited for the hub is too old.
            _ if hub.identification.is_some() || arrived.elapsed() >= VALID => (),
            Event::Twist(from, twist) => self.robot.twist(from, twist, at),
            Event::Joints(from, commands) => self.robot.joints(from, &commands, at),
        }
        Ok(())
    }

    fn call(&mut self, hub: &mut Connected, call: Call, answer: Answer) -> Result<(), Error> {
        let done = match call {
            Call::Stop | Call::Enable(false) => {
                self.robot.stop(STOPPED);
                hub.disable()?;
                hub.give_up_identification("stop was called");
                Ok("all motors are off until enable is called".to_owned())
            }
            Call::Enable(true) => {
                // A fault is latched until the motor is disabled.
                hub.disable()?;
                self.robot.enable();
                Ok("motors accept commands".to_owned())
            }
            Call::ResetEncoders => {
                for joint in &self.robot.config().joints {
                    hub.session.reset_encoder(joint.motor)?;
                }
                Ok("all encoders are at 0".to_owned())
            }
            Call::SaveSettings => {
                let report = hub.session.store(HubFunction::Save);
                match report {
                    Ok(report) => match reasons::why_unsaved(&report) {
                        None => Ok("settings are stored".to_owned()),
                        Some(why) => Err(why.to_owned()),
                    },
                    Err(error @ (Error::Refused { .. } | Error::TooOld { .. })) => Err(error.to_string()),
                    Err(error) => return Err(error),
                }
            }
            Call::Identify => match (self.robot.off(), &hub.identification) {
                (Some(why), _) => Err(format!("motors are off: {why}")),
                (_, Some(_)) => Err("an identification is under way".to_owned()),
                (None, None) => {
                    // Set-points in force end here, without a stop that follows later.
                    hub.disable()?;
                    self.robot.enable();
                    let motors = self.robot.config().joints.iter().map(|joint| joint.motor).collect();
                    hub.identification = Some(Identifying { answer, motors, started: false });
                    return Ok(());
                }
            },
        };
        answer.send(done);
        Ok(())
    }

    /// Publishes the newest report of the hub.
    fn report(&mut self, hub: &mut Connected) -> Result<(), Error> {
        let asked = Instant::now();
        let Some(report) = hub.session.report()? else {
            eprintln!(
                "error: {}: the hub's firmware is not of this project, or too old",
                self.robot.config().place
            );
            return Err(Error::NoHub);
        };
        if hub.was_reset(asked, report.at_ms) {
            eprintln!("warning: {}: the hub was reset", self.robot.config().place);
            self.robot.stop("the hub was reset; call enable");
            hub.disable()?;
            hub.give_up_identification("the hub was reset");
            hub.start_base(&mut self.robot)?;
        }
        hub.identify(&report)?;
        hub.note_disabled(&report);
        let placed = hub.odometry()?;
        self.robot.observe(report, placed);
        let at = now();
        let states = self.robot.joint_states();
        let names: Vec<&str> = states.iter().map(|state| state.0).collect();
        let column = |of: fn(&(&str, f64, f64, f64)) -> f64| states.iter().map(of).collect::<Vec<f64>>();
        let mut efforts = column(|state| state.3);
        if efforts.iter().all(|effort| effort.is_nan()) {
            efforts.clear();
        }
        let message = joint_state(at, &names, &column(|state| state.1), &column(|state| state.2), &efforts);
        told(self.topics.joint_states.put(message, at));
        let base = self
            .robot
            .config()
            .base
            .as_ref()
            .map(|base| [base.odom_frame.as_str(), base.base_frame.as_str()]);
        if let (Some(frames), Some((pose, twist)), Some((odom, tf))) =
            (base, self.robot.odometry(), &mut self.topics.odometry)
        {
            told(odom.put(odometry(at, frames, pose, twist), at));
            told(tf.put(transform(at, frames, pose), at));
        }
        Ok(())
    }

    fn publish_battery(&mut self) {
        if let Some((volts, amperes)) = self.robot.battery() {
            let at = now();
            told(self.topics.battery_state.put(battery_state(at, volts, amperes), at));
        }
    }

    fn publish_diagnostics(&mut self) {
        let at = now();
        let all = self.robot.diagnostics(self.malformed.load(Ordering::Relaxed), self.now());
        told(self.topics.diagnostics.put(diagnostics(at, &self.robot.config().place, &all), at));
    }
}

/// Prints why a message was not published. Without a router, Zenoh drops messages without an error.
fn told(published: zenoh::Result<()>) {
    if let Err(error) = published {
        eprintln!("warning: a message could not be published: {error}");
    }
}

impl Connected {
    /// Waits until the hub knows its battery. A hub that has just started does not before its first tick, and would refuse to
    /// enable motors.
    fn await_battery(&mut self) -> Result<(), Error> {
        let end = Instant::now() + FIRST_TICKS;
        while self.session.report()?.is_some_and(|report| report.battery.is_none()) && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(())
    }

    /// Configures the drive base, which then starts at the origin. A board without I2C has no gyro.
    fn start_base(&mut self, robot: &mut Robot) -> Result<(), Error> {
        robot.start_base();
        self.has_base = false;
        let Some(Ok(base)) = robot.config().base_settings() else { return Ok(()) };
        let mut done = self.session.set_base(base);
        if base.use_gyro && matches!(done, Err(Error::Refused { .. })) {
            done = self.session.set_base(BaseSettings { use_gyro: false, ..base });
        }
        match done {
            Err(error @ (Error::Refused { .. } | Error::TooOld { .. })) => {
                eprintln!("warning: {}: {error}; its odometry is not published", robot.config().place);
                return Ok(());
            }
            done => done?,
        }
        self.has_base = true;
        Ok(())
    }

    /// Where the drive base is. `None` without a base, and after a reset of the hub that the next report shows.
    fn odometry(&mut self) -> Result<Option<OdometryReport>, Error> {
        if !self.has_base {
            return Ok(None);
        }
        match self.session.odometry() {
            Err(Error::Refused { .. }) => Ok(None),
            report => report.map(Some),
        }
    }

    /// Disables all motors, with one packet.
    fn disable(&mut self) -> Result<(), Error> {
        self.sent = [Sent::default(); CHANNELS];
        self.session.fail_safe()
    }

    /// Disables all motors at the end of the program.
    fn stop(&mut self) {
        if let Err(error) = self.disable() {
            eprintln!(
                "warning: motors could not be disabled: {error}; the hub disables them by itself within 2.5 s"
            );
        }
    }

    /// Sends a set-point, and enables the motor with it. A target precedes its mode, so that no former target is in force.
    fn set(&mut self, motor: u8, setpoint: Setpoint) -> Result<(), Error> {
        let sent = self.sent.get(usize::from(motor)).copied().unwrap_or_default();
        let mode = match setpoint {
            Setpoint::Velocity(cps) => {
                self.session.set_velocity(motor, cps)?;
                RunMode::Velocity
            }
            Setpoint::Position { counts, speed } => {
                self.session.set_position(motor, counts, 0)?;
                // In velocity mode the speed limit is the speed itself: it may change only after the mode.
                if sent.mode == Some(RunMode::Velocity) {
                    self.mode(motor, RunMode::Position, sent)?;
                }
                self.session.set_velocity(motor, speed)?;
                RunMode::Position
            }
            Setpoint::Current { .. } => {
                self.session.set_power(motor, Control::ZERO)?;
                RunMode::Power
            }
        };
        self.mode(motor, mode, sent)?;
        if !sent.enabled {
            self.session.enable(motor, true)?;
        }
        if let Setpoint::Current { ma, speed } = setpoint {
            self.session.set_current(motor, ma, speed)?;
        }
        if let Some(sent) = self.sent.get_mut(usize::from(motor)) {
            *sent = Sent { enabled: true, mode: Some(mode) };
        }
        Ok(())
    }

    fn mode(&mut self, motor: u8, mode: RunMode, sent: Sent) -> Result<(), Error> {
        if sent.mode == Some(mode) { Ok(()) } else { self.session.set_mode(motor, mode, ZeroPower::Brake) }
    }

    /// Notes motors that the hub has disabled by itself, so that the next set-point enables them.
    fn note_disabled(&mut self, report: &HubReport) {
        if report.is_up_to_date() {
            for (sent, motor) in self.sent.iter_mut().zip(&report.motors) {
                sent.enabled &= motor.enabled;
            }
        }
    }

    /// True if the hub was reset since the last report: its clock has begun again, so it does not go on with this machine's.
    fn was_reset(&mut self, asked: Instant, at_ms: u32) -> bool {
        self.clock.replace((asked, at_ms)).is_some_and(|(before, before_ms)| {
            Duration::from_millis(at_ms.wrapping_sub(before_ms).into()) > before.elapsed() + AHEAD
        })
    }

    /// Ends an identification that cannot go on.
    fn give_up_identification(&mut self, why: &str) {
        if let Some(Identifying { answer, .. }) = self.identification.take() {
            answer.send(Err(why.to_owned()));
        }
    }

    /// Goes on with an identification. Motors are braked until they stand, and identified one after the other.
    fn identify(&mut self, report: &HubReport) -> Result<(), Error> {
        let Some(Identifying { motors, started, .. }) = &self.identification else { return Ok(()) };
        let Some(&motor) = motors.front() else {
            return self.identified(Ok("all joints are identified; their constants are in force".to_owned()));
        };
        if !started {
            self.session.set_power(motor, Control::ZERO)?;
            self.session.set_mode(motor, RunMode::Power, ZeroPower::Brake)?;
            self.session.enable(motor, true)?;
            let stands =
                report.motors.get(usize::from(motor)).is_some_and(|motor| motor.velocity.unsigned_abs() <= 3);
            if stands {
                match self.session.identify(motor, u32::MAX) {
                    Err(Error::Refused { reason, .. }) => {
                        return self.identified(Err(format!("motor {motor}: the hub refuses: {reason}")));
                    }
                    done => drop(done?),
                }
                if let Some(of) = &mut self.identification {
                    of.started = true;
                }
            }
            return Ok(());
        }
        match self.session.identification(motor)? {
            Identification::Running(_) => return Ok(()),
            Identification::Found(found) => {
                self.session.set_dynamics(motor, Some(found.dynamics))?;
            }
            Identification::Refused(why) => return self.identified(Err(format!("motor {motor}: {why}"))),
            Identification::None => {
                return self.identified(Err(format!("motor {motor}: the identification did not start")));
            }
        }
        self.session.enable(motor, false)?;
        if let Some(Identifying { motors, started, .. }) = &mut self.identification {
            motors.pop_front();
            *started = false;
        }
        Ok(())
    }

    /// Ends an identification, and answers its call.
    fn identified(&mut self, outcome: Result<String, String>) -> Result<(), Error> {
        let disabled = self.disable();
        if let Some(Identifying { answer, .. }) = self.identification.take() {
            answer.send(outcome);
        }
        disabled
    }
}
