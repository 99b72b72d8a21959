//! What the protocol has no words for: which motor a channel drives, and what its control values mean.
//!
//! An interface of this hub's own beside the one that hosts know; a host that does not ask for it by its
//! name, `MOTOR_HUB`, never meets it. Nothing of it outlasts a reset unless it is [stored](super::store).
//!
//! | function | payload | answer |
//! |---|---|---|
//! | 0 set up a motor | motor, then the fields of a [`Setup`] | ACK |
//! | 1 read it back | motor | the fields |
//! | 2 say how the motor moves | motor, then the fields of a [`Motion`] | ACK |
//! | 3 read it back | motor | the fields |
//! | 4 learn how the motor moves | motor, then u32, the most counts it may turn either way | u32, the most that it will |
//! | 5 tell what came of that | motor | the fields of an [`Identification`] |
//!
//! | 6, 7 | of motors that move in step, see [`group`](super::group) | |
//! | 8 say what protects the motor | motor, then the fields of a [`Protection`] | ACK |
//! | 9 read it back | motor | the fields |
//! | 10 tell how the motor and its bridge are | motor | the fields of a [`Condition`] |
//! | 11 say how the motor's bridge switches | motor, then the fields of a [`Timing`] | ACK |
//! | 12 read it back | motor | the fields |
//! | 13 | of the bus, see [`bus`](super::bus) | |
//! | 14 to 17 | of what is stored, see [`store`](super::store) | |
//! | 18, 19 | of what happened, see [`record`](super::record) | |
//! | 20 | of all motors at once, see [`report`](super::report) | |
//! | 21 to 27 | of new firmware, see [`update`](super::update) | |
//!
//! Function 4 is refused (51) unless the motor is enabled, in constant power of 0; any other target, mode or
//! disabling ends the motion. From then on function 5 answers of that motion only. What is found is told, not put in force: that is function 2.
//!
//! The time constants of a bridge belong to the board; what they are for a real VNH5019 is
//! [`Timing::VNH5019`]. A set-up leaves them, and what protects the motor: who connects another one says anew what
//! its winding stands.
//!
//! A set-up forgets how the motor moved and the coefficients that a host gave: it is another motor.
//! Of a set-up:
//!
//! | field | |
//! |---|---|
//! | i32 | back-EMF constant, mV s/count in steps of 2^-20, above 0 and below 32 |
//! | u16 | winding resistance, milliohms, from 1; 0, with linear duty only, leaves the winding as it is known |
//! | u16 | winding inductance, microhenries, 0 if unknown |
//! | u8 | scheme: 0 forward and reverse only, 1 A, 2 B, 3 C, 4 D with automatic blend, 5 D |
//! | u16 | blend of the last, in steps of 2^-16 |
//! | u8 | duty: 0 linear, as in the paper; 1 such that current is linear |
//!
//! Of a motion:
//!
//! | field | |
//! |---|---|
//! | u32 | acceleration per volt, counts/s² in steps of 1/256; 0 if nothing is known of the motor |
//! | u32 | rate of decay, 1/s in steps of 2^-16 |
//! | u16 | friction, mV |
//! | u32 | largest acceleration, counts/s²; 0 for what the battery gives |
//!
//! Of a protection:
//!
//! | field | |
//! |---|---|
//! | u8 | on a fault, and when the host falls silent: 0 coast, 1 brake |
//! | u16 | current that the winding stands for ever, mA; 0 for no limit |
//! | u16, u16 | time constants of winding and case, s, from 1; with no limit they mean nothing |
//!
//! Of a timing:
//!
//! | field | |
//! |---|---|
//! | u16, u16 | shortest time for which the PWM line may be low, and high, ns; 0 for any |
//! | u16, u16 | how long an output takes when it rises, and when it falls, ns |
//! | u16 | how long the bridge is open when its mode changes, us |
//!
//! Of a condition:
//!
//! | field | |
//! |---|---|
//! | i32 | mean current by the motor's constants, mA |
//! | bool, u16 | it is measured; magnitude of the mean current as measured, mA |
//! | u16 | heat of the winding, in 1/1000 of its limit; 0 without one |
//! | bool | its current is limited because it is hot |
//! | bool | it was switched off because it got too hot all the same |
//! | bool | its bridge switched itself off |
//! | u8 | its current-sense line: 0 none, 1 sound, 2 silent though a current is due, 3 stuck, 4 far above what could flow; of 2 and 3 nothing is measured |
//!
//! Of an identification, where what follows the code is left out unless the code asks for it:
//!
//! | field | |
//! |---|---|
//! | u8 | 0 there was none, 1 it is under way, 2 the motor is known, 3 it is not |
//! | u8 | of 1: percent; of 3: why, by the order of [`Refusal`], from 0 |
//! | u32, u32, u16 | of 2: as the first three of a motion |
//! | i32 | of 2: back EMF and drag together, mV s/count in steps of 2^-20 |
//! | bool | of 2: that is as told, not found |
//! | u16, u16, u16 | of 2: standard errors of the first, the second and the back EMF, in 1/1000 of each |
//! | u16 | of 2: standard error of the friction, mV |
//! | u16 | of 2: what is left of the changes of speed, in 1/1000 of them |
//!
//! ```
//! use motor_hub::braking::{DutyRule, Scheme};
//! use motor_hub::protocol::setup::{Setup, ToSetup};
//! use motor_hub::units::{EmfConstant, Inductance, Resistance};
//!
//! // An AM 60 A, Scheme B, linear current, on channel 2.
//! let setup = Setup {
//!     emf: EmfConstant::from_bits(4_180_575).unwrap(),
//!     resistance: Resistance::from_milliohms(3_300).ok(),
//!     inductance: Inductance::from_microhenries(694).ok(),
//!     scheme: Scheme::B,
//!     duty: DutyRule::LinearCurrent,
//! };
//! let request = ToSetup::SetUp { setup }.to(2);
//! assert_eq!(request.id(), 0x4D00);
//! assert_eq!(*request.payload(), [2, 0x5F, 0xCA, 0x3F, 0, 0xE4, 0x0C, 0xB6, 2, 2, 0, 0, 1]);
//! ```

