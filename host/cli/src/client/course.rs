//! What motors are told to do by `power`, `velocity` and `position`, and whether they do.

use super::driven::Driven;
use super::live::motors_of;
use super::trouble::Trouble;
use crate::output::{Failure, say};
use motor_hub::motor::ZeroPower;
use motor_hub::protocol::answers::Bulk;
use motor_hub::protocol::motor::RunMode;
use motor_hub::units::{Control, EmfConstant, Millivolts};
use motor_hub_client::line::Line;
use motor_hub_client::{Error, Session};
use std::collections::VecDeque;
use std::time::Duration;

/// A set-point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Course {
    /// Share of full power.
    Power(Control),
    /// Counts per second.
    Velocity(i16),
    /// Counts, and counts per second on the way.
    Position { counts: i32, tolerance: u16, speed: i16 },
}

impl Course {
    const fn mode(self) -> RunMode {
        match self {
            Self::Power(_) => RunMode::Power,
            Self::Velocity(_) => RunMode::Velocity,
            Self::Position { .. } => RunMode::Position,
        }
    }

    /// Says it to a motor, which does it once it is enabled.
    pub(super) fn set(self, session: &mut Session<Line>, motor: u8) -> Result<(), Error> {
        match self {
            Self::Power(power) => session.set_power(motor, power),
            Self::Velocity(cps) => session.set_velocity(motor, cps),
            Self::Position { counts, tolerance, speed } => {
                session.set_velocity(motor, speed)?;
                session.set_position(motor, counts, tolerance)
            }
        }
    }

    /// How fast it wants a motor to turn, in counts per second; on its way to a position that is a limit, no wish.
    const fn speed(self) -> Option<u32> {
        match self {
            Self::Velocity(cps) => Some(cps.unsigned_abs() as u32),
            Self::Power(_) | Self::Position { .. } => None,
        }
    }
}

/// Motors, and what all of them are to do for how long.
pub(super) struct Order {
    pub(super) motors: Vec<u8>,
    pub(super) course: Course,
    pub(super) zero: ZeroPower,
    pub(super) length: Option<Duration>,
}

impl Order {
    /// Sets the motors going.
    pub(super) fn begin(&self, driven: &mut Driven<'_, Line>) -> Result<(), Trouble> {
        if let Some(speed) = self.course.speed() {
            let speeds: Vec<_> = self.motors.iter().map(|motor| (*motor, speed)).collect();
            warn_of(driven, &speeds)?;
        }
        for &motor in &self.motors {
            driven.set_mode(motor, self.course.mode(), self.zero)?;
            self.course.set(driven, motor)?;
        }
        for &motor in &self.motors {
            driven.enable(motor)?;
        }
        Ok(())
    }

    /// Fails if the hub has let go of a motor: fail-safe, a reset, a fault.
    pub(super) fn check(&self, session: &mut Session<Line>) -> Result<(), Trouble> {
        for &motor in &self.motors {
            if !session.enabled(motor)? {
                let words = session.status(false)?.words().join(", ");
                let says = format!("the hub has let motor {motor} go; its status: {words}");
                return Err(Failure::Work(says).into());
            }
        }
        Ok(())
    }
}

/// Says which of these motors, by number and speed in counts per second, no voltage there is can make as fast; of hubs
/// that tell what they know of their motors.
pub(super) fn warn_of(session: &mut Session<Line>, speeds: &[(u8, u32)]) -> Result<(), Error> {
    let battery = session.battery()?;
    // Of a battery that the hub does not know nothing follows.
    if battery == Millivolts::default() {
        return Ok(());
    }
    for &(motor, wanted) in speeds {
        let setup = match session.setup(motor) {
            Ok(setup) => setup,
            Err(Error::Refused { .. } | Error::TooOld { .. }) => return Ok(()),
            Err(error) => return Err(error),
        };
        let free = free_speed(setup.emf, battery);
        if f64::from(wanted) > free {
            let volts = f64::from(battery.get()) / 1e3;
            say(&format!(
                "warning: motor {motor} turns at {free:.0} counts/s at most with {volts:.1} V, by what the hub \
                 knows of it; {wanted} are asked for"
            ));
        }
    }
    Ok(())
}

/// The speed at which back EMF is all of the voltage, in counts per second.
fn free_speed(emf: EmfConstant, battery: Millivolts) -> f64 {
    f64::from(battery.get()) * f64::from(1 << 20) / f64::from(emf.to_bits())
}

/// In a row, and no faster than this, so that a motor that rushes through its target is not taken for one
/// that is there: two counts in the hub's control period.
const STANDING_TIME: Duration = Duration::from_millis(90);
const STANDING_CPS: u16 = 40;

