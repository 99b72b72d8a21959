//! Motors of a hub, and of the hubs behind it, as joints of a robot. Converts commands to set-points of the motors, and
//! computes the pose of the drive base.
//!
//! ```text
//!  twist, joint commands --> [Robot] --set-points--> hub
//!      stop, enable     -->         <--report-----
//! ```
//!
//! * A command is valid for 0.5 s. After 0.5 s without another command the joint stops.
//! * After `stop` the motors are off until `enable`. After a loss of the hub all motors are off until `enable`. A joint
//!   is off until `enable` after a fault, and after the hub has disabled its motor. After a fault its motor gets speed
//!   0, because the motor would turn again when the fault passes. A base with such a wheel ignores speeds for the base.
//!   The joints of a child hub are off until `enable` after a loss of the child.
//! * One commander (a process) drives at a time. A new commander drives immediately, instead of the present commander.
//!   An earlier commander drives again only after the present commander has sent nothing for 5 s.

use crate::config::{Hub, Joint};
use crate::messages::{JointCommands, Level, Pose, Status};
use crate::names::{Publishers, Source};
use motor_hub_client::base::heading_text;
use motor_hub_client::motor::{Setpoint, constant_current_ma};
use motor_hub_client::motor_hub::extension::base::OdometryReport;
use motor_hub_client::motor_hub::extension::report::{HubReport, MotorReport};
use motor_hub_client::motor_hub::group::GyroState;
use motor_hub_client::motor_hub::record::Fault;
use motor_hub_client::motor_hub::units::CountsPerSecond;
use motor_hub_client::reasons::why_still;
use std::collections::BTreeMap;
use std::time::Duration;

/// Time for which a command is valid.
pub(crate) const VALID: Duration = Duration::from_millis(500);
/// Time without commands after which an earlier commander may drive again.
const SILENT: Duration = Duration::from_secs(5);
/// Largest number of commanders in the list of known commanders. A commander that has left the list counts as new.
const REMEMBERED: usize = 64;
/// Largest speed of a set-point in counts/s. The protocol has 16 signed bits for a speed.
const FASTEST: f64 = i16::MAX as f64;

/// State of one joint's command.
#[derive(Clone, Debug, Default)]
struct Command {
    /// Set-point that the hub has or that is sent next; `None` if the motor is off.
    setpoint: Option<Setpoint>,
    /// True if the hub does not have the set-point yet.
    is_new: bool,
    /// End of the set-point's validity, as time since the start of the hub's thread; `None` for a stop.
    until: Option<Duration>,
    /// Why commands for this joint are ignored until `enable`; `None` if commands are accepted.
    off: Option<String>,
}

impl Command {
    /// Ignores commands for the joint until [`Robot::enable`].
    fn refuse(&mut self, why: &str) {
        *self = Self { off: Some(format!("{why}; call enable")), ..Self::default() };
    }
}

/// Decides which commander drives the robot. Times count from the start of the hub's thread.
#[derive(Clone, Debug, Default)]
struct Commander {
    /// The last [`REMEMBERED`] commanders, in the order of their first command.
    known: Vec<Source>,
    /// The commander that drives, and the time of its last command.
    driving: Option<(Source, Duration)>,
    /// The commander that was last replaced, or whose command was last ignored, and the time of this event.
    ignored: Option<(Source, Duration)>,
    /// Visible publishers, which show whether two sources belong to one process.
    publishers: Publishers,
}

impl Commander {
    /// Returns true if this commander may drive now, and records its command.
    fn admits(&mut self, from: Source, now: Duration) -> bool {
        let is_new = !self.known.iter().any(|known| self.publishers.is_same(known, &from));
        if is_new {
            if self.known.len() == REMEMBERED {
                self.known.remove(0);
            }
            self.known.push(from.clone());
        }
        if let Some((driving, last)) = &self.driving
            && !self.publishers.is_same(driving, &from)
            && now.saturating_sub(*last) < SILENT
        {
            self.ignored = Some((if is_new { driving.clone() } else { from.clone() }, now));
            if !is_new {
                return false;
            }
        }
        self.driving = Some((from, now));
        true
    }

    /// Returns a warning for 5 s after a commander was replaced or ignored.
    fn conflict(&self, now: Duration) -> Option<String> {
        let ((ignored, at), (driving, _)) = (self.ignored.as_ref()?, self.driving.as_ref()?);
        let [driving, ignored] = [driving, ignored].map(|source| self.publishers.name(source));
        (now.saturating_sub(*at) < SILENT)
            .then(|| format!("two commanders: {driving} drives, {ignored} is ignored"))
    }
}

/// Newest reports of the hubs that can be reached, by address. `None` is the address of the hub at the port.
type Reports = BTreeMap<Option<u8>, HubReport>;

