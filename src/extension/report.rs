//! Reports of motors, bridges and bus.
//!
//! A [`HubReport`] has the state of all motors and of the bus in one answer, for hosts that plot, tune or record while
//! motors run. Its values are from the last control tick. Positions and velocities are from the newest encoder sample,
//! which may be newer than the tick. [`Commands`] tell whether the values include the effects of all earlier requests.
//!
//! Newer firmware may add fields at the end of each motor's fields, and after all motors. A host ignores fields that it
//! does not know.
//!
//! ```
//! use motor_hub::extension::report::HubReport;
//! use motor_hub::protocol::payload::{Field, Fields, Payload};
//!
//! let mut payload = Payload::new();
//! let report = HubReport { at_ms: 20, ..HubReport::default() };
//! report.write(&mut payload);
//! payload.extend_from_slice(&[1, 2, 3]).unwrap();
//! assert_eq!(HubReport::read(&mut Fields::new(&payload)), Ok(report));
//! ```

use crate::braking::Regime;
use crate::bridge::{Drive, Mode};
use crate::motor::{Faults, SenseLine, best_current};
use crate::protocol::payload::{
    ByteIn, Field, Fields, Payload, bits, byte, codec, codes, fields_in_order, payload,
};
use crate::protocol::{CHANNELS, Nack};
use crate::record::Fault;
use crate::regulator::Kind;
use crate::supply::BusState;
use crate::units::{Control, EmfConstant, Milliamperes, Millivolts, is_included};
use heapless::Vec;

/// Version of the [`HubReport`] that this firmware sends. A higher version has more fields after all motors.
pub const VERSION: u8 = 2;

/// Lowest version of a [`HubReport`] with [`Commands`].
const WITH_COMMANDS: u8 = 2;

/// Size of one motor's fields in bytes. The report of newer firmware may have a larger size.
const STRIDE: u8 = 36;

codes!(Mode { 0 = Cw98, 1 = Ccw62, 2 = Brake50 });
// `None` stands for an open bridge.
codes!(Option<Regime> { 0 = None, 1 = Some(Regime::Reverse), 2 = Some(Regime::Braking), 3 = Some(Regime::Forward) });
codes!(Kind { 0 = Model, 1 = Pid });
codes!(SenseLine { 0 = Absent, 1 = Sound, 2 = NoCurrent, 3 = Stuck, 4 = Excessive });
codes!(BusState { 0 = NoReading, 1 = TooLow, 2 = Cutoff, 3 = Derated, 4 = Quiet, 5 = Dissipating, 6 = TooHigh });

payload! {
    /// State of a motor and its bridge.
    #[derive(Copy, Default)]
    pub struct Condition {
        /// Mean current, modelled from the motor's constants.
        pub current: Milliamperes,
        /// Magnitude of the measured mean current in milliamperes. `None` without a current-sense line, with a line
        /// that is silent or stuck, and while the bridge is in mode 5/0.
        pub measured_ma: Option<u16> as measured,
        /// Heat of the winding in 1/1000 of its thermal limit. 0 without a thermal limit.
        pub heat: u16,
        /// True if the current is limited because the winding is hot.
        pub derated: bool,
        /// True if the winding was too hot. The motor then coasts or brakes until the winding has cooled down and the
        /// motor has been disabled.
        pub overheated: bool,
        /// True if the bridge has switched itself off since the motor was last disabled.
        pub bridge_fault: bool,
        /// State of the current-sense line.
        pub sense_line: SenseLine,
        /// Back EMF constant in force: the configured one, unless the hub has corrected it because the speed hunted or
        /// because the motor has become warm. `None` before the first tick, and
        /// from firmware that does not report it.
        pub emf_constant: Option<EmfConstant> as reported,
    }
}