use super::fields::{ByteIn, Field, Fields, Payload, codes};
use super::nack::Nack;
use super::table::requests;
use crate::braking::{Blend, BlendFraction, DutyRule, Scheme};
use crate::bridge::Timing;
use crate::motor::{OnFault, SenseLine, ThermalLimit};
use crate::regulator::Dynamics;
use crate::regulator::identify::{Identification, Identified, Refusal};
use crate::units::{
    Acceleration, AccelerationPerVolt, DecayRate, EmfConstant, Inductance, Milliamperes, Millivolts,
    Resistance,
};

/// The type of the interface's function 0.
pub const FIRST_FUNCTION: u16 = 0x4D00;

/// Functions of the interface.
pub const FUNCTION_COUNT: u16 = 28;

requests! {
    /// A request to one motor, whose number goes before the fields.
    pub enum ToSetup {
        0 SetUp { setup: Setup },
        /// Answered by a [`Setup`].
        1 Setup,
        2 SetMotion { motion: Motion },
        /// Answered by a [`Motion`].
        3 Motion,
        /// In counts, either way. Answered by a u32, the counts that it will turn at most.
        4 Identify { travel_limit: u32 },
        /// Answered by an [`Identification`].
        5 Identification,
        8 SetProtection { protection: Protection },
        /// Answered by a [`Protection`].
        9 Protection,
        /// Answered by a [`Condition`].
        10 Condition,
        11 SetTiming { timing: Timing },
        /// Answered by a [`Timing`].
        12 Timing,
    }
}

/// A motor, and how it is controlled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setup {
    /// Its back EMF per encoder speed.
    pub emf: EmfConstant,
    /// Its winding's resistance; `None`, with linear duty only, for a winding as it is known.
    pub resistance: Option<Resistance>,
    /// Its winding's inductance, if known.
    pub inductance: Option<Inductance>,
    /// Where S, T, Z and G lie.
    pub scheme: Scheme,
    /// How the duty is found within a regime.
    pub duty: DutyRule,
}

