//! How hot a winding is, from the current that is known to flow in it (I2t), and how much current it may have for that.
//!
//! Two bodies in a row, the winding and the case around it, each of first order: of the winding's rise over its
//! surroundings a quarter is over the case, and follows the square of the current within seconds; the rest is the case's, and
//! takes minutes. Both together are 1 of the limit when the continuous current flows for ever. The resistance
//! is taken as it was told, cold; a hot winding has more of it, and less current.
//!
//! Temperatures are not known here, nor is that of the room: the limit is the motor's data sheet's.

use crate::units::single::{at_least, at_most};
use crate::units::{Milliamperes, Period, RangeError};

/// The winding's share of the rise; of small brushed motors 0.15 to 0.3 of the thermal resistance lies between winding
/// and case.
const WINDING_SHARE: f32 = 0.25;
/// From here on the current is limited: from four times the continuous current down to that at 1.
const DERATED_FROM: f32 = 0.8;
/// Above this the motor is switched off. Limited current ends at 1, so it is a load that drives the motor that gets here.
const CUT_ABOVE: f32 = 1.1;
/// A cut motor that has cooled down to this may run again, if it is disabled and enabled.
const COOL: f32 = 1.0;
/// Squares are gathered for so long: a filter of minutes that is stepped every millisecond would lose them in rounding.
const GATHER_S: f32 = 0.05;

/// What heat a motor's winding stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ThermalLimit {
    continuous_ma: u16,
    winding_s: u16,
    case_s: u16,
}

impl ThermalLimit {
    /// Time constant of a winding if nobody knows better, in seconds.
    pub const USUAL_WINDING_S: u16 = 20;
    /// Time constant of a case if nobody knows better, in seconds.
    pub const USUAL_CASE_S: u16 = 600;

    /// The current that may flow for ever, in milliamperes, and the time constants of winding and case, in seconds.
    ///
    /// # Errors
    /// [`RangeError::Thermal`] if one of them is 0.
    pub const fn new(continuous_ma: u16, winding_s: u16, case_s: u16) -> Result<Self, RangeError> {
        if continuous_ma == 0 || winding_s == 0 || case_s == 0 {
            return Err(RangeError::Thermal);
        }
        Ok(Self { continuous_ma, winding_s, case_s })
    }

    /// 1 to 65 535 mA.
    pub const fn continuous_ma(&self) -> u16 {
        self.continuous_ma
    }

    /// 1 to 65 535 s.
    pub const fn winding_s(&self) -> u16 {
        self.winding_s
    }

    /// 1 to 65 535 s.
    pub const fn case_s(&self) -> u16 {
        self.case_s
    }

    fn continuous(&self) -> f32 {
        f32::from(self.continuous_ma) / 1000.0
    }
}

/// The heat of one winding, in mean squares of its current, A².
#[derive(Clone, Copy, Debug)]
pub(super) struct Thermal {
    period_s: f32,
    limit: Option<ThermalLimit>,
    winding: f32,
    case: f32,
    /// Squares of currents times seconds, and the seconds, since the filters were last stepped.
    gathered: f32,
    gathered_s: f32,
    /// Latched.
    cut: bool,
}

impl Thermal {
    /// Cold.
    pub(super) const fn new(period: Period, limit: Option<ThermalLimit>) -> Self {
        let period_s = period.as_millis() as f32 / 1000.0;
        Self { period_s, limit, winding: 0.0, case: 0.0, gathered: 0.0, gathered_s: 0.0, cut: false }
    }

    /// Another limit; the winding is as hot as it was.
    pub(super) const fn configure(&mut self, limit: Option<ThermalLimit>) {
        self.limit = limit;
        if limit.is_none() {
            self.cut = false;
        }
    }

    /// This current flows until the next tick.
    pub(super) fn step(&mut self, current: Milliamperes) {
        let Some(limit) = self.limit else { return };
        let amperes = current.get() as f32 / 1000.0;
        self.gathered += amperes * amperes * self.period_s;
        self.gathered_s += self.period_s;
        if self.gathered_s < GATHER_S {
            return;
        }
        let square = self.gathered / self.gathered_s;
        for (mean, seconds) in [(&mut self.winding, limit.winding_s), (&mut self.case, limit.case_s)] {
            *mean += (square - *mean) * at_most(self.gathered_s / f32::from(seconds), 1.0);
        }
        (self.gathered, self.gathered_s) = (0.0, 0.0);
        self.cut |= self.heat() > CUT_ABOVE;
    }

