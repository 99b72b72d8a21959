//! Thermal model of a winding (I2t): computes the heating from the current, and limits the current of a hot motor.
//!
//! Winding and case are two bodies in series, each a filter of first order. The model assumes that a quarter of the
//! winding's temperature rise lies between winding and case. This quarter follows the square of the current within
//! seconds. The other three quarters lie between case and room, and follow within minutes. In the formulas *winding*
//! and *case* are the squared current, in A², filtered with the time constant of the winding and of the case. A prime
//! marks a rate of change:
//!
//! ```text
//! heat = (0.25 winding + 0.75 case) / continuous²      winding' = (current² - winding) / winding_s
//!                                                      case'    = (current² - case) / case_s
//! ```
//!
//! The heat is 1 after a long time at the continuous current, which is a setting from the motor's data sheet. The model
//! assumes that the winding is then 100 K warmer than the room, and takes the magnets to be as warm as the case. The
//! regulator's constants follow these [`Temperatures`]. Without a measured current the hub computes the current with
//! the configured resistance of a cold winding. A hot winding has more resistance, so its true current is smaller than
//! the computed current.
//!
//! ```text
//! Running ───── heat above 1.1 ────▶ Tripped
//!    ▲                                │
//!    └── disabled at heat 1 or less ──┘
//! ```

use crate::settings::ThermalLimit;
use crate::units::single::{at_least, at_most};
use crate::units::{Milliamperes, Period};

/// Share of the winding's temperature rise that lies between winding and case. Small brushed motors have 0.15 to 0.3 of
/// their thermal resistance there.
const WINDING_SHARE: f32 = 0.25;
/// Heat above which the current is limited. At this heat the limit is four times the continuous current. The limit
/// falls linearly to the continuous current at the heat 1.
const DERATED_FROM: f32 = 0.8;
/// Heat above which the motor is switched off. The limited driving current keeps the heat near 1. The braking current
/// is not limited, so a load that drives the motor can exceed this heat.
const TRIP_HEAT: f32 = 1.1;
/// Largest heat at which disabling a motor, or fail-safe, ends the trip.
const COOL: f32 = 1.0;
/// Time in s over which squares of the current are averaged before the filters are stepped. A filter with a time
/// constant of minutes that is stepped every millisecond would lose small squares in rounding.
const AVERAGING_S: f32 = 0.05;

/// Temperature rise of the winding above the room at the heat 1, in K. The value is an assumption: windings of small
/// brushed motors tolerate 120 to 150 degrees Celsius.
const RISE_K: f32 = 100.0;
/// Growth of the resistance of copper per kelvin, as a share of the cold resistance.
const COPPER_PER_K: f32 = 0.0039;
/// Loss of the field of ferrite magnets per kelvin, as a share of the field of cold magnets.
const FERRITE_PER_K: f32 = 0.002;

/// Temperature rises of a motor above the temperatures of a cold motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Temperatures {
    /// Temperature rise of the winding, in K.
    pub(super) winding_k: u8,
    /// Temperature rise of the magnets, in K.
    pub(super) magnets_k: u8,
}

impl Temperatures {
    /// A cold motor.
    pub(super) const COLD: Self = Self { winding_k: 0, magnets_k: 0 };

    /// Resistance of the winding, as a share of the cold resistance.
    pub(super) fn resistance_share(&self) -> f32 {
        1.0 + COPPER_PER_K * f32::from(self.winding_k)
    }

    /// Field of the magnets, which makes back EMF and torque, as a share of the field of cold magnets.
    pub(super) fn field_share(&self) -> f32 {
        1.0 - FERRITE_PER_K * f32::from(self.magnets_k)
    }
}

/// State of the thermal model of one motor. The default is a cold motor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Thermal {
    /// Filtered square of the current with the winding's time constant, in A².
    winding: f32,
    /// Filtered square of the current with the case's time constant, in A².
    case: f32,
    /// Integral of the squared current since the filters were last stepped, in A² s.
    squared_current_integral: f32,
    /// Time since the filters were last stepped, in s.
    averaged_s: f32,
    /// True if the motor was too hot and is switched off. The trip is latched.
    tripped: bool,
}

impl Thermal {
    /// Steps the model by a tick with this current. Without a limit the model does not change.
    pub(super) fn step(&mut self, limit: Option<ThermalLimit>, period: Period, current: Milliamperes) {
        let Some(limit) = limit else { return };
        let (amperes, seconds) = (current.to_amperes(), period.to_seconds());
        self.squared_current_integral += amperes * amperes * seconds;
        self.averaged_s += seconds;
        if self.averaged_s < AVERAGING_S {
            return;
        }
        let square = self.squared_current_integral / self.averaged_s;
        for (mean, seconds) in [(&mut self.winding, limit.winding_s()), (&mut self.case, limit.case_s())] {
            *mean += (square - *mean) * at_most(self.averaged_s / f32::from(seconds), 1.0);
        }
        (self.squared_current_integral, self.averaged_s) = (0.0, 0.0);
        self.tripped |= self.heat(Some(limit)) > TRIP_HEAT;
    }

