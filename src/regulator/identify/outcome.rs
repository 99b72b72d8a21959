//! What an identification says.

use super::super::Dynamics;
use crate::units::{EmfConstant, Millivolts};
use core::fmt;

/// What has become of the last identification of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
// Whole words: it is copied at every tick, with every report, and byte by byte if what it holds begins within one.
#[repr(u32)]
pub enum Identification {
    /// There was none since the hub's reset.
    #[default]
    None,
    /// It is under way, and so far: 0 to 99 percent.
    Running(u8),
    /// The motor is known.
    Found(Identified),
    /// It is not.
    Refused(Refusal),
}

/// What was found. The errors are standard errors, as if what is left of one row had nothing to do with
/// what is left of another; those in 1/1000 end at 65 535.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Identified {
    /// The motor with its load.
    pub dynamics: Dynamics,
    /// The back EMF per speed that would damp the motor as back EMF and drag do together: q / b.
    pub emf: EmfConstant,
    /// The motion was too short to tell the decay: it is b times the back EMF that the hub was told.
    pub emf_is_told: bool,
    /// Error of the acceleration per volt, in 1/1000 of it.
    pub gain_error: u16,
    /// Error of the decay as the motion told it, in 1/1000 of it.
    pub decay_error: u16,
    /// Error of the back EMF as the motion told it, in 1/1000 of it.
    pub emf_error: u16,
    /// Error of the friction.
    pub friction_error: Millivolts,
    /// What the motor's equation leaves of the changes of speed, root mean square, in 1/1000 of those.
    pub residual: u16,
}

/// Why a motor is not known after all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// Something else was asked of the motor.
    Stopped,
    /// Encoder or battery could not be read.
    Interrupted,
    /// The motor turned before it was driven.
    NotAtRest,
    /// The travel limit leaves too short a motion.
    TravelLimit,
    /// The battery is below 6 V, or sags by more than 30 %.
    Battery,
    /// The motor went further than was announced.
    TooFar,
    /// No counts came: a stop holds the motor, it is jammed or too heavy, or the encoder is unplugged.
    NoCounts,
    /// The motor turned against the voltage: its encoder is reversed, or a load overpowers it.
    Backwards,
    /// Something pulls at the motor all the time, as gravity does.
    Load,
    /// Something pulls the motor back, the more the further it goes.
    Spring,
    /// The motor did not move as one with inertia, drag and friction does: it met something on its way, its
    /// load changes with its position, or counts were lost.
    Uneven,
    /// Too little was seen of the motion to be sure within 10 %.
    Unsure,
    /// What was found is no motor: its back EMF would be less than 0.7 times what the hub was told, or more than
    /// 8 times.
    Implausible,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stopped => "something else was asked of the motor",
            Self::Interrupted => "encoder or battery could not be read",
            Self::NotAtRest => "the motor turned before it was driven",
            Self::TravelLimit => "the travel limit leaves too short a motion",
            Self::Battery => "the battery is below 6 V or sags by more than 30 %",
            Self::TooFar => "the motor went further than announced",
            Self::NoCounts => {
                "no counts came: a stop, a jam, too heavy a load, or the encoder is unplugged"
            }
            Self::Backwards => "the motor turned against the voltage: a reversed encoder or an overpowering load",
            Self::Load => "something pulls at the motor all the time, as gravity does",
            Self::Spring => "something pulls the motor back, the more the further it goes",
            Self::Uneven => {
                "it did not move as a motor with inertia, drag and friction does: something in its way, a load \
                 that changes with the position, or lost counts"
            }
            Self::Unsure => "too little was seen of the motion to be sure within 10 %",
            Self::Implausible => "the back EMF found is not that of the motor that the hub was told of",
        })
    }
}

impl core::error::Error for Refusal {}
