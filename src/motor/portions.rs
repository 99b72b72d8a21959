//! Braking that returns nothing to the bus, in portions: a full short, which burns all in the winding and brakes more than
//! was asked, and driving a little beyond the back EMF, which takes from the bus what windings give back between the two.
//! Over some milliseconds it is the braking that was asked for: volt seconds are kept account of.
//!
//! (Nothing else is left: proportional braking returns what it does not burn, and so does an open bridge when it opens;
//! reverse driving returns nothing, but brakes more than a short does.)

use crate::units::Micros;
use crate::units::single::{at_least, at_most};
use libm::sqrtf;

/// A portion is over when the motor has been braked so long too much, or too little, by its whole back EMF: long enough for
/// what a winding gives back to be little, and for a bridge to change its mode; short enough for the speed not to waver.
const PORTION_MICROS: f32 = 1_500.0;

/// Portions that are made up for if they could not be given.
const MADE_UP: f32 = 4.0;

/// What a motor is given now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Portion {
    Short,
    Drive,
}

/// The account of one motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Portions {
    until: Micros,
    /// Braked too much until then, in volts times microseconds.
    surplus: f32,
    /// Since then, in volts across the motor.
    given: Given,
    /// `None` while it is given what was asked for; the account is kept meanwhile.
    now: Option<Portion>,
    /// What was given last when it was driven.
    driven: f32,
}

/// What was asked for, what is given instead, and the motor's back EMF, all in volts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Given {
    pub(super) wanted: f32,
    pub(super) given: f32,
    pub(super) emf: f32,
}

impl Given {
    const NONE: Self = Self { wanted: 0.0, given: 0.0, emf: 0.0 };
}

impl Portions {
    /// Of a motor that has been given what was asked for.
    pub(super) const NEW: Self =
        Self { until: Micros::new(0), surplus: 0.0, given: Given::NONE, now: None, driven: 0.0 };

    /// The motor is driven meanwhile.
    pub(super) fn drives(&self) -> bool {
        self.now == Some(Portion::Drive)
    }

    /// The motor is given portions.
    pub(super) const fn are_given(&self) -> bool {
        self.now.is_some()
    }

    /// It is given what was asked for.
    pub(super) fn end(&mut self, now: Micros) {
        self.pass(now);
        (self.given, self.now) = (Given::NONE, None);
    }

    /// The account is closed: what is asked for is no braking.
    pub(super) const fn close(&mut self) {
        *self = Self::NEW;
    }

    /// So it went on until now.
    pub(super) fn pass(&mut self, now: Micros) {
        let passed = now.since(self.until) as u32;
        self.until = self.until.max(now);
        let Given { wanted, given, emf } = self.given;
        self.surplus += along(wanted - given, emf) * passed as f32;
    }

    /// The next portion of a motor of this back EMF, which may end a short only in its turn.
    pub(super) fn next(&mut self, emf: f32, turn: bool) -> Portion {
        let most = PORTION_MICROS * emf.abs();
        // What could not be given for a while is not made up for.
        self.surplus = at_most(at_least(self.surplus, -MADE_UP * most), MADE_UP * most);
        match self.now {
            None | Some(Portion::Short) if turn && self.surplus > most => Portion::Drive,
            Some(Portion::Drive) if self.surplus >= -most => Portion::Drive,
            _ => Portion::Short,
        }
    }

    /// From now on this is given. To change takes so many microseconds, in which the bridge is open.
    pub(super) fn give(&mut self, portion: Portion, given: Given, change_us: u16) {
        if portion != self.now.unwrap_or(Portion::Short) {
            self.surplus += along(given.given - given.emf, given.emf) * f32::from(change_us);
        }
        if portion == Portion::Drive {
            self.driven = given.given;
        }
        (self.given, self.now) = (given, Some(portion));
    }

    /// Volts across the motor.
    pub(super) const fn given(&self) -> f32 {
        self.given.given
    }

    /// The volts behind the current that heats the winding as much as its portions do: more than behind their mean.
    pub(super) fn heating(&self) -> f32 {
        let Given { wanted, emf, .. } = self.given;
        let driven = self.driven / emf;
        let drives = if driven > 1.0 { (wanted / emf) / driven } else { 0.0 };
        emf.abs() * sqrtf(1.0 - drives + drives * (driven - 1.0) * (driven - 1.0))
    }
}

/// Volts in the direction in which a motor turns.
fn along(volts: f32, emf: f32) -> f32 {
    if emf < 0.0 { -volts } else { volts }
}
