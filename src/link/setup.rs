//! What the protocol has no words for: which motor a channel drives, and what its control values mean.
//!
//! An interface of this hub's own beside the one that hosts know; a host that does not ask for it by its
//! name, [`INTERFACE`], never meets it. Nothing of it outlasts a reset.
//!
//! | type | payload | answer |
//! |---|---|---|
//! | [`FIRST`] set up a motor | motor, then the fields of a [`Setup`] | ACK |
//! | [`FIRST`] + 1 read it back | motor | the fields |
//!
//! | field | |
//! |---|---|
//! | i32 | back-EMF constant, mV s/count in steps of 2^-20, above 0 and below 32 |
//! | u16 | winding resistance, milliohms, from 1; 0, with linear duty only, leaves the winding as it is known |
//! | u16 | winding inductance, microhenries, 0 if unknown |
//! | u8 | scheme: 0 forward and reverse only, 1 A, 2 B, 3 C, 4 D with automatic blend, 5 D |
//! | u16 | blend of the last, in steps of 2^-16 |
//! | u8 | duty: 0 linear, as in the paper; 1 such that current is linear |

use super::fields::{Fields, Nack};
use crate::braking::{Blend, BlendFraction, DutyRule, Scheme, Winding};
use crate::motor::Settings;
use crate::units::EmfConstant;

/// The name to ask for.
pub const INTERFACE: &[u8] = b"MOTOR_HUB";

/// The type of the interface's function 0.
pub const FIRST: u16 = 0x4D00;

/// Functions of the interface.
pub const COUNT: u16 = 2;

/// A motor, and how it is controlled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setup {
    /// Its back EMF per encoder speed.
    pub emf: EmfConstant,
    /// Its winding's resistance in milliohms; 0, with linear duty only, for a winding as it is known.
    pub resistance_mohm: u16,
    /// Its winding's inductance in microhenries; 0 if unknown.
    pub inductance_uh: u16,
    /// Where S, T, Z and G lie.
    pub scheme: Scheme,
    /// Duties such that current is linear, not duties that are linear themselves.
    pub linear_current: bool,
}

impl Setup {
    /// Reads its fields, of which the first is the payload's second.
    ///
    /// # Errors
    /// The first that is missing or out of range.
    pub fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let emf = fields.i32_as(|bits| EmfConstant::from_bits(bits).ok())?;
        let (resistance_mohm, inductance_uh) = (fields.u16()?, fields.u16()?);
        let code = fields.u8_in(0..=5)?;
        let blend = fields.u16_as(|bits| BlendFraction::from_bits(bits.into()).ok())?;
        let scheme = match code {
            0 => Scheme::ForwardReverse,
            1 => Scheme::A,
            2 => Scheme::B,
            3 => Scheme::C,
            4 => Scheme::D(Blend::Automatic),
            _ => Scheme::D(Blend::Fixed(blend)),
        };
        let linear_current = fields.flag()?;
        if linear_current && resistance_mohm == 0 {
            return Err(Nack::Parameter(2));
        }
        Ok(Self { emf, resistance_mohm, inductance_uh, scheme, linear_current })
    }

    /// As these settings have it.
    pub fn of(settings: &Settings) -> Self {
        let Settings { winding, scheme, duty, .. } = settings;
        Self {
            emf: winding.emf(),
            resistance_mohm: winding.resistance_mohm(),
            inductance_uh: winding.inductance_uh().unwrap_or(0),
            scheme: *scheme,
            linear_current: *duty == DutyRule::LinearCurrent,
        }
    }

    /// Its fields.
    pub const fn bytes(self) -> [u8; 12] {
        let (code, blend) = match self.scheme {
            Scheme::ForwardReverse => (0, 0),
            Scheme::A => (1, 0),
            Scheme::B => (2, 0),
            Scheme::C => (3, 0),
            Scheme::D(Blend::Automatic) => (4, 0),
            Scheme::D(Blend::Fixed(blend)) => (5, blend.to_bits()),
        };
        let [e0, e1, e2, e3] = self.emf.to_bits().to_le_bytes();
        let [r0, r1] = self.resistance_mohm.to_le_bytes();
        let [l0, l1] = self.inductance_uh.to_le_bytes();
        // 1, which is Scheme C, is as near as 16 bits come.
        let [b0, b1] = if blend > u16::MAX as u32 { [u8::MAX; 2] } else { (blend as u16).to_le_bytes() };
        [e0, e1, e2, e3, r0, r1, l0, l1, code, b0, b1, self.linear_current as u8]
    }

    /// Settings for it, with the coefficients that go with it; what zero means is kept, and what is known
    /// of the bridge.
    pub(super) fn settings(self, present: &Settings) -> Settings {
        let Self { emf, resistance_mohm, inductance_uh, scheme, linear_current } = self;
        // The only fault of a winding is to have no resistance.
        let winding = Winding::new(emf, resistance_mohm, Some(inductance_uh))
            .unwrap_or_else(|_| present.winding.with_emf(emf));
        let duty = if linear_current { DutyRule::LinearCurrent } else { DutyRule::LinearDuty };
        let Settings { bridge, zero_power, .. } = *present;
        Settings { bridge, duty, zero_power, ..Settings::for_scheme(winding, scheme) }
    }
}
