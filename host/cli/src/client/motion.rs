//! Motions of `power`, `current`, `velocity` and `position`, and whether motors reach their set-points. Also detects
//! motions to positions, alone or in a group, that make no progress.

use super::motors_off::DrivingSession;
use super::readings::motors_of;
use crate::output::{Failure, print_error_line};
use motor_hub::extension::report::HubReport;
use motor_hub::motor::{SettleDetector, ZeroPower};
use motor_hub::protocol::CHANNELS;
use motor_hub::protocol::answers::Bulk;
use motor_hub::units::{CountsPerSecond, Millivolts, Period};
use motor_hub_client::error::none_if_unsupported;
use motor_hub_client::motor::{NO_CURRENT, Setpoint};
use motor_hub_client::reasons::why_still;
use motor_hub_client::{Error, Session};
use std::collections::VecDeque;
use std::time::Duration;

/// Motors with their common set-point.
pub(super) struct Motion {
    pub(super) motors: Vec<u8>,
    pub(super) setpoint: Setpoint,
    /// What the motors do at power 0 or velocity 0.
    pub(super) zero: ZeroPower,
    /// Duration of the motion; `None` for no limit.
    pub(super) length: Option<Duration>,
    /// Encoder counts in a turn of the output shaft; `None` if the options do not give them.
    pub(super) counts_per_turn: Option<f64>,
}

impl Motion {
    /// Sets mode and set-point of all motors, then enables them. A constant current is set again once the motors are
    /// enabled.
    pub(super) fn begin(&self, driven: &mut DrivingSession<'_>) -> Result<(), Failure> {
        if matches!(self.setpoint, Setpoint::Current { .. }) && driven.report()?.is_none() {
            return Err(Failure::work(NO_CURRENT));
        }
        if let Setpoint::Velocity(cps) = self.setpoint {
            let speed = cps.unsigned_abs().into();
            let speeds: Vec<_> = self.motors.iter().map(|motor| (*motor, speed)).collect();
            warn_of(driven, &speeds)?;
        }
        for &motor in &self.motors {
            driven.set_setpoint(motor, self.setpoint, self.zero)?;
        }
        for &motor in &self.motors {
            driven.enable(motor)?;
        }
        if let Setpoint::Current { .. } = self.setpoint {
            for &motor in &self.motors {
                driven.set_setpoint(motor, self.setpoint, self.zero)?;
            }
        }
        Ok(())
    }

    pub(super) fn check(&self, session: &mut Session) -> Result<(), Failure> {
        self.motors.iter().try_for_each(|motor| check_enabled(session, *motor))
    }
}

/// Fails if the hub has disabled a motor: after a fail-safe, a reset or a fault.
pub(super) fn check_enabled(session: &mut Session, motor: u8) -> Result<(), Failure> {
    if session.enabled(motor)? {
        return Ok(());
    }
    let words = session.status(false)?.words().join(", ");
    Err(Failure::Work(format!("the hub has disabled motor {motor}; hub status: {words}")))
}

/// Returns the end of an error message: why each motor does not turn, such as `; motor 1: stalled: the motor is driven and
/// does not turn`. Motors without a known reason are left out.
pub(super) fn reasons(report: Option<&HubReport>, motors: &[u8]) -> String {
    let reason = |motor: &u8| Some(format!("; motor {motor}: {}", why_still(report?, usize::from(*motor))?));
    motors.iter().filter_map(reason).collect()
}

/// Warns of motors whose requested speed exceeds their free speed at the present battery voltage. `speeds` are pairs of
/// motor and speed in counts per second. Hubs that do not report their motors' constants give no warning.
pub(super) fn warn_of(session: &mut Session, speeds: &[(u8, u32)]) -> Result<(), Error> {
    let battery = session.battery()?;
    // The free speed is unknown while the battery voltage is unknown.
    if battery == Millivolts::default() {
        return Ok(());
    }
    for &(motor, wanted) in speeds {
        let Some(settings) = none_if_unsupported(session.settings(motor))? else { return Ok(()) };
        // At the free speed the back EMF equals the battery voltage.
        let free = f64::from(battery.get()) / settings.motor.winding.emf.to_millivolt_seconds();
        if f64::from(wanted) > free {
            let volts = f64::from(battery.get()) / 1e3;
            print_error_line(&format!(
                "warning: motor {motor}: {wanted} counts/s requested, but its free speed at {volts:.1} V is {free:.0} \
                 counts/s by its configured constants"
            ));
        }
    }
    Ok(())
}