    /// 1 at the limit; 0 without one.
    pub(super) fn heat(&self) -> f32 {
        self.limit.map_or(0.0, |limit| {
            let mean = WINDING_SHARE * self.winding + (1.0 - WINDING_SHARE) * self.case;
            mean / (limit.continuous() * limit.continuous())
        })
    }

    /// The most amperes that may drive the motor now; `None` for any.
    pub(super) fn ceiling(&self) -> Option<f32> {
        let (limit, heat) = (self.limit?, self.heat());
        (heat > DERATED_FROM).then(|| {
            let left = at_least((1.0 - heat) / (1.0 - DERATED_FROM), 0.0);
            limit.continuous() * (1.0 + 3.0 * left)
        })
    }

    /// It was too hot.
    pub(super) const fn is_cut(&self) -> bool {
        self.cut
    }

    /// The motor was disabled: it may run again, if it has cooled down.
    pub(super) fn clear(&mut self) {
        self.cut &= self.heat() > COOL;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1 A, 20 s, 600 s.
    fn limit() -> ThermalLimit {
        ThermalLimit::new(1_000, 20, 600).unwrap_or_else(|error| unreachable!("{error}"))
    }

    fn thermal(ms: u32) -> Thermal {
        Thermal::new(Period::from_millis(ms).unwrap_or_default(), Some(limit()))
    }

    /// The heat after so many seconds of milliamperes.
    fn after(thermal: &mut Thermal, seconds: f32, ma: i32) -> f32 {
        for _ in 0..(seconds / thermal.period_s) as u32 {
            thermal.step(Milliamperes::new(ma));
        }
        thermal.heat()
    }

    #[test]
    fn the_continuous_current_is_the_limit_however_often_it_is_looked_at() {
        for ms in [1, 30, 50, 100] {
            let heat = after(&mut thermal(ms), 6_000.0, -1_000);
            assert!((heat - 1.0).abs() < 0.01, "{ms} ms: {heat}");
        }
    }

    #[test]
    fn heat_follows_the_square_of_the_current_with_both_time_constants() {
        for ms in [1, 50] {
            for (seconds, ma) in [(5.0_f32, 3_000_i32), (20.0, 1_500), (600.0, 900)] {
                let rise = |tau: f32| 1.0 - (-seconds / tau).exp();
                let square = (ma as f32 / 1e3).powi(2);
                let wanted = square * (0.25 * rise(20.0) + 0.75 * rise(600.0));
                let heat = after(&mut thermal(ms), seconds, ma);
                assert!((heat - wanted).abs() < 0.01 * wanted, "{ms} ms, {seconds} s: {heat}, {wanted}");
            }
        }
    }

    #[test]
    fn what_may_flow_falls_to_the_continuous_current_before_anything_is_cut() {
        let mut thermal = thermal(50);
        assert_eq!(thermal.ceiling(), None);
        let mut least = f32::INFINITY;
        for _ in 0..200 * 20 {
            // Whoever obeys is not cut.
            let ma = thermal.ceiling().map_or(4_000.0, |ceiling| (1e3 * ceiling).min(4_000.0));
            least = least.min(ma);
            thermal.step(Milliamperes::new(ma as i32));
        }
        assert!((thermal.heat() - 1.0).abs() < 0.1 && !thermal.is_cut(), "{}", thermal.heat());
        assert!((1_000.0..1_400.0).contains(&least), "{least}");
    }

    #[test]
    fn what_was_too_hot_stays_cut_until_it_has_cooled_down_and_was_disabled() {
        let mut thermal = thermal(50);
        after(&mut thermal, 30.0, 4_000);
        assert!(thermal.is_cut());
        thermal.clear();
        assert!(thermal.is_cut(), "hot still: {}", thermal.heat());
        after(&mut thermal, 900.0, 0);
        assert!(thermal.is_cut());
        thermal.clear();
        assert!(!thermal.is_cut());
    }
}
