//! The thread of one hub: sends commands to the hub, publishes the reports of the hub, and connects again after a loss
//! of the hub.
//!
//! A *child* is a hub behind this hub, on the same line. A lost child gets a request once a second. The other hubs keep
//! working.

use crate::config::Joint;
use crate::messages::{battery_state, diagnostics, imu, joint_state, odometry, transform};
use crate::node::{Answer, Arrived, Call, Event, Topics, now};
use crate::robot::{Robot, VALID};
use motor_hub_client::hub::StoreAccess;
use motor_hub_client::identification::{Identifying as IdentifyingMotor, Progress};
use motor_hub_client::motor::Setpoint;
use motor_hub_client::motor_hub::extension::HubFunction;
use motor_hub_client::motor_hub::extension::base::OdometryReport;
use motor_hub_client::motor_hub::extension::report::HubReport;
use motor_hub_client::motor_hub::group::BaseSettings;
use motor_hub_client::motor_hub::motor::ZeroPower;
use motor_hub_client::motor_hub::protocol::Address;
use motor_hub_client::motor_hub::protocol::motor::RunMode;
use motor_hub_client::motor_hub::regulator::identify::Identification;
use motor_hub_client::motor_hub::units::Control;
use motor_hub_client::{Error, Session, reasons};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Interval between two attempts to reach a lost hub.
const RECONNECT_INTERVAL: Duration = Duration::from_secs(1);
/// Time-out of requests to the hub at the port.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(1);
/// Time-out of requests to a child. A child answers within 20 ms. The other hubs get no requests while the thread waits
/// for a child.
const CHILD_TIMEOUT: Duration = Duration::from_millis(150);
/// Longest wait for the battery voltage of a hub that has just started.
const BATTERY_TIMEOUT: Duration = Duration::from_millis(500);
/// Interval between two messages about battery and diagnostics.
const DIAGNOSTICS_INTERVAL: Duration = Duration::from_secs(1);
/// Why motors are off after a call of `stop`.
const STOPPED: &str = "stop was called; call enable";

/// State of a hub's thread.
pub(crate) struct HubThread {
    pub(crate) robot: Robot,
    pub(crate) topics: Topics,
    pub(crate) events: Receiver<Arrived>,
    pub(crate) malformed: Arc<AtomicU64>,
    /// True once the program must end.
    pub(crate) ends: Arc<AtomicBool>,
    /// Interval between two messages of joint states, odometry and heading.
    pub(crate) interval: Duration,
    pub(crate) start: Instant,
}

/// What a joint's motor was last sent: whether it is enabled, and its mode. Both are sent only if they change.
#[derive(Clone, Copy, Default)]
struct SentState {
    enabled: bool,
    mode: Option<RunMode>,
}

/// A connected hub, with its children.
struct Connected {
    session: Session,
    /// Address of the hub at the port.
    parent: Address,
    /// Lost children by address, and the time of the next request to each.
    lost: BTreeMap<u8, Instant>,
    joints: Vec<(Joint, SentState)>,
    identification: Option<Identifying>,
    saving: Option<Saving>,
    /// True if the hub has accepted the configuration of the drive base.
    has_base: bool,
    /// Number of resets in this session that were handled, by the address of the hub.
    resets: BTreeMap<u8, u32>,
}

/// An identification of all joints, one after the other.
struct Identifying {
    answer: Answer,
    /// The joint that is being identified, followed by the joints that are not identified yet.
    joints: VecDeque<Joint>,
    /// The identification of the first of these joints; `None` until this identification has begun.
    first: Option<IdentifyingMotor>,
}

/// A save of settings, which runs on several hubs at the same time.
struct Saving {
    answer: Answer,
    /// Addresses of the hubs that have not finished. `None` is the hub at the port.
    running: Vec<(Option<u8>, StoreAccess)>,
    /// Answer of the call, if the hubs that have not finished store their settings.
    outcome: Result<String, String>,
}

impl HubThread {
    /// Runs until the program ends.
    pub(crate) fn run(mut self) {
        let place = self.robot.config().place.clone();
        let mut reached = false;
        while !self.ends.load(Ordering::Relaxed) {
            let lost = match Session::open(&place) {
                Ok(session) => {
                    print_line!("{place}: connected");
                    reached = true;
                    match self.connect(session) {
                        Ok(()) => return,
                        Err(error) => error,
                    }
                }
                Err(error) => error.to_string(),
            };
            print_error_line!(
                "warning: {place}: {lost}; the next try follows in {} s",
                RECONNECT_INTERVAL.as_secs()
            );
            if reached {
                self.robot.lose();
            }
            self.wait_for_hub();
        }
    }