/// The motors of one hub, and of the hubs behind it.
#[derive(Debug)]
pub(crate) struct Robot {
    config: Hub,
    commands: Vec<Command>,
    commander: Commander,
    /// Why all commands are ignored until `enable`; `None` if commands are accepted.
    off: Option<&'static str>,
    reports: Reports,
    /// Pose in `odom` at which the hub's odometry started.
    start: Pose,
    /// The newest odometry of the hub. `None` without a base.
    odometry: Option<OdometryReport>,
    /// Forward speed in m/s and turning speed in rad/s.
    twist: (f64, f64),
    /// Number of commands for joints that the configuration does not have.
    unknown_joints: u64,
    /// The name in the last of these commands.
    last_unknown_joint: Option<String>,
    /// Number of commands beyond what the protocol can express.
    out_of_range: u64,
}

impl Robot {
    pub(crate) fn new(config: Hub, publishers: Publishers) -> Self {
        Self {
            commands: vec![Command::default(); config.joints.len()],
            config,
            commander: Commander { publishers, ..Commander::default() },
            off: None,
            reports: Reports::new(),
            start: Pose::default(),
            odometry: None,
            twist: (0.0, 0.0),
            unknown_joints: 0,
            last_unknown_joint: None,
            out_of_range: 0,
        }
    }

    pub(crate) const fn config(&self) -> &Hub {
        &self.config
    }

    /// Takes a forward speed in m/s and a turning speed in rad/s for the drive base. Speeds beyond what the protocol
    /// can express are reduced together, so that the curve keeps its radius. Speeds that cannot be computed are ignored
    /// and counted.
    pub(crate) fn twist(&mut self, from: Source, (forward, turn): (f64, f64), now: Duration) {
        let Some((base, joints)) = self.config.drive_base() else { return };
        let Ok(speeds) = base.speeds(1e3 * forward, turn.to_degrees()) else {
            self.out_of_range += 1;
            return;
        };
        if !self.admits(from, now) {
            return;
        }
        // A single wheel would drive the base in a circle.
        if joints.iter().any(|joint| self.commands.get(*joint).is_some_and(|command| command.off.is_some())) {
            return;
        }
        let speeds = speeds.map(CountsPerSecond::to_f64);
        let fastest = speeds.iter().fold(FASTEST, |most, speed| most.max(speed.abs()));
        for (joint, speed) in joints.into_iter().zip(speeds) {
            self.set(joint, Setpoint::Velocity((speed * FASTEST / fastest).round() as i16), now);
        }
    }

    /// Takes commands for joints by name. A joint with a position moves to this position. The velocity, if given,
    /// limits its speed. A joint without a position turns at its velocity. A joint that has only an effort gets a
    /// constant current for this torque. Values that are not finite numbers are ignored. Unknown names, and commands
    /// out of range, are ignored and counted. The sender of a message without any command for a joint does not count as
    /// a commander.
    pub(crate) fn joints(&mut self, from: Source, commands: &JointCommands, now: Duration) {
        let mut setpoints = Vec::new();
        for (index, name) in commands.names.iter().enumerate() {
            let Some(at) = self.config.joints.iter().position(|joint| joint.name == *name) else {
                self.unknown_joints += 1;
                self.last_unknown_joint = Some(name.clone());
                continue;
            };
            let value = |values: &[f64]| values.get(index).copied().filter(|value| value.is_finite());
            let setpoint = setpoint(
                &self.config.joints[at],
                value(&commands.positions),
                value(&commands.velocities),
                value(&commands.efforts),
            );
            match setpoint {
                Ok(setpoint) => setpoints.extend(setpoint.map(|setpoint| (at, setpoint))),
                Err(OutOfRange) => self.out_of_range += 1,
            }
        }
        if setpoints.is_empty() || !self.admits(from, now) {
            return;
        }
        for (joint, setpoint) in setpoints {
            self.set(joint, setpoint, now);
        }
    }

    fn admits(&mut self, from: Source, now: Duration) -> bool {
        self.off.is_none() && self.commander.admits(from, now)
    }

    fn set(&mut self, joint: usize, setpoint: Setpoint, now: Duration) {
        if let Some(command) = self.commands.get_mut(joint).filter(|command| command.off.is_none()) {
            command.is_new |= command.setpoint != Some(setpoint);
            (command.setpoint, command.until) = (Some(setpoint), Some(now + VALID));
        }
    }

    /// Records that the present position of a joint is 0 counts now. A joint with a target position is held there until
    /// its next command.
    pub(crate) fn note_encoder_reset(&mut self, joint: usize) {
        if let Some(command) = self.commands.get_mut(joint)
            && let Some(Setpoint::Position { counts, .. }) = &mut command.setpoint
        {
            *counts = 0;
            (command.is_new, command.until) = (true, None);
        }
    }

