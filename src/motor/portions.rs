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
        let drives = if driven > 1.0 { at_most(wanted / emf / driven, 1.0) } else { 0.0 };
        emf.abs() * sqrtf(1.0 - drives + drives * (driven - 1.0) * (driven - 1.0))
    }
}

/// Volts in the direction in which a motor turns.
fn along(volts: f32, emf: f32) -> f32 {
    if emf < 0.0 { -volts } else { volts }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEYOND: f32 = 1.15;

    /// Mean voltage across a motor, and the mean square of the voltage behind its current, while it is looked at every
    /// millisecond; a change of mode opens the bridge for so long.
    fn run(emf: f32, wanted: f32, change_us: u16) -> (f32, f32) {
        const MS: u16 = 2_000;
        let mut portions = Portions::NEW;
        let (mut before, mut mean, mut square) = (Portion::Short, 0.0, 0.0);
        for ms in 0..MS {
            portions.pass(Micros::new(1_000 * u64::from(ms)));
            let portion = portions.next(emf, true);
            let given = if portion == Portion::Drive { BEYOND * emf } else { 0.0 };
            portions.give(portion, Given { wanted, given, emf }, change_us);
            let open = if portion == before { 0.0 } else { f32::from(change_us) / 1_000.0 };
            before = portion;
            mean += (given * (1.0 - open) + emf * open) / f32::from(MS);
            square += (given - emf) * (given - emf) * (1.0 - open) / f32::from(MS);
        }
        assert!((portions.heating() / square.sqrt() - 1.0).abs() < 0.1 || change_us > 0);
        (mean, square)
    }

    #[test]
    fn on_the_mean_a_motor_is_given_what_was_asked_for() {
        for emf in [0.5, 5.0, -9.0] {
            for share in [0.02, 0.3, 0.5, 0.8, 0.95] {
                for change_us in [0, 600] {
                    let (mean, _) = run(emf, share * emf, change_us);
                    let miss = (mean - share * emf).abs() / emf.abs();
                    assert!(miss < 0.01, "{emf} V, {share}, {change_us} us: {miss}");
                }
            }
        }
    }

    #[test]
    fn a_portion_lasts_for_milliseconds() {
        let mut portions = Portions::NEW;
        let (mut changes, mut before) = (0, Portion::Short);
        for ms in 0..1_000 {
            portions.pass(Micros::new(1_000 * ms));
            let portion = portions.next(6.0, true);
            let given = if portion == Portion::Drive { BEYOND * 6.0 } else { 0.0 };
            portions.give(portion, Given { wanted: 3.0, given, emf: 6.0 }, 0);
            changes += u32::from(portion != before);
            before = portion;
        }
        assert!((100..250).contains(&changes), "{changes} in a second");
    }

    #[test]
    fn a_short_ends_only_in_its_turn_and_what_was_braked_too_much_is_made_up_for() {
        let mut portions = Portions::NEW;
        let mut look = |ms: u64, turn| {
            portions.pass(Micros::new(1_000 * ms));
            let portion = portions.next(6.0, turn);
            let given = if portion == Portion::Drive { BEYOND * 6.0 } else { 0.0 };
            portions.give(portion, Given { wanted: 3.0, given, emf: 6.0 }, 0);
            portion
        };
        assert!((0..8).all(|ms| look(ms, false) == Portion::Short));
        let driven = (8..40).take_while(|ms| look(*ms, true) == Portion::Drive).count();
        assert!((8..12).contains(&driven), "for {driven} ms");
    }
}
