//! Decides whether some regulator can settle a response, by the time that the motion takes with the battery's full
//! voltage.

use super::responses::Kind;
use crate::StudyError;
use crate::settling::{Change, Goal, changes, rest_s};
use motor_hub::braking::{Modulator, OperatingPoint};
use motor_hub::bridge::Drive;
use motor_hub::model::load::Shaft;
use motor_hub::units::{Control, CountsPerSecond, EmfConstant, Millivolts};
use simulated::hardware::{BRIDGE, winding};
use simulated::scenario::{Motor, Scenario};

/// Usable share of the battery's voltage with all motors stalled.
const COUNTED_ON: f64 = 0.95;
/// Share of the usable voltage that must be left at the set-point.
const RESERVE: f64 = 0.1;
/// Largest difference between the needed voltage and the voltage of the nearest control value, as a share of the
/// battery's voltage.
const GAP: f64 = 0.02;
/// Factor by which the granted time exceeds the ideal time.
const PATIENCE: f64 = 1.5;
/// Time in seconds that is granted in addition.
const GRACE_S: f64 = 0.3;
/// Number of control periods that are granted in addition.
const GRACE_PERIODS: f64 = 6.0;
/// Number of counts whose time, at the speed of the set-point, is granted in addition.
const GRACE_COUNTS: f64 = 3.0;
/// Time in seconds for which a new torque acts before a regulator can detect it. A control period is added to this
/// time.
const SURPRISE_S: f64 = 0.05;
/// Step of the integration in seconds.
const STEP: f64 = 1e-3;
/// Longest change of speed that is integrated, in seconds.
const LONGEST: f64 = 60.0;

/// A motor with its load at its scenario's battery, in the encoder's units.
struct Machine {
    modulator: Modulator,
    emf: EmfConstant,
    battery: Millivolts,
    /// Acceleration per volt, in counts/s² per volt.
    b: f64,
    /// Back EMF per speed, in volts per count/s.
    kappa: f64,
    /// Drag divided by inertia, in 1/s.
    drag: f64,
    /// Acceleration per torque on the output shaft, in counts/s² per newton metre.
    per_torque: f64,
    /// Dry friction of a moving motor, in counts/s².
    friction: f64,
    /// Breakaway friction of a standing motor, in counts/s².
    breakaway: f64,
}

impl Machine {
    fn new(scenario: &Scenario, motor: &Motor) -> Result<Self, StudyError> {
        let constants = &motor.constants;
        let winding = winding(constants)?;
        let shaft = Shaft::new(constants, &motor.load);
        let counts = constants.counts_per_rev_motor / core::f64::consts::TAU;
        let ohms = constants.r.0 + 2e-3 * f64::from(BRIDGE.switch_mohm());
        let emf_v =
            scenario.emf_over_time.iter().map(|timed| timed.value).fold(scenario.battery.emf.0, f64::min);
        let drawn: f64 = scenario.motors.iter().map(|motor| emf_v / motor.constants.r.0).sum();
        let volts = COUNTED_ON * (emf_v - scenario.battery.resistance.0 * drawn);
        Ok(Self {
            modulator: Modulator::new(&winding, &BRIDGE, motor.scheme, motor.duty),
            emf: winding.emf,
            battery: Millivolts::from_volts(volts)?,
            b: constants.kt.0 * counts / (ohms * shaft.inertia.0),
            kappa: constants.ke.0 / counts,
            drag: shaft.drag.0 / shaft.inertia.0,
            per_torque: counts * shaft.torque_ratio / shaft.inertia.0,
            friction: counts * constants.friction.coulomb.0 / shaft.inertia.0,
            breakaway: counts * constants.friction.breakaway.0 / shaft.inertia.0,
        })
    }

    /// The voltage of a control value at a speed; `None` if the bridge is open.
    fn volts(&self, speed: f64, control: Control) -> Option<f64> {
        let speed = CountsPerSecond::saturating_from_bits((256.0 * speed) as i64);
        let at = OperatingPoint::new(self.emf.emf(speed), self.battery)?;
        let placement = self.modulator.for_control(at, control);
        (placement.drive != Drive::COAST).then(|| f64::from(placement.voltage.to_volts()))
    }

    /// The lowest and the highest voltage of all control values at a speed.
    fn range(&self, speed: f64) -> Option<(f64, f64)> {
        Some((self.volts(speed, Control::MIN)?, self.volts(speed, Control::MAX)?))
    }

    fn acceleration(&self, speed: f64, volts: f64, torque: f64) -> f64 {
        let free = self.b * (volts - self.kappa * speed) - self.drag * speed + self.per_torque * torque;
        if speed != 0.0 {
            free - self.friction * speed.signum()
        } else if free.abs() > self.breakaway {
            free - self.friction * free.signum()
        } else {
            0.0
        }
    }

    /// The largest deceleration and the largest acceleration, both signed, in counts/s².
    fn strength(&self, speed: f64, torque: f64) -> Option<(f64, f64)> {
        let (low, high) = self.range(speed)?;
        Some((self.acceleration(speed, low, torque), self.acceleration(speed, high, torque)))
    }