/// Longest time without progress in a motion to positions. Motors that pause on their way, for example because of
/// static friction, go on within this time. Chosen.
const LONGEST_STANDSTILL: Duration = Duration::from_secs(5);

/// A motion may pause longer than [`LONGEST_STANDSTILL`] by the time in which its fastest motor covers this distance,
/// in counts. The distance is the smallest usual lag of a group: the reference of a motor with friction may run ahead
/// by this distance before the motor turns.
const SLOWEST_START_COUNTS: f64 = 24.0;

/// Detects that a motion to positions makes no progress. A motor makes progress when it goes beyond all positions that
/// it has had since the start. So a motor that oscillates about a position makes no progress.
pub(super) struct StandstillDetector {
    /// Target of each motor of the motion, in counts.
    targets: [Option<i32>; CHANNELS],
    /// Longest time without progress.
    limit: Duration,
    /// Positions of all motors at the start; `None` before the first reading.
    start: Option<[i32; CHANNELS]>,
    /// Least and largest distance of each motor from its start, in counts.
    extents: [(i32, i32); CHANNELS],
    /// Time of the last progress since the start.
    progress_at: Duration,
}

impl StandstillDetector {
    /// `speed_cps` is the speed of the fastest motor in counts per second.
    pub(super) fn new(targets: [Option<i32>; CHANNELS], speed_cps: f64) -> Self {
        let start = Duration::try_from_secs_f64(SLOWEST_START_COUNTS / speed_cps).unwrap_or(Duration::MAX);
        let limit = LONGEST_STANDSTILL.saturating_add(start);
        Self { targets, limit, start: None, extents: [(0, 0); CHANNELS], progress_at: Duration::ZERO }
    }

    /// Takes the encoder positions of all motors. `at` is the time of the reading since the start. Returns true if the
    /// motion has made no progress for too long.
    pub(super) fn step(&mut self, at: Duration, positions: [i32; CHANNELS]) -> bool {
        let start = *self.start.get_or_insert(positions);
        let moved = positions.into_iter().zip(start).map(|(position, start)| position.wrapping_sub(start));
        for ((moved, (least, most)), target) in moved.zip(&mut self.extents).zip(self.targets) {
            if target.is_some() && !(*least..=*most).contains(&moved) {
                self.progress_at = at;
            }
            (*least, *most) = (moved.min(*least), moved.max(*most));
        }
        at.saturating_sub(self.progress_at) > self.limit
    }

    /// Returns the failure of a motion without progress. The failure names the motors that are not within the tolerance
    /// of their targets, and the reasons why motors do not turn. `positions` are the present positions, counted from
    /// the same zero as the targets.
    pub(super) fn failure(
        &self,
        positions: [i32; CHANNELS],
        tolerance: u16,
        report: Option<&HubReport>,
    ) -> Failure {
        let mut motors = String::new();
        for ((motor, position), target) in positions.into_iter().enumerate().zip(self.targets) {
            let missed = |target: &i32| target.wrapping_sub(position).unsigned_abs() > u32::from(tolerance);
            if let Some(target) = target.filter(missed) {
                let why = report.and_then(|report| why_still(report, motor));
                let why = why.map_or(String::new(), |why| format!(" ({why})"));
                motors += &format!("; motor {motor} stands at {position} counts instead of {target}{why}");
            }
        }
        if motors.is_empty() {
            motors = "; the motors are within tolerance of their targets, but have not settled".to_owned();
        }
        Failure::Work(format!("no progress for {:.0} s{motors}", self.limit.as_secs_f64()))
    }
}

/// Longest control period of a hub, in milliseconds.
const LONGEST_PERIOD_MS: u32 = 100;

/// Time over which the speed of a motor is averaged to decide whether the requested speed is reached.
const VELOCITY_TIME: Duration = Duration::from_millis(500);
/// Allowed error of the mean speed, as a share of the requested speed.
const VELOCITY_SHARE: f64 = 0.05;
/// Smallest allowed error of the mean speed in counts per second: two counts in a control period of 50 ms.
const VELOCITY_CPS: f64 = 40.0;

/// Progress of motors towards their set-point.
pub(super) struct Progress<'a> {
    motion: &'a Motion,
    /// Decides whether the motors have settled. It is used for hubs that send no reports.
    settle_detector: SettleDetector,
    /// Time between two readings.
    interval: Period,
    velocities: VecDeque<(Duration, [i16; 4])>,
    standstill_detector: StandstillDetector,
    /// Last report of the hub.
    report: Option<HubReport>,
}

