//! Regulation by the motor's model: the law computes in closed form the voltage that brings the motor to a speed by the
//! next tick.
//!
//! * With a **demanded speed** the law removes most of the speed's error within a tick.
//! * With a **demanded position** the speed follows a profile. The deceleration of the profile is less than battery
//!   and load allow, so that the motor can still brake. Far from the target the speed is proportional to the square
//!   root of the distance, near the target to the distance.
//! * With a **moving reference** the law adds a speed in proportion to the error of the position.
//!
//! The law has no integrator, because the observer estimates the load. So nothing winds up, and a change of mode
//! needs no preset.

use super::observer::{Observer, Plant};
use super::stream::Target;
use super::{Context, Effort, Output, Reference, within};
use crate::units::single::{at_least, at_most};
use crate::units::{CountsPerSecond, Period, Voltage};
use libm::{expf, expm1f, sqrtf};

/// Share of the configured friction that the law reverses when the motion reverses, before the observer has estimated
/// the change.
const FRICTION_SHARE: f32 = 0.8;
/// Lowest speed at the tick's end, in counts/s, for which the law reverses the friction.
const REVERSING_CPS: f32 = 2.0;
/// Deceleration of a profile, as a share of the deceleration that battery and load allow at standstill.
const PLANNED_SHARE: f32 = 0.85;
/// Least deceleration of a profile whatever the load, as a share of the acceleration that the battery gives at
/// standstill.
const LEAST_PLANNED_SHARE: f32 = 0.05;
/// Distance from the middle of the target count, in counts, up to which a held motor stays where it is.
const HELD_COUNTS: f32 = 0.5;
/// Speed per distance beyond [`HELD_COUNTS`] with which a held motor is drawn back, in 1/s.
const HOLDING_RATE: f32 = 2.0;

/// The law of one motor: constants for its plant and its control period, and a state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law {
    /// Share of a speed's error that remains after a tick.
    remaining: f32,
    /// Mean voltage that changes the speed by 1 count/s within a tick: q / (b (1 - exp(-q T))). b and q are constants
    /// of the [`Plant`], and T is the control period.
    volts_per_cps: f32,
    /// Direction of motion, -1 or 1, for which the estimated load includes the friction; 0 if the load includes no
    /// friction, and between these values at standstill.
    friction_side: f32,
    /// Distance to the target in counts at the last tick, if the motor holds its target position; `None` if the motor is
    /// on its way, or has no target position.
    held: Option<i8>,
    /// Estimated load in V at the last tick of a held motor.
    held_load_volts: f32,
}

impl Law {
    /// Prepares the law for a motor whose estimated load includes no friction.
    pub(super) fn new(plant: &Plant, period: Period) -> Self {
        let seconds = period.to_seconds();
        let remaining =
            if period.as_millis() > 20 { expf(-24.0 * seconds).max(0.3) } else { expf(-30.0 * seconds) };
        let x = plant.q * seconds;
        let rate = if x > 1e-3 { plant.q / -expm1f(-x) } else { 1.0 / seconds };
        Self {
            remaining,
            volts_per_cps: rate / plant.b,
            friction_side: 0.0,
            held: None,
            held_load_volts: 0.0,
        }
    }

    /// Replaces the constants. The state stays.
    pub(super) fn set_plant(&mut self, plant: &Plant, period: Period) {
        let Self { friction_side, held, held_load_volts, .. } = *self;
        *self = Self { friction_side, held, held_load_volts, ..Self::new(plant, period) };
    }

    /// Notes that the estimated load includes the friction of a motion at this speed, in counts/s. With the speed 0 the
    /// load includes no friction. The load is then not compared with the load of a motor that was held before.
    pub(super) fn set_friction_speed(&mut self, speed: f32) {
        self.held = None;
        self.friction_side = if speed.abs() > REVERSING_CPS { 1.0f32.copysign(speed) } else { 0.0 };
    }

    /// Computes the output for a target speed.
    pub(super) fn velocity(
        &mut self,
        observer: &mut Observer,
        plant: &Plant,
        target: Target,
        context: &Context<'_>,
    ) -> Output {
        self.held = None;
        // One tick before `target.end` the stream has the speed `target.end - target.change`. The share `remaining` of
        // the present speed's difference from this stream speed remains at the tick's end.
        let next = self.next_speed(observer, target.end) + self.remaining * target.change;
        self.request(observer, plant, next, context, target.demanded)
    }

