//! Report of a motor's state at a tick.

use super::{EncoderFault, SenseLine, Setpoint, Settings};
use crate::braking::{OperatingPoint, Regime};
use crate::bridge::Drive;
use crate::regulator::Kind;
use crate::regulator::identify::Identification;
use crate::units::{Control, CountsPerSecond, EmfConstant, Milliamperes, Millivolts, Voltage};

/// Faults of a motor. With a fault that its set-point does not tolerate the motor coasts or brakes, by its setting
/// [`OnFault`](super::OnFault). With a fault of battery or bridge every motor coasts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Faults {
    /// The battery voltage is unknown: never measured, implausible, or too old. The motor coasts.
    pub battery_unknown: bool,
    /// There is no encoder reading from the last 20 ms. Constant power continues.
    pub encoder_stale: bool,
    /// Fault of the encoder of a regulated motor: no counts, or counts in the wrong direction. `None` without this
    /// fault. The fault is latched until the motor is disabled or in fail-safe. Constant power continues.
    pub encoder: Option<EncoderFault>,
    /// The winding was too hot although its driving current was limited. The fault is latched until the motor is
    /// disabled or in fail-safe after the winding has cooled down.
    pub overheated: bool,
    /// The bridge has reported that it had switched itself off. The fault is latched until the motor is disabled or
    /// in fail-safe. The motor coasts.
    pub bridge: bool,
}

impl Faults {
    /// No fault.
    pub const NONE: Self = Self {
        battery_unknown: false,
        encoder_stale: false,
        encoder: None,
        overheated: false,
        bridge: false,
    };

    /// True if there is a fault.
    pub fn any(self) -> bool {
        self != Self::NONE
    }
}

/// Best estimate of a motor's current: the measured magnitude with the sign of the modelled current, or, without a
/// measurement, the modelled current. The torque of a positive current is CW.
pub const fn best_current(modelled: Milliamperes, measured: Option<Milliamperes>) -> Milliamperes {
    match measured {
        // `i32::MIN` has no opposite, and stays negative.
        Some(magnitude) if modelled.get() < 0 => Milliamperes::new(magnitude.get().wrapping_neg()),
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
    /// Modelled mean current of the winding, by the motor's constants and the applied voltage; 0 while coasting. The
    /// torque of a positive current is CW.
    pub current: Milliamperes,
    /// Magnitude of the mean current that the board measures. `None` without a current-sense line, with a broken line,
    /// and while the bridge is in 5/0, in which the line shows no current. `None` also at a tick whose mode differs
    /// from the mode of the last sample, and during burn pulses. `None` also while the line shows no current and has
    /// not yet shown a current at four samples.
    pub measured: Option<Milliamperes>,
    /// Condition of the current-sense line.
    pub sense_line: SenseLine,
    /// Heat of the winding, by the measured current or, without a measured current, by the modelled current. The heat
    /// is in 1/1000 of the thermal limit, and 0 without a limit.
    pub heat: u16,
    /// True if the winding is so hot that its driving current is limited.
    pub derated: bool,
    /// True if the current is limited, and is as high as the [current limit](super::Settings::current_limit) allows.
    pub current_limited: bool,
    /// Current that would balance load, friction and drag; positive for a load that resists CW motion. `None` for an
    /// unknown motor, whose dynamics are not configured.
    pub load: Option<Milliamperes>,
    /// Back EMF and battery voltage for which the command was computed; `None` while the motor coasts.
    pub operating_point: Option<OperatingPoint>,
    /// Mean voltage across the motor that the command applies, within all limits; 0 while the motor coasts.
    pub voltage: Voltage,
    /// Control value that the set-point or PID requests. `None` if a voltage is requested, or if a limit changes the
    /// request.
    pub requested: Option<Control>,
    /// Regime of the command; `None` while the motor coasts: disabled, at speed or power 0 with
    /// [`ZeroPower::Float`](super::ZeroPower::Float), at a fault that opens the bridge, or before and after the motion
    /// of an identification. A command with a limit that opens the bridge has a regime.
    pub regime: Option<Regime>,
    /// Command of the bridge.
    pub drive: Drive,
    /// True if the motor has settled in regulated position: at every tick of the dwell the motor was [within
    /// tolerance](super::within_tolerance) and no faster than 40 counts/s. The dwell is 50 ms, or one control
    /// period if the period is longer. A member of a group has settled when all members have settled.
    /// The members of a group that has lost a member never settle.
    pub settled: bool,
    /// True if the motor is regulated, and a stop or a load holds the motor.
    pub stalled: bool,
    /// Back EMF constant in force: the configured one, unless the hub has corrected it because the speed hunted or
    /// because the motor has become warm. `None` before the first tick.
    pub emf_constant: Option<EmfConstant>,
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

    /// Control value of the command, by the scheme and the duty rule of these settings; 0 while the motor coasts.
    pub fn control(&self, settings: &Settings) -> Control {
        match (self.requested, self.operating_point) {
            (Some(control), _) => control,
            (None, Some(at)) => settings.modulator().control(at, self.voltage),
            (None, None) => Control::ZERO,
        }
    }

    /// Mean current that the bridge draws from the bus; negative while the bridge returns current.
    ///
    /// The bridge stores no energy. So the current from the bus is the motor's current times the ratio of motor voltage
    /// to battery voltage. Without a battery voltage every bridge is open, and the current is 0.
    pub fn bus_current(&self, settings: &Settings, battery: Millivolts) -> Milliamperes {
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
        operating_point: None,
        voltage: Voltage::ZERO,
        requested: None,
        regime: None,
        drive: Drive::COAST,
        settled: false,
        stalled: false,
        emf_constant: None,
        identification: Identification::None,
        faults: Faults::NONE,
    };
}