payload! {
    /// State of the bus that battery and bridges share.
    #[derive(Copy, Default)]
    pub struct BusReport {
        /// Range of the bus voltage.
        pub state: BusState,
        /// Voltage of the newest sample, plausible or not. `None` if the converter does not answer, or if the sample is
        /// older than 100 ms.
        pub measured: Option<Millivolts> as measured,
        /// Strength with which braking motors dissipate energy, in 1/1000 of full strength. 0 while they may return all
        /// energy.
        pub dissipate: u16,
        /// Energy that braking motors have returned to the bus since boot, in millijoules.
        pub returned_mj: u32,
        /// Energy that braking motors have dissipated since boot, in millijoules.
        pub dissipated_mj: u32,
    }
}

/// Codec of a last field that older firmware does not send.
mod reported {
    use super::{Field, Fields, Nack, Payload};

    pub(super) fn read<T: Field>(fields: &mut Fields<'_>) -> Result<Option<T>, Nack> {
        (!fields.is_empty()).then(|| T::read(fields)).transpose()
    }

    pub(super) fn write<T: Field>(value: &Option<T>, payload: &mut Payload) {
        value.iter().for_each(|value| value.write(payload));
    }
}

/// Codec of an optional value: a bool, which is true if the value was measured, and then the value or 0.
mod measured {
    use super::{Field, Fields, Nack, Payload};

    pub(super) fn read<T: Field>(fields: &mut Fields<'_>) -> Result<Option<T>, Nack> {
        let (is_measured, value) = (bool::read(fields)?, T::read(fields)?);
        Ok(is_measured.then_some(value))
    }

    pub(super) fn write<T: Field + Default + Copy>(value: &Option<T>, payload: &mut Payload) {
        value.is_some().write(payload);
        value.unwrap_or_default().write(payload);
    }
}

codec! {
    /// Codec of a battery voltage. 0 stands for an unknown voltage.
    battery: Option<Millivolts> as Millivolts,
    |voltage| Some(voltage).filter(|voltage| voltage.get() != 0),
    Option::unwrap_or_default
}

/// Converts a current to 16 bits, limited to 32 767 mA in both directions.
fn milliamperes(current: Milliamperes) -> i16 {
    current.get().clamp(-i32::from(i16::MAX), i16::MAX.into()) as i16
}

codec! {
    /// Codec of a current in 16 bits, limited to 32 767 mA in both directions.
    current: Milliamperes as i16,
    |ma| Milliamperes::new(ma.into()),
    milliamperes
}

codec! {
    /// Codec of an optional [`current`]. -32 768 stands for `None`, because currents are limited to 32 767 mA.
    load: Option<Milliamperes> as i16,
    |ma| (ma != i16::MIN).then_some(Milliamperes::new(ma.into())),
    |load| load.map_or(i16::MIN, milliamperes)
}

codec! {
    /// Codec of the magnitude of a measured current, limited to 65 534 mA. 65 535 stands for a current that is not
    /// measured.
    magnitude: Option<u16> as u16,
    |ma| (ma != u16::MAX).then_some(ma),
    |ma| ma.map_or(u16::MAX, |ma| ma.min(u16::MAX - 1))
}

/// Faults of a motor in a report, by the bits of a byte.
const FAULTS: [Fault; 6] = [
    Fault::BatteryUnknown,
    Fault::EncoderStale,
    Fault::EncoderStuck,
    Fault::EncoderReversed,
    Fault::Overheated,
    Fault::BridgeOff,
];

codec! {
    /// Codec of the [`FAULTS`] of a motor.
    faults: Faults as u8,
    |byte| {
        let mut faults = Faults::NONE;
        let present = bits(byte).into_iter().zip(FAULTS).filter(|(present, _)| *present);
        present.for_each(|(_, fault)| fault.add_to(&mut faults));
        faults
    },
    |faults| byte(FAULTS.map(|fault| fault.is_in(faults)))
}

codec! {
    /// Codec of the points of a scheme. Four zeros stand for `None`.
    points: Option<[Control; 4]> as [i16; 4],
    |points| (points != [0; 4]).then_some(points.map(Control::new)),
    |points| points.map_or([0; 4], |points| points.map(Control::get))
}