    /// Serves a connected hub until the program ends or the hub is lost. Disables all motors at the end of the program.
    ///
    /// # Errors
    /// Why the hub cannot be used.
    fn connect(&mut self, session: Session) -> Result<(), String> {
        let children = self.robot.config().children();
        let parent = Address::new(session.address()).filter(|parent| !children.contains(&parent.get()));
        let Some(parent) = parent else {
            return Err(format!(
                "the hub itself has the address {}; give its joints no address",
                session.address()
            ));
        };
        let joints = self.robot.config().joints.iter().map(|joint| (joint.clone(), SentState::default()));
        let mut hub = Connected {
            session,
            parent,
            // Each child counts as lost until it answers. The first request is sent immediately.
            lost: children.into_iter().map(|child| (child, Instant::now())).collect(),
            joints: joints.collect(),
            identification: None,
            saving: None,
            has_base: false,
            resets: BTreeMap::new(),
        };
        self.serve(&mut hub).map_err(|error| error.to_string())?;
        if let Err(error) = hub.disable() {
            print_error_line!(
                "warning: motors could not be disabled: {error}; the hub disables them by itself within 2.5 s"
            );
        }
        Ok(())
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    /// Publishes diagnostics, and answers calls for the time [`RECONNECT_INTERVAL`] while the hub cannot be reached.
    fn wait_for_hub(&mut self) {
        self.publish_diagnostics();
        let end = Instant::now() + RECONNECT_INTERVAL;
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

    /// Passes events and reports between ROS and the hub until the program ends or the hub is lost.
    fn serve(&mut self, hub: &mut Connected) -> Result<(), Error> {
        // A former host may have left motors enabled. They would keep running, because every packet resets the hub's
        // keep-alive.
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
            // All events that have arrived are taken before set-points are sent. Only the last command of each joint is
            // sent.
            while let Some(one) = event {
                self.take(hub, one)?;
                event = self.events.try_recv().ok();
            }
            for (joint, setpoint) in self.robot.due(self.now()) {
                if let Err(error) = hub.set(joint, setpoint) {
                    let why = self.go_on_after(hub, error)?;
                    self.robot.refuse(joint, &why);
                }
            }
            if Instant::now() >= next {
                next = (next + self.interval).max(Instant::now());
                self.report(hub)?;
            }
            if Instant::now() >= slow {
                slow += DIAGNOSTICS_INTERVAL;
                self.publish_diagnostics();
                self.publish_battery();
            }
        }
        Ok(())
    }

    /// Returns the text of an error that does not end the connection: a refusal, or a child that does not answer. A
    /// child that does not answer counts as lost. All other errors are returned as errors.
    fn go_on_after(&mut self, hub: &mut Connected, error: Error) -> Result<String, Error> {
        let text = error.to_string();
        match error {
            Error::Refused { .. } | Error::TooOld { .. } => (),
            Error::Silent { address } if address != hub.parent.get() => {
                let identified = hub.identification.is_some();
                if hub.lose(address) {
                    print_error_line!("warning: {}: {text}", self.robot.config().place);
                }
                self.robot.lose_child(address);
                if identified && hub.identification.is_none() {
                    // The identification has ended, but its motor may still turn, if this motor is at another hub.
                    hub.disable()?;
                }
            }
            error => return Err(error),
        }
        Ok(text)
    }

    fn take(&mut self, hub: &mut Connected, (arrived, event): Arrived) -> Result<(), Error> {
        let at = arrived.saturating_duration_since(self.start);
        match event {
            Event::Call(call, answer) => self.call(hub, call, answer)?,
            // Commands are dropped during an identification, because a set-point would end it. Commands that waited for
            // the hub longer than [`VALID`] are dropped too.
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
                // The hub latches a fault until the motor is disabled.
                hub.disable()?;
                self.robot.enable();
                Ok("motors accept commands".to_owned())
            }
            Call::ResetEncoders => {
                let mut done = Ok("all encoders are at 0".to_owned());
                for joint in 0..self.robot.config().joints.len() {
                    match hub.reset_encoder(joint) {
                        Ok(()) => self.robot.note_encoder_reset(joint),
                        Err(error) => done = Err(self.go_on_after(hub, error)?),
                    }
                }
                done
            }
            Call::SaveSettings if hub.saving.is_some() => Err("a save is under way".to_owned()),
            Call::SaveSettings => {
                let mut saving =
                    Saving { answer, running: Vec::new(), outcome: Ok("settings are stored".to_owned()) };
                for address in hub.addresses() {
                    match hub.select(address).and_then(|()| hub.session.begin_store(HubFunction::Save)) {
                        Ok(access) => saving.running.push((address, access)),
                        Err(error) => saving.outcome = Err(self.go_on_after(hub, error)?),
                    }
                }
                hub.saving = Some(saving);
                hub.answer_save();
                return Ok(());
            }
            Call::Identify => match (self.robot.off(), &hub.identification, hub.lost.keys().next()) {
                (Some(why), ..) => Err(format!("motors are off: {why}")),
                (_, Some(_), _) => Err("an identification is under way".to_owned()),
                (.., Some(&address)) => Err(Error::Silent { address }.to_string()),
                (None, None, None) => {
                    // Motors and commands are reset. So no earlier command, and no stop at the end of its validity,
                    // disturbs the identification.
                    hub.disable()?;
                    self.robot.enable();
                    let joints = self.robot.config().joints.iter().cloned().collect();
                    hub.identification = Some(Identifying { answer, joints, first: None });
                    return Ok(());
                }
            },
        };
        answer.send(done);
        Ok(())
    }