    /// The heat as defined in the module, 1 after a long time at the continuous current. 0 without a limit.
    pub(super) fn heat(&self, limit: Option<ThermalLimit>) -> f32 {
        limit.map_or(0.0, |limit| {
            let mean = WINDING_SHARE * self.winding + (1.0 - WINDING_SHARE) * self.case;
            mean / (limit.continuous_amperes() * limit.continuous_amperes())
        })
    }

    /// The temperatures of the motor. Without a limit the motor counts as cold.
    pub(super) fn temperatures(&self, limit: Option<ThermalLimit>) -> Temperatures {
        let Some(limit) = limit else { return Temperatures::COLD };
        let per_square = RISE_K / (limit.continuous_amperes() * limit.continuous_amperes());
        let magnets_k = (1.0 - WINDING_SHARE) * self.case * per_square;
        let winding_k = magnets_k + WINDING_SHARE * self.winding * per_square;
        // The conversion saturates at 255 K. The motor is switched off before it is so hot.
        Temperatures { winding_k: winding_k as u8, magnets_k: magnets_k as u8 }
    }

    /// Largest current in A that may drive the motor; `None` if no thermal limit is configured, or if the motor is
    /// not hot.
    pub(super) fn driving_current_limit_amperes(&self, limit: Option<ThermalLimit>) -> Option<f32> {
        let heat = self.heat(limit);
        limit.filter(|_| heat > DERATED_FROM).map(|limit| {
            let left = at_least((1.0 - heat) / (1.0 - DERATED_FROM), 0.0);
            limit.continuous_amperes() * (1.0 + 3.0 * left)
        })
    }

    /// True if the motor was too hot and is switched off.
    pub(super) const fn is_tripped(&self) -> bool {
        self.tripped
    }

    /// Ends the trip of a motor that has cooled down, or that has no limit any more.
    pub(super) fn clear(&mut self, limit: Option<ThermalLimit>) {
        self.tripped &= self.heat(limit) > COOL;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A limit of 1 A with the time constants 20 s and 600 s.
    fn limit() -> ThermalLimit {
        ThermalLimit::new(1_000, 20, 600).unwrap_or_else(|error| unreachable!("{error}"))
    }

    fn step(model: &mut Thermal, ms: u32, ma: i32) {
        model.step(Some(limit()), Period::from_millis(ms).unwrap_or_default(), Milliamperes::new(ma));
    }

    /// The heat after a constant current of `ma` mA for `seconds`, at a control period of `ms`.
    fn heat_after(model: &mut Thermal, ms: u32, seconds: f32, ma: i32) -> f32 {
        let period = Period::from_millis(ms).unwrap_or_default();
        for _ in 0..(seconds / period.to_seconds()) as u32 {
            step(model, ms, ma);
        }
        model.heat(Some(limit()))
    }

    #[test]
    fn heat_follows_the_square_of_the_current_with_both_time_constants() {
        for ms in [1, 30, 50, 100] {
            // At the end, the continuous current leads to the heat 1.
            for (seconds, ma) in [(5.0_f32, 3_000_i32), (20.0, 1_500), (600.0, 900), (6_000.0, -1_000)] {
                let rise = |tau: f32| 1.0 - (-seconds / tau).exp();
                let square = (ma as f32 / 1e3).powi(2);
                let wanted = square * (0.25 * rise(20.0) + 0.75 * rise(600.0));
                let heat = heat_after(&mut Thermal::default(), ms, seconds, ma);
                assert!((heat - wanted).abs() < 0.01 * wanted, "{ms} ms, {seconds} s: {heat}, {wanted}");
            }
        }
    }

    #[test]
    fn a_motor_that_was_too_hot_stays_tripped_until_it_has_cooled_down_and_is_disabled() {
        let mut model = Thermal::default();
        heat_after(&mut model, 50, 30.0, 4_000);
        assert!(model.is_tripped());
        model.clear(Some(limit()));
        assert!(model.is_tripped(), "still hot: {}", model.heat(Some(limit())));
        heat_after(&mut model, 50, 900.0, 0);
        assert!(model.is_tripped());
        model.clear(Some(limit()));
        assert!(!model.is_tripped());
    }
}
