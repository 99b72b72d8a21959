//! `motor-hub client together`: moves motors in step.

use super::drive;
use super::hub::HubOptions;
use super::motion::{StandstillDetector, reasons, warn_of};
use super::motors_off::{DrivingSession, names};
use super::readings::motors_of;
use crate::output::{Failure, print};
use crate::parse::{MotorName, common_hub, whole, within_a_day};
use motor_hub::extension::group::{GroupCourse, GroupState};
use motor_hub::group::{DEFAULT_TOLERANCE, GroupCommand, Halt};
use motor_hub::protocol::CHANNELS;
use motor_hub::units::{Acceleration, CountsPerSecond};
use motor_hub_client::hub::FASTEST_GROUP_CPS;
use motor_hub_client::{Error, Session};
use std::time::Duration;

/// Moves motors in step to positions, or at speeds, then disables them, on hubs of this project
///
/// All motors travel in proportion. If a motor lags, the others wait for it. On the way to positions the command fails
/// (exit code 1) if no motor makes progress for 5 s, for example because a motor is held fast.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Motors 0 to 3 with their target positions in counts, as 0=1000 1=-500; of another hub of a chain as 3:0=1000
    #[arg(value_name = "MOTOR=COUNTS", required = true, value_parser = member)]
    members: Vec<(MotorName, i32)>,
    /// Targets are relative to the present positions
    #[arg(long)]
    by: bool,
    /// Targets are speeds in counts per second, which the motors then hold
    #[arg(long, conflicts_with_all = ["by", "speed"])]
    on: bool,
    /// Speed of the motor with the longest distance, in counts per second
    #[arg(long = "speed-cps", alias = "speed", value_name = "CPS", default_value_t = 1000)]
    #[arg(value_parser = whole("a speed", 1..=FASTEST_GROUP_CPS, "counts/s"))]
    speed: i32,
    /// Largest acceleration of any motor, in counts per second squared
    #[arg(long = "acceleration-cps2", alias = "acceleration", value_name = "CPS2", default_value_t = 2000)]
    #[arg(value_parser = whole("an acceleration", 1..=u32::MAX, "counts/s\u{b2}"))]
    acceleration: u32,
    /// Lag in counts from which the others wait for a motor; below 24 motors may move slowly or not at all [default: its distance in 0.1 s, at least 24]
    #[arg(long = "lag-counts", alias = "lag", value_name = "COUNTS")]
    #[arg(value_parser = whole("a lag", 0..=u16::MAX, "counts"))]
    lag: Option<u16>,
    /// Largest distance to its target, in counts, at which a motor can settle
    #[arg(long = "tolerance-counts", alias = "tolerance", value_name = "COUNTS", default_value_t = DEFAULT_TOLERANCE)]
    #[arg(value_parser = whole("a tolerance", 0..=u16::MAX, "counts"))]
    tolerance: u16,
    /// A fault of one motor disables all [default: the others stop in step]
    #[arg(long)]
    coast: bool,
    /// Longest duration in seconds [default: no limit]
    #[arg(long = "for-s", alias = "for", value_name = "S", value_parser = within_a_day)]
    length: Option<Duration>,
}

fn member(text: &str) -> Result<(MotorName, i32), String> {
    let (motor, counts) = text.split_once('=').ok_or("give MOTOR=COUNTS, such as 0=1000")?;
    let counts = counts.parse().map_err(|_| "COUNTS is a whole number from -2147483648 to 2147483647")?;
    Ok((crate::parse::motor(motor)?, counts))
}

impl Options {
    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let of_motors = common_hub(self.members.iter().map(|(motor, _)| *motor))
            .map_err(|why| Failure::Input(format!("{why}, and so is a group")))?;
        let values = self.values()?;
        let session = &mut hub.open(of_motors)?;
        let motors: Vec<u8> = drive::ALL.into_iter().zip(values).filter_map(|(m, v)| v.map(|_| m)).collect();
        let settled = DrivingSession::run(session, |session| {
            if self.on {
                let speeds = drive::ALL.into_iter().zip(values);
                let speeds = speeds.filter_map(|(motor, cps)| Some((motor, cps?.unsigned_abs())));
                warn_of(session, &speeds.collect::<Vec<_>>())?;
            }
            let wanted = self.wanted(session, values)?;
            enable_with_power_0(session, &motors)?;
            run_group(session, &motors, wanted, self.length, "targets not reached")
        })?;
        if settled {
            print("all motors settled\n")?;
        }
        Ok(())
    }

    /// Returns the target of each motor; `None` for a motor that is not given.
    fn values(&self) -> Result<[Option<i32>; CHANNELS], Failure> {
        let mut values = [None; CHANNELS];
        for &(MotorName { number: motor, .. }, value) in &self.members {
            if self.on && !(-FASTEST_GROUP_CPS..=FASTEST_GROUP_CPS).contains(&value) {
                return Err(Failure::input(format!(
                    "{motor}={value}: a speed is -{FASTEST_GROUP_CPS} to {FASTEST_GROUP_CPS} counts/s"
                )));
            }
            let slot = values.get_mut(usize::from(motor));
            if slot.and_then(|slot| slot.replace(value)).is_some() {
                return Err(Failure::input(format!("motor {motor} is given twice; give each motor once")));
            }
        }
        Ok(values)
    }

    fn wanted(
        &self,
        session: &mut Session,
        values: [Option<i32>; CHANNELS],
    ) -> Result<GroupCommand<GroupCourse>, Failure> {
        let mut speed = CountsPerSecond::new(self.speed);
        let course = if self.on {
            let fastest = values.iter().flatten().map(|cps| cps.abs()).max();
            speed = CountsPerSecond::new(fastest.unwrap_or_default());
            GroupCourse::Velocity(values.map(|cps| cps.map(CountsPerSecond::new)))
        } else {
            let mut places = values;
            if self.by {
                // Relative targets are converted to absolute positions. A retransmission of the request then has no
                // further effect.
                let from = session.group_positions(values.map(|counts| counts.is_some()))?;
                for (place, now) in places.iter_mut().zip(from) {
                    *place = place.map(|counts| now.wrapping_add(counts));
                }
            }
            GroupCourse::Position(places)
        };
        let acceleration = Acceleration::new(self.acceleration).map_err(Failure::input)?;
        let usual = GroupCommand::new(course, speed, acceleration);
        Ok(GroupCommand {
            lag: self.lag.unwrap_or(usual.lag),
            tolerance: self.tolerance,
            halt: if self.coast { Halt::Coast } else { Halt::Stop },
            ..usual
        })
    }
}

