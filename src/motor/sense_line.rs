//! The current-sense line of a motor's bridge: when it shows the motor's current, and whether to believe it.
//!
//! A bridge of the VNH5019 kind senses in its high-side switches (data sheet Doc ID 15701, tables 9 and 11): in 9/8 and 6/2
//! one of them is closed throughout the period, for the duty and for freewheeling, so that the line shows the motor's
//! current in both, and its mean is the motor's. In 5/0 none is closed, and the line shows nothing whatever flows: there the
//! current by the motor's constants goes on. Which chip it is makes 0.7 to 1.5 of what is shown, at 3 A and below.

use crate::bridge::Mode;
use crate::units::Milliamperes;

/// What is thought of a motor's current-sense line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SenseLine {
    /// There is none, or its converter does not answer.
    #[default]
    Absent,
    /// It is believed.
    Sound,
    /// Nothing is on it where by the motor's constants a current flows: it is broken, or a lead of the motor is. It is not
    /// believed.
    Silent,
    /// A current is on it where the bridge can show none. It is not believed.
    Stuck,
    /// Far more is on it than could flow by the motor's constants: these are another motor's, or the winding is shorted.
    /// It is believed.
    Excessive,
}

/// So often in a row a line must contradict what is thought of it.
const CONVINCED: u8 = 4;

/// Less is nothing: a converter's offset, but no motor that turns takes as little.
const NOTHING_MA: u32 = 50;
/// Where by its constants a motor takes so much, something must be seen of it.
const DUE_MA: u32 = 1_000;
/// What a bridge that shorts or opens its motor shows, at most: leakage.
const LEAKAGE_MA: u32 = 300;

/// More than a bridge that shows half as much again, and a motor of twice the current, could make of a modelled one.
const fn most(modelled_ma: u32) -> u32 {
    modelled_ma.saturating_mul(3).saturating_add(2_000)
}

/// One motor's line.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Line {
    is: SenseLine,
    doubts: u8,
    /// Of the bridge at the last sample.
    mode: Option<Mode>,
    shown: Option<Milliamperes>,
    /// So often, up to [`CONVINCED`], it has shown a current. A line that has not may be one to ground: nothing is no
    /// measurement of it.
    shows: u8,
}

impl Line {
    /// A sample. `mode` is the bridge's now, `None` where it changes from one period of a few milliseconds to the next;
    /// `modelled` the current by the motor's constants, `None` if nobody knows how fast it turns.
    pub(super) fn step(
        &mut self,
        shown: Option<Milliamperes>,
        mode: Option<Mode>,
        modelled: Option<Milliamperes>,
    ) {
        // One that has changed since the sample before may have done so just now.
        let settled = mode.filter(|_| mode == self.mode);
        (self.mode, self.shown) = (mode, None);
        let Some(current) = shown else {
            (self.is, self.doubts, self.shows) = (SenseLine::Absent, 0, 0);
            return;
        };
        if self.is == SenseLine::Absent {
            self.is = SenseLine::Sound;
        }
        let Some(mode) = settled else { return };
        let magnitude = current.get().unsigned_abs();
        let seems = if mode == Mode::Brake50 {
            Some(at_rest(magnitude))
        } else {
            let shows = magnitude >= NOTHING_MA;
            self.shows = CONVINCED.min(self.shows + u8::from(shows));
            self.shown = shown.filter(|_| shows || self.shows == CONVINCED);
            modelled.and_then(|modelled| driving(magnitude, modelled.get().unsigned_abs()))
        };
        if let Some(seems) = seems {
            self.weigh(seems, mode == Mode::Brake50);
        }
    }

    /// What is thought of it now.
    pub(super) const fn is(&self) -> SenseLine {
        self.is
    }

    /// Magnitude of the motor's mean current while its bridge is in this mode, if the line shows it and is believed.
    pub(super) fn measured(&self, mode: Mode) -> Option<Milliamperes> {
        let believed = matches!(self.is, SenseLine::Sound | SenseLine::Excessive);
        self.shown.filter(|_| believed && self.mode == Some(mode))
    }

    /// What a line does at rest proves nothing of one that is silent, and the other way round.
    fn weigh(&mut self, seems: SenseLine, at_rest: bool) {
        let proves = match self.is {
            SenseLine::Stuck => at_rest,
            SenseLine::Silent | SenseLine::Excessive => !at_rest || seems == SenseLine::Stuck,
            SenseLine::Absent | SenseLine::Sound => true,
        };
        if seems == self.is || !proves {
            self.doubts = 0;
            return;
        }
        self.doubts += 1;
        if self.doubts >= CONVINCED {
            (self.is, self.doubts) = (seems, 0);
            if matches!(seems, SenseLine::Silent | SenseLine::Stuck) {
                self.shows = 0;
            }
        }
    }
}

/// In 5/0.
const fn at_rest(ma: u32) -> SenseLine {
    if ma > LEAKAGE_MA { SenseLine::Stuck } else { SenseLine::Sound }
}

/// A motor that takes less than it should may be another one; only nothing at all is a broken line, and where little is due
/// it proves nothing.
const fn driving(ma: u32, modelled_ma: u32) -> Option<SenseLine> {
    match (ma < NOTHING_MA, modelled_ma >= DUE_MA) {
        (true, true) => Some(SenseLine::Silent),
        (true, false) => None,
        (false, _) if ma > most(modelled_ma) => Some(SenseLine::Excessive),
        (false, _) => Some(SenseLine::Sound),
    }
}