/// How a motor moves, and how it may.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Motion {
    /// How it answers to a voltage; `None` if that is not known, and PID is to regulate it.
    pub dynamics: Option<Dynamics>,
    /// Its largest acceleration; `None` for what the battery gives.
    pub acceleration: Option<Acceleration>,
}

/// What keeps a motor, and what it moves, from harm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Protection {
    /// What a fault does to it.
    pub on_fault: OnFault,
    /// What its winding stands; `None` for no limit.
    pub thermal: Option<ThermalLimit>,
}

/// How a motor and its bridge are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Condition {
    /// Mean current by the motor's constants.
    pub current: Milliamperes,
    /// Magnitude of the mean current in milliamperes, where it is measured.
    pub measured_ma: Option<u16>,
    /// Of the winding: 1000 at its limit, 0 without one.
    pub heat: u16,
    /// So hot that its current is limited.
    pub derated: bool,
    /// It got too hot all the same, and was switched off.
    pub overheated: bool,
    /// The bridge has switched itself off.
    pub bridge_fault: bool,
    /// What is thought of its current-sense line.
    pub sense_line: SenseLine,
}

codes!(SenseLine { 0 = Absent, 1 = Sound, 2 = Silent, 3 = Stuck, 4 = Excessive });

codes!(OnFault { 0 = Coast, 1 = Brake });

codes!(Refusal {
    0 = Stopped,
    1 = Interrupted,
    2 = NotAtRest,
    3 = TravelLimit,
    4 = Battery,
    5 = TooFar,
    6 = NoCounts,
    7 = Backwards,
    8 = Load,
    9 = Spring,
    10 = Uneven,
    11 = Unsure,
    12 = Implausible
});

impl Field for Identification {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Ok(match ByteIn::<0, 3>::read(fields)?.get() {
            0 => Self::None,
            1 => Self::Running(ByteIn::<0, 99>::read(fields)?.get()),
            2 => Self::Found(Identified::read(fields)?),
            _ => Self::Refused(Refusal::read(fields)?),
        })
    }

    fn write(&self, payload: &mut Payload) {
        match self {
            Self::None => 0u8.write(payload),
            Self::Running(percent) => [1, *percent].write(payload),
            Self::Found(found) => {
                2u8.write(payload);
                found.write(payload);
            }
            Self::Refused(why) => {
                3u8.write(payload);
                why.write(payload);
            }
        }
    }
}

impl Field for Identified {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Ok(Self {
            dynamics: Dynamics {
                gain: fields.checked(|bits| AccelerationPerVolt::from_bits(bits).ok())?,
                decay: DecayRate::from_bits(u32::read(fields)?),
                friction: Millivolts::new(u16::read(fields)?),
            },
            emf: fields.checked(|bits| EmfConstant::from_bits(bits).ok())?,
            emf_is_told: bool::read(fields)?,
            gain_error: u16::read(fields)?,
            decay_error: u16::read(fields)?,
            emf_error: u16::read(fields)?,
            friction_error: Millivolts::new(u16::read(fields)?),
            residual: u16::read(fields)?,
        })
    }

    fn write(&self, payload: &mut Payload) {
        let Dynamics { gain, decay, friction } = self.dynamics;
        [gain.to_bits(), decay.to_bits()].write(payload);
        friction.get().write(payload);
        self.emf.to_bits().write(payload);
        self.emf_is_told.write(payload);
        let friction_error = self.friction_error.get();
        [self.gain_error, self.decay_error, self.emf_error, friction_error, self.residual].write(payload);
    }
}

impl Field for Motion {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let gain = AccelerationPerVolt::from_bits(u32::read(fields)?).ok();
        let decay = DecayRate::from_bits(u32::read(fields)?);
        let friction = Millivolts::new(u16::read(fields)?);
        let acceleration = Acceleration::new(u32::read(fields)?).ok();
        let dynamics = gain.map(|gain| Dynamics { gain, decay, friction });
        Ok(Self { dynamics, acceleration })
    }

    fn write(&self, payload: &mut Payload) {
        self.dynamics.map_or(0, |known| known.gain.to_bits()).write(payload);
        self.dynamics.map_or(0, |known| known.decay.to_bits()).write(payload);
        self.dynamics.map_or(0, |known| known.friction.get()).write(payload);
        self.acceleration.map_or(0, Acceleration::get).write(payload);
    }
}