    /// Returns the set-points that the hubs do not have yet, with the index of each joint. A joint whose command is no
    /// longer valid stops. In position mode it gets its present position as target, otherwise speed 0.
    pub(crate) fn due(&mut self, now: Duration) -> Vec<(usize, Setpoint)> {
        let mut due = Vec::new();
        for (index, (joint, command)) in self.config.joints.iter().zip(&mut self.commands).enumerate() {
            if command.until.is_some_and(|until| now >= until) {
                let present = motor(&self.reports, joint).map(|motor| motor.position);
                let stop = match (command.setpoint, present) {
                    (Some(Setpoint::Position { tolerance, speed_limit, .. }), Some(counts)) => {
                        Setpoint::Position { counts, tolerance, speed_limit }
                    }
                    _ => Setpoint::Velocity(0),
                };
                command.is_new |= command.setpoint != Some(stop);
                (command.setpoint, command.until) = (Some(stop), None);
            }
            if let Some(setpoint) = command.setpoint.filter(|_| std::mem::take(&mut command.is_new)) {
                due.push((index, setpoint));
            }
        }
        due
    }

    /// Returns the time until the first command is no longer valid, so that [`due`](Self::due) returns a stop; `None`
    /// without a valid command.
    pub(crate) fn next_stop(&self, now: Duration) -> Option<Duration> {
        self.commands.iter().filter_map(|command| command.until).min().map(|until| until.saturating_sub(now))
    }

    /// Ignores all commands until [`enable`](Self::enable). The caller disables the motors.
    pub(crate) fn stop(&mut self, why: &'static str) {
        self.off = Some(why);
        for command in &mut self.commands {
            *command = Command { off: command.off.take(), ..Command::default() };
        }
    }

    /// Records that the hub cannot be reached any more. All commands are ignored until [`enable`](Self::enable).
    pub(crate) fn lose(&mut self) {
        self.stop("the hub was lost; call enable");
        self.reports.clear();
    }

    /// Records that a hub behind the hub at the port cannot be reached. Commands for its joints are ignored until
    /// [`enable`](Self::enable).
    pub(crate) fn lose_child(&mut self, address: u8) {
        if self.reports.remove(&Some(address)).is_some() {
            self.refuse_all_of(Some(address), &format!("the hub at address {address} was lost"));
        }
    }

    /// Ignores commands for the joints of one hub until [`enable`](Self::enable).
    pub(crate) fn refuse_all_of(&mut self, address: Option<u8>, why: &str) {
        let all = self.config.joints.iter().zip(&mut self.commands);
        all.filter(|(joint, _)| joint.address == address).for_each(|(_, command)| command.refuse(why));
    }

    /// Records that the hub's odometry starts again at its origin. The present pose in `odom` stays unchanged.
    pub(crate) fn start_base(&mut self) {
        self.start = self.pose();
        self.odometry = None;
    }

    /// Returns the pose of the drive base in `odom`.
    fn pose(&self) -> Pose {
        self.odometry.map_or(self.start, |odometry| {
            let [x, y] = [odometry.x_um, odometry.y_um].map(|um| f64::from(um) / 1e6);
            let heading = (f64::from(odometry.heading_millidegrees) / 1e3).to_radians();
            self.start.then(Pose { x, y, heading })
        })
    }

    /// Accepts commands again, also for joints that had a fault.
    pub(crate) fn enable(&mut self) {
        self.off = None;
        for command in &mut self.commands {
            *command = Command::default();
        }
    }

    /// Ignores commands for a joint until [`enable`](Self::enable), because the hub has refused its set-point or has
    /// disabled its motor.
    pub(crate) fn refuse(&mut self, joint: usize, why: &str) {
        if let Some(command) = self.commands.get_mut(joint) {
            command.refuse(why);
        }
    }