    /// Computes the output for a target position, `distance` counts from the lower edge of the present count.
    pub(super) fn position(
        &mut self,
        observer: &mut Observer,
        plant: &Plant,
        distance: i32,
        speed_limit: CountsPerSecond,
        context: &Context<'_>,
    ) -> Output {
        let w = observer.speed();
        let window = at_least(context.period.to_seconds(), 0.02);
        let held = self.held.take();
        let near = if held.is_some() { 2 } else { 1 };
        let counts = distance;
        // The target is the middle of the target count.
        let distance = distance as f32 + 0.5 - observer.fraction();
        if counts.unsigned_abs() <= near && (held.is_some() || w.abs() * window < 0.5) {
            let counts = counts as i8;
            if held == Some(counts) {
                self.follow_static_friction(observer.load() / plant.b - self.held_load_volts, context);
            }
            // Without samples the predicted position may leave the count, so the distance is limited.
            let distance = within(distance, near as f32 + HELD_COUNTS);
            let back = HOLDING_RATE * (distance - within(distance, HELD_COUNTS));
            let next = back + self.remaining * (w - back);
            let output = self.request(observer, plant, next, context, 0.0);
            (self.held, self.held_load_volts) = (Some(counts), observer.load() / plant.b);
            return output;
        }
        let reference = Reference { speed_limit, ..Reference::default() };
        self.approach(observer, plant, distance, &reference, context)
    }

    /// Computes the output for a moving reference, `distance` counts from the lower edge of the present count.
    pub(super) fn follow(
        &mut self,
        observer: &mut Observer,
        plant: &Plant,
        distance: f32,
        reference: &Reference,
        context: &Context<'_>,
    ) -> Output {
        self.held = None;
        // The target is the middle of the count.
        let distance = distance + 0.5 - observer.fraction();
        self.approach(observer, plant, distance, reference, context)
    }

    /// Computes the output for a reference at this distance in counts. The speed relative to the reference follows a
    /// profile that ends at the reference.
    fn approach(
        &mut self,
        observer: &mut Observer,
        plant: &Plant,
        distance: f32,
        reference: &Reference,
        context: &Context<'_>,
    ) -> Output {
        let (side, distance) = (1.0f32.copysign(distance), distance.abs());
        let moves = !reference.is_still();
        let full = plant.b * at_most(context.standstill_volts, context.at.battery_volts());
        let deceleration = if moves && context.settings.dynamics.is_none() {
            // A motor that lags at full voltage may have learned a wrong acceleration, and would not catch up.
            f32::INFINITY
        } else {
            // An unknown motor that accelerates less than expected has a load or a large inertia. A load would help to
            // brake, but a motor with a large inertia also brakes less than expected.
            let load = side * observer.load();
            let load = if context.settings.dynamics.is_none() { load.abs() } else { load };
            at_least(PLANNED_SHARE * (full - load), LEAST_PLANNED_SHARE * full)
        };
        let deceleration =
            acceleration_limit(context).map_or(deceleration, |limit| at_most(deceleration, limit));
        let profile = Profile {
            deceleration,
            limit: reference.speed_limit.to_f32().abs(),
            // The error of the speed also changes the distance of this tick. For a position this is neglected.
            remaining: if moves { self.remaining } else { 0.0 },
            period: context.period,
        };
        let w = side * (observer.speed() - reference.speed.to_f32());
        let (now, end) = profile.speeds(distance, w);
        let reference_end = reference.next.to_f32();
        let next = reference_end + side * (end - self.remaining * (now - w));
        self.request(observer, plant, next, context, reference_end + side * now)
    }

    /// Computes the output that brings the motor to the speed `next` by the tick's end, within the limits of
    /// acceleration and voltage. `speed` becomes the speed of the output. Both are in counts/s.
    fn request(
        &mut self,
        observer: &mut Observer,
        plant: &Plant,
        next: f32,
        context: &Context<'_>,
        speed: f32,
    ) -> Output {
        let w = observer.speed();
        let next = match acceleration_limit(context) {
            Some(limit) => w + within(next - w, limit * context.period.to_seconds()),
            None => next,
        };
        self.reverse_friction(observer, plant, next, context);
        let wanted = self.requested_volts(observer, plant, next, context);
        // In overrun the back EMF is above the battery voltage. At a motor voltage between battery voltage and back EMF
        // the motor brakes less than at the battery voltage.
        let most = at_least(context.at.battery_volts(), (plant.kappa * w).abs());
        let voltage = Voltage::from_volts(within(wanted, most));
        Output { effort: Effort::Voltage(voltage), speed: super::speed(speed), hunts: false }
    }

    /// Reverses the friction in the estimated load if the motion reverses by the tick's end. Friction always acts
    /// against the motion.
    fn reverse_friction(&mut self, observer: &mut Observer, plant: &Plant, next: f32, context: &Context<'_>) {
        let side = 1.0f32.copysign(next);
        // More than one count per tick in the old direction: the motion does not reverse within this tick.
        let still_opposite = -side * observer.speed() * context.period.to_seconds() > 1.0;
        if side != self.friction_side && next.abs() > REVERSING_CPS && !still_opposite {
            observer.add_load(friction_volts(context) * plant.b * (self.friction_side - side));
            self.friction_side = side;
        }
    }

    /// Follows the friction of a held motor that stands. The friction then balances every change of the voltage, so a
    /// change of the estimated load, in V, is a change of the friction. Without this, the friction of a motor that breaks
    /// away would count twice.
    fn follow_static_friction(&mut self, load_change_volts: f32, context: &Context<'_>) {
        let friction = friction_volts(context);
        if friction > 0.0 {
            self.friction_side = within(self.friction_side - load_change_volts / friction, 1.0);
        }
    }