    /// Reads the reports of the hub and its children, and publishes joint states, odometry and heading.
    fn report(&mut self, hub: &mut Connected) -> Result<(), Error> {
        for address in hub.addresses() {
            if let Err(error) = self.ask(hub, address) {
                self.go_on_after(hub, error)?;
            }
        }
        let at = now();
        let states = self.robot.joint_states();
        let names: Vec<&str> = states.iter().map(|state| state.0).collect();
        let column = |of: fn(&(&str, f64, f64, f64)) -> f64| states.iter().map(of).collect::<Vec<f64>>();
        let mut efforts = column(|state| state.3);
        if efforts.iter().all(|effort| effort.is_nan()) {
            efforts.clear();
        }
        let message = joint_state(at, &names, &column(|state| state.1), &column(|state| state.2), &efforts);
        warn_if_unpublished(self.topics.joint_states.put(message, at));
        let base = self
            .robot
            .config()
            .base
            .as_ref()
            .map(|base| [base.odom_frame.as_str(), base.base_frame.as_str()]);
        if let (Some(frames), Some((pose, twist)), Some((odom, tf))) =
            (base, self.robot.odometry(), &mut self.topics.odometry)
        {
            warn_if_unpublished(odom.put(odometry(at, frames, pose, twist), at));
            warn_if_unpublished(tf.put(transform(at, frames, pose), at));
        }
        if let (Some([_, frame]), Some(heading), Some(topic)) =
            (base, self.robot.gyro_heading(), &mut self.topics.imu)
        {
            warn_if_unpublished(topic.put(imu(at, frame, heading), at));
        }
        Ok(())
    }

    /// Reads the report of the hub or of a child, and evaluates the report.
    fn ask(&mut self, hub: &mut Connected, address: Option<u8>) -> Result<(), Error> {
        let is_new = hub.find(address)?;
        let (place, at) = (self.robot.config().place.clone(), hub.session.address());
        if is_new {
            print_line!("{place}: connected to the hub at address {at}");
        }
        let Some(report) = hub.session.report()? else {
            let why = format!("the firmware of the hub at address {at} is not of this project, or too old");
            let Some(address) = address else { return Err(std::io::Error::other(why).into()) };
            print_error_line!("error: {place}: {why}");
            return Err(Error::Silent { address });
        };
        let resets = hub.session.resets();
        if hub.resets.insert(at, resets).unwrap_or_default() != resets {
            print_error_line!("warning: {place}: the hub at address {at} was reset");
            hub.end_save(address, Some("the hub was reset".to_owned()));
            match address {
                None => {
                    self.robot.stop("the hub was reset; call enable");
                    hub.disable()?;
                    hub.give_up_identification("the hub was reset");
                    hub.start_base(&mut self.robot)?;
                }
                Some(child) => {
                    self.robot.refuse_all_of(address, &format!("the hub at address {child} was reset"));
                    hub.disable_child(child)?;
                }
            }
        }
        hub.identify(address)?;
        hub.follow_save(address)?;
        hub.note_disabled(address, &report);
        let placed = if address.is_none() { hub.odometry()? } else { None };
        self.robot.observe(address, report, placed);
        Ok(())
    }

