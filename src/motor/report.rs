//! What became of it: one tick of a motor, as a host would want to see it.

use super::{SenseLine, Setpoint};
use crate::braking::Regime;
use crate::bridge::Drive;
use crate::motion::EncoderFault;
use crate::regulator::Kind;
use crate::regulator::identify::Identification;
use crate::units::{Control, CountsPerSecond, Milliamperes};

/// What keeps a motor from doing what it is asked; each makes it coast, or brake where
/// [`OnFault`](super::OnFault) says so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Faults {
    /// No battery voltage is known: never measured, implausible, or too old. The motor coasts.
    pub battery_unknown: bool,
    /// No encoder reading, or none newer than 20 ms. Constant power runs on without one.
    pub encoder_stale: bool,
    /// The encoder of a regulated motor does not count, or counts the wrong way. Latched until the
    /// motor is disabled; constant power runs on.
    pub encoder: Option<EncoderFault>,
    /// The winding got too hot by its own current, in spite of a limit. Latched until it has cooled down and the motor
    /// is disabled.
    pub overheated: bool,
    /// The bridge says that it has switched itself off. Latched until the motor is disabled. The motor coasts.
    pub bridge: bool,
}

impl Faults {
    /// True if there is one.
    pub const fn any(self) -> bool {
        self.battery_unknown || self.encoder_stale || self.encoder.is_some() || self.overheated || self.bridge
    }
}

/// A motor's current as well as it is known: the measured magnitude with the sign of the modelled current, or the modelled
/// current where none is measured. Positive turns the motor CW.
pub const fn best_current(modelled: Milliamperes, measured: Option<Milliamperes>) -> Milliamperes {
    match measured {
        Some(magnitude) if modelled.get() < 0 => Milliamperes::new(-magnitude.get()),
        Some(magnitude) => magnitude,
        None => modelled,
    }
}

/// What a host would want to see of a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Report {
    /// What it is asked to do.
    pub setpoint: Setpoint,
    /// Counts.
    pub position: i32,
    /// Estimated.
    pub velocity: CountsPerSecond,
    /// Which regulator the motor has.
    pub regulator: Kind,
    /// Mean current of the winding by its constants and what the bridge is told; 0 while coasting. Positive
    /// turns the motor CW.
    pub current: Milliamperes,
    /// Magnitude of the mean current as the board measures it; `None` of a board that does not, while the bridge is in 5/0,
    /// where none can, and of a line that is not believed.
    pub measured: Option<Milliamperes>,
    /// What is thought of the line that shows it.
    pub sense_line: SenseLine,
    /// How hot the winding is by that current, or by the other: 1000 at its limit. 0 without one.
    pub heat: u16,
    /// It is so hot that its current is limited.
    pub derated: bool,
    /// The [current limit](super::Settings::current_limit) holds the current below what the set-point requests.
    pub current_limited: bool,
    /// The current that would just balance what loads the motor, friction and drag among it; positive for a load that holds it
    /// back from turning CW. `None` for an unknown motor.
    pub load: Option<Milliamperes>,
    /// The control value; 0 while coasting.
    pub control: Control,
    /// Its regime; `None` while the bridge is open because the motor is disabled, floating or at fault.
    pub regime: Option<Regime>,
    /// What the bridge is told.
    pub drive: Drive,
    /// True if the motor has settled: in regulated position, [within tolerance](super::within_tolerance) and no faster
    /// than 40 counts/s, all that for 50 ms or a control period, whichever is longer. A member of a group has settled when
    /// all members have come to their end in this way.
    pub settled: bool,
    /// Regulated, under effort, and held against a stop.
    pub stalled: bool,
    /// What became of the last identification.
    pub identification: Identification,
    /// What keeps it from obeying.
    pub faults: Faults,
}

impl Report {
    /// The [best current](best_current) of the motor.
    pub const fn best_current(&self) -> Milliamperes {
        best_current(self.current, self.measured)
    }

    /// A disabled motor of which nothing is known.
    pub const INITIAL: Self = Self {
        setpoint: Setpoint::Disabled,
        position: 0,
        velocity: CountsPerSecond::ZERO,
        regulator: Kind::Pid,
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
