//! Regulation of a motor that is known: the voltage that brings it to the speed it should have at the next
//! tick, in closed form, and speeds on the way to a position that it can still brake from.
//!
//! No integrator: what a load takes is observed, so nothing winds up, and nothing must be preset when the
//! mode changes.

use super::observer::{Observer, Plant};
use super::{Effort, Output, Stage, within};
use crate::units::single::{at_least, at_most};
use crate::units::{Acceleration, Period, Voltage};
use libm::{expf, expm1f, sqrtf};

/// Of the friction that turns round with the motion, so much is taken for granted.
const FRICTION_SHARE: f32 = 0.8;
/// Slower than this, in counts/s, a motor is not asked to turn round.
const TURNING: f32 = 2.0;
/// Of the acceleration that the battery could give at standstill, so much is planned with,
const PLANNED: f32 = 0.85;
/// and so much at least, whatever the load.
const LEAST_PLANNED: f32 = 0.05;

/// The law's constants for one motor and period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law {
    /// The period in seconds.
    period: f32,
    /// Share of a speed's error that is left after a tick.
    left: f32,
    /// Mean voltage that changes the speed by 1 count/s within a tick: q / (b (1 - exp(-q T))).
    per_speed: f32,
    /// Speed per distance near a position, 1/s.
    approach: f32,
    /// What the friction's turning round changes the load by, counts/s².
    friction: f32,
    /// Largest acceleration, counts/s², if one was set.
    limit: Option<f32>,
}

/// The law's state.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct State {
    /// The direction for which the observed load holds the friction: -1, 0 or 1.
    friction_side: f32,
    /// At a position, holding.
    holding: bool,
}

impl Law {
    pub(super) fn new(plant: &Plant, friction: f32, period: Period, limit: Option<Acceleration>) -> Self {
        let seconds = period.to_seconds();
        let left =
            if period.as_millis() > 20 { expf(-24.0 * seconds).max(0.3) } else { expf(-30.0 * seconds) };
        let x = plant.q * seconds;
        let rate = if x > 1e-3 { plant.q / -expm1f(-x) } else { 1.0 / seconds };
        Self {
            period: seconds,
            left,
            per_speed: rate / plant.b,
            approach: (0.75 / seconds).min(12.0),
            friction: FRICTION_SHARE * friction * plant.b,
            limit: limit.map(|limit| limit.get() as f32),
        }
    }

    /// Of the observer's filter: poles in 1/s, and the floor of z. At long periods a load must be known sooner
    /// than a crawl is smooth.
    pub(super) const fn filter(period: Period) -> (f32, f32) {
        match period.as_millis() {
            0..=20 => (45.0, 0.35),
            21..=50 => (42.0, 0.35),
            _ => (42.0, 0.25),
        }
    }

    /// Towards a speed.
    pub(super) fn velocity(
        &self,
        state: &mut State,
        observer: &mut Observer,
        plant: &Plant,
        target: f32,
        stage: &Stage<'_>,
    ) -> Output {
        state.holding = false;
        let w = observer.speed();
        let next = w + (1.0 - self.left) * (target - w);
        self.request(state, observer, plant, next, stage, target)
    }

    /// Towards a position, `distance` counts away from the present count's lower edge.
    pub(super) fn position(
        &self,
        state: &mut State,
        observer: &mut Observer,
        plant: &Plant,
        distance: i32,
        speed_limit: f32,
        stage: &Stage<'_>,
    ) -> Output {
        let w = observer.speed();
        let window = at_least(self.period, 0.02);
        let near = if state.holding { 2 } else { 1 };
        state.holding = distance.unsigned_abs() <= near && (state.holding || w.abs() * window < 0.5);
        if state.holding {
            return self.request(state, observer, plant, self.left * w, stage, 0.0);
        }
        // To the middle of the target count.
        let way = distance as f32 + 0.5 - observer.fraction();
        let (side, way) = (1.0f32.copysign(way), way.abs());
        let strength = plant.b * stage.at.battery_volts();
        let brakes = at_least(PLANNED * (strength - side * observer.disturbance()), LEAST_PLANNED * strength);
        let brakes = self.limit.map_or(brakes, |limit| at_most(brakes, limit));
        let (now, end) = self.profile(way, side * w, brakes, speed_limit);
        let next = side * (end - self.left * (now - side * w));
        self.request(state, observer, plant, next, stage, side * now)
    }