    /// Returns why all commands are ignored; `None` if commands are accepted.
    pub(crate) const fn off(&self) -> Option<&'static str> {
        self.off
    }

    /// Takes a report of the hub at `address`, and the odometry of the drive base. `None` leaves the odometry
    /// unchanged.
    pub(crate) fn observe(
        &mut self,
        address: Option<u8>,
        report: HubReport,
        odometry: Option<OdometryReport>,
    ) {
        self.odometry = odometry.or(self.odometry);
        for (joint, command) in self.config.joints.iter().zip(&mut self.commands) {
            let Some(motor) = report.motors.get(usize::from(joint.motor)) else { continue };
            let driven = joint.address == address && command.setpoint.is_some() && !command.is_new;
            let accepts = command.off.is_none();
            if driven && accepts && report.is_up_to_date() && (motor.faults.any() || !motor.enabled) {
                let why = why_still(&report, joint.motor.into()).unwrap_or("the hub has disabled the motor");
                command.refuse(why);
                if motor.enabled {
                    // After a fault that passes, the motor would follow the set-point that the hub has.
                    (command.setpoint, command.is_new) = (Some(Setpoint::Velocity(0)), true);
                }
            }
        }
        if address.is_none()
            && let Some((base, joints)) = self.config.drive_base()
        {
            let at =
                |joint: usize| self.config.joints.get(joint).map_or(usize::MAX, |joint| joint.motor.into());
            let speeds =
                joints.map(|joint| report.motors.get(at(joint)).map_or(0, |motor| motor.velocity.into()));
            self.twist = (base.distance(speeds) / 1e3, base.heading(speeds).to_radians());
        }
        self.reports.insert(address, report);
    }

    /// Returns pose and twist of the drive base at the hub's last control tick. `None` without a base or a report.
    pub(crate) fn odometry(&self) -> Option<(Pose, (f64, f64))> {
        (self.odometry.is_some() && self.reports.contains_key(&None)).then(|| (self.pose(), self.twist))
    }

    /// Returns the heading in rad; `None` unless the base holds the heading of the gyro.
    pub(crate) fn gyro_heading(&self) -> Option<f64> {
        self.odometry.filter(|odometry| odometry.gyro == GyroState::Good).map(|_| self.pose().heading)
    }

    /// Returns name, position in rad, velocity in rad/s and effort in N m of each joint whose hub can be reached. The
    /// effort is NaN if it is unknown.
    pub(crate) fn joint_states(&self) -> Vec<(&str, f64, f64, f64)> {
        let states = self.config.joints.iter().filter_map(|joint| {
            let (motor, scale) = (motor(&self.reports, joint)?, joint.counts_per_radian());
            let amperes = f64::from(motor.best_current().get()) / 1e3 * scale.signum();
            let effort = joint.torque_per_ampere.map_or(f64::NAN, |torque| torque * amperes);
            Some((
                joint.name.as_str(),
                f64::from(motor.position) / scale,
                f64::from(motor.velocity) / scale,
                effort,
            ))
        });
        states.collect()
    }

    /// Returns the battery voltage in V, if the hub knows it, and the battery current in A. The current is the sum over
    /// the motors of current times duty. As in ROS 2 it is negative while the battery supplies current. `None` without
    /// a report of the hub.
    pub(crate) fn battery(&self) -> Option<(Option<f32>, f32)> {
        let volts = self.reports.get(&None)?.battery.map(|battery| f32::from(battery.get()) / 1e3);
        let drawn = self
            .reports
            .values()
            .flat_map(|report| &report.motors)
            .map(|motor| motor.best_current().get().unsigned_abs() as f32 / 1e3 * drawn_share(motor));
        Some((volts, -drawn.sum::<f32>()))
    }

    /// Returns the state of the hub and of each joint for diagnostics. `malformed` is the number of malformed messages
    /// that were dropped.
    pub(crate) fn diagnostics(&self, malformed: u64, now: Duration) -> Vec<Status> {
        let name = self.config.namespace.trim_start_matches('/').replace('/', " ");
        let name = if name.is_empty() { "hub".to_owned() } else { name };
        let (level, message) = match (self.reports.get(&None), self.off, self.commander.conflict(now)) {
            (None, ..) => (Level::Stale, "the hub cannot be reached".to_owned()),
            (_, Some(why), _) => (Level::Warn, why.to_owned()),
            (.., Some(conflict)) => (Level::Warn, conflict),
            _ => (Level::Ok, "ready".to_owned()),
        };
        let mut values = vec![
            ("malformed messages", malformed.to_string()),
            ("commands for unknown joints", self.unknown_joints.to_string()),
            ("commands out of range", self.out_of_range.to_string()),
        ];
        values.extend(self.last_unknown_joint.clone().map(|name| ("last unknown joint", name)));
        if let Some(OdometryReport { gyro, losses, .. }) = self.odometry {
            values.push(("heading", heading_text(gyro).to_owned()));
            values.push(("times the gyro was lost", losses.to_string()));
        }
        let mut all = vec![Status { level, name: name.clone(), message, values }];
        for (joint, command) in self.config.joints.iter().zip(&self.commands) {
            let (hub, of) = match joint.address {
                Some(address) => {
                    (format!("the hub at address {address}"), format!("{address}:{}", joint.motor))
                }
                None => ("the hub".to_owned(), joint.motor.to_string()),
            };
            let mut values = vec![("motor", of)];
            let name = format!("{name}: {}", joint.name);
            let Some(motor) = motor(&self.reports, joint) else {
                let message = format!("{hub} cannot be reached");
                all.push(Status { level: Level::Stale, name, message, values });
                continue;
            };
            let faults: Vec<Fault> =
                Fault::ALL.iter().copied().filter(|fault| fault.is_in(motor.faults)).collect();
            let report = self.reports.get(&joint.address);
            let why = report.and_then(|report| why_still(report, joint.motor.into()));
            let (level, message) = match (&command.off, faults.first()) {
                (Some(off), _) => (Level::Error, off.clone()),
                (None, Some(fault)) => (Level::Error, fault.name().to_owned()),
                _ if motor.stalled || motor.derated || motor.current_limited => {
                    (Level::Warn, why.unwrap_or("the current is limited").to_owned())
                }
                _ => (Level::Ok, why.unwrap_or("turning").to_owned()),
            };
            values
                .extend(faults.iter().map(|fault| ("fault", format!("{} {}", fault.number(), fault.name()))));
            values.push(("heat", format!("{:.0} %", f64::from(motor.heat) / 10.0)));
            all.push(Status { level, name, message, values });
        }
        all
    }
}

