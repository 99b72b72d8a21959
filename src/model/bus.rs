//! The supply bus of the bridges: a capacitor that a source charges. The source may be unable to take current back, and
//! may be disconnected. The module also models how a bridge shuts itself down when the bus voltage is too low or too
//! high.
//!
//! ```
//! use motor_hub::model::battery::Battery;
//! use motor_hub::model::bus::Bus;
//! use motor_hub::model::si::{Coulombs, Ohms, Seconds, Volts};
//!
//! // A bench supply with 1000 uF takes no current back, so returned charge raises the voltage and it stays high.
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

/// The capacitor of the bus and its connection to the source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bus {
    /// Capacitance of the capacitor in F, above 0.
    pub capacitance: f64,
    /// True if the source takes no current back, for example a bench supply or a source behind a diode.
    pub one_way: bool,
    /// True if the contactor between source and capacitor is closed.
    pub closed: bool,
    /// Shutdown voltages of all bridges.
    pub protection: Protection,
    /// Voltage of the capacitor, V.
    voltage: f64,
    /// Net energy that the source has delivered, J.
    delivered: f64,
    /// Heat in the resistance of the source, J.
    lost: f64,
}

impl Bus {
    /// Creates a bus whose capacitor is charged to the voltage of its source. The source takes current back.
    #[must_use]
    pub const fn new(source: Battery, capacitance: f64) -> Self {
        let voltage = source.emf.0;
        let protection = Protection::VNH5019;
        Self { capacitance, one_way: false, closed: true, protection, voltage, delivered: 0.0, lost: 0.0 }
    }

    /// Returns the present voltage of the bus.
    #[must_use]
    pub const fn voltage(&self) -> Volts {
        Volts(self.voltage)
    }

    /// Returns the energy in the capacitor.
    #[must_use]
    pub const fn stored(&self) -> Joules {
        Joules(0.5 * self.capacitance * self.voltage * self.voltage)
    }

    /// Returns the net energy that the source has delivered so far, including the heat in its resistance.
    #[must_use]
    pub const fn delivered(&self) -> Joules {
        Joules(self.delivered)
    }

    /// Returns the heat in the resistance of the source so far.
    #[must_use]
    pub const fn lost(&self) -> Joules {
        Joules(self.lost)
    }

    /// Removes the charge that the bridges have drawn at the present voltage. A negative `charge` is what the bridges
    /// have returned.
    ///
    /// The energy of the charge is subtracted from the energy of the capacitor. Energy is therefore conserved.
    pub fn draw(&mut self, charge: Coulombs) {
        let square = self.voltage * self.voltage - 2.0 * self.voltage * charge.0 / self.capacitance;
        self.voltage = square.max(0.0).sqrt();
    }

    /// Advances by `time`, in which the source charges or discharges the capacitor.
    ///
    /// The voltage does not change while the contactor is open. The voltage also does not change if
    /// [`one_way`](Self::one_way) is true and the voltage of the bus is not below the voltage of the source.
    pub fn wait(&mut self, time: Seconds, source: &Battery) {
        let difference = self.voltage - source.emf.0;
        if !self.closed || (self.one_way && difference >= 0.0) {
            return;
        }
        let before = self.stored().0;
        let tau = source.resistance.0 * self.capacitance;
        let remaining = if tau > 0.0 { (-time.0 / tau).exp() } else { 0.0 };
        let change = difference * (remaining - 1.0);
        self.voltage += change;
        let delivered = source.emf.0 * self.capacitance * change;
        self.delivered += delivered;
        self.lost += delivered - (self.stored().0 - before);
    }
}

/// Supply voltages at which a bridge shuts itself down: it opens all switches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Protection {
    /// The bridge opens above this voltage. The bridge stays open until its input lines change while the voltage is
    /// lower.
    pub over: Volts,
    /// The bridge opens below this voltage.
    pub under: Volts,
    /// After an undervoltage shutdown the bridge works again from this voltage on.
    pub back: Volts,
}

impl Protection {
    /// Typical thresholds of the VNH5019 family. The data sheet states a range of operation of 5.5 to 24 V.
    pub const VNH5019: Self = Self { over: Volts(27.0), under: Volts(4.5), back: Volts(5.0) };
    /// A bridge that works at any supply voltage.
    pub const NONE: Self =
        Self { over: Volts(f64::INFINITY), under: Volts(f64::NEG_INFINITY), back: Volts(f64::NEG_INFINITY) };
}

/// State of a bridge's own shutdown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shutdown {
    /// The bridge follows its input lines.
    #[default]
    None,
    /// The bridge is open because the voltage was too low.
    Under,
    /// The bridge is open because the voltage was too high. The two states are what the input lines commanded at the
    /// shutdown, in the first and in the second part of a PWM period.
    Over(State, State),
}

impl Shutdown {
    /// Returns the next state for this supply voltage and for input lines that alternate between the states `lines`.
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