    /// With a place that is `distance` counts away from the present count's lower edge and moves, at these
    /// speeds now and at the next tick.
    pub(super) fn follow(
        &self,
        state: &mut State,
        observer: &mut Observer,
        plant: &Plant,
        distance: f32,
        (now, end): (f32, f32),
        stage: &Stage<'_>,
    ) -> Output {
        state.holding = false;
        let Self { period, approach, left, .. } = *self;
        let w = observer.speed();
        // To the middle of a count, as positions are.
        let way = distance + 0.5 - observer.fraction();
        // At the tick's end it will be so far, less half a tick of the speed that is sought.
        let rest = way + (now + end - w) * period / 2.0;
        let next =
            (end + approach * rest - left * (now + approach * way - w)) / (1.0 + approach * period / 2.0);
        self.request(state, observer, plant, next, stage, end + approach * way)
    }

    /// The speeds that are right so far from a target: now, and at the tick's end if the motor, at speed `w`
    /// towards the target, takes the tick to get there. Far away they fall with the square root of the
    /// distance, as constant braking makes them; near by in proportion to it.
    fn profile(&self, way: f32, w: f32, brakes: f32, limit: f32) -> (f32, f32) {
        let Self { period, approach, .. } = *self;
        let knee = brakes / (approach * approach);
        let now = if way < knee { approach * way } else { sqrtf(2.0 * brakes * (way - knee / 2.0)) };
        // The tick's distance is half by the speed now, half by that at its end.
        let rest = way - w * period / 2.0;
        let linear = approach * rest / (1.0 + approach * period / 2.0);
        let lost = brakes * period / 2.0;
        let end = if rest - linear * period / 2.0 < knee {
            linear
        } else {
            sqrtf(lost * lost + 2.0 * brakes * (rest - knee / 2.0)) - lost
        };
        (at_most(now, limit), within(end, limit))
    }

    /// The voltage for a speed at the tick's end.
    fn request(
        &self,
        state: &mut State,
        observer: &mut Observer,
        plant: &Plant,
        next: f32,
        stage: &Stage<'_>,
        speed: f32,
    ) -> Output {
        let w = observer.speed();
        let next = match self.limit {
            Some(limit) => w + within(next - w, limit * self.period),
            None => next,
        };
        self.turn_friction(state, observer, next);
        let wanted = self.voltage_to(observer, plant, next);
        // In overrun less braking takes more than the battery's voltage.
        let most = at_least(stage.at.battery_volts(), (plant.kappa * w).abs());
        let voltage = Voltage::from_volts(within(wanted, most));
        Output { effort: Effort::Voltage(voltage), speed: super::speed(speed) }
    }

    /// The voltage that brings the motor to this speed by the tick's end, in V.
    fn voltage_to(&self, observer: &Observer, plant: &Plant, next: f32) -> f32 {
        let w = observer.speed();
        plant.kappa * w + (next - w) * self.per_speed - observer.load(plant) / plant.b
    }

    /// The voltage that brings the motor towards a speed, in V.
    pub(super) fn voltage_for_speed(&self, observer: &Observer, plant: &Plant, target: f32) -> f32 {
        let w = observer.speed();
        self.voltage_to(observer, plant, w + (1.0 - self.left) * (target - w))
    }

    /// Friction acts against the motion: what was observed of it has the wrong sign once the motion turns.
    fn turn_friction(&self, state: &mut State, observer: &mut Observer, next: f32) {
        let side = 1.0f32.copysign(next);
        let against = -side * observer.speed() * self.period > 1.0;
        if side != state.friction_side && next.abs() > TURNING && !against {
            observer.add_load(self.friction * (state.friction_side - side));
            state.friction_side = side;
        }
    }
}