/// Longest wait for the remaining motors to stop in step after a motor has left the group. A motor at 4000 counts/s
/// stops within this time at the default acceleration.
const LONGEST_HALT: Duration = Duration::from_secs(2);

/// Starts a group and shows its motion. Returns true if all motors have settled, and false if the time of a motion at
/// speeds is over. `what` is the beginning of an error message, and says what the group has not done.
///
/// # Errors
/// * The group has not settled at its positions within `length`, or makes no progress.
/// * A motor has left the group, by a fault or because the hub has disabled the motor. The other motors have then
///   stopped in step, unless the stop takes longer than [`LONGEST_HALT`].
pub(super) fn run_group(
    session: &mut Session,
    motors: &[u8],
    wanted: GroupCommand<GroupCourse>,
    length: Option<Duration>,
    what: &str,
) -> Result<bool, Failure> {
    let Some(&first) = motors.first() else { return Ok(false) };
    let targets = match wanted.course {
        GroupCourse::Position(targets) => Some(targets),
        GroupCourse::Velocity(_) => None,
    };
    let mut standstill = targets.map(|targets| StandstillDetector::new(targets, wanted.speed.to_f64().abs()));
    session.move_together(first, wanted)?;
    let mut lost: Vec<u8> = Vec::new();
    let mut lost_at = None;
    let settled = drive::follow(session, motors, None, length, |session, reading| {
        let (mut moving, mut turning) = (false, false);
        lost.clear();
        for &motor in motors {
            match session.group_state(motor)? {
                GroupState::Moving => {
                    moving = true;
                    turning |= motors_of(&reading.bulk, &[motor]).any(|of| of.velocity != 0);
                }
                GroupState::Alone => lost.push(motor),
                GroupState::Settled => (),
            }
        }
        if lost.is_empty() {
            if let Some(detector) = standstill.as_mut().filter(|_| moving)
                && detector.step(reading.at, reading.bulk.encoders)
            {
                let members = drive::ALL.map(|motor| motors.contains(&motor));
                let positions = session.group_positions(members)?;
                let failure = detector.failure(positions, wanted.tolerance, reading.report.as_ref());
                return Err(Failure::Work(format!("{what}: {failure}")));
            }
            return Ok(!moving);
        }
        // A group that has lost a member never settles: the others hold the positions at which they stop.
        let since = *lost_at.get_or_insert(reading.at);
        Ok(!turning || reading.at.saturating_sub(since) > LONGEST_HALT)
    })?;
    if !lost.is_empty() {
        return Err(left_the_group(session, &lost)?);
    }
    if !settled && standstill.is_some() {
        let seconds = length.unwrap_or_default().as_secs_f64();
        let why = reasons(session.report()?.as_ref(), motors);
        return Err(Failure::Work(format!("{what} after {seconds} s{why}")));
    }
    Ok(settled)
}

/// Returns the failure that names the motors which have left their group, and their faults. Without a fault the hub has
/// disabled the motors, and the failure gives the hub's status.
fn left_the_group(session: &mut Session, lost: &[u8]) -> Result<Failure, Error> {
    let report = session.report()?;
    let mut why = reasons(report.as_ref(), lost);
    let mut motors = report.iter().flat_map(|report| (0..).zip(&report.motors));
    if !motors.any(|(motor, of)| lost.contains(&motor) && of.faults.any()) {
        why = format!("{why}; hub status: {}", session.status(false)?.words().join(", "));
    }
    Ok(Failure::Work(format!("{} left the group{why}", names(lost))))
}

/// Enables motors with power 0, so that they brake.
pub(super) fn enable_with_power_0(session: &mut DrivingSession<'_>, motors: &[u8]) -> Result<(), Failure> {
    for &motor in motors {
        session.brake(motor)?;
        session.enable(motor)?;
    }
    Ok(())
}