/// State of all motors and of the bus.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HubReport {
    /// Time of the control tick since boot, in milliseconds. Wraps at 2^32.
    pub at_ms: u32,
    /// Filtered battery voltage. `None` if the voltage is unknown.
    pub battery: Option<Millivolts>,
    /// Range of the bus voltage.
    pub bus: BusState,
    /// Strength with which braking motors dissipate energy, in 1/1000 of full strength. 0 while they may return all
    /// energy.
    pub dissipate: u16,
    /// State of each of the first four motors. A hub with fewer motors has fewer states.
    pub motors: Vec<MotorReport, CHANNELS>,
    /// Numbers of the newest commands. `None` in a report of version 1.
    pub commands: Option<Commands>,
}

/// Numbers of commands to the motors. Commands are counted from the start of the hub, modulo 2^32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Commands {
    /// Number of the newest command that the report includes.
    pub included: u32,
    /// Number of the newest command that the responder has sent to control for a host. While the next command waits to
    /// be sent, the number is larger by 1.
    pub newest: u32,
}

impl HubReport {
    /// True if the report includes all commands that earlier requests have caused. Also true for a report without
    /// [`Commands`].
    pub fn is_up_to_date(&self) -> bool {
        self.commands.is_none_or(|Commands { included, newest }| is_included(newest, included))
    }
}

/// State of one motor. The default is the state of a disabled motor after a reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MotorReport {
    /// The set-point in force.
    pub setpoint: ReportedSetpoint,
    /// Position in the host's counts.
    pub position: i32,
    /// Velocity in counts per second.
    pub velocity: i16,
    /// Kind of the motor's regulator.
    pub regulator: Kind,
    /// Control value. 0 while the bridge is open.
    pub control: Control,
    /// Regime. `None` while the bridge is open because the motor is disabled, floating or at fault.
    pub regime: Option<Regime>,
    /// Command to the bridge.
    pub drive: Drive,
    /// Mean current, modelled from the motor's constants and the command to the bridge. Limited to 32.767 A.
    pub current: Milliamperes,
    /// Magnitude of the measured mean current in milliamperes, limited to 65 534. `None` without a current-sense line,
    /// with a line that is silent or stuck, and while the bridge is in mode 5/0.
    pub measured_ma: Option<u16>,
    /// Current that would balance load, friction and drag. `None` for an unknown motor, whose dynamics are not
    /// configured.
    pub load: Option<Milliamperes>,
    /// Heat of the winding in 1/1000 of its thermal limit. 0 without a thermal limit.
    pub heat: u16,
    /// True from a host's *set enable* until a host or fail-safe disables the motor.
    pub enabled: bool,
    /// True if the motor has [settled](crate::motor::Report::settled) at its target position, and the report includes
    /// the newest target. A member of a group has settled when all members have.
    pub settled: bool,
    /// True if the motor is regulated, and a mechanical stop or a load keeps the motor from moving.
    pub stalled: bool,
    /// True if the current is limited because the winding is hot.
    pub derated: bool,
    /// True if the motor's current limit reduces the current.
    pub current_limited: bool,
    /// Faults of the motor. With an encoder fault, constant power still works.
    pub faults: Faults,
    /// Points S, T, Z and G of the scheme as control values, at the present speed and battery voltage. `None` if the
    /// battery voltage is unknown.
    pub points: Option<[Control; 4]>,
}

impl MotorReport {
    /// Returns the [best current](best_current) of the motor.
    pub fn best_current(&self) -> Milliamperes {
        best_current(self.current, self.measured_ma.map(|ma| Milliamperes::new(ma.into())))
    }
}

/// The kind of a set-point, with its most important number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReportedSetpoint {
    /// The motor is disabled, or no host has set a target for its mode.
    #[default]
    Off,
    /// The keep-alive timer has run out, and the motor brakes according to its setting `on_fault`. A motor that coasts
    /// according to this setting is `Off`.
    FailSafe,
    /// Constant power, as a control value.
    Power(Control),
    /// Velocity in counts per second.
    Velocity(i32),
    /// Position in the host's counts.
    Position(i32),
    /// Motion in a group. The number is the present reference position in the host's counts.
    Follow(i32),
    /// Constant current.
    Current(Milliamperes),
    /// Identification. The number is the travel limit in counts in either direction.
    Identify(u32),
}

