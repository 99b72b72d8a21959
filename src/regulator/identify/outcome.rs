//! Outcome of an identification.

use super::super::Dynamics;
use crate::units::{EmfConstant, Millivolts};
use core::fmt;

/// State or result of the last identification of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Identification {
    /// No identification has been started since the hub started.
    #[default]
    None,
    /// An identification runs; its progress is 0 to 99 percent.
    Running(u8),
    /// The motor's constants were found.
    Found(Identified),
    /// No constants were found, for this reason.
    Refused(Refusal),
}

/// Constants that an identification has found. All errors are standard errors, for residuals that do not correlate.
/// Errors in 1/1000 saturate at 65 535.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Identified {
    /// Dynamics of the motor with its load.
    pub dynamics: Dynamics,
    /// Back EMF constant that would damp the motor as much as back EMF and drag do together: q / b.
    pub emf: EmfConstant,
    /// True if the motion was too short to find the decay: `emf` is then the configured back EMF, and the decay is b
    /// times this back EMF.
    pub emf_is_configured: bool,
    /// Error of the acceleration per volt, in 1/1000 of the acceleration per volt.
    pub gain_error: u16,
    /// Error of the decay found from the motion, in 1/1000 of the decay.
    pub decay_error: u16,
    /// Error of the back EMF found from the motion, in 1/1000 of the back EMF.
    pub emf_error: u16,
    /// Error of the friction.
    pub friction_error: Millivolts,
    /// Residual of the motor's equation, in 1/1000 of the changes of speed (both root mean square).
    pub residual: u16,
}

/// Reason for which an identification found no constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// Another set-point stopped the identification.
    Stopped,
    /// A fault of the motor ended the identification, or no sample of the encoder came.
    Interrupted,
    /// The motor turned before it was driven.
    NotAtRest,
    /// The travel limit leaves too short a motion.
    TravelLimit,
    /// The battery voltage is below 6 V, or sags by more than 30 %.
    Battery,
    /// The motor turned further than announced.
    TooFar,
    /// No counts came in the first two phases: a stop holds the motor, the motor is jammed or too heavy, or the encoder
    /// is unplugged.
    NoCounts,
    /// The motor turned against the voltage: its encoder is reversed, or a load overpowers it.
    Backwards,
    /// A load pulls at the motor all the time, as gravity does.
    Load,
    /// A load pulls the motor back, more with distance, as a spring does.
    Spring,
    /// The motion does not fit a motor with inertia, drag and friction: the motor met a stop, the load changes with the
    /// position, or counts were lost.
    PoorFit,
    /// The motion has too few counts for an error below 10 %.
    Inaccurate,
    /// A constant found is out of its range, or the back EMF is implausible. An implausible back EMF is below 0.7 times
    /// or above 8 times the configured back EMF, by more than two standard errors.
    Implausible,
    /// The motor turned in the first two phases, but no counts came at the low voltage of the last phase.
    HeldAtLowVoltage,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stopped => "another request ended the identification",
            Self::Interrupted => {
                "a fault ended the identification: see the motor's faults (encoder, battery, bridge, heat), then repeat"
            }
            Self::NotAtRest => {
                "the motor was not at rest before the motion: wait until the motor stands, or remove a load that turns \
                 it, such as a hanging weight"
            }
            Self::TravelLimit => "the travel limit makes the motion too short: allow more travel",
            Self::Battery => "the battery is below 6 V or sags by more than 30 %: charge the battery",
            Self::TooFar => {
                "the motor turned further than announced: check that the configured winding belongs to this motor"
            }
            Self::NoCounts => {
                "the encoder did not count: a stop, a jam, too heavy a load, or an unplugged encoder"
            }
            Self::Backwards => "the motor turned against the voltage: a reversed encoder or an overpowering load",
            Self::Load => "a constant load drives the motor, as gravity does",
            Self::Spring => {
                "a spring drives the motor back, because the load grows with the distance; or the configured winding is \
                 not this motor's"
            }
            Self::PoorFit => {
                "the motion does not fit a motor with inertia, drag and friction: an obstacle, a load that changes \
                 with the position, backlash or a soft shaft before a heavy load, lost counts, or the configured \
                 winding of another motor"
            }
            Self::Inaccurate => "the motion has too few counts for an error below 10 %",
            Self::Implausible => {
                "a constant found is implausible: configure the right motor, or check its gear and encoder"
            }
            Self::HeldAtLowVoltage => {
                "the motor turned at 65 % of the battery voltage, but not at 29 %: much friction, a constant load, a low \
                 battery, or an encoder that was unplugged while the motor turned"
            }
        })
    }
}

impl core::error::Error for Refusal {}
