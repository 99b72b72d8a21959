//! The bus that bridges share: a capacitor behind a source that may be unable to sink and may come off, and what
//! bridges do by themselves when its voltage is none to work at.
//!
//! ```
//! use motor_hub::model::battery::Battery;
//! use motor_hub::model::bus::Bus;
//! use motor_hub::model::si::{Coulombs, Ohms, Seconds, Volts};
//!
//! // A bench supply behind 1000 uF. What comes back lifts the voltage, and nothing takes it down.
//! let supply = Battery { emf: Volts(12.0), resistance: Ohms(0.1) };
//! let mut bus = Bus::new(supply, 1e-3);
//! bus.one_way = true;
//! bus.draw(Coulombs(-3e-3));
//! bus.wait(Seconds(1.0), &supply);
//! assert!((14.0..15.0).contains(&bus.voltage().0));
//! ```

use super::battery::Battery;
use super::si::{Coulombs, Joules, Seconds, Volts};
use crate::bridge::State;

/// A capacitor and how it is connected to its source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bus {
    /// In farads, above 0.
    pub capacitance: f64,
    /// The source gives current and takes none: a diode, or a bench supply.
    pub one_way: bool,
    /// The contactor between source and capacitor is closed.
    pub closed: bool,
    /// Of all bridges.
    pub protection: Protection,
    voltage: f64,
    given: f64,
    lost: f64,
}

impl Bus {
    /// Charged by its source, which takes current back.
    #[must_use]
    pub const fn new(source: Battery, capacitance: f64) -> Self {
        let voltage = source.emf.0;
        let protection = Protection::VNH5019;
        Self { capacitance, one_way: false, closed: true, protection, voltage, given: 0.0, lost: 0.0 }
    }

    /// Present voltage.
    #[must_use]
    pub const fn voltage(&self) -> Volts {
        Volts(self.voltage)
    }

    /// Energy in the capacitor.
    #[must_use]
    pub const fn stored(&self) -> Joules {
        Joules(0.5 * self.capacitance * self.voltage * self.voltage)
    }

    /// What the source has given so far, less what it was given: behind its resistance.
    #[must_use]
    pub const fn given(&self) -> Joules {
        Joules(self.given)
    }

    /// What has become heat in the source's resistance so far.
    #[must_use]
    pub const fn lost(&self) -> Joules {
        Joules(self.lost)
    }

    /// Bridges draw a charge at the present voltage; a negative one they return. By its energy, so that none is
    /// lost however long the step was in which it was drawn.
    pub fn draw(&mut self, charge: Coulombs) {
        let square = self.voltage * self.voltage - 2.0 * self.voltage * charge.0 / self.capacitance;
        self.voltage = square.max(0.0).sqrt();
    }

    /// The source charges the capacitor for a while, or discharges it.
    pub fn wait(&mut self, time: Seconds, source: &Battery) {
        let away = self.voltage - source.emf.0;
        if !self.closed || (self.one_way && away >= 0.0) {
            return;
        }
        let before = self.stored().0;
        let tau = source.resistance.0 * self.capacitance;
        let left = if tau > 0.0 { (-time.0 / tau).exp() } else { 0.0 };
        let by = away * (left - 1.0);
        self.voltage += by;
        let given = source.emf.0 * self.capacitance * by;
        self.given += given;
        self.lost += given - (self.stored().0 - before);
    }
}

/// Voltages at which a bridge opens by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Protection {
    /// Above this, and then until its lines change.
    pub over: Volts,
    /// Below this,
    pub under: Volts,
    /// until it is back here.
    pub back: Volts,
}

impl Protection {
    /// The thresholds that are typical of this family, within the data sheet's range of operation of 5.5 to 24 V.
    pub const VNH5019: Self = Self { over: Volts(27.0), under: Volts(4.5), back: Volts(5.0) };
    /// A bridge that works at any voltage.
    pub const NONE: Self =
        Self { over: Volts(f64::INFINITY), under: Volts(f64::NEG_INFINITY), back: Volts(f64::NEG_INFINITY) };
}

/// Whether a bridge does what it is told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shutdown {
    /// It does.
    #[default]
    None,
    /// The voltage was too low.
    Under,
    /// The voltage was too high while its lines alternated between these states.
    Over(State, State),
}

impl Shutdown {
    /// At this voltage, with lines that alternate between these states.
    #[must_use]
    pub fn step(self, protection: &Protection, voltage: Volts, lines: (State, State)) -> Self {
        match self {
            _ if voltage.0 < protection.under.0 => Self::Under,
            Self::Under if voltage.0 < protection.back.0 => Self::Under,
            _ if voltage.0 > protection.over.0 => Self::Over(lines.0, lines.1),
            Self::Over(on, off) if (on, off) == lines => self,
            _ => Self::None,
        }
    }
}