    /// True if the speed can be kept under this torque with [`RESERVE`] of the voltage left.
    fn keeps(&self, speed: f64, torque: f64) -> bool {
        let Some((low, high)) = self.range(speed) else { return false };
        let battery = f64::from(self.battery.get()) / 1e3;
        // Friction helps a motor to stand.
        let friction = if speed == 0.0 { 0.0 } else { self.friction * speed.signum() };
        let needed = self.kappa * speed + (self.drag * speed + friction - self.per_torque * torque) / self.b;
        let reserve = RESERVE * battery;
        // Without a braking regime some voltages have no control value.
        let near = |volts: f64| (volts - needed).abs() < GAP * battery;
        let given = || {
            (i16::MIN..=i16::MAX).step_by(64).any(|c| self.volts(speed, Control::new(c)).is_some_and(near))
        };
        low + reserve <= needed && needed <= high - reserve && given()
    }

    /// Time in seconds of the fastest change from one speed to another, and the counts that the motor turns meanwhile.
    /// `None` if the motor does not reach the speed.
    fn run_up(&self, from: f64, to: f64, torque: f64) -> Option<(f64, f64)> {
        let (mut speed, mut counts, up) = (from, 0.0, to > from);
        let mut steps = 0.0;
        while if up { speed < to } else { speed > to } {
            let (down, rise) = self.strength(speed, torque)?;
            let rate = if up { rise.max(0.0) } else { down.min(0.0) };
            if rate == 0.0 || steps * STEP > LONGEST {
                return None;
            }
            counts += speed * STEP;
            speed += rate * STEP;
            steps += 1.0;
        }
        Some((steps * STEP, counts))
    }

    /// Time in seconds of a motion from standstill to standstill, with the fastest speed at every position. `None` if
    /// the motor cannot do the motion.
    fn travel(&self, counts: f64, limit: f64, torque: f64) -> Option<f64> {
        const PLACES: usize = 400;
        let (side, way) = (counts.signum(), counts.abs());
        let step = way / PLACES as f64;
        let mut fastest = vec![limit; PLACES + 1];
        let mut pass = |backwards: bool| -> Option<()> {
            let mut square = 0.0f64;
            for index in 0..=PLACES {
                let place = fastest.get_mut(if backwards { PLACES - index } else { index })?;
                *place = place.min(square.sqrt());
                let (down, up) = self.strength(side * *place, torque)?;
                // The forward pass limits the speeds by the acceleration from the start. The backward pass limits them
                // by the deceleration to the target.
                let rate = match (backwards, side > 0.0) {
                    (false, true) => up,
                    (false, false) => -down,
                    (true, true) => -down,
                    (true, false) => up,
                };
                square = (*place * *place + 2.0 * rate * step).max(0.0);
                if square == 0.0 {
                    return None;
                }
            }
            Some(())
        };
        pass(false)?;
        pass(true)?;
        Some(fastest.windows(2).map(|pair| 2.0 * step / pair.iter().sum::<f64>()).sum())
    }
}

/// The state of a motor before a change, as predicted.
struct State {
    /// Speed in counts/s.
    speed: f64,
    /// Position in counts.
    counts: f64,
    /// Largest error of `counts`, in counts.
    slack: f64,
}

/// The changes of a motor in a scenario, by time, that some regulator can settle before the next change.
///
/// The ideal time is the time with full voltage within the scheme's range, in one direction and then in the other. The
/// voltage is 95 % of the battery's voltage with all motors stalled. The granted time is 1.5 times the ideal time plus
/// 0.3 s, six control periods and the time of three counts. After the granted time the motor must still have the time
/// for which it must stay settled. Some control value must also keep the speed, or standstill at a position, under the
/// torque with a tenth of the voltage left. After a change that cannot be settled the state of the motor is not
/// known, so the motor's further changes are not judged.
pub(super) fn settleable(scenario: &Scenario, motor: &Motor) -> Result<Vec<Change>, StudyError> {
    let period_s = f64::from(scenario.period.as_millis()) / 1e3;
    let machine = Machine::new(scenario, motor)?;
    let mut at = State { speed: 0.0, counts: 0.0, slack: 0.0 };
    let mut settleable = Vec::new();
    for change in changes(motor, scenario.duration_s) {
        let Some(after) = machine.answer(&change, &at, period_s) else { break };
        settleable.push(change);
        at = after;
    }
    Ok(settleable)
}

impl Machine {
    /// The motor's state after a change that can be settled.
    fn answer(&self, change: &Change, at: &State, period: f64) -> Option<State> {
        let &Change { goal, torque, old_torque, .. } = change;
        let surprise = if change.kind() == Kind::Load || torque != old_torque {
            self.per_torque * (torque - old_torque) * (period + SURPRISE_S)
        } else {
            0.0
        };
        let from = at.speed + surprise;
        let (ideal, counts, after) = match goal {
            Goal::Velocity(to) => {
                let (ideal, _) = self.run_up(from, to, torque)?;
                let way = to * change.length_s();
                let slack = at.slack + (to - at.speed).abs() * (ideal + period + GRACE_S);
                let counts = if to == 0.0 { 0.0 } else { GRACE_COUNTS / to.abs() };
                (ideal, counts, State { speed: to, counts: at.counts + way, slack })
            }
            Goal::Position { counts, limit_cps, .. } => {
                let (stopping, run) = self.run_up(from, 0.0, torque)?;
                let way = counts - at.counts;
                let way = way + at.slack.copysign(way) + run.abs().copysign(way);
                let travel = if way == 0.0 { 0.0 } else { self.travel(way, limit_cps, torque)? };
                (stopping + travel, 0.0, State { speed: 0.0, counts, slack: 0.0 })
            }
        };
        let granted = PATIENCE * ideal + GRACE_S + GRACE_PERIODS * period + counts;
        let length = change.length_s();
        let enough = granted <= length - rest_s(length);
        (enough && self.keeps(after.speed, torque)).then_some(after)
    }
}
