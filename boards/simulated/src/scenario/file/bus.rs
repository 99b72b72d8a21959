//! The table `[bus]`: the bus between battery and bridges, and the hub's limits for it.

use super::ranges::within;
use super::tables::BusTable;
use crate::scenario::definition::Bus;
use crate::scenario::mistake::{Checked, Mistake, fault};
use motor_hub::supply::{Levels, Limits};
use motor_hub::units::Millivolts;

impl BusTable {
    pub(super) fn check(&self, duration_s: f64) -> Checked<Bus> {
        let opens_at_s =
            self.opens_at_s.as_ref().map(|at| within(at, "opens_at_s", 0.0..=duration_s)).transpose()?;
        let capacitance_f = within(&self.capacitance_f, "capacitance_f", 1e-5..=1.0)?;
        Ok(Bus { capacitance_f, one_way: self.one_way, opens_at_s })
    }

    /// The hub's own limits, with the dissipation levels of the table.
    pub(super) fn limits(&self) -> Checked<Limits> {
        let limits = Limits::TWELVE_VOLTS;
        let Some(between) = &self.burn_between_v else { return Ok(limits) };
        let [dissipate, ceiling] = between.get_ref().map(Millivolts::from_volts);
        let levels = |dissipate, ceiling| Limits::new(Levels { dissipate, ceiling, ..limits.levels() });
        match (dissipate, ceiling) {
            (Ok(dissipate), Ok(ceiling)) => levels(dissipate, ceiling),
            (Err(wrong), _) | (_, Err(wrong)) => Err(wrong),
        }
        .map_err(|_| fault(between, Mistake::BurnBetween(limits.levels())))
    }
}