impl<'a> Progress<'a> {
    /// `interval` is the time between two readings.
    pub(super) fn new(motion: &'a Motion, interval: Duration) -> Self {
        let millis = u32::try_from(interval.as_millis()).unwrap_or(u32::MAX);
        let interval = Period::from_millis(millis.clamp(1, LONGEST_PERIOD_MS)).unwrap_or_default();
        let (target, speed) = match motion.setpoint {
            Setpoint::Position { counts, speed_limit, .. } => (Some(counts), speed_limit.into()),
            _ => (None, f64::INFINITY),
        };
        let takes_part = |motor: usize| motion.motors.iter().any(|other| usize::from(*other) == motor);
        let targets = std::array::from_fn(|motor| target.filter(|_| takes_part(motor)));
        Self {
            motion,
            settle_detector: SettleDetector::default(),
            interval,
            velocities: VecDeque::new(),
            standstill_detector: StandstillDetector::new(targets, speed),
            report: None,
        }
    }

    /// Takes a reading. `at` is the time of the reading since the start. Returns true once all motors have settled at a
    /// position. `report` is `None` if the hub sends no reports.
    ///
    /// # Errors
    /// The motors make no progress towards their position.
    pub(super) fn observe(
        &mut self,
        at: Duration,
        bulk: &Bulk,
        report: Option<&HubReport>,
    ) -> Result<bool, Failure> {
        self.report = report.cloned();
        self.velocities.push_back((at, bulk.velocities));
        while self.velocities.front().is_some_and(|(then, _)| at.saturating_sub(*then) > VELOCITY_TIME) {
            self.velocities.pop_front();
        }
        let Setpoint::Position { tolerance, .. } = self.motion.setpoint else { return Ok(false) };
        if self.have_settled(bulk, report) {
            return Ok(true);
        }
        if self.standstill_detector.step(at, bulk.encoders) {
            return Err(self.standstill_detector.failure(bulk.encoders, tolerance, report));
        }
        Ok(false)
    }

    /// True once all motors have settled at their position.
    fn have_settled(&mut self, bulk: &Bulk, report: Option<&HubReport>) -> bool {
        let motors = &self.motion.motors;
        if let Some(report) = report {
            let settled = |motor: &u8| report.motors.get(usize::from(*motor)).is_some_and(|of| of.settled);
            return motors.iter().all(settled);
        }
        let within_tolerance = motors_of(bulk, motors).all(|reading| reading.within_tolerance);
        let fastest = motors_of(bulk, motors).map(|reading| i32::from(reading.velocity).abs()).max();
        let fastest = CountsPerSecond::new(fastest.unwrap_or_default());
        self.settle_detector.step(within_tolerance, fastest, self.interval)
    }

    /// Fails if the motors have not reached the set-point when the time is over. The error names the motors that missed
    /// a velocity, and the reasons of motors that do not turn.
    pub(super) fn judge(&self) -> Result<(), Failure> {
        let Motion { motors, setpoint, length, .. } = self.motion;
        let seconds = length.unwrap_or_default().as_secs_f64();
        match *setpoint {
            Setpoint::Power(_) | Setpoint::Current { .. } => Ok(()),
            Setpoint::Position { .. } => {
                let settled =
                    |motor: &u8| self.report.as_ref()?.motors.get(usize::from(*motor)).map(|of| of.settled);
                let missed: Vec<u8> = motors.iter().copied().filter(|m| settled(m) != Some(true)).collect();
                let why = reasons(self.report.as_ref(), &missed);
                Err(Failure::Work(format!("target not reached after {seconds} s{why}")))
            }
            Setpoint::Velocity(wanted) => {
                let missed: Vec<String> = motors.iter().filter_map(|m| self.missed(*m, wanted)).collect();
                if missed.is_empty() {
                    return Ok(());
                }
                let missed = missed.join(", ");
                let why = reasons(self.report.as_ref(), motors);
                Err(Failure::Work(format!("{wanted} counts/s not reached after {seconds} s: {missed}{why}")))
            }
        }
    }