fn motor<'a>(reports: &'a Reports, joint: &Joint) -> Option<&'a MotorReport> {
    reports.get(&joint.address)?.motors.get(usize::from(joint.motor))
}

/// Returns the share of a motor's current that the battery supplies: the duty while the motor is driven, 0 while the
/// motor brakes or coasts.
fn drawn_share(motor: &MotorReport) -> f32 {
    use motor_hub_client::motor_hub::braking::Regime;
    match motor.regime {
        Some(Regime::Forward | Regime::Reverse) => motor.drive.duty.to_f32(),
        Some(Regime::Braking) | None => 0.0,
    }
}

/// A command that is beyond what the protocol can express.
struct OutOfRange;

/// Rounds a value of a command to whole units of the hub.
fn whole(value: f64, most: f64) -> Result<f64, OutOfRange> {
    let value = value.round();
    if value.abs() <= most { Ok(value) } else { Err(OutOfRange) }
}

/// Returns the set-point for a joint's command; `None` for a command without values, or with an effort that the joint
/// does not accept.
fn setpoint(
    joint: &Joint,
    position: Option<f64>,
    velocity: Option<f64>,
    effort: Option<f64>,
) -> Result<Option<Setpoint>, OutOfRange> {
    let scale = joint.counts_per_radian();
    let limit = (joint.speed * scale.abs()).clamp(1.0, FASTEST).round();
    Ok(Some(match (position, velocity, effort) {
        (Some(position), velocity, _) => {
            // Programs of ROS often fill in 0 for a velocity that is not given.
            let speed = velocity
                .filter(|velocity| *velocity != 0.0)
                .map_or(limit, |velocity| (velocity * scale).abs().round().clamp(1.0, limit));
            let counts = whole(position * scale, f64::from(i32::MAX))? as i32;
            Setpoint::Position { counts, tolerance: 0, speed_limit: speed as i16 }
        }
        (None, Some(velocity), _) => Setpoint::Velocity(whole(velocity * scale, FASTEST)? as i16),
        (None, None, Some(effort)) => {
            let Some(torque_per_ampere) = joint.torque_per_ampere else { return Ok(None) };
            let amperes = effort / torque_per_ampere * scale.signum();
            let ma = constant_current_ma(amperes).map_err(|_| OutOfRange)?;
            Setpoint::Current { ma, speed_limit: limit as u16 }
        }
        (None, None, None) => return Ok(None),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Config, tests::EXAMPLE};
    use motor_hub_client::motor_hub::extension::report::ReportedSetpoint;
    use motor_hub_client::motor_hub::motor::Faults;

    const A: Source = Source { gid: [1; 16], timed_by: None };
    const B: Source = Source { gid: [2; 16], timed_by: None };

    fn robot() -> Robot {
        Robot::new(Config::read(EXAMPLE).unwrap().hubs.remove(0), Publishers::default())
    }

    fn position(counts: i32, speed_limit: i16) -> Setpoint {
        Setpoint::Position { counts, tolerance: 0, speed_limit }
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    /// A report of two enabled motors without faults at these positions.
    fn report(positions: [i32; 2]) -> HubReport {
        let motor = |position| MotorReport {
            position,
            enabled: true,
            setpoint: ReportedSetpoint::Velocity(0),
            ..MotorReport::default()
        };
        HubReport { motors: positions.into_iter().map(motor).collect(), ..HubReport::default() }
    }

    fn commands(names: &[&str], positions: &[f64], velocities: &[f64], efforts: &[f64]) -> JointCommands {
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        let [positions, velocities, efforts] = [positions, velocities, efforts].map(<[f64]>::to_vec);
        JointCommands { names, positions, velocities, efforts }
    }

    fn velocities(names: &[&str], velocities: &[f64]) -> JointCommands {
        commands(names, &[], velocities, &[])
    }

    #[test]
    fn a_twist_becomes_two_wheel_speeds_and_ends_after_half_a_second() {
        let mut robot = robot();
        robot.twist(A, (0.5, 0.0), ms(0));
        // 0.5 m/s on wheels of 0.09 m are 1.768 turns/s. The right motor is mirrored.
        assert_eq!(robot.due(ms(0)), [(0, Setpoint::Velocity(2971)), (1, Setpoint::Velocity(-2971))]);
        assert_eq!(robot.next_stop(ms(100)), Some(ms(400)));
        assert_eq!(robot.due(ms(499)), []);
        assert_eq!(robot.due(ms(500)), [(0, Setpoint::Velocity(0)), (1, Setpoint::Velocity(0))]);
        assert_eq!((robot.due(ms(5000)), robot.next_stop(ms(5000))), (vec![], None));
    }

    #[test]
    fn a_repeated_command_is_sent_once_and_stays_valid() {
        let mut robot = robot();
        for tick in 0..100 {
            robot.twist(A, (0.5, 0.0), ms(20 * tick));
            assert_eq!(robot.due(ms(20 * tick)).is_empty(), tick > 0);
        }
    }

    #[test]
    fn a_twist_beyond_the_range_keeps_its_curve() {
        let mut robot = robot();
        robot.twist(A, (20.0, 20.0), ms(0));
        let speeds: Vec<_> = robot.due(ms(0)).into_iter().map(|(_, setpoint)| setpoint).collect();
        // The wheels' speeds are 17 and 23 m/s.
        let [Setpoint::Velocity(left), Setpoint::Velocity(right)] = speeds[..] else { panic!("{speeds:?}") };
        assert_eq!(right, -i16::MAX);
        assert!((f64::from(left) / f64::from(right) + 17.0 / 23.0).abs() < 1e-3);
    }

    #[test]
    fn joints_are_driven_by_name_and_by_what_is_given() {
        let mut robot = robot();
        let names = ["right", "none", "left"];
        let all = commands(&names, &[TAU, 0.0, f64::NAN], &[1.0, 1.0, f64::NAN], &[0.0, 0.0, 1.2]);
        robot.joints(A, &all, ms(0));
        assert_eq!(
            robot.due(ms(0)),
            [(0, Setpoint::Current { ma: 2000, speed_limit: 1604 }), (1, position(-1680, 267))]
        );
        // The right joint has no torque constant, so it takes no effort.
        robot.joints(A, &commands(&["right"], &[], &[], &[1.0]), ms(10));
        assert_eq!(robot.due(ms(10)), []);
    }

    #[test]
    fn a_position_has_a_speed_limit_of_one_count_per_second_at_least_and_a_velocity_of_zero_is_no_limit() {
        for (velocity, speed) in [(0.001, 1), (-0.001, 1), (1.0, 267), (1e300, 1604), (0.0, 1604)] {
            let mut robot = robot();
            robot.joints(A, &commands(&["left"], &[TAU], &[velocity], &[]), ms(0));
            assert_eq!(robot.due(ms(0)), [(0, position(1680, speed))], "{velocity} rad/s");
        }
    }

    #[test]
    fn a_command_out_of_range_is_refused_and_counted_and_makes_no_commander() {
        let mut robot = robot();
        robot.observe(None, report([0, 0]), None);
        robot.joints(A, &velocities(&["left"], &[1.0]), ms(0));
        robot.due(ms(0));
        // The largest values are 2^31 - 1 counts, 32767 counts/s and 65.535 A.
        for out in [
            commands(&["left"], &[-1e300], &[], &[]),
            commands(&["left"], &[8.04e6], &[], &[]),
            commands(&["left"], &[], &[1e300], &[]),
            commands(&["left"], &[], &[-122.6], &[]),
            commands(&["left"], &[], &[], &[1e300]),
            commands(&["left"], &[], &[], &[-39.4]),
        ] {
            robot.joints(B, &out, ms(10));
            assert_eq!(robot.due(ms(10)), [], "{out:?}");
        }
        robot.twist(B, (1e300, 0.0), ms(10));
        // Another joint of the same message is driven.
        robot.joints(A, &velocities(&["left", "right"], &[1e300, 1.0]), ms(20));
        assert_eq!(robot.due(ms(20)), [(1, Setpoint::Velocity(-267))]);
        let hub = robot.diagnostics(0, ms(20)).remove(0);
        assert_eq!(hub.message, "ready");
        assert_eq!(hub.values[2], ("commands out of range", "8".to_owned()));
    }

    #[test]
    fn a_position_whose_commands_end_is_held_where_the_joint_is() {
        let mut robot = robot();
        robot.joints(A, &commands(&["left"], &[TAU], &[], &[]), ms(0));
        robot.due(ms(0));
        robot.observe(None, report([700, 0]), None);
        assert_eq!(robot.due(ms(600)), [(0, position(700, 1604))]);
    }

    #[test]
    fn a_joint_with_a_target_position_is_held_where_it_is_when_its_encoder_is_reset() {
        let mut robot = robot();
        let commands = commands(&["left", "right"], &[TAU, f64::NAN], &[f64::NAN, 1.0], &[]);
        robot.joints(A, &commands, ms(0));
        let [there, turning] = robot.due(ms(0))[..] else { panic!("two set-points") };
        robot.observe(None, report([1680, 0]), None);
        robot.note_encoder_reset(0);
        robot.note_encoder_reset(1);
        assert_eq!(robot.due(ms(10)), [(0, position(0, 1604))]);
        // No report has the new position yet when the commands end.
        assert_eq!(robot.due(ms(500)), [(1, Setpoint::Velocity(0))]);
        robot.joints(A, &commands, ms(600));
        assert_eq!(robot.due(ms(600)), [there, turning]);
    }

    #[test]
    fn the_newest_commander_drives_and_the_conflict_is_reported() {
        let mut robot = robot();
        robot.observe(None, report([0, 0]), None);
        robot.twist(A, (0.1, 0.0), ms(0));
        robot.twist(B, (0.2, 0.0), ms(10));
        robot.due(ms(10));
        robot.twist(A, (0.1, 0.0), ms(20));
        assert_eq!(robot.due(ms(20)), []);
        let hub = robot.diagnostics(0, ms(20)).remove(0);
        assert_eq!(
            (hub.level, hub.message.as_str()),
            (Level::Warn, "two commanders: 02020202 drives, 01010101 is ignored")
        );
        // The newer commander is silent, so the older commander drives again after 5 s.
        robot.twist(A, (0.1, 0.0), ms(5009));
        assert!(robot.due(ms(5009)).iter().all(|(_, setpoint)| *setpoint == Setpoint::Velocity(0)));
        robot.twist(A, (0.1, 0.0), ms(5010));
        assert_eq!(robot.due(ms(5010)).len(), 2);
    }

    #[test]
    fn a_message_for_unknown_joints_alone_makes_no_commander_and_is_reported() {
        let mut robot = robot();
        robot.observe(None, report([0, 0]), None);
        robot.joints(A, &velocities(&["left"], &[1.0]), ms(0));
        robot.joints(B, &velocities(&["arm", "lift"], &[1.0, 1.0]), ms(10));
        robot.joints(A, &velocities(&["left"], &[2.0]), ms(20));
        assert_eq!(robot.due(ms(20)), [(0, Setpoint::Velocity(535))]);
        let hub = robot.diagnostics(0, ms(20)).remove(0);
        assert_eq!(hub.message, "ready");
        assert_eq!(hub.values[1], ("commands for unknown joints", "2".to_owned()));
        assert_eq!(hub.values[3], ("last unknown joint", "lift".to_owned()));
    }

    #[test]
    fn a_joint_with_a_fault_is_off_until_enable_and_its_number_is_reported() {
        let mut robot = robot();
        robot.twist(A, (0.5, 0.0), ms(0));
        robot.due(ms(0));
        let mut faulty = report([0, 0]);
        faulty.motors[0].faults = Faults { bridge: true, ..Faults::default() };
        robot.observe(None, faulty, None);
        let left = robot.diagnostics(0, ms(0)).remove(1);
        assert_eq!((left.level, left.name.as_str()), (Level::Error, "hub0: left"));
        assert!(left.values.contains(&("fault", "5 bridge switched itself off".to_owned())), "{left:?}");
        assert_eq!(robot.due(ms(5)), [(0, Setpoint::Velocity(0))]);
        robot.joints(A, &velocities(&["left", "right"], &[1.0, 1.0]), ms(10));
        assert_eq!(robot.due(ms(10)), [(1, Setpoint::Velocity(-267))]);
        // A base does not move by one wheel.
        robot.twist(A, (0.4, 0.0), ms(20));
        assert_eq!(robot.due(ms(20)), []);
        assert_eq!(robot.due(ms(510)), [(1, Setpoint::Velocity(0))]);
        robot.enable();
        robot.twist(A, (0.5, 0.0), ms(520));
        assert_eq!(robot.due(ms(520)).len(), 2);
    }

    #[test]
    fn a_joint_does_not_turn_again_when_its_fault_passes() {
        let mut robot = robot();
        robot.twist(A, (0.5, 0.0), ms(0));
        robot.due(ms(0));
        // The hub keeps the set-point of a motor during this fault, which passes with the next battery reading.
        let mut faulty = report([0, 0]);
        faulty.motors[0].faults = Faults { battery_unknown: true, ..Faults::default() };
        robot.observe(None, faulty.clone(), None);
        assert_eq!(robot.due(ms(10)), [(0, Setpoint::Velocity(0))]);
        robot.observe(None, faulty, None);
        robot.observe(None, report([0, 0]), None);
        robot.joints(A, &velocities(&["left", "right"], &[1.0, 1.0]), ms(20));
        assert_eq!(robot.due(ms(20)), [(1, Setpoint::Velocity(-267))]);
        // A set-point would enable a motor that the hub has disabled.
        let mut disabled = report([0, 0]);
        disabled.motors[1].enabled = false;
        robot.observe(None, disabled, None);
        assert_eq!(robot.due(ms(30)), []);
    }

    #[test]
    fn a_lost_hub_reports_nothing_old_and_stays_off() {
        let mut robot = robot();
        robot.observe(None, report([10, 10]), None);
        robot.lose();
        assert!(robot.joint_states().is_empty() && robot.odometry().is_none() && robot.battery().is_none());
        assert_eq!(robot.diagnostics(0, ms(0)).remove(0).level, Level::Stale);
        robot.observe(None, report([10, 10]), None);
        robot.twist(A, (0.5, 0.0), ms(0));
        assert_eq!(robot.due(ms(0)), []);
    }

    #[test]
    fn of_a_chain_a_lost_hub_takes_its_own_joints_alone() {
        let chain = EXAMPLE.replace(
            "        ]",
            r#"    { name = "lift", address = 3, motor = 0, counts_per_turn = 1680, speed = 6 },
        ]"#,
        );
        let mut robot = Robot::new(Config::read(&chain).unwrap().hubs.remove(0), Publishers::default());
        robot.observe(None, report([100, 200]), None);
        robot.observe(Some(3), report([300, 400]), None);
        let names =
            |robot: &Robot| robot.joint_states().iter().map(|joint| joint.0.to_owned()).collect::<Vec<_>>();
        assert_eq!(names(&robot), ["left", "right", "lift"]);
        assert_eq!(robot.joint_states()[2].1, 300.0 / 1680.0 * TAU);
        let all = velocities(&["left", "lift"], &[1.0, 1.0]);
        robot.joints(A, &all, ms(0));
        assert_eq!(robot.due(ms(0)), [(0, Setpoint::Velocity(267)), (2, Setpoint::Velocity(267))]);
        // The joint `left` has motor 0 of the hub at the port. A disabled motor 0 of the other hub must not switch this
        // joint off.
        let mut disabled = report([0, 0]);
        disabled.motors[0].enabled = false;
        robot.observe(Some(3), disabled, None);
        robot.joints(A, &velocities(&["left", "lift"], &[2.0, 2.0]), ms(10));
        assert_eq!(robot.due(ms(10)), [(0, Setpoint::Velocity(535))]);
        robot.lose_child(3);
        assert_eq!(names(&robot), ["left", "right"]);
        let told = robot.diagnostics(0, ms(10));
        assert_eq!(
            told.iter().map(|status| status.level).collect::<Vec<_>>(),
            [Level::Ok, Level::Ok, Level::Ok, Level::Stale]
        );
        assert_eq!(told[3].message, "the hub at address 3 cannot be reached");
        assert_eq!(told[3].values, [("motor", "3:0".to_owned())]);
        // The hub at address 3 can be reached again.
        robot.observe(Some(3), report([0, 0]), None);
        robot.joints(A, &all, ms(20));
        assert_eq!(robot.due(ms(20)), [(0, Setpoint::Velocity(267))]);
        robot.enable();
        robot.joints(A, &all, ms(30));
        assert_eq!(robot.due(ms(30)).len(), 2);
    }

    #[test]
    fn the_base_is_where_the_hub_says_and_stays_there_when_the_hub_counts_from_the_origin_again() {
        let mut robot = robot();
        let odometry = |x_um, heading_millidegrees| {
            Some(OdometryReport { x_um, heading_millidegrees, ..OdometryReport::default() })
        };
        assert!(robot.odometry().is_none());
        robot.observe(None, report([0, 0]), odometry(1_000_000, 90_000));
        // A report without odometry leaves the pose of the base unchanged.
        robot.observe(None, report([0, 0]), None);
        robot.start_base();
        assert!(robot.odometry().is_none(), "nothing old is published");
        robot.observe(None, report([0, 0]), odometry(500_000, -90_000));
        let (pose, _) = robot.odometry().unwrap();
        assert!((pose.x - 1.0).abs() < 1e-9 && (pose.y - 0.5).abs() < 1e-9, "{pose:?}");
        assert!(pose.heading.abs() < 1e-9, "{pose:?}");
    }

    use std::f64::consts::TAU;
}