/// A motor is at its velocity if its mean over this time is within a twentieth of it, or within two counts in the
/// hub's control period.
const VELOCITY_TIME: Duration = Duration::from_millis(500);
const VELOCITY_SHARE: f64 = 0.05;
const VELOCITY_CPS: f64 = 40.0;

/// How far motors are.
pub(super) struct Progress {
    course: Course,
    motors: Vec<u8>,
    /// Since when all motors stand at their target.
    standing: Option<Duration>,
    velocities: VecDeque<(Duration, [i16; 4])>,
}

impl Progress {
    pub(super) fn new(order: &Order) -> Self {
        let Order { course, ref motors, .. } = *order;
        Self { course, motors: motors.clone(), standing: None, velocities: VecDeque::new() }
    }

    /// Takes what the hub says at a time since the start; true once all motors have arrived at a position.
    pub(super) fn observe(&mut self, at: Duration, bulk: &Bulk) -> bool {
        self.velocities.push_back((at, bulk.velocities));
        while self.velocities.front().is_some_and(|(then, _)| at.saturating_sub(*then) > VELOCITY_TIME) {
            self.velocities.pop_front();
        }
        let stands = matches!(self.course, Course::Position { .. })
            && motors_of(bulk, &self.motors).all(|(_, _, v, at)| at && v.unsigned_abs() <= STANDING_CPS);
        let since = self.standing.unwrap_or(at);
        self.standing = stands.then_some(since);
        stands && at.saturating_sub(since) >= STANDING_TIME
    }

    /// Fails, and says which motors are not where they were told to be or as fast, now that time is over.
    pub(super) fn judge(&self, length: Option<Duration>) -> Result<(), Failure> {
        let seconds = length.unwrap_or_default().as_secs_f64();
        match self.course {
            Course::Power(_) => Ok(()),
            Course::Position { .. } => Err(Failure::Work(format!("not at the target after {seconds} s"))),
            Course::Velocity(wanted) => {
                let missed: Vec<String> =
                    self.motors.iter().filter_map(|m| self.missed(*m, wanted)).collect();
                if missed.is_empty() {
                    return Ok(());
                }
                let missed = missed.join(", ");
                Err(Failure::Work(format!("not at {wanted} counts/s after {seconds} s: {missed}")))
            }
        }
    }

    /// How fast a motor is that is not as fast as it should be.
    fn missed(&self, motor: u8, wanted: i16) -> Option<String> {
        let of_motor = self.velocities.iter().filter_map(|(_, all)| all.get(usize::from(motor)));
        let sum: f64 = of_motor.map(|cps| f64::from(*cps)).sum();
        let mean = sum / self.velocities.len().max(1) as f64;
        let allowed = (VELOCITY_SHARE * f64::from(wanted).abs()).max(VELOCITY_CPS);
        let off = (mean - f64::from(wanted)).abs() > allowed;
        off.then(|| format!("motor {motor} at {mean:.0}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn progress(course: Course, velocities: &[i16]) -> Progress {
        let order = Order { motors: vec![0], course, zero: ZeroPower::Brake, length: None };
        let mut progress = Progress::new(&order);
        for (n, cps) in (0u64..).zip(velocities) {
            let bulk = Bulk { velocities: [*cps, 0, 0, 0], at_target: [true; 4], ..Bulk::default() };
            progress.observe(Duration::from_millis(100 * n), &bulk);
        }
        progress
    }

    #[test]
    fn a_velocity_is_reached_within_a_twentieth_or_two_counts_a_period() {
        for (wanted, is, reached) in
            [(1000, 951, true), (1000, 949, false), (1000, 1051, false), (100, 60, true), (100, 59, false)]
        {
            let judged = progress(Course::Velocity(wanted), &[is; 9]).judge(None).is_ok();
            assert_eq!(judged, reached, "{wanted} {is}");
        }
        // The way there does not count.
        assert!(progress(Course::Velocity(500), &[0, 200, 500, 500, 500, 500, 500, 500]).judge(None).is_ok());
    }

    #[test]
    fn a_motor_that_rushes_through_its_target_has_not_arrived() {
        let position = Course::Position { counts: 0, tolerance: 5, speed: 1000 };
        let bulk = |cps| Bulk { velocities: [cps, 0, 0, 0], at_target: [true; 4], ..Bulk::default() };
        let mut progress = progress(position, &[]);
        let at = |n: u64| Duration::from_millis(50 * n);
        assert!(!progress.observe(at(0), &bulk(900)));
        assert!(!progress.observe(at(1), &bulk(20)));
        assert!(!progress.observe(at(2), &bulk(0)));
        assert!(progress.observe(at(3), &bulk(0)));
    }
}