impl ReportedSetpoint {
    /// Returns the name of the kind for users.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::FailSafe => "fail-safe",
            Self::Power(_) => "power",
            Self::Velocity(_) => "velocity",
            Self::Position(_) => "position",
            Self::Follow(_) => "together",
            Self::Current(_) => "current",
            Self::Identify(_) => "identify",
        }
    }

    /// Returns the number of the set-point for users: a share of full power, amperes, counts per second or counts.
    /// `None` for `Off` and `FailSafe`.
    pub fn value(self) -> Option<f64> {
        match self {
            Self::Off | Self::FailSafe => None,
            Self::Power(control) => Some(control.to_f64()),
            Self::Current(current) => Some(f64::from(current.get()) / 1e3),
            Self::Velocity(number) | Self::Position(number) | Self::Follow(number) => Some(number.into()),
            Self::Identify(travel) => Some(travel.into()),
        }
    }
}

impl Field for HubReport {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let version = ByteIn::<1, { u8::MAX }>::read(fields)?.get();
        let (count, stride) = (u8::read(fields)?, ByteIn::<STRIDE, { u8::MAX }>::read(fields)?.get());
        let at_ms = u32::read(fields)?;
        let battery = battery::read(fields)?;
        let (bus, dissipate) = (BusState::read(fields)?, u16::read(fields)?);
        let mut motors = Vec::new();
        for _ in 0..count {
            let of_motor = fields.slice(stride.into())?;
            // Motors beyond the channels of REV's protocol are ignored.
            let _ = motors.push(MotorReport::read(&mut Fields::new(of_motor))?);
        }
        let commands = match version {
            WITH_COMMANDS.. => Some(Commands { included: u32::read(fields)?, newest: u32::read(fields)? }),
            _ => None,
        };
        Ok(Self { at_ms, battery, bus, dissipate, motors, commands })
    }

    fn write(&self, payload: &mut Payload) {
        let version = if self.commands.is_some() { VERSION } else { WITH_COMMANDS - 1 };
        [version, self.motors.len() as u8, STRIDE].write(payload);
        self.at_ms.write(payload);
        battery::write(&self.battery, payload);
        self.bus.write(payload);
        self.dissipate.write(payload);
        self.motors.iter().for_each(|motor| motor.write(payload));
        if let Some(Commands { included, newest }) = self.commands {
            [included, newest].write(payload);
        }
    }
}

fields_in_order!(Drive { mode, duty });

fields_in_order!(MotorReport {
    setpoint,
    position,
    velocity,
    regulator,
    control,
    regime,
    drive,
    current: current,
    measured_ma: magnitude,
    load: load,
    heat,
    [enabled, settled, stalled, derated, current_limited],
    faults: faults,
    points: points
});

impl Field for ReportedSetpoint {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let code = ByteIn::<0, 7>::read(fields)?.get();
        let value = i32::read(fields)?;
        Ok(match code {
            0 => Self::Off,
            1 => Self::FailSafe,
            2 => Self::Power(Control::saturating(value.into())),
            3 => Self::Velocity(value),
            4 => Self::Position(value),
            5 => Self::Follow(value),
            6 => Self::Identify(value.cast_unsigned()),
            _ => Self::Current(Milliamperes::new(value)),
        })
    }

    fn write(&self, payload: &mut Payload) {
        let (code, value) = match *self {
            Self::Off => (0u8, 0),
            Self::FailSafe => (1, 0),
            Self::Power(control) => (2, control.get().into()),
            Self::Velocity(cps) => (3, cps),
            Self::Position(counts) => (4, counts),
            Self::Follow(counts) => (5, counts),
            Self::Identify(travel) => (6, travel.cast_signed()),
            Self::Current(current) => (7, current.get()),
        };
        code.write(payload);
        value.write(payload);
    }
}