    /// Voltage in V at the beginning of a tick that brings the motor to the speed `next` by the tick's end.
    ///
    /// Up to the boundary of discontinuous current, the result is the voltage by the equation of a discontinuous
    /// current. Beyond the boundary the result moves towards the voltage by the equation of a continuous current, by at
    /// most the excess over the boundary. So the result has no step at the boundary.
    fn requested_volts(&self, observer: &Observer, plant: &Plant, next: f32, context: &Context<'_>) -> f32 {
        let continuous = self.voltage_to(observer, plant, next);
        if !plant.distinguishes_currents {
            return continuous;
        }
        let Context { period, at, modulator, .. } = *context;
        let change = next - observer.speed();
        let load_volts = (plant.drag * change - observer.external_acceleration(plant)) / plant.b;
        let emf_change = plant.kappa * change;
        // Length of the tick in mechanical time constants of the motor.
        let n = plant.b * plant.kappa * period.to_seconds();
        let Some((beyond_emf, boundary)) = modulator.discontinuous_to(at, emf_change, load_volts, n) else {
            return continuous;
        };
        let discontinuous = plant.kappa * observer.speed() + beyond_emf;
        let beyond_boundary = at_least(beyond_emf.abs() - boundary, 0.0);
        discontinuous + within(continuous - discontinuous, beyond_boundary)
    }

    /// Mean voltage in V that brings the motor to the speed `next` by the tick's end with a continuous current.
    fn voltage_to(&self, observer: &Observer, plant: &Plant, next: f32) -> f32 {
        let w = observer.speed();
        plant.kappa * w + (next - w) * self.volts_per_cps - observer.external_acceleration(plant) / plant.b
    }

    /// Mean voltage in V that brings the motor closer to a target speed by the tick's end, as
    /// [`velocity`](Self::velocity) does, but without limits.
    pub(super) fn voltage_for_speed(&self, observer: &Observer, plant: &Plant, target: f32) -> f32 {
        self.voltage_to(observer, plant, self.next_speed(observer, target))
    }

    /// Part of the voltage that corrects the error of a demanded speed, in V.
    pub(super) fn correction_volts(&self, observer: &Observer, target: f32) -> f32 {
        (self.next_speed(observer, target) - observer.speed()) * self.volts_per_cps
    }

    /// Speed at the tick's end on the way to a target speed, in counts/s.
    fn next_speed(&self, observer: &Observer, target: f32) -> f32 {
        let w = observer.speed();
        w + (1.0 - self.remaining) * (target - w)
    }
}

/// The friction that the law expects, as the voltage that balances it, in V; 0 for an unknown motor.
fn friction_volts(context: &Context<'_>) -> f32 {
    context.settings.dynamics.map_or(0.0, |dynamics| FRICTION_SHARE * dynamics.friction.to_volts())
}

/// Largest acceleration in counts/s²; `None` for no limit.
fn acceleration_limit(context: &Context<'_>) -> Option<f32> {
    context.settings.acceleration.map(|limit| limit.get() as f32)
}

/// Speed per distance near a target position, in 1/s.
fn approach(period: Period) -> f32 {
    (0.75 / period.to_seconds()).min(12.0)
}

/// The speed of a motor over its distance to a target: proportional to the distance near the target, and farther away the
/// speed from which the motor can brake.
struct Profile {
    /// Deceleration in counts/s².
    deceleration: f32,
    /// Largest speed in counts/s.
    limit: f32,
    /// Share of the speed's error that remains after a tick, for the distance of this tick; 0 to neglect the error.
    remaining: f32,
    period: Period,
}

impl Profile {
    /// Speeds at this distance from the target, in counts/s. The first speed is the speed now. The second speed is the
    /// speed at the tick's end of a motor that now has the speed `w` towards the target.
    fn speeds(&self, distance: f32, w: f32) -> (f32, f32) {
        let Self { deceleration, limit, remaining, period } = *self;
        let (period_s, approach) = (period.to_seconds(), approach(period));
        let knee = deceleration / (approach * approach);
        let now = if distance < knee {
            approach * distance
        } else {
            sqrtf(2.0 * deceleration * (distance - knee / 2.0))
        };
        let now = at_most(now, limit);
        // The distance of a tick is half a tick at the speed now, and half a tick at the speed at the tick's end.
        let rest = distance - (w - remaining * (now - w)) * period_s / 2.0;
        let linear = approach * rest / (1.0 + approach * period_s / 2.0);
        let lost = deceleration * period_s / 2.0;
        let end = if rest - linear * period_s / 2.0 < knee {
            linear
        } else {
            sqrtf(lost * lost + 2.0 * deceleration * (rest - knee / 2.0)) - lost
        };
        (now, within(end, limit))
    }
}