    fn publish_battery(&mut self) {
        if let Some((volts, amperes)) = self.robot.battery() {
            let at = now();
            warn_if_unpublished(self.topics.battery_state.put(battery_state(at, volts, amperes), at));
        }
    }

    fn publish_diagnostics(&mut self) {
        let at = now();
        let all = self.robot.diagnostics(self.malformed.load(Ordering::Relaxed), self.now());
        warn_if_unpublished(
            self.topics.diagnostics.put(diagnostics(at, &self.robot.config().place, &all), at),
        );
    }
}

/// Prints why a message was not published. Zenoh drops messages without an error while no router is connected.
fn warn_if_unpublished(published: zenoh::Result<()>) {
    if let Err(error) = published {
        print_error_line!("warning: a message could not be published: {error}");
    }
}

impl Connected {
    /// Waits until the hub knows its battery voltage, for [`BATTERY_TIMEOUT`] at most. A hub does not know the voltage
    /// before its first control tick, and refuses to enable motors without it.
    fn await_battery(&mut self) -> Result<(), Error> {
        let end = Instant::now() + BATTERY_TIMEOUT;
        while self.session.report()?.is_some_and(|report| report.battery.is_none()) && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(())
    }

    /// Configures the drive base. The odometry of the hub then starts at the origin. If the hub refuses a gyro, for
    /// example without an I2C bus, the base is configured without a gyro.
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
                print_error_line!(
                    "warning: {}: {error}; its odometry is not published",
                    robot.config().place
                );
                return Ok(());
            }
            done => done?,
        }
        self.has_base = true;
        Ok(())
    }

    /// Reads the odometry of the drive base. `None` without a base, and if the hub refuses because a reset has deleted
    /// the configuration of the base. The next report shows the reset.
    fn odometry(&mut self) -> Result<Option<OdometryReport>, Error> {
        if !self.has_base {
            return Ok(None);
        }
        match self.session.odometry() {
            Err(Error::Refused { .. }) => Ok(None),
            report => report.map(Some),
        }
    }

    /// Returns the addresses of the hub and its children. `None` is the hub at the port.
    fn addresses(&self) -> Vec<Option<u8>> {
        let mut addresses: Vec<_> = self.joints.iter().map(|(joint, _)| joint.address).collect();
        addresses.push(None);
        addresses.sort_unstable();
        addresses.dedup();
        addresses
    }

    /// Selects the hub or a child for the next requests.
    ///
    /// # Errors
    /// [`Error::Silent`] for a lost child, to which no request is sent.
    fn select(&mut self, address: Option<u8>) -> Result<(), Error> {
        if let Some(address) = address.filter(|address| self.lost.contains_key(address)) {
            return Err(Error::Silent { address });
        }
        self.session.select_hub(address.and_then(Address::new).unwrap_or(self.parent));
        self.session.set_timeout(if address.is_some() { CHILD_TIMEOUT } else { REQUEST_TIMEOUT });
        Ok(())
    }

    /// Selects the hub or a child for the next requests, and returns true if a lost child has answered. A lost child
    /// gets a request once in [`RECONNECT_INTERVAL`]. If it answers, it is no longer lost, and its motors are disabled.
    ///
    /// # Errors
    /// [`Error::Silent`] for a child that is still lost.
    fn find(&mut self, address: Option<u8>) -> Result<bool, Error> {
        let lost = address.and_then(|child| Some((child, *self.lost.get(&child)?)));
        let found = lost.is_some_and(|(_, again)| Instant::now() >= again);
        if let Some((child, _)) = lost.filter(|_| found) {
            self.lost.insert(child, Instant::now() + RECONNECT_INTERVAL);
            self.session.select_hub(Address::new(child).unwrap_or(self.parent));
            self.disable_child(child)?;
            self.lost.remove(&child);
        }
        self.select(address)?;
        Ok(found)
    }

    /// Records that a child does not answer. Returns false if the child was lost already.
    fn lose(&mut self, address: u8) -> bool {
        let identifies = |of: &Identifying| of.joints.iter().any(|joint| joint.address == Some(address));
        if self.identification.as_ref().is_some_and(identifies) {
            self.give_up_identification("a hub of the chain was lost");
        }
        self.end_save(Some(address), Some(Error::Silent { address }.to_string()));
        let is_new = !self.lost.contains_key(&address);
        self.lost.entry(address).or_insert_with(|| Instant::now() + RECONNECT_INTERVAL);
        is_new
    }

    /// Disables all motors of a child. The session must have selected the child.
    fn disable_child(&mut self, address: u8) -> Result<(), Error> {
        for (_, sent) in self.joints.iter_mut().filter(|(joint, _)| joint.address == Some(address)) {
            *sent = SentState::default();
        }
        if self.lost.contains_key(&address) {
            self.session.fail_safe_lost()
        } else {
            self.session.fail_safe()
        }
    }

    /// Disables all motors. One broadcast packet reaches all hubs of a chain. A child that does not confirm is lost.
    fn disable(&mut self) -> Result<(), Error> {
        for (_, sent) in &mut self.joints {
            *sent = SentState::default();
        }
        self.select(None)?;
        let children = self.addresses().into_iter().flatten();
        let known: Vec<u8> = children.filter(|child| !self.lost.contains_key(child)).collect();
        if known.is_empty() && self.lost.is_empty() {
            return self.session.fail_safe();
        }
        self.session.stop_hubs(&[self.parent.get()])?;
        for child in known {
            self.select(Some(child))?;
            if let Err(Error::Silent { address }) = self.session.fail_safe() {
                self.lose(address);
            }
        }
        self.select(None)
    }

    /// Makes the present position of a joint 0 counts. The hub keeps the number of a target position, which then means
    /// another place. So a joint with a target position gets speed 0 before.
    fn reset_encoder(&mut self, joint: usize) -> Result<(), Error> {
        let Some(&(Joint { address, motor, .. }, sent)) = self.joints.get(joint) else { return Ok(()) };
        if sent.enabled && sent.mode == Some(RunMode::Position) {
            self.set(joint, Setpoint::Velocity(0))?;
        }
        self.select(address)?;
        self.session.reset_encoder(motor)
    }

    /// Asks a hub that stores its settings whether it has finished. The session must have selected the hub.
    fn follow_save(&mut self, address: Option<u8>) -> Result<(), Error> {
        let running = self.saving.iter().flat_map(|saving| &saving.running);
        let Some(access) = running.copied().find(|(of, _)| *of == address).map(|(_, access)| access) else {
            return Ok(());
        };
        let why = match access.result(&mut self.session) {
            Ok(None) => return Ok(()),
            Ok(Some(report)) => reasons::why_unsaved(&report).map(str::to_owned),
            Err(error @ (Error::Refused { .. } | Error::TooOld { .. })) => Some(error.to_string()),
            Err(error) => return Err(error),
        };
        self.end_save(address, why);
        Ok(())
    }

    /// Records that a hub has stored its settings, or why it has not.
    fn end_save(&mut self, address: Option<u8>, why: Option<String>) {
        let Some(saving) = &mut self.saving else { return };
        let Some(index) = saving.running.iter().position(|(of, _)| *of == address) else { return };
        saving.running.remove(index);
        if let Some(why) = why {
            saving.outcome = Err(why);
        }
        self.answer_save();
    }

    /// Answers the call of a save once no hub is storing.
    fn answer_save(&mut self) {
        if let Some(Saving { answer, outcome, .. }) = self.saving.take_if(|saving| saving.running.is_empty())
        {
            answer.send(outcome);
        }
    }

    /// Sends a set-point, and enables the motor. The target is sent before the mode, so that an earlier target of this
    /// mode does not come into force.
    fn set(&mut self, joint: usize, setpoint: Setpoint) -> Result<(), Error> {
        let Some(&(Joint { address, motor, .. }, sent)) = self.joints.get(joint) else { return Ok(()) };
        self.select(address)?;
        let mode = match setpoint {
            Setpoint::Power(power) => {
                self.session.set_power(motor, power)?;
                RunMode::Power
            }
            Setpoint::Velocity(cps) => {
                self.session.set_velocity(motor, cps)?;
                RunMode::Velocity
            }
            Setpoint::Position { counts, tolerance, speed_limit } => {
                self.session.set_position(motor, counts, tolerance)?;
                // In velocity mode this value is the target velocity, so the speed limit is set after the mode has
                // changed.
                if sent.mode == Some(RunMode::Velocity) {
                    self.mode(motor, RunMode::Position, sent)?;
                }
                self.session.set_velocity(motor, speed_limit)?;
                RunMode::Position
            }
            Setpoint::Current { .. } => {
                // The mode of a constant current has power 0. A new target of the mode would end a running current, and
                // the motor would brake until the next current.
                if !sent.enabled || sent.mode != Some(RunMode::Power) {
                    self.session.set_power(motor, Control::ZERO)?;
                }
                RunMode::Power
            }
        };
        self.mode(motor, mode, sent)?;
        if !sent.enabled {
            self.session.enable(motor, true)?;
        }
        if let Setpoint::Current { ma, speed_limit } = setpoint {
            self.session.set_current(motor, ma, speed_limit)?;
        }
        if let Some((_, sent)) = self.joints.get_mut(joint) {
            *sent = SentState { enabled: true, mode: Some(mode) };
        }
        Ok(())
    }

    fn mode(&mut self, motor: u8, mode: RunMode, sent: SentState) -> Result<(), Error> {
        if sent.mode == Some(mode) { Ok(()) } else { self.session.set_mode(motor, mode, ZeroPower::Brake) }
    }

    /// Records motors that the hub has disabled, so that the next set-point enables them again.
    fn note_disabled(&mut self, address: Option<u8>, report: &HubReport) {
        for (joint, sent) in self.joints.iter_mut().filter(|(joint, _)| joint.address == address) {
            let motor = report.motors.get(usize::from(joint.motor)).filter(|_| report.is_up_to_date());
            sent.enabled &= motor.is_none_or(|motor| motor.enabled);
        }
    }

    /// Ends an identification that cannot continue, and answers its call with the reason.
    fn give_up_identification(&mut self, why: &str) {
        if let Some(Identifying { answer, .. }) = self.identification.take() {
            answer.send(Err(why.to_owned()));
        }
    }

    /// Takes the next step of an identification. The motors are identified one after the other.
    fn identify(&mut self, address: Option<u8>) -> Result<(), Error> {
        let Some(Identifying { joints, first, .. }) = &mut self.identification else { return Ok(()) };
        let Some(Joint { name, address: of, motor, .. }) = joints.front().cloned() else {
            return self.identified(Ok("all joints are identified; their constants are in force".to_owned()));
        };
        if of != address {
            return Ok(());
        }
        let session = &mut self.session;
        let progress = match first {
            Some(identifying) => identifying.step(session).and_then(|progress| {
                if let Progress::Ended(Identification::Found(found)) = &progress {
                    session.set_dynamics(motor, Some(found.dynamics))?;
                    session.enable(motor, false)?;
                }
                Ok(progress)
            }),
            None => IdentifyingMotor::begin(session, motor, u32::MAX).and_then(|identifying| {
                *first = Some(identifying);
                session.enable(motor, true).map(|()| Progress::Braking)
            }),
        };
        match progress {
            Ok(Progress::Ended(Identification::Found(_))) => {
                joints.pop_front();
                *first = None;
                Ok(())
            }
            Ok(Progress::Ended(Identification::Refused(why))) => {
                self.identified(Err(format!("{name}: {why}")))
            }
            Ok(Progress::Ended(_)) => {
                self.identified(Err(format!("{name}: the identification did not start")))
            }
            Ok(_) => Ok(()),
            Err(Error::Refused { reason, .. }) => {
                self.identified(Err(format!("{name}: the hub refuses: {reason}")))
            }
            Err(error @ Error::TooOld { .. }) => self.identified(Err(format!("{name}: {error}"))),
            Err(error) => Err(error),
        }
    }

    /// Disables all motors, ends an identification, and answers its call.
    fn identified(&mut self, outcome: Result<String, String>) -> Result<(), Error> {
        let disabled = self.disable();
        if let Some(Identifying { answer, .. }) = self.identification.take() {
            answer.send(outcome);
        }
        disabled
    }
}
