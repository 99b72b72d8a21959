//! What the supply leaves of what a motor is asked to do: a stage between its placement and its bridge.

use super::portions::{Given, Portion, Portions};
use crate::braking::{OperatingPoint, Placement, Placer, Regime};
use crate::bridge::Drive;
use crate::units::{Duty, Micros, Millivolts, Share};

/// What the supply allows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Allowed {
    /// How much may be drawn.
    pub(crate) draw: Share,
    /// How far returned energy is to be burnt.
    pub(crate) burn: Share,
    /// The bus by its newest sample.
    pub(crate) bus: Millivolts,
    /// From when on.
    pub(crate) from: Micros,
}

/// The bounds, and the placement that they are put on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    allowed: Allowed,
    /// All may be drawn, and nothing is to be burnt.
    none: bool,
    /// At the last tick, with what could be drawn then; `None` while the motor coasts.
    placed: Option<Placement>,
    /// The same within the bounds of now, where there are any.
    bounded: Option<Placement>,
    /// In which what the motor would return is burnt.
    portions: Portions,
}

/// The speed, with the voltage that a placement was made for; and the speed of now, with that of now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points {
    pub(super) placed: OperatingPoint,
    pub(super) now: OperatingPoint,
    /// How long the bridge is open, in microseconds, when its mode changes.
    pub(super) change_us: u16,
}

impl Bounds {
    /// None.
    pub(super) const NONE: Self = Self {
        allowed: Allowed {
            draw: Share::ALL,
            burn: Share::NONE,
            bus: Millivolts::new(0),
            from: Micros::new(0),
        },
        none: true,
        placed: None,
        bounded: None,
        portions: Portions::NEW,
    };

    /// Takes a tick's placement; says what the bridge does.
    pub(super) fn place(
        &mut self,
        placer: &Placer,
        at: impl FnOnce(Millivolts) -> Points,
        placed: Placement,
    ) -> Placement {
        self.placed = Some(placed);
        if self.none {
            return placed;
        }
        self.bound(placer, at(self.allowed.bus), placed, false)
    }

    fn bound(&mut self, placer: &Placer, at: Points, placed: Placement, turn: bool) -> Placement {
        let drawing = placer.drawing_at_most(placed, self.allowed.draw, at.placed);
        let duty = drawing.drive.duty;
        let returns = drawing.regime == Regime::Braking && duty != Duty::ZERO && duty != Duty::ONE;
        let bounded = match (returns, self.allowed.burn) {
            (false, _) => {
                self.portions.close();
                drawing
            }
            (true, Share::NONE) => {
                self.portions.end(self.allowed.from);
                drawing
            }
            (true, _) => self.portion(placer, at, drawing, turn),
        };
        self.bounded = Some(bounded);
        bounded
    }

    /// What a motor does now that is to brake as in this placement, and to return nothing.
    #[inline(never)]
    fn portion(&mut self, placer: &Placer, at: Points, placed: Placement, turn: bool) -> Placement {
        let (emf, _) = at.now.volts();
        let emf = if at.now.counter_clockwise() { -emf } else { emf };
        self.portions.pass(self.allowed.from);
        let beyond = placer.beyond_emf(self.allowed.burn, at.now).filter(|_| self.allowed.draw == Share::ALL);
        let (portion, placement) = match (self.portions.next(emf, turn), beyond) {
            (Portion::Drive, Some(beyond)) => (Portion::Drive, beyond),
            _ => (Portion::Short, Placement::full_braking(at.now)),
        };
        let wanted = placer.flows(at.placed, placed).to_volts();
        let given = placer.flows(at.now, placement).to_volts();
        self.portions.give(portion, Given { wanted, given, emf }, at.change_us);
        placement
    }

    /// The bridge is open until a placement is taken.
    pub(super) const fn let_go(&mut self) {
        (self.placed, self.bounded) = (None, None);
        self.portions.close();
    }

    /// True if all is allowed.
    pub(super) const fn are_none(&self) -> bool {
        self.none
    }

    /// How much may be drawn.
    pub(super) const fn draw(&self) -> Share {
        self.allowed.draw
    }

    /// `None` unless the motor brakes in portions.
    pub(super) const fn portions(&self) -> Option<&Portions> {
        if !self.none && self.portions.are_given() { Some(&self.portions) } else { None }
    }

    /// Puts other bounds on the last tick's placement; says what the bridge does if that is something else than
    /// before, or one portion of what was asked. More than at the last tick is drawn from the next one on. In its turn a
    /// motor may end a short, and has had its turn then.
    pub(super) fn renew(
        &mut self,
        placer: &Placer,
        at: Option<Points>,
        allowed: Allowed,
        turn: &mut bool,
    ) -> Option<Placement> {
        let before = self.drive();
        let drove = self.portions.drives();
        self.allowed = allowed;
        self.none = (allowed.draw, allowed.burn) == (Share::ALL, Share::NONE);
        let bounded = self.bound(placer, at?, self.placed?, *turn);
        *turn &= drove || !self.portions.drives();
        (bounded.drive != before || self.portions.are_given()).then_some(bounded)
    }

    /// True if the bridge does something else than was asked for.
    pub(super) fn intervenes(&self) -> bool {
        !self.none && self.bounded != self.placed
    }

    /// What the bridge does, if it is told anything.
    pub(super) const fn bounded(&self) -> Option<Placement> {
        if self.none { self.placed } else { self.bounded }
    }

    /// What the bridge is told.
    pub(super) const fn drive(&self) -> Drive {
        match self.bounded() {
            Some(placement) => placement.drive,
            None => Drive::COAST,
        }
    }
}