impl Field for Protection {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let on_fault = OnFault::read(fields)?;
        let continuous_ma = u16::read(fields)?;
        let winding_s = u16::read(fields)?;
        let thermal = fields.checked(|case_s| match continuous_ma {
            0 => Some(None),
            _ => ThermalLimit::new(continuous_ma, winding_s, case_s).ok().map(Some),
        })?;
        Ok(Self { on_fault, thermal })
    }

    fn write(&self, payload: &mut Payload) {
        self.on_fault.write(payload);
        let limit = self.thermal.as_ref();
        limit.map_or([0; 3], |of| [of.continuous_ma(), of.winding_s(), of.case_s()]).write(payload);
    }
}

impl Field for Timing {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let [least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, change_us] = Field::read(fields)?;
        Ok(Self { least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, change_us })
    }

    fn write(&self, payload: &mut Payload) {
        let Self { least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, change_us } = *self;
        [least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, change_us].write(payload);
    }
}

impl Field for Condition {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let current = Milliamperes::new(i32::read(fields)?);
        let (is_measured, measured_ma) = (bool::read(fields)?, u16::read(fields)?);
        let heat = u16::read(fields)?;
        let [derated, overheated, bridge_fault] = <[bool; 3]>::read(fields)?;
        let measured_ma = is_measured.then_some(measured_ma);
        let sense_line = SenseLine::read(fields)?;
        Ok(Self { current, measured_ma, heat, derated, overheated, bridge_fault, sense_line })
    }

    fn write(&self, payload: &mut Payload) {
        self.current.get().write(payload);
        self.measured_ma.is_some().write(payload);
        [self.measured_ma.unwrap_or_default(), self.heat].write(payload);
        [self.derated, self.overheated, self.bridge_fault].write(payload);
        self.sense_line.write(payload);
    }
}

impl Field for Setup {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let emf = fields.checked(|bits| EmfConstant::from_bits(bits).ok())?;
        let resistance = Resistance::from_milliohms(u16::read(fields)?).ok();
        let inductance = Inductance::from_microhenries(u16::read(fields)?).ok();
        let code = ByteIn::<0, 5>::read(fields)?;
        let blend = fields.checked(|bits: u16| BlendFraction::from_bits(bits.into()).ok())?;
        let scheme = match code.get() {
            0 => Scheme::ForwardReverse,
            1 => Scheme::A,
            2 => Scheme::B,
            3 => Scheme::C,
            4 => Scheme::D(Blend::Automatic),
            _ => Scheme::D(Blend::Fixed(blend)),
        };
        let duty = if bool::read(fields)? { DutyRule::LinearCurrent } else { DutyRule::LinearDuty };
        if duty == DutyRule::LinearCurrent && resistance.is_none() {
            return Err(Nack::parameter(2));
        }
        Ok(Self { emf, resistance, inductance, scheme, duty })
    }

    fn write(&self, payload: &mut Payload) {
        let (code, blend) = match self.scheme {
            Scheme::ForwardReverse => (0u8, 0),
            Scheme::A => (1, 0),
            Scheme::B => (2, 0),
            Scheme::C => (3, 0),
            Scheme::D(Blend::Automatic) => (4, 0),
            // 1, which is Scheme C, is as near as 16 bits come.
            Scheme::D(Blend::Fixed(blend)) => (5, u16::try_from(blend.to_bits()).unwrap_or(u16::MAX)),
        };
        self.emf.to_bits().write(payload);
        self.resistance.map_or(0, Resistance::as_milliohms).write(payload);
        self.inductance.map_or(0, Inductance::as_microhenries).write(payload);
        code.write(payload);
        blend.write(payload);
        (self.duty == DutyRule::LinearCurrent).write(payload);
    }
}
