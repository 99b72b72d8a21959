//! Report of a motor's state at a tick.

use super::{EncoderFault, SenseLine, Setpoint, Settings};
use crate::braking::Regime;
use crate::bridge::Drive;
use crate::regulator::Kind;
use crate::regulator::identify::Identification;
use crate::units::{Control, CountsPerSecond, Milliamperes, Millivolts};

/// Faults of a motor. With a fault the motor coasts or brakes, by its setting [`OnFault`](super::OnFault).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Faults {
    /// The battery voltage is unknown: never measured, implausible, or too old. The motor coasts.
    pub battery_unknown: bool,
    /// There is no encoder reading from the last 20 ms. Constant power continues.
    pub encoder_stale: bool,
    /// The encoder of a regulated motor does not count, or counts in the wrong direction. This fault is latched until
    /// the motor is disabled. Constant power continues. `None` without this fault.
    pub encoder: Option<EncoderFault>,
    /// The winding was too hot in spite of its current limit. This fault is latched until the winding has cooled down
    /// and the motor is disabled.
    pub overheated: bool,
    /// The bridge reports that it has switched itself off. This fault is latched until the motor is disabled. The
    /// motor coasts.
    pub bridge: bool,
}

impl Faults {
    /// True if there is a fault.
    pub const fn any(self) -> bool {
        self.battery_unknown || self.encoder_stale || self.encoder.is_some() || self.overheated || self.bridge
    }
}

/// Best estimate of a motor's current: the measured magnitude with the sign of the modelled current, or the modelled
/// current where none is measured. A positive current turns the motor CW.
pub const fn best_current(modelled: Milliamperes, measured: Option<Milliamperes>) -> Milliamperes {
    match measured {
        Some(magnitude) if modelled.get() < 0 => Milliamperes::new(-magnitude.get()),
        Some(magnitude) => magnitude,
        None => modelled,
    }
}

/// State of a motor at a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Report {
    /// Set-point at the tick.
    pub setpoint: Setpoint,
    /// Position in counts.
    pub position: i32,
    /// Estimated speed.
    pub velocity: CountsPerSecond,
    /// Kind of the motor's regulator.
    pub regulator: Kind,
    /// Modelled mean current of the winding, by its constants and the applied voltage; 0 while coasting. A positive
    /// current turns the motor CW.
    pub current: Milliamperes,
    /// Magnitude of the mean current that the board measures. `None` without a current-sense line, with a broken one,
    /// and while the bridge is in 5/0, where the line shows no current.
    pub measured: Option<Milliamperes>,
    /// Condition of the current-sense line.
    pub sense_line: SenseLine,
    /// Heat of the winding, by the measured current or, without a measured current, by the modelled current. The heat is
    /// 1000 at the thermal limit, and 0 without a limit.
    pub heat: u16,
    /// True if the winding is so hot that its current is limited.
    pub derated: bool,
    /// True if the [current limit](super::Settings::current_limit) holds the current below the requested current.
    pub current_limited: bool,
    /// Current that would balance load, friction and drag. The current is positive for a load that resists CW motion.
    /// `None` for an unknown motor, whose dynamics are not configured.
    pub load: Option<Milliamperes>,
    /// Control value; 0 while coasting.
    pub control: Control,
    /// Regime of the control value; `None` while the bridge is open because the motor is disabled, floating or at
    /// fault.
    pub regime: Option<Regime>,
    /// Command of the bridge.
    pub drive: Drive,
    /// True if the motor has settled in regulated position: the motor was [within tolerance](super::within_tolerance) and
    /// no faster than 40 counts/s for the dwell. The dwell is 50 ms, or one control period if the period is longer. A
    /// member of a group has settled when all members have settled.
    pub settled: bool,
    /// True if the motor is regulated, and a stop or a load holds the motor.
    pub stalled: bool,
    /// State or result of the last identification.
    pub identification: Identification,
    /// Faults of the motor.
    pub faults: Faults,
}

impl Report {
    /// The [best current](best_current) of the motor.
    pub const fn best_current(&self) -> Milliamperes {
        best_current(self.current, self.measured)
    }

    /// Mean current that the bridge draws from the bus; negative while the bridge returns current.
    ///
    /// The bridge stores no energy. So the current from the bus is the motor's current times the ratio of motor voltage
    /// to battery voltage. Without a battery voltage every bridge is open, and the current is 0.
    pub fn drawn(&self, settings: &Settings, battery: Millivolts) -> Milliamperes {
        let amperes = self.best_current().to_amperes();
        let across = settings.winding.emf.emf(self.velocity).to_volts() + amperes * settings.ohms();
        let share = if battery.get() == 0 { 0.0 } else { across / battery.to_volts() };
        Milliamperes::from_amperes(amperes * share)
    }

    /// The report before the first tick: a disabled motor.
    pub const INITIAL: Self = Self {
        setpoint: Setpoint::Disabled,
        position: 0,
        velocity: CountsPerSecond::ZERO,
        regulator: Kind::Model,
        current: Milliamperes::ZERO,
        measured: None,
        sense_line: SenseLine::Absent,
        heat: 0,
        derated: false,
        current_limited: false,
        load: None,
        control: Control::ZERO,
        regime: None,
        drive: Drive::COAST,
        settled: false,
        stalled: false,
        identification: Identification::None,
        faults: Faults {
            battery_unknown: false,
            encoder_stale: false,
            encoder: None,
            overheated: false,
            bridge: false,
        },
    };
}