    /// Returns a text with a motor's mean speed in counts per second if the motor has missed the requested speed.
    fn missed(&self, motor: u8, wanted: i16) -> Option<String> {
        let of_motor = self.velocities.iter().filter_map(|(_, all)| all.get(usize::from(motor)));
        let sum: f64 = of_motor.map(|cps| f64::from(*cps)).sum();
        let mean = sum / self.velocities.len().max(1) as f64;
        let allowed = (VELOCITY_SHARE * f64::from(wanted).abs()).max(VELOCITY_CPS);
        let off = (mean - f64::from(wanted)).abs() > allowed;
        off.then(|| format!("motor {motor} at {mean:.0} counts/s"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motor_hub::extension::report::MotorReport;

    /// A position that motors settle at.
    const POSITION: Setpoint = Setpoint::Position { counts: 0, tolerance: 5, speed_limit: 1000 };

    /// A motion of motor 0.
    fn motion(setpoint: Setpoint) -> Motion {
        Motion { motors: vec![0], setpoint, zero: ZeroPower::Brake, length: None, counts_per_turn: None }
    }

    fn progress(motion: &Motion) -> Progress<'_> {
        Progress::new(motion, Duration::from_millis(50))
    }

    fn bulk(cps: i16) -> Bulk {
        Bulk { velocities: [cps, 0, 0, 0], within_tolerance: [true; 4], ..Bulk::default() }
    }

    #[test]
    fn a_velocity_is_reached_within_a_twentieth_or_two_counts_a_period() {
        // The readings of an acceleration are older than 0.5 s and do not count.
        let accelerates = [0, 200, 500, 500, 500, 500, 500, 500];
        for (wanted, velocities, reached) in [
            (1000, &[951; 9][..], true),
            (1000, &[949; 9], false),
            (1000, &[1051; 9], false),
            (100, &[60; 9], true),
            (100, &[59; 9], false),
            (500, &accelerates, true),
        ] {
            let motion = motion(Setpoint::Velocity(wanted));
            let mut progress = progress(&motion);
            for (n, cps) in (0..).zip(velocities) {
                progress.observe(Duration::from_millis(100 * n), &bulk(*cps), None).unwrap();
            }
            assert_eq!(progress.judge().is_ok(), reached, "{wanted} {velocities:?}");
        }
    }

    #[test]
    fn a_motor_that_rushes_through_its_target_has_not_settled() {
        let motion = motion(POSITION);
        let mut progress = progress(&motion);
        let at = |n: u64| Duration::from_millis(50 * n);
        assert!(!progress.observe(at(0), &bulk(900), None).unwrap());
        assert!(!progress.observe(at(1), &bulk(20), None).unwrap());
        assert!(progress.observe(at(2), &bulk(0), None).unwrap());
    }

    #[test]
    fn a_hub_that_reports_says_itself_whether_a_motor_has_settled() {
        let motion = motion(POSITION);
        let mut progress = progress(&motion);
        let report = |settled| HubReport {
            motors: [MotorReport { settled, ..MotorReport::default() }].into_iter().collect(),
            ..HubReport::default()
        };
        for _ in 0..10 {
            assert!(!progress.observe(Duration::ZERO, &bulk(0), Some(&report(false))).unwrap());
        }
        assert!(progress.observe(Duration::ZERO, &bulk(0), Some(&report(true))).unwrap());
    }

    #[test]
    fn a_motion_ends_when_no_motor_gets_to_a_new_position_for_five_seconds() {
        let targets = [Some(0), Some(900), None, None];
        // Motor 0 rocks at its target, motor 1 stops after 3 s, and motor 2 does not take part.
        let positions = |s: i32| [s % 2, 100 * s.min(3), 7 * s, 0];
        let mut detector = StandstillDetector::new(targets, 1000.0);
        for s in 0..=9 {
            assert_eq!(detector.step(Duration::from_secs(s as u64), positions(s)), s == 9, "{s} s");
        }
        let failure = detector.failure(positions(9), 5, None).to_string();
        assert_eq!(failure, "no progress for 5 s; motor 1 stands at 300 counts instead of 900");
        let failure = detector.failure([1, 896, 0, 0], 5, None).to_string();
        assert!(failure.ends_with("within tolerance of their targets, but have not settled"), "{failure}");
        // A motion at 1 count/s may take 24 s longer to begin.
        let mut slow = StandstillDetector::new(targets, 1.0);
        assert_eq!(
            [0, 28, 30].map(|s| slow.step(Duration::from_secs(s), [0; CHANNELS])),
            [false, false, true]
        );
    }
}
